"""The multilevel discrete wavelet transform of a matrix, column by column, range by range.

SPEC.md, "Wavelets", is normative. ``analyze`` is the encoder's and may differ in the last bits from
machine to machine; ``synthesize`` is bit-exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.transforms.wavelets import Wavelet

Floats = NDArray[np.float64]
Ranges = list[tuple[int, int]]


@cache
def _kernels() -> ModuleType:
    from mcz.codecs.transforms import dwt_kernels

    return dwt_kernels


def own_range(first: int, stop: int, level: int, lengths: Sequence[int]) -> tuple[int, int]:
    """The coefficients of ``level`` that belong to the segment first <= frame < stop."""
    last = stop == lengths[0]  # MRDWT-14
    return first >> level, lengths[level] if last else stop >> level


def needed_ranges(start: int, stop: int, levels: int, n_taps: int) -> Ranges:
    """For each level from 0: the samples that frames start <= f < stop, stop > start, need."""
    ranges = [(start, stop)]
    for _ in range(levels):
        start, stop = start // 2, (stop - 1 + n_taps - 2) // 2 + 1
        ranges.append((start, stop))
    return ranges


def analyze(
    window: Floats, at: int, first: int, stop: int, lengths: Sequence[int], wavelet: Wavelet
) -> list[Floats]:
    """Coefficients of the segment first <= frame < stop: the approximation, then the details from
    the coarsest to the finest, each (coefficients, channels).

    ``window`` holds frames from ``at`` to ``stop`` or ``Wavelet.mirrored``, whichever is later (to
    the end of a signal that is shorter); ``at`` is 0, or a multiple of 2^levels at least
    ``Wavelet.lead`` before ``first``. It ends at a multiple of 2^levels, or with the signal.
    """
    low, high = (np.array(taps) for taps in wavelet.analysis)
    details = []
    have, signal = at, np.ascontiguousarray(window)
    own = slice(first - at, stop - at)
    for level in range(1, len(lengths)):
        start, end = own_range(first, stop, level, lengths)
        last = own_range(first, at + len(window), level, lengths)[1]
        begin = 0 if have == 0 else (have + wavelet.n_taps - 1) // 2
        own = slice(start - begin, end - begin)
        approx, detail = np.zeros((2, last - begin, signal.shape[1]))
        _kernels().analyze(approx, detail, signal, have, lengths[level - 1], begin, low, high)
        details.append(detail[own])
        have, signal = begin, approx
    return [signal[own], *reversed(details)]


def synthesize(
    bands: Sequence[Floats], firsts: Sequence[int], start: int, stop: int, wavelet: Wavelet
) -> Floats:
    """Frames start <= f < stop, (stop - start, channels), from their coefficients.

    ``bands`` is the approximation, then the details from the coarsest to the finest, a band
    without rows standing for zeros; ``firsts`` has the number of each level's first coefficient,
    the finest first (as ``needed_ranges`` gives it, the frames themselves left out).
    """
    lo, hi = np.array(wavelet.lo), np.array(wavelet.hi)
    levels = len(bands) - 1
    ranges = needed_ranges(start, stop, levels, wavelet.n_taps)
    signal = bands[0]
    for level in range(levels, 0, -1):
        detail = bands[levels + 1 - level]
        begin, end = ranges[level - 1]
        finer = np.zeros((end - begin, signal.shape[1]))
        _kernels().synthesize(finer, signal, detail, firsts[level - 1], begin, lo, hi)
        signal = finer
    return np.array(signal, order="C")
