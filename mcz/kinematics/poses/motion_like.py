"""Common access to a Motion or to a Clip, which decodes only the needed joints and frames."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import OptionError
from mcz.model.clock import Timeline, known_timeline
from mcz.model.motion import Motion, Skeleton, check_poses
from mcz.model.skeleton import Joints, joint_columns, joint_list
from mcz.model.types import Floats, Reals, Values
from mcz.model.units import unit_cm_of

if TYPE_CHECKING:
    from mcz.kinematics.frames import FramePoses

Frames = tuple[int, int] | slice | None


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


def poses_of(skeleton: Skeleton) -> FramePoses:
    """The poses of a skeleton; kernels are loaded on the first call."""
    from mcz.kinematics.frames import frame_poses_of

    return frame_poses_of(skeleton)


def frame_range(moving: MotionLike, frames: Frames) -> tuple[int, int]:
    """Frames a <= f < b, from a pair or a slice; raises OptionError where they are out of range.

    A slice counts as numpy's do: ends may be left out, negative or beyond.
    """
    if isinstance(frames, slice):
        start, stop, step = frames.indices(moving.n_frames)
        if step != 1:
            raise OptionError(
                f"frames is {frames}, but a step is not supported; take every n-th frame of "
                "the result"
            )
        return start, max(start, stop)
    start, stop = frames if frames is not None else (0, moving.n_frames)
    if not 0 <= start <= stop <= moving.n_frames:
        raise OptionError(f"{moving.name!r} has {moving.n_frames} frames, not {start}:{stop}")
    return start, stop


def joint_numbers(skeleton: Skeleton, joints: Joints) -> list[int]:
    """The indices of these joints, None: all; raises MotionError."""
    if joints is None:
        return list(range(skeleton.n_joints))
    return [skeleton.find(joint) for joint in joint_list(joints)]


def values_of(moving: MotionLike, frames: tuple[int, int], joints: Sequence[int]) -> Floats:
    """The channels of these joints, float64 (n_frames, n_channels), NaN where invalid.

    Columns of other joints are undefined. Raises MotionError where the rows of the motion are not
    poses, see ``check_poses``.
    """
    skeleton = moving.skeleton
    check_poses(moving.name, moving.signals[0])
    if isinstance(moving, Motion):
        return np.asarray(moving.signals[0].cut(*frames).masked(), np.float64)
    columns = joint_columns(skeleton, joints)
    if len(columns) == skeleton.n_channels:
        return np.asarray(moving.read(frames), np.float64)
    values = np.zeros((frames[1] - frames[0], skeleton.n_channels))
    if columns:
        values[:, columns] = moving.read(frames, joints=joints)
    return values


def scale_to(skeleton: Skeleton, unit: str | None) -> float:
    """Factor from length units to ``unit`` (cm, m, mm ...); 1 if None.

    Raises OptionError for another unit, and where the skeleton's is unknown.
    """
    if unit is None:
        return 1.0
    unit_cm = unit_cm_of(unit)
    if skeleton.unit_cm is None:
        raise OptionError(
            f"the length unit of skeleton {skeleton.name!r} is unknown, so it cannot be "
            f"converted to {unit}; leave out unit=, or set it when reading"
        )
    return skeleton.unit_cm / unit_cm


def times(moving: MotionLike, frames: Frames = None, *, signal: int | str = 0) -> Floats:
    """The time of every frame of a Motion or Clip in seconds, (n_frames,), never falling.

    Times of a signal of times; else, by frame numbers and rate, from ``first_time`` on or, without
    one, (number - 1) / rate, so that frame 1 is at 0 s. Events are on the same clock. ``signal``,
    by index or name: the times of its samples, evenly spaced from each frame on. ``frames`` (a, b)
    or a slice. Raises OptionError where neither times nor a rate are known.
    """
    start, stop = frame_range(moving, frames)
    timeline = known_timeline(moving.name, moving.timeline)
    per_frame = signal_of(moving, signal).samples_per_frame
    return timeline.samples(per_frame)[start * per_frame : stop * per_frame]


def signal_of(moving: MotionLike, signal: int | str) -> Any:
    """A signal by index or name, the first of its name; raises OptionError."""
    names = [each.name for each in moving.signals]
    if isinstance(signal, str) and signal in names:
        return moving.signals[names.index(signal)]
    if isinstance(signal, str) or not 0 <= signal < len(names):
        raise OptionError(
            f"{moving.name!r} has no signal {signal!r}; its signals are {', '.join(names)}"
        )
    return moving.signals[signal]


def as_type(values: Reals, dtype: DTypeLike) -> Reals:
    """``values`` as float64 or float32; raises OptionError for another type."""
    new_type = np.dtype(dtype)
    if new_type not in (np.float64, np.float32):
        raise OptionError(f"dtype is {new_type}; it must be float64 or float32")
    return values.astype(new_type, copy=False)
