"""Compiled: ordinals of decimal grids to values and back, a whole matrix at once."""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel, truncated
from mcz.kernels.types import Bytes2, Floats, Floats2, Ints, Ints2
from mcz.model.numbers.rules import MIN_POWER

# Columns of ``rules``, one row a channel.
DIGITS, POWER, LIMIT = range(3)
RULE_SIZE = 3
FIXED, OTHER = 0, -1  # ``digits`` of a grid of fixed decimals, and of a binary one
ROWS = 256  # rows a pass, so that they stay in the processor's cache
EXACT_POWER = 22
NONE = 1 << 62  # above all magnitudes


def scaled(mantissa: int, power: int, tens: Floats) -> float:
    """``mantissa * 10^power``, rounded once: both factors are exact."""
    if power < 0:
        return float(mantissa / tens[-power])
    return float(mantissa * tens[power])


def values_of_general(
    ordinals: Ints2, values: Floats2, c: int, start: int, stop: int, rule: Ints, tens: Floats
) -> bool:
    """Fill in numbers of a GENERAL grid; return False if a power of ten is too large."""
    low = int(tens[rule[DIGITS] - 1])
    per_class, limit = 9 * low, rule[LIMIT]
    first = NONE  # the least magnitude of the class of the last number
    since = power = 0
    ten = 1.0
    for t in range(start, stop):
        minus = ordinals[t, c] >> 63
        magnitude = ordinals[t, c] ^ minus
        if not first <= magnitude < first + per_class:
            if magnitude == 0:
                values[t, c] = -0.0 if minus else 0.0
                continue
            own = (magnitude - 1) // per_class
            first, since, power = own * per_class + 1, own * per_class + 1 - low, own + rule[POWER]
            if abs(power) > EXACT_POWER:
                return False
            ten = tens[abs(power)]
        if magnitude > limit:
            return False
        mantissa = float(((magnitude - since) ^ minus) - minus)
        values[t, c] = mantissa / ten if power < 0 else mantissa * ten
    return True


@kernel
def fill_values(ordinals: Ints2, rules: Ints2, tens: Floats, values: Floats2, left: Ints) -> None:
    """Fill ``values`` (rows, channels) from the ordinals; ``left``: channels not filled.

    Their grid is not decimal, or a number has no exact quotient, or an ordinal has no number.
    """
    for start in range(0, len(ordinals), ROWS):
        stop = min(start + ROWS, len(ordinals))
        for c in range(len(rules)):
            if left[c]:
                continue
            if rules[c, DIGITS] == OTHER:
                left[c] = 1
            elif rules[c, DIGITS] != FIXED:
                if not values_of_general(ordinals, values, c, start, stop, rules[c], tens):
                    left[c] = 1
            else:
                ten = tens[rules[c, POWER]]
                for t in range(start, stop):
                    magnitude = ordinals[t, c] ^ (ordinals[t, c] >> 63)
                    left[c] |= 1 if magnitude > rules[c, LIMIT] else 0
                    value = float(magnitude) / ten  # GRID-08
                    values[t, c] = -value if ordinals[t, c] < 0 else value


LEAST_POWER, GREATEST_POWER = -324, 308  # powers of ten in the table


def power_of(value: float, power: int, powers: Floats) -> int:
    """The power of ten of the first digit of a value above 0.

    The search begins at ``power``; ``powers`` is the table, from ``LEAST_POWER`` on.
    """
    while value < powers[power - LEAST_POWER]:
        power -= 1
    while power < GREATEST_POWER and value >= powers[power + 1 - LEAST_POWER]:
        power += 1
    return power


def decimal(value: float, power: int, digits: int, tens: Floats, powers: Floats) -> tuple[int, int]:
    """The nearest mantissa of ``digits`` digits for a value above 0, and its first digit's power.

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


def ordinals_of_general(
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
    """Fill in ordinals of a GENERAL grid; return False if a number needs an exact check."""
    low, high = tens[digits - 1], tens[digits]
    power = shift = since = 0  # since: excess of magnitudes over mantissas
    ten = 1.0
    least = above = 0.0  # range of the previous number's power of ten
    for t in range(start, stop):
        value = values[t, c]
        size = abs(value)
        if not least <= size < above:
            if size == 0.0:
                ordinals[t, c] = -1 if 1.0 / value < 0.0 else 0
                exact[t, c] = 1
                continue
            if not size < powers[GREATEST_POWER - LEAST_POWER]:  # NaN too
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


def ordinals_of_fixed(
    values: Floats2,
    c: int,
    start: int,
    stop: int,
    rule: Ints,
    tens: Floats,
    ordinals: Ints2,
    exact: Bytes2,
) -> bool:
    """Fill in ordinals of a FIXED grid; return False for a number beyond it or NaN."""
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
def fill_ordinals(
    values: Floats2,
    rules: Ints2,
    tens: Floats,
    powers: Floats,
    ordinals: Ints2,
    exact: Bytes2,
    left: Ints,
) -> None:
    """Fill ``ordinals`` (rows, channels), and ``exact`` with 1 if they restore the values.

    ``left``: channels not filled. Their grid is not decimal, or a value has no exact product or
    quotient.
    """
    for start in range(0, len(values), ROWS):
        stop = min(start + ROWS, len(values))
        for c in range(len(rules)):
            if left[c]:
                continue
            digits = rules[c, DIGITS]
            good = digits != OTHER
            if good and digits == FIXED:
                good = ordinals_of_fixed(values, c, start, stop, rules[c], tens, ordinals, exact)
            elif good:
                good = ordinals_of_general(
                    values, c, start, stop, digits, tens, powers, ordinals, exact
                )
            if not good:
                left[c] = 1
