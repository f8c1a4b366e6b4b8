"""Joints and their channels, in the order of a file, and the source file that they come from.

SPEC.md, "SKEL", has the stored form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import Protocol

import numpy as np

from mcz.errors import MotionError
from mcz.model import text_format
from mcz.model.checks import (
    DATA,
    HASH,
    INTEGER,
    NAME,
    NUMBER,
    TEXT,
    TRUTH,
    VECTOR,
    Rule,
    check_fields,
    of_type,
    optional,
    several,
)
from mcz.model.types import Floats, Ints


class FrameNotes(Protocol):
    """Notes of a source on each frame, other than its values; a source format defines them."""

    def cut(self, start: int, stop: int) -> bytes:
        """The notes of frames start <= f < stop as bytes of a segment, b"" if there are none."""

    def part(self, start: int, stop: int) -> FrameNotes:
        """The notes of frames start <= f < stop, numbered from 0."""


SOURCE = {
    "format": TEXT,
    "template": DATA,
    "detail": DATA,
    "notes": Rule("notes of frames or None", lambda notes: notes and notes.cut and notes),
    "path": TEXT,
    "size": INTEGER,
    "sha256": HASH,
}


@dataclass(frozen=True, slots=True)
class Source:
    """Data, other than the values, to restore a source file byte for byte.

    ``template`` is shared by clips of the same layout; ``detail`` belongs to this clip; ``notes``
    holds notes on single frames. The source format defines all three.
    """

    format: str
    template: bytes = field(repr=False)
    detail: bytes = b""
    notes: FrameNotes | None = field(default=None, repr=False)
    path: str = ""
    size: int = 0
    sha256: bytes = b""

    __repr__ = text_format.source_text

    def __post_init__(self) -> None:
        check_fields(self, SOURCE)
        if self.size < 0:
            raise MotionError(f"source: size is {self.size}; it must not be negative")

    def without_file(self) -> Source:
        """A copy for changed values or frames: without size and hash."""
        return replace(self, size=0, sha256=b"")

    def cut(self, start: int, stop: int) -> Source:
        """The source of frames start <= f < stop."""
        notes = self.notes and self.notes.part(start, stop)
        return replace(self, notes=notes).without_file()


Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)

POSITION_KINDS = ("tx", "ty", "tz")
ROTATION_KINDS = ("rx", "ry", "rz")
QUATERNION_KINDS = ("qw", "qx", "qy", "qz")
VECTOR_KINDS = ("vx", "vy", "vz")  # of a rotation vector: an axis times an angle
ANGLE_KINDS = (*ROTATION_KINDS, *VECTOR_KINDS)  # whose numbers are angles
TURNING_KINDS = (*ROTATION_KINDS, *QUATERNION_KINDS, *VECTOR_KINDS)
CHANNEL_KINDS = (
    *POSITION_KINDS,
    *ROTATION_KINDS,
    *("sx", "sy", "sz"),
    "length",
    *QUATERNION_KINDS,
    *VECTOR_KINDS,
)


@dataclass(frozen=True, slots=True)
class Channel:
    """One scalar signal over time.

    ``kind`` is a name of ``CHANNEL_KINDS``, or "" for a plain scalar, which then has a ``name``
    and perhaps a ``unit`` of its own and takes no part in kinematics.
    """

    kind: str
    name: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        check_fields(self, CHANNEL)
        if self.kind and self.kind not in CHANNEL_KINDS:
            raise MotionError(f"channel kind {self.kind!r} is not in the registry; use kind ''")

    @property
    def label(self) -> str:
        return self.name or self.kind


CHANNEL = {"kind": TEXT, "name": NAME, "unit": NAME}
CHANNELS = several(of_type(Channel, "a Channel"), "Channels")
JOINT = {
    "name": NAME,
    "parent": INTEGER,
    "offset": VECTOR,
    "tails": several(VECTOR, "vectors of three finite numbers"),
    "axis": VECTOR,
    "axis_order": TEXT,
    "channels": CHANNELS,
    "adds_to_offset": TRUTH,
}


@dataclass(frozen=True, slots=True)
class Joint:
    """A node of the skeleton.

    ``offset`` leads from the parent's origin to the joint's own, in length units, along the
    parent's axes. ``tails`` are the ends of bones without a joint of their own: the ASF bone's
    vector, or BVH end sites, along the joint's axes. ``axis`` are the Euler angles that orient the
    local axes (ASF ``axis``), applied in ``axis_order``, first letter first, about fixed axes.
    ``adds_to_offset``: position channels add to the offset; otherwise they replace it.
    """

    name: str
    parent: int = -1
    offset: Vector = ORIGIN
    tails: tuple[Vector, ...] = ()
    axis: Vector = ORIGIN
    axis_order: str = "XYZ"
    channels: tuple[Channel, ...] = ()
    adds_to_offset: bool = True

    def __post_init__(self) -> None:
        check_fields(self, JOINT)
        if sorted(self.axis_order) != ["X", "Y", "Z"]:
            raise MotionError(
                f"joint {self.name!r}: axis order {self.axis_order!r} is not one such as XYZ"
            )


AXES = ("", "x", "y", "z", "-x", "-y", "-z")
HANDS = ("", "right", "left")


def column_of(axis: str) -> int:
    """The column of an axis of either sign.

    >>> column_of("z"), column_of("-y")
    (2, 1)
    """
    return "xyz".index(axis[-1])


def signs_of(axis: str) -> Floats:
    """Signs of x, y and z that make an axis positive, by half a turn about the previous one.

    >>> signs_of("z").tolist(), signs_of("-z").tolist()
    ([1.0, 1.0, 1.0], [-1.0, 1.0, -1.0])
    """
    signs, column = np.ones(3), column_of(axis)
    if axis.startswith("-"):
        signs[[column, (column + 1) % 3]] = -1.0
    return signs


SKELETON = {
    "joints": several(of_type(Joint, "a joint"), "joints"),
    "name": NAME,
    "unit_cm": optional(NUMBER),
    "angle_unit": TEXT,
    "up_axis": TEXT,
    "forward_axis": TEXT,
    "handedness": TEXT,
    "intrinsic": TRUTH,
    "base": optional(DATA),
    "source": optional(of_type(Source, "a Source")),
}


@dataclass(frozen=True, slots=True)
class Skeleton:
    """The joints of a clip, parents before children, and what their numbers mean.

    ``unit_cm`` is the length of one unit in centimeters, None while unknown; ``angle_unit`` is
    "deg", "rad" or "" (unknown); ``up_axis`` and ``forward_axis``, if a
    figure faces, are "x", "y", "z", "-x", "-y", "-z" or "" (unknown), not parallel; ``handedness``
    of the axes is "right", "left" or "" (unknown). Computations ignore these three.
    ``intrinsic``: the rotation channels of a joint apply about the axes that turn with it, as
    listed (BVH); otherwise about fixed axes (Acclaim).
    ``base`` is the id of the skeleton that this one was derived from.
    """

    joints: tuple[Joint, ...]
    name: str = ""
    unit_cm: float | None = None
    angle_unit: str = "deg"
    up_axis: str = ""
    forward_axis: str = ""
    handedness: str = ""
    intrinsic: bool = True
    base: bytes | None = None
    source: Source | None = field(default=None, compare=False, repr=False)

    __repr__ = text_format.skeleton_text

    def __post_init__(self) -> None:
        check_fields(self, SKELETON)
        for index, joint in enumerate(self.joints):
            if not -1 <= joint.parent < index:  # SKEL-05
                raise MotionError(
                    f"joint {index} ({joint.name!r}): its parent {joint.parent} must precede it"
                )
        if self.unit_cm is not None and self.unit_cm <= 0:  # SKEL-01
            raise MotionError(f"unit_cm is {self.unit_cm}, not a valid length")
        if self.angle_unit not in ("deg", "rad", ""):
            raise MotionError(f"angle unit {self.angle_unit!r} is neither deg nor rad")
        for name in ("up_axis", "forward_axis"):
            axis = getattr(self, name).removeprefix("+")
            if axis not in AXES:
                raise MotionError(
                    f"{name.replace('_', ' ')} {axis!r} is not one of {', '.join(AXES[1:])}"
                )
            object.__setattr__(self, name, axis)
        if self.up_axis and self.up_axis[-1:] == self.forward_axis[-1:]:  # SKEL-10
            raise MotionError(f"up axis {self.up_axis!r} is parallel to the forward axis")
        if self.handedness not in HANDS:
            raise MotionError(f"handedness {self.handedness!r} is neither right nor left")

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels, in column order."""
        return tuple(channel for joint in self.joints for channel in joint.channels)

    @property
    def n_joints(self) -> int:
        return len(self.joints)

    @property
    def n_channels(self) -> int:
        return sum(len(joint.channels) for joint in self.joints)

    @property
    def parents(self) -> Ints:
        """The index of every joint's parent, int64 (n_joints,), -1 of a root."""
        return np.array([joint.parent for joint in self.joints], dtype=np.int64)

    @property
    def offsets(self) -> Floats:
        """From the parent's origin to each joint's own, float64 (n_joints, 3), in length units.

        They lie along axes that turn with the parent and are those of the world in the rest pose.
        """
        return np.array([joint.offset for joint in self.joints], np.float64).reshape(-1, 3)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The name of every joint, made unique as ``addresses`` does."""
        return tuple(self.addresses())

    @property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Children of every joint, in joint order."""
        below: list[list[int]] = [[] for _ in self.joints]
        for index, joint in enumerate(self.joints):
            if joint.parent >= 0:
                below[joint.parent].append(index)
        return tuple(map(tuple, below))

    def columns(self, joint: int) -> range:
        """The columns of joint ``joint``."""
        starts = self.column_starts()
        return range(starts[joint], starts[joint + 1])

    def column_starts(self) -> list[int]:
        """The first column of every joint, and the number of all."""
        return [0, *accumulate(len(joint.channels) for joint in self.joints)]  # SKEL-06

    def addresses(self) -> list[str]:
        """The name of every joint, made unique: ``name#n`` for repeated ones."""
        counts: dict[str, int] = {}
        names = []
        for joint in self.joints:
            counts[joint.name] = n = counts.get(joint.name, -1) + 1
            names.append(joint.name if n == 0 else f"{joint.name}#{n}")
        return names

    def channel_addresses(self) -> list[str]:
        """``joint.channel`` of every channel."""
        joints = zip(self.addresses(), self.joints, strict=True)
        return [f"{name}.{channel.label}" for name, joint in joints for channel in joint.channels]

    def find(self, joint: int | str) -> int:
        """The index of a joint given by index or by name, ``name[#n]`` if a name repeats.

        Raises MotionError if there is no such joint.
        """
        if isinstance(joint, str):
            addresses = self.addresses()
            if joint in addresses:
                return addresses.index(joint)
            if joint.isascii() and joint.isdigit() and len(joint) < 10:
                joint = int(joint)
        if isinstance(joint, (int, np.integer)) and 0 <= joint < self.n_joints:
            return int(joint)
        if not self.joints:
            raise MotionError(f"no joint {joint!r}; the skeleton has none")
        joints = text_format.suggest_names(self.addresses(), joint)
        raise MotionError(f"no joint {joint!r}; the joints are {joints}")


def first_columns(
    channels: Sequence[Channel], kinds: tuple[str, ...], start: int = 0
) -> tuple[int, ...]:
    """The columns of ``kinds``, which turn a joint together; () if one is missing.

    The first channel of each kind counts; ``start`` is the first column of the joint.
    """
    channel_kinds = [channel.kind for channel in channels]
    if not set(kinds) <= set(channel_kinds):
        return ()
    return tuple(start + channel_kinds.index(kind) for kind in kinds)


Chosen = Sequence[int | str] | int | str
Joints = Chosen | None  # None: all


def joint_list(joints: Chosen) -> Sequence[int | str]:
    """Joints as a sequence, also from a single one."""
    return (joints,) if isinstance(joints, (int, np.integer, str)) else joints


def joint_columns(skeleton: Skeleton, joints: Sequence[int | str]) -> list[int]:
    """The columns of the named joints, in the order given."""
    starts = skeleton.column_starts()
    numbers = map(skeleton.find, joints)
    return [c for joint in numbers for c in range(starts[joint], starts[joint + 1])]
