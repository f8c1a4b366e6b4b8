"""Rotations as matrices, vectors (an axis times an angle), quaternions and Euler angles.

Vectors are (3, F) in radians, quaternions (w, x, y, z), (4, F), matrices (3, 3, F), active, for
column vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mcz.model.types import Floats

NEAR = 0.1  # radians below which a difference of near numbers is summed as a series
SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880)  # of (t - sin t) / t^3, in t^2
FULL_TURN = 2 * np.pi


def matrices_of_vectors(vectors: Floats) -> Floats:
    """The rotations by |v| about v, (3, 3, F); the identity if v is 0, NaN if not finite."""
    angle = _length(vectors)
    # np.sinc is sin(pi x) / (pi x), and 1 at 0: no division by zero.
    first, half = np.sinc(angle / np.pi), np.sinc(angle / FULL_TURN)
    return _combine_vectors(vectors, first, half * half / 2, angle)


def spins_of_vectors(vectors: Floats) -> Floats:
    """Rotation axes for a change of each component, after the rotation, (3, 3, F), as columns.

    The left Jacobian of the exponential map: R(v + dv) = R(spins dv) R(v), to the first order.
    """
    angle = _length(vectors)
    half, square = np.sinc(angle / FULL_TURN), angle * angle
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        third = (angle - np.sin(angle)) / (square * angle)
    near = angle < NEAR
    series = np.polynomial.polynomial.polyval(np.where(near, square, 0.0), SERIES)
    return _combine_vectors(vectors, half * half / 2, np.where(near, series, third), angle)


def _length(vectors: Floats) -> Floats:
    """|v|, also if its square would be 0 or infinite."""
    result: Floats = np.hypot(np.hypot(vectors[0], vectors[1]), vectors[2])
    return result


def _combine_vectors(vectors: Floats, first: Floats, second: Floats, angle: Floats) -> Floats:
    """I + ``first`` K + ``second`` K K, K the matrix of the cross product by v."""
    out = np.empty((3, 3, vectors.shape[1]))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[i, i] = 1 - second * (vectors[j] * vectors[j] + vectors[k] * vectors[k])
        mixed = second * (vectors[i] * vectors[j])
        turn = first * vectors[k]
        out[i, j], out[j, i] = mixed - turn, mixed + turn
    out[:, :, ~np.isfinite(angle)] = np.nan
    return out


def matrices_of_quaternions(quaternions: Floats) -> Floats:
    """The rotations, (3, 3, F), of quaternions of any length but 0."""
    w, x, y, z = quaternions
    two = 2.0 / (quaternions * quaternions).sum(axis=0)
    return np.stack(
        [
            np.stack([1 - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)]),
            np.stack([two * (x * y + w * z), 1 - two * (x * x + z * z), two * (y * z - w * x)]),
            np.stack([two * (x * z - w * y), two * (y * z + w * x), 1 - two * (x * x + y * y)]),
        ]
    )


def quaternions_of_matrices(turns: Floats) -> Floats:
    """Quaternions of length 1, (4, F), whose greatest part is positive.

    F. L. Markley 2008, "Unit quaternion from rotation matrix": each row of 4 q q' is q times one of
    its parts, and the row of the greatest part is never small.
    """
    t = turns
    squares = np.stack(
        [
            1 + t[0, 0] + t[1, 1] + t[2, 2],
            1 + t[0, 0] - t[1, 1] - t[2, 2],
            1 - t[0, 0] + t[1, 1] - t[2, 2],
            1 - t[0, 0] - t[1, 1] + t[2, 2],
        ]
    )
    wx, wy, wz = t[2, 1] - t[1, 2], t[0, 2] - t[2, 0], t[1, 0] - t[0, 1]
    xy, xz, yz = t[1, 0] + t[0, 1], t[0, 2] + t[2, 0], t[2, 1] + t[1, 2]
    rows = np.array(
        [
            [squares[0], wx, wy, wz],
            [wx, squares[1], xy, xz],
            [wy, xy, squares[2], yz],
            [wz, xz, yz, squares[3]],
        ]
    )
    best = squares.argmax(axis=0)
    parts = rows[best, :, np.arange(t.shape[2])].T
    result: Floats = parts / np.sqrt((parts * parts).sum(axis=0))
    return result


def vectors_of_quaternions(quaternions: Floats) -> Floats:
    """Convert unit quaternions (w, x, y, z), (4, F), to vectors of at most half a turn."""
    w, parts = quaternions[0], quaternions[1:]
    sine = _length(parts)
    angle = 2 * np.arctan2(sine, np.abs(w))
    small = sine == 0
    ratio = np.where(small, 2.0, angle / np.where(small, 1.0, sine))
    return parts * np.where(w < 0, -ratio, ratio)


def continuous(vectors: Floats) -> Floats:
    """Equivalent rotation vectors, each near the previous one, (3, F).

    v and v (1 + 2 pi n / |v|) turn alike. The first is the shortest; each other one is nearest to
    the previous vector, whose axis serves if v is 0. Vectors that are not finite are skipped.
    """
    out = np.array(vectors, np.float64)
    last: Any = np.zeros(3)
    for frame in np.flatnonzero(np.isfinite(out).all(axis=0)).tolist():
        out[:, frame] = last = nearest_vector(out[:, frame], last)
    return out


def nearest_vector(vector: Floats, target: Floats) -> Floats:
    """The vector (3,) nearest to ``target`` with the rotation of ``vector``."""
    length = float(np.sqrt(vector @ vector))
    if length:
        axis = vector / length
    elif (size := float(np.sqrt(target @ target))) > np.pi:
        axis = target / size
    else:
        return vector
    turns = np.rint((float(target @ axis) - length) / FULL_TURN)
    return vector if turns == 0 else axis * (length + FULL_TURN * turns)


# The most common order of BVH files first.
ORDERS = ("zyx", "zxy", "yxz", "xyz", "xzy", "yzx")
# beyond it the outer axes nearly fall together: other orders are tried
STEEP = np.sin(np.deg2rad(80))
LOCKED = 1e-14  # cosine below which they do; any choice of an angle then costs as much, in radians


def euler_order(turns: Floats) -> str:
    """The order, first to last about turned axes, that keeps well away from gimbal lock.

    "zyx" wherever its second angle stays below 80 degrees, else the order whose second angle stays
    smallest. ``turns`` are rotation matrices, (3, 3, n_frames).
    """
    steepest = {o: np.abs(_entry(turns, o, 0, 2)).max(initial=0.0) for o in ORDERS}
    return ORDERS[0] if steepest[ORDERS[0]] < STEEP else min(ORDERS, key=steepest.__getitem__)


def euler_angles(turns: Floats, order: str) -> Floats:
    """Angles in radians, (n_frames, 3), about the turned axes of ``order``, that make ``turns``.

    Of the two solutions of a frame, and of whole turns, those nearest to the previous frame are
    chosen. The first and second angle are solved after the third, so that all three restore the
    matrix to rounding even in gimbal lock, where the third keeps its previous value.
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
    result: Floats = turns["xyz".index(order[row]), "xyz".index(order[column])]
    return result


