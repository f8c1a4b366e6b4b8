"""Compiled: the points of one frame at a time, of skeletons that only turn and move.

The steps are those of ``chain.py``, which is far quicker for many frames at once and slow for one.
Imported on first use only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Joints(NamedTuple):
    """A skeleton, an entry a joint.

    ``changes`` and ``backs`` (n_joints, 3, 3), ``offsets`` (n_joints, 3), ``moves`` (n_joints, 3)
    and ``turns`` (n_joints, most, 2), -1 where there is no column.
    """

    parents: Ints
    changes: Floats
    offsets: Floats
    backs: Floats
    replaces: Ints
    moves: Ints
    turns: Ints
    radians: float


class Points(NamedTuple):
    """``joints`` (n_points,), and ``tails`` (n_points, 3) along the axes of each."""

    joints: Ints
    tails: Floats


@kernel
def position_points(
    values: Floats, joints: Joints, points: Points, out: Floats, origins: Floats, axes: Floats
) -> None:
    """Write the positions of ``points`` to ``out`` (n_points, 3), and ``origins`` and ``axes``.

    ``origins`` (n_joints, 3), ``axes`` (n_joints, 3, 3) with the axes as columns.
    """
    parents, changes, offsets, backs, replaces, moves, turns, radians = joints
    arm = np.empty(3)
    for joint in range(len(parents)):
        for i in range(3):
            column = moves[joint, i]
            moved = column >= 0
            arm[i] = 0.0 if moved and replaces[joint] else offsets[joint, i]
            if moved:
                arm[i] += values[column]
        parent = parents[joint]
        own = axes[joint]
        if parent < 0:
            for i in range(3):
                origins[joint, i] = arm[i]
                for j in range(3):
                    own[i, j] = changes[joint, i, j]
        else:
            above, back = axes[parent], backs[joint]
            for i in range(3):
                total = origins[parent, i]
                for j in range(3):
                    along = back[j, 0] * arm[0] + back[j, 1] * arm[1] + back[j, 2] * arm[2]
                    total += above[i, j] * along
                    own[i, j] = (
                        above[i, 0] * changes[joint, 0, j]
                        + above[i, 1] * changes[joint, 1, j]
                        + above[i, 2] * changes[joint, 2, j]
                    )
                origins[joint, i] = total
        for turn in range(turns.shape[1]):
            axis, column = turns[joint, turn]
            if column < 0:
                break
            j, k = (axis + 1) % 3, (axis + 2) % 3
            angle = values[column] * radians
            cosine, sine = math.cos(angle), math.sin(angle)
            for i in range(3):
                before, after = own[i, j], own[i, k]
                own[i, j] = before * cosine + after * sine
                own[i, k] = after * cosine - before * sine
    for point in range(len(points.joints)):
        joint = points.joints[point]
        for i in range(3):
            total = origins[joint, i]
            for j in range(3):
                total += axes[joint, i, j] * points.tails[point, j]
            out[point, i] = total
