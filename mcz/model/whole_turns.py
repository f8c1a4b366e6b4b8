"""Rotation vectors and quaternions along time: which of those that turn alike is meant.

v and v (1 + 2 pi n / |v|) turn alike, and so do q and -q. SPEC.md, "Unwrapping", lets an encoder
code any of them; its metrics take the nearest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import QUATERNION_KINDS, VECTOR_KINDS, Skeleton
from mcz.model.skeleton import first_columns

Floats = NDArray[np.float64]
Columns = NDArray[np.int64]

BEYOND = 2.0**40  # a number of this magnitude or more takes no part


def vectors_of(skeleton: Skeleton) -> list[Columns]:
    """The columns of the rotation vector of every joint that has one."""
    return _columns(skeleton, VECTOR_KINDS)


def quaternions_of(skeleton: Skeleton) -> list[Columns]:
    """The columns of the quaternion of every joint that has one."""
    return _columns(skeleton, QUATERNION_KINDS)


def _columns(skeleton: Skeleton, kinds: tuple[str, ...]) -> list[Columns]:
    starts = skeleton.column_starts()
    found = (
        first_columns(joint.channels, kinds, start)
        for joint, start in zip(skeleton.joints, starts, strict=False)
    )
    return [np.array(columns, np.int64) for columns in found if columns]


class VectorFollower:
    """Makes one rotation vector follow itself, block after block of rows."""

    def __init__(self, full: float) -> None:
        self._full = full
        self._last: Floats | None = None

    def __call__(self, vectors: Floats) -> Floats:
        """The next rows, (n_rows, 3), each the nearest to the one before of those alike."""
        rows = np.flatnonzero((np.abs(vectors) < BEYOND).all(axis=1))
        if not len(rows):
            return vectors
        own = vectors[rows]
        last = own[:1] if self._last is None else self._last[None]
        counts = _turns(own, np.concatenate([last, own[:-1]]), self._full)[0]
        if counts.any():  # rare: the rest goes row by row, for each depends on the one before
            first = int(np.flatnonzero(counts)[0])
            before = own[first - 1] if first else last[0]
            for row in range(first, len(own)):
                own[row] = before = nearest(own[row : row + 1], before[None], self._full)[0]
            vectors = vectors.copy()
            vectors[rows] = own
        self._last = own[-1].copy()
        return vectors


class SignKeeper:
    """Gives one quaternion the sign that keeps it near the one before, block after block."""

    def __init__(self) -> None:
        self._last: Floats | None = None

    def __call__(self, quaternions: Floats) -> Floats:
        """The next rows, (n_rows, 4)."""
        rows = np.flatnonzero(np.isfinite(quaternions).all(axis=1))
        if not len(rows):
            return quaternions
        own = quaternions[rows]
        last = own[:1] if self._last is None else self._last[None]
        dots = (own * np.concatenate([last, own[:-1]])).sum(axis=1)
        signs = np.cumprod(np.where(dots < 0, -1.0, 1.0))
        out = quaternions.copy()
        out[rows] = own * signs[:, None]
        self._last = out[rows[-1]].copy()
        return out


def nearest(vectors: Floats, wanted: Floats, full: float) -> Floats:
    """Return the equivalent rotation vectors, (n, 3), nearest to ``wanted``."""
    counts, axes = _turns(vectors, wanted, full)
    return np.where(counts[:, None] == 0, vectors, vectors + (full * counts)[:, None] * axes)


def _turns(vectors: Floats, wanted: Floats, full: float) -> tuple[Floats, Floats]:
    """Whole turns from each vector to the nearest equivalent one, and their axes."""
    sizes = np.sqrt((vectors * vectors).sum(axis=1))
    others = np.sqrt((wanted * wanted).sum(axis=1))
    zero = sizes == 0  # any axis is as good: that of what is wanted
    lengths = np.where(zero, others, sizes)
    axes = np.where(zero[:, None], wanted, vectors) / np.where(lengths == 0, 1.0, lengths)[:, None]
    counts = np.rint(((wanted * axes).sum(axis=1) - sizes) / full)
    return counts, axes


def without_whole_turns(
    original: Floats, decoded: Floats, differences: Floats, skeleton: Skeleton
) -> Floats:
    """``differences``, decoded minus original, those of vectors and quaternions the least alike.

    All are (n_rows, n_channels); ``differences`` is written to and returned. Nothing is changed
    where a number is not below 2^40 in magnitude.
    """
    full = {"deg": 360.0, "rad": 2 * math.pi}.get(skeleton.angle_unit, 0.0)
    for columns in vectors_of(skeleton) if full else []:
        rows = _known(original, decoded, columns)
        wanted = original[np.ix_(rows, columns)]
        differences[np.ix_(rows, columns)] = (
            nearest(decoded[np.ix_(rows, columns)], wanted, full) - wanted
        )
    for columns in quaternions_of(skeleton):
        rows = _known(original, decoded, columns)
        one, other = original[np.ix_(rows, columns)], decoded[np.ix_(rows, columns)]
        signs = np.where((one * other).sum(axis=1) < 0, -1.0, 1.0)
        differences[np.ix_(rows, columns)] = other * signs[:, None] - one
    return differences


def _known(original: Floats, decoded: Floats, columns: Columns) -> NDArray[np.int64]:
    part = (np.abs(original[:, columns]) < BEYOND) & (np.abs(decoded[:, columns]) < BEYOND)
    return np.flatnonzero(part.all(axis=1)).astype(np.int64)
