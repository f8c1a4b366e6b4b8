"""Motions as scenes of animated nodes, for viewers and tools of animation."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.exchange.conversion.scenes.gltf import build_glb
from mcz.exchange.conversion.scenes.keys import find_keys
from mcz.exchange.conversion.scenes.nodes import Scene, scene_of
from mcz.exchange.conversion.scenes.usda import build_usda
from mcz.files.reading.source_files import SourceOptions
from mcz.hints import Hint
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, Motion
from mcz.model.text_format import fields_text
from mcz.version import VERSION

KEY_ERROR_MM = 0.1
KEY_ERROR_SIZE = 1 / 20_000  # of the figure, if its unit is unknown: 0.1 mm of 2 m
MM_PER_M = 1000.0
WRITERS = {"glb": build_glb, "usda": build_usda}
GENERATOR = f"mcz {VERSION}"
GREATEST = 2.0**100  # of a coordinate, in meters


@dataclass(frozen=True, slots=True)
class SceneFile:
    """A scene as a file: ``data``, and its errors.

    ``key_error`` is the bound that was kept, ``max_error`` the greatest distance of a joint or an
    end of a bone (or a marker) from its place in the motion, over all frames; it is met in
    ``frame`` by ``point``. Both are in mm; in length units of the motion if ``has_unit`` is
    False. ``n_keys`` keys are left of ``n_values``, one a frame and channel. ``notes`` list
    assumptions and omissions.
    """

    data: bytes
    key_error: float
    max_error: float
    frame: int | None
    point: str | None
    n_keys: int
    n_values: int
    has_unit: bool
    notes: tuple[str, ...]

    __repr__ = fields_text


def to_scene(
    motion: Motion,
    to: str,
    *,
    key_error_mm: float | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
) -> SceneFile:
    """``motion`` as a file of the format ``to``, "glb" or "usda"; see those functions."""
    if to not in WRITERS:
        raise OptionError(f"unknown scene format {to!r}; the formats are {', '.join(WRITERS)}")
    motion = SourceOptions(rate=rate, unit=unit, up=up).applied_to(motion)
    if motion.timeline is None:
        raise OptionError(
            f"its frame rate is unknown, but {to.upper()} must state times",
            clip=motion.name,
            hint=Hint.RATE,
        )
    if to == "usda" and key_error_mm:
        raise OptionError("a key error applies only to GLB; USD has a sample in every frame")
    scene = scene_of(motion)
    _check_size(scene)
    bound = 0.0 if to == "usda" else _bound(scene, key_error_mm)
    keys = find_keys(scene, bound)
    scale = MM_PER_M if scene.has_unit else 1.0
    errors = keys.errors
    facts = {
        "source": motion.source.path if motion.source else motion.name,
        "frameRate": float(scene.rate),
        "frames": motion.n_frames,
        "startTime": scene.start,
        "lengthUnitKnown": scene.has_unit,
        "upAxisKnown": bool(motion.skeleton.up_axis),
        "keyError": bound,
        "maxError": errors.error,
        "notes": list(scene.notes),
    }
    return SceneFile(
        WRITERS[to](scene, keys, GENERATOR, facts),
        bound * scale,
        errors.error * scale,
        errors.frame,
        errors.point,
        errors.n_keys,
        errors.n_values,
        scene.has_unit,
        scene.notes,
    )


@check_arguments(motion=A_MOTION)
def to_glb(
    motion: Motion,
    *,
    key_error_mm: float | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
) -> SceneFile:
    """``motion`` as binary glTF 2.0: an animated skeleton with solid bones, or markers.

    Keys are left out if interpolation keeps every joint, end of a bone and marker within
    ``key_error_mm`` in every frame, by default 0.1 mm; if the length unit is unknown, within
    1/20,000 of the figure's size. 0: a key in every frame. ``rate``, ``unit`` ("cm", "m", ...) and
    ``up`` ("x" to "-z") replace the motion's own; if the last two are unknown, a unit becomes a
    meter and y points up, and ``notes`` mention it.

    Raises OptionError if the frame rate is unknown, and if float32 numbers cannot keep the
    bound; MotionError if the skeleton has no kinematics, or lacks a joint in some frame.
    """
    return to_scene(motion, "glb", key_error_mm=key_error_mm, rate=rate, unit=unit, up=up)


@check_arguments(motion=A_MOTION)
def to_usda(
    motion: Motion,
    *,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
) -> SceneFile:
    """``motion`` as USD in text: a UsdSkel skeleton with solid bones, or a sphere a marker.

    Every frame is a sample, so that ``max_error`` is the error of float32 numbers. Arguments and
    errors are as in ``to_glb``.
    """
    return to_scene(motion, "usda", rate=rate, unit=unit, up=up)


def _bound(scene: Scene, key_error_mm: float | None) -> float:
    """Greatest error of keys, in length units of the scene."""
    if key_error_mm is None:
        return KEY_ERROR_MM / MM_PER_M if scene.has_unit else KEY_ERROR_SIZE * scene.size
    if not 0 <= key_error_mm < np.inf:
        raise OptionError(f"key error is {key_error_mm} mm; it must be at least 0")
    if key_error_mm and not scene.has_unit:
        raise OptionError(
            f"its length unit is unknown, so a key error of {key_error_mm:g} mm has no meaning",
            clip=scene.name,
            hint=Hint.UNIT,
        )
    return key_error_mm / MM_PER_M


def _check_size(scene: Scene) -> None:
    for node in scene.nodes:
        places: Any = np.abs(node.places[node.is_visible])
        if not (places < GREATEST).all() or not (np.abs(node.rest) < GREATEST).all():
            raise MotionError(f"node {node.name!r} is too far away for float32")
