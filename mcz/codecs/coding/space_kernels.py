"""Compiled: the coefficients of a frame in space, coded, and made into values.

SPEC.md, "Rows of a frame", is normative and has the steps below in the same order. One function
serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.coding import residuals
from mcz.codecs.coding.residuals import FAULT, bits, code_residual, side_of
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

MAX_INDEX = 1 << 40
LENGTHS = 0, 0  # residuals of a stream
FIRSTS = residuals.N_CONTEXTS, residuals.N_MIXERS
OTHERS = 2 * residuals.N_CONTEXTS, 2 * residuals.N_MIXERS
N_SETS = 3


class Transform(NamedTuple):
    """Transform from coefficients to values (SPEC.md, "Space"): a row each, matrix by matrix.

    ``vectors`` (n_rows, n_points), ``starts`` the first row of each matrix and the end, ``columns``
    (n_matrices, n_points) the channel of each point, ``weights`` (n_channels,).
    """

    vectors: Floats2
    starts: Ints
    columns: Ints2
    step: float
    weights: Floats


LAST, BEFORE, FAST, SLOW, TRACK_SIZE = range(5)  # remembered of a coefficient


def code_frame(
    state: Ints, data: Bytes, indices: Ints, starts: Ints, lengths: Ints, tracks: Ints2, first: int
) -> int:
    """Code ``indices`` (n_rows,) in place; 1 where that is impossible.

    ``lengths`` (n_matrices,) and ``tracks`` (n_rows, TRACK_SIZE) remember the frames before.
    """
    for m in range(len(starts) - 1):
        start, stop = starts[m], starts[m + 1]
        length = stop - start
        while length > 0 and indices[start + length - 1] == 0:
            length -= 1
        scales = 16 * lengths[m], 16 * lengths[max(m - 1, 0)]  # FRAME-08
        length = code_residual(state, data, length, scales, 0, (0, 0, 0), LENGTHS)
        if length < 0 or length > stop - start:  # FAULT is far below 0 (FRAME-09)
            return 1
        lengths[m] = length
        above = higher = 0
        for r in range(start, start + length):
            beside = starts[m - 1] + r - start if m > 0 else -1
            side = indices[beside] if 0 <= beside < start else 0  # FRAME-08
            track = tracks[r]
            if first:
                scales, near = (16 * abs(above), 16 * abs(side)), 0
                sides, base = (side_of(above), side_of(side), 0), FIRSTS
            else:
                fast = (3 * track[FAST] + 16 * abs(side)) >> 2
                slow = (track[SLOW] + 8 * abs(above) + 4 * abs(higher)) >> 1  # FRAME-08
                scales, near = (fast, slow), min(bits(start + length - r), 7)
                sides, base = (side_of(track[LAST]), side_of(side), side_of(track[BEFORE])), OTHERS
            fault = code_residual(state, data, indices[r], scales, near, sides, base)
            if fault == FAULT or abs(fault) > MAX_INDEX:  # SPACE-12
                return 1
            indices[r] = fault
            higher, above = above, fault
    if first == 0:  # FRAME-08
        remember(indices, tracks)
    return 0


def remember(indices: Ints, tracks: Ints2) -> None:
    for r in range(len(indices)):
        track, size = tracks[r], 16 * abs(indices[r])
        track[BEFORE] = track[LAST]
        track[LAST] = indices[r]
        track[FAST] += (size - track[FAST]) >> 1
        track[SLOW] += (size - track[SLOW]) >> 4  # FRAME-08


def add_frame(
    values: Floats, indices: Ints, transform: Transform, step: float, sums: Floats
) -> None:
    """Add the synthesis of the coefficients to ``values`` (n_channels,).

    ``step`` is that of the frame; ``sums`` (n_points,) is worked in.
    """
    vectors, starts, columns, _, weights = transform
    for m in range(len(starts) - 1):
        sums[:] = 0.0
        for r in range(starts[m], starts[m + 1]):  # FRAME-11
            if indices[r] != 0:
                index = float(indices[r])
                for j in range(len(sums)):
                    sums[j] = sums[j] + index * vectors[r, j]
        for j in range(len(sums)):
            c = columns[m, j]
            values[c] = values[c] + (sums[j] * step) * weights[c]  # FRAME-11, ONLINE-24


def coefficient_of(points: Floats, row: Floats) -> float:
    """Coefficient of points for one row of the analysis."""
    total = 0.0
    for j in range(len(points)):
        total += points[j] * row[j]
    return total


def index_of(coefficient: float, threshold: float) -> int:
    """A coefficient in steps as an integer; MAX_INDEX + 1 where it is too large."""
    size = abs(coefficient)
    if not size <= MAX_INDEX:  # NaN too
        return MAX_INDEX + 1
    if size < threshold:
        return 0
    index = int(np.floor(size + 0.5))
    return -index if coefficient < 0 else index
