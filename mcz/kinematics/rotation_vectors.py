"""Rotation vectors, an axis times an angle: the exponential map, quaternions, and the way back.

Vectors are (3, F) in radians, quaternions (w, x, y, z), (4, F), matrices (3, 3, F), active, for
column vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NEAR = 0.1  # radians below which a difference of near numbers is summed as a series
SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880)  # of (t - sin t) / t^3, in t^2
FULL_TURN = 2 * np.pi


def matrices_of_vectors(vectors: Floats) -> Floats:
    """The rotations by |v| about v, (3, 3, F); the identity where v is 0, NaN where not finite."""
    angle = _length(vectors)
    # np.sinc is sin(pi x) / (pi x), and 1 at 0: there is no division to go wrong near zero.
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
    """|v|, also where its square would be 0 or infinite."""
    length: Floats = np.hypot(np.hypot(vectors[0], vectors[1]), vectors[2])
    return length


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
    vectors: Floats = parts * np.where(w < 0, -ratio, ratio)
    return vectors


def continuous(vectors: Floats, start: Floats | None = None) -> Floats:
    """The same rotations by vectors each near the one before, (3, F).

    v and v (1 + 2 pi n / |v|) turn alike. The first is taken near ``start``, (3,), or as short as
    it can be; each other is the one of these that is nearest to the one before. Where v is 0, any
    axis does: that of the vector before is taken. What is not finite is passed over.
    """
    out = np.array(vectors, np.float64)
    last: Any = np.zeros(3) if start is None else np.asarray(start, np.float64)
    for frame in np.flatnonzero(np.isfinite(out).all(axis=0)).tolist():
        out[:, frame] = last = nearest_vector(out[:, frame], last)
    return out


def nearest_vector(vector: Floats, wanted: Floats) -> Floats:
    """The vector (3,) nearest to ``wanted`` with the rotation of ``vector``."""
    length = float(np.sqrt(vector @ vector))
    if length:
        axis = vector / length
    elif (size := float(np.sqrt(wanted @ wanted))) > np.pi:
        axis = wanted / size
    else:
        return vector
    turns = np.rint((float(wanted @ axis) - length) / FULL_TURN)
    return vector if turns == 0 else axis * (length + FULL_TURN * turns)
