"""Compiled: the columns of a stream, as codec 14, ``fast``, decodes them.

SPEC.md, "Codec 14: fast", is normative and has the steps below in the same order. Imported on first
use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.jit import bit_length, inner

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

# Columns of a head, one row a channel.
KIND, BASE, DIGITS, DROP, TOP, DEPTH, SCALE, FROM_LAST, TAPS = range(9)
MAX_TAPS = 4
UNIT = TAPS + MAX_TAPS  # where the unit lies in the data, or -1
HEAD_SIZE = UNIT + 1
ORDINAL = 1  # of a constant
GROUP, COLUMN = 1, 2  # of a copy
CODED, CONSTANT, COPY = range(3)

N_CONTEXTS, N_SYMBOLS = 32, 49
TABLE_BITS = 12
TABLE = 1 << TABLE_BITS
LOW = 1 << 16  # of the state
DIRECT, FAR = 16, 48  # symbols: of a size itself, of a length
LENGTH_BITS = 6
WORD = 0xFFFFFFFF
MAX_LENGTH = 61  # bits of a residual

DECIMAL_WIDTH, BINARY_WIDTH = 13, 44  # digits of the greatest class in fixed point
MAX_PLAIN = 1 << 44
MAX_DIFFERENCE = 1 << 40
MAX_MISS = 1 << 48  # that is remembered, in sixteenths of a step
EXACT = 1 << 53  # up to which quotients of floats are right
LAST_POWER = 63


# Classes of mantissas: row of the powers; digits; the least mantissa; mantissas a class; the lowest
# and the highest class, by digits in fixed point.
Lattice = tuple[int, int, int, int, int, int]


class Tables(NamedTuple):
    """``symbols``: by context and slot; ``frequencies``: count << TABLE_BITS | start of each."""

    symbols: Bytes
    frequencies: Ints
    powers: Ints  # of 2 in row 0, of 10 in row 1


@inner
def quotient(a: int, b: int) -> int:
    """``a // b`` of numbers that are not negative, quicker where floats are exact."""
    return int(float(a) / float(b)) if a < EXACT else a // b


