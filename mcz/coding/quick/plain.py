"""The streams of a segment, as ``fast``, decodes them where there is no compiler.

The loops of ``kernels`` and ``stream_kernels`` in the Python that runs quickest: numbers of Python
in lists and local names, one function a channel. It decodes 62 channels some five times as quickly
as plain Python runs those loops. SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from mcz.coding.quick.head_kernels import BAD_BITS
from mcz.coding.quick.kernels import (
    BASE,
    CODED,
    DEPTH,
    DIGITS,
    DIRECT,
    DROP,
    FAR,
    FAR_OFF,
    FIRST,
    FROM_LAST,
    HIGH,
    KIND,
    LAST_POWER,
    LEAST,
    LEAST_STATE,
    LENGTH_BITS,
    LIMIT,
    LOW,
    MAX_DIFFERENCE,
    MAX_LENGTH,
    MAX_PLAIN,
    N_CONTEXTS,
    PARTS,
    PER_CLASS,
    PLAN_SIZE,
    RESTS,
    ROW,
    SCALE,
    SYMBOL_BITS,
    TABLE,
    TABLE_BITS,
    TAPS,
    WIDTH,
    settle,
)
from mcz.coding.quick.stream_kernels import (
    AT,
    BEGIN,
    BIT,
    CHANNEL,
    END,
    FLOW_SIZE,
    NO_ROOM,
    STOP,
    Rows,
    Streams,
    X,
    ends_well,
    open_stream,
)
from mcz.coding.quick.stream_kernels import FIRST as FIRST_CHANNEL
from mcz.coding.quick.tables import tables

SHORT = 33  # bits that a window has for certain, of those that begin in its first 32


class Distribution(NamedTuple):
    """Of a scale: the symbols by slot, counts and starts by symbol, and how many bits are raw."""

    symbols: bytes
    counts: list[int]
    starts: list[int]
    raw: int


class Track(NamedTuple):
    """The class of a prediction, see ``kernels``: its sizes, its step, what is added to ranks.

    ``floor``: down to which sizes are treated alike; of the lowest class all that are below it.
    """

    floor: int
    since: int
    until: int
    step: int
    is_coarse: bool  # a mantissa is so many steps; else a step is so many mantissas
    quarters: int
    offset: int


@dataclass(slots=True)
class Flow:
    """What a stream is decoded from: the state, words from the one end, bits from the other.

    ``windows[j]`` are 64 bits from bit 32 j on. ``size``: bits of all that is behind the state.
    """

    x: int
    words: list[int]
    word: int
    windows: list[int]
    bit: int
    size: int

    def take(self, n: int) -> int:
        """The next ``n`` bits, at most 63. Raises IndexError far behind the end."""
        i = self.bit
        self.bit = i + n
        found = self.windows[i >> 5] >> (i & 31)
        if n > SHORT:
            found = found & 0xFFFFFFFF | self.windows[(i >> 5) + 1] >> (i & 31) << 32
        return found & ((1 << n) - 1)


def read_streams(streams: Streams, plans: Any, rows: Rows) -> tuple[int, int]:
    """As ``stream_kernels.read_streams``, one stream after the other."""
    rest = np.zeros(PLAN_SIZE, np.int64)
    rest[KIND], rest[SCALE] = CODED, 1
    powers = tables().powers
    settle(rest, powers)
    for group in range(len(streams.bounds) - 1):
        flow = np.zeros(FLOW_SIZE, np.int64)
        fault = open_stream(streams, group, plans, powers, flow, rows.ordinals)
        if fault >= 0:
            return int(flow[CHANNEL]), fault
        coded = [n for n in range(flow[FIRST_CHANNEL], flow[STOP]) if plans[n, KIND] == CODED]
        rested = [n for n in coded if plans[n, PARTS] & RESTS]  # FAST-02, LOSS-38
        if rested and not rows.rests.shape[1]:
            return NO_ROOM, BAD_BITS
        jobs = [(n, plans[n], rows.ordinals) for n in coded]
        jobs += [(n, rest, rows.rests) for n in rested]
        found = _flow_of(streams.data, flow) if coded else None
        for n, plan, out in jobs:
            column = _column(found, plan.tolist(), len(out))
            if column is None:
                return n, BAD_BITS
            out[:, n] = column
        if found is not None:
            flow[X], flow[BIT] = found.x, flow[BEGIN] + found.bit
            flow[AT] += 2 * found.word
        if not ends_well(streams.data, flow):
            return int(flow[STOP]) - 1, BAD_BITS
    return -1, -1


def _flow_of(data: Any, flow: Any) -> Flow:
    """The words behind the state, and the bits before the end, with some zeros behind both."""
    stream = data[flow[AT] : flow[END]].tobytes()
    words = np.frombuffer(stream + bytes(4 - len(stream) % 2), "<u2")
    halves = np.frombuffer(stream[::-1] + bytes(16 - len(stream) % 4), "<u4").astype(np.uint64)
    windows = halves[:-1] | halves[1:] << np.uint64(32)
    return Flow(int(flow[X]), words.tolist(), 0, windows.tolist(), 0, 8 * len(stream))


def _column(flow: Flow | None, plan: list[int], n_rows: int) -> list[int] | None:
    """The ordinals of a channel; None where they are none, or the stream ends before they do."""
    assert flow is not None
    try:
        column = _read_channel(flow, plan, n_rows)
    except IndexError:
        return None
    return column if 16 * flow.word + flow.bit <= flow.size else None


def _read_channel(flow: Flow, plan: list[int], n_rows: int) -> list[int] | None:
    """Decode a channel: its ordinals; None where one is wrong.

    One loop for all, with the steps and the names of ``kernels.next_value``: a call would take as
    long as some ten of them.
    """
    base, drop, from_last, low, high = (plan[n] for n in (BASE, DROP, FROM_LAST, LOW, HIGH))
    tap0, tap1, tap2, tap3 = plan[TAPS : TAPS + 4]
    has_taps, limit, first = any(plan[TAPS : TAPS + 4]), plan[LIMIT], plan[FIRST]
    scales, powers = _distributions(), tables().powers.tolist()
    words, windows, take = flow.words, flow.windows, flow.take
    started = _first_value(flow, plan, powers)
    if started is None:
        return None
    last, ordinal = started
    column = [ordinal]
    x, word, i, f = flow.x, flow.word, flow.bit, plan[SCALE] << 4
    d0 = d1 = d2 = d3 = floor = since = until = quarters = offset = half = 0
    step, is_coarse = 1, True
    for _ in range(1, n_rows):
        # what is expected
        p = tap0 * d0 + tap1 * d1 + tap2 * d2 + tap3 * d3 + 16 >> 5 if has_taps else 0
        if from_last:
            p += last
        if p > limit:  # FAST-14
            p = limit
        elif p < -limit:
            p = -limit
        size = p if p >= 0 else -p
        if base and not floor <= size < until:
            floor, since, until, step, is_coarse, quarters, offset = _track(size, plan, powers)
            half = step >> 1
        # what that misses
        length = (f + 1).bit_length()
        scale = 4 * length + ((f + 1 << 2) >> length - 1) - 8 - quarters
        symbols, counts, starts, k = scales[scale if scale > 0 else 0]
        slot = x & TABLE - 1
        symbol = symbols[slot]
        x = counts[symbol] * (x >> TABLE_BITS) + slot - starts[symbol]  # FAST-08
        if x < LEAST_STATE:
            x = x << 16 | words[word]
            word += 1
        if symbol < DIRECT:
            miss = symbol << k
        elif symbol < FAR:
            k += 2 + (symbol - DIRECT >> 2)
            miss = 4 + (symbol & 3) << k
        else:
            far = windows[i >> 5] >> (i & 31) & 63
            i += LENGTH_BITS
            if not 0 < far <= MAX_LENGTH - k:  # FAST-15
                return None
            k += far - 1
            miss = 1 << k
        if k or miss:
            if k < SHORT:
                raw = windows[i >> 5] >> (i & 31) & (2 << k) - 1
                i += k + 1
            else:
                flow.bit = i
                raw, i = take(k + 1), flow.bit
            miss |= raw >> 1
            if raw & 1:
                miss = -miss
        # the number
        if base:
            minus = p < 0
            mantissa = inside = FAR_OFF
            if size >= since:  # not below the lowest class
                mantissa = min((size + half) // step, high - 1) if is_coarse else size * step
                inside = mantissa - miss if minus else mantissa + miss
            if low <= inside < high:
                ordinal = offset + first + inside << drop
                value = inside * step if is_coarse else (inside + half) // step
                if minus:
                    ordinal, value = ~ordinal, -value
            else:  # another class or sign
                expected = mantissa + offset if size >= since else 0
                found = _of_rank((~expected if minus else expected) + miss, plan, powers)
                if found is None:
                    return None
                value, ordinal = found
        else:
            value = p + miss
            if not -MAX_PLAIN <= value < MAX_PLAIN:  # FAST-11
                return None
            ordinal = value
            if drop:
                flow.bit = i
                ordinal, i = value << drop | take(drop), flow.bit
        column.append(ordinal)
        # what is remembered
        miss = value - p
        f += ((miss if miss >= 0 else -miss) << 4) - f >> 2  # FAST-14
        d3, d2, d1, d0 = d2, d1, d0, value - last
        if not -MAX_DIFFERENCE <= d0 <= MAX_DIFFERENCE:
            d0 = MAX_DIFFERENCE if d0 > 0 else -MAX_DIFFERENCE
        last = value
    flow.x, flow.word, flow.bit = x, word, i
    return column


def _first_value(flow: Flow, plan: list[int], powers: list[list[int]]) -> tuple[int, int] | None:
    """The first value of a channel, in fixed point, and its ordinal; None where it is none."""
    n, rank = flow.take(LENGTH_BITS), 0
    if n > MAX_LENGTH:  # there is no such rank
        return None
    if n:
        raw = flow.take(n)
        rank = 1 << n - 1 | raw >> 1  # FAST-13
        rank = -rank if raw & 1 else rank
    if plan[BASE]:
        return _of_rank(rank, plan, powers)
    ordinal = rank << plan[DROP] | flow.take(plan[DROP])
    return (rank, ordinal) if -MAX_PLAIN <= rank < MAX_PLAIN else None  # FAST-11


def _of_rank(rank: int, plan: list[int], powers: list[list[int]]) -> tuple[int, int] | None:
    """Of a rank: value in fixed point, and ordinal; None where there is no such one."""
    magnitude = rank if rank >= 0 else ~rank
    if magnitude == 0:
        return 0, rank
    k, m = divmod(magnitude - 1, plan[PER_CLASS])
    if k > plan[DEPTH]:  # FAST-10
        return None
    mantissa, shift = m + plan[LOW], plan[LEAST] + k - plan[DIGITS]
    unit = powers[plan[ROW]][min(abs(shift), LAST_POWER)]
    value = mantissa * unit if shift >= 0 else (mantissa + unit // 2) // unit
    ordinal = plan[FIRST] + magnitude << plan[DROP]  # FAST-09
    return (value, ordinal) if rank >= 0 else (-value, ~ordinal)


def _track(size: int, plan: list[int], powers: list[list[int]]) -> Track:
    """The class of a predicted size."""
    row, least = powers[plan[ROW]], max(plan[LEAST], 1)
    own = max(bisect_right(row, size, 0, plan[WIDTH]), least)
    shift = own - plan[DIGITS]
    quarters = 4 * shift if plan[BASE] == 2 else 425 * shift + 16 >> 5  # FAST-14
    offset = 1 + (own - plan[LEAST]) * plan[PER_CLASS] - plan[LOW]
    since = row[own - 1]
    floor = since if own > least else 0
    return Track(floor, since, row[own], row[abs(shift)], shift >= 0, quarters, offset)


@cache
def _distributions() -> list[Distribution]:
    """Of each scale the distribution of its context."""
    known = tables()
    symbols, frequencies = known.symbols.tobytes(), known.frequencies
    counts, starts = frequencies >> TABLE_BITS, frequencies & TABLE - 1
    parts = [slice(c << SYMBOL_BITS, c + 1 << SYMBOL_BITS) for c in range(N_CONTEXTS)]
    slots = [symbols[c << TABLE_BITS : c + 1 << TABLE_BITS] for c in range(N_CONTEXTS)]
    of_counts = [counts[part].tolist() for part in parts]
    of_starts = [starts[part].tolist() for part in parts]
    return [
        Distribution(slots[scale >> 8], of_counts[scale >> 8], of_starts[scale >> 8], scale & 63)
        for scale in known.scales.tolist()
    ]
