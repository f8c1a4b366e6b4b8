"""Rotation matrices -> Euler angles about turned axes, continuous over time."""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Floats, rotate_axes

# The most common order of BVH files first.
ORDERS = ("zyx", "zxy", "yxz", "xyz", "xzy", "yzx")
STEEP = np.sin(np.deg2rad(80))  # beyond it the outer axes nearly fall together: try other orders
LOCKED = 1e-14  # cosine below which they do; to choose an angle then costs as much, in radians


def euler_order(turns: Floats) -> str:
    """The order, first to last about turned axes, that keeps well away from gimbal lock.

    "zyx" wherever its second angle stays below 80 degrees, else the order whose second angle stays
    smallest. ``turns`` are rotation matrices, (3, 3, n_frames).
    """
    steepest = {o: np.abs(_entry(turns, o, 0, 2)).max(initial=0.0) for o in ORDERS}
    return ORDERS[0] if steepest[ORDERS[0]] < STEEP else min(ORDERS, key=steepest.__getitem__)


def euler_angles(turns: Floats, order: str) -> Floats:
    """Angles in radians, (n_frames, 3), about the turned axes of ``order``, that make ``turns``.

    Of the two solutions of each frame, and of full turns, those nearest to the frame before are
    taken. The first and second angle are solved after the third, so that the three of them make
    the matrix to rounding even in gimbal lock, where the third is that of the frame before.
    """
    i, j, k = ("xyz".index(letter) for letter in order)
    sign = _sign(order)
    third = np.arctan2(-sign * turns[i, j], turns[i, i])
    third = _hold_last(third, np.hypot(turns[i, i], turns[i, j]) > LOCKED)
    rest = rotate_axes(turns, k, -third)
    first = np.arctan2(sign * rest[k, j], rest[j, j])
    second = np.arctan2(sign * rest[i, k], rest[i, i])
    return np.unwrap(nearest_solutions(np.stack([first, second, third], axis=1)), axis=0)


def _sign(order: str) -> float:
    return 1.0 if order in "xyzxy" else -1.0


def _entry(turns: Floats, order: str, row: int, column: int) -> Floats:
    entry: Floats = turns["xyz".index(order[row]), "xyz".index(order[column])]
    return entry


def _hold_last(angles: Floats, known: Floats) -> Floats:
    """Replace ``angles`` that are not ``known`` by the last known ones, 0 before the first."""
    last = np.maximum.accumulate(np.where(known, np.arange(len(angles)), -1))
    return np.where(last >= 0, angles[last], 0.0)


def nearest_solutions(angles: Floats) -> Floats:
    """Choose (a, b, c) or (a + pi, pi - b, c + pi) per frame, the one nearer to the frame before.

    Which of them is nearer does not depend on which of them the frame before took, as both change
    alike; so changes can be found for all frames at once.
    """
    other = angles * [1, -1, 1] + np.pi
    stays, changes = (
        np.abs(np.angle(np.exp(1j * (now[1:] - angles[:-1])))).sum(axis=1)
        for now in (angles, other)
    )
    is_other = np.concatenate([[False], np.cumsum(changes < stays) % 2 == 1])[: len(angles)]
    return np.where(is_other[:, None], other, angles)
