"""Compiled: one level of the 9/7 wavelet transform by lifting, along time.

SPEC.md, "Lifting", is normative for ``join``: binary64, in the order below. One function takes a
step both ways, so that ``split`` undoes what ``join`` does. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels import kernel
from mcz.kernels.types import Floats2

# I. Daubechies and W. Sweldens, Factoring wavelet transforms into lifting steps, 1998.
ALPHA, BETA = -1.586134342059924, -0.052980118572961
GAMMA, DELTA = 0.882911075530934, 0.443506852043971
LOW, HIGH = 1.230174104914001, 1.149604398860241  # of approximations, of details


def lift(signal: Floats2, first: int, factor: float) -> None:
    """Add to the rows ``first``, ``first`` + 2, ... ``factor`` times the sum of their neighbors.

    At an end of the signal, of at least two rows, the one neighbor counts twice.
    """
    n_rows, n_channels = signal.shape
    for n in range(first, n_rows, 2):
        before = n - 1 if n > 0 else 1
        after = n + 1 if n + 1 < n_rows else n_rows - 2
        for c in range(n_channels):
            signal[n, c] = signal[n, c] + factor * (signal[before, c] + signal[after, c])  # LIFT-01


@kernel
def join(signal: Floats2, approx: Floats2, detail: Floats2) -> None:
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
def split(signal: Floats2, approx: Floats2, detail: Floats2) -> None:
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
