"""Summaries of converted outputs, as JSON and text: skeleton fits, scenes, notes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from fractions import Fraction

    from mcz.cli.clip_selection import ClipSelection
    from mcz.cli.decode_options import DecodeOptions
    from mcz.exchange.conversion import Fit
    from mcz.exchange.conversion.scenes import SceneFile
    from mcz.files.reading.clip import Clip


@dataclass(slots=True)
class ConversionSummary:
    """Fit, scene and notes of one converted clip."""

    fit: Fit | None = None
    scene: SceneFile | None = None
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def summary_facts(clips: Mapping[str, ConversionSummary]) -> JsonObject:
    """The ``--json`` facts: "fit" and "scene" of one clip, "fits" and "scenes" by name of several.

    "left_out" has by the names of clips what their formats have no place for, "notes" what else is
    to be known of them.
    """
    fits = {name: _fit(made.fit) for name, made in clips.items() if made.fit is not None}
    scenes = {name: _scene(made.scene) for name, made in clips.items() if made.scene is not None}
    facts: JsonObject = {}
    for key, found in (("fit", fits), ("scene", scenes)):
        if len(found) == 1:
            facts[key] = next(iter(found.values()))
        elif found:
            facts[f"{key}s"] = found
    for key in ("left_out", "notes"):
        texts = {name: list(getattr(made, key)) for name, made in clips.items()}
        texts = {name: found for name, found in texts.items() if found}
        facts |= {key: texts} if texts else {}
    return facts


def summary_lines(clips: Mapping[str, ConversionSummary]) -> Iterator[str]:
    """The same in words, a line a thing."""
    for made in clips.values():
        if made.fit is not None:
            yield _fit_line(made.fit)
        if made.scene is not None:
            yield from _scene_lines(made.scene)
        scene_notes = () if made.scene is None else made.scene.notes
        yield from (text for text in made.left_out if text not in scene_notes)
        yield from made.notes


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


def _scene_lines(scene: SceneFile) -> Iterator[str]:
    unit = "mm" if scene.has_unit else "units"
    at = "" if scene.frame is None else f" (frame {scene.frame}, {scene.point})"
    yield (
        f"keys: {scene.n_keys:,} of {scene.n_values:,}; at most {scene.max_error:.3g} {unit} "
        f"off{at}"
    )
    yield from scene.notes


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


def rate_notes(clip: Clip, part: ClipSelection, wanted: DecodeOptions) -> tuple[str, ...]:
    """Notes on text files whose stated times differ from those of the clip."""
    from mcz.files.reading.rate_notes import text_notes

    if wanted.decimate:
        return ()
    is_file = not wanted.filtered and clip.gives_file(part.frames, wanted.resolution)
    start = part.frames[0] if part.frames else 0
    notes = text_notes(clip, start, is_file=is_file)
    return tuple(f"clip {clip.name}: {note}" for note in notes)


def rate_change_notes(clip: Clip, rate: Fraction | None) -> tuple[str, ...]:
    """A note if ``--rate`` replaces the rate of the clip."""
    own = clip.frame_rate
    if own is None or rate is None or own == rate:
        return ()
    text = f"{float(own):g} frames a second are written as {float(rate):g}, as was asked for"
    return (f"clip {clip.name}: its {text}",)
