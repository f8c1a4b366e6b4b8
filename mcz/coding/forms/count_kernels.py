"""Compiled: the cheap test for channels of a GENERAL grid that may be counts of a converter.

Nothing here is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Ints, Ints2
from mcz.numbers.value_kernels import EXACT_POWER

WINDOWS, SEEN = 4, 128  # runs of rows that are looked at, and their length
FEWEST = 9  # distinct values in a window that shows something
ENOUGH = 2  # windows that show something
WIDE = 4.0  # last places in a gap between values, at least
NEAR = 16.0  # times the unit that a gap may have to tell something
MOST_PARTS = 3  # of the least gap, one of which may be the unit
LOOSE = 0.25  # of a unit that a gap may be off
BINARY32 = 2.0**-23  # of a number: twice what rounding takes of it, at most
STRIDES = (57, 23, 10, 4, 1)  # Ciura, Best increments for the average case of Shellsort, 2001


@kernel
def clear_hopeless(ordinals: Ints2, numbers: Ints, digits: Ints, tens: Floats, tried: Ints) -> None:
    """Clear ``tried`` of channels in which some rows show that there is no unit.

    Of so many ``digits`` each; ``tens``: the exact powers of ten.
    """
    room = np.empty(SEEN, np.float64)
    powers = np.empty(SEEN, np.int64)
    size = min(SEEN, len(ordinals))
    for n in range(len(numbers)):
        if not tried[n]:
            continue
        left = ENOUGH
        for window in range(WINDOWS):
            start = window * (len(ordinals) - size) // (WINDOWS - 1)
            take_values(ordinals, numbers[n], start, size, digits[n], tens, powers, room)
            sort(room, size)
            if count_distinct(room, size) >= FEWEST:
                tried[n] = 1 if have_unit(room, size) else 0
                left -= 1
            if not tried[n] or left == 0:
                break


def take_values(
    ordinals: Ints2,
    number: int,
    start: int,
    size: int,
    digits: int,
    tens: Floats,
    powers: Ints,
    room: Floats,
) -> None:
    """Fill ``room`` with some values of a channel, in last places of the greatest."""
    low = int(tens[digits - 1])
    most = 0
    for row in range(size):
        ordinal = ordinals[start + row, number]
        powers[row] = max((ordinal ^ (ordinal >> 63)) - 1, 0) // (9 * low)
        most = max(most, powers[row])
    for row in range(size):
        ordinal = ordinals[start + row, number]
        magnitude = ordinal ^ (ordinal >> 63)
        down = most - powers[row]
        room[row] = 0.0
        if magnitude > 0 and down <= EXACT_POWER:
            mantissa = magnitude - 1 - powers[row] * 9 * low + low
            room[row] = float(mantissa) / tens[down]
        if ordinal < 0:
            room[row] = -room[row]


def sort(room: Floats, size: int) -> None:
    for stride in STRIDES:
        for row in range(stride, size):
            value, at = room[row], row
            while at >= stride and room[at - stride] > value:
                room[at] = room[at - stride]
                at -= stride
            room[at] = value


def count_distinct(room: Floats, size: int) -> int:
    count = 1
    for row in range(1, size):
        count += 1 if room[row] != room[row - 1] else 0
    return count


def have_unit(room: Floats, size: int) -> bool:
    """Most gaps between sorted values are whole numbers of one of them, or of a part of it."""
    slack = 1.0 + BINARY32 * max(abs(room[0]), abs(room[size - 1]))
    least = 0.0
    for row in range(1, size):
        gap = room[row] - room[row - 1]
        if gap > WIDE * slack and (least == 0.0 or gap < least):
            least = gap
    if least == 0.0:
        return False
    for parts in range(1, MOST_PARTS + 1):
        unit = least / float(parts)
        near = good = 0
        for row in range(1, size):
            gap = room[row] - room[row - 1]
            if gap <= WIDE * slack or gap > NEAR * unit:
                continue
            near += 1
            off = abs(gap - np.rint(gap / unit) * unit)
            if off <= min(LOOSE * unit, slack * (1.0 + gap / least)):
                good += 1
        if near >= FEWEST - 1 and 8 * good >= 7 * near:
            return True
    return False