def _hold_last(angles: Floats, known: Floats) -> Floats:
    """Replace ``angles`` that are not ``known`` by the last known ones, 0 before the first."""
    last = np.maximum.accumulate(np.where(known, np.arange(len(angles)), -1))
    return np.where(last >= 0, angles[last], 0.0)


def nearest_solutions(angles: Floats) -> Floats:
    """Choose (a, b, c) or (a + pi, pi - b, c + pi) per frame, nearer to the previous frame.

    The nearer one does not depend on the previous choice, as both change alike; so changes can be
    found for all frames together.
    """
    other = angles * [1, -1, 1] + np.pi
    stays, changes = (
        np.abs(np.angle(np.exp(1j * (now[1:] - angles[:-1])))).sum(axis=1)
        for now in (angles, other)
    )
    is_other = np.concatenate([[False], np.cumsum(changes < stays) % 2 == 1])[: len(angles)]
    return np.where(is_other[:, None], other, angles)


def rotate_axes(axes: Floats, axis: int, angle: Floats) -> Floats:
    """``axes`` R, R the rotation by ``angle`` in radians, (F,), about axis 0, 1 or 2."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = np.cos(angle), np.sin(angle)
    result = np.empty((3, 3, len(angle) if axes.shape[2] == 1 else axes.shape[2]))
    result[:, axis] = axes[:, axis]
    np.multiply(axes[:, j], cosine, out=result[:, j])
    result[:, j] += axes[:, k] * sine
    np.multiply(axes[:, k], cosine, out=result[:, k])
    result[:, k] -= axes[:, j] * sine
    return result
