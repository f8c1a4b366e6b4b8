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
    own = chain.turned[joint]
    hung = IDENTITY if own is None else own[:, :, None]
    nothing = np.zeros((3, 1))
    pose = Pose([], [], [], [])
    chain.add(pose, chain.links[joint], (nothing, nothing, hung), columns)
    axes = pose.axes[0]
    return axes if own is None else multiply_matrices(axes, own.T[:, :, None])


def set_local_turns(chain: Chain, joint: int, wanted: Floats, columns: Floats) -> Floats:
    """Write values of the joint into ``columns`` (n_channels, F) so that its L is ``wanted``.

    As nearly as its channels can. Where ``wanted`` is not known, the values are NaN. Returns the L
    that they make, (3, 3, F or 1).
    """
    link, own = chain.links[joint], chain.turned[joint]
    if not link.turns:
        return IDENTITY
    wanted = np.broadcast_to(wanted, (3, 3, columns.shape[1]))
    known = finite(wanted)
    turn = hold_known(wanted, known)
    if own is not None:
        turn = multiply_matrices(multiply_matrices(own.T[:, :, None], turn), own[:, :, None])
    set_turns(link, turn, columns, chain.radians)
    if len(link.turns) > 1 and not link.is_whole and link.freedoms not in ORDERS:
        polish_turns(link, turn, columns, chain.radians)
    made = local_turns(chain, joint, columns)
    for column in link.turning:
        columns[column, ~known] = np.nan
    return made


def finite(matrices: Floats) -> Bools:
    """Flags of the frames of matrices (3, 3, F) that are finite, (F,)."""
    result: Bools = np.logical_and.reduce(np.isfinite(matrices), axis=(0, 1))
    return result


def hold_known(matrices: Floats, known: Bools) -> Floats:
    """Matrices (3, 3, F), those not known as the last known one before, or the first one after."""
    if known.all():
        return matrices
    if not known.any():
        return np.broadcast_to(IDENTITY, matrices.shape)
    frames = np.where(known, np.arange(len(known)), -1)
    last = np.maximum.accumulate(frames)
    return matrices[:, :, np.where(last < 0, known.argmax(), last)]


def back(turn: Floats) -> Floats:
    """The inverse of rotation matrices, (3, 3, F)."""
    return np.swapaxes(turn, 0, 1)


def relative(chain: Chain, above: int, joint: int, turns: dict[int, Floats]) -> Floats:
    """W_above^T W of a joint, (3, 3, F or 1), by what lies between the two alone.

    ``above`` need not be an ancestor, and -1 is the world. ``turns`` has L of every joint.
    """
    parents = [link.parent for link in chain.links]
    up, down = _line(above, parents), _line(joint, parents)
    shared = 0
    while shared < min(len(up), len(down)) and up[shared] == down[shared]:
        shared += 1
    result = IDENTITY
    for index in reversed(up[shared:]):
        result = multiply_matrices(result, back(turns[index]))
    for index in down[shared:]:
        result = multiply_matrices(result, turns[index])
    return result


def _line(joint: int, parents: list[int]) -> list[int]:
    """The joints from a root down to ``joint``."""
    line: list[int] = []
    while joint >= 0:
        line.append(joint)
        joint = parents[joint]
    return line[::-1]
