"""Turns of joints relative to their parents, and of bones from one rest pose to another.

A turn is L = W_parent^T W, a rotation matrix of column vectors, (3, 3, F), the identity at rest.
With C, the matrix of the joint's ``axis``, and M, the product of its channels, L = C M C^T.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping

import numpy as np

from mcz.errors import OptionError, SkeletonWarning
from mcz.kinematics.chain import IDENTITY, Chain, Pose, multiply_matrices
from mcz.kinematics.rest_pose import rest_positions
from mcz.kinematics.retargeting.joint_maps import limbs_of, nearest_above
from mcz.kinematics.rotation_fit import polish_turns, set_turns
from mcz.kinematics.rotations import ORDERS
from mcz.model.motion import Skeleton
from mcz.model.text_format import suggest_names
from mcz.model.types import Bools, Floats


def local_turns(chain: Chain, joint: int, columns: Floats) -> Floats:
    """L of a joint, (3, 3, F), or (3, 3, 1) if it is constant, from values (n_channels, F)."""
    rest_turn = chain.turned[joint]
    parent_axes = IDENTITY if rest_turn is None else rest_turn[:, :, None]
    origin = np.zeros((3, 1))
    pose = Pose([], [], [], [])
    chain.add(pose, chain.links[joint], (origin, origin, parent_axes), columns)
    axes = pose.axes[0]
    return axes if rest_turn is None else multiply_matrices(axes, rest_turn.T[:, :, None])


def set_local_turns(chain: Chain, joint: int, turn: Floats, columns: Floats) -> Floats:
    """Write the values of a joint whose L is nearest to ``turn`` into ``columns`` (n_channels, F).

    If ``turn`` is not known, the values are NaN. Returns their L, (3, 3, F or 1).
    """
    link, rest_turn = chain.links[joint], chain.turned[joint]
    if not link.turns:
        return IDENTITY
    turn = np.broadcast_to(turn, (3, 3, columns.shape[1]))
    known = finite_frames(turn)
    turn = fill_unknown(turn, known)
    if rest_turn is not None:
        turn = multiply_matrices(
            multiply_matrices(rest_turn.T[:, :, None], turn), rest_turn[:, :, None]
        )
    set_turns(link, turn, columns, chain.radians)
    if len(link.turns) > 1 and not link.is_whole and link.freedoms not in ORDERS:
        polish_turns(link, turn, columns, chain.radians)
    result = local_turns(chain, joint, columns)
    for column in link.turning:
        columns[column, ~known] = np.nan
    return result


def finite_frames(matrices: Floats) -> Bools:
    """Flags of the frames of matrices (3, 3, F) that are finite, (F,)."""
    result: Bools = np.logical_and.reduce(np.isfinite(matrices), axis=(0, 1))
    return result


def fill_unknown(matrices: Floats, known: Bools) -> Floats:
    """Replace each unknown matrix (3, 3, F) by the last known one before it, else by the first."""
    if known.all():
        return matrices
    if not known.any():
        return np.broadcast_to(IDENTITY, matrices.shape)
    frames = np.where(known, np.arange(len(known)), -1)
    last = np.maximum.accumulate(frames)
    return matrices[:, :, np.where(last < 0, known.argmax(), last)]


def inverse_turns(turn: Floats) -> Floats:
    """The inverse of rotation matrices, (3, 3, F)."""
    return np.swapaxes(turn, 0, 1)


def relative_turns(chain: Chain, reference: int, joint: int, turns: dict[int, Floats]) -> Floats:
    """W_reference^T W of a joint, (3, 3, F or 1), from the turns between the two alone.

    ``reference`` need not be an ancestor; -1 is the world. ``turns`` has L of every joint.
    """
    parents = [link.parent for link in chain.links]
    up, down = path_from_root(reference, parents), path_from_root(joint, parents)
    shared = 0
    while shared < min(len(up), len(down)) and up[shared] == down[shared]:
        shared += 1
    result = IDENTITY
    for index in reversed(up[shared:]):
        result = multiply_matrices(result, inverse_turns(turns[index]))
    for index in down[shared:]:
        result = multiply_matrices(result, turns[index])
    return result


def path_from_root(joint: int, parents: list[int]) -> list[int]:
    """The joints from a root down to ``joint``."""
    line: list[int] = []
    while joint >= 0:
        line.append(joint)
        joint = parents[joint]
    return line[::-1]


SHORT = 1e-9  # of the longest bone: shorter ones have no direction
UNLIKE = 10.0  # degrees between bones at rest: more than people differ
MOST_NAMED = 6


def rest_turns(
    target: Skeleton, source: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]
) -> dict[int, Floats]:
    """Turns that align the bone of each joint of ``pairs`` with the source's; also of -1.

    Rotation matrices (3, 3, 1): for joints named in ``alike`` the least such turn, for others the
    turn of the joint above, for -1 none. The bone of a joint leads to the only joint of ``pairs``
    below it or, if there is none, along its first tail.

    Raises OptionError for a joint that is not in ``pairs``, and for one without such a bone.
    """
    numbers, turns = _numbers(target, pairs, alike), _bone_turns(target, source, pairs)
    result: dict[int, Floats] = {-1: IDENTITY}
    for joint in pairs:
        result[joint] = result[nearest_above(target, joint, pairs)]
        if joint not in numbers:
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
    """The limbs of a usual skeleton, if one rests in another direction than the source's.

    All limbs count, since joints that are not named turn with the joint above. Warns with
    SkeletonWarning for other skeletons whose bones rest otherwise.
    """
    names, others = target.joint_names, source.joint_names
    ours, theirs = limbs_of(target), limbs_of(source)
    turns = _bone_turns(target, source, pairs)
    angles = {joint: angle for joint, turn in turns.items() if (angle := _angle(turn)) > UNLIKE}
    known = [joint for joint, turn in turns.items() if turn is not None]
    limbs = [j for j in known if names[j] in ours or others[pairs[j]] in theirs]
    if angles and not (ours or theirs):
        joined = ", ".join(
            f"{names[j]} by {angles[j]:.0f} degrees" for j in list(angles)[:MOST_NAMED]
        )
        more = " ..." if len(angles) > MOST_NAMED else ""
        warnings.warn(
            f"retarget: bones of the rest poses differ: {joined}{more}; match_rest= names those "
            "that are to point as the motion's, () accepts the difference",
            SkeletonWarning,
            stacklevel=4,
        )
    return [names[joint] for joint in limbs] if angles.keys() & set(limbs) else []


def _numbers(target: Skeleton, pairs: Mapping[int, int], alike: Iterable[str]) -> set[int]:
    names = {target.joint_names[joint]: joint for joint in pairs}
    for name in alike:
        if name not in names:
            raise OptionError(
                f"retarget: match_rest: no mapped joint of the skeleton is called {name!r}; "
                f"the mapped joints are {suggest_names(list(names), name)}"
            )
    return {names[name] for name in alike}


def _tail(skeleton: Skeleton, joint: int) -> Floats:
    """The first tail of a joint in the rest pose, (3,), 0 if it has none."""
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
