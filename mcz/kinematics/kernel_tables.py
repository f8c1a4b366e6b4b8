"""A skeleton as compiled loops know it: ``frame_kernels`` has the loops."""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Chain, Floats
from mcz.kinematics.frame_kernels import Joints, Points


def is_elaborate(chain: Chain) -> bool:
    """Return True if a joint has other channels than rotations and positions, or a repeated one."""
    return any(
        link.is_whole
        or link.scales
        or link.lengths
        or len({component for component, _ in link.moves}) < len(link.moves)
        for link in chain.links
    )


def tables_of(chain: Chain, points: list[int], tails: list[Floats]) -> tuple[Joints, Points]:
    """Skeleton tables for the kernels."""
    links = chain.links
    n_joints = len(links)
    most = max((len(link.turns) for link in links), default=0)
    moves = np.full((n_joints, 3), -1, np.int64)
    turns = np.full((n_joints, max(1, most), 2), -1, np.int64)
    changes, backs, owns = (np.tile(np.eye(3), (n_joints, 1, 1)) for _ in range(3))
    for joint, link in enumerate(links):
        for component, column in link.moves:
            moves[joint, component] = column
        for turn, pair in enumerate(link.turns):
            turns[joint, turn] = pair
        if link.change is not None:
            changes[joint] = link.change[:, :, 0]
        if link.parent_back is not None:
            backs[joint] = link.parent_back
        own = chain.turned[joint]
        if own is not None:
            owns[joint] = own
    joints = Joints(
        np.array([link.parent for link in links], np.int64),
        changes,
        np.array([link.offset for link in links]).reshape(n_joints, 3),
        backs,
        owns,
        np.array([link.replaces for link in links], np.int64),
        moves,
        turns,
        float(chain.radians),
    )
    return joints, Points(np.array(points, np.int64), np.array(tails).reshape(len(points), 3))
