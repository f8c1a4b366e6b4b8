"""``mcz decode``: the original file out of an .mcz file, or its numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.clip_selection import ClipSelection, FilteredSelection, PreviewSelection
from mcz.cli.common import (
    Exit,
    Failure,
    JsonRefused,
    damage_of,
    plural,
    say,
)
from mcz.cli.conversion_summary import (
    ConversionSummary,
    rate_change_notes,
    rate_notes,
    summary_facts,
    summary_lines,
)
from mcz.cli.decode_input import SOURCE_GIVEN, Input
from mcz.cli.decode_options import EVENTS, DecodeOptions, check_options, check_signal, refuse
from mcz.cli.decode_output import Output, check_count, deliver
from mcz.cli.options import (
    decoded_option,
    force_option,
    frames_option,
    json_option,
    key_error_option,
    rate_option,
    salvage_option,
    threads_option,
    unit_option,
    up_option,
    where_option,
)
from mcz.cli.suffixes import TARGETS, check_kept, suffix_of, target_of, target_of_clip
from mcz.files.reading.fidelity import CONVERTED, RESTORED
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from fractions import Fraction

    from mcz.exchange.conversion import Fit
    from mcz.exchange.conversion.scenes import SceneFile
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File
    from mcz.model.motion import Motion


@click.command(short_help="Restore the original file, or write its numbers.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    help=(
        "Write to a file, whose suffix sets the format, a folder, or - for standard "
        "output. Default: the source's name, beside FILE.mcz."
    ),
)
@click.option(
    "--clip",
    "names",
    metavar="NAME",
    multiple=True,
    help="Choose a clip (repeatable); needed if there are several.",
)
@where_option
@frames_option("Frames A <= f < B, counted from 0.")
@click.option(
    "--joints", metavar="a,b", help="Write these joints alone, by name or index (with --to)."
)
@click.option(
    "--resolution",
    metavar="K",
    type=click.IntRange(min=0),
    default=0,
    help="Leave out the K finest details.",
)
@click.option(
    "--decimate", is_flag=True, help="Write every 2^K-th frame alone, at the rate divided by 2^K."
)
@click.option(
    "--preview",
    "preview",
    is_flag=True,
    help="Write only frames that need no decoding of the rest (with --to).",
)
@click.option(
    "--post-filter",
    "filtered",
    is_flag=True,
    help="Filter the noise of a coarse codec out of the positions of markers.",
)
@click.option(
    "--to",
    "target",
    type=click.Choice(TARGETS),
    help=(
        "Write numbers, or the motion in another format, instead of the source "
        "file. Default: by the suffix of OUT."
    ),
)
@click.option(
    "--signal",
    metavar="NAME",
    help=("Write another signal, such as analog or outputs, or the events (with --to csv or npz)."),
)
@click.option("--stored", is_flag=True, help="Write words as stored, not in units (with --signal).")
@up_option("Axis that points up, where the clip does not know it (with --to c3d, glb or usda).")
@unit_option("Length unit, where the clip does not know it (with --to another format).")
@key_error_option
@rate_option("Frames a second, in place of the clip's own (with --to, --post-filter).")
@click.option(
    "--solve-ik",
    "solve",
    is_flag=True,
    help="Fit the skeleton of a clip of positions to them (--to amc, bvh, glb or usda).",
)
@click.option("--with-skeleton", is_flag=True, help="Write the skeleton's own file (ASF), too.")
@salvage_option
@click.option(
    "--unverified",
    is_flag=True,
    help="Read only the bytes that are needed; no checksum covers them.",
)
@decoded_option
@force_option
@threads_option
@json_option
def command(
    file: str,
    output: str | None,
    names: tuple[str, ...],
    where: str | None,
    salvage: bool,
    unverified: bool,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Write the original file of a clip, byte for byte, or its numbers, or another format.

    A file without clips gives its skeleton's ASF or its attachment. A source file in place of
    FILE.mcz is converted at once, as by mcz convert.
    """
    wanted = DecodeOptions(**options)
    refuse(unverified and salvage, "--salvage checks all that it reads; leave out --unverified")
    given = Input(file, salvage=salvage, unverified=unverified, max_decoded=max_decoded)
    return decode(given, wanted, output, names=names, where=where, force=force, as_json=as_json)


