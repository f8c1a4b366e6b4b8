"""Compiled: coefficients of a window, and frames as differences, coded as residuals and decoded.

SPEC.md, "Codec 20: lsdt-clip" and "Codec 19: lsdt-frame", are normative and have the steps below in
the same order. One function serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_residual, side_of
from mcz.codecs.space import (
    FIRSTS,
    LENGTHS,
    MAX_INDEX,
    OTHERS,
    Transform,
    add_frame,
    code_frame,
    coefficient_of,
    index_of,
)
from mcz.codecs.space import TRACK_SIZE as TRACK_SIZE
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

BLOCK_FRAMES = 256  # at a time, so that sums stay near the processor


@kernel
def code_window(state: Ints, data: Bytes, rows: Ints2, starts: Ints, lengths: Ints) -> int:
    """Code ``rows`` (n_rows, n_frequencies) in place; return the row of a fault, or -1.

    ``starts`` has the first row of each matrix, and n_rows. ``lengths`` (n_rows,) is filled with
    the number of each row's coefficients up to the last that is not zero.
    """
    n = rows.shape[1]
    nothing = np.zeros(n, np.int64)
    above = side = nothing
    slow = 16 * n
    near = matrix = expected = 0
    for r in range(len(rows)):
        if r == starts[matrix]:
            above, matrix = nothing, matrix + 1  # WIND-11
        beside = starts[matrix - 2] + r - starts[matrix - 1] if matrix > 1 else -1  # WIND-11
        if 0 <= beside < starts[matrix - 1]:  # WIND-11
            side, expected = rows[beside], lengths[beside]
        else:
            side, expected = nothing, lengths[r - 1] if r else n  # WIND-11
        length = code_residual(
            state,
            data,
            _length(rows[r]),
            (16 * expected, slow),
            clamp(near + 3, 0, 7),
            (0, 0, 0),
            LENGTHS,
        )
        if length < 0 or length > n:  # FAULT is far below 0 (WIND-12)
            return r
        near = (near + bits(16 * length) - bits(slow)) >> 1  # WIND-11
        slow += (16 * length - slow) >> 2
        lengths[r] = length
        if _code_row(state, data, rows[r], length, above, side):
            return r
        above = rows[r]
    return -1


def _length(row: Ints) -> int:
    n = len(row)
    while n > 0 and row[n - 1] == 0:
        n -= 1
    return n


def _code_row(state: Ints, data: Bytes, row: Ints, length: int, above: Ints, side: Ints) -> int:
    """Code the first ``length`` coefficients of a row; 1 if that is impossible."""
    last = before = side_1 = side_2 = 0
    n = len(row)
    for k in range(length):
        a, b = abs(above[k]), abs(side[k])
        if k == 0:
            scales = 16 * a, 16 * b
            near, sides, first = 0, (side_of(above[0]), side_of(side[0]), 0), FIRSTS
        else:
            around = abs(above[k - 1]) + abs(side[k - 1]) if k > 1 else 0  # WIND-11
            if k + 1 < n:
                around += abs(above[k + 1]) + abs(side[k + 1])
            scales = 8 * last + 4 * before + 2 * (a + b), 6 * (a + b) + 3 * around
            near = min(bits(length - k), 7)
            sides, first = (side_1, side_2, side_of(above[k])), OTHERS
        fault = code_residual(state, data, row[k], scales, near, sides, first)
        if fault == FAULT or abs(fault) > MAX_INDEX:  # SPACE-12
            return 1
        row[k] = fault
        if k > 0:  # WIND-11
            before, last = last, abs(fault)
            side_2, side_1 = side_1, side_of(fault)
    return 0


@kernel
def synthesize_courses(out: Floats2, entries: Floats2, cosines: Floats2) -> None:
    """Add to ``out`` (n_courses, frames) the cosines times ``entries`` (n_courses, n_cosines)."""
    for k in range(len(out)):
        for j in range(entries.shape[1]):
            entry = entries[k, j]
            if entry != 0:  # most are
                for f in range(out.shape[1]):
                    out[k, f] = out[k, f] + entry * cosines[j, f]


@kernel
def synthesize(
    out: Floats2, rows: Ints2, lengths: Ints, temporal: Floats2, transform: Transform, mean: Floats
) -> None:
    """Write the frames of a window, (frames, channels), from its coefficients.

    ``temporal`` (n_frequencies, frames), ``mean`` (n_channels,).
    """
    vectors, starts, columns, step, weights = transform
    n_points = vectors.shape[1]
    sums = np.empty((n_points + 1, BLOCK_FRAMES))
    for begin in range(0, len(out), BLOCK_FRAMES):
        size = min(BLOCK_FRAMES, len(out) - begin)
        for m in range(len(starts) - 1):
            a, b = starts[m], starts[m + 1]
            _sums(sums, begin, size, rows[a:b], lengths[a:b], temporal, vectors[a:b])
            for j in range(n_points):
                c = columns[m, j]
                weight, start = weights[c], mean[c]  # WIND-15
                for f in range(size):
                    out[begin + f, c] = start + (sums[j, f] * step) * weight  # WIND-13


def _sums(
    sums: Floats2,
    begin: int,
    n_frames: int,
    rows: Ints2,
    lengths: Ints,
    temporal: Floats2,
    vectors: Floats2,
) -> None:
    """Write the points of one matrix in ``n_frames`` frames, before step, weight and mean.

    ``sums`` (n_points + 1, BLOCK_FRAMES) has room for one row of coefficients after the points.
    """
    n_points = vectors.shape[1]
    course = sums[n_points]
    for j in range(n_points):
        sums[j] = 0.0
    for r in range(len(rows)):  # WIND-13
        if lengths[r] == 0:
            continue
        course[:] = 0.0
        for k in range(lengths[r]):
            if rows[r, k] != 0:
                index, wave = float(rows[r, k]), temporal[k, begin : begin + n_frames]
                for f in range(n_frames):
                    course[f] = course[f] + index * wave[f]
        for j in range(n_points):
            entry, total = vectors[r, j], sums[j]
            for f in range(n_frames):
                total[f] = total[f] + entry * course[f]  # WIND-13


@kernel
def code_frames(
    state: Ints, data: Bytes, indices: Ints2, starts: Ints, lengths: Ints, tracks: Ints2, first: int
) -> int:
    """Code ``indices`` (frames, n_rows) in place; return the frame of a fault, or -1.

    ``first``: nothing is known before them. ``lengths`` (n_matrices,) and ``tracks`` (n_rows,
    TRACK_SIZE) are those of the previous frame, and become those of the last.
    """
    for at in range(len(indices)):
        begins = first if at == 0 else 0
        if code_frame(state, data, indices[at], starts, lengths, tracks, begins):
            return at
    return -1


@kernel
def add_frames(out: Floats2, values: Floats, indices: Ints2, transform: Transform) -> None:
    """Write frames, (frames, n_channels), from their coefficients (frames, n_rows).

    ``values`` (n_channels,) is the previous frame, and becomes the last.
    """
    sums = np.empty(transform.vectors.shape[1])
    for at in range(len(out)):
        add_frame(values, indices[at], transform, transform.step, sums)
        out[at] = values


@kernel
def quantize_frames(
    indices: Ints2,
    frames: Floats2,
    values: Floats,
    transform: Transform,
    analysis: Floats2,
    threshold: float,
) -> int:
    """Fill ``indices`` (frames, n_rows) with the quantized differences of ``frames``.

    Otherwise as ``add_frames``; ``analysis`` (n_rows, n_points) makes coefficients of points.
    Returns the frame of a coefficient that is too large, or -1.
    """
    vectors, starts, columns, step, weights = transform
    sums = np.empty(vectors.shape[1])
    points = np.empty(vectors.shape[1])
    for at in range(len(frames)):
        for m in range(len(starts) - 1):
            for j in range(len(points)):
                c = columns[m, j]
                points[j] = (frames[at, c] - values[c]) / weights[c] / step
            for r in range(starts[m], starts[m + 1]):
                indices[at, r] = index_of(coefficient_of(points, analysis[r]), threshold)
                if abs(indices[at, r]) > MAX_INDEX:
                    return at
        add_frame(values, indices[at], transform, step, sums)
    return -1
