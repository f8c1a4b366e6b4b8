"""Compiled: what codec 14, ``fast``, codes of a column, and how that becomes words and bits.

The inverse of ``kernels``, in the same order.
"""

from __future__ import annotations

from mcz.coding.quick.kernels import (
    BASE,
    DIRECT,
    DROP,
    FAR,
    FROM_LAST,
    LENGTH_BITS,
    LOW,
    MAX_DIFFERENCE,
    MAX_MISS,
    MAX_PLAIN,
    SCALE,
    TABLE,
    TABLE_BITS,
    TAPS,
    Bytes,
    Ints,
    Tables,
    clamp,
    class_of,
    expected_of,
    first_of,
    from_mantissa,
    lattice_of,
    quarters_of_step,
    quotient,
)
from mcz.jit import bit_length, inner, kernel

# Columns of ``records``, one row a value.
CONTEXT, SYMBOL, N_RAW, RAW, N_LEAST, LEAST = range(6)  # of FAR and more the length is added
RECORD_SIZE = 6
FIRST = -1  # context of a first value, whose symbol is its length


@kernel
def spread_column(ordinals: Ints, plan: Ints, powers: Ints, spread: Ints) -> None:
    """Fill ``spread`` (2, n_rows) with the reduced ordinals and the values in fixed point."""
    lattice = lattice_of(plan, powers)
    row, digits, low, per_class, least, _ = lattice
    first, drop = first_of(plan, per_class), plan[DROP]
    for t in range(len(ordinals)):
        ordinal = ordinals[t]
        if plan[BASE] == 0:
            spread[0, t] = spread[1, t] = ordinal >> drop
            continue
        magnitude = (ordinal ^ (ordinal >> 63)) >> drop
        value = 0
        if magnitude:
            magnitude -= first
            k = quotient(magnitude - 1, per_class)
            mantissa = magnitude - 1 - k * per_class + low
            value = from_mantissa(mantissa, least + k - digits, row, powers)
        spread[0, t] = -1 - magnitude if ordinal < 0 else magnitude
        spread[1, t] = -value if ordinal < 0 else value


@kernel
def record_column(
    ordinals: Ints, spread: Ints, plan: Ints, powers: Ints, costs: Ints, records: Ints
) -> int:
    """Fill ``records`` with what is coded; return the cost of that in 256ths of a bit.

    ``costs`` are those of symbols, by context.
    """
    base, drop, from_last, f = plan[BASE], plan[DROP], plan[FROM_LAST], plan[SCALE] << 4
    lattice = lattice_of(plan, powers)
    row, digits, _, _, least, width = lattice
    limit = powers[row, width] - 1 if base else MAX_PLAIN
    own = last = d0 = d1 = d2 = d3 = total = step = 0
    for t in range(len(ordinals)):
        p = plan[TAPS] * d0 + plan[TAPS + 1] * d1 + plan[TAPS + 2] * d2 + plan[TAPS + 3] * d3
        p = (p + 16) >> 5
        p = clamp(p + last if from_last else p, -limit, limit)
        expected = p
        if base:
            own = class_of(abs(p), own, least, width, row, powers)
            step = quarters_of_step(base, own - digits)
            expected = expected_of(abs(p), own, lattice, powers)
            expected = -1 - expected if p < 0 else expected
        miss, value = spread[0, t] - expected, spread[1, t]
        size = abs(miss)
        if t == 0:
            far = bit_length(size)
            context, symbol, n_raw, kept = FIRST, far, far, size - (1 << far >> 1)
        else:
            length = bit_length(f + 1) - 1
            scale = max(4 * length + ((f + 1 << 2) >> length & 3) - step, 0)
            context = scale if scale < 28 else 28 + (scale & 3)
            k = clamp((scale >> 2) - 7, 0, 44)
            part = size >> k
            far = bit_length(part)
            symbol, n_raw = part, k
            if far > 12:
                symbol, n_raw = FAR + far, k + far - 1
                total += LENGTH_BITS << 8
            elif part >= DIRECT:
                symbol = DIRECT + 4 * (far - 5) + (part >> (far - 3) & 3)
                n_raw = k + far - 3
            kept = size & ((1 << n_raw) - 1)
            total += costs[context, min(symbol, FAR)]
            if n_raw or size:
                n_raw += 1
            d3, d2, d1 = d2, d1, d0
            d0 = clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
            f += (min(abs(value - p) << 4, MAX_MISS) - f) >> 2
        last = value
        total += n_raw << 8
        records[t, CONTEXT], records[t, SYMBOL], records[t, N_RAW] = context, symbol, n_raw
        records[t, RAW] = kept << 1 | (1 if miss < 0 else 0)
        records[t, N_LEAST] = drop if base == 0 else 0
        records[t, LEAST] = ordinals[t] & ((1 << drop) - 1)
    return total


@inner
def put(data: Bytes, i: int, value: int, n: int) -> int:
    """Append ``n`` bits to ``data``, which is 0 behind bit ``i``; the bit behind them."""
    end = i + n
    while i < end:
        free = 8 - (i & 7)
        data[i >> 3] = int(data[i >> 3]) | (value << (i & 7) & 0xFF)
        value >>= free
        i += free
    return end


@kernel
def write_records(records: Ints, tables: Tables, words: Ints, data: Bytes) -> tuple[int, int, int]:
    """Code records: the state, how many ``words`` follow it, the last first, and bits of ``data``.

    ``data`` shall be 0.
    """
    i = 0
    for t in range(len(records)):
        context, symbol = records[t, CONTEXT], records[t, SYMBOL]
        if context == FIRST:
            i = put(data, i, symbol, LENGTH_BITS)
        elif symbol >= FAR:
            i = put(data, i, symbol - FAR, LENGTH_BITS)
        if records[t, N_RAW]:
            i = put(data, i, records[t, RAW], records[t, N_RAW])
        if records[t, N_LEAST]:
            i = put(data, i, records[t, LEAST], records[t, N_LEAST])
    x, at = LOW, 0
    for t in range(len(records) - 1, -1, -1):
        context = records[t, CONTEXT]
        if context != FIRST:
            frequency = tables.frequencies[context, min(records[t, SYMBOL], FAR)]
            count = frequency >> TABLE_BITS
            if x >= count << 20:
                words[at] = x & 0xFFFF
                x >>= 16
                at += 1
            x = (quotient(x, count) << TABLE_BITS) + x % count + (frequency & (TABLE - 1))
    return x, at, i
