"""BVH's joints -> bones of Acclaim: each starts where its parent ends, and carries its own vector.

A joint whose children and end sites all lie at one point is one bone. Any other becomes a bone of
no length, which turns, with a bone for each point that has no channels and leads there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.exchange.conversion.hierarchy import to_bvh
from mcz.kinematics import point_set
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Channel,
    Joint,
    Motion,
    Vector,
)

Ints = NDArray[np.int64]


def to_amc(motion: Motion) -> Motion:
    """``motion`` on Acclaim bones, its angles as they are; unchanged where its own are such.

    Quaternions and rotation vectors become angles, as in BVH.
    """
    if any(c.kind in (*QUATERNION_KINDS, *VECTOR_KINDS) for c in motion.skeleton.channels):
        motion = to_bvh(motion)
    skeleton = motion.skeleton
    if not skeleton.intrinsic:
        return motion
    _check(motion)
    bones = _Bones(motion)
    joints = tuple(bones.joints)
    converted = replace(skeleton, joints=joints, intrinsic=False, base=None, source=None)
    signal = motion.signals[0].of_columns(bones.columns)
    return replace(motion, skeleton=converted, signals=(signal,))


def _check(motion: Motion) -> None:
    """Raises MotionError for what Acclaim's files cannot hold."""
    skeleton = motion.skeleton
    if point_set(skeleton) == "markers":
        raise MotionError("markers have no skeleton, and AMC needs one", clip=motion.name)
    roots = [joint.name for joint in skeleton.joints if joint.parent < 0]
    if len(roots) != 1:
        raise MotionError(f"ASF has one root, and the skeleton has {len(roots)}: {roots[:8]}")
    if not motion.signals[0].has_poses:
        raise MotionError("AMC holds the channels of a skeleton alone", clip=motion.name)
    for joint in skeleton.joints:
        for channel in joint.channels:
            if channel.kind not in POSITION_KINDS + ROTATION_KINDS:
                raise MotionError(f"ASF has no channel {channel.label!r}, as joint {joint.name!r}")


class _Bones:
    """The bones, and for each of their channels the column that it had before."""

    def __init__(self, motion: Motion) -> None:
        self.motion, self.skeleton = motion, motion.skeleton
        self.joints: list[Joint] = []
        self.columns: list[int] = []
        self.names: set[str] = set()
        starts: dict[int, dict[Vector, int]] = {}  # joint -> point below it -> bone that ends there
        offsets = [self._offset(index) for index in range(self.skeleton.n_joints)]
        children: dict[int, list[int]] = {}
        for index, joint in enumerate(self.skeleton.joints):
            children.setdefault(joint.parent, []).append(index)
        for index, joint in enumerate(self.skeleton.joints):
            ends = [offsets[child] for child in children.get(index, [])] + list(joint.tails)
            points = list(dict.fromkeys(ends))
            whole = points[0] if len(points) == 1 and joint.parent >= 0 else None
            parent = -1 if joint.parent < 0 else starts[joint.parent][offsets[index]]
            own = self._turning(index, parent, whole or ORIGIN)
            starts[index] = {whole or ORIGIN: own}
            for number, point in enumerate((p for p in points if p not in starts[index]), 1):
                starts[index][point] = self._leading(joint, own, point, number)

    def _turning(self, index: int, parent: int, tail: Vector) -> int:
        """Add the bone that turns as joint ``index`` does; returns its number."""
        joint = self.skeleton.joints[index]
        columns = self.skeleton.columns(index)
        kinds = [channel.kind for channel in joint.channels]
        moves = [k for k, kind in enumerate(kinds) if kind in POSITION_KINDS]
        turns = [k for k, kind in enumerate(kinds) if kind in ROTATION_KINDS]
        # About turned axes from first to last is about fixed axes from last to first.
        kept = [*(moves if parent < 0 else []), *reversed(turns)]
        self.columns += [columns[k] for k in kept]
        bone = Joint(
            "root" if parent < 0 else self._name(joint.name),
            parent,
            _root_offset(joint) if parent < 0 else self._end(parent),
            () if parent < 0 else (tail,),
            joint.axis,
            joint.axis_order,
            tuple(Channel(kinds[k]) for k in kept),
        )
        return self._add(bone)

    def _leading(self, joint: Joint, own: int, point: Vector, number: int) -> int:
        """Add a bone without channels from the joint to ``point``; returns its number."""
        name = self._name(f"{joint.name}_{number}")
        return self._add(Joint(name, own, self._end(own), (point,)))

    def _add(self, bone: Joint) -> int:
        self.joints.append(bone)
        self.names.add(bone.name)
        return len(self.joints) - 1

    def _end(self, bone: int) -> Vector:
        """Origin of the bones below this one."""
        return self.joints[bone].tails[0] if bone else ORIGIN

    def _name(self, name: str) -> str:
        """``name`` as ASF can hold it, and as no bone has it yet."""
        letters = ("_" if letter <= " " or letter in "()" else letter for letter in name)
        stem = "".join(letters).lstrip("#:") or "joint"
        name, number = stem, 1
        while name in self.names or name == "root":
            number += 1
            name = f"{stem}_{number}"
        return name

    def _offset(self, index: int) -> Vector:
        """The joint's offset; MotionError where position channels change it over time."""
        joint = self.skeleton.joints[index]
        if joint.parent < 0 or not any(c.kind in POSITION_KINDS for c in joint.channels):
            return joint.offset
        offset = list(_root_offset(joint))
        for channel, column in zip(joint.channels, self.skeleton.columns(index), strict=True):
            if channel.kind in POSITION_KINDS:
                track = self.motion.values[:, column]
                if len(track) and not (track == track[0]).all():
                    raise MotionError(
                        f"joint {joint.name!r} has position channels that change, and bones of "
                        "ASF keep their place on their parent"
                    )
                offset[POSITION_KINDS.index(channel.kind)] += float(track[0]) if len(track) else 0.0
        x, y, z = offset
        return x, y, z


def _root_offset(joint: Joint) -> Vector:
    """Offset that position channels of the joint add to."""
    x, y, z = (
        0.0 if not joint.adds_to_offset and Channel(kind) in joint.channels else part
        for kind, part in zip(POSITION_KINDS, joint.offset, strict=True)
    )
    return x, y, z
