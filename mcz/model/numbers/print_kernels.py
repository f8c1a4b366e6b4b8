"""Compiled: values to the text of decimal grids, a whole matrix at once."""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel, truncated
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2
from mcz.model.numbers.kernels import length, put
from mcz.model.numbers.value_kernels import (
    DIGITS,
    EXACT_POWER,
    FIXED,
    GREATEST_POWER,
    LEAST_POWER,
    LIMIT,
    OTHER,
    POWER,
    decimal,
)

# Further columns of ``rules``: how ``kernels.put`` prints, and the last power of ten.
TRIM, LOW, HIGH, FLAGS, GUESS = range(3, 8)
RULE_SIZE = 8
FEW_DIGITS = 9
CLOSE = 1e-5


@kernel
def fill(
    values: Floats2,
    rules: Ints2,
    tens: Floats,
    powers: Floats,
    out: Bytes,
    base: int,
    start: Ints2,
    size: Ints2,
) -> int:
    """Print the nearest number of each value's grid to ``out``; returns the number of bytes.

    ``start``, counted from ``base``, and ``size`` locate each text. They stay unchanged for a value
    without a decimal grid, beyond its grid, NaN, or without an exact product or quotient.
    """
    at = 0
    for t in range(len(values)):
        for c in range(len(rules)):
            end = put_value(values[t, c], rules[c], tens, powers, out, at)
            if end >= 0:
                start[t, c] = base + at
                size[t, c] = end - at
                at = end
    return at


def put_value(value: float, rule: Ints, tens: Floats, powers: Floats, out: Bytes, at: int) -> int:
    """Print the nearest number of a grid; returns where it ends, -1 for what ``fill`` skips."""
    digits = rule[DIGITS]
    amount = abs(value)
    minus = value < 0.0
    mantissa = width = fraction = 0
    if amount == 0.0 and digits != OTHER:
        minus = 1.0 / value < 0.0
        fraction = rule[POWER] if digits == FIXED else 0
    elif digits == OTHER or not amount < powers[GREATEST_POWER - LEAST_POWER]:
        return -1  # NaN too
    elif digits == FIXED:
        count = np.rint(amount * tens[rule[POWER]])
        if not count < float(rule[LIMIT]):
            return -1
        mantissa, fraction = truncated(count), rule[POWER]
        width = length(mantissa)
    else:
        mantissa, power = decimal(amount, rule[GUESS], digits, tens, powers)
        rule[GUESS] = power
        if mantissa == 0:
            mantissa = small_decimal(amount, power, digits, tens)
        if mantissa == 0:
            return -1
        width, fraction = digits, digits - 1 - power
    style = rule[TRIM], rule[LOW], rule[HIGH], rule[FLAGS]
    return put(minus, mantissa, width, fraction, style, out, at)


def small_decimal(value: float, power: int, digits: int, tens: Floats) -> int:
    """``decimal`` of a value whose first digit is at ``power``, where two products reach it.

    Rounded twice, a number of few digits moves by less than ``CLOSE``. 0: it is nearly a tie.
    """
    shift = digits - 1 - power
    if digits > FEW_DIGITS or shift <= EXACT_POWER or shift > 2 * EXACT_POWER:
        return 0
    product = value * tens[EXACT_POWER] * tens[shift - EXACT_POWER]
    nearest = np.rint(product)
    if abs(abs(product - nearest) - 0.5) < CLOSE:
        return 0
    within = tens[digits - 1] <= nearest and nearest < tens[digits]
    return int(nearest) if within else 0
