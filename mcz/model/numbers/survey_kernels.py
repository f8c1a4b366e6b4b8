"""Compiled: counts of the notations of tokens, which suggest grids."""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels import kernel
from mcz.kernels.types import Ints, Ints2
from mcz.model.numbers.kernels import (
    BAD,
    EXPONENT,
    EXPONENT_DIGITS,
    FRACTION_DIGITS,
    MINUS,
    NO_INTEGER,
    PLUS,
    POINT,
    SIGNIFICANT,
    SPECIAL,
    UPPER,
    ZERO_INTEGER,
)

MOST_DECIMALS = 63  # larger numbers of decimals are counted as this
MOST_DIGITS = 31

# Indices of ``Survey.styles``.
SIGNED, UNSIGNED = 0, 1  # a plus sign, and no sign at all
BARE_INTEGER, NO_ZERO = 2, 3  # "0.5", ".5"
POINT_ONLY, NO_POINT, POINT_ZERO = 4, 5, 6  # integral numbers: "5.", "5", "5.0"
THREE, TWO, ONE, TWO_OF_ONE = 7, 8, 9, 10  # digits of an exponent, the last where one would do
CAPITAL, SMALL = 11, 12  # "E", "e"
N_STYLES = 13


class Survey(NamedTuple):
    """Counts of numbers by decimals, of those without an exponent, and by digits.

    ``styles``: counts of the notations above.
    """

    decimals: Ints
    significant: Ints
    styles: Ints


@kernel
def count(fields: Ints2, step: int, n_counted: int, survey: Survey) -> None:
    """Count ``n_counted`` of the tokens, ``step`` apart, cyclically."""
    decimals, significant, styles = survey
    step %= max(1, len(fields))
    token = -step
    for _ in range(n_counted):
        token += step
        if token >= len(fields):
            token -= len(fields)
        mantissa, power, shape = fields[token, 0], fields[token, 1], fields[token, 2]
        if shape & (BAD | SPECIAL):
            continue
        significant[(shape >> SIGNIFICANT) & MOST_DIGITS] += 1
        styles[SIGNED] += 1 if shape & PLUS else 0
        styles[UNSIGNED] += 1 if shape & (PLUS | MINUS) == 0 else 0
        styles[BARE_INTEGER] += 1 if shape & ZERO_INTEGER else 0
        styles[CAPITAL] += 1 if shape & UPPER else 0
        if shape & EXPONENT:
            written = (shape >> EXPONENT_DIGITS) & 255
            styles[SMALL] += 1 if shape & UPPER == 0 else 0
            if abs(power) < 100:
                styles[THREE] += 1 if written == 3 else 0
                styles[TWO] += 1 if written == 2 else 0
                styles[ONE] += 1 if written == 1 else 0
                styles[TWO_OF_ONE] += 1 if written == 2 and abs(power) < 10 else 0
            continue
        places = min(shape >> FRACTION_DIGITS, MOST_DECIMALS)
        decimals[places] += 1
        styles[NO_ZERO] += 1 if shape & NO_INTEGER else 0
        if places == 0:
            styles[POINT_ONLY if shape & POINT else NO_POINT] += 1
        elif places == 1 and mantissa % 10 == 0:
            styles[POINT_ZERO] += 1
