"""Kernels of decimal numbers in text: compare them with a grid, print them.

A token is described by a row of three int64, which determines its text unless LONG:

0. its digits read as one integer, leading zeros dropped (below 10^18)
1. the number after its ``e``, 0 without one, clamped to +-``HUGE``
2. shape: the bits below, and ``SIGNIFICANT``, ``EXPONENT_DIGITS``, ``FRACTION_DIGITS`` above them

Everything is int64, the only integer type of compiled loops.
"""

from __future__ import annotations

from mcz.kernels import bit_length, kernel, put_eight_bytes
from mcz.kernels.types import Bytes, Flags, Floats, Ints, Ints2
from mcz.model.numbers.value_kernels import EXACT_POWER, scaled

HUGE = 1_000_000
POWERS: tuple[int, ...] = tuple(10**power for power in range(19))

# Bits of a shape.
MINUS, PLUS = 1, 2
POINT = 4
EXPONENT, UPPER, EXPONENT_SIGN = 8, 16, 32
NO_INTEGER = 64  # ".5"
ZERO_INTEGER = 128  # "0.5"
EXTRA_ZERO = 256  # "00.5", never printed by a grid
LONG = 512  # more than 18 significant digits: column 0 is not exact
SPECIAL = 1024  # nan or inf
BAD = 2048  # not a number
SIGNIFICANT = 12  # shift; 5 bits: digits from the first to the last nonzero one
EXPONENT_DIGITS = 17  # shift; 8 bits
FRACTION_DIGITS = 25  # shift; 16 bits

# Bits of a grid's flags, as in mcz.model.numbers.GridFlag (loops know plain integers).
_POINT_ZERO, _POINT_ONLY, _NO_ZERO, _PLUS, _EXP3, _EXP1, _UPPER = 1, 2, 4, 8, 16, 32, 64


@kernel
def values(fields: Ints2, tens: Floats, out: Floats, slow: Flags) -> int:
    """Fill ``out`` with the nearest binary64 of each token; returns the number of tokens left out.

    ``slow`` is set for these: no binary64 holds their mantissa or power of ten exactly.
    """
    n_slow = 0
    for token in range(len(fields)):
        mantissa, power, shape = fields[token, 0], fields[token, 1], fields[token, 2]
        power -= shape >> FRACTION_DIGITS
        hard = mantissa != 0 and (mantissa > 1 << 53 or abs(power) > EXACT_POWER)
        if hard or shape & (LONG | SPECIAL | BAD):  # TEXT-03
            slow[token] = True
            n_slow += 1
            continue
        value = scaled(mantissa, power, tens) if mantissa else 0.0
        out[token] = -value if shape & MINUS else value  # TEXT-03
    return n_slow


@kernel
def match(
    fields: Ints2,
    rule: tuple[int, int, int, int, int, int, int],
    ordinals: Ints,
    printed: Flags,
    allowed: int,
) -> int:
    """Fill in ordinals of tokens that a decimal grid prints; return the number of others.

    Stops after more than ``allowed`` others.

    ``rule``: significant digits or 0, decimals, trimmed, low, high, flags, limit. With digits:
    ``%g``, with an exponent below ``low`` and from ``high`` on. Without: exactly, or if trimmed at
    most, ``decimals`` decimals. Magnitudes above ``limit`` are not printed.
    """
    digits, decimals, trim, low, high, flags, limit = rule
    refused = LONG | SPECIAL | BAD | EXTRA_ZERO | (0 if digits else EXPONENT)
    seen, usual = 0, 1  # bits of a shape, and their values in a number of fixed decimals; none
    if digits == 0 and trim == 0 and flags == 0:
        seen = refused | PLUS | NO_INTEGER | POINT | 65535 << FRACTION_DIGITS
        usual = (POINT if decimals else 0) | decimals << FRACTION_DIGITS
    misses = 0
    for token in range(len(fields)):
        mantissa, power, shape = fields[token, 0], fields[token, 1], fields[token, 2]
        if shape & seen == usual and mantissa <= limit:
            ordinals[token] = mantissa ^ -(shape & MINUS)
            printed[token] = True
            continue
        places = (shape >> FRACTION_DIGITS) & 65535
        good = shape & refused == 0 and (shape & PLUS != 0) == (
            flags & _PLUS != 0 and shape & MINUS == 0
        )
        if not good:
            magnitude = 0
        elif shape & EXPONENT:
            good = (power < low or power >= high) and _scientific(
                mantissa, power, shape, places, flags
            )
            magnitude = _general(mantissa, power, digits) if good else 0
        else:
            good = _positional(mantissa, shape, places, decimals, trim, flags)
            if digits:
                index = length(mantissa) - 1 - places
                good = good and (mantissa == 0 or low <= index < high)
                magnitude = _general(mantissa, index, digits) if good else 0
            else:
                magnitude = _scaled(mantissa, decimals - places, limit) if good else 0
        if digits and mantissa and (shape >> SIGNIFICANT) & 31 > digits:
            good = False
        if not good or magnitude < 0 or magnitude > limit:
            good = False
            magnitude = 0
            misses += 1
            if misses > allowed:
                break
        ordinals[token] = -1 - magnitude if good and shape & MINUS else magnitude
        printed[token] = good
    return misses


