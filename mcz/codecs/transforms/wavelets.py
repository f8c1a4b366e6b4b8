"""Wavelets: the filters of the registry, and the multilevel transform of columns of a matrix.

SPEC.md, "Wavelets", is normative and has the same numbers. A wavelet is its two synthesis filters;
those of analysis follow from them (``Wavelet.analysis``). Filters are those of PyWavelets.
``analyze`` is the encoder's and may differ in the last bits from machine to machine; ``synthesize``
is bit-exact: binary64, one product and one sum at a time, in the order of its compiled loop.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from mcz.errors import FormatError, OptionError
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2
from mcz.model.extras import annex_bytes

MAX_TAPS = 64
MAX_TAP = 16.0  # the greatest size of one
MAX_LEVELS = 16


@dataclass(frozen=True, slots=True)
class Wavelet:
    """Synthesis filters of equal, even length: ``lo`` for approximations, ``hi`` for details."""

    lo: tuple[float, ...]
    hi: tuple[float, ...]

    def __post_init__(self) -> None:
        n_taps = len(self.lo)
        if n_taps != len(self.hi) or n_taps % 2 or not 2 <= n_taps <= MAX_TAPS:  # MRDWT-06
            raise FormatError(f"wavelet: the filters have {n_taps} and {len(self.hi)} taps")
        if not all(abs(tap) <= MAX_TAP for tap in (*self.lo, *self.hi)):  # MRDWT-07
            raise FormatError(f"wavelet: a tap exceeds {MAX_TAP}")

    @property
    def n_taps(self) -> int:
        return len(self.lo)

    @property
    def analysis(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The analysis filters, low and high, of a biorthogonal pair."""
        signs = [1.0, -1.0] * (self.n_taps // 2)
        low = tuple(s * tap for s, tap in zip(signs, self.hi, strict=True))
        high = tuple(-s * tap for s, tap in zip(signs, self.lo, strict=True))
        return low, high

    def lengths(self, n: int, levels: int) -> list[int]:
        """Samples of the signal and of the approximations of levels 1, 2, ..., (levels + 1,)."""
        out = [n]
        for _ in range(levels):
            out.append((out[-1] + self.n_taps - 1) // 2)
        return out

    def lead(self, levels: int) -> int:
        """The frames before its own that the first coefficient of a segment affects."""
        return (self.n_taps - 2) * ((1 << levels) - 1)

    def mirrored(self, levels: int) -> int:
        """The first frames, whose mirror image the first coefficients of all levels need."""
        return (self.n_taps - 2) << max(0, levels - 1)


INLINE = 0  # the id of filters that are in the header
_ANNEX = json.loads(annex_bytes("wavelets.json"))
WAVELETS = {
    name: Wavelet(tuple(row["lo"]), tuple(row["hi"]))  # WAVE-01
    for name, row in _ANNEX.items()
}
IDS: dict[str, int] = {name: row["id"] for name, row in _ANNEX.items()}


@cache
def by_name(name: str) -> tuple[int, Wavelet]:
    """The id and filters of a wavelet; others of PyWavelets have the id INLINE.

    Raises OptionError for an unknown name.
    """
    if name in WAVELETS:
        return IDS[name], WAVELETS[name]
    import pywt

    if name not in pywt.wavelist(kind="discrete"):
        raise OptionError(f"wavelet {name!r} is unknown; the wavelets are {', '.join(WAVELETS)}")
    wavelet = pywt.Wavelet(name)
    try:
        return INLINE, Wavelet(tuple(wavelet.rec_lo), tuple(wavelet.rec_hi))
    except FormatError as error:
        raise OptionError(f"wavelet {name!r}: {error}") from None


def by_id(id_: int) -> Wavelet:
    """The registered wavelet with this id; raises FormatError."""
    if not 1 <= id_ <= len(WAVELETS):
        raise FormatError(f"wavelet {id_} is not one of 1 to {len(WAVELETS)}")
    return list(WAVELETS.values())[id_ - 1]


Ranges = list[tuple[int, int]]


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


@kernel
def synthesize_level(
    out: Floats2, approx: Floats2, detail: Floats2, first: int, start: int, lo: Floats, hi: Floats
) -> None:
    """Write samples n >= start of the next finer approximation, (samples, channels).

    ``out`` is all zeros. ``approx`` and ``detail`` hold the coefficients from number ``first`` on,
    a column a channel; a ``detail`` without rows means zeros.
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
def analyze_level(
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

    Both are zeros on entry. ``signal`` holds its samples from number ``first`` on, a column a
    channel; beyond both ends of the whole signal it is mirrored about half a sample (PyWavelets'
    mode "symmetric").
    """
    n_taps, n_channels = len(low), signal.shape[1]
    for k in range(start, start + len(approx)):
        for tap in range(n_taps):
            n = (2 * k + 1 - tap) % (2 * n_samples)
            n = min(n, 2 * n_samples - 1 - n)
            for c in range(n_channels):
                approx[k - start, c] += low[tap] * signal[n - first, c]
                detail[k - start, c] += high[tap] * signal[n - first, c]


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
        analyze_level(approx, detail, signal, have, lengths[level - 1], begin, low, high)
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
        synthesize_level(finer, signal, detail, firsts[level - 1], begin, lo, hi)
        signal = finer
    return np.array(signal, order="C")
