"""Echoes of best: runs of numbers that repeat earlier ones, of the same channel or another.

Repeated loops have them, and gaits whose halves are mirrored. SPEC.md, "Codec 2: best", is
normative for their meaning, not for the search. It also chooses the channels that predict a
channel; mcz/codecs/lossless/README.md describes both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcz.errors import FormatError
from mcz.kernels.types import Words
from mcz.model.schema import read_varint, varint
from mcz.model.types import Bools, Floats, Ints

FIELDS = 6  # of an echo, before its flags
MINUS = 1  # flag

VOTES = 8  # equal numbers that make an echo a candidate
LOOKS = 16  # at echoes, for each channel
COST = 56  # bits of an echo


@dataclass(frozen=True, slots=True)
class Echo:
    """A block of numbers that repeats the block ``lag`` rows above, or its negative."""

    row: int
    n_rows: int
    channel: int
    n_channels: int
    lag: int
    source: int
    minus: bool

    def data(self) -> bytes:
        fields = self.row, self.n_rows, self.channel, self.n_channels, self.lag, self.source
        return b"".join(map(varint, fields)) + bytes((MINUS * self.minus,))

    def covers(self, other: Echo) -> bool:
        """Return True if ``other`` has the rows, the lag and the signs of this one."""
        return (self.row, self.n_rows, self.lag, self.minus) == (
            other.row,
            other.n_rows,
            other.lag,
            other.minus,
        )


def build_echoes(echoes: Sequence[Echo]) -> bytes:
    return varint(len(echoes)) + b"".join(echo.data() for echo in echoes)


def read_echoes(data: bytes, n_rows: int, may_echo: Sequence[bool]) -> tuple[list[Echo], int]:
    """The echoes at the start of ``data``, and the offset after them.

    ``may_echo``: mask of the coded channels without rests.
    """
    count, at = read_varint(data, 0)
    left = n_rows * len(may_echo)
    if not 1 <= count <= left:  # BEST-19
        raise FormatError(f"best: the number of echoes is {count}")
    echoes = []
    for _ in range(count):
        fields = []
        for _ in range(FIELDS):
            field, at = read_varint(data, at)
            fields.append(field)
        if at >= len(data):
            raise FormatError("best: the stream is truncated within the echoes")
        if data[at] > MINUS:  # BEST-23
            raise FormatError(f"best: the flags of an echo are {data[at]:#04x}")
        row, rows, channel, channels, lag, source = fields
        echo = Echo(row, rows, channel, channels, lag, source, data[at] == MINUS)
        at += 1
        _check(echo, n_rows, may_echo)
        left -= echo.n_rows * echo.n_channels
        if left < 0:  # BEST-19
            raise FormatError("best: the echoes have more numbers than the segment")
        echoes.append(echo)
    return echoes, at


def _check(echo: Echo, n_rows: int, may_echo: Sequence[bool]) -> None:
    if not 1 <= echo.n_rows <= n_rows - echo.row:  # BEST-20
        raise FormatError(
            f"best: an echo of {echo.n_rows} rows from {echo.row} on exceeds the {n_rows} rows"
        )
    if not 1 <= echo.lag <= echo.row:  # BEST-21
        raise FormatError(f"best: the echo at row {echo.row} cannot refer {echo.lag} rows back")
    for first in (echo.channel, echo.source):
        own = may_echo[first : first + echo.n_channels]
        if not 1 <= echo.n_channels == len(own) or not all(own):  # BEST-22
            raise FormatError(
                f"best: an echo cannot have {echo.n_channels} channels from {first} on"
            )


def echo_table(echoes: Sequence[Echo], n_rows: int, n_channels: int) -> Ints:
    """Place that each number repeats, counted from 1, negative if the sign is flipped.

    (n_rows, n_channels); 0 if a number is coded. Without echoes (0, n_channels).
    """
    table = np.zeros((n_rows if echoes else 0, n_channels), np.int64)
    for echo in echoes:
        rows = np.arange(echo.row, echo.row + echo.n_rows)[:, None]
        channels = np.arange(echo.n_channels)
        places = (rows - echo.lag) * n_channels + echo.source + channels + 1
        table[rows, echo.channel + channels] = -places if echo.minus else places
    return table


# The search


def find_echoes(numbers: Ints, leads: Words, usable: Ints) -> list[Echo]:
    """Echoes in ``numbers`` (rows, channels) that probably save bytes; mostly none.

    Numbers that equal an earlier one vote for its lag and channel. ``leads`` must repeat as well.
    ``usable``: mask of the channels to search.
    """
    if len(usable) == 0 or len(numbers) < 2 * VOTES:
        return []
    own, own_leads = np.ascontiguousarray(numbers[:, usable]), leads[:, usable]
    changes = np.empty(own.shape, bool)
    changes[0] = True
    np.not_equal(own[1:], own[:-1], out=changes[1:])
    weights = _bits(own)
    covered = np.zeros(own.shape, bool)
    echoes: list[Echo] = []
    for lag, channel, source, minus in _candidates(own, changes):
        same = ~covered[lag:, channel]
        for rows in (own, own_leads):
            before = rows[:-lag, source]
            same &= rows[lag:, channel] == (-1 - before if minus else before)
        for start, stop in _runs_of_true(same):
            rows_of = slice(lag + start, lag + stop)
            if np.count_nonzero(changes[rows_of, channel]) * weights[channel] > COST:
                covered[rows_of, channel] = True
                place = int(usable[channel]), 1, lag, int(usable[source])
                echoes.append(Echo(lag + start, stop - start, *place, minus))
    return _merge_echoes(echoes)


def _bits(numbers: Ints) -> Floats:
    bends = np.abs(np.diff(numbers.astype(np.float64), n=2, axis=0, prepend=numbers[:2]))
    return np.asarray(np.log2(np.median(bends, axis=0) + 1) + 1)


def _candidates(numbers: Ints, changes: Bools) -> Iterator[tuple[int, int, int, bool]]:
    """Lag, channel, source and signs of echoes, those with most votes first."""
    n_channels = numbers.shape[1]
    places = np.flatnonzero(changes)
    flat = numbers.ravel()[places]
    sizes = np.where(flat < 0, -1 - flat, flat)
    order = np.argsort(sizes, kind="stable")
    equal = np.flatnonzero(sizes[order[1:]] == sizes[order[:-1]])
    earlier, later = order[equal], order[equal + 1]
    minus = (flat[earlier] < 0) != (flat[later] < 0)
    row, channel = np.divmod(places[later], n_channels)
    source_row, source = np.divmod(places[earlier], n_channels)
    lags = row - source_row
    keys = ((lags * n_channels + channel) * n_channels + source) * 2 + minus
    keys, votes = np.unique(keys[lags > 0], return_counts=True)
    keys, votes = keys[votes >= VOTES], votes[votes >= VOTES]
    for key in keys[np.argsort(-votes, kind="stable")][: LOOKS * n_channels].tolist():
        key, sign = divmod(key, 2)
        key, source_of = divmod(key, n_channels)
        lag, channel_of = divmod(key, n_channels)
        yield lag, channel_of, source_of, bool(sign)


def _runs_of_true(same: Bools) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(same.astype(np.int8), prepend=0, append=0))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _merge_echoes(echoes: list[Echo]) -> list[Echo]:
    merged: list[Echo] = []
    for echo in sorted(echoes, key=lambda e: (e.lag, e.row, e.n_rows, e.minus, e.channel)):
        last = merged[-1] if merged else None
        if (
            last is not None
            and last.covers(echo)
            and echo.channel == last.channel + last.n_channels
            and echo.source == last.source + last.n_channels
        ):
            merged[-1] = replace(last, n_channels=last.n_channels + 1)
        else:
            merged.append(echo)
    return merged


WINDOW = 96  # rows of a comparison of channels
CANDIDATES = 64  # channels that are compared at all
LEAST_GAIN, GAIN_ROWS = 0.05, 5.0  # octaves that one more must save; and in all rows together


def choose_references(leads: Words, most: int, most_in_all: int) -> list[tuple[int, ...]]:
    """The references of each channel of ``leads`` (rows, channels), all before it.

    At most ``most`` of one channel, and ``most_in_all`` together.
    """
    steps = np.diff(leads.astype(np.float64), axis=0, prepend=leads[:1])
    bends = _windows(np.diff(steps, axis=0, prepend=steps[:1]))
    references: list[tuple[int, ...]] = []
    for channel in range(leads.shape[1]):
        references.append(_explain(bends, channel, min(most, most_in_all)))
        most_in_all -= len(references[-1])
    return references


def _windows(values: Floats) -> Floats:
    """(windows, channels, rows of a window)."""
    n = len(values) // WINDOW
    parts = values[: n * WINDOW].reshape(n, WINDOW, -1) if n else values[None]
    return np.ascontiguousarray(parts.transpose(0, 2, 1))


def _explain(bends: Floats, channel: int, most: int) -> tuple[int, ...]:
    """Channels before ``channel`` that explain most of it, chosen one after the other."""
    rest, floor = bends[:, channel].copy(), bends.shape[2] * 0.5
    others = _reference_candidates(bends, channel, rest, floor)
    least = LEAST_GAIN + GAIN_ROWS / (bends.shape[0] * bends.shape[2])
    left = bends[:, others].copy()
    chosen: list[int] = []
    while len(chosen) < min(most, len(others)):
        sizes = np.einsum("nkw,nkw->nk", left, left) + 1e-18
        gains = _gains(rest, left, sizes, floor)
        gains[[others.index(one) for one in chosen]] = 0
        best = int(np.argmin(gains))
        if -gains[best] < least:
            break
        chosen.append(others[best])
        direction = left[:, best] / np.sqrt(sizes[:, best])[:, None]
        rest = rest - direction * np.einsum("nw,nw->n", direction, rest)[:, None]
        shares = np.einsum("nw,nkw->nk", direction, left)
        left = left - direction[:, None] * shares[:, :, None]
    return tuple(chosen)


def _reference_candidates(bends: Floats, channel: int, rest: Floats, floor: float) -> list[int]:
    """The channels before ``channel`` that explain most of it individually."""
    if channel <= CANDIDATES:
        return list(range(channel))
    before = bends[:, :channel]
    gains = _gains(rest, before, np.einsum("nkw,nkw->nk", before, before) + 1e-18, floor)
    return sorted(np.argsort(gains, kind="stable")[:CANDIDATES].tolist())


def _gains(rest: Floats, others: Floats, sizes: Floats, floor: float) -> Floats:
    """Octaves by which each of ``others`` (windows, channels, rows) reduces ``rest``."""
    products = np.einsum("nw,nkw->nk", rest, others)
    whole = np.einsum("nw,nw->n", rest, rest)[:, None]
    smaller = np.maximum(whole - products * products / sizes, 0)
    logs = np.log2(smaller + floor) - np.log2(whole + floor)
    return np.asarray(logs.mean(axis=0) * 0.5)
