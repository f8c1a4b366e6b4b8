"""Compiled: what ``fast``, codes of a column, and how that becomes words and bits.

The inverse of ``kernels``, in the same order.
"""

from __future__ import annotations

from mcz.coding.quick.kernels import (
    BASE,
    DIGITS,
    DIRECT,
    DROP,
    FAR,
    FIRST,
    FROM_LAST,
    HIGH,
    LEAST,
    LEAST_STATE,
    LENGTH_BITS,
    LIMIT,
    LOW,
    MAX_DIFFERENCE,
    PER_CLASS,
    ROW,
    SCALE,
    SYMBOL_BITS,
    TABLE,
    TABLE_BITS,
    TAPS,
    Tables,
    clamp,
    class_of,
    from_mantissa,
    quotient,
)
from mcz.kernels import bit_length, kernel
from mcz.kernels.types import Bytes, Ints, Ints2

# Columns of ``records``, one row a value.
CONTEXT, SYMBOL, N_RAW, RAW, N_DROPPED, DROPPED = range(6)  # of FAR and more the length is added
RECORD_SIZE = 6
MAX_VALUE_SIZE = 12  # bytes of bits beside a symbol
NEW = -1  # context of a first value, whose symbol is its length


def expected_of(size: int, own: int, plan: Ints, powers: Ints2) -> int:
    """The magnitude of the rank that is nearest to ``size``, whose class is ``own``."""
    row, shift = plan[ROW], own - plan[DIGITS]
    if size < powers[row, own - 1]:
        return 0
    if shift >= 0:
        unit = powers[row, shift]
        mantissa = min(quotient(size + (unit >> 1), unit), plan[HIGH] - 1)
    else:
        mantissa = size * powers[row, -shift]
    return int(1 + (own - plan[LEAST]) * plan[PER_CLASS] + mantissa - plan[LOW])


def spread_column(ordinals: Ints, plan: Ints, powers: Ints2, spread: Ints2) -> None:
    """Fill ``spread`` (3, n_rows): ranks, values in fixed point, and the size of a step there."""
    drop, per_class = plan[DROP], plan[PER_CLASS]
    for t in range(len(ordinals)):
        ordinal = ordinals[t]
        if plan[BASE] == 0:
            spread[0, t] = spread[1, t] = ordinal >> drop
            spread[2, t] = 1
            continue
        magnitude = (ordinal ^ (ordinal >> 63)) >> drop
        value, step = 0, 1
        if magnitude:
            magnitude -= plan[FIRST]
            k = quotient(magnitude - 1, per_class)
            mantissa = magnitude - 1 - k * per_class + plan[LOW]
            shift = plan[LEAST] + k - plan[DIGITS]
            value = from_mantissa(mantissa, shift, plan[ROW], powers)
            step = powers[plan[ROW], max(shift, 0)]
        spread[0, t] = -1 - magnitude if ordinal < 0 else magnitude
        spread[1, t] = -value if ordinal < 0 else value
        spread[2, t] = step


