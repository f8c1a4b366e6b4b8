"""One motion put into the scene: which axes, units and frames, and what is remembered of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.kinematics.points import point_set

from .armatures import animate, armature_of
from .clips import Loaded
from .markers import empties_of
from .placing import bones_of, markers_of
from .spaces import CM_PER_M, NAME_BYTES, UNITS_CM, cut, holdable

RATE, UNIT, UP = "mcz_rate", "mcz_unit_cm", "mcz_up_axis"  # properties of what was imported
NAME, METADATA = "mcz_clip", "mcz_metadata"


@dataclass(frozen=True)
class Settings:
    """Defaults for facts that the file lacks, and changes to the scene.

    ``sets_rate``: the scene gets the clip's frame rate, and each frame of it one of its own;
    otherwise keys lie where they are in time. ``sets_range``: the scene's range becomes the clip's.
    """

    unit: str = "cm"
    up: str = "y"
    rate: float = 120.0
    start: float = 1.0
    sets_rate: bool = True
    sets_range: bool = True


def put(
    context: Any, loaded: Loaded, settings: Settings, step: Callable[[float], None]
) -> tuple[Any, list[str]]:
    """The motion as a new object of the scene, and what to tell about it."""
    motion, notes = loaded.motion, list(loaded.notes)
    skeleton, called = motion.skeleton, repr(motion.name)
    unit_cm, up, rate = skeleton.unit_cm, skeleton.up_axis, loaded.rate
    if unit_cm is None:
        unit_cm = UNITS_CM[settings.unit]
        notes.append(f"{called}: its length unit is unknown: taken for {settings.unit}")
    if not up:
        up = settings.up
        notes.append(f"{called}: the axis that points up is unknown: taken for {up}")
    if rate is None:
        rate = Fraction(settings.rate).limit_denominator(10**6)
        notes.append(f"{called}: its frame rate is unknown: taken for {float(rate):g}")
    scene, scale = context.scene, unit_cm / CM_PER_M / context.scene.unit_settings.scale_length
    frames = frames_of(scene, loaded.numbers, float(rate), settings)
    name = cut(motion.name.rpartition("/")[2], NAME_BYTES) or "motion"
    if point_set(skeleton) == "markers":
        places, names = markers_of(motion, up, scale), skeleton.addresses()
        made = empties_of(name, names, places, frames, context.collection, step)
    else:
        bones = bones_of(motion, up, scale)
        names = [joint.name for joint in skeleton.joints]
        made = armature_of(name, bones, names, context.collection)
        animate(made, bones, frames, name, step)
    _remember(made, loaded, unit_cm, up, rate)
    return made, notes


def _remember(made: Any, loaded: Loaded, unit_cm: float, up: str, rate: Fraction) -> None:
    """Store on the object the facts that an export needs."""
    made[NAME], made[UNIT], made[UP] = holdable(loaded.motion.name), unit_cm, up
    made[RATE] = str(rate)
    made[METADATA] = json.dumps(dict(loaded.motion.metadata))  # keys may be longer than Blender's


def frames_of(scene: Any, numbers: np.ndarray, rate: float, settings: Settings) -> np.ndarray:
    """Scene times of keys; sets the scene's rate and range as ``settings`` say."""
    if settings.sets_rate:
        render = scene.render
        render.fps = max(1, round(rate))
        render.fps_base = render.fps / rate
        apart = 1.0
    else:
        apart = scene.render.fps / scene.render.fps_base / rate
    first = numbers[0] if len(numbers) else 0
    frames: np.ndarray = settings.start + (numbers - first) * apart
    if settings.sets_range and len(frames):
        scene.frame_start = int(np.floor(frames[0]))
        scene.frame_end = max(scene.frame_start, int(np.ceil(frames[-1] - 1e-6)))
    return frames
