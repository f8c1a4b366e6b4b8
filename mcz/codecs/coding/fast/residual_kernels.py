"""Compiled: read the residuals of lanes, predict their leads, read their tails and make ordinals.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import bit_length, eight_bytes, kernel, trailing_zeros, wrapped
from mcz.kernels.types import Bytes, Ints, Ints2, Words, Words2

BEHIND = 5  # rows that a prediction looks back
PLAIN = 7  # longest unary part that is not an escape
MOST_BITS = 31  # after a unary part
MOST_SIZE = 1 << 26  # of a residual, as the scale takes it in


class Predictors(NamedTuple):
    """The predictors of lanes, an item each; ``behind`` has the weights of earlier rows."""

    first: Words
    scales: Words  # in sixteenths
    behind: Words2  # (BEHIND, lanes)
    parents: Ints  # the lane of the parent, or -1
    weights: Words  # in 256ths


def predictors_of(n_lanes: int) -> Predictors:
    """Room for the predictors of ``n_lanes``."""
    first, scales, weights = np.zeros((3, n_lanes), np.int32)
    behind = np.zeros((BEHIND, n_lanes), np.int32)
    return Predictors(first, scales, behind, np.zeros(n_lanes, np.int64), weights)


def window(data: Bytes, bit: int) -> int:
    """At least 57 bits from ``bit`` on, the lowest first; bits above these are undefined."""
    return eight_bytes(data, bit >> 3) >> (int(bit) & 7)


def read_code(data: Bytes, bit: int, scale: int) -> tuple[int, int, int]:
    """A residual, the bit after its code, and the next scale; bit -1: there is none."""
    k = bit_length(scale >> 4)
    word = window(data, bit)
    zeros = trailing_zeros(word)
    if zeros <= PLAIN:
        folded = zeros << k | word >> (zeros + 1) & (1 << k) - 1
        bit += zeros + 1 + k
    else:
        more = k + zeros - PLAIN
        if more > MOST_BITS:  # FAST-40
            return 0, -1, scale
        bit += zeros + 1
        folded = (6 + (1 << (zeros - PLAIN)) << k) + (window(data, bit) & (1 << more) - 1)
        bit += more
        if folded >> 32:  # FAST-40, FAST-41
            return 0, -1, scale
    half, odd = folded >> 1, folded & 1
    return half ^ -odd, bit, scale + ((16 * min(half + odd, MOST_SIZE) - scale) >> 2)


def is_read(data: Bytes, bit: int, end: int) -> bool:
    """No byte, and no bit that is 1, is left from ``bit`` to ``end``."""
    left = int(end) - int(bit)
    return 0 <= left < 8 and window(data, bit) & (1 << left) - 1 == 0


def read_row(
    data: Bytes, bits: Ints, ends: Ints, starts: Ints, scales: Words, residuals: Words
) -> bool:
    """Read one residual of each lane, group by group; False if bits are not a code."""
    for group in range(len(bits)):
        bit, end = bits[group], ends[group]
        for lane in range(starts[group], starts[group + 1]):
            residual, bit, scale = read_code(data, bit, int(scales[lane]))
            if bit < 0 or bit > end:
                return False
            residuals[lane] = wrapped(residual)
            scales[lane] = scale
        bits[group] = bit
    return True


def predict(lanes: Predictors, leads: Words2, row: int, residuals: Words, sums: Words) -> None:
    """Fill a row of ``leads``."""
    behind, parents, weights = lanes.behind, lanes.parents, lanes.weights
    own = leads[row]
    before1, before2, before3 = leads[row - 1], leads[row - 2], leads[row - 3]
    before4, before5 = leads[row - 4], leads[row - 5]
    weights1, weights2, weights3 = behind[0], behind[1], behind[2]
    weights4, weights5 = behind[3], behind[4]
    n_lanes = len(own)
    for lane in range(n_lanes):  # short loops are vectorised
        sums[lane] = wrapped(
            16 + int(weights1[lane]) * int(before1[lane]) + int(weights2[lane]) * int(before2[lane])
        )
    for lane in range(n_lanes):
        sums[lane] = wrapped(
            int(sums[lane])
            + int(weights3[lane]) * int(before3[lane])
            + int(weights4[lane]) * int(before4[lane])
            + int(weights5[lane]) * int(before5[lane])
        )
    for lane in range(n_lanes):
        own[lane] = wrapped(int(before1[lane]) + (int(sums[lane]) >> 5) + int(residuals[lane]))
    for lane in range(n_lanes):
        parent = parents[lane]
        if parent >= 0:
            crossed = wrapped(128 + int(weights[lane]) * int(residuals[parent])) >> 8
            own[lane] = wrapped(int(own[lane]) + crossed)  # FAST-39


@kernel
def read_leads(
    data: Bytes, bits: Ints, ends: Ints, starts: Ints, lanes: Predictors, leads: Words2
) -> int:
    """Fill ``leads`` (BEHIND + rows, lanes), whose first rows stand for those before the segment.

    ``bits`` and ``ends``: the first bit of each group's residuals and the one after the last.
    ``starts``: the first lane of each group, and the number of all. Returns the row that has no
    code, -2 minus a group that leaves bits, or -1.
    """
    n_lanes = leads.shape[1]
    residuals = np.zeros(n_lanes, np.int32)
    sums = np.zeros(n_lanes, np.int32)
    scales = np.zeros(n_lanes, np.int32)
    for lane in range(n_lanes):
        scales[lane] = lanes.scales[lane]
        for row in range(BEHIND + 1):
            leads[row, lane] = lanes.first[lane]
    for row in range(BEHIND + 1, len(leads)):
        if not read_row(data, bits, ends, starts, scales, residuals):
            return row - BEHIND
        predict(lanes, leads, row, residuals, sums)
    for group in range(len(bits)):
        if not is_read(data, bits[group], ends[group]):  # FAST-20
            return -2 - group
    return -1


# Columns of lattices, one row a lane: the first as plans have them, those from LEADING on follow.
BASE, DIGITS, DROP, TOP, TINY, REST, LEADING, FIRST, LOW, PER_CLASS = range(10)
# Leads below ABOVE have all their digits; SHIFT and a mantissa of the class TOP make a magnitude.
ABOVE, SHIFT = range(10, 12)
LATTICE_SIZE = 12
MOST_LEADING_10, MOST_LEADING_2 = 9, 30  # digits of a lead
NEAR = 9  # classes below the last one that a lead reaches, as far as one digit tells
FAR_DIGITS = 4
POWERS = tuple(10**n for n in range(16))
# Of a number below 10^n: the bits of most, the least with one bit more, what that bit adds.
FEWEST_BITS = tuple((10**n).bit_length() - 1 for n in range(10))
FIRST_LONG = tuple(2 ** (10**n).bit_length() - 10**n for n in range(10))
LONGER = tuple(10**n - 2 ** ((10**n).bit_length() - 1) for n in range(10))


class Tails(NamedTuple):
    """The tails of groups: first bit, the one after the last, first lane; columns of lanes."""

    data: Bytes
    bits: Ints
    ends: Ints
    starts: Ints  # and the number of all lanes
    columns: Ints


def derive_fields(lattices: Ints2, lane: int) -> None:
    """Fill in what follows from base and digits."""
    base, digits = lattices[lane, BASE], lattices[lane, DIGITS]
    if base == 10:
        lattices[lane, LEADING] = min(digits, MOST_LEADING_10)
        lattices[lane, LOW] = POWERS[digits - 1]
        lattices[lane, PER_CLASS] = 9 * POWERS[digits - 1]
        lattices[lane, FIRST] = 1
    elif base == 2:
        lattices[lane, LEADING] = min(digits, MOST_LEADING_2)
        lattices[lane, LOW] = 1 << (digits - 1)
        lattices[lane, PER_CLASS] = 1 << (digits - 1)
        lattices[lane, FIRST] = 0
    if base == 10 and lattices[lane, LEADING] == digits:
        lattices[lane, ABOVE] = 10 * lattices[lane, LOW]
        lattices[lane, SHIFT] = magnitude_of(lattices, lane, lattices[lane, TOP], 0)


def decimal_digits(value: int) -> int:
    """Digits of ``value``, 0 of 0."""
    n = bit_length(value) * 1233 >> 12
    return int(n + 1 + ((value - POWERS[n]) >> 63))  # no branch


def read_decimal_9(data: Bytes, bit: int, n: int) -> tuple[int, int]:
    """A number below 10^n, n <= 9, and the bit after it."""
    n_bits = FEWEST_BITS[n]
    word = window(data, bit)
    value = word & (1 << n_bits) - 1
    is_long = 1 if value >= FIRST_LONG[n] else 0  # no branch: it is unpredictable
    return value + (is_long & word >> n_bits) * LONGER[n], bit + n_bits + is_long


def read_decimal(data: Bytes, bit: int, n: int) -> tuple[int, int]:
    """A number below 10^n and the bit after it."""
    high = 0
    if n > 9:
        high, bit = read_decimal_9(data, bit, n - 9)
        n = 9
    value, bit = read_decimal_9(data, bit, n)
    return high * POWERS[9] + value, bit


def magnitude_of(lattices: Ints2, lane: int, number: int, mantissa: int) -> int:
    """The magnitude of a mantissa of class ``number``, without the bits that are dropped."""
    base = lattices[lane, FIRST] - lattices[lane, LOW]
    return int(number * lattices[lane, PER_CLASS] + mantissa + base)


def read_tiny(data: Bytes, bit: int, lattices: Ints2, lane: int) -> tuple[int, int]:
    """The magnitude of a lead without digits, and the bit after its tail; or -1."""
    below, bit = read_decimal_9(data, bit, 1)
    if below == 0:
        return 0, bit
    if below == NEAR:
        more, bit = read_decimal_9(data, bit, FAR_DIGITS)
        below += more
    number = lattices[lane, TOP] - lattices[lane, LEADING] + 1 - below
    if lattices[lane, BASE] == 2:
        mantissa = lattices[lane, LOW] + (window(data, bit) & int(lattices[lane, LOW]) - 1)
        bit += lattices[lane, DIGITS] - 1
    else:
        mantissa, bit = read_decimal(data, bit, lattices[lane, DIGITS])
    if number < 0 or mantissa < lattices[lane, LOW]:  # FAST-45, FAST-46
        return -1, bit
    return magnitude_of(lattices, lane, number, mantissa), bit


def read_magnitude(data: Bytes, bit: int, lead: int, lattices: Ints2, lane: int) -> tuple[int, int]:
    """The magnitude that begins with the digits of ``lead``, and the bit after its tail; or -1."""
    if lead == 0:
        if lattices[lane, TINY]:
            return read_tiny(data, bit, lattices, lane)
        return 0, bit
    digits = decimal_digits(lead) if lattices[lane, BASE] == 10 else bit_length(lead)
    number = lattices[lane, TOP] - lattices[lane, LEADING] + digits
    if digits > lattices[lane, LEADING] or number < 0:  # FAST-43, FAST-44
        return -1, bit
    n = int(lattices[lane, DIGITS]) - digits
    if lattices[lane, BASE] == 2:
        lead = lead << n | window(data, bit) & (1 << n) - 1
        bit += n
    elif n:
        tail, bit = read_decimal(data, bit, n)
        lead = lead * POWERS[n] + tail
    return magnitude_of(lattices, lane, number, lead), bit


def read_whole(data: Bytes, bit: int, size: int, lattices: Ints2, lane: int) -> tuple[int, int]:
    """The magnitude of a decimal lead that may have all digits, and the bit after its tail."""
    n = int(lattices[lane, DIGITS]) - decimal_digits(size)
    if n == 0:
        return int(lattices[lane, SHIFT]) + size, bit
    tail, bit = read_decimal_9(data, bit, n)
    magnitude = lattices[lane, SHIFT] - n * lattices[lane, PER_CLASS] + size * POWERS[n] + tail
    return (magnitude if n <= lattices[lane, TOP] else -1), bit  # FAST-44


def read_ordinal(data: Bytes, bit: int, lead: int, lattices: Ints2, lane: int) -> tuple[int, int]:
    """The ordinal of a lead, or its rest, and the bit after its tail; bit -1: it has none."""
    if lattices[lane, BASE] == 0:
        if lattices[lane, REST] >= 0:
            lead, bit, lattices[lane, REST] = read_code(data, bit, int(lattices[lane, REST]))
        elif lattices[lane, DROP]:
            drop = int(lattices[lane, DROP])
            lead = lead << drop | window(data, bit) & (1 << drop) - 1
            bit += drop
        return lead, bit
    minus = lead >> 31
    size = lead ^ minus
    if 0 < size < lattices[lane, ABOVE]:  # nearly always
        magnitude, bit = read_whole(data, bit, size, lattices, lane)
    else:
        magnitude, bit = read_magnitude(data, bit, size, lattices, lane)
        magnitude = magnitude << lattices[lane, DROP]
    return magnitude ^ minus, (bit if magnitude >= 0 else -1)  # FAST-42


@kernel
def read_ordinals(tails: Tails, lattices: Ints2, leads: Words2, out: Ints2) -> int:
    """Fill columns of ``out`` (rows, channels) from ``leads`` (rows, lanes) and tails.

    Lanes with rests get these, and those of other units their leads. Returns the lane that has no
    tail, -2 minus a group that leaves bits, or -1.
    """
    data, bits, ends, starts = tails.data, tails.bits, tails.ends, tails.starts
    columns, n_groups = tails.columns, len(tails.bits)
    for lane in range(len(lattices)):
        derive_fields(lattices, lane)
    for row in range(len(out)):
        for group in range(n_groups):  # one after the other: a processor reads several at a time
            bit, end = bits[group], ends[group]
            for lane in range(starts[group], starts[group + 1]):
                ordinal, bit = read_ordinal(data, bit, int(leads[row, lane]), lattices, lane)
                if bit < 0 or bit > end:
                    return lane
                out[row, columns[lane]] = ordinal
            bits[group] = bit
    for group in range(n_groups):
        if not is_read(data, bits[group], ends[group]):  # FAST-20
            return -2 - group
    return -1