def decode(
    given: Input,
    wanted: DecodeOptions,
    output: str | None,
    *,
    names: tuple[str, ...],
    where: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write what is wanted of an input, and say what became of it."""
    file, salvage = given.file, given.salvage
    if output == "-" and (as_json or wanted.with_skeleton):
        raise JsonRefused("-o - leaves no room for --json or --with-skeleton", Exit.USAGE)
    if given.is_source:
        given, wanted = given.with_facts(wanted)
        refuse(output is None and wanted.target is None, f"{file}: {SOURCE_GIVEN}")
    if target_of(suffix_of(output)) is None:
        check_options(wanted, salvage)
        check_signal(wanted)
    outputs: list[Output] = []
    summaries: dict[str, ConversionSummary] = {}
    with given.opened() as (held, inputs):
        for clip in _chosen(held, output, names, where):
            found, summaries[clip.name] = _of_clip(
                held, clip, _as_named(clip, output, wanted, salvage)
            )
            outputs += [part for part in found if part not in outputs]  # an ASF that clips share
        if not held.clips:
            _check_plain(file, wanted)
            outputs = [_other(held, names)]
            check_kept(output, outputs[0].name, is_skeleton=outputs[0].kind == "skeleton")
        facts: JsonObject = {"damage": held.damage, "unverified_segments": held.unverified}
    deliver(inputs, output, outputs, force, as_json, facts | summary_facts(summaries))
    if facts["unverified_segments"]:
        say(f"{file}: {plural(facts['unverified_segments'], 'segment')} read in part, not verified")
    for line in summary_lines(summaries):
        say(f"{file}: {line}")
    return damage_of(file, facts["damage"])


def _chosen(
    held: File, output: str | None, names: tuple[str, ...], where: str | None
) -> list[Clip]:
    """The clips that are asked for, or the only one; none where the file has none."""
    if where is not None:
        clips = held.chosen(names or None, where)
    elif not held.clips:
        return []
    else:
        clips = held.clips_called(names) if names else [held.only_clip(None)]
    check_count(output, len(clips))
    return clips


def _as_named(
    clip: Clip, output: str | None, wanted: DecodeOptions, salvage: bool
) -> DecodeOptions:
    """``wanted`` as the suffix of the output says, unless ``--to`` does."""
    if wanted.target is None:
        plain = not (wanted.solve or wanted.preview)
        wanted = wanted._replace(target=target_of_clip(clip, output, plain=plain))
    check_options(wanted, salvage)
    check_signal(wanted)
    return wanted


def _check_plain(file: str, wanted: DecodeOptions) -> None:
    """Raise Failure for options of clips, where the file has none."""
    if wanted.target is not None or wanted.frames is not None or wanted.filtered:
        raise Failure(
            "it has no clips, so --to, --frames and --post-filter do not apply",
            Exit.USAGE,
            path=file,
        )


def _of_clip(
    held: File, clip: Clip, wanted: DecodeOptions
) -> tuple[list[Output], ConversionSummary]:
    """The outputs of a clip, and their summary."""
    target, summary = wanted.target, ConversionSummary()
    part = _part(clip, wanted)
    if target is None:
        outputs = [_source(clip, part)]
        summary.notes = rate_notes(clip, part, wanted)
    elif wanted.is_converted:
        from mcz.exchange.conversion import left_out
        from mcz.files.reading.source_files import SourceOptions

        motion = part.motion()
        if wanted.solve:
            motion, summary.fit = _solved(clip, motion)
        elif target in ("amc", "bvh"):
            _check_moves(clip)
        unit = wanted.unit if motion.skeleton.unit_cm is None else None
        motion = SourceOptions(unit=unit, up=wanted.up).applied_to(motion)
        rate = None if wanted.filtered else wanted.rate
        summary.notes = rate_change_notes(clip, rate)
        if wanted.is_scene:
            summary.scene = _scene(motion, target, rate, wanted)
            outputs = [Output(target, f"{_stem(motion)}.{target}", summary.scene.data, CONVERTED)]
        else:
            outputs = _converted(motion, target, rate, wanted.with_skeleton)
        summary.left_out = left_out(motion, target)
    else:
        outputs = [_export(clip, target, part, wanted)]
        summary.left_out = _beside(clip, wanted)
    if wanted.with_skeleton and target != "amc":
        outputs.append(_skeleton(held, _sourced(held, clip)))
    return outputs, summary


def _part(clip: Clip, wanted: DecodeOptions) -> ClipSelection:
    frames = wanted.frames
    if frames is not None:
        start, stop = frames
        frames = start, clip.n_frames if stop is None else stop
    what = (
        FilteredSelection
        if wanted.filtered
        else PreviewSelection
        if wanted.preview
        else ClipSelection
    )
    return what(clip, frames, wanted.resolution, wanted.decimate, wanted.rate)


def _source(clip: Clip, part: ClipSelection) -> Output:
    path = clip.source.path if clip.source else ""
    data = part.source_bytes()
    name = PurePosixPath(path).name or f"{_stem(clip)}.out"
    return Output("source", name, data, part.fidelity(data))


def _check_moves(clip: Clip) -> None:
    """Raise Failure for positions of a skeleton that is here, too: it can be fitted to them."""
    from mcz.kinematics import point_set

    if clip.skeleton.base and point_set(clip.skeleton) == "markers":
        held = f"{clip.container.source.name}: clip {clip.name!r} holds positions"
        raise Failure(f"{held}; --solve-ik fits its skeleton to them", Exit.USAGE)


def _solved(clip: Clip, motion: Motion) -> tuple[Motion, Fit]:
    """The motion of the clip's base skeleton whose points lie where those of ``motion`` do."""
    from mcz.exchange.conversion import from_positions

    base = clip.base_skeleton
    if base is None:
        raise Failure(
            f"{clip.container.source.name}: clip {clip.name!r} names no skeleton that --solve-ik "
            "could fit to its positions",
            Exit.USAGE,
        )
    return from_positions(motion, base)


def _scene(motion: Motion, target: str, rate: Fraction | None, wanted: DecodeOptions) -> SceneFile:
    """The motion as a file of animated nodes."""
    from mcz.exchange.conversion.scenes import to_scene

    return to_scene(motion, target, key_error_mm=wanted.key_error, rate=rate, unit=wanted.unit)


def _converted(
    motion: Motion, target: str, rate: Fraction | None, with_skeleton: bool
) -> list[Output]:
    """The motion as a plain file of another format, with its ASF where an AMC is to have one."""
    from mcz.exchange.conversion import converted_files

    files = converted_files(motion, target, rate, with_skeleton)
    kinds = {"asf": "skeleton"}
    return [
        Output(kinds.get(s, s), f"{_stem(motion)}.{s}", data, CONVERTED)
        for s, data in files.items()
    ]


def _export(clip: Clip, target: str, part: ClipSelection, wanted: DecodeOptions) -> Output:
    from mcz.files.tables.files import EVENT_EXPORTS, EXPORTS, channel_names, channel_units

    joints = wanted.joints
    chosen = None if joints is None else [joint.strip() for joint in joints.split(",")]
    if wanted.signal == EVENTS and all(each.name != EVENTS for each in clip.signals):
        events = () if clip.recording is None else clip.recording.events
        data = EVENT_EXPORTS[target](part.events(events))
        return Output(target, f"{_stem(clip)}.{target}", data, CONVERTED)
    signal = 0 if wanted.signal is None else clip.find_signal(wanted.signal)
    channels = clip.signals[signal].channels
    names = channel_names(clip.skeleton, channels)
    if wanted.signal is not None:
        units = channel_units(clip.skeleton, channels)
        table = part.of_signal(signal, wanted.stored, names, units)
        return Output(target, f"{_stem(clip)}.{target}", EXPORTS[target](table), CONVERTED)
    if chosen is not None and channels is None:  # else the table says why there are no joints
        skeleton = clip.skeleton
        names = [names[c] for joint in chosen for c in skeleton.columns(skeleton.find(joint))]
    table = part.table(chosen, names)
    if target == "npz" and chosen is None and channels is None and not wanted.preview:
        table = replace(table, motion=part.motion())
    return Output(target, f"{_stem(clip)}.{target}", EXPORTS[target](table), CONVERTED)


def _beside(clip: Clip, wanted: DecodeOptions) -> tuple[str, ...]:
    """The signals that a table does not have, and --signal would write."""
    from mcz.exchange.conversion.losses import of_recording, of_text

    if wanted.signal is not None or wanted.joints is not None:
        return ()
    others = [signal.name for signal in clip.signals[1:]]
    signals = [f"left out: signal {', '.join(others)} (--signal)"] if others else []
    events = " (--signal events)" if clip.recording is not None and clip.recording.events else ""
    told = (f"{text}{events}" for text in of_recording(clip.recording))
    return (*signals, *of_text(clip.metadata), *told)


def _stem(clip: Clip | Motion) -> str:
    """The clip's name without folders, which must not lead out of the output's folder."""
    return PurePosixPath(clip.name).name.strip(".") or "clip"


def _sourced(held: File, clip: Clip) -> bytes:
    """The skeleton of the clip, or its base where that alone has a file of its own."""
    base = clip.base_skeleton
    own = held.skeleton(clip.skeleton_id, with_source=True).source
    has_file = own is None and base is not None and base.source is not None
    return clip.skeleton.base if has_file and clip.skeleton.base else clip.skeleton_id


def _skeleton(held: File, wanted: bytes) -> Output:
    """The skeleton's own file; its name is that of the alias that refers to it."""
    names = [name for name, (_, target) in held.aliases.items() if target == wanted]
    name = PurePosixPath(names[0]).name if names else "skeleton.asf"
    return Output("skeleton", name, held.skeleton_bytes(wanted), RESTORED)


def _other(held: File, wanted: tuple[str, ...]) -> Output:
    """The attachment of the name that is wanted, or the only thing in a file without clips."""
    names = list(held.attachments)
    if len(wanted) > 1:
        raise Failure("no clips; of attachments one is decoded, mcz unpack writes all", Exit.USAGE)
    name = wanted[0] if wanted else None
    if name is None and len(held.skeletons) == 1 and not names:
        return _skeleton(held, held.skeletons[0][0])
    if name is None and len(names) == 1:
        name = names[0]
    if name is None or name not in held.attachments:
        shown = ", ".join(names) or "nothing"
        raise Failure(f"no clips; choose with --clip among {shown}", Exit.USAGE)
    data = held.attachments[name].read()
    return Output("attachment", PurePosixPath(name).name, data, RESTORED)
