"""Local refinement of a joint's angles towards a target rotation.

Damped Gauss-Newton steps, each frame damped for itself. They end where one angle at a time, as in
``rotation_fit.py``, gets on slowly: at two axes that fall together.
"""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import IDENTITY, Floats, Link, multiply_matrices, rotate_axes

STEPS = 40
FLAT = 1e-14  # of the gradient, whose greatest is about 1: no way up any more
ROUNDING = 1e-15  # of the trace, by which the last and best steps are not told apart
START_DAMPING, EASIER, HARDER = 1e-3, 0.1, 10.0


def polish_turns(link: Link, wanted: Floats, columns: Floats, radians: float) -> None:
    """Improve the angles of a joint in ``columns``, (n_channels, F) in source units.

    It turns by angles about axes alone. ``wanted`` are rotation matrices (3, 3, F) along
    the joint's own axes.
    """
    axes, own = [axis for axis, _ in link.turns], link.angles
    angles = columns[own] * radians
    damping = np.full(angles.shape[1], START_DAMPING)
    turn, spins = _turn(axes, angles)
    near = _nearness(turn, wanted)
    for _ in range(STEPS):
        gradient = np.einsum("kif,if->fk", spins, _vector(wanted, turn))
        if np.abs(gradient).max(initial=0.0) < FLAT:
            break
        normal = 2 * np.einsum("kif,lif->fkl", spins, spins)
        normal += damping[:, None, None] * np.eye(len(axes))
        step = np.linalg.solve(normal, gradient[:, :, None])[:, :, 0].T
        trial = angles + step
        trial_turn, trial_spins = _turn(axes, trial)
        trial_near = _nearness(trial_turn, wanted)
        better = trial_near > near - ROUNDING
        angles = np.where(better, trial, angles)
        near = np.where(better, trial_near, near)
        turn, spins = (
            np.where(better, trial_turn, turn),
            np.where(better, trial_spins, spins),
        )
        damping *= np.where(better, EASIER, HARDER)
    columns[own] = angles / radians


def _turn(axes: list[int], angles: Floats) -> tuple[Floats, Floats]:
    """Rotation by ``angles`` (n, F), (3, 3, F), and the axis of each, (n, 3, F)."""
    rotation = np.broadcast_to(IDENTITY, (3, 3, angles.shape[1]))
    spins = np.empty((len(axes), 3, angles.shape[1]))
    for number, axis in enumerate(axes):
        spins[number] = rotation[:, axis]
        rotation = rotate_axes(rotation, axis, angles[number])
    return rotation, spins


def _nearness(rotation: Floats, wanted: Floats) -> Floats:
    """The trace of R' M, 3 where they are the same, (F,)."""
    near: Floats = (rotation * wanted).sum(axis=(0, 1))
    return near


def _vector(wanted: Floats, rotation: Floats) -> Floats:
    """Twice the sine of the angle from ``rotation`` to ``wanted``, times the axis, (3, F)."""
    left = multiply_matrices(wanted, np.swapaxes(rotation, 0, 1))
    return np.stack([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
