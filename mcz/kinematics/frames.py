"""Point positions and joint rotations: ``FramePoses`` of many frames, ``FramePositions`` of one.

Kernels compute them if the skeleton only turns and moves, otherwise ``Chain``: equal to 1e-9.
Motions and clips are accessed alike; a clip decodes only the needed joints and frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import OptionError
from mcz.kinematics.chain import IDENTITY, Chain, SkeletonKey
from mcz.kinematics.frame_kernels import (
    JointTable,
    PointTable,
    place_frames,
    position_points,
    turn_frames,
)
from mcz.kinematics.points import (
    discard_infinite,
    listed_points,
    marker_distance,
    point_position,
    points_and_markers_of,
    points_of,
    positions_of,
)
from mcz.model.checks import FRAMES, ArgumentType, check_arguments
from mcz.model.clock import Timeline, known_timeline
from mcz.model.motion import Motion, Skeleton, check_poses
from mcz.model.skeleton import Joints, joint_columns, joint_list
from mcz.model.text_format import named
from mcz.model.types import Floats, Reals, Values
from mcz.model.units import unit_cm_of


class FramePoses:
    """The poses of a skeleton. Joints and points are given by index, values in source units.

    Values are (n_frames, n_channels); channels of joints that are neither requested nor above a
    requested one are ignored. A result that depends on an invalid value is NaN. Raises as
    ``Chain``.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.chain = Chain(skeleton)
        self._points = list(listed_points(skeleton))
        tails = [
            np.zeros(3) if tail < 0 else self.chain.links[joint].tails[tail]
            for joint, tail in self._points
        ]
        self._tails = np.array(tails).reshape(len(tails), 3)
        self._tables: tuple[JointTable, PointTable] | None = None
        if not is_elaborate(self.chain):
            self._tables = tables_of(self.chain, [joint for joint, _ in self._points], tails)

    def above(self, joints: Sequence[int]) -> list[int]:
        """These joints and all above them, parents before children."""
        ancestors: set[int] = set()
        for joint in joints:
            while joint >= 0 and joint not in ancestors:
                ancestors.add(joint)
                joint = self.chain.links[joint].parent
        return sorted(ancestors)

    def joints_of(self, points: Sequence[int]) -> list[int]:
        """The joints that the points are fastened to."""
        return [self._points[point][0] for point in points]

    def tails(self) -> Floats:
        """From each point's joint to the point at rest, in the world's axes, (n_points, 3)."""
        tails = self._tails.copy()
        for point, (joint, _) in enumerate(self._points):
            own = self.chain.turned[joint]
            if own is not None:
                tails[point] = own @ tails[point]
        return tails

    def positions(self, values: Floats, points: Sequence[int]) -> Floats:
        """Positions of the points, (n_frames, n_points, 3) in length units."""
        out = np.empty((len(values), len(points), 3))
        if self._tables is None:
            for rows, columns, pose in self.chain.poses(values):
                for number, point in enumerate(points):
                    joint, tail = self._points[point]
                    out[rows, number] = point_position(self.chain, joint, tail, columns, pose).T
        else:
            known = self._tables[1]
            chosen = PointTable(known.joints[list(points)], known.tails[list(points)])
            self._place(values, self.joints_of(points), chosen, out, np.empty((0, 0, 3, 3)))
        discard_infinite(out)
        return out

    def origins(self, values: Floats, joints: Sequence[int]) -> Floats:
        """Origins of the joints, (n_frames, n_chosen, 3) in length units."""
        out = np.empty((len(values), len(joints), 3))
        if self._tables is None:
            for rows, _, pose in self.chain.poses(values):
                for number, joint in enumerate(joints):
                    out[rows, number] = pose.origins[joint].T
        else:
            chosen = PointTable(np.array(joints, np.int64), np.zeros((len(joints), 3)))
            self._place(values, joints, chosen, out, np.empty((0, 0, 3, 3)))
        discard_infinite(out)
        return out

    def world(self, values: Floats, joints: Sequence[int]) -> Floats:
        """World rotations W of the joints, (n_frames, n_chosen, 3, 3)."""
        n_joints = len(self.chain.links)
        if self._tables is None:
            out = np.empty((len(values), len(joints), 3, 3))
            for rows, _, pose in self.chain.poses(values):
                for number, joint in enumerate(joints):
                    out[rows, number] = np.moveaxis(pose.axes[joint], 2, 0)
        else:
            kept = np.empty((len(values), n_joints, 3, 3))
            none = PointTable(np.empty(0, np.int64), np.empty((0, 3)))
            self._place(values, joints, none, np.empty((len(values), 0, 3)), kept)
            out = kept[:, list(joints)]
        for number, joint in enumerate(joints):
            own = self.chain.turned[joint]
            if own is not None:
                out[:, number] = out[:, number] @ own.T  # W = B C^-1
        return out

    def local(self, values: Floats, joints: Sequence[int]) -> Floats:
        """Local rotations of the joints, W_parent^-1 W, (n_frames, n_chosen, 3, 3).

        The identity in the rest pose.
        """
        out = np.empty((len(values), len(joints), 3, 3))
        if self._tables is not None:
            turn_frames(_rows(values), self._tables[0], np.array(joints, np.int64), out)
            return out
        columns = np.ascontiguousarray(values.T)
        for number, joint in enumerate(joints):
            own = self.chain.turned[joint]
            axes = IDENTITY if own is None else own[:, :, None]
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                turned = self.chain.apply_turns(self.chain.links[joint], axes, columns, [])
            turned = np.moveaxis(turned, 2, 0)
            out[:, number] = turned if own is None else turned @ own.T
        return out

    def _place(
        self, values: Floats, joints: Sequence[int], points: PointTable, out: Floats, kept: Floats
    ) -> None:
        assert self._tables is not None
        indices = np.array(self.above(joints), np.int64)
        place_frames(_rows(values), self._tables[0], indices, points, out, kept)


