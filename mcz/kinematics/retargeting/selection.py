"""Some joints of a motion alone, where they were."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kinematics.retargeting.baking import baked
from mcz.kinematics.retargeting.channels import check_channels, edited
from mcz.model.motion import POSITION_KINDS, Joint, Motion, Skeleton, joint_columns
from mcz.model.text_format import among

SCALING = ("sx", "sy", "sz")


def select(
    motion: Motion, joints: str | int | Iterable[str | int], *, allow_translation: bool = False
) -> Motion:
    """``motion`` with these joints alone, by name or index, in the order of its skeleton.

    Every joint stays where it was, and turned as it was. The parent of a joint is the nearest one
    above it that is kept. Numbers are kept bit for bit, with their grids and masks; other signals
    are kept as they are. What is returned has no source.

    What is left out may be anything that no kept joint hangs on. A joint above a kept one may be
    left out where it has no channels that move it, or never leaves rest in this motion: its offset
    is added to that of the kept one. Any other is refused, unless ``allow_translation``: then the
    kept one gets position channels and three rotation channels in place of its own, computed, on a
    grid of 6 decimals.

    Raises OptionError for a joint that is not there, for none at all, and, naming it, for one in
    between that cannot be left out; MotionError where the channels are not those of the skeleton.
    """
    check_channels(motion)
    skeleton = motion.skeleton
    kept = _kept(skeleton, joints)
    above = _parents(skeleton, kept)
    moved = {joint: name for joint in kept if (name := _obstacle(motion, joint, above[joint]))}
    if moved and not allow_translation:
        joint, name = next(iter(moved.items()))
        raise OptionError(
            f"select: joint {name!r} moves {skeleton.joint_names[joint]!r}, which is kept; keep it "
            "too, or allow_translation=True gives that one position channels"
        )
    numbers = {joint: number for number, joint in enumerate(kept)} | {-1: -1}
    chosen = [
        replace(_folded(skeleton, joint, above[joint]), parent=numbers[above[joint]])
        for joint in kept
    ]
    signal = motion.signals[0].of_columns(joint_columns(skeleton, kept))
    selected = replace(skeleton, joints=tuple(chosen), base=None, source=None)
    if moved:
        selected, signal = baked(motion, {j: above[j] for j in moved}, kept, selected, signal)
    return edited(motion, selected, signal)


def _kept(skeleton: Skeleton, joints: str | int | Iterable[str | int]) -> list[int]:
    named = [joints] if isinstance(joints, (str, int, np.integer)) else list(joints)
    if not named:
        raise OptionError("select: no joint is to be kept")
    kept = set()
    for joint in named:
        try:
            kept.add(skeleton.find(joint))
        except MotionError:
            names = among(skeleton.joint_names, joint)
            raise OptionError(f"select: no joint {joint!r} among {names}") from None
    return sorted(kept)


def _parents(skeleton: Skeleton, kept: list[int]) -> dict[int, int]:
    """Nearest kept ancestor of each kept joint, -1 for none."""
    among_kept, above = set(kept), {}
    for joint in kept:
        parent = skeleton.joints[joint].parent
        while parent >= 0 and parent not in among_kept:
            parent = skeleton.joints[parent].parent
        above[joint] = parent
    return above


def _between(skeleton: Skeleton, joint: int, above: int) -> list[int]:
    """The joints between a joint and one above it, from the lowest up."""
    between = []
    parent = skeleton.joints[joint].parent
    while parent != above:
        between.append(parent)
        parent = skeleton.joints[parent].parent
    return between


def _obstacle(motion: Motion, joint: int, above: int) -> str:
    """The name of a joint that keeps those between from being left out, "" where none does."""
    skeleton = motion.skeleton
    between = _between(skeleton, joint, above)
    moving = [k for k in between if not _rests(motion, k)]
    if between and above >= 0:  # it would stretch the whole of the longer bone
        kinds = {channel.kind for channel in skeleton.joints[above].channels}
        moving += [above] * bool(kinds & set(SCALING))
    return skeleton.joint_names[moving[0]] if moving else ""


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


def _folded(skeleton: Skeleton, index: int, above: int) -> Joint:
    """The joint with the offsets of those between it and ``above`` added to its own."""
    joint = skeleton.joints[index]
    between = _between(skeleton, index, above)
    base = skeleton.offsets[between[::-1]].sum(axis=0)
    if not base.any():
        return joint
    own = np.array(joint.offset)
    kinds = [channel.kind for channel in joint.channels if channel.kind in POSITION_KINDS]
    if not joint.adds_to_offset:
        own[[POSITION_KINDS.index(kind) for kind in kinds]] = 0.0
    x, y, z = (base + own).tolist()
    return replace(joint, offset=(x, y, z), adds_to_offset=True)
