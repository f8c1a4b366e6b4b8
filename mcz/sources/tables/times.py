"""The times of a table: whether they follow from frame numbers, and their frame rate."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from mcz.model.clock import TIMES, Timeline, times_fault
from mcz.model.motion import Channel, Signal
from mcz.model.numbers import Grid, GridKind, Tokens, scan
from mcz.model.numbers import decimal_kernels as kernels
from mcz.sources.tables.layout import Clock
from mcz.sources.tables.signals import read_columns
from mcz.sources.text.rows import TokenRows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNITS = (Fraction(1), Fraction(1000, 1001), *(Fraction(1, 10**n) for n in (1, 2, 3)))
MOST = 2**61  # of products, so that they are exact
LARGEST_DENOMINATOR = 10**6  # of a rate that is no round number
MOST_DECIMALS = 15
ZEROS_IN = 8  # rows that show how many zeros end all times


def stated_rate(text: str) -> Fraction | None:
    """A rate as a header prints it; None if it is no positive number."""
    text = text.strip()
    if len(text) > 64 or not DECIMAL.fullmatch(text) or not 1e-9 <= float(text) <= 1e9:
        return None
    rate = Fraction(text)
    return rate if max(rate.numerator, rate.denominator) <= MAX_TERM else None


def find_clock(
    tokens: Tokens, numbers: Ints, stated: Sequence[Fraction], seconds: Fraction = Fraction(1)
) -> Clock | None:
    """Find the clock that gives the times from the frame numbers, or None.

    ``stated``: rates that the file states. Tried are these and round ones near the mean.
    ``seconds``: what a unit of the times is.
    """
    if len(tokens) < 2:
        return None
    places = _decimals(tokens)
    for grid in (Grid(GridKind.FIXED, places), Grid(GridKind.TRIMMED, max(places, 1))):
        ordinals, known = grid.ordinals_of_tokens(tokens)
        if known.all() and ordinals.min() >= 0:
            break
    else:
        return None
    distance = int(numbers[-1] - numbers[0])
    if distance <= 0 or ordinals[-1] <= ordinals[0]:
        return None
    unit = 10**grid.digits / seconds
    mean = Fraction(distance * unit, int(ordinals[-1] - ordinals[0]))
    for rate in dict.fromkeys((*stated, *_round(mean))):
        step = unit / rate  # in units of the last digit
        offset = _offset(ordinals, numbers, step.numerator, step.denominator)
        if offset is not None:
            return Clock(grid, step.numerator, step.denominator, offset)
    return None


def _decimals(tokens: Tokens) -> int:
    places = int((tokens.fields[:, 2] >> kernels.FRACTION_DIGITS).max())
    return min(places, MOST_DECIMALS)


def _round(rate: Fraction) -> list[Fraction]:
    """Round rates near ``rate``, and itself; none near 0."""
    rounded = [round(rate / unit) * unit for unit in UNITS]
    return [r for r in (*rounded, rate.limit_denominator(LARGEST_DENOMINATOR)) if r > 0]


def _offset(ordinals: Ints, numbers: Ints, numerator: int, denominator: int) -> int | None:
    """An offset with (number * numerator + offset) div denominator = ordinal for all; None: none.

    The one nearest to 0 of those that there are.
    """
    largest = max(int(np.abs(ordinals).max()) + 1, 1) * denominator
    if max(largest, int(np.abs(numbers).max()) * numerator) > MOST:
        return None
    least = ordinals * denominator - numbers * numerator
    low, high = int(least.max()), int(least.min()) + denominator - 1
    return None if low > high else min(max(low, 0), high)


def rate_of_times(
    times: Floats,
    half_digits: Sequence[float],
    stated: Sequence[Fraction] = (),
    numbers: Ints | None = None,
) -> tuple[Fraction | None, bool]:
    """The rate of times that are whole frames apart, to half a unit of their last digit.

    Frames are counted by ``numbers``, those of the frames in the file, else by rows, else, if
    rows are missing that nothing counts, by the steps between the times, most of which are one
    frame. ``half_digits`` are tried in order. Returns None if no count fits; and whether the
    rate is a round or a stated one.
    """
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        return None, True
    counts = [np.arange(len(times)), *([numbers - numbers[0]] if numbers is not None else [])]
    counts = [count for count in reversed(counts) if count[-1] > 0]
    noise = 8 * float(np.spacing(np.abs(times).max()))
    stated_rates = [(count, list(stated)) for count in counts]
    near = [(count, _round(_mean_rate(times, count))) for count in counts]
    run = _longest_run(times)
    of_run = _round(_mean_rate(run, np.arange(len(run)))) if len(run) > 1 else []
    for k, half_digit in enumerate(half_digits):
        digits = _Digits(2 * half_digit, noise)
        rates = chain(
            _counted_rates(times, stated_rates, digits, 1.0),
            _stepped_rates(
                times, stated, digits, 0.99
            ),  # all of a digit: halfway between two frames
            _counted_rates(times, near, digits),
            _stepped_rates(times, of_run, digits),
            _counted_rates(times, near, digits, 1.0) if k == 0 else (),
        )
        rate = next(rates, None)
        if rate is not None:
            is_round = any((rate / unit).denominator == 1 for unit in UNITS)
            return rate, rate in stated or is_round
    return None, True


@dataclass(frozen=True, slots=True)
class _Digits:
    """The last ``digit`` of some times, and the ``noise`` of their binary64."""

    digit: float
    noise: float

    def fit(self, times: Floats, count: Floats | Ints, rate: Fraction, share: float = 0) -> bool:
        """Return True if times are ``count`` frames from one start, each rounded to a digit.

        Digits of more than a quarter of a frame fit almost any rate: only a ``share`` of them may
        be missed.
        """
        spread = np.ptp(times - times[0] - count / float(rate))
        allowed = self.digit if 4 * self.digit * rate <= 1 else share * self.digit
        return bool(spread <= allowed + self.noise)


def _counted_rates(
    times: Floats,
    candidates: Sequence[tuple[Ints, list[Fraction]]],
    digits: _Digits,
    share: float = 0,
) -> Iterator[Fraction]:
    """The rates of the candidates that fit, each with a count of the frames."""
    for count, rates in candidates:
        yield from (rate for rate in rates if digits.fit(times, count, rate, share))


def _mean_rate(times: Floats, count: Ints) -> Fraction:
    """Frames a second on average; 0 if that is absurd."""
    with np.errstate(over="ignore", divide="ignore"):
        mean = float(count[-1] / (times[-1] - times[0]))
    return Fraction(mean) if 1e-9 < mean < 1e9 else Fraction(0)


def _stepped_rates(
    times: Floats, rates: Sequence[Fraction], digits: _Digits, share: float = 0
) -> Iterator[Fraction]:
    """The rates by which most of rising times follow each other by one frame, others by more."""
    if not (np.diff(times) > 0).all():
        return
    for rate in rates:
        count = np.rint((times - times[0]) * float(rate))
        if not count[-1] < MOST:
            continue
        frames = np.diff(count)
        usual = np.count_nonzero(frames == 1)
        is_apart = bool((frames >= 1).all()) and 2 * usual > len(frames)
        if is_apart and digits.fit(times, count, rate, share):
            yield rate


def _longest_run(times: Floats) -> Floats:
    """The longest part of some times without a gap."""
    steps = np.diff(times)
    edges = np.flatnonzero(steps > 1.5 * np.median(steps))
    starts, stops = np.append(0, edges + 1), np.append(edges, len(steps))
    longest = int(np.argmax(stops - starts))
    return times[starts[longest] : stops[longest] + 1]


def half_digits_of(data: bytes, stop: Ints, tokens: Tokens) -> list[float]:
    """Half a unit of the last digit that times have, as they are printed and without zeros.

    ``stop``: where each token ends, which zeros may follow that all of them have. These are digits,
    or say nothing.
    """
    places = _decimals(tokens)
    zeros = 0
    if places:
        ends = [int(at) for at in stop[:ZEROS_IN]]
        zeros = min(len(data[at : at + 32]) - len(data[at : at + 32].lstrip(b"0")) for at in ends)
    return [0.5 * 10.0**-each for each in dict.fromkeys((places + zeros, places))]


MAX_TERM = 2**53 - 1  # of a frame rate's numerator and denominator
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def frame_rate(frame_time: str) -> tuple[Fraction | None, bool]:
    """Frames a second, and whether that is exactly the reciprocal of the seconds printed.

    A rate whose reciprocal rounds to the printed digits is taken for the true one, if it is an
    integer, or an integer divided by 1.001, or, if at least 6 more digits are printed than
    would tell such rates apart, one of at most 3 decimals; in this order. Otherwise it is the
    reciprocal itself. None if the frame time is zero, negative, absurd or not a number.
    """
    if len(frame_time) > 64 or not DECIMAL.fullmatch(frame_time):
        return None, True
    if not 1e-9 <= float(frame_time) <= 1e9:
        return None, True
    time = Fraction(frame_time)
    half_digit = Fraction(10) ** int(Decimal(frame_time).as_tuple().exponent) / 2
    half_digit += time / 2**53  # it may have been a binary64 before, itself rounded
    reciprocal = 1 / time
    spread = half_digit / time * reciprocal  # of the rates that print alike, about
    units = [Fraction(1), Fraction(1000, 1001)]
    units += [Fraction(1, n) for n in (10, 100, 1000) if spread * 10**6 < Fraction(1, n)]
    for unit in units:
        rate = round(reciprocal / unit) * unit
        if rate and abs(1 / rate - time) <= half_digit and rate.numerator <= MAX_TERM:
            return rate, 1 / rate == time
    if max(reciprocal.numerator, reciprocal.denominator) <= MAX_TERM:
        return reciprocal, True
    return reciprocal.limit_denominator(min(MAX_TERM, int(MAX_TERM / (reciprocal + 1)))), False


def frame_time(rate: Fraction | None) -> str:
    """The seconds a frame takes, as the shortest decimal of its binary64; 0 if unknown."""
    return "0" if rate is None else repr(float(1 / rate))


SECOND = Fraction(1)


@dataclass(frozen=True, slots=True)
class TableTimes:
    """``signals``: one of times if there are some that no clock gives, named ``time``.

    ``rate`` is None if times are not whole frames apart. ``exact``: it is round or stated.
    ``note`` says why the signal has not the role of times. ``printed`` are the times of a clock.
    """

    clock: Clock | None
    signals: tuple[Signal, ...]
    rate: Fraction | None
    exact: bool
    note: str = ""
    printed: Timeline | None = None


def as_times(signal: Signal, channel: Channel) -> tuple[Signal, str]:
    """A signal of one channel as the times, and why it has not their role, "" if it has."""
    fault = times_fault(signal.masked()[:, 0])
    role = "" if fault else TIMES
    named = replace(signal, name="time", channels=(channel,), role=role)
    return named, f"the times do not count: {fault}" if fault else ""


def read_times(
    data: bytes,
    rows: TokenRows,
    column: int,
    stated: Sequence[Fraction] = (),
    unit: Fraction = SECOND,
    name: str = "time",
) -> TableTimes:
    """The times in a column; ``stated``: rates that the file states; ``unit`` in seconds."""
    present = np.flatnonzero(rows.stop[:, column])
    tokens = scan(data, rows.start[present, column], rows.stop[present, column])
    whole = len(tokens) == rows.n_rows and not tokens.bad().any()
    numbers = rows.numbers if rows.numbers is not None else np.arange(1, rows.n_rows + 1)
    clock = find_clock(tokens, numbers, stated, unit) if whole else None
    used = any(
        run.column <= column < run.column + run.n_columns
        for pattern in rows.patterns
        for run in pattern.runs
    )
    signals: tuple[Signal, ...] = ()
    note = ""
    if clock is None and used:
        symbol = {3: "ms", 6: "us", 9: "ns"}.get(len(str(unit.denominator)) - 1, "s")
        channel = Channel("", name, symbol)
        signal, note = as_times(read_columns(data, rows, [column]), channel)
        signals = (signal,)
    rate, exact = None, True
    if whole:
        digits = half_digits_of(data, rows.stop[present, column], tokens)
        seconds = tokens.values() * float(unit)
        in_seconds = [digit * float(unit) for digit in digits]
        rate, exact = rate_of_times(seconds, in_seconds, stated, rows.numbers)
    if rate is None and stated and (rows.n_rows < 2 or not len(tokens)):
        rate = stated[0]
    printed = None
    if clock is not None:
        half = 0.5 * 10.0**-clock.grid.digits
        printed = Timeline(tokens.values() * float(unit), rate, half * float(unit))
    return TableTimes(clock, signals, rate, exact, note, printed)
