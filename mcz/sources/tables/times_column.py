"""Times column of a table: a clock or a signal of its own, and a frame rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from mcz.model.clock import TIMES, Timeline, times_fault
from mcz.model.motion import Channel, Signal
from mcz.model.numbers import scan
from mcz.sources.tables.layout import Clock
from mcz.sources.tables.signals import read_columns
from mcz.sources.tables.times import find_clock, half_digits_of, rate_of_times
from mcz.sources.text.rows import Rows

SECOND = Fraction(1)


@dataclass(frozen=True, slots=True)
class Times:
    """``signals``: one of times where there are some that no clock gives, named ``time``.

    ``rate`` is None where times are not whole frames apart. ``exact``: it is round or stated.
    ``note`` says why the signal has not the role of times. ``printed`` are the times of a clock.
    """

    clock: Clock | None
    signals: tuple[Signal, ...]
    rate: Fraction | None
    exact: bool
    note: str = ""
    printed: Timeline | None = None


def as_times(signal: Signal, channel: Channel) -> tuple[Signal, str]:
    """A signal of one channel as the times, and why it has not their role, "" where it has."""
    fault = times_fault(signal.masked()[:, 0])
    role = "" if fault else TIMES
    named = replace(signal, name="time", channels=(channel,), role=role)
    return named, f"the times do not count: {fault}" if fault else ""


def read_times(
    data: bytes,
    rows: Rows,
    column: int,
    stated: Sequence[Fraction] = (),
    unit: Fraction = SECOND,
    name: str = "time",
) -> Times:
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
        channel = Channel("", name, _symbol(unit))
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
    return Times(clock, signals, rate, exact, note, printed)


def _symbol(unit: Fraction) -> str:
    return {3: "ms", 6: "us", 9: "ns"}.get(len(str(unit.denominator)) - 1, "s")
