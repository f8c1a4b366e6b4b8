"""Compiled: the notation of numbers in text, as ``mcz.model.numbers.kernels`` has it."""

from __future__ import annotations

from mcz.kernels import bit_length, eight_bytes, kernel, trailing_zeros
from mcz.kernels.types import Bytes, Ints, Ints2
from mcz.model.numbers.kernels import (
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
    UPPER,
    ZERO_INTEGER,
)

OUTSIDE = -1  # in place of a count
NO_POINT = -1  # digits after a point where there is none
POINT_DIGIT = 46 ^ 48


@kernel
def scan(text: Bytes, start: Ints, stop: Ints, fields: Ints2) -> int:
    """Fill ``fields`` (n, 3) from tokens ``text[start[i]:stop[i]]``; returns the number of bad
    ones, ``OUTSIDE`` where one is outside of the text.
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
        if mantissa == 0 or (high_fraction != NO_POINT and fraction != NO_POINT):
            return 0, -1
        mantissa += _number_of_eight(high) * (100_000_000 if fraction == NO_POINT else 10_000_000)
        if high:
            first = (trailing_zeros(high) >> 3) - (8 if fraction == NO_POINT else 7)
        fraction = high_fraction + 8 if high_fraction != NO_POINT else fraction
    if fraction >= BAD:
        return 0, -1
    last = bit_length(digits | 1) - 1 >> 3
    shape = max(0, last + 1 - first) << SIGNIFICANT
    integers = size
    if fraction != NO_POINT:
        integers -= fraction + 1
        shape |= POINT | fraction << FRACTION_DIGITS
    if integers == 0:
        shape |= NO_INTEGER if size > 1 else NO_INTEGER | BAD
    is_zero = 1 if text[at] == 48 else 0
    return mantissa, shape | is_zero * (ZERO_INTEGER if integers == 1 else EXTRA_ZERO)


def _eight_characters(text: Bytes, end: int, size: int) -> tuple[int, int]:
    """The ``size`` <= 8 digits before ``end``, a byte each, the last in the highest.

    Returned with the number of digits after the point: ``NO_POINT`` without one, ``BAD`` or more
    where there is another character or a second point.
    """
    last = int(text[end - 1]) ^ 48
    digits = (eight_bytes(text, end - 8) ^ 0x3030303030303030) & -(1 << 64 - 8 * size)
    bad = digits & 0x0080808080808080  # beyond ASCII; the last digit, in the highest byte, is known
    digits &= 0x007F7F7F7F7F7F7F
    odd = digits + 0x0076767676767676 & 0x0080808080808080  # above 9
    digits += last << 56
    fraction = NO_POINT
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
