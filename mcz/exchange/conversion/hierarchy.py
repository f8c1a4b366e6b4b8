"""Any skeleton -> joints of BVH: axes as the world's at rest, Euler angles, degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.errors import MotionError
from mcz.exchange.conversion.losses import first_gap
from mcz.kinematics import point_set
from mcz.kinematics.chain import Chain, Floats, multiply_matrices
from mcz.kinematics.euler import euler_angles, euler_order
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    ROTATION_KINDS,
    TURNING_KINDS,
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
TINY = 1e-13  # radians; what rounding makes of an angle of zero
STRETCHING = ("sx", "sy", "sz", "length")
BVH_KINDS = {"", *POSITION_KINDS, *ROTATION_KINDS, "sx", "sy", "sz"}


def to_bvh(motion: Motion) -> Motion:
    """``motion`` on joints of BVH; unchanged where its own are such."""
    skeleton = motion.skeleton
    _check(motion)
    if is_bvh(skeleton):
        return _unmistakable(motion)
    Chain(skeleton)  # refuses what has no kinematics
    values = np.asarray(motion.values, np.float64)
    joints: list[Joint] = []
    columns: list[Floats] = []
    numbers: list[int] = []  # of each joint of the skeleton, among ``joints``
    for index, joint in enumerate(skeleton.joints):
        numbers.append(len(joints))
        parent = numbers[joint.parent] if joint.parent >= 0 else -1
        channels, offset = [], joint.offset
        if moves(skeleton, index):
            columns += list(_positions(skeleton, index, values))
            channels, offset = [Channel(kind) for kind in POSITION_KINDS], ORIGIN
        order, angles = _angles(skeleton, index, values)
        columns += list(angles.T)
        channels += [Channel(f"r{letter}") for letter in order]
        stretched = stretches(joint)
        tails = loose_tails(skeleton, index)
        fixed = () if stretched else tails
        joints.append(Joint(joint.name, parent, offset, fixed, channels=tuple(channels)))
        for number, tail in enumerate(tails if stretched else (), 1):
            columns += list(_tail_positions(skeleton, index, values, tail))
            name = f"{joint.name} end {number}"
            kinds = tuple(Channel(kind) for kind in POSITION_KINDS)
            joints.append(Joint(name, numbers[index], channels=kinds))
    made = np.stack(columns, axis=1) if columns else np.zeros((len(values), 0))
    return _made(motion, joints, made)


def _made(motion: Motion, joints: list[Joint], values: Floats) -> Motion:
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


def _unmistakable(motion: Motion) -> Motion:
    """``motion``, its joints without offsets where a reader would take its positions otherwise.

    A BVH does not say whether positions add to the offset; without one it makes no difference.
    """
    joints = motion.skeleton.joints
    values = np.array(motion.values, np.float64)
    if with_positions(joints, values) == joints:
        return motion
    plain = []
    for index, joint in enumerate(joints):
        offset = list(joint.offset)
        moves = [
            (POSITION_KINDS.index(channel.kind), column)
            for channel, column in zip(joint.channels, motion.skeleton.columns(index), strict=True)
            if channel.kind in POSITION_KINDS
        ]
        for component, column in moves:
            values[:, column] += offset[component] if joint.adds_to_offset else 0.0
            offset[component] = 0.0
        plain.append(replace(joint, offset=(offset[0], offset[1], offset[2]), adds_to_offset=True))
    return _made(motion, plain, values)


def is_bvh(skeleton: Skeleton) -> bool:
    """Return True if BVH can express the joints' motion unchanged."""
    turning = any(channel.kind in ROTATION_KINDS for channel in skeleton.channels)
    return (
        skeleton.intrinsic
        and (skeleton.angle_unit == "deg" or not turning)
        and not any(any(joint.axis) for joint in skeleton.joints)
        and all(channel.kind in BVH_KINDS for channel in skeleton.channels)
    )


def _check(motion: Motion) -> None:
    """Raises MotionError for what no BVH can hold."""
    if point_set(motion.skeleton) == "markers":
        raise MotionError("markers have no skeleton, and BVH needs one", clip=motion.name)
    if not motion.signals[0].has_poses:
        raise MotionError("BVH holds the channels of a skeleton alone", clip=motion.name)
    if gap := first_gap(motion):
        raise MotionError(f"BVH cannot leave out values, but {gap}", clip=motion.name)
    if is_bvh(motion.skeleton):
        return
    for joint in motion.skeleton.joints:
        if any(not channel.kind for channel in joint.channels):
            raise MotionError(
                f"joint {joint.name!r} has plain scalars, of which is not known how they move it"
            )


def moves(skeleton: Skeleton, index: int) -> bool:
    """Return True if the joint's position relative to its parent may change; always for a root."""
    joint = skeleton.joints[index]
    own = any(channel.kind in POSITION_KINDS for channel in joint.channels)
    return joint.parent < 0 or own or stretches(skeleton.joints[joint.parent])


def stretches(joint: Joint) -> bool:
    """Return True if channels of the joint scale its descendants."""
    return any(channel.kind in STRETCHING for channel in joint.channels)


def loose_tails(skeleton: Skeleton, index: int) -> tuple[Vector, ...]:
    """The tails of a joint at which no child begins and stays."""
    if not skeleton.joints[index].tails:
        return ()
    children = {
        joint.offset
        for joint in skeleton.joints
        if joint.parent == index and not any(c.kind in POSITION_KINDS for c in joint.channels)
    }
    return tuple(tail for tail in skeleton.joints[index].tails if tail not in children)


def _angles(skeleton: Skeleton, index: int, values: Floats) -> tuple[str, Floats]:
    """An order and the angles, (n_frames, 3) in degrees, of the joint's own rotation C M C^-1."""
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
    """A chain of some joints, with channels of some kinds alone, and its values.

    Each joint is (index, kinds) and hangs on the one before. Those that do not move are at the
    origin. The values are (n_channels, n_frames).
    """
    joints, numbers = [], []
    for number, (index, kinds) in enumerate(chosen):
        joint = skeleton.joints[index]
        kept = [k for k, channel in enumerate(joint.channels) if channel.kind in kinds]
        numbers += [skeleton.columns(index)[k] for k in kept]
        channels = tuple(joint.channels[k] for k in kept)
        offset = joint.offset if kinds == POSITION_KINDS else ORIGIN
        joints.append(replace(joint, parent=number - 1, offset=offset, channels=channels))
    part = replace(skeleton, joints=tuple(joints), base=None, source=None)
    return Chain(part), np.ascontiguousarray(values[:, numbers].T)
