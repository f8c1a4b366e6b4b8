"""Turns of bones from one rest pose to another."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping

import numpy as np

from mcz.errors import OptionError, SkeletonWarning
from mcz.kinematics.chain import IDENTITY
from mcz.kinematics.rest_pose import rest_positions
from mcz.kinematics.retargeting.joint_maps import limbs_of
from mcz.kinematics.retargeting.matching import nearest_above
from mcz.model.motion import Skeleton
from mcz.model.text_format import among
from mcz.model.types import Floats

SHORT = 1e-9  # of the longest bone: shorter ones have no direction
UNLIKE = 10.0  # degrees between bones at rest: more than people differ
MOST_NAMED = 6


def rest_turns(
    target: Skeleton, source: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]
) -> dict[int, Floats]:
    """Turns of each joint of ``pairs``, and of -1, that align its bone with the source's.

    Rotation matrices (3, 3, 1): for joints named in ``alike`` the least such turn, for others the
    turn of the joint above, for -1 none. The bone of a joint leads to the only joint of ``pairs``
    below it or, if there is none, along its first tail.

    Raises OptionError for a joint that is not in ``pairs``, and for one without such a bone.
    """
    named, turns = _numbers(target, pairs, alike), _bone_turns(target, source, pairs)
    result: dict[int, Floats] = {-1: IDENTITY}
    for joint in pairs:
        result[joint] = result[nearest_above(target, joint, pairs)]
        if joint not in named:
            continue
        turn = turns.get(joint)
        if turn is None:
            how = "no bone" if joint in turns else "several bones"
            raise OptionError(
                f"retarget: match_rest: joint {target.joint_names[joint]!r} has {how} to align"
            )
        result[joint] = turn[:, :, None]
    return result


def _bone_turns(
    target: Skeleton, source: Skeleton, pairs: Mapping[int, int]
) -> dict[int, Floats | None]:
    """The turn of each joint's bone to the source's, None if it has none.

    Joints of several bones are left out.
    """
    ours, theirs = rest_positions(target), rest_positions(source)
    children: dict[int, list[int]] = {joint: [] for joint in (-1, *pairs)}
    for joint in pairs:
        children[nearest_above(target, joint, pairs)].append(joint)
    turns: dict[int, Floats | None] = {}
    for joint, other in pairs.items():
        below = children[joint]
        if len(below) == 1:
            bones = ours[below[0]] - ours[joint], theirs[pairs[below[0]]] - theirs[other]
            turns[joint] = _least_turn(*bones)
        elif not below:
            turns[joint] = _least_turn(_tail(target, joint), _tail(source, other))
    return turns


def _angle(turn: Floats | None) -> float:
    cosine = 1.0 if turn is None else (float(np.trace(turn)) - 1) / 2
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))


def usual_alike(target: Skeleton, source: Skeleton, pairs: Mapping[int, int]) -> list[str]:
    """The limbs of a usual skeleton, if one of them rests otherwise than the source's.

    All of them, since joints that are not named turn along with the joint above. Warns with
    SkeletonWarning for other skeletons whose bones rest otherwise.
    """
    names, others = target.joint_names, source.joint_names
    ours, theirs = limbs_of(target), limbs_of(source)
    turns = _bone_turns(target, source, pairs)
    angles = {joint: angle for joint, turn in turns.items() if (angle := _angle(turn)) > UNLIKE}
    known = [joint for joint, turn in turns.items() if turn is not None]
    limbs = [j for j in known if names[j] in ours or others[pairs[j]] in theirs]
    if angles and not (ours or theirs):
        listed = ", ".join(
            f"{names[j]} by {angles[j]:.0f} degrees" for j in list(angles)[:MOST_NAMED]
        )
        more = " ..." if len(angles) > MOST_NAMED else ""
        warnings.warn(
            f"retarget: bones of the rest poses differ: {listed}{more}; match_rest= names those "
            "that are to point as the motion's, () accepts the difference",
            SkeletonWarning,
            stacklevel=3,
        )
    return [names[joint] for joint in limbs] if angles.keys() & set(limbs) else []


def _numbers(target: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]) -> set[int]:
    names = {target.joint_names[joint]: joint for joint in pairs}
    for name in alike:
        if name not in names:
            raise OptionError(
                f"retarget: match_rest: no mapped joint of the skeleton is called {name!r}; "
                f"the mapped joints are {among(list(names), name)}"
            )
    return {names[name] for name in alike}


def _tail(skeleton: Skeleton, joint: int) -> Floats:
    """The first tail of a joint in the rest pose, (3,), 0 where it has none."""
    tails = skeleton.joints[joint].tails
    return np.array(tails[0]) if tails else np.zeros(3)


def _least_turn(a: Floats, b: Floats) -> Floats | None:
    """The rotation by the least angle that makes ``a`` point along ``b``; None without direction.

    For opposite vectors it is about any axis normal to both.
    """
    lengths = np.linalg.norm(a), np.linalg.norm(b)
    if min(lengths) <= SHORT * max(lengths):
        return None
    a, b = a / lengths[0], b / lengths[1]
    cosine, axis = float(a @ b), np.cross(a, b)
    if cosine < -1 + 1e-12:
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        axis /= np.linalg.norm(axis)
        return np.asarray(2 * np.outer(axis, axis) - np.eye(3))
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + cosine))
