"""How bones of one rest pose have to turn to point as those of another do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mcz.kinematics.chain import IDENTITY, Floats
from mcz.kinematics.rest import rest_positions
from mcz.motion import Skeleton
from mcz.retargeting.matching import nearest_above

SHORT = 1e-9  # of the longest bone: no direction


def rest_turns(target: Skeleton, source: Skeleton, pairs: Mapping[int, int]) -> dict[int, Floats]:
    """Of each joint of ``pairs`` the least turn of its bone to the direction of the source's.

    Rotation matrices (3, 3, 1). The bone of a joint leads to the one joint of ``pairs`` that hangs
    on it, or along its first tail. Where several hang on it, it does not turn; where there is no
    bone, it turns as the joint above does.
    """
    ours, theirs = rest_positions(target), rest_positions(source)
    above = {joint: nearest_above(target, joint, pairs) for joint in pairs}
    result: dict[int, Floats] = {-1: IDENTITY}
    for joint, other in pairs.items():
        below = [child for child in pairs if above[child] == joint]
        if len(below) > 1:
            result[joint] = IDENTITY
            continue
        if below:
            bones = ours[below[0]] - ours[joint], theirs[pairs[below[0]]] - theirs[other]
        else:
            bones = _tail(target, joint), _tail(source, other)
        turn = _least_turn(*bones)
        result[joint] = result[above[joint]] if turn is None else turn[:, :, None]
    return result


def _tail(skeleton: Skeleton, joint: int) -> Floats:
    """The first tail of a joint in the rest pose, (3,), 0 where it has none."""
    tails = skeleton.joints[joint].tails
    return np.array(tails[0]) if tails else np.zeros(3)


def _least_turn(a: Floats, b: Floats) -> Floats | None:
    """The rotation by the least angle that makes ``a`` point along ``b``; None without direction.

    Where they are opposite, about an axis normal to both, whichever.
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
