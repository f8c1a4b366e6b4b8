"""Kernels of tokens: their notation scanned, their notations counted, values printed as tokens.

``decimal_kernels`` defines the rows that describe tokens. Counts of notations suggest grids.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import bit_length, eight_bytes, kernel, trailing_zeros, truncated
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2
from mcz.model.numbers.decimal_kernels import (
    BAD,
    EXPONENT,
    EXPONENT_DIGITS,
    EXPONENT_SIGN,
    EXTRA_ZERO,
    FRACTION_DIGITS,
    HUGE,
    LONG,
    MINUS,
    NO_INTEGER,
    PLUS,
    POINT,
    SIGNIFICANT,
    SPECIAL,
    UPPER,
    ZERO_INTEGER,
    length,
    put,
)
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

OUTSIDE = -1  # in place of a count
NO_FRACTION = -1  # digits after a point if there is none
POINT_DIGIT = 46 ^ 48


@kernel
def scan(text: Bytes, start: Ints, stop: Ints, fields: Ints2) -> int:
    """Fill ``fields`` (n, 3) from tokens ``text[start[i]:stop[i]]``; returns the number of bad
    ones, ``OUTSIDE`` if one is outside of the text.
    """
    n_bad = 0
    for token in range(len(start)):
        at, end = start[token], stop[token]
        if at < 0 or end < at or end > len(text):
            return OUTSIDE
        sign = 0
        if at < end:
            minus, plus = 1 if text[at] == 45 else 0, 1 if text[at] == 43 else 0
            sign = MINUS * minus + PLUS * plus
            at += minus + plus
        power = bits = 0
        first_end = end
        if end - at > 4 and text[end - 4] | 32 == 101:
            first_end = end - 4
            power, bits = _exponent(text, first_end, end)
        mantissa, shape = _short_number(text, at, first_end)
        if shape < 0 or bits & BAD:
            mantissa, power, shape = _number(text, at, end)
        else:
            shape |= bits
        fields[token, 0], fields[token, 1], fields[token, 2] = mantissa, power, shape | sign
        n_bad += 1 if shape & BAD else 0
    return n_bad


def _number(text: Bytes, at: int, end: int) -> tuple[int, int, int]:
    """The fields of a number without its sign."""
    shape = 0
    first = at
    point = -1
    mantissa = 0
    digits = 0  # of the mantissa, leading zeros left out
    significant = 0
    while at < end:
        digit = int(text[at]) - 48
        if digit == -2 and point < 0:
            point = at
        elif 0 <= digit <= 9:
            if digit or digits:
                digits += 1
                if digits <= 18:
                    mantissa = mantissa * 10 + digit
                if digit:
                    significant = digits
        else:
            break
        at += 1
    fraction = at - point - 1 if point >= 0 else 0
    integers = at - first - fraction - (1 if point >= 0 else 0)
    shape |= POINT if point >= 0 else 0
    shape |= LONG if digits > 18 else 0
    shape |= BAD if integers + fraction == 0 else 0
    if integers == 0:
        shape |= NO_INTEGER
    elif text[first] == 48:
        shape |= ZERO_INTEGER if integers == 1 else EXTRA_ZERO
    shape |= min(significant, 31) << SIGNIFICANT
    shape |= min(fraction, 65535) << FRACTION_DIGITS
    power = 0
    if at < end:
        power, bits = _exponent(text, at, end)
        shape |= bits
    return mantissa, power, shape


def _short_number(text: Bytes, at: int, end: int) -> tuple[int, int]:
    """Mantissa and shape of up to 16 digits and points, eight at once; shape -1: it is more.

    A loop over characters mispredicts where each number ends, which takes most of its time.
    """
    size = int(end - at)
    if size < 1 or size > 16 or end < 16:
        return 0, -1
    digits, fraction = _eight_characters(text, end, min(size, 8))
    mantissa = _number_of_eight(digits)
    first = trailing_zeros(digits | 1 << 62) >> 3  # the byte of the first digit that is not 0
    if size > 8:
        high, high_fraction = _eight_characters(text, end - 8, size - 8)
        if mantissa == 0 or (high_fraction != NO_FRACTION and fraction != NO_FRACTION):
            return 0, -1
        mantissa += _number_of_eight(high) * (
            100_000_000 if fraction == NO_FRACTION else 10_000_000
        )
        if high:
            first = (trailing_zeros(high) >> 3) - (8 if fraction == NO_FRACTION else 7)
        fraction = high_fraction + 8 if high_fraction != NO_FRACTION else fraction
    if fraction >= BAD:
        return 0, -1
    last = bit_length(digits | 1) - 1 >> 3
    shape = max(0, last + 1 - first) << SIGNIFICANT
    integers = size
    if fraction != NO_FRACTION:
        integers -= fraction + 1
        shape |= POINT | fraction << FRACTION_DIGITS
    if integers == 0:
        shape |= NO_INTEGER if size > 1 else NO_INTEGER | BAD
    is_zero = 1 if text[at] == 48 else 0
    return mantissa, shape | is_zero * (ZERO_INTEGER if integers == 1 else EXTRA_ZERO)


def _eight_characters(text: Bytes, end: int, size: int) -> tuple[int, int]:
    """The ``size`` <= 8 digits before ``end``, a byte each, the last in the highest.

    Returned with the number of digits after the point: ``NO_FRACTION`` without one, ``BAD`` or more
    if there is another character or a second point.
    """
    last = int(text[end - 1]) ^ 48
    digits = (eight_bytes(text, end - 8) ^ 0x3030303030303030) & -(1 << 64 - 8 * size)
    bad = digits & 0x0080808080808080  # beyond ASCII; the last digit, in the highest byte, is known
    digits &= 0x007F7F7F7F7F7F7F
    odd = digits + 0x0076767676767676 & 0x0080808080808080  # above 9
    digits += last << 56
    fraction = NO_FRACTION
    if odd or last > 9:
        place = trailing_zeros(odd) >> 3 if odd else 7
        bad |= odd & odd - 1 | (digits >> 8 * place & 255 ^ POINT_DIGIT)
        bad |= last if odd and last > 9 else 0
        before = digits & (1 << 8 * place) - 1
        digits += (before << 8) - before - (POINT_DIGIT << 8 * place)
        fraction = 7 - place
    return digits, fraction if bad == 0 else BAD


def _number_of_eight(digits: int) -> int:
    """The number of eight digits, the first in the lowest byte."""
    pairs = digits * 10 + (digits >> 8) & 0x00FF00FF00FF00FF
    fours = pairs * 100 + (pairs >> 16) & 0x0000FFFF0000FFFF
    return fours * 10_000 + (fours >> 32) & 0xFFFFFFFF


def _exponent(text: Bytes, at: int, end: int) -> tuple[int, int]:
    """The number after the ``e`` at ``at``, and bits of the shape."""
    if text[at] != 101 and text[at] != 69:
        return 0, BAD
    shape = EXPONENT | UPPER if text[at] == 69 else EXPONENT
    at += 1
    negative = False
    if at < end and (text[at] == 45 or text[at] == 43):
        shape |= EXPONENT_SIGN
        negative = text[at] == 45
        at += 1
    power = 0
    digits = 0
    while at < end and 48 <= text[at] <= 57:
        power = min(power * 10 + int(text[at]) - 48, HUGE)
        digits += 1
        at += 1
    if digits == 0 or at < end:  # TEXT-05
        shape |= BAD
    return (-power if negative else power), shape | min(digits, 255) << EXPONENT_DIGITS


MOST_DECIMALS = 63  # larger numbers of decimals are counted as this
MOST_DIGITS = 31

# Indices of ``Survey.styles``.
SIGNED, UNSIGNED = 0, 1  # a plus sign, and no sign at all
BARE_INTEGER, NO_ZERO = 2, 3  # "0.5", ".5"
POINT_ONLY, NO_POINT, POINT_ZERO = 4, 5, 6  # integral numbers: "5.", "5", "5.0"
THREE, TWO, ONE, TWO_OF_ONE = 7, 8, 9, 10  # digits of an exponent, the last if one would do
CAPITAL, SMALL = 11, 12  # "E", "e"
N_STYLES = 13


class Survey(NamedTuple):
    """Counts of numbers by decimals (those without an exponent) and by digits.

    ``styles``: counts of the notations above.
    """

    decimals: Ints
    significant: Ints
    styles: Ints


@kernel
def count_notations(fields: Ints2, step: int, n_counted: int, survey: Survey) -> None:
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


# Further columns of ``rules``: how ``kernels.put`` prints, and the last power of ten.
TRIM, LOW, HIGH, FLAGS, GUESS = range(3, 8)
RULE_SIZE = 8
FEW_DIGITS = 9
CLOSE = 1e-5


@kernel
def print_rows(
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
    """Print the nearest number of a grid; returns its end, -1 for what ``print_rows`` skips."""
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
    """``decimal`` of a value whose first digit is at ``power``, if two products reach it.

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