def _rows(values: Floats) -> Floats:
    return np.ascontiguousarray(values, np.float64)


def frame_poses_of(skeleton: Skeleton) -> FramePoses:
    """``FramePoses(skeleton)``, prepared once for repeated calls."""
    return _frame_poses_of(SkeletonKey(skeleton))


@lru_cache(maxsize=8)
def _frame_poses_of(key: SkeletonKey) -> FramePoses:
    return FramePoses(key.skeleton)


class FramePositions:
    """Positions of the points of ``skeleton`` and, on request, its virtual markers.

    Maps the channels of a frame, (n_channels,), to (n_places, 3) in length units, NaN if
    unknown. Results equal those of ``places_of`` to 1e-9, with the same errors.
    """

    def __init__(self, skeleton: Skeleton, *, virtual_markers: bool = False) -> None:
        self._skeleton, self._has_markers = skeleton, virtual_markers
        self._distance = marker_distance(skeleton) if virtual_markers else 0.0
        chain = Chain(skeleton)
        own = points_of(skeleton)
        self._numbers = [joint for joint, tails in enumerate(own) for _ in tails]
        tails = [
            np.zeros(3) if tail < 0 else chain.links[joint].tails[tail]
            for joint, joint_tails in enumerate(own)
            for tail in joint_tails
        ]
        self._firsts = [self._numbers.index(joint) for joint in range(skeleton.n_joints)]
        self._tables = None if is_elaborate(chain) else tables_of(chain, self._numbers, tails)

    def __call__(self, values: Floats) -> Floats:
        if self._tables is None:
            return self._from_batch(values)
        n_points, n_joints = len(self._numbers), self._skeleton.n_joints
        out = np.empty((n_points + (3 * n_joints if self._has_markers else 0), 3))
        origins, axes = np.empty((n_joints, 3)), np.empty((n_joints, 3, 3))
        filled = out[:n_points], origins, axes
        position_points(values, *self._tables, *filled)
        if self._has_markers:
            points = out[self._firsts][:, None]
            markers = points + self._distance * np.swapaxes(axes, 1, 2)
            out[n_points:] = markers.reshape(3 * n_joints, 3)
        out[~np.isfinite(out).all(axis=1)] = np.nan
        return out

    def _from_batch(self, values: Floats) -> Floats:
        if self._has_markers:
            both = points_and_markers_of(self._skeleton, values[None])
            positions: Floats = np.concatenate(both, axis=1)[0]
        else:
            positions = positions_of(self._skeleton, values[None])[0]
        return positions


def is_elaborate(chain: Chain) -> bool:
    """Return True if a joint has channels other than rotations and positions, or a repeated one."""
    return any(
        link.is_whole
        or link.scales
        or link.lengths
        or len({component for component, _ in link.moves}) < len(link.moves)
        for link in chain.links
    )


def tables_of(
    chain: Chain, points: list[int], tails: list[Floats]
) -> tuple[JointTable, PointTable]:
    """Skeleton tables for the kernels."""
    links = chain.links
    n_joints = len(links)
    most = max((len(link.turns) for link in links), default=0)
    moves = np.full((n_joints, 3), -1, np.int64)
    turns = np.full((n_joints, max(1, most), 2), -1, np.int64)
    changes, backs, owns = (np.tile(np.eye(3), (n_joints, 1, 1)) for _ in range(3))
    for joint, link in enumerate(links):
        for component, column in link.moves:
            moves[joint, component] = column
        for turn, pair in enumerate(link.turns):
            turns[joint, turn] = pair
        if link.change is not None:
            changes[joint] = link.change[:, :, 0]
        if link.parent_back is not None:
            backs[joint] = link.parent_back
        own = chain.turned[joint]
        if own is not None:
            owns[joint] = own
    joints = JointTable(
        np.array([link.parent for link in links], np.int64),
        changes,
        np.array([link.offset for link in links]).reshape(n_joints, 3),
        backs,
        owns,
        np.array([link.replaces for link in links], np.int64),
        moves,
        turns,
        float(chain.radians),
    )
    return joints, PointTable(np.array(points, np.int64), np.array(tails).reshape(len(points), 3))


