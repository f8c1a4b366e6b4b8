"""Motion-adaptive post filter: smoother positions with a delay of 12 rows.

C.-H. Kwak, I. V. Bajić, "Online MoCap data coding with bit allocation, rate control, and
motion-adaptive post-processing", section IV. Each coordinate of a point goes through one of three
low-pass filters; its own past decides which one, row by row. SPEC.md, "Post filter", is normative
and has the steps below in the same order: binary64, + - * / alone, so that every machine makes the
same numbers. Loops over rows and channels are compiled.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Ints

SIDE = 12  # rows on each side
FAR = 2.0**40  # a number that is not nearer to 0 is taken for unknown (FILT-05)


@kernel
def filter_middle(
    rows: Floats2, past: Floats2, bank: Floats2, low: float, high: float, out: Floats2
) -> None:
    """Fill ``out``, (n, n_channels), with the filtered rows 12 to n + 11 of ``rows``.

    ``rows`` (n + 24, n_channels); ``past`` (3, n_channels), the filtered rows before, latest first,
    is carried on; ``bank`` (13, 3) has a column a filter; ``low`` and ``high`` are the thresholds.
    """
    n_channels = rows.shape[1]
    choice, total = np.empty(n_channels, np.int64), np.empty(n_channels)
    patched = np.empty((2 * SIDE + 1, n_channels))
    last_gap = -1  # last row with an unknown number
    for row in range(2 * SIDE):
        if _has_gap(rows[row]):
            last_gap = row
    for n in range(len(out)):
        if _has_gap(rows[n + 2 * SIDE]):
            last_gap = n + 2 * SIDE
        window = rows[n : n + 2 * SIDE + 1]
        _choose(window, past, low, high, choice)
        if last_gap >= n:
            _patch(window, patched)
            _sum(patched, bank, choice, total)
        else:
            _sum(window, bank, choice, total)
        for c in range(n_channels):
            middle = window[SIDE, c]
            filtered = middle + total[c]
            out[n, c] = filtered if abs(middle) < FAR else middle  # FILT-05
            past[2, c] = past[1, c]
            past[1, c] = past[0, c]
            past[0, c] = filtered


def _has_gap(row: Floats) -> bool:
    n_unknown = 0
    for c in range(len(row)):
        n_unknown += not abs(row[c]) < FAR
    return n_unknown > 0


def _choose(window: Floats2, past: Floats2, low: float, high: float, choice: Ints) -> None:
    """Choose the filter of each channel; fill ``past`` at the start of a run."""
    for c in range(window.shape[1]):
        here, before = window[SIDE, c], window[SIDE - 1, c]
        if not abs(before) < FAR:
            before = past[0, c] = past[1, c] = past[2, c] = here
        speed = past[0, c] - past[1, c]
        gain = speed - (past[1, c] - past[2, c])  # FILT-08
        error = abs(((before + speed) + gain / 2.0) - here)  # FILT-08
        choice[c] = 0 if error <= low else (1 if error <= high else 2)  # FILT-08


def _patch(window: Floats2, patched: Floats2) -> None:
    """``window`` with the first and the last number of the run of its middle repeated outwards."""
    n_channels = window.shape[1]
    inside = np.empty(n_channels)
    patched[SIDE] = window[SIDE]
    for step in (-1, 1):
        inside[:] = 1.0
        for k in range(1, SIDE + 1):
            row, nearer = SIDE + step * k, SIDE + step * (k - 1)
            for c in range(n_channels):
                inside[c] = inside[c] if abs(window[row, c]) < FAR else 0.0
                patched[row, c] = window[row, c] if inside[c] else patched[nearer, c]  # FILT-06


def _sum(window: Floats2, bank: Floats2, choice: Ints, total: Floats) -> None:
    """Compute the correction of each channel's filter to the middle of ``window``."""
    total[:] = 0.0
    middle = window[SIDE]
    for k in range(1, SIDE + 1):  # FILT-02
        before, after = window[SIDE - k], window[SIDE + k]
        first, second, third = bank[k, 0], bank[k, 1], bank[k, 2]
        for c in range(len(total)):
            tap = first if choice[c] == 0 else (second if choice[c] == 1 else third)
            total[c] += tap * ((before[c] - middle[c]) + (after[c] - middle[c]))  # FILT-02


DELAY = 12  # rows on each side of the one that is filtered: 25 taps
CUTOFFS = (1.0, 3.0, 5.0)  # Hz
THRESHOLDS_CM = (2.0, 12.0)  # of the error of prediction; up to the first, the lowest cutoff serves
SCALE = 2**30  # taps are multiples of 1 / SCALE
PI, TWO_PI = 3.141592653589793, 6.283185307179586
N_PAST = 3  # filtered rows of a prediction
RING = 1024  # rows that a stream holds before it moves them


