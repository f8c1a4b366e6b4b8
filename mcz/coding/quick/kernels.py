"""Compiled: the values of channels, as ``fast``, decodes them.

SPEC.md, "Codec 1: fast", is normative and has the steps below in the same order. Imported on first
use only.
"""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels import bit_length, truncated
from mcz.kernels.types import Bytes, Floats, Ints, Ints2

MAX_TAPS = 4
# Columns of plans, one row a channel: what its head says,
KIND, BASE, DIGITS, DROP, TOP, DEPTH, SCALE, FROM_LAST, TAPS = range(9)
UNIT = TAPS + MAX_TAPS  # where the unit lies in the data, or -1
SHIFTS, PARTS = UNIT + 1, UNIT + 2  # of products, or 0; of a law, and 8 more, or 0
RESTS = 4  # in parts: ordinals are added that are coded behind all channels
ORDINAL = 1  # of a constant
GROUP, COLUMN = 1, 2  # of a copy
# and what follows from that for numbers in classes of mantissas: which powers; the least mantissa
# and one more than the greatest; how many make a class; by how much magnitudes exceed ranks;
# the lowest and the highest class, by digits in fixed point; the greatest prediction.
ROW, LOW, HIGH, PER_CLASS, FIRST, LEAST, WIDTH, LIMIT = range(PARTS + 1, PARTS + 9)
PLAN_SIZE = PARTS + 9
CODED, CONSTANT, COPY = range(3)

N_CONTEXTS, N_SYMBOLS = 32, 49
TABLE_BITS, SYMBOL_BITS = 12, 6
TABLE = 1 << TABLE_BITS
LEAST_STATE = 1 << 16
DIRECT, FAR = 16, 48  # symbols: of a size itself, of a length
LENGTH_BITS = 6
MAX_LENGTH = 61  # bits of what a prediction misses
WORD = 0xFFFFFFFF

DECIMAL_WIDTH, BINARY_WIDTH = 13, 44  # digits of the greatest class in fixed point
MAX_PLAIN = 1 << 44
MAX_DIFFERENCE = 1 << 40
EXACT = 1 << 53  # up to which quotients of floats are right
LAST_POWER = 63
FAR_OFF = -(1 << 62)  # a mantissa in no class, whatever is added

# Columns of tracks: the class of the last prediction, its sizes from and to, the size of a step in
# fixed point or how many steps make one, and 4 log2 of it; magnitude - mantissa.
OWN, SINCE, UNTIL, SHIFT, STEP, QUARTERS, OFFSET = range(7)
TRACK_SIZE = 7


class Tables(NamedTuple):
    """``symbols``: by context and slot; ``frequencies``: count << TABLE_BITS | start of each, by
    context and 64 symbols; ``scales``: of each scale its context << 8 | how many bits are raw.
    """

    symbols: Bytes
    frequencies: Ints
    scales: Ints
    powers: Ints2  # of 2 in row 0, of 10 in row 1


def quotient(a: int, b: int) -> int:
    """``a // b`` of numbers that are not negative, quicker where floats are exact."""
    return truncated(float(a) / float(b)) if a < EXACT else a // b


def divided(a: int, unit: int, inverse: float) -> int:
    """``a // unit`` of numbers that are not negative, ``inverse`` being 1 / unit."""
    found = truncated(float(a) * inverse)
    rest = a - found * unit
    return found - 1 if rest < 0 else found + 1 if rest >= unit else found


