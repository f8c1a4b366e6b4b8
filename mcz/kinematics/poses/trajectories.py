"""Positions of points and the root, and their derivatives, from known positions only.

``places`` is (n_frames, n, 3), NaN if unknown; ``steps`` are the seconds from each frame to the
next, (n_frames - 1,), NaN across a break in time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import MotionError, OptionError
from mcz.kinematics.frames import (
    MOTION_CLIP_OR_SKELETON,
    MOTION_OR_CLIP,
    Frames,
    MotionLike,
    as_type,
    frame_poses_of,
    frame_range,
    joint_numbers,
    scale_to,
    values_of,
)
from mcz.kinematics.points import first_points
from mcz.kinematics.points import point_names as names_of_points
from mcz.kinematics.poses.conversions import from_matrices
from mcz.model.checks import FRAMES, check_arguments
from mcz.model.clock import known_timeline
from mcz.model.motion import Skeleton
from mcz.model.skeleton import Joints, column_of, joint_list, signs_of
from mcz.model.text_format import fields_text, suggest_names
from mcz.model.types import Floats, Reals


@check_arguments(motion=MOTION_CLIP_OR_SKELETON)
def point_names(motion: MotionLike | Skeleton, joints: Joints = None) -> tuple[str, ...]:
    """The names of the points whose ``positions`` are given, in their order.

    A name is the joint's, with " end" for an end site of a BVH. The point of an Acclaim joint is
    the end of its bone.
    """
    skeleton = motion if isinstance(motion, Skeleton) else motion.skeleton
    names = names_of_points(skeleton)
    return names if joints is None else tuple(names[p] for p in find_points(skeleton, joints))


def find_points(skeleton: Skeleton, joints: Joints) -> list[int]:
    """The points of these names, and the first point of each joint of these names or indices.

    Raises MotionError for an unknown one.
    """
    names = names_of_points(skeleton)
    if joints is None:
        return list(range(len(names)))
    firsts, points = first_points(skeleton), []
    for joint in joint_list(joints):
        if isinstance(joint, str) and joint in names and joint not in skeleton.addresses():
            points.append(names.index(joint))  # an end site
            continue
        try:
            points.append(firsts[skeleton.find(joint)])
        except MotionError:
            raise MotionError(
                f"no point {joint!r}; the points are {suggest_names(names, joint)}"
            ) from None
    return points


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def positions(
    motion: MotionLike,
    joints: Joints = None,
    frames: Frames = None,
    *,
    unit: str | None = None,
    dtype: DTypeLike = np.float64,
) -> Reals:
    """World positions of the points of a Motion or Clip, (n_frames, n_points, 3).

    ``joints`` by index or name, or points by the names of ``point_names``; None: all points of
    ``point_names``. ``frames`` (a, b) or a slice. In length units of the skeleton, or in ``unit``:
    "mm", "cm", "m", "in", "ft". A point that depends on an invalid value is NaN. Raises
    OptionError, and MotionError if the skeleton has no kinematics: its angle unit is unknown, or
    all of its channels are plain scalars.
    """
    scale = scale_to(motion.skeleton, unit)
    places = _positions(motion, joints, frame_range(motion, frames))
    return as_type(places if scale == 1.0 else places * scale, dtype)


def _positions(motion: MotionLike, joints: Joints, span: tuple[int, int]) -> Floats:
    points = find_points(motion.skeleton, joints)
    poses = frame_poses_of(motion.skeleton)
    needed = poses.above(poses.joints_of(points))
    return poses.positions(values_of(motion, span, needed), points)


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def velocities(
    motion: MotionLike,
    joints: Joints = None,
    frames: Frames = None,
    *,
    unit: str | None = None,
    dtype: DTypeLike = np.float64,
) -> Reals:
    """Velocities of the points, (n_frames, n_points, 3), in length units (or ``unit``) per second.

    Central differences by the times of the frames, (p[t+1] - p[t-1]) / 2 x rate if these are
    uniform; one-sided at the ends of the clip, next to unknown positions and next to breaks in
    time, over which no difference is taken: a frame alone between two breaks has NaN. A part of the
    frames has the same results as the whole. Arguments and errors are those of ``positions``;
    OptionError also if the times are unknown.
    """
    return as_type(_derivative(motion, joints, frames, unit, 1, velocities_of), dtype)


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def accelerations(
    motion: MotionLike,
    joints: Joints = None,
    frames: Frames = None,
    *,
    unit: str | None = None,
    dtype: DTypeLike = np.float64,
) -> Reals:
    """Accelerations of the points, in length units (or ``unit``) per second squared.

    (p[t+1] - 2 p[t] + p[t-1]) x rate^2 if times are uniform; at an end or next to a break in
    time the value of the neighbor frame, NaN in a run of fewer than three. Otherwise as
    ``velocities``.
    """
    return as_type(_derivative(motion, joints, frames, unit, 2, accelerations_of), dtype)


def _derivative(
    motion: MotionLike,
    joints: Joints,
    frames: Frames,
    unit: str | None,
    reach: int,
    derive: Callable[[Floats, Floats], Floats],
) -> Floats:
    """``derive`` of positions and of the seconds between frames, NaN across a break in time.

    Reads ``reach`` frames more on both sides, so that a part has the results of the whole.
    """
    scale = scale_to(motion.skeleton, unit)
    steps = known_timeline(motion.name, motion.timeline).steps
    start, stop = frame_range(motion, frames)
    low, high = max(0, start - reach), min(motion.n_frames, stop + reach)
    places = _positions(motion, joints, (low, high)) * scale
    return derive(places, steps[low : max(low, high - 1)])[start - low : stop - low]


@dataclass(frozen=True, slots=True, eq=False)
class Root:
    """Position and rotation of the root in every frame.

    ``positions`` (n_frames, 3) in length units (or the requested unit), ``rotations`` (n_frames,
    4), quaternions in the world, w first, ``joint`` its name, ``up_axis`` "x" to "-z", or "" while
    unknown.
    """

    joint: str
    positions: Reals
    rotations: Reals
    up_axis: str

    __repr__ = fields_text

    @property
    def headings(self) -> Reals:
        """Rotation of the root about the up axis, (n_frames,), in radians.

        0 in the rest pose, continuous over turns: the twist of the rotation. Raises OptionError
        if the up axis is unknown.
        """
        if not self.up_axis:
            raise OptionError(f"root {self.joint!r}: the up axis is unknown; set it with up=")
        column = column_of(self.up_axis)
        sign = float(signs_of(self.up_axis)[column])
        twist = self.rotations[:, 1 + column].astype(np.float64) * sign
        angles = 2.0 * np.arctan2(twist, self.rotations[:, 0].astype(np.float64))
        known = np.isfinite(angles)
        angles[known] = np.unwrap(angles[known])
        return angles.astype(self.rotations.dtype)


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def root(
    motion: MotionLike,
    frames: Frames = None,
    *,
    joint: int | str | None = None,
    unit: str | None = None,
    dtype: DTypeLike = np.float64,
) -> Root:
    """World position and rotation of the root joint.

    ``joint`` selects another than the first. Raises as ``positions``, and MotionError if the
    skeleton has no joint.
    """
    skeleton, span = motion.skeleton, frame_range(motion, frames)
    scale = scale_to(skeleton, unit)
    (number,) = joint_numbers(skeleton, 0 if joint is None else joint)
    poses = frame_poses_of(skeleton)
    values = values_of(motion, span, poses.above([number]))
    turns = from_matrices(poses.world(values, [number]), "quat")
    return Root(
        skeleton.addresses()[number],
        as_type(poses.origins(values, [number])[:, 0] * scale, dtype),
        as_type(turns[:, 0], dtype),
        skeleton.up_axis,
    )


def velocities_of(places: Floats, steps: Floats) -> Floats:
    """The slope of the parabola through three frames; at an end or break, to the next frame.

    NaN if a frame or both of its neighbors are unknown.
    """
    before, after, first, last = _one_sided_slopes(places, steps)
    with np.errstate(invalid="ignore"):
        velocities: Floats = (before * last + after * first) / (first + last)
    velocities = np.where(np.isnan(velocities), before, velocities)
    return np.where(np.isnan(velocities), after, velocities)


def accelerations_of(places: Floats, steps: Floats) -> Floats:
    """Second derivative of that parabola; at an end or a break in time, the next frame's.

    NaN if a frame is unknown or in a run of fewer than three.
    """
    before, after, first, last = _one_sided_slopes(places, steps)
    with np.errstate(invalid="ignore"):
        inner: Floats = 2.0 * (after - before) / (first + last)
    accelerations = inner.copy()
    missing = np.isnan(accelerations[:-1]) & ~np.isnan(after[:-1])  # the next frame is a neighbor
    accelerations[:-1][missing] = inner[1:][missing]
    missing = np.isnan(accelerations[1:]) & ~np.isnan(before[1:])
    accelerations[1:][missing] = inner[:-1][missing]
    return accelerations


def _one_sided_slopes(places: Floats, steps: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Slopes from the previous frame and to the next, and the seconds between; NaN: none."""
    seconds = np.full((len(places) + 1, 1, 1), np.nan)
    seconds[1:-1, 0, 0] = steps
    slopes = np.full((len(places) + 1, *places.shape[1:]), np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        slopes[1:-1] = np.diff(places, axis=0) / seconds[1:-1]
    return slopes[:-1], slopes[1:], seconds[:-1], seconds[1:]
