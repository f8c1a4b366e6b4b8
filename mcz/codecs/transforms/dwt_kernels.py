"""Compiled: one level of a discrete wavelet transform over a range of samples.

SPEC.md, "Wavelets", is normative for synthesis: binary64, one product and one sum at a time, in
the order below. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2


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