def clamp(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


def eight_bytes(data: Bytes, at: int) -> int:
    """The number of 64 bits that the bytes from ``at`` on are, the first one the greatest."""
    k = at & WORD
    high = int(data[k]) << 56 | int(data[k + 1]) << 48 | int(data[k + 2]) << 40
    mid = int(data[k + 3]) << 32 | int(data[k + 4]) << 24 | int(data[k + 5]) << 16
    return high | mid | int(data[k + 6]) << 8 | int(data[k + 7])


def window(data: Bytes, i: int) -> int:
    """At least 56 bits from bit ``i`` on: ``data`` is a number whose last byte is the lowest."""
    return eight_bytes(data, len(data) - 8 - (i >> 3)) >> (int(i) & 7)


def bits_at(data: Bytes, i: int, n: int) -> int:
    """``n`` bits, at most 63, from bit ``i`` on."""
    if n > 56:
        rest = window(data, i + 32) & ((1 << int(n - 32)) - 1)
        return window(data, i) & WORD | rest << 32
    found: int = window(data, i) & ((1 << int(n)) - 1)
    return found


def from_mantissa(mantissa: int, shift: int, row: int, powers: Ints2) -> int:
    """A mantissa in fixed point: mantissa * base^shift, halves up."""
    if shift >= 0:
        return int(mantissa * powers[row, shift])
    unit = powers[row, min(-shift, LAST_POWER)]
    return 0 if unit > 2 * mantissa else quotient(mantissa + unit // 2, unit)


def class_of(size: int, own: int, plan: Ints, powers: Ints2) -> int:
    """The class of a size, by digits, not below the lowest and 1; the search begins at ``own``."""
    row, least = plan[ROW], plan[LEAST]
    own = max(own, least, 1)
    while own < plan[WIDTH] and powers[row, own] <= size:
        own += 1
    while own > least and own > 1 and powers[row, own - 1] > size:
        own -= 1
    return own


def settle(plan: Ints, powers: Ints2) -> None:
    """Fill in what follows from the head of a coded channel."""
    base = plan[BASE]
    plan[ROW] = 1 if base == 10 else 0
    plan[WIDTH] = DECIMAL_WIDTH if base == 10 else BINARY_WIDTH
    plan[LOW] = powers[plan[ROW], plan[DIGITS] - 1] if base else 1
    plan[HIGH] = plan[LOW] * base
    plan[PER_CLASS] = plan[HIGH] - plan[LOW]
    plan[FIRST] = (plan[TOP] - plan[DEPTH]) * plan[PER_CLASS] + (0 if base == 10 else -1)
    plan[LEAST] = plan[WIDTH] - plan[DEPTH]
    plan[LIMIT] = powers[plan[ROW], plan[WIDTH]] - 1 if base else MAX_PLAIN


def enter_class(size: int, plan: Ints, track: Ints, powers: Ints2) -> None:
    """Note the class of a predicted size in ``track``."""
    own = class_of(size, track[OWN], plan, powers)
    row, shift = plan[ROW], own - plan[DIGITS]
    track[OWN], track[SHIFT] = own, shift
    track[SINCE], track[UNTIL] = powers[row, own - 1], powers[row, own]
    track[STEP] = powers[row, abs(shift)]
    track[QUARTERS] = 4 * shift if plan[BASE] == 2 else (425 * shift + 16) >> 5  # FAST-14
    track[OFFSET] = 1 + (own - plan[LEAST]) * plan[PER_CLASS] - plan[LOW]


def of_rank(rank: int, plan: Ints, powers: Ints2) -> tuple[int, int, bool]:
    """Of a rank: value in fixed point, ordinal, and whether there is such a one."""
    minus = rank >> 63
    magnitude = rank ^ minus
    if magnitude == 0:
        return 0, minus, True
    k = quotient(magnitude - 1, plan[PER_CLASS])
    mantissa = magnitude - 1 - k * plan[PER_CLASS] + plan[LOW]
    value = from_mantissa(
        mantissa, plan[LEAST] + min(k, plan[DEPTH]) - plan[DIGITS], plan[ROW], powers
    )
    ordinal = (plan[FIRST] + magnitude) << plan[DROP]  # FAST-09
    return (value ^ minus) - minus, ordinal ^ minus, k <= plan[DEPTH]  # FAST-10


def first_value(data: Bytes, i: int, plan: Ints, powers: Ints2) -> tuple[int, int, int, bool]:
    """Decode the first value of a channel: (next bit, value in fixed point, ordinal, all right)."""
    n = bits_at(data, i, LENGTH_BITS)
    i += LENGTH_BITS
    rank = 0
    if n > MAX_LENGTH:  # there is no such rank
        return i, 0, 0, False
    if n:
        raw = bits_at(data, i, n)
        i += n
        rank = 1 << (n - 1) | raw >> 1  # FAST-13
        rank = -rank if raw & 1 else rank
    if plan[BASE]:
        value, ordinal, good = of_rank(rank, plan, powers)
        return i, value, ordinal, good
    ordinal = rank << plan[DROP] | bits_at(data, i, plan[DROP])
    return i + plan[DROP], rank, ordinal, -MAX_PLAIN <= rank < MAX_PLAIN  # FAST-11


def next_value(
    data: Bytes,
    tables: Tables,
    plan: Ints,
    track: Ints,
    inverse: Floats,
    x: int,
    at: int,
    i: int,
    f: int,
    last: int,
    d0: int,
    d1: int,
    d2: int,
    d3: int,
) -> tuple[int, int, int, int, int, int, bool]:
    """Decode another value of a channel.

    ``x`` is the state, which takes bytes from ``at`` on, ``i`` the next bit, ``f`` how far
    predictions were off, ``last`` and the others the values before and their differences. Returns
    the first four anew, the value in fixed point, its ordinal, and whether all is right.
    """
    # what is expected
    p = plan[TAPS] * d0 + plan[TAPS + 1] * d1 + plan[TAPS + 2] * d2 + plan[TAPS + 3] * d3
    p = (p + 16) >> 5
    p = clamp(p + last if plan[FROM_LAST] else p, -plan[LIMIT], plan[LIMIT])  # FAST-14
    minus = p >> 63
    size = (p ^ minus) - minus
    mantissa = FAR_OFF  # in the class of the prediction
    if plan[BASE]:
        if size < track[SINCE] or size >= track[UNTIL]:
            enter_class(size, plan, track, tables.powers)
            inverse[0] = 1.0 / float(track[STEP])
        if size >= track[SINCE]:
            step = track[STEP]
            if track[SHIFT] >= 0:
                mantissa = min(divided(size + (step >> 1), step, inverse[0]), plan[HIGH] - 1)
            else:
                mantissa = size * step
    # what that misses
    length = bit_length(f + 1) - 1
    scale = tables.scales[max(4 * length + ((f + 1 << 2) >> length & 3) - track[QUARTERS], 0)]
    context, k = scale >> 8 & (N_CONTEXTS - 1), scale & 63
    slot = x & (TABLE - 1)
    symbol = int(tables.symbols[context << TABLE_BITS | slot])
    frequency = tables.frequencies[context << SYMBOL_BITS | symbol]
    # FAST-08
    x = (frequency >> TABLE_BITS) * (x >> TABLE_BITS) + slot - (frequency & (TABLE - 1))
    place = at & WORD
    word = int(data[place]) | int(data[place + 1]) << 8
    at = at + 2 if x < LEAST_STATE else at
    x = x << 16 | word if x < LEAST_STATE else x
    miss = symbol << k
    good = True
    if symbol >= DIRECT:
        if symbol == FAR:
            far = bits_at(data, i, LENGTH_BITS)
            i += LENGTH_BITS
            good = far > 0  # FAST-15
            good = good and far + k <= MAX_LENGTH  # there is no such rank
            k = clamp(far + k - 1, 0, MAX_LENGTH - 1)
            miss = 1 << k
        else:
            k += 2 + ((symbol - DIRECT) >> 2)
            miss = (4 + (symbol & 3)) << k
    if k or miss:
        raw = bits_at(data, i, k + 1)
        i += k + 1
        negative = -(raw & 1)
        miss = ((miss | raw >> 1) ^ negative) - negative
    # the number
    inside = mantissa + ((miss ^ minus) - minus)
    if plan[LOW] <= inside < plan[HIGH]:
        ordinal = ((track[OFFSET] + plan[FIRST] + inside) << plan[DROP]) ^ minus
        if track[SHIFT] >= 0:
            value = inside * track[STEP]
        else:
            value = divided(inside + (track[STEP] >> 1), track[STEP], inverse[0])
        value = (value ^ minus) - minus
    elif plan[BASE]:  # another class or sign
        expected = mantissa + track[OFFSET] if size >= track[SINCE] else 0
        value, ordinal, known = of_rank((expected ^ minus) + miss, plan, tables.powers)
        good = good and known
    else:
        value = p + miss
        good = good and -MAX_PLAIN <= value < MAX_PLAIN  # FAST-11
        ordinal = value << plan[DROP] | bits_at(data, i, plan[DROP])
        i += plan[DROP]
    # what is remembered
    f += ((abs(value - p) << 4) - f) >> 2  # FAST-14
    return x, at, i, f, value, ordinal, good
