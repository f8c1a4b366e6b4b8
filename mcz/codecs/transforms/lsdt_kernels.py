"""Compiled: sparse vectors of Algorithm 1 of Hou 2016, and their sums for its next basis.

Frames are worked on in blocks, so that the loops inside run over frames; everything is summed in
one order, so the same frames give the same bytes. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats2

BLOCK = 128  # frames; coefficients, magnitudes and ranks of 31 points then fit the second cache


@kernel
def truncate(
    columns: Floats2, rows: Floats2, basis: Floats2, n_kept: int, n_counted: int, products: Floats2
) -> float:
    """Keep the ``n_kept`` largest coefficients of every frame.

    ``columns`` (J, N) and ``rows`` (N, J) are the same frames m; ``basis`` (J, J) has the basis
    vectors as rows. ``products`` (J, J) becomes the sum over frames of e m^T, e being what is kept
    of basis @ m. Of equal magnitudes that with the lower index is kept. Returns the sum of the
    squares of all but the ``n_counted`` largest.
    """
    n_points, n_frames = columns.shape
    coefficients = np.empty((n_points, BLOCK))
    magnitudes = np.empty((n_points, BLOCK))
    ranks = np.empty((n_points, BLOCK), np.int64)
    products[:] = 0.0
    dropped = 0.0
    for start in range(0, n_frames, BLOCK):
        width = min(BLOCK, n_frames - start)
        for k in range(n_points):
            line = coefficients[k]
            line[:] = 0.0
            for j in range(n_points):
                factor = basis[k, j]
                source = columns[j, start : start + width]
                for i in range(width):
                    line[i] += factor * source[i]
            for i in range(width):
                magnitudes[k, i] = abs(line[i])
                ranks[k, i] = 0
        for k in range(1, n_points):
            for l in range(k):  # noqa: E741
                for i in range(width):
                    first = int(magnitudes[l, i] >= magnitudes[k, i])
                    ranks[k, i] += first
                    ranks[l, i] += 1 - first
        for i in range(width):
            frame = rows[start + i]
            for k in range(n_points):
                value = coefficients[k, i]
                if ranks[k, i] >= n_counted:
                    dropped += value * value
                if ranks[k, i] < n_kept:
                    for j in range(n_points):
                        products[k, j] += value * frame[j]
    return dropped
