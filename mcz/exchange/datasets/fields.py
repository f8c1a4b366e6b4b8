"""Fields of data sets: a name, a shape, and the computation from the frames of a clip."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import MotionError, OptionError
from mcz.kinematics.frames import FramePoses
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.points import first_points
from mcz.kinematics.poses.trajectories import point_names
from mcz.model.motion import Skeleton
from mcz.model.skeleton import joint_columns
from mcz.model.types import Floats, Reals

Arrays = Mapping[str, Reals]  # features by field

WHOLE = 2**62  # the reach of a field that needs all frames of a clip


@dataclass(frozen=True, slots=True)
class SignalShape:
    """Layout of a signal: the names of its channels, and its samples a frame."""

    channels: tuple[str, ...]
    samples_per_frame: int


@dataclass(frozen=True)
class Subject:
    """The joints, points and signals of a clip that the fields of a data set use.

    ``joints`` and ``points`` are the chosen ones, by index; ``scale`` converts length units of the
    skeleton to the unit of the data set; ``signals`` are by name; ``read_joints`` are the joints
    whose channels a field needs.
    """

    skeleton: Skeleton
    poses: FramePoses | None  # None: no field needs them
    joints: tuple[int, ...]
    points: tuple[int, ...]
    scale: float
    signals: Mapping[str, SignalShape]
    read_joints: tuple[int, ...] = ()

    @property
    def kinematics(self) -> FramePoses:
        assert self.poses is not None
        return self.poses

    @cached_property
    def columns(self) -> list[int]:
        """The channels of ``joints``."""
        return joint_columns(self.skeleton, self.joints)

    @cached_property
    def read_columns(self) -> list[int]:
        return joint_columns(self.skeleton, self.read_joints)

    @cached_property
    def feet(self) -> tuple[int, ...]:
        """The chosen joints that are parts of feet by name; raises OptionError without any."""
        feet = tuple(joint for joint in find_feet(self.skeleton) if joint in self.joints)
        if not feet:
            raise OptionError("no chosen joint is named like a foot")
        return feet

    @cached_property
    def foot_points(self) -> list[int]:
        firsts = first_points(self.skeleton)
        return [firsts[joint] for joint in self.feet]


class Units(NamedTuple):
    """The length unit of a data set, and the up axis of skeletons that do not state theirs."""

    length: str | None = None
    up: str | None = None


class SubjectRows(NamedTuple):
    """Channels of frames, (n_frames, n_channels), and the seconds from each frame to the next.

    ``signals`` are the values of the signals that fields name, (n_frames, n_channels), or
    (n_frames, samples, n_channels) if a frame has several samples.
    """

    values: Floats
    steps: Floats
    signals: Mapping[str, Floats]

    def part(self, start: int, stop: int) -> SubjectRows:
        """Frames start <= f < stop."""
        signals = {name: values[start:stop] for name, values in self.signals.items()}
        return SubjectRows(
            self.values[start:stop], self.steps[start : max(start, stop - 1)], signals
        )


@dataclass(frozen=True, slots=True)
class Field:
    """One array of a window.

    ``shape`` is the shape of a frame; ``names`` the kind of its first axis: "joints", "points",
    "feet", "channels", "signal" or "". ``make`` takes the values of all channels.
    ``reach``: the number of neighbors on either side that it needs, ``WHOLE`` for all;
    ``needs``: the joints whose channels it needs. ``posed``: it needs kinematics. ``lengths``: it
    is in length units, to be scaled. ``signed``: quaternions, whose signs follow from a whole
    window.
    """

    name: str
    names: str
    shape: Callable[[Subject], tuple[int, ...]]
    make: Callable[[Subject, SubjectRows], Floats]
    needs: Callable[[Subject], Iterable[int]]
    reach: int = 0
    posed: bool = True
    lengths: bool = False
    signed: bool = False
    signal: str = ""  # the signal that it is


def names_of(field: Field, subject: Subject) -> tuple[str, ...]:
    """Names of the joints, points or channels of a frame, () for none."""
    skeleton = subject.skeleton
    addresses = skeleton.addresses()
    if field.names == "signal":
        return subject.signals[field.name].channels
    if field.names == "points":
        points = point_names(skeleton)
        return tuple(points[point] for point in subject.points)
    if field.names == "joints":
        return tuple(addresses[joint] for joint in subject.joints)
    if field.names == "feet":
        return tuple(addresses[joint] for joint in subject.feet)
    if field.names == "channels":
        names = skeleton.channel_addresses()
        return tuple(names[column] for column in subject.columns)
    return ()


def features_of(
    fields: Iterable[Field],
    subject: Subject,
    rows: SubjectRows,
    margins: tuple[int, int],
    dtype: DTypeLike,
) -> dict[str, Reals]:
    """The arrays of frames; ``rows`` has ``margins`` more rows before and after."""
    first, last = margins
    arrays = {}
    for each in fields:
        low, high = max(0, first - each.reach), max(0, last - each.reach)
        features = each.make(subject, rows.part(low, len(rows.steps) + 1 - high))
        part = features[first - low : len(features) - (last - high)]
        with np.errstate(over="ignore"):
            arrays[each.name] = np.ascontiguousarray(part, dtype)
        if np.isinf(arrays[each.name]).any() and not np.isinf(part).any():
            raise MotionError(
                f"{each.name}: a value is too large for {np.dtype(dtype)}; choose another dtype"
            )
    return arrays