def length(mantissa: int) -> int:
    """Decimal digits of ``mantissa``, 0 for 0."""
    digits = bit_length(mantissa) * 1233 >> 12  # log 2 is 1233 / 4096
    return digits + (1 if mantissa >= POWERS[digits] else 0)


def _general(mantissa: int, power: int, digits: int) -> int:
    """Magnitude of d.ddd * 10^power among the numbers of ``digits`` digits; -1 if there is none."""
    if mantissa == 0 or digits > 15:
        return 0
    if abs(power) > 307:
        return -1
    shift = digits - length(mantissa)
    mantissa = mantissa * POWERS[shift] if shift >= 0 else mantissa // POWERS[-shift]
    block = POWERS[digits - 1]
    return (power + 307) * 9 * block + 1 + mantissa - block


def _scaled(mantissa: int, shift: int, limit: int) -> int:
    """``mantissa * 10^shift``, limit + 1 if it is greater than limit."""
    for _ in range(shift):
        if mantissa > limit:
            break
        mantissa *= 10
    for _ in range(-shift):  # a ".0" if the grid has no decimals
        mantissa //= 10
    return min(mantissa, limit + 1)


def _scientific(mantissa: int, power: int, shape: int, places: int, flags: int) -> bool:
    """Return True if a token with an exponent has the printed form."""
    size = abs(power)
    width = 3 if flags & _EXP3 or size >= 100 else 1 if flags & _EXP1 and size < 10 else 2
    return (
        shape & (NO_INTEGER | ZERO_INTEGER) == 0
        and length(mantissa) == places + 1
        and (places == 0 or mantissa % 10 != 0)
        and (shape & POINT != 0) == (places > 0)
        and shape & EXPONENT_SIGN != 0
        and (shape & UPPER != 0) == (flags & _UPPER != 0)
        and (shape >> EXPONENT_DIGITS) & 255 == width
    )


def _positional(
    mantissa: int, shape: int, places: int, decimals: int, trim: int, flags: int
) -> bool:
    """Return True if a token without an exponent has the printed form."""
    point = shape & POINT != 0
    if trim and (places > 1 or (places == 1 and mantissa % 10 != 0)):
        good = mantissa % 10 != 0 and places <= decimals
        fractional = True
    elif trim:  # integral
        good = places == (1 if flags & _POINT_ZERO else 0)
        good = good and point == (flags & (_POINT_ZERO | _POINT_ONLY) != 0)
        fractional = False
    else:
        good = places == decimals and point == (places > 0 or flags & _POINT_ONLY != 0)
        fractional = places > 0
    if flags & _NO_ZERO and fractional:
        return good and shape & ZERO_INTEGER == 0
    return good and shape & NO_INTEGER == 0


@kernel
def write(
    negative: Flags,
    mantissas: Ints,
    fractions: Ints,
    rule: tuple[int, int, int, int],
    out: Bytes,
    offsets: Ints,
) -> None:
    """Print ``mantissa * 10^-fraction`` for every i at ``out[offsets[i]:offsets[i + 1]]``.

    ``rule``: trimmed, low, high, flags. Trimming drops trailing zeros of the fraction; an
    exponent is printed below ``low`` and from ``high`` on. ``out`` has ``SPARE`` bytes more.
    """
    at = 0
    for i in range(len(mantissas)):
        mantissa = mantissas[i]
        at = put(negative[i], mantissa, length(mantissa), fractions[i], rule, out, at)
        offsets[i + 1] = at


