"""Compiled: values to the text of decimal grids, a whole matrix at once."""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel, truncated
from mcz.kernels.types import Bytes, Floats, Floats2, Ints2
from mcz.model.numbers.kernels import length, put
from mcz.model.numbers.value_kernels import (
    DIGITS,
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
            digits = rules[c, DIGITS]
            value = values[t, c]
            amount = abs(value)
            minus = value < 0.0
            mantissa = width = fraction = 0
            if amount == 0.0 and digits != OTHER:
                minus = 1.0 / value < 0.0
                fraction = rules[c, POWER] if digits == FIXED else 0
            elif digits == OTHER or not amount < powers[GREATEST_POWER - LEAST_POWER]:
                continue  # NaN too
            elif digits == FIXED:
                count = np.rint(amount * tens[rules[c, POWER]])
                if not count < float(rules[c, LIMIT]):
                    continue
                mantissa, fraction = truncated(count), rules[c, POWER]
                width = length(mantissa)
            else:
                mantissa, power = decimal(amount, rules[c, GUESS], digits, tens, powers)
                rules[c, GUESS] = power
                if mantissa == 0:
                    continue
                width, fraction = digits, digits - 1 - power
            start[t, c] = base + at
            rule = rules[c, TRIM], rules[c, LOW], rules[c, HIGH], rules[c, FLAGS]
            at = put(minus, mantissa, width, fraction, rule, out, at)
            size[t, c] = base + at - start[t, c]
    return at
