"""Compiled: one level of a discrete wavelet transform over a range of samples.

SPEC.md, "Wavelets", is normative for synthesis: binary64, one product and one sum at a time, in
the order below. Imported on first use only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.jit import kernel

Floats = NDArray[np.float64]


@kernel
def synthesize(
    approx: Floats,
    detail: Floats,
    first: int,
    start: int,
    stop: int,
    lo: Floats,
    hi: Floats,
) -> Floats:
    """Samples start <= n < stop of the next finer approximation, (stop - start, channels).

    ``approx`` and ``detail`` hold the coefficients from number ``first`` on, a column a channel;
    a ``detail`` without rows stands for zeros, which are not even added.
    """
    n_taps, n_channels = len(lo), approx.shape[1]
    out = np.zeros((stop - start, n_channels))
    for n in range(start, stop):
        for k in range(n // 2, (n + n_taps - 2) // 2 + 1):
            tap = lo[n + n_taps - 2 - 2 * k]
            for c in range(n_channels):
                out[n - start, c] = out[n - start, c] + tap * approx[k - first, c]
        if len(detail) == 0:
            continue
        for k in range(n // 2, (n + n_taps - 2) // 2 + 1):
            tap = hi[n + n_taps - 2 - 2 * k]
            for c in range(n_channels):
                out[n - start, c] = out[n - start, c] + tap * detail[k - first, c]
    return out


@kernel
def analyze(
    signal: Floats,
    first: int,
    n_samples: int,
    start: int,
    stop: int,
    low: Floats,
    high: Floats,
) -> tuple[Floats, Floats]:
    """Approximations and details start <= k < stop of a signal of ``n_samples``.

    ``signal`` holds its samples from number ``first`` on, a column a channel; beyond both ends of
    the whole signal it is mirrored about half a sample (PyWavelets' mode "symmetric").
    """
    n_taps, n_channels = len(low), signal.shape[1]
    approx = np.zeros((stop - start, n_channels))
    detail = np.zeros((stop - start, n_channels))
    for k in range(start, stop):
        for tap in range(n_taps):
            n = (2 * k + 1 - tap) % (2 * n_samples)
            n = min(n, 2 * n_samples - 1 - n)
            for c in range(n_channels):
                approx[k - start, c] += low[tap] * signal[n - first, c]
                detail[k - start, c] += high[tap] * signal[n - first, c]
    return approx, detail
