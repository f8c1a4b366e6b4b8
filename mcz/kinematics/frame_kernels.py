"""Compiled: poses, frame by frame, of skeletons whose joints only turn and move.

``chain.py`` has the same steps for every kind of channel. Imported on first use only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Floats3, Floats4, Ints, Ints2, Ints3


class JointTable(NamedTuple):
    """A skeleton, an entry a joint.

    ``changes``, ``backs`` and ``owns`` (n_joints, 3, 3): C_parent^-1 C, C_parent^-1 and C;
    ``offsets`` (n_joints, 3), ``moves`` (n_joints, 3) and ``turns`` (n_joints, most, 2), -1 if
    there is no column.
    """

    parents: Ints
    changes: Floats3
    offsets: Floats2
    backs: Floats3
    owns: Floats3
    replaces: Ints
    moves: Ints2
    turns: Ints3
    radians: float


class PointTable(NamedTuple):
    """``joints`` (n_points,), and ``tails`` (n_points, 3) along the axes of each."""

    joints: Ints
    tails: Floats2


@kernel
def position_points(
    values: Floats,
    joints: JointTable,
    points: PointTable,
    out: Floats2,
    origins: Floats2,
    axes: Floats3,
) -> None:
    """Write the positions of ``points`` to ``out`` (n_points, 3), and ``origins`` and ``axes``.

    ``origins`` (n_joints, 3), ``axes`` (n_joints, 3, 3) with the axes as columns.
    """
    arm = np.empty(3)
    for joint in range(len(joints.parents)):
        _place(values, joints, joint, arm, origins, axes)
    _mark(points, origins, axes, out)


@kernel
def place_frames(
    values: Floats2,
    joints: JointTable,
    indices: Ints,
    points: PointTable,
    out: Floats3,
    kept: Floats4,
) -> None:
    """Write ``points`` of all frames to ``out`` (n_frames, n_points, 3), and axes to ``kept``.

    ``values`` (n_frames, n_channels); ``indices`` are the joints to place, parents before children.
    ``kept`` (n_frames, n_joints, 3, 3), or (0, ...) if the axes are not needed.
    """
    n_joints = len(joints.parents)
    arm, origins, axes = np.empty(3), np.empty((n_joints, 3)), np.empty((n_joints, 3, 3))
    for frame in range(len(values)):
        for number in range(len(indices)):
            _place(values[frame], joints, indices[number], arm, origins, axes)
        _mark(points, origins, axes, out[frame])
        if len(kept):
            for joint in range(n_joints):
                for i in range(3):
                    for j in range(3):
                        kept[frame, joint, i, j] = axes[joint, i, j]


@kernel
def turn_frames(values: Floats2, joints: JointTable, indices: Ints, out: Floats4) -> None:
    """Write the local rotations of the joints ``indices``, (n_frames, n_indices, 3, 3).

    They are C M C^-1, M the product of the joint's own turns: the identity in the rest pose.
    """
    own = np.empty((3, 3))
    for frame in range(len(values)):
        for number in range(len(indices)):
            joint = indices[number]
            for i in range(3):
                for j in range(3):
                    own[i, j] = joints.owns[joint, i, j]
            _turn(values[frame], joints, joint, own)
            for i in range(3):
                for j in range(3):
                    total = 0.0
                    for k in range(3):
                        total += own[i, k] * joints.owns[joint, j, k]
                    out[frame, number, i, j] = total


def _place(
    values: Floats, joints: JointTable, joint: int, arm: Floats, origins: Floats2, axes: Floats3
) -> None:
    """The origin and the axes of a joint whose parent is placed; ``arm`` (3,) is scratch."""
    for i in range(3):
        column = joints.moves[joint, i]
        moved = column >= 0
        arm[i] = 0.0 if moved and joints.replaces[joint] else joints.offsets[joint, i]
        if moved:
            arm[i] += values[column]
    parent, own = joints.parents[joint], axes[joint]
    change = joints.changes[joint]
    if parent < 0:
        for i in range(3):
            origins[joint, i] = arm[i]
            for j in range(3):
                own[i, j] = change[i, j]
    else:
        above, back = axes[parent], joints.backs[joint]
        for i in range(3):
            total = origins[parent, i]
            for j in range(3):
                along = back[j, 0] * arm[0] + back[j, 1] * arm[1] + back[j, 2] * arm[2]
                total += above[i, j] * along
                own[i, j] = (
                    above[i, 0] * change[0, j]
                    + above[i, 1] * change[1, j]
                    + above[i, 2] * change[2, j]
                )
            origins[joint, i] = total
    _turn(values, joints, joint, own)


def _turn(values: Floats, joints: JointTable, joint: int, own: Floats2) -> None:
    """Turn the axes of a joint, (3, 3), by its channels."""
    turns = joints.turns
    for turn in range(turns.shape[1]):
        axis, column = turns[joint, turn]
        if column < 0:
            break
        j, k = (axis + 1) % 3, (axis + 2) % 3
        angle = values[column] * joints.radians
        cosine, sine = math.cos(angle), math.sin(angle)
        for i in range(3):
            before, after = own[i, j], own[i, k]
            own[i, j] = before * cosine + after * sine
            own[i, k] = after * cosine - before * sine


def _mark(points: PointTable, origins: Floats2, axes: Floats3, out: Floats2) -> None:
    for point in range(len(points.joints)):
        joint = points.joints[point]
        for i in range(3):
            total = origins[joint, i]
            for j in range(3):
                if points.tails[point, j] != 0.0:  # else unknown axes do not matter
                    total += axes[joint, i, j] * points.tails[point, j]
            out[point, i] = total
