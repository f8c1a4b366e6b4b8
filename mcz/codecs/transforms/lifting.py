"""The 9/7 wavelet transform in time by lifting: halves, and halves of halves.

SPEC.md, "Lifting", is normative: a signal is mirrored about its first and its last sample.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.transforms import wavelet_kernels
from mcz.model.types import Floats


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
    wavelet_kernels.split(signal.copy(), approx, detail)
    return approx, detail


def join(approx: Floats, detail: Floats) -> Floats:
    """The inverse of ``split``."""
    signal = np.empty((len(approx) + len(detail), approx.shape[1]))
    wavelet_kernels.join(signal, approx, detail)
    return signal
