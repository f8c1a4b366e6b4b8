"""Armatures and empties, frame by frame as the dependency graph has them, as motions."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

import mcz

from .armatures import END, JOINT
from .markers import HIDDEN, MARKER, ORDER
from .scenes import METADATA, NAME, RATE, UNIT, UP
from .solving import Facts, Part, motion_of_bones, motion_of_markers
from .spaces import CM_PER_M, TO_Z_UP, UNITS_CM

KEEP = "keep"  # what the import remembered
MICROMETERS = -1  # as many decimals of a length as say a micrometer
MICROMETER_CM = 1e-4
SAME_RATE = 1e-6  # of a rate: Blender keeps it as float32


@dataclass(frozen=True)
class Terms:
    """Terms of an export: the frames ``first`` to ``last``, and the file's metadata."""

    first: int
    last: int
    name: str = ""
    unit: str = KEEP
    up: str = KEEP
    angle_decimals: int = 4
    length_decimals: int = MICROMETERS

    @property
    def frames(self) -> range:
        return range(self.first, self.last + 1)


def things_of(context: Any) -> list[tuple[Any, list[Any]]]:
    """Selected armatures, each with no markers, and empties with those below them.

    Empties that are selected without one above them belong together.
    """
    chosen = [thing for thing in context.selected_objects if thing.type in ("ARMATURE", "EMPTY")]
    found: list[tuple[Any, list[Any]]] = [(t, []) for t in chosen if t.type == "ARMATURE"]
    empties = [thing for thing in chosen if thing.type == "EMPTY"]
    tops = [thing for thing in empties if any(c.type == "EMPTY" for c in thing.children)]
    found += [(t, _in_order(c for c in t.children if c.type == "EMPTY")) for t in tops]
    loose = [thing for thing in empties if thing not in tops and thing.parent not in tops]
    if loose:
        found.append((loose[0].parent or loose[0], _in_order(loose)))
    return found


def most_values(thing: Any, markers: list[Any], n_frames: int) -> int:
    """An estimate, rather too high, of how many numbers ``recorded`` finds."""
    if markers:
        return 3 * len(markers) * n_frames
    joints = [bone for bone in thing.data.bones if END not in bone or JOINT in bone]
    return 3 * (len(joints) + 1) * n_frames  # the root moves, the others turn


def _in_order(markers: Iterable[Any]) -> list[Any]:
    """Markers as they were imported, others after them by name."""
    return sorted(markers, key=lambda marker: (marker.get(ORDER, sys.maxsize), marker.name))


def recorded(
    context: Any, thing: Any, markers: list[Any], terms: Terms, step: Callable[[float], None]
) -> mcz.Motion:
    """The motion of an armature, or of markers; the scene is left at the frame it was at."""
    if not terms.frames:
        raise mcz.OptionError(f"frames {terms.first} to {terms.last}: the last is before the first")
    facts = _facts(context.scene, thing, terms)
    before = context.scene.frame_current, context.scene.frame_subframe
    try:
        frames = _frames(context, terms.frames, step)
        if markers:
            names = [str(marker.get(MARKER, marker.name)) for marker in markers]
            return motion_of_markers(names, _places(markers, frames, len(terms.frames)), facts)
        return _armature(thing, frames, len(terms.frames), facts)
    finally:
        context.scene.frame_set(before[0], subframe=before[1])


def _frames(context: Any, frames: range, step: Callable[[float], None]) -> Iterator[Any]:
    """The dependency graph in each frame."""
    for number, frame in enumerate(frames):
        context.scene.frame_set(frame)
        yield context.evaluated_depsgraph_get()
        if number % 16 == 0:
            step(number / len(frames))


def _facts(scene: Any, thing: Any, terms: Terms) -> Facts:
    try:
        kept = Fraction(thing.get(RATE, "1"))
        unit_cm, up = float(thing.get(UNIT, 1.0)), thing.get(UP, "z")
        metadata = dict(json.loads(thing.get(METADATA, "{}")))
        name = terms.name or str(thing.get(NAME, thing.name))
    except (TypeError, ValueError, ZeroDivisionError):
        raise mcz.OptionError(
            f"{thing.name!r}: its properties mcz_... are not as imported"
        ) from None
    unit_cm = unit_cm if terms.unit == KEEP else UNITS_CM[terms.unit]
    up = up if terms.up == KEEP else terms.up
    if not 0 < unit_cm < math.inf or up not in TO_Z_UP:
        raise mcz.OptionError(f"{thing.name!r}: a unit of {unit_cm} cm, up is {up!r}")
    rate = Fraction(scene.render.fps) / Fraction(scene.render.fps_base)
    rate = kept if abs(rate - kept) <= SAME_RATE * kept else rate.limit_denominator(10_000)
    scale = scene.unit_settings.scale_length * CM_PER_M / unit_cm
    decimals = terms.length_decimals
    if decimals == MICROMETERS:
        decimals = min(9, max(0, math.ceil(math.log10(unit_cm / MICROMETER_CM) - 1e-9)))
    return Facts(name, rate, unit_cm, up, scale, terms.angle_decimals, decimals, metadata)


def _places(markers: list[Any], frames: Iterator[Any], n_frames: int) -> np.ndarray:
    """Marker positions, (n_frames, n, 3), NaN for hidden ones."""
    found = np.full((n_frames, len(markers), 3), np.nan)
    for row, graph in enumerate(frames):
        for number, marker in enumerate(markers):
            if not any(getattr(marker, name) for name in HIDDEN):
                found[row, number] = marker.evaluated_get(graph).matrix_world.translation
    return found


def _armature(thing: Any, frames: Iterator[Any], n_frames: int, facts: Facts) -> mcz.Motion:
    bones = list(thing.data.bones)
    if not bones:
        raise mcz.MotionError(f"{thing.name!r} has no bones")
    matrices = np.empty((n_frames, len(bones), 4, 4))
    buffer = np.empty(16 * len(bones), np.float32)
    for row, graph in enumerate(frames):
        evaluated = thing.evaluated_get(graph)
        evaluated.pose.bones.foreach_get("matrix", buffer)
        local = buffer.reshape(-1, 4, 4).swapaxes(1, 2)  # Blender has columns first
        matrices[row] = np.array(evaluated.matrix_world) @ local
    order = {posed.name: number for number, posed in enumerate(thing.pose.bones)}
    numbers = {bone.name: number for number, bone in enumerate(bones)}
    parts = [
        Part(
            str(bone.get(JOINT, bone.name)),
            numbers[bone.parent.name] if bone.parent else -1,
            np.array(bone.matrix_local, np.float64),
            np.array(bone.tail_local, np.float64),
            matrices[:, order[bone.name]],
            bool(bone.get(END, not bone.children)),
            END in bone and JOINT not in bone,
        )
        for bone in bones
    ]
    return motion_of_bones(parts, facts, _stretch(thing))


def _stretch(thing: Any) -> float:
    """By how much the object of an armature scales it; raises MotionError where that is uneven."""
    x, y, z = thing.matrix_world.to_scale()
    if max(x, y, z) - min(x, y, z) > 1e-4 * max(x, y, z) or min(x, y, z) <= 0:
        raise mcz.MotionError(f"{thing.name!r} is scaled by {x:g}, {y:g}, {z:g}; apply its scale")
    return float(x)
