"""Any skeleton -> joints of BVH: axes as the world's at rest, Euler angles, degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.errors import MotionError
from mcz.exchange.conversion.losses import first_gap
from mcz.kinematics.chain import Chain, Floats, multiply_matrices
from mcz.kinematics.points import point_set
from mcz.kinematics.rotations import euler_angles, euler_order
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    TURNING_KINDS,
    VECTOR_KINDS,
    Channel,
    Joint,
    Motion,
    Signal,
    Skeleton,
    Vector,
)
from mcz.model.numbers import Grid, GridKind
from mcz.sources.text.bvh import with_positions

PRINTED = Grid(GridKind.FIXED, 6)  # degrees and units: a millionth of either is far below noise
TINY = 1e-13  # radians; rounding error of an angle of zero
STRETCHING = ("sx", "sy", "sz", "length")
BVH_KINDS = {"", *POSITION_KINDS, *ROTATION_KINDS, "sx", "sy", "sz"}


def to_bvh(motion: Motion, target: str = "BVH") -> Motion:
    """``motion`` on joints of BVH; unchanged if it has such joints.

    ``target`` is the format that errors name.
    """
    skeleton = motion.skeleton
    _check(motion, target)
    if is_bvh(skeleton):
        return _without_offsets(motion)
    Chain(skeleton)  # refuses a skeleton without kinematics
    values = np.asarray(motion.values, np.float64)
    joints: list[Joint] = []
    columns: list[Floats] = []
    numbers: list[int] = []  # of each joint of the skeleton, among ``joints``
    for index, joint in enumerate(skeleton.joints):
        numbers.append(len(joints))
        parent = numbers[joint.parent] if joint.parent >= 0 else -1
        channels, offset = [], joint.offset
        if is_moving(skeleton, index):
            columns += list(_positions(skeleton, index, values))
            channels, offset = [Channel(kind) for kind in POSITION_KINDS], ORIGIN
        order, angles = _angles(skeleton, index, values)
        columns += list(angles.T)
        channels += [Channel(f"r{letter}") for letter in order]
        stretched = is_stretching(joint)
        tails = loose_tails(skeleton, index)
        fixed = () if stretched else tails
        joints.append(Joint(joint.name, parent, offset, fixed, channels=tuple(channels)))
        for number, tail in enumerate(tails if stretched else (), 1):
            columns += list(_tail_positions(skeleton, index, values, tail))
            name = f"{joint.name} end {number}"
            kinds = tuple(Channel(kind) for kind in POSITION_KINDS)
            joints.append(Joint(name, numbers[index], channels=kinds))
    values_of_bvh = np.stack(columns, axis=1) if columns else np.zeros((len(values), 0))
    return _computed_motion(motion, joints, values_of_bvh)


def _computed_motion(motion: Motion, joints: list[Joint], values: Floats) -> Motion:
    signal = Signal(
        values,
        (PRINTED,) * values.shape[1],
        motion.signals[0].name,
        motion.signals[0].samples_per_frame,
    )
    converted = replace(
        motion.skeleton,
        joints=tuple(joints),
        angle_unit="deg",
        intrinsic=True,
        base=None,
        source=None,
    )
    return replace(motion, skeleton=converted, signals=(signal,))


def _without_offsets(motion: Motion) -> Motion:
    """``motion``, its joints without offsets if a reader could misread its positions.

    A BVH does not state whether positions add to the offset; without one both are equal.
    """
    joints = motion.skeleton.joints
    values = np.array(motion.values, np.float64)
    if with_positions(joints, values) == joints:
        return motion
    plain = []
    for index, joint in enumerate(joints):
        offset = list(joint.offset)
        position_columns = [
            (POSITION_KINDS.index(channel.kind), column)
            for channel, column in zip(joint.channels, motion.skeleton.columns(index), strict=True)
            if channel.kind in POSITION_KINDS
        ]
        for component, column in position_columns:
            values[:, column] += offset[component] if joint.adds_to_offset else 0.0
            offset[component] = 0.0
        plain.append(replace(joint, offset=(offset[0], offset[1], offset[2]), adds_to_offset=True))
    return _computed_motion(motion, plain, values)


def is_bvh(skeleton: Skeleton) -> bool:
    """Return True if BVH can express the joints' motion unchanged."""
    turning = any(channel.kind in ROTATION_KINDS for channel in skeleton.channels)
    return (
        skeleton.intrinsic
        and (skeleton.angle_unit == "deg" or not turning)
        and not any(any(joint.axis) for joint in skeleton.joints)
        and all(channel.kind in BVH_KINDS for channel in skeleton.channels)
    )