def record_column(ordinals: Ints, spread: Ints2, plan: Ints, powers: Ints2, records: Ints2) -> None:
    """Fill ``records`` with what is coded."""
    base, drop, from_last, f = plan[BASE], plan[DROP], plan[FROM_LAST], plan[SCALE] << 4
    limit, own = plan[LIMIT], 0
    last = d0 = d1 = d2 = d3 = quarters = 0
    for t in range(len(ordinals)):
        p = plan[TAPS] * d0 + plan[TAPS + 1] * d1 + plan[TAPS + 2] * d2 + plan[TAPS + 3] * d3
        p = (p + 16) >> 5
        p = clamp(p + last if from_last else p, -limit, limit)
        expected = p
        if base:
            own = class_of(abs(p), own, plan, powers)
            shift = own - plan[DIGITS]
            quarters = 4 * shift if base == 2 else (425 * shift + 16) >> 5
            expected = expected_of(abs(p), own, plan, powers)
            expected = -1 - expected if p < 0 else expected
        miss, value = spread[0, t] - expected, spread[1, t]
        size = abs(miss)
        if t == 0:
            far = bit_length(size)
            context, symbol, n_raw, kept = NEW, far, far, size - (1 << far >> 1)
        else:
            length = bit_length(f + 1) - 1
            scale = max(4 * length + ((f + 1 << 2) >> length & 3) - quarters, 0)
            context = scale if scale < 28 else 28 + (scale & 3)
            k = clamp((scale >> 2) - 7, 0, 44)
            part = size >> k
            far = bit_length(part)
            symbol, n_raw = part, k
            if far > 12:
                symbol, n_raw = FAR + far, k + far - 1
            elif part >= DIRECT:
                symbol = DIRECT + 4 * (far - 5) + (part >> (far - 3) & 3)
                n_raw = k + far - 3
            kept = size & ((1 << n_raw) - 1)
            if n_raw or size:
                n_raw += 1
            d3, d2, d1 = d2, d1, d0
            d0 = clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
            f += ((abs(value - p) << 4) - f) >> 2
        last = value
        records[t, CONTEXT], records[t, SYMBOL], records[t, N_RAW] = context, symbol, n_raw
        records[t, RAW] = kept << 1 | (1 if miss < 0 else 0)
        records[t, N_DROPPED] = drop if base == 0 else 0
        records[t, DROPPED] = ordinals[t] & ((1 << drop) - 1)


def put(data: Bytes, i: int, value: int, n: int) -> int:
    """Append ``n`` bits to ``data``, which is 0 behind bit ``i``; the bit behind them."""
    end = i + n
    while i < end:
        free = 8 - (i & 7)
        data[i >> 3] = int(data[i >> 3]) | (value << (i & 7) & 0xFF)
        value >>= free
        i += free
    return end


def write_bits(records: Ints2, data: Bytes) -> int:
    """Write all that is no symbol to ``data``, which is 0; how many bits there are."""
    i = 0
    for t in range(len(records)):
        context, symbol = records[t, CONTEXT], records[t, SYMBOL]
        if context == NEW:
            i = put(data, i, symbol, LENGTH_BITS)
        elif symbol >= FAR:
            i = put(data, i, symbol - FAR, LENGTH_BITS)
        if records[t, N_RAW]:
            i = put(data, i, records[t, RAW], records[t, N_RAW])
        if records[t, N_DROPPED]:
            i = put(data, i, records[t, DROPPED], records[t, N_DROPPED])
    return i


def write_words(records: Ints2, tables: Tables, words: Ints) -> tuple[int, int]:
    """Code the symbols: the state, and how many ``words`` follow it, the last of them first."""
    x, at = LEAST_STATE, 0
    for t in range(len(records) - 1, -1, -1):
        context = records[t, CONTEXT]
        if context != NEW:
            frequency = tables.frequencies[context << SYMBOL_BITS | min(records[t, SYMBOL], FAR)]
            count = frequency >> TABLE_BITS
            if x >= count << 20:
                words[at] = x & 0xFFFF
                x >>= 16
                at += 1
            x = (quotient(x, count) << TABLE_BITS) + x % count + (frequency & (TABLE - 1))
    return x, at


@kernel
def write_records(
    records: Ints2, ends: Ints, tables: Tables, words: Ints, data: Bytes, sizes: Ints2
) -> None:
    """Code the records of groups, which end at ``ends``.

    Words and bits of a group begin where its records do, ``data`` having MAX_VALUE_SIZE bytes for
    each. ``sizes`` (groups, 3) get its state, how many words follow it, and how many bits.
    """
    start = 0
    for n in range(len(ends)):
        own = records[start : ends[n]]
        state, n_words = write_words(own, tables, words[start : ends[n]])
        sizes[n, 0], sizes[n, 1] = state, n_words
        sizes[n, 2] = write_bits(own, data[MAX_VALUE_SIZE * start : MAX_VALUE_SIZE * ends[n]])
        start = ends[n]
