"""Compiled: values to ordinals of decimal grids, a whole matrix at once."""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel, truncated
from mcz.kernels.types import Bytes2, Floats, Floats2, Ints, Ints2
from mcz.model.numbers.rules import MIN_POWER
from mcz.model.numbers.value_kernels import DIGITS, EXACT_POWER, FIXED, LIMIT, OTHER, POWER, ROWS

LEAST_POWER, GREATEST_POWER = -324, 308  # of ten, in the table of powers


def power_of(value: float, power: int, powers: Floats) -> int:
    """The power of ten of the first digit of a value above 0.

    The search begins at ``power``; ``powers`` are all of them, from ``LEAST_POWER`` on.
    """
    while value < powers[power - LEAST_POWER]:
        power -= 1
    while power < GREATEST_POWER and value >= powers[power + 1 - LEAST_POWER]:
        power += 1
    return power


def decimal(value: float, power: int, digits: int, tens: Floats, powers: Floats) -> tuple[int, int]:
    """The mantissa of so many digits nearest to a value above 0, and the power of its first digit.

    A mantissa of 0: no product or quotient with a power of ten is exact enough. The search for the
    power begins at ``power``.
    """
    power = power_of(value, power, powers)
    shift = digits - 1 - power
    mantissa = 0
    if 0 <= shift and shift <= EXACT_POWER:
        mantissa = int(np.rint(value * tens[shift]))
    elif shift < 0 and shift >= -EXACT_POWER:
        mantissa = int(np.rint(value / tens[-shift]))
    low = int(tens[digits - 1])
    if mantissa < low or mantissa >= 10 * low:
        return 0, power
    return mantissa, power


def magnitude_of(mantissa: int, power: int, digits: int, tens: Floats) -> int:
    """Magnitude of a number with ``digits`` significant digits, the first at ``power`` of ten."""
    low = int(tens[digits - 1])
    return (power - MIN_POWER) * 9 * low + 1 + mantissa - low


def general_column(
    values: Floats2,
    c: int,
    start: int,
    stop: int,
    digits: int,
    tens: Floats,
    powers: Floats,
    ordinals: Ints2,
    exact: Bytes2,
) -> bool:
    """Numbers of so many significant digits; False where one is to be looked at more closely."""
    low, high = tens[digits - 1], tens[digits]
    power = shift = since = 0  # since: what magnitudes exceed mantissas by
    ten = 1.0
    least = above = 0.0  # sizes of that power of ten, of the number before
    for t in range(start, stop):
        value = values[t, c]
        size = abs(value)
        if not least <= size < above:
            if size == 0.0:
                ordinals[t, c] = -1 if 1.0 / value < 0.0 else 0
                exact[t, c] = 1
                continue
            if not size < powers[GREATEST_POWER - LEAST_POWER]:  # nor is that NaN
                return False
            power = power_of(size, power, powers)
            least, above = powers[power - LEAST_POWER], powers[power + 1 - LEAST_POWER]
            shift = digits - 1 - power
            if abs(shift) > EXACT_POWER:
                return False
            ten, since = tens[abs(shift)], magnitude_of(0, power, digits, tens)
        mantissa = np.rint(size * ten) if shift >= 0 else np.rint(size / ten)
        if mantissa < low or mantissa >= high:
            return False
        magnitude = since + truncated(mantissa)
        ordinals[t, c] = -1 - magnitude if value < 0.0 else magnitude
        exact[t, c] = 1 if (mantissa / ten if shift >= 0 else mantissa * ten) == size else 0
    return True


def fixed_column(
    values: Floats2,
    c: int,
    start: int,
    stop: int,
    rule: Ints,
    tens: Floats,
    ordinals: Ints2,
    exact: Bytes2,
) -> bool:
    """Numbers of so many decimals; False where one is beyond the grid or none."""
    ten = tens[rule[POWER]]
    for t in range(start, stop):
        value = values[t, c]
        size = abs(value)
        count = np.rint(size * ten)
        if not count <= float(rule[LIMIT]):
            return False
        minus = value < 0.0
        if size == 0.0:
            minus = 1.0 / value < 0.0
        ordinals[t, c] = -1 - int(count) if minus else int(count)
        exact[t, c] = 1 if count / ten == size else 0  # GRID-08
    return True


@kernel
def fill(
    values: Floats2,
    rules: Ints2,
    tens: Floats,
    powers: Floats,
    ordinals: Ints2,
    exact: Bytes2,
    left: Ints,
) -> None:
    """Fill ``ordinals`` (rows, channels), and where they give the values back ``exact`` with 1.

    ``left``: channels not filled, which have another grid than a decimal one, or a value that no
    exact product or quotient gives.
    """
    for start in range(0, len(values), ROWS):
        stop = min(start + ROWS, len(values))
        for c in range(len(rules)):
            if left[c]:
                continue
            digits = rules[c, DIGITS]
            good = digits != OTHER
            if good and digits == FIXED:
                good = fixed_column(values, c, start, stop, rules[c], tens, ordinals, exact)
            elif good:
                good = general_column(values, c, start, stop, digits, tens, powers, ordinals, exact)
            if not good:
                left[c] = 1