def _check(motion: Motion, target: str) -> None:
    if point_set(motion.skeleton) == "markers":
        raise MotionError(f"markers have no skeleton, and {target} needs one", clip=motion.name)
    if not motion.signals[0].has_poses:
        raise MotionError(f"{target} can hold only the channels of a skeleton", clip=motion.name)
    if gap := first_gap(motion):
        raise MotionError(f"{target} cannot omit values, but {gap}", clip=motion.name)
    if is_bvh(motion.skeleton):
        return
    for joint in motion.skeleton.joints:
        if any(not channel.kind for channel in joint.channels):
            raise MotionError(
                f"joint {joint.name!r} has plain scalars, and how they move it is unknown"
            )


def is_moving(skeleton: Skeleton, index: int) -> bool:
    """Return True if the joint's position relative to its parent may change; always for a root."""
    joint = skeleton.joints[index]
    own = any(channel.kind in POSITION_KINDS for channel in joint.channels)
    return joint.parent < 0 or own or is_stretching(skeleton.joints[joint.parent])


def is_stretching(joint: Joint) -> bool:
    """Return True if channels of the joint scale its descendants."""
    return any(channel.kind in STRETCHING for channel in joint.channels)


def loose_tails(skeleton: Skeleton, index: int) -> tuple[Vector, ...]:
    """The tails of a joint without a child that begins and stays there."""
    if not skeleton.joints[index].tails:
        return ()
    children = {
        joint.offset
        for joint in skeleton.joints
        if joint.parent == index and not any(c.kind in POSITION_KINDS for c in joint.channels)
    }
    return tuple(tail for tail in skeleton.joints[index].tails if tail not in children)


def _angles(skeleton: Skeleton, index: int, values: Floats) -> tuple[str, Floats]:
    """Axis order and angles, (n_frames, 3) in degrees, of the joint's own rotation C M C^-1."""
    part, columns = _part(skeleton, values, (index, TURNING_KINDS))
    if not len(columns):
        return "zyx", np.zeros((len(values), 3))
    turns = part.pose(columns).axes[0]
    if part.turned[0] is not None:
        turns = multiply_matrices(turns, part.turned[0].T[:, :, None])
    order = euler_order(turns)
    angles = euler_angles(turns, order)
    return order, np.rad2deg(np.where(np.abs(angles) < TINY, 0.0, angles))


def _positions(skeleton: Skeleton, index: int, values: Floats) -> Floats:
    """The joint's origin from its parent's, along the axes of the parent, (3, n_frames)."""
    own, parent = (index, POSITION_KINDS), skeleton.joints[index].parent
    chosen = (own,) if parent < 0 else ((parent, STRETCHING), own)
    part, columns = _part(skeleton, values, *chosen)
    return np.broadcast_to(part.pose(columns).origins[-1], (3, len(values)))


def _tail_positions(skeleton: Skeleton, index: int, values: Floats, tail: Vector) -> Floats:
    """The end of ``tail`` from the joint's origin, along the joint's axes, (3, n_frames)."""
    part, columns = _part(skeleton, values, (index, STRETCHING))
    number = skeleton.joints[index].tails.index(tail)
    position = part.tail(0, number, columns, part.pose(columns))
    return np.broadcast_to(position, (3, len(values)))


def _part(
    skeleton: Skeleton, values: Floats, *chosen: tuple[int, tuple[str, ...]]
) -> tuple[Chain, Floats]:
    """A chain of some joints, with only channels of some kinds, and its values.

    Each joint is (index, kinds) and is the child of the previous one. Joints that do not move are
    at the origin. The values are (n_channels, n_frames).
    """
    joints, numbers = [], []
    for number, (index, kinds) in enumerate(chosen):
        joint = skeleton.joints[index]
        columns = [k for k, channel in enumerate(joint.channels) if channel.kind in kinds]
        numbers += [skeleton.columns(index)[k] for k in columns]
        channels = tuple(joint.channels[k] for k in columns)
        offset = joint.offset if kinds == POSITION_KINDS else ORIGIN
        joints.append(replace(joint, parent=number - 1, offset=offset, channels=channels))
    part = replace(skeleton, joints=tuple(joints), base=None, source=None)
    return Chain(part), np.ascontiguousarray(values[:, numbers].T)


