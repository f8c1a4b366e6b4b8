"""How bones of one rest pose have to turn to point as those of another do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mcz.brief import among
from mcz.errors import OptionError
from mcz.kinematics.chain import IDENTITY, Floats
from mcz.kinematics.rest import rest_positions
from mcz.motion import Skeleton
from mcz.retargeting.matching import nearest_above

SHORT = 1e-9  # of the longest bone: no direction


def rest_turns(
    target: Skeleton, source: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]
) -> dict[int, Floats]:
    """Of each joint of ``pairs``, and of -1, what turns its bone to the direction of the source's.

    Rotation matrices (3, 3, 1): for joints named in ``alike`` the least turn that does it, for
    others that of the joint above, for -1 none. The bone of a joint leads to the one joint of
    ``pairs`` that hangs on it or, where none does, along its first tail.

    Raises OptionError for a joint that is not in ``pairs``, and for one without such a bone.
    """
    named = _numbers(target, pairs, alike)
    ours, theirs = rest_positions(target), rest_positions(source)
    above = {joint: nearest_above(target, joint, pairs) for joint in pairs}
    result: dict[int, Floats] = {-1: IDENTITY}
    for joint, other in pairs.items():
        result[joint] = result[above[joint]]
        if joint not in named:
            continue
        below = [child for child in pairs if above[child] == joint]
        if below:
            bones = ours[below[0]] - ours[joint], theirs[pairs[below[0]]] - theirs[other]
        else:
            bones = _tail(target, joint), _tail(source, other)
        turn = None if len(below) > 1 else _least_turn(*bones)
        if turn is None:
            how = "several bones" if len(below) > 1 else "no bone"
            raise OptionError(
                f"retarget: match_rest: joint {target.joint_names[joint]!r} has {how} to match"
            )
        result[joint] = turn[:, :, None]
    return result


def _numbers(target: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]) -> set[int]:
    names = {target.joint_names[joint]: joint for joint in pairs}
    for name in alike:
        if name not in names:
            raise OptionError(
                f"retarget: match_rest: no joint {name!r} of the skeleton stands for one of the "
                f"motion, but {among(list(names), name)}"
            )
    return {names[name] for name in alike}


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