def put(
    negative: bool,
    mantissa: int,
    count: int,
    fraction: int,
    rule: tuple[int, int, int, int],
    out: Bytes,
    at: int,
) -> int:
    """Print ``mantissa * 10^-fraction`` at ``at``, by a rule as in ``write``; returns the end.

    ``count``: the digits of the mantissa, 0 for 0.
    """
    trim, low, high, flags = rule
    if trim and mantissa == 0:
        fraction = 0
    while trim and mantissa != 0 and mantissa % 10 == 0:
        mantissa //= 10
        fraction -= 1
        count -= 1
    power = count - 1 - fraction
    scientific = mantissa != 0 and (power < low or power >= high)
    if scientific:
        fraction = count - 1
    out[at] = 45 if negative else 43
    at += 1 if negative or flags & _PLUS else 0  # TEXT-01
    least = 0 if flags & _NO_ZERO and fraction > 0 else 1  # TEXT-01
    integers = max(least, count - fraction)
    end = at + integers
    if fraction > 0:
        digits = integers + fraction
        if fraction <= 8 and digits <= 16:
            high = mantissa // 100_000_000
            low = _eight_digits(mantissa - 100_000_000 * high)
            if digits > 8:
                put_eight_bytes(out, at, _eight_digits(high) >> 8 * (16 - digits))
                put_eight_bytes(out, at + digits - 8, low)
            else:
                put_eight_bytes(out, at, low >> 8 * (8 - digits))
            put_eight_bytes(out, end + 1, low >> 8 * (8 - fraction))
        else:
            mantissa = _digits(mantissa, fraction, out, end + 1)
            _digits(mantissa, integers, out, at)
        out[end] = 46
        end += fraction + 1
    else:
        zeros = min(-fraction, integers)
        _digits(mantissa, integers - zeros, out, at)
        for index in range(end - zeros, end):
            out[index] = 48
    if scientific:
        return _power(power, flags, out, end)
    if fraction <= 0:
        if flags & (_POINT_ZERO | _POINT_ONLY):  # TEXT-01
            out[end] = 46
            end += 1
        if flags & _POINT_ZERO:
            out[end] = 48
            end += 1
    return end


def _eight_digits(number: int) -> int:
    """The digits of a number below 10^8 as eight bytes, the first digit in the lowest one."""
    high = number // 10_000
    fours = high + (number - 10_000 * high << 32)
    tens = (fours * 10_486 >> 20) & 0x7F0000007F  # a hundredth of each
    twos = tens + (fours - 100 * tens << 16)
    ones = (twos * 103 >> 10) & 0xF000F000F000F  # a tenth of each
    return ones + (twos - 10 * ones << 8) + 0x3030303030303030


def _digits(mantissa: int, count: int, out: Bytes, at: int) -> int:
    """Print the last ``count`` digits of ``mantissa`` at ``at``; returns the digits before them."""
    index = at + count
    while index > at + 1:
        rest = mantissa // 100
        pair = mantissa - 100 * rest
        ten = pair * 103 >> 10
        index -= 2
        out[index] = 48 + ten
        out[index + 1] = 48 + pair - 10 * ten
        mantissa = rest
    if index > at:
        rest = mantissa // 10
        out[at] = 48 + mantissa - 10 * rest
        mantissa = rest
    return mantissa


def _power(power: int, flags: int, out: Bytes, at: int) -> int:
    """Print ``e``, sign and digits of an exponent; return where it ends."""
    out[at] = 69 if flags & _UPPER else 101
    out[at + 1] = 45 if power < 0 else 43
    power = abs(power)
    # TEXT-01
    width = 3 if flags & _EXP3 or power >= 100 else 1 if flags & _EXP1 and power < 10 else 2
    end = at + 2 + width
    for index in range(end - 1, at + 1, -1):
        out[index] = 48 + power % 10
        power //= 10
    return end
