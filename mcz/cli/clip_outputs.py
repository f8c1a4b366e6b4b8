"""The outputs of ``mcz decode`` from one clip, and their summary as JSON and text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from mcz.cli.common import Exit, Failure
from mcz.cli.decode_options import (
    EVENTS,
    ClipSelection,
    DecodeOptions,
    FilteredSelection,
    PreviewSelection,
)
from mcz.cli.outputs import Output
from mcz.errors import OptionError
from mcz.files.reading.differences import CONVERTED, RESTORED
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from fractions import Fraction

    from mcz.exchange.conversion import Fit
    from mcz.exchange.conversion.scenes import SceneFile
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File
    from mcz.model.motion import Motion


@dataclass(slots=True)
class ConversionSummary:
    """Fit, scene and notes of one converted clip."""

    fit: Fit | None = None
    scene: SceneFile | None = None
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def clip_outputs(
    file: File, clip: Clip, options: DecodeOptions
) -> tuple[list[Output], ConversionSummary]:
    """The outputs of a clip, and their summary."""
    target, summary = options.target, ConversionSummary()
    part = _select(clip, options)
    if target is None:
        outputs = [_source_output(clip, part)]
        summary.notes = _rate_notes(clip, part, options)
    elif options.is_converted:
        from mcz.exchange.conversion import conversion_losses
        from mcz.exchange.conversion.scenes import to_scene
        from mcz.files.reading.source_files import SourceOptions

        motion = part.motion()
        if options.solve:
            motion, summary.fit = _solve_skeleton(clip, motion)
        elif target in ("amc", "bvh"):
            _refuse_positions(clip)
        unit = options.unit if motion.skeleton.unit_cm is None else None
        motion = SourceOptions(unit=unit, up=options.up).applied_to(motion)
        rate = None if options.filtered else options.rate
        summary.notes = _rate_change_notes(clip, rate)
        if options.is_scene:
            summary.scene = to_scene(
                motion, target, key_error_mm=options.key_error, rate=rate, unit=options.unit
            )
            outputs = [_converted_output(motion, target, summary.scene.data)]
        else:
            outputs = _convert(motion, target, rate, options.with_skeleton)
        summary.left_out = conversion_losses(motion, target)
    else:
        outputs = [_export(clip, target, part, options)]
        summary.left_out = _signals_left_out(clip, options)
    if options.with_skeleton and target != "amc":
        outputs.append(skeleton_output(file, _skeleton_id(file, clip)))
    return outputs, summary


def _select(clip: Clip, options: DecodeOptions) -> ClipSelection:
    frames = options.frames
    if frames is not None:
        start, stop = frames
        frames = start, clip.n_frames if stop is None else stop
    selection = ClipSelection
    if options.filtered:
        from mcz.files.reading.post_filtering import FilteredClip

        clip, selection = FilteredClip(clip, options.rate), FilteredSelection
    elif options.preview:
        selection = PreviewSelection
    return selection(clip, frames, options.resolution, options.decimate, options.rate)


def _source_output(clip: Clip, part: ClipSelection) -> Output:
    path = clip.source.path if clip.source else ""
    data = part.source_bytes()
    name = PurePosixPath(path).name or f"{_stem(clip)}.out"
    return Output("source", name, data, part.fidelity(data))


def _refuse_positions(clip: Clip) -> None:
    """Raise Failure for positions whose skeleton is in the file and can be fitted to them."""
    from mcz.kinematics.points import point_set

    if clip.skeleton.base and point_set(clip.skeleton) == "markers":
        text = f"{clip.container.source.name}: clip {clip.name!r} holds positions"
        raise Failure(f"{text}; --solve-ik fits its skeleton to them", Exit.USAGE)


def _solve_skeleton(clip: Clip, motion: Motion) -> tuple[Motion, Fit]:
    """The motion of the clip's base skeleton whose points lie where those of ``motion`` do."""
    from mcz.exchange.conversion import from_positions

    base = clip.base_skeleton
    if base is None:
        raise Failure(
            f"{clip.container.source.name}: clip {clip.name!r} names no skeleton for "
            "--solve-ik to fit",
            Exit.USAGE,
        )
    return from_positions(motion, base)


