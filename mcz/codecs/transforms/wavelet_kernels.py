"""Compiled: one level of a wavelet transform along time, by filters or, the 9/7 one, by lifting.

SPEC.md, "Wavelets" and "Lifting", are normative for ``synthesize`` and ``join``: binary64, one
product and one sum at a time, in the order below. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2

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


@kernel
def synthesize(
    out: Floats2, approx: Floats2, detail: Floats2, first: int, start: int, lo: Floats, hi: Floats
) -> None:
    """Write samples n >= start of the next finer approximation, (samples, channels).

    ``out`` is all zeros. ``approx`` and ``detail`` hold the coefficients from number ``first`` on,
    a column a channel; a ``detail`` without rows stands for zeros, which are not even added.
    """
    n_taps, n_channels = len(lo), approx.shape[1]
    for n in range(start, start + len(out)):
        for k in range(n // 2, (n + n_taps - 2) // 2 + 1):  # WAVE-02
            tap = lo[n + n_taps - 2 - 2 * k]  # WAVE-02
            for c in range(n_channels):
                # CODEC-02, WAVE-02
                out[n - start, c] = out[n - start, c] + tap * approx[k - first, c]
        if len(detail) == 0:  # WAVE-02
            continue
        for k in range(n // 2, (n + n_taps - 2) // 2 + 1):
            tap = hi[n + n_taps - 2 - 2 * k]  # WAVE-02
            for c in range(n_channels):
                out[n - start, c] = out[n - start, c] + tap * detail[k - first, c]  # WAVE-02


@kernel
def analyze(
    approx: Floats2,
    detail: Floats2,
    signal: Floats2,
    first: int,
    n_samples: int,
    start: int,
    low: Floats,
    high: Floats,
) -> None:
    """Write approximations and details k >= start, (coefficients, channels), of ``n_samples``.

    Both are all zeros.
    ``signal`` holds its samples from number ``first`` on, a column a channel; beyond both ends of
    the whole signal it is mirrored about half a sample (PyWavelets' mode "symmetric").
    """
    n_taps, n_channels = len(low), signal.shape[1]
    for k in range(start, start + len(approx)):
        for tap in range(n_taps):
            n = (2 * k + 1 - tap) % (2 * n_samples)
            n = min(n, 2 * n_samples - 1 - n)
            for c in range(n_channels):
                approx[k - start, c] += low[tap] * signal[n - first, c]
                detail[k - start, c] += high[tap] * signal[n - first, c]
