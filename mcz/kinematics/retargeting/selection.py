"""Skeletons with fewer joints, other names, other rest offsets.

Selected joints are baked onto other parents if their own are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mcz.errors import MotionError, OptionError
from mcz.kinematics.chain import Chain, multiply_matrices
from mcz.kinematics.retargeting.joint_maps import check_channels, computed_signal, replace_motion
from mcz.kinematics.retargeting.turns import (
    fill_unknown,
    finite_frames,
    inverse_turns,
    local_turns,
    relative_turns,
    set_local_turns,
)
from mcz.kinematics.rotations import ORDERS, euler_order
from mcz.model.checks import JOINTS, MAPPING, NUMBERS, check_arguments
from mcz.model.motion import (
    A_MOTION,
    MOTION_OR_SKELETON,
    ORIGIN,
    POSITION_KINDS,
    ROTATION_KINDS,
    TURNING_KINDS,
    Channel,
    Joint,
    Motion,
    Signal,
    Skeleton,
    joint_columns,
)
from mcz.model.text_format import suggest_names
from mcz.model.types import Floats

Named = TypeVar("Named", Motion, Skeleton)


@check_arguments(item=MOTION_OR_SKELETON, mapping=MAPPING)
def rename(item: Named, mapping: Mapping[str, str]) -> Named:
    """Rename the joints of a motion or skeleton by ``mapping``, from old name to new.

    Other joints keep their names; if a name repeats, ``name#1`` is the second joint of that
    name, as in ``Skeleton.joint_names``. Numbers stay unchanged. The result has no source: a file's
    text has the old names. Other signals keep the names of their channels.

    Raises OptionError for an unknown joint, and for a name that two joints would have.
    """
    skeleton = item if isinstance(item, Skeleton) else item.skeleton
    names = _names(skeleton, mapping)
    joints = tuple(
        replace(joint, name=name) for joint, name in zip(skeleton.joints, names, strict=True)
    )
    renamed = replace(skeleton, joints=joints, base=None, source=None)
    if isinstance(item, Skeleton):
        return renamed
    return replace_motion(item, renamed, item.signals[0])


def _names(skeleton: Skeleton, mapping: Mapping[str, str]) -> list[str]:
    addresses = skeleton.joint_names
    names = [joint.name for joint in skeleton.joints]
    used: set[int] = set()
    for old, new in mapping.items():
        if old not in addresses:
            raise OptionError(
                f"rename: no joint {old!r}; the joints are {suggest_names(addresses, old)}"
            )
        if not isinstance(new, str) or not new:
            raise OptionError(f"rename: {new!r} is not a valid name for joint {old!r}")
        index = addresses.index(old)
        names[index] = new
        used.add(index)
    for index in sorted(used):
        if names.count(names[index]) > 1:
            addresses_of_name = [
                addresses[k] for k, name in enumerate(names) if name == names[index]
            ]
            raise OptionError(
                f"rename: {len(addresses_of_name)} joints would have the name "
                f"{names[index]!r}: {', '.join(addresses_of_name)}"
            )
    return names


Given = TypeVar("Given", Motion, Skeleton)


@check_arguments(item=MOTION_OR_SKELETON, offsets=NUMBERS)
def with_offsets(item: Given, offsets: ArrayLike, unit_cm: float | None = None) -> Given:
    """A motion or skeleton with these rest offsets, (n_joints, 3), and ``unit_cm`` if given.

    They lead from each parent's origin to the joint's own, along the world's axes at rest. Numbers
    stay unchanged; lengths of bones and so positions of joints change. The result has no source.
    Raises OptionError for another shape, or a number that is not finite.
    """
    skeleton = item if isinstance(item, Skeleton) else item.skeleton
    new_offsets = np.asarray(offsets, np.float64)
    if new_offsets.shape != (skeleton.n_joints, 3) or not np.isfinite(new_offsets).all():
        raise OptionError(
            f"offsets have shape {new_offsets.shape}; {skeleton.n_joints} joints need "
            f"({skeleton.n_joints}, 3) finite numbers"
        )
    joints = tuple(
        replace(joint, offset=(x, y, z))
        for joint, (x, y, z) in zip(skeleton.joints, new_offsets.tolist(), strict=True)
    )
    unit = skeleton.unit_cm if unit_cm is None else unit_cm
    made = replace(skeleton, joints=joints, unit_cm=unit, base=None, source=None)
    return made if isinstance(item, Skeleton) else replace_motion(item, made, item.signals[0])


SCALING = ("sx", "sy", "sz")


@check_arguments(motion=A_MOTION, joints=JOINTS)
def select(
    motion: Motion, joints: str | int | Iterable[str | int], *, allow_translation: bool = False
) -> Motion:
    """``motion`` with only these joints, by name or index, in the order of its skeleton.

    Every joint keeps its position and rotation in the world. The parent of a joint is the nearest
    kept one above it. Numbers are kept bit for bit, with their grids and masks; other signals are
    kept unchanged. The result has no source.

    A joint may be left out if no kept joint is below it. A joint above a kept one may be left out
    if it has no channels that move it, or never leaves rest in this motion: its offset is added to
    the kept one's. Any other is refused, unless ``allow_translation``: then the kept one gets
    position channels and three rotation channels in place of its own, computed, on a grid of 6
    decimals.

    Raises OptionError for an unknown joint, for none at all, and, naming it, for one in between
    that cannot be left out; MotionError if the channels differ from the skeleton's.
    """
    check_channels(motion)
    skeleton = motion.skeleton
    indices = _kept_joints(skeleton, joints)
    above = _parents(skeleton, indices)
    moved = {
        joint: name for joint in indices if (name := _blocking_joint(motion, joint, above[joint]))
    }
    if moved and not allow_translation:
        joint, name = next(iter(moved.items()))
        raise OptionError(
            f"select: joint {name!r} moves {skeleton.joint_names[joint]!r}, which is kept; "
            "keep both, or set allow_translation=True to give the latter position channels"
        )
    numbers = {joint: number for number, joint in enumerate(indices)} | {-1: -1}
    chosen = [
        replace(_fold_offsets(skeleton, joint, above[joint]), parent=numbers[above[joint]])
        for joint in indices
    ]
    signal = motion.signals[0].of_columns(joint_columns(skeleton, indices))
    selected = replace(skeleton, joints=tuple(chosen), base=None, source=None)
    if moved:
        selected, signal = bake_joints(
            motion, {j: above[j] for j in moved}, indices, selected, signal
        )
    return replace_motion(motion, selected, signal)


def _kept_joints(skeleton: Skeleton, joints: str | int | Iterable[str | int]) -> list[int]:
    requested = [joints] if isinstance(joints, (str, int, np.integer)) else list(joints)
    if not requested:
        raise OptionError("select: keep at least one joint")
    indices = set()
    for joint in requested:
        try:
            indices.add(skeleton.find(joint))
        except MotionError:
            names = suggest_names(skeleton.joint_names, joint)
            raise OptionError(f"select: no joint {joint!r}; the joints are {names}") from None
    return sorted(indices)


def _parents(skeleton: Skeleton, indices: list[int]) -> dict[int, int]:
    """Nearest kept ancestor of each kept joint, -1 for none."""
    among_kept, above = set(indices), {}
    for joint in indices:
        parent = skeleton.joints[joint].parent
        while parent >= 0 and parent not in among_kept:
            parent = skeleton.joints[parent].parent
        above[joint] = parent
    return above


def _joints_between(skeleton: Skeleton, joint: int, above: int) -> list[int]:
    between = []
    parent = skeleton.joints[joint].parent
    while parent != above:
        between.append(parent)
        parent = skeleton.joints[parent].parent
    return between


def _blocking_joint(motion: Motion, joint: int, above: int) -> str:
    """The name of a joint in between that cannot be left out, "" if all can."""
    skeleton = motion.skeleton
    between = _joints_between(skeleton, joint, above)
    turning = [k for k in between if not _rests(motion, k)]
    if between and above >= 0:  # it would stretch the longer bone
        kinds = {channel.kind for channel in skeleton.joints[above].channels}
        turning += [above] * bool(kinds & set(SCALING))
    return skeleton.joint_names[turning[0]] if turning else ""


def _rests(motion: Motion, index: int) -> bool:
    """Return True if no channel moves the joint in any frame."""
    joint, values = motion.skeleton.joints[index], motion.values
    for channel, column in zip(joint.channels, motion.skeleton.columns(index), strict=True):
        rest = 1.0 if channel.kind in (*SCALING, "qw") else 0.0
        if channel.kind in POSITION_KINDS and not joint.adds_to_offset:
            rest = joint.offset[POSITION_KINDS.index(channel.kind)]
        if channel.kind and not (values[:, column] == rest).all():
            return False
    return True


def _fold_offsets(skeleton: Skeleton, index: int, above: int) -> Joint:
    """Add the offsets of the joints between it and ``above`` to the joint's own."""
    joint = skeleton.joints[index]
    between = _joints_between(skeleton, index, above)
    base = skeleton.offsets[between[::-1]].sum(axis=0)
    if not base.any():
        return joint
    own = np.array(joint.offset)
    kinds = [channel.kind for channel in joint.channels if channel.kind in POSITION_KINDS]
    if not joint.adds_to_offset:
        own[[POSITION_KINDS.index(kind) for kind in kinds]] = 0.0
    x, y, z = (base + own).tolist()
    return replace(joint, offset=(x, y, z), adds_to_offset=True)