def to_amc(motion: Motion) -> Motion:
    """``motion`` on Acclaim bones, its angles unchanged; unchanged if it has such bones.

    Quaternions and rotation vectors become angles, as in BVH.
    """
    if any(c.kind in (*QUATERNION_KINDS, *VECTOR_KINDS) for c in motion.skeleton.channels):
        motion = to_bvh(motion, "AMC")
    skeleton = motion.skeleton
    if not skeleton.intrinsic:
        return motion
    _check_acclaim(motion)
    bones = _Bones(motion)
    joints = tuple(bones.joints)
    converted = replace(skeleton, joints=joints, intrinsic=False, base=None, source=None)
    signal = motion.signals[0].of_columns(bones.columns)
    return replace(motion, skeleton=converted, signals=(signal,))


def _check_acclaim(motion: Motion) -> None:
    skeleton = motion.skeleton
    if point_set(skeleton) == "markers":
        raise MotionError("markers have no skeleton, and AMC needs one", clip=motion.name)
    roots = [joint.name for joint in skeleton.joints if joint.parent < 0]
    if len(roots) != 1:
        raise MotionError(f"ASF has one root, but the skeleton has {len(roots)}: {roots[:8]}")
    if not motion.signals[0].has_poses:
        raise MotionError("AMC can hold only the channels of a skeleton", clip=motion.name)
    for joint in skeleton.joints:
        for channel in joint.channels:
            if channel.kind not in POSITION_KINDS + ROTATION_KINDS:
                raise MotionError(
                    f"ASF cannot hold channel {channel.label!r} of joint {joint.name!r}"
                )


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
            own = self._add_turning_bone(index, parent, whole or ORIGIN)
            starts[index] = {whole or ORIGIN: own}
            for number, point in enumerate((p for p in points if p not in starts[index]), 1):
                starts[index][point] = self._add_leading_bone(joint, own, point, number)

    def _add_turning_bone(self, index: int, parent: int, tail: Vector) -> int:
        """Add the bone that turns as joint ``index`` does; return its number."""
        joint = self.skeleton.joints[index]
        columns = self.skeleton.columns(index)
        kinds = [channel.kind for channel in joint.channels]
        positions = [k for k, kind in enumerate(kinds) if kind in POSITION_KINDS]
        turns = [k for k, kind in enumerate(kinds) if kind in ROTATION_KINDS]
        # About turned axes from first to last is about fixed axes from last to first.
        channels = [*(positions if parent < 0 else []), *reversed(turns)]
        self.columns += [columns[k] for k in channels]
        bone = Joint(
            "root" if parent < 0 else self._name(joint.name),
            parent,
            _root_offset(joint) if parent < 0 else self._end(parent),
            () if parent < 0 else (tail,),
            joint.axis,
            joint.axis_order,
            tuple(Channel(kinds[k]) for k in channels),
        )
        return self._add(bone)

    def _add_leading_bone(self, joint: Joint, own: int, point: Vector, number: int) -> int:
        """Add a bone without channels from the joint to ``point``; returns its number."""
        name = self._name(f"{joint.name}_{number}")
        return self._add(Joint(name, own, self._end(own), (point,)))

    def _add(self, bone: Joint) -> int:
        self.joints.append(bone)
        self.names.add(bone.name)
        return len(self.joints) - 1

    def _end(self, bone: int) -> Vector:
        return self.joints[bone].tails[0] if bone else ORIGIN

    def _name(self, name: str) -> str:
        """``name`` valid in ASF, and different from all present bones."""
        letters = ("_" if letter <= " " or letter in "()" else letter for letter in name)
        stem = "".join(letters).lstrip("#:") or "joint"
        name, number = stem, 1
        while name in self.names or name == "root":
            number += 1
            name = f"{stem}_{number}"
        return name

    def _offset(self, index: int) -> Vector:
        """The joint's offset; MotionError if position channels change it over time."""
        joint = self.skeleton.joints[index]
        if joint.parent < 0 or not any(c.kind in POSITION_KINDS for c in joint.channels):
            return joint.offset
        offset = list(_root_offset(joint))
        for channel, column in zip(joint.channels, self.skeleton.columns(index), strict=True):
            if channel.kind in POSITION_KINDS:
                track = self.motion.values[:, column]
                if len(track) and not (track == track[0]).all():
                    raise MotionError(
                        f"joint {joint.name!r} moves relative to its parent, which ASF cannot "
                        "express"
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
