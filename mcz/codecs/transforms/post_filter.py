"""Motion-adaptive post filter: smoother positions with a delay of 12 rows.

C.-H. Kwak, I. V. Bajić, "Online MoCap data coding with bit allocation, rate control, and
motion-adaptive post-processing", section IV. Each coordinate of a point goes through one of three
low-pass filters; its own past decides which one, row by row. SPEC.md, "Post filter", is normative
and has the steps below in the same order: binary64, + - * / alone, so that every machine makes the
same numbers.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from mcz.codecs.transforms.post_filter_kernels import filter_middle
from mcz.errors import MotionError, OptionError
from mcz.model.types import Floats, Ints

DELAY = 12  # rows on each side of the one that is filtered: 25 taps
CUTOFFS = (1.0, 3.0, 5.0)  # Hz
THRESHOLDS_CM = (2.0, 12.0)  # of the error of prediction; up to the first, the lowest cutoff serves
SCALE = 2**30  # taps are multiples of 1 / SCALE
PI, TWO_PI = 3.141592653589793, 6.283185307179586
N_PAST = 3  # filtered rows of a prediction
RING = 1024  # rows that a stream holds before it moves them


class PostFilter:
    """The filter of rows that come one by one: each is returned when the 12th after it has arrived.

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