STRETCHING = ("sx", "sy", "sz", "length")


def bake_joints(
    motion: Motion, above: Mapping[int, int], indices: list[int], selected: Skeleton, signal: Signal
) -> tuple[Skeleton, Signal]:
    """``selected`` and ``signal`` with position and rotation channels for some joints.

    ``above`` has, for every joint of ``motion`` to bake, its new parent, or -1; ``indices`` are the
    joints of ``selected`` as joints of ``motion``. Raises OptionError if the new parent
    stretches what is below it.
    """
    skeleton = motion.skeleton
    chain = Chain(skeleton)
    values = np.ascontiguousarray(np.asarray(motion.values, np.float64).T)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        turns = {k: local_turns(chain, k, values) for k in range(skeleton.n_joints)}
        places = _joint_placements(chain, np.asarray(motion.values, np.float64), above)
    joints = list(selected.joints)
    columns: dict[int, Floats] = {}
    for joint, parent in above.items():
        _check(skeleton, parent)
        turn = relative_turns(chain, parent, joint, turns)
        turn = np.broadcast_to(turn, (3, 3, values.shape[1]))
        number = indices.index(joint)
        joints[number] = _baked_joint(skeleton, joints[number], turn)
        columns[number] = np.concatenate([places[joint], _angles(selected, joints[number], turn)])
    baked = replace(selected, joints=tuple(joints))
    return baked, _join_signals(motion, selected, baked, signal, columns)