Frames = tuple[int | None, int | None] | slice | None


class ClipLike(Protocol):
    """Interface of a Clip as this package uses it."""

    name: str
    n_frames: int

    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def frame_rate(self) -> Fraction | None: ...
    @property
    def signals(self) -> Sequence[Any]: ...
    @property
    def timeline(self) -> Timeline | None: ...
    def read(
        self, frames: tuple[int, int] | None = None, joints: Joints = None, resolution: int = 0
    ) -> Values: ...


MotionLike = Motion | ClipLike

MOTION_OR_CLIP = ArgumentType(
    "a Motion or a Clip", lambda value: hasattr(value, "signals") and hasattr(value, "n_frames")
)
MOTION_CLIP_OR_SKELETON = ArgumentType(
    "a Motion, a Clip or a Skeleton",
    lambda value: isinstance(value, Skeleton) or MOTION_OR_CLIP.accepts(value),
)


def frame_range(motion: MotionLike, frames: Frames) -> tuple[int, int]:
    """Frames a <= f < b, from a pair or a slice; raises OptionError if they are out of range.

    A slice counts as numpy's do: ends may be left out, negative or beyond.
    """
    if isinstance(frames, slice):
        start, stop, step = frames.indices(motion.n_frames)
        if step != 1:
            raise OptionError(
                f"frames is {frames}, but a step is not supported; take every n-th frame of "
                "the result"
            )
        return start, max(start, stop)
    first, end = frames if frames is not None else (None, None)
    start, stop = first or 0, motion.n_frames if end is None else end
    if not 0 <= start <= stop <= motion.n_frames:
        raise OptionError(f"{motion.name!r} has {motion.n_frames} frames, not {start}:{stop}")
    return start, stop


def joint_numbers(skeleton: Skeleton, joints: Joints) -> list[int]:
    """The indices of these joints, None: all; raises MotionError."""
    if joints is None:
        return list(range(skeleton.n_joints))
    return [skeleton.find(joint) for joint in joint_list(joints)]


def values_of(motion: MotionLike, frames: tuple[int, int], joints: Sequence[int]) -> Floats:
    """The channels of these joints, float64 (n_frames, n_channels), NaN if invalid.

    Columns of other joints are undefined. Raises MotionError if the rows of the motion are not
    poses, see ``check_poses``.
    """
    skeleton = motion.skeleton
    check_poses(motion.name, motion.signals[0])
    if isinstance(motion, Motion):
        return np.asarray(motion.signals[0].cut(*frames).masked(), np.float64)
    columns = joint_columns(skeleton, joints)
    if len(columns) == skeleton.n_channels:
        return np.asarray(motion.read(frames), np.float64)
    values = np.zeros((frames[1] - frames[0], skeleton.n_channels))
    if columns:
        values[:, columns] = motion.read(frames, joints=joints)
    return values


def scale_to(skeleton: Skeleton, unit: str | None) -> float:
    """Factor from length units to ``unit`` (cm, m, mm ...); 1 if None.

    Raises OptionError for another unit, and if the skeleton's is unknown.
    """
    if unit is None:
        return 1.0
    unit_cm = unit_cm_of(unit)
    if skeleton.unit_cm is None:
        raise OptionError(
            f"the length unit of {named('skeleton', skeleton.name)} is unknown, so it cannot be "
            f"converted to {unit}; leave out unit=, or set it when reading"
        )
    return skeleton.unit_cm / unit_cm


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def times(motion: MotionLike, frames: Frames = None, *, signal: int | str = 0) -> Floats:
    """The time of every frame of a Motion or Clip in seconds, (n_frames,), never falling.

    Times of a signal of times; else, by frame numbers and rate, from ``first_time`` on or, without
    one, (number - 1) / rate, so that frame 1 is at 0 s. Events are on the same clock. ``signal``,
    by index or name: the times of its samples, evenly spaced from each frame on. ``frames`` (a, b)
    or a slice. Raises OptionError if neither times nor a rate are known.
    """
    start, stop = frame_range(motion, frames)
    timeline = known_timeline(motion.name, motion.timeline)
    per_frame = signal_of(motion, signal).samples_per_frame
    return timeline.samples(per_frame)[start * per_frame : stop * per_frame]


def signal_of(motion: MotionLike, signal: int | str) -> Any:
    """A signal by index or name, the first of its name; raises OptionError."""
    names = [each.name for each in motion.signals]
    if isinstance(signal, str) and signal in names:
        return motion.signals[names.index(signal)]
    if isinstance(signal, str) or not 0 <= signal < len(names):
        raise OptionError(
            f"{motion.name!r} has no signal {signal!r}; its signals are {', '.join(names)}"
        )
    return motion.signals[signal]


def as_type(values: Reals, dtype: DTypeLike) -> Reals:
    """``values`` as float64 or float32; raises OptionError for another type."""
    new_type = np.dtype(dtype)
    if new_type not in (np.float64, np.float32):
        raise OptionError(f"dtype is {new_type}; it must be float64 or float32")
    return values.astype(new_type, copy=False)
