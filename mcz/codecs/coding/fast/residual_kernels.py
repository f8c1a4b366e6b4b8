"""Compiled: read the residuals of lanes and predict their leads.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import bit_length, eight_bytes, kernel, trailing_zeros, wrapped
from mcz.kernels.types import Bytes, Ints, Words, Words2

BEHIND = 5  # rows that a prediction looks back
PLAIN = 7  # zeros of a unary part that stand for themselves
MOST_BITS = 31  # behind a unary part
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
    """A residual, the bit behind its code, and the scale after it; bit -1: it is none."""
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
    """Fill ``leads`` (BEHIND + rows, lanes), of which the first rows are those before the first.

    ``bits`` and ``ends``: the first bit of each group's residuals and the one behind the last.
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
