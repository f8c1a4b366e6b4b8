"""Relative sizes of skeletons, by bones that both have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mcz.kinematics.chain import Floats
from mcz.kinematics.joint_groups import is_foot
from mcz.kinematics.rest_pose import rest_positions
from mcz.model.motion import Skeleton


def size_ratio(ours: Skeleton, theirs: Skeleton, pairs: Mapping[int, int]) -> float:
    """Our size for each unit of theirs, each in its own length units.

    ``pairs`` has joints of theirs by joints of ours. Heights are from the feet up to the joint
    where the legs part, as ``_height`` says; a foot is the first joint of a leg that is a part of
    a foot by its name, in either skeleton. Where there is none, or it has no height, the length of
    all bones between joints of ``pairs`` counts; 1 where there is none of these, too.
    """
    feet = {
        one: other
        for one, other in pairs.items()
        if is_foot(ours.joints[one].name) or is_foot(theirs.joints[other].name)
    }
    first = [one for one in feet if not feet.keys() & set(_line(ours, one)[:-1])]
    heights = _height(ours, first), _height(theirs, [feet[one] for one in first])
    if min(heights) <= 0:
        heights = _bones(ours, pairs), _bones(theirs, pairs.values())
    return heights[0] / heights[1] if all(heights) else 1.0


def _height(skeleton: Skeleton, feet: list[int]) -> float:
    """The height of the joint where the legs part above the feet, with legs straight.

    Up is away from the feet in the rest pose; one leg alone parts at its root. A leg begins below
    the first bone that has a length; of that bone counts how far it leads down. The mean of all
    legs; 0 where there is none.
    """
    if not feet:
        return 0.0
    lines = [_line(skeleton, foot) for foot in feet]
    shared = [joint for joint in lines[0] if all(joint in line for line in lines[1:])]
    fork = shared[-1] if shared and len(lines) > 1 else lines[0][0]
    rest, lengths = rest_positions(skeleton), _lengths(skeleton)
    down = np.sum([rest[foot] - rest[fork] for foot in feet], axis=0)
    down /= np.linalg.norm(down) or 1.0
    heights = []
    for line in lines:
        bones = [joint for joint in line[line.index(fork) + 1 :] if lengths[joint] > 0]
        leg = sum(float(lengths[joint]) for joint in bones[1:])
        heights.append(leg + float((rest[bones[0]] - rest[fork]) @ down) if bones else 0.0)
    return sum(heights) / len(heights)


def _bones(skeleton: Skeleton, joints: Iterable[int]) -> float:
    """The length of all bones on the lines between these joints."""
    chosen = set(joints)
    lengths, total = _lengths(skeleton), 0.0
    for joint in chosen:
        *above, _ = _line(skeleton, joint)
        begun = [number for number, other in enumerate(above) if other in chosen]
        if begun:
            total += float(lengths[[*above[begun[-1] + 1 :], joint]].sum())
    return total


def _line(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints from a root down to ``joint``."""
    line = [joint]
    while (parent := skeleton.joints[line[-1]].parent) >= 0:
        line.append(parent)
    return line[::-1]


def _lengths(skeleton: Skeleton) -> Floats:
    """Length of every joint's offset, (n_joints,)."""
    return np.asarray(np.sqrt((skeleton.offsets**2).sum(axis=1)))
