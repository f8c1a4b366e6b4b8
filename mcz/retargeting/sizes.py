"""How large one skeleton is beside another, by bones that both have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mcz.kinematics.chain import Floats
from mcz.kinematics.feet import is_foot
from mcz.motion import Skeleton


def size_ratio(ours: Skeleton, theirs: Skeleton, pairs: Mapping[int, int]) -> float:
    """The length of our legs in those of theirs, each in its own length unit.

    ``pairs`` has joints of theirs by joints of ours. A leg reaches from the hip down to the first
    joint that is a part of a foot by its name. Where there are no legs, or legs of no length, it is
    that of all bones between joints of ``pairs``; 1 where there is none.
    """
    feet = [
        (one, other)
        for one, other in pairs.items()
        if is_foot(ours.joints[one].name) or is_foot(theirs.joints[other].name)
    ]
    legs = [pair for pair in feet if not _hangs_on(ours, pair[0], {one for one, _ in feet})]
    lengths = (
        sum(_leg(ours, one) for one, _ in legs),
        sum(_leg(theirs, other) for _, other in legs),
    )
    if not all(lengths):
        lengths = (_bones(ours, pairs), _bones(theirs, pairs.values()))
    return lengths[0] / lengths[1] if all(lengths) else 1.0


def _hangs_on(skeleton: Skeleton, joint: int, others: set[int]) -> bool:
    parent = skeleton.joints[joint].parent
    while parent >= 0:
        if parent in others:
            return True
        parent = skeleton.joints[parent].parent
    return False


def _leg(skeleton: Skeleton, foot: int) -> float:
    """The length of the bones from the hip to a joint, without the one that leads to the hip."""
    lengths = _lengths(skeleton)
    line = []
    while skeleton.joints[foot].parent >= 0:
        line.append(float(lengths[foot]))
        foot = skeleton.joints[foot].parent
    bones = [length for length in line if length > 0]
    return sum(bones[:-1]) if len(bones) > 1 else sum(bones)


def _bones(skeleton: Skeleton, joints: Iterable[int]) -> float:
    """The length of all bones on the lines between these joints."""
    chosen = set(joints)
    lengths, total = _lengths(skeleton), 0.0
    for joint in chosen:
        line = []
        while joint >= 0:
            line.append(float(lengths[joint]))
            joint = skeleton.joints[joint].parent
            if joint in chosen:
                total += sum(line)
                break
    return total


def _lengths(skeleton: Skeleton) -> Floats:
    """Of every joint the length of its offset, (n_joints,)."""
    return np.asarray(np.sqrt((skeleton.offsets**2).sum(axis=1)))
