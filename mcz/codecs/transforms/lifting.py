"""The 9/7 wavelet transform in time by lifting: halves, and halves of halves.

SPEC.md, "Lifting", is normative: a signal is mirrored about its first and its last sample.
``join_rows`` is compiled: binary64, one product and one sum at a time, in the order below.
"""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2

# I. Daubechies and W. Sweldens, Factoring wavelet transforms into lifting steps, 1998.
ALPHA, BETA = -1.586134342059924, -0.052980118572961
GAMMA, DELTA = 0.882911075530934, 0.443506852043971
LOW, HIGH = 1.230174104914001, 1.149604398860241  # of approximations, of details


def lift(signal: Floats2, first: int, factor: float) -> None:
    """Add to the rows ``first``, ``first`` + 2, ... ``factor`` times the sum of their neighbors.

    At an end of the signal, the only neighbor counts twice. There are at least two rows.
    """
    n_rows, n_channels = signal.shape
    for n in range(first, n_rows, 2):
        before = n - 1 if n > 0 else 1
        after = n + 1 if n + 1 < n_rows else n_rows - 2
        for c in range(n_channels):
            signal[n, c] = signal[n, c] + factor * (signal[before, c] + signal[after, c])  # LIFT-01


@kernel
def join_rows(signal: Floats2, approx: Floats2, detail: Floats2) -> None:
    """Write the ``signal``, (n_rows, n_channels), that has these coefficients."""
    n_channels = signal.shape[1]
    for n in range(len(approx)):
        for c in range(n_channels):
            signal[2 * n, c] = approx[n, c] * LOW
    for n in range(len(detail)):
        for c in range(n_channels):
            signal[2 * n + 1, c] = detail[n, c] * HIGH
    lift(signal, 0, -DELTA)
    lift(signal, 1, -GAMMA)
    lift(signal, 0, -BETA)
    lift(signal, 1, -ALPHA)


@kernel
def split_rows(signal: Floats2, approx: Floats2, detail: Floats2) -> None:
    """Write the coefficients of ``signal``, which is lost."""
    n_channels = signal.shape[1]
    lift(signal, 1, ALPHA)
    lift(signal, 0, BETA)
    lift(signal, 1, GAMMA)
    lift(signal, 0, DELTA)
    for n in range(len(approx)):
        for c in range(n_channels):
            approx[n, c] = signal[2 * n, c] / LOW
    for n in range(len(detail)):
        for c in range(n_channels):
            detail[n, c] = signal[2 * n + 1, c] / HIGH


def lengths(n_rows: int, levels: int) -> list[int]:
    """Rows of the approximation after 0, 1, ... splits; none splits a single row."""
    lengths_ = [n_rows]
    while len(lengths_) <= levels and lengths_[-1] > 1:
        lengths_.append((lengths_[-1] + 1) // 2)
    return lengths_


def split(signal: Floats) -> tuple[Floats, Floats]:
    """Approximation and detail of at least two rows, (n_rows, n_channels)."""
    n_rows, n_channels = signal.shape
    approx = np.empty(((n_rows + 1) // 2, n_channels))
    detail = np.empty((n_rows // 2, n_channels))
    split_rows(signal.copy(), approx, detail)
    return approx, detail


def join(approx: Floats, detail: Floats) -> Floats:
    """The inverse of ``split``."""
    signal = np.empty((len(approx) + len(detail), approx.shape[1]))
    join_rows(signal, approx, detail)
    return signal
