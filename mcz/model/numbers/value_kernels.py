"""Compiled: ordinals of decimal grids to values, a whole matrix at once."""

from __future__ import annotations

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Ints, Ints2

# Columns of ``rules``, one row a channel.
DIGITS, POWER, LIMIT = range(3)
RULE_SIZE = 3
FIXED, OTHER = 0, -1  # digits of a grid of fixed decimals; of one that is not decimal
ROWS = 256  # that are worked on at a time, so that they stay in the processor's memory
EXACT_POWER = 22
NONE = 1 << 62  # above all magnitudes


def scaled(mantissa: int, power: int, tens: Floats) -> float:
    """``mantissa * 10^power``, rounded once: both factors are exact."""
    if power < 0:
        return float(mantissa / tens[-power])
    return float(mantissa * tens[power])


def general_column(
    ordinals: Ints2, values: Floats2, c: int, start: int, stop: int, rule: Ints, tens: Floats
) -> bool:
    """Numbers of so many significant digits; False where one has too large a power of ten."""
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
def fill(ordinals: Ints2, rules: Ints2, tens: Floats, values: Floats2, left: Ints) -> None:
    """Fill ``values`` (rows, channels) with those of the ordinals; ``left``: channels not filled.

    These have another grid than a decimal one, or a number that no exact division gives, or none.
    """
    for start in range(0, len(ordinals), ROWS):
        stop = min(start + ROWS, len(ordinals))
        for c in range(len(rules)):
            if left[c]:
                continue
            if rules[c, DIGITS] == OTHER:
                left[c] = 1
            elif rules[c, DIGITS] != FIXED:
                if not general_column(ordinals, values, c, start, stop, rules[c], tens):
                    left[c] = 1
            else:
                ten = tens[rules[c, POWER]]
                for t in range(start, stop):
                    magnitude = ordinals[t, c] ^ (ordinals[t, c] >> 63)
                    left[c] |= 1 if magnitude > rules[c, LIMIT] else 0
                    value = float(magnitude) / ten  # GRID-08
                    values[t, c] = -value if ordinals[t, c] < 0 else value
