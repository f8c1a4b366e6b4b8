"""The turn of one joint relative to its parent, from its channels and back.

A turn is L = W_parent^T W, a rotation matrix of column vectors, (3, 3, F), the identity at rest.
With C, the matrix of the joint's ``axis``, and M, the product of its channels, L = C M C^T.
"""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import IDENTITY, Chain, Pose, multiply_matrices
from mcz.kinematics.rotation_fit import polish_turns, set_turns
from mcz.kinematics.rotations import ORDERS
from mcz.model.types import Bools, Floats


def local_turns(chain: Chain, joint: int, columns: Floats) -> Floats:
    """L of a joint, (3, 3, F), or (3, 3, 1) where it is constant, from values (n_channels, F)."""
    rest_turn = chain.turned[joint]
    parent_axes = IDENTITY if rest_turn is None else rest_turn[:, :, None]
    origin = np.zeros((3, 1))
    pose = Pose([], [], [], [])
    chain.add(pose, chain.links[joint], (origin, origin, parent_axes), columns)
    axes = pose.axes[0]
    return axes if rest_turn is None else multiply_matrices(axes, rest_turn.T[:, :, None])


def set_local_turns(chain: Chain, joint: int, turn: Floats, columns: Floats) -> Floats:
    """Write the values of a joint whose L is nearest to ``turn`` into ``columns`` (n_channels, F).

    Where ``turn`` is not known, the values are NaN. Returns their L, (3, 3, F or 1).
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


def inverse(turn: Floats) -> Floats:
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
        result = multiply_matrices(result, inverse(turns[index]))
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
