"""Fit of a joint's rotation channels to a target rotation.

One angle at a time; near gimbal lock, where this converges slowly, then by Gauss-Newton steps with
a damping for each frame.
"""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import IDENTITY, Link, multiply_matrices
from mcz.kinematics.rotations import (
    ORDERS,
    continuous,
    euler_angles,
    quaternions_of_matrices,
    rotate_axes,
    vectors_of_quaternions,
)
from mcz.model.types import Floats

STARTS = (0.0, np.pi / 2, np.pi, -np.pi / 2)
SWEEPS = 12


def set_turns(link: Link, moment: Floats, columns: Floats, radians: float) -> None:
    """Set a joint's rotation channels to the R that maximizes the trace of R' ``moment``.

    R is the joint's rotation. ``moment`` (3, 3, F) is in the joint's own axes; if it is a rotation,
    R is the nearest one. ``columns``, (n_channels, F) in source units, are written. A quaternion,
    or else a rotation vector, determines R alone.
    """
    if link.is_whole:
        columns[link.turning] = 0.0
        quaternions = quaternions_of(_nearest_rotations(moment))
        if link.quaternion:
            columns[list(link.quaternion)] = quaternions
        else:
            vectors = continuous(vectors_of_quaternions(quaternions))
            columns[list(link.vector)] = vectors / radians
    elif link.freedoms in ORDERS:
        angles = smallest_angles(euler_angles(_nearest_rotations(moment), link.freedoms))
        for k, (_, column) in enumerate(link.turns):
            columns[column] = angles[:, k] / radians
    else:
        columns[link.angles] = _angle_by_angle([axis for axis, _ in link.turns], moment) / radians


def _nearest_rotations(moment: Floats) -> Floats:
    """The rotations R with the greatest trace of R' ``moment``, (3, 3, F)."""
    left, _, right = np.linalg.svd(np.moveaxis(moment, 2, 0))
    turn = np.linalg.det(left) * np.linalg.det(right)
    left[:, :, 2] *= turn[:, None]
    return np.ascontiguousarray(np.moveaxis(left @ right, 0, 2))


def smallest_angles(angles: Floats) -> Floats:
    """Equivalent angles (n_frames, 3) that are nearer to zero overall, and as continuous.

    Angles (a, b, c) about three axes are equivalent to (a + pi, pi - b, c + pi).
    """
    both = [center_angles(angles), center_angles(angles * [1, -1, 1] + np.pi)]
    return min(both, key=lambda angles: float((angles * angles).sum()))


def center_angles(angles: Floats) -> Floats:
    """Angles, (n_frames, n), shifted by whole turns: their means are within half a turn of zero."""
    if not len(angles):
        return angles
    result: Floats = angles - 2 * np.pi * np.rint(angles.mean(axis=0) / (2 * np.pi))
    return result


def quaternions_of(turns: Floats) -> Floats:
    """Quaternions (w, x, y, z), (4, F), of rotation matrices, each near the previous one."""
    parts = quaternions_of_matrices(turns)
    signs = np.where((parts[:, 1:] * parts[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)
    signs = np.cumprod(np.concatenate([np.where(parts[0, :1] < 0, -1.0, 1.0), signs]))
    return parts * signs


def _angle_by_angle(axes: list[int], moment: Floats) -> Floats:
    """Angles (n, F) about turned axes, first to last, for the greatest trace of R' ``moment``.

    The best of several starts; each sweep sets one angle after another to the optimum for the
    present others.
    """
    n_frames = moment.shape[2]
    best = np.zeros((len(axes), n_frames))
    most = np.full(n_frames, -np.inf)
    for start in STARTS if len(axes) > 1 else (0.0,):
        angles = np.zeros((len(axes), n_frames))
        angles[-1:] = start
        for _ in range(SWEEPS if len(axes) > 1 else 1):
            for k, axis in enumerate(axes):
                rest = moment
                for left in range(k):  # undo the turns on the left, outermost first
                    rest = _rotate_left(rest, axes[left], -angles[left])
                for right in range(len(axes) - 1, k, -1):
                    rest = rotate_axes(rest, axes[right], -angles[right])
                i, j = (axis + 1) % 3, (axis + 2) % 3
                sine, cosine = rest[j, i] - rest[i, j], rest[i, i] + rest[j, j]
                angles[k] = np.arctan2(sine, cosine)
                trace = np.hypot(sine, cosine) + rest[axis, axis]
        better = trace > most * (1 + 1e-9) + 1e-300
        best, most = np.where(better, angles, best), np.where(better, trace, most)
    return np.asarray(np.unwrap(best, axis=1))


def _rotate_left(matrix: Floats, axis: int, angle: Floats) -> Floats:
    """R ``matrix``, R the rotation by ``angle`` about the axis."""
    return np.swapaxes(rotate_axes(np.swapaxes(matrix, 0, 1), axis, -angle), 0, 1)


STEPS = 40
FLAT = 1e-14  # gradient, at most about 1, below which steps gain nothing
ROUNDING = 1e-15  # smaller differences of the trace are rounding
START_DAMPING, EASIER, HARDER = 1e-3, 0.1, 10.0


def polish_turns(link: Link, target: Floats, columns: Floats, radians: float) -> None:
    """Improve the angles of a joint in ``columns``, (n_channels, F) in source units.

    The joint has only angles about axes. ``target`` are rotation matrices (3, 3, F) along the
    joint's own axes.
    """
    axes, columns_of_turns = [axis for axis, _ in link.turns], link.angles
    angles = columns[columns_of_turns] * radians
    damping = np.full(angles.shape[1], START_DAMPING)
    turn, spins = _turn(axes, angles)
    near = _nearness(turn, target)
    for _ in range(STEPS):
        gradient = np.einsum("kif,if->fk", spins, _vector(target, turn))
        if np.abs(gradient).max(initial=0.0) < FLAT:
            break
        normal = 2 * np.einsum("kif,lif->fkl", spins, spins)
        normal += damping[:, None, None] * np.eye(len(axes))
        step = np.linalg.solve(normal, gradient[:, :, None])[:, :, 0].T
        trial = angles + step
        trial_turn, trial_spins = _turn(axes, trial)
        trial_near = _nearness(trial_turn, target)
        better = trial_near > near - ROUNDING
        angles = np.where(better, trial, angles)
        near = np.where(better, trial_near, near)
        turn, spins = (np.where(better, trial_turn, turn), np.where(better, trial_spins, spins))
        damping *= np.where(better, EASIER, HARDER)
    columns[columns_of_turns] = angles / radians


def _turn(axes: list[int], angles: Floats) -> tuple[Floats, Floats]:
    """The rotation by ``angles`` (n, F), (3, 3, F), and the axis of each angle, (n, 3, F)."""
    rotation = np.broadcast_to(IDENTITY, (3, 3, angles.shape[1]))
    spins = np.empty((len(axes), 3, angles.shape[1]))
    for number, axis in enumerate(axes):
        spins[number] = rotation[:, axis]
        rotation = rotate_axes(rotation, axis, angles[number])
    return rotation, spins


def _nearness(rotation: Floats, target: Floats) -> Floats:
    """The trace of rotation' target, (F,): 3 if they are equal."""
    result: Floats = (rotation * target).sum(axis=(0, 1))
    return result


def _vector(target: Floats, rotation: Floats) -> Floats:
    """Twice the sine of the angle from ``rotation`` to ``target``, times the axis, (3, F)."""
    left = multiply_matrices(target, np.swapaxes(rotation, 0, 1))
    return np.stack([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