def _converted_output(clip: Clip | Motion, suffix: str, data: bytes) -> Output:
    kind = "skeleton" if suffix == "asf" else suffix
    return Output(kind, f"{_stem(clip)}.{suffix}", data, CONVERTED)


def _convert(
    motion: Motion, target: str, rate: Fraction | None, with_skeleton: bool
) -> list[Output]:
    """The motion as a plain file of another format, with its ASF for an AMC."""
    from mcz.exchange.conversion import converted_files

    files = converted_files(motion, target, rate, with_skeleton)
    return [_converted_output(motion, suffix, data) for suffix, data in files.items()]


def _export(clip: Clip, target: str, part: ClipSelection, options: DecodeOptions) -> Output:
    from mcz.files.tables import EVENT_EXPORTS, EXPORTS, channel_names, channel_units

    joints = options.joints
    chosen = None if joints is None else [joint.strip() for joint in joints.split(",")]
    if options.signal == EVENTS and all(each.name != EVENTS for each in clip.signals):
        events = () if clip.recording is None else clip.recording.events
        return _converted_output(clip, target, EVENT_EXPORTS[target](part.events(events)))
    signal = 0 if options.signal is None else clip.find_signal(options.signal)
    channels = clip.signals[signal].channels
    names = channel_names(clip.skeleton, channels)
    if options.signal is not None:
        units = channel_units(clip.skeleton, channels)
        table = part.of_signal(signal, options.stored, names, units)
        return _converted_output(clip, target, EXPORTS[target](table))
    if chosen is not None and channels is None:  # else the table explains why there are no joints
        skeleton = clip.skeleton
        numbers = [skeleton.find(joint) for joint in chosen]
        for joint, number in zip(chosen, numbers, strict=True):
            if numbers.count(number) > 1:
                raise OptionError(f"joint {joint!r} is named twice; name it once")
        names = [names[c] for number in numbers for c in skeleton.columns(number)]
    table = part.table(chosen, names)
    if target == "npz" and chosen is None and channels is None and not options.preview:
        table = replace(table, motion=part.motion())
    return _converted_output(clip, target, EXPORTS[target](table))


def _signals_left_out(clip: Clip, options: DecodeOptions) -> tuple[str, ...]:
    """The signals that a table does not have, and --signal would write."""
    from mcz.exchange.conversion.losses import recording_facts, text_column_note

    if options.signal is not None or options.joints is not None:
        return ()
    others = [signal.name for signal in clip.signals[1:]]
    signals = [f"left out: signal {', '.join(others)} (--signal)"] if others else []
    events = " (--signal events)" if clip.recording is not None and clip.recording.events else ""
    recording = (f"{text}{events}" for text in recording_facts(clip.recording))
    return (*signals, *text_column_note(clip.metadata), *recording)


def _stem(clip: Clip | Motion) -> str:
    """The clip's name without folders, which must not lead out of the output's folder."""
    return PurePosixPath(clip.name).name.strip(".") or "clip"


def _skeleton_id(file: File, clip: Clip) -> bytes:
    """The skeleton of the clip, or its base if only that has a file of its own."""
    base = clip.base_skeleton
    own = file.skeleton(clip.skeleton_id, with_source=True).source
    has_file = own is None and base is not None and base.source is not None
    return clip.skeleton.base if has_file and clip.skeleton.base else clip.skeleton_id


def skeleton_output(file: File, skeleton_id: bytes) -> Output:
    """The skeleton's own file, named by the alias that refers to it."""
    names = (name for name, (_, target) in file.aliases.items() if target == skeleton_id)
    name = PurePosixPath(next(names, "skeleton.asf")).name
    return Output("skeleton", name, file.skeleton_bytes(skeleton_id), RESTORED)


