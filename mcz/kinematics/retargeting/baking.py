"""Joints on another parent, held in place by channels of their own, computed frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcz.errors import OptionError
from mcz.kinematics.chain import Chain, Floats, multiply_matrices
from mcz.kinematics.euler import ORDERS, euler_order
from mcz.kinematics.retargeting.channels import computed
from mcz.kinematics.retargeting.turns import (
    back,
    finite,
    held,
    local_turns,
    relative,
    set_local_turns,
)
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
)

STRETCHING = ("sx", "sy", "sz", "length")


def baked(
    motion: Motion, above: Mapping[int, int], kept: list[int], selected: Skeleton, signal: Signal
) -> tuple[Skeleton, Signal]:
    """``selected`` and ``signal`` with position and rotation channels that hold some joints.

    ``above`` has, of every joint of ``motion`` to be held, the one that it hangs on now, or -1;
    ``kept`` are the joints of ``selected`` as those of ``motion``. Raises OptionError where that
    one stretches what hangs on it.
    """
    skeleton = motion.skeleton
    chain = Chain(skeleton)
    values = np.ascontiguousarray(np.asarray(motion.values, np.float64).T)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        turns = {k: local_turns(chain, k, values) for k in range(skeleton.n_joints)}
        places = _places(chain, np.asarray(motion.values, np.float64), above)
    joints = list(selected.joints)
    columns: dict[int, Floats] = {}
    for joint, parent in above.items():
        _check(skeleton, parent)
        turn = relative(chain, parent, joint, turns)
        turn = np.broadcast_to(turn, (3, 3, values.shape[1]))
        number = kept.index(joint)
        joints[number] = _held_joint(skeleton, joints[number], turn)
        columns[number] = np.concatenate([places[joint], _angles(selected, joints[number], turn)])
    made = replace(selected, joints=tuple(joints))
    return made, _joined(motion, selected, made, signal, columns)


def _check(skeleton: Skeleton, parent: int) -> None:
    if parent >= 0 and any(c.kind in STRETCHING for c in skeleton.joints[parent].channels):
        raise OptionError(
            f"select: joint {skeleton.joint_names[parent]!r} stretches what hangs on it, so that "
            "joints between it and one below it cannot be left out"
        )


def _places(chain: Chain, values: Floats, above: Mapping[int, int]) -> dict[int, Floats]:
    """Origin of each joint from its parent's, along the parent's axes, (3, F)."""
    places = {joint: np.empty((3, len(values))) for joint in above}
    for rows, _, pose in chain.poses(values):
        for joint, parent in above.items():
            place = pose.origins[joint]
            if parent >= 0:
                axes, own = pose.axes[parent], chain.turned[parent]
                world = axes if own is None else multiply_matrices(axes, own.T[:, :, None])
                step = place - pose.origins[parent]
                place = multiply_matrices(back(world), step[:, None])[:, 0]
            places[joint][:, rows] = place
    return places


def _held_joint(skeleton: Skeleton, joint: Joint, turn: Floats) -> Joint:
    """The joint with three position channels, three rotation channels, and others of its own."""
    kinds = [c.kind for c in joint.channels if c.kind in TURNING_KINDS]
    order = "".join(kind[1] for kind in kinds)
    if order not in ORDERS or kinds[0] not in ROTATION_KINDS:
        order = euler_order(held(turn, finite(turn)))
        order = order if skeleton.intrinsic else order[::-1]
    others = tuple(c for c in joint.channels if c.kind not in (*TURNING_KINDS, *POSITION_KINDS))
    own = tuple(Channel(kind) for kind in (*POSITION_KINDS, *(f"r{letter}" for letter in order)))
    return replace(joint, offset=ORIGIN, channels=own + others, adds_to_offset=True)


def _angles(selected: Skeleton, joint: Joint, turn: Floats) -> Floats:
    """The values of the three rotation channels of ``joint``, (3, F), for its turns."""
    alone = replace(joint, parent=-1, channels=joint.channels[3:6])
    chain = Chain(replace(selected, joints=(alone,)))
    columns = np.zeros((3, turn.shape[2]))
    set_local_turns(chain, 0, turn, columns)
    return columns


def _joined(
    motion: Motion, before: Skeleton, after: Skeleton, signal: Signal, columns: dict[int, Floats]
) -> Signal:
    """``signal`` of ``before``, with ``columns`` of the joints that were held, as of ``after``."""
    new = computed(motion, np.concatenate([*columns.values()]).T)
    first = signal.n_channels
    order: list[int] = []
    for number, joint in enumerate(before.joints):
        own = list(before.columns(number))
        if number in columns:
            order += range(first, first + 6)
            first += 6
            kinds = (*TURNING_KINDS, *POSITION_KINDS)
            own = [k for k, c in zip(own, joint.channels, strict=True) if c.kind not in kinds]
        order += own
    assert len(order) == after.n_channels
    return _beside(signal, new).of_columns(order)


def _beside(left: Signal, right: Signal) -> Signal:
    """The columns of two signals of as many rows."""
    masks = [
        np.ones(part.values.shape, np.bool_) if part.mask is None else part.mask
        for part in (left, right)
    ]
    mask = np.concatenate(masks, axis=1)
    return Signal(
        np.concatenate([left.values, right.values], axis=1),
        left.grids + right.grids,
        left.name,
        left.samples_per_frame,
        None if mask.all() else mask,
        left.exceptions,
        left.grid_changes,
    )
