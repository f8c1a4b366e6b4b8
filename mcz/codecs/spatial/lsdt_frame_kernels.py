"""Compiled: frames as differences from the frame before.

SPEC.md, "Codec 19: lsdt-frame", is normative. One function serves encoder and decoder. Imported on
first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.space_kernels import (
    MAX_INDEX,
    N_SETS,
    TRACK_SIZE,
    Transform,
    add_frame,
    code_frame,
    coefficient_of,
    index_of,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

__all__ = ["N_SETS", "TRACK_SIZE", "add_frames", "code_frames", "quantize_frames"]


@kernel
def code_frames(
    state: Ints,
    data: Bytes,
    indices: Ints2,
    starts: Ints,
    lengths: Ints,
    tracks: Ints2,
    first: int,
) -> int:
    """Code ``indices`` (frames, n_rows) in place; return the frame of a fault, or -1.

    ``first``: nothing is known before them. ``lengths`` (n_matrices,) and ``tracks`` (n_rows,
    TRACK_SIZE) are those of the frame before, and become those of the last.
    """
    for at in range(len(indices)):
        begins = first if at == 0 else 0
        if code_frame(state, data, indices[at], starts, lengths, tracks, begins):
            return at
    return -1


@kernel
def add_frames(out: Floats2, values: Floats, indices: Ints2, transform: Transform) -> None:
    """Write frames, (frames, n_channels), from their coefficients (frames, n_rows).

    ``values`` (n_channels,) is the frame before, and becomes the last.
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