def _check(skeleton: Skeleton, parent: int) -> None:
    if parent >= 0 and any(c.kind in STRETCHING for c in skeleton.joints[parent].channels):
        raise OptionError(
            f"select: joint {skeleton.joint_names[parent]!r} scales its children, so joints "
            "between it and a kept joint below it must be kept too"
        )


def _joint_placements(chain: Chain, values: Floats, above: Mapping[int, int]) -> dict[int, Floats]:
    """Origin of each joint from its parent's, along the parent's axes, (3, F)."""
    places = {joint: np.empty((3, len(values))) for joint in above}
    for rows, _, pose in chain.poses(values):
        for joint, parent in above.items():
            place = pose.origins[joint]
            if parent >= 0:
                axes, own = pose.axes[parent], chain.turned[parent]
                world = axes if own is None else multiply_matrices(axes, own.T[:, :, None])
                step = place - pose.origins[parent]
                place = multiply_matrices(inverse_turns(world), step[:, None])[:, 0]
            places[joint][:, rows] = place
    return places


def _baked_joint(skeleton: Skeleton, joint: Joint, turn: Floats) -> Joint:
    """The joint with three position channels, three rotation channels, and others of its own."""
    kinds = [c.kind for c in joint.channels if c.kind in TURNING_KINDS]
    order = "".join(kind[1] for kind in kinds)
    if order not in ORDERS or kinds[0] not in ROTATION_KINDS:
        order = euler_order(fill_unknown(turn, finite_frames(turn)))
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


def _join_signals(
    motion: Motion, before: Skeleton, after: Skeleton, signal: Signal, columns: dict[int, Floats]
) -> Signal:
    """``signal`` of ``before``, with ``columns`` of the baked joints, as of ``after``."""
    new = computed_signal(motion, np.concatenate([*columns.values()]).T)
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
    return _join_columns(signal, new).of_columns(order)


def _join_columns(left: Signal, right: Signal) -> Signal:
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