def summary_facts(clips: Mapping[str, ConversionSummary]) -> JsonObject:
    """The ``--json`` facts: "fit" and "scene" of one clip, "fits" and "scenes" by name of several.

    "left_out" lists by clip what the formats cannot hold, "notes" other remarks.
    """
    fits = {name: _fit(clip.fit) for name, clip in clips.items() if clip.fit is not None}
    scenes = {name: _scene(clip.scene) for name, clip in clips.items() if clip.scene is not None}
    facts: JsonObject = {}
    for key, documents in (("fit", fits), ("scene", scenes)):
        if len(documents) == 1:
            (facts[key],) = documents.values()
        elif documents:
            facts[f"{key}s"] = documents
    for key in ("left_out", "notes"):
        texts = {name: list(getattr(clip, key)) for name, clip in clips.items()}
        if any(texts.values()):
            facts[key] = {name: lines for name, lines in texts.items() if lines}
    return facts


def summary_lines(clips: Mapping[str, ConversionSummary]) -> Iterator[str]:
    """The summary as lines of text."""
    for clip in clips.values():
        if clip.fit is not None:
            yield _fit_line(clip.fit)
        scene_notes: tuple[str, ...] = ()
        if clip.scene is not None:
            scene_notes = clip.scene.notes
            yield _scene_line(clip.scene)
            yield from scene_notes
        yield from (text for text in clip.left_out if text not in scene_notes)
        yield from clip.notes


def _scene(scene: SceneFile) -> JsonObject:
    unit = "_mm" if scene.has_unit else ""
    return {
        f"key_error{unit}": scene.key_error,
        f"max_error{unit}": scene.max_error,
        "frame": scene.frame,
        "point": scene.point,
        "n_keys": scene.n_keys,
        "n_values": scene.n_values,
        "notes": list(scene.notes),
    }


def _scene_line(scene: SceneFile) -> str:
    unit = "mm" if scene.has_unit else "units"
    at = "" if scene.frame is None else f" (frame {scene.frame}, {scene.point})"
    keys = f"keys: {scene.n_keys:,} of {scene.n_values:,}"
    return f"{keys}; at most {scene.max_error:.3g} {unit} off{at}"


def _fit(fit: Fit) -> JsonObject:
    keys = ("mean_error", "max_error", "marker_mean_error", "marker_max_error")
    distances = {name: getattr(fit, name) for key in keys for name in (key, f"{key}_cm")}
    return {
        "n_points": fit.n_points,
        "n_markers": fit.n_markers,
        **distances,
        "frame": fit.frame,
        "point": fit.point,
        "unsolved": list(fit.unsolved),
    }


def _fit_line(fit: Fit) -> str:
    scale, unit = (1.0, "units") if fit.unit_cm is None else (fit.unit_cm, "cm")
    if fit.mean_error is None or fit.max_error is None:
        text = "inverse kinematics: no position is known"
    else:
        text = (
            f"inverse kinematics: {fit.n_points} points {fit.mean_error * scale:.3g} {unit} off on "
            f"average, at most {fit.max_error * scale:.3g} {unit} (frame {fit.frame}, {fit.point})"
        )
    if fit.marker_mean_error is not None and fit.marker_max_error is not None:
        text += (
            f"; {fit.n_markers} virtual markers {fit.marker_mean_error * scale:.3g}, at most "
            f"{fit.marker_max_error * scale:.3g} {unit}"
        )
    if fit.unsolved:
        text += f"; left at 0: {', '.join(fit.unsolved)}"
    return text


def _rate_notes(clip: Clip, part: ClipSelection, options: DecodeOptions) -> tuple[str, ...]:
    """Notes on text files whose stated times differ from the clip's."""
    from mcz.files.reading.differences import text_notes

    if options.decimate:
        return ()
    is_file = not options.filtered and clip.can_restore(part.frames, options.resolution)
    start = part.frames[0] if part.frames else 0
    notes = text_notes(clip, start, is_file=is_file)
    return tuple(f"clip {clip.name}: {note}" for note in notes)


def _rate_change_notes(clip: Clip, rate: Fraction | None) -> tuple[str, ...]:
    """A note if ``--rate`` replaces the rate of the clip."""
    own = clip.frame_rate
    if own is None or rate is None or own == rate:
        return ()
    text = f"{float(own):g} frames a second are written as {float(rate):g}, as requested"
    return (f"clip {clip.name}: its {text}",)