class PostFilter:
    """Filter for rows that arrive one by one; it returns a row once the 12th after it is in.

    ``rate`` is rows a second, ``unit_cm`` the length unit of the numbers in cm. The output equals
    ``filter_rows`` of all rows bit for bit.
    """

    def __init__(self, n_channels: int, rate: float, unit_cm: float) -> None:
        self._settings = _settings(rate, unit_cm)
        self._rows = np.full((RING + 2 * DELAY, n_channels), np.nan)
        self._past = np.zeros((N_PAST, n_channels))
        self._next = DELAY  # place of the next row
        self._n_held = 0  # rows that have not gone out

    def push(self, row: Floats) -> Floats | None:
        """Take a row, (n_channels,), NaN where unknown; return the row of 12 before, filtered.

        None as long as there is none. Raises MotionError for a row of another size.
        """
        row = np.asarray(row, np.float64)
        if row.shape != self._rows.shape[1:]:
            raise MotionError(
                f"the row has shape {row.shape}, but the filter needs {self._rows.shape[1:]}"
            )
        if self._next == len(self._rows):
            self._rows[: 2 * DELAY] = self._rows[-2 * DELAY :]
            self._next = 2 * DELAY
        self._rows[self._next] = row
        self._next += 1
        if self._n_held < DELAY:
            self._n_held += 1
            return None
        window = self._rows[self._next - 2 * DELAY - 1 : self._next]
        result: Floats = _filter_middle(window, self._past, *self._settings)[0]
        return result

    def finish(self) -> Floats:
        """The rest, at most 12 rows, (n, n_channels); afterwards the filter is reset."""
        rest = self._rows[self._next - self._n_held - DELAY : self._next]
        rows = _filter_middle(np.concatenate((rest, self._unknown())), self._past, *self._settings)
        self._rows[:DELAY] = self._unknown()
        self._next, self._n_held = DELAY, 0
        return rows

    def _unknown(self) -> Floats:
        return np.full((DELAY, self._rows.shape[1]), np.nan)


def filter_rows(rows: Floats, rate: float, unit_cm: float) -> Floats:
    """``rows``, float64 (n_rows, n_channels), filtered; ``rate`` in rows a second.

    A channel is a coordinate of a point, in units of ``unit_cm`` cm, NaN where unknown: each run of
    known rows is filtered separately. Raises OptionError as ``filter_taps``, and for a unit that is
    not positive.
    """
    n_channels = rows.shape[1]
    unknown = np.full((DELAY, n_channels), np.nan)
    whole = np.concatenate((unknown, rows, unknown))
    return _filter_middle(whole, np.zeros((N_PAST, n_channels)), *_settings(rate, unit_cm))


def _filter_middle(rows: Floats, past: Floats, bank: Floats, low: float, high: float) -> Floats:
    """All but the first and the last 12 of ``rows``, filtered; ``past`` is updated."""
    out = np.empty((len(rows) - 2 * DELAY, rows.shape[1]))
    filter_middle(rows, past, bank, low, high, out)
    return out


def _settings(rate: float, unit_cm: float) -> tuple[Floats, float, float]:
    """Taps as numbers, (13, 3), and both thresholds in length units."""
    if not (math.isfinite(unit_cm) and unit_cm > 0):
        raise OptionError(f"post filter: a length unit of {unit_cm!r} cm is not valid")
    bank = np.ascontiguousarray(filter_taps(rate).T / SCALE)
    low, high = (threshold / unit_cm for threshold in THRESHOLDS_CM)  # FILT-08
    return bank, low, high


@lru_cache(maxsize=64)
def filter_taps(rate: float) -> Ints:
    """The filters at ``rate`` rows a second, (3, 13) integers in units of 2^-30, read-only.

    A row for each cutoff; column k is the tap of the rows k before and k after the middle one. The
    25 taps of a filter sum to exactly 1. Raises OptionError for a rate that is not positive.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise OptionError(f"post filter: {rate!r} rows a second are not a valid rate")
    taps = np.empty((len(CUTOFFS), DELAY + 1), np.int64)
    for row, cutoff in zip(taps, CUTOFFS, strict=True):
        side = _windowed_sinc(min(cutoff / rate, 0.5))
        total = side[0]
        for value in side[1:]:
            total = total + 2.0 * value  # FILT-07
        row[1:] = [math.floor(value / total * SCALE + 0.5) for value in side[1:]]  # FILT-07
        row[0] = SCALE - 2 * row[1:].sum()
    taps.setflags(write=False)
    return taps


def _windowed_sinc(cutoff: float) -> list[float]:
    """The middle and one side of the windowed ideal low-pass; ``cutoff`` in turns a row."""
    side = [2.0 * cutoff]
    for k in range(1, DELAY + 1):
        window = 0.54 + 0.46 * _sine(0.25 + k / (2 * DELAY + 1))
        side.append(_sine(cutoff * k) / (PI * k) * window)
    return side


def _sine(turns: float) -> float:
    """The sine of an angle in turns, at least 0."""
    part = turns - math.floor(turns)
    half = min(part, 1.0 - part)
    x = TWO_PI * min(half, 0.5 - half)
    square = x * x
    sine = 1.0
    for i in range(9, 0, -1):
        sine = 1.0 - square * sine / ((2 * i) * (2 * i + 1))
    sine = x * sine
    return sine if part <= 0.5 else -sine