@inner
def clamp(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


@inner
def bits_at(words: Ints, i: int, n: int) -> int:
    """``n`` bits, at most 63, of ``words`` of 32 bits from bit ``i`` on."""
    if n > 32:
        return window(words, i) & WORD | (window(words, i + 32) & ((1 << (n - 32)) - 1)) << 32
    return window(words, i) & ((1 << n) - 1)


@inner
def window(words: Ints, i: int) -> int:
    """At least 32 bits from bit ``i`` on."""
    k = i >> 5 & WORD
    return (words[k] | words[k + 1] << 32) >> (i & 31)


@inner
def divided(a: int, unit: int, inverse: float) -> int:
    """``a // unit`` of numbers that are not negative, ``inverse`` being 1 / unit."""
    found = int(float(a) * inverse)
    rest = a - found * unit
    return found - 1 if rest < 0 else found + 1 if rest >= unit else found


@inner
def from_mantissa(mantissa: int, shift: int, row: int, powers: Ints) -> int:
    """A mantissa in fixed point: mantissa * base^shift, halves up."""
    if shift >= 0:
        return int(mantissa * powers[row, shift])
    unit = powers[row, min(-shift, LAST_POWER)]
    return 0 if unit > 2 * mantissa else quotient(mantissa + unit // 2, unit)


@inner
def class_of(size: int, own: int, least: int, width: int, row: int, powers: Ints) -> int:
    """The class of a size, by digits, not below ``least`` and 1; the search begins at ``own``."""
    own = max(own, least, 1)
    while own < width and powers[row, own] <= size:
        own += 1
    while own > least and own > 1 and powers[row, own - 1] > size:
        own -= 1
    return own


@inner
def expected_of(size: int, own: int, lattice: Lattice, powers: Ints) -> int:
    """The magnitude of the reduced ordinal that is nearest to ``size``, whose class is ``own``."""
    row, digits, low, per_class, least, _ = lattice
    if size < powers[row, own - 1]:
        return 0
    if own >= digits:
        unit = powers[row, own - digits]
        mantissa = min(quotient(size + (unit >> 1), unit), low + per_class - 1)
    else:
        mantissa = size * powers[row, digits - own]
    return 1 + (own - least) * per_class + mantissa - low


@inner
def quarters_of_step(base: int, shift: int) -> int:
    """About 4 log2(base^shift), at least 0: less the size of a step in fixed point."""
    return max(4 * shift if base == 2 else (425 * shift + 16) >> 5, -180)  # FAST-12


@inner
def lattice_of(plan: Ints, powers: Ints) -> Lattice:
    base = plan[BASE]
    row = 1 if base == 10 else 0
    width = DECIMAL_WIDTH if base == 10 else BINARY_WIDTH
    low = powers[row, plan[DIGITS] - 1] if base else 1
    return row, plan[DIGITS], low, low * base - low, width - plan[DEPTH], width


@inner
def first_of(plan: Ints, per_class: int) -> int:
    """What the magnitude of a number exceeds its reduced one by."""
    return (plan[TOP] - plan[DEPTH]) * per_class + (0 if plan[BASE] == 10 else -1)


@inner
def read_columns(
    data: Bytes,
    words: Ints,
    at: int,
    end: int,
    heads: Ints,
    first_column: int,
    out: Ints,
    tables: Tables,
) -> int:
    """Decode the coded channels of a group, whose words and bits are ``data`` from ``at`` to ``end``.

    ``data`` has ``SPARE`` bytes more at both ends. Returns -1, or the number of the channel that
    cannot be decoded; ``len(heads)`` where the bits do not end with the last one.
    """
    symbols, frequencies, powers = tables
    x = -1
    begin = 8 * (len(data) - end)  # of the bits, in ``words``
    i = begin
    for n in range(len(heads)):
        if heads[n, KIND] != CODED:
            continue
        if x < 0:
            x = int(data[at]) | int(data[at + 1]) << 8
            x |= int(data[at + 2]) << 16 | int(data[at + 3]) << 24
            at += 4
            if x < LOW:
                return n
        base, digits, drop = heads[n, BASE], heads[n, DIGITS], heads[n, DROP]
        from_last, f = heads[n, FROM_LAST], heads[n, SCALE] << 4
        tap0, tap1 = heads[n, TAPS], heads[n, TAPS + 1]
        tap2, tap3 = heads[n, TAPS + 2], heads[n, TAPS + 3]
        lattice = lattice_of(heads[n], powers)
        row, _, low, per_class, least, width = lattice
        high, first = low + per_class, first_of(heads[n], per_class)
        limit = powers[row, width] - 1 if base else MAX_PLAIN
        # of the class of the prediction: from, to, size of a step or how many steps make one
        own, step, shift, since, until, unit, inverse = 0, 0, 0, 0, 0, 1, 1.0
        last = d0 = d1 = d2 = d3 = 0
        c = first_column + n
        for t in range(len(out)):
            # what is expected, FAST-10
            p = (tap0 * d0 + tap1 * d1 + tap2 * d2 + tap3 * d3 + 16) >> 5
            p = clamp(p + last if from_last else p, -limit, limit)
            expected, mantissa = p, 0
            if base:
                size = abs(p)
                if size < since or size >= until:
                    own = class_of(size, own, least, width, row, powers)
                    since, until, shift = powers[row, own - 1], powers[row, own], own - digits
                    step = quarters_of_step(base, shift)
                    unit = powers[row, abs(shift)]
                    inverse = 1.0 / float(unit)
                if size < since:
                    expected = 0
                elif shift >= 0:
                    mantissa = min(divided(size + (unit >> 1), unit, inverse), high - 1)
                    expected = 1 + (own - least) * per_class + mantissa - low
                else:
                    mantissa = size * unit
                    expected = 1 + (own - least) * per_class + mantissa - low
                expected = -1 - expected if p < 0 else expected
            # what it misses, FAST-11
            if t == 0:
                k = bits_at(words, i, LENGTH_BITS)
                i += LENGTH_BITS
                if k > MAX_LENGTH:
                    return n
                miss = 1 << k >> 1
                k = max(k - 1, 0)
            else:
                length = bit_length(f + 1) - 1
                scale = max(4 * length + ((f + 1 << 2) >> length & 3) - step, 0)
                context = scale if scale < 28 else 28 + (scale & 3)
                k = clamp((scale >> 2) - 7, 0, 44)
                slot = x & (TABLE - 1)
                symbol = int(symbols[context, slot])
                frequency = frequencies[context, symbol]
                x = (frequency >> TABLE_BITS) * (x >> TABLE_BITS) + slot - (frequency & (TABLE - 1))
                word = int(data[at & WORD]) | int(data[at + 1 & WORD]) << 8
                at = at + 2 if x < LOW else at
                x = x << 16 | word if x < LOW else x
                miss = symbol << k
                if symbol >= DIRECT:
                    if symbol == FAR:
                        far = bits_at(words, i, LENGTH_BITS)
                        i += LENGTH_BITS
                        if far == 0 or far + k > MAX_LENGTH:
                            return n
                        miss, k = 1 << (far + k - 1), k + far - 1
                    else:
                        k += 2 + ((symbol - DIRECT) >> 2)
                        miss = (4 + (symbol & 3)) << k
            if k or miss:
                raw = bits_at(words, i, k + 1)
                i += k + 1
                miss |= raw >> 1
                miss = -miss if raw & 1 else miss
            # the value in fixed point and its ordinal, FAST-13
            reduced = expected + miss
            if base:
                magnitude = reduced if reduced >= 0 else -1 - reduced
                inside = mantissa - miss if p < 0 else mantissa + miss
                value = 0
                ordinal = 0
                if mantissa and low <= inside < high and (reduced < 0) == (p < 0):
                    value = inside * unit
                    if shift < 0:
                        value = divided(inside + (unit >> 1), unit, inverse)
                    ordinal = (first + magnitude) << drop
                elif magnitude:
                    k = quotient(magnitude - 1, per_class)
                    if k > heads[n, DEPTH]:
                        return n
                    inside = magnitude - 1 - k * per_class + low
                    value = from_mantissa(inside, least + k - digits, row, powers)
                    ordinal = (first + magnitude) << drop
                value = -value if reduced < 0 else value
                ordinal = -1 - ordinal if reduced < 0 else ordinal
            else:
                value = reduced
                if not -MAX_PLAIN <= value < MAX_PLAIN:
                    return n
                ordinal = value
                if drop:
                    ordinal = value << drop | bits_at(words, i, drop)
                    i += drop
            if 8 * at + i - begin > 8 * end:
                return n
            out[t, c] = ordinal
            # what is remembered, FAST-14
            if t:
                d3, d2, d1 = d2, d1, d0
                d0 = clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
                f += (min(abs(value - p) << 4, MAX_MISS) - f) >> 2
            last = value
    if x < 0:
        return -1 if at == end else len(heads)
    whole = at + (i - begin + 7 >> 3) == end and bits_at(words, i, -i & 7) == 0
    return -1 if x == LOW and whole else len(heads)
