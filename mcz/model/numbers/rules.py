"""The kinds of number grids: flags, digits, limits, magnitudes. SPEC.md, "Number grids".

A magnitude index is an int64 >= 0 within the limit of its grid (the caller checks that); values
here have no sign. ``*_values`` are normative; ``*_magnitudes`` find the index of a finite value
>= 0, or of the nearest number of the grid.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import IntEnum, IntFlag

import numpy as np

from mcz.model.types import Floats, Ints

NAN = np.int64(0x7FF8000000000000).view(np.float64)  # the only NaN in values
EXACT_POWER = 22  # 10^22 is the last power of ten that a binary64 holds exactly
TENS = np.array([float(f"1e{power}") for power in range(EXACT_POWER + 1)])
DECIMAL_LIMIT = 2**51 - 1  # below it, neighbors on a decimal grid are different binary64
INTEGER_LIMIT = 2**53
MIN_POWER, MAX_POWER = -307, 307  # of %g numbers: normal binary64, which 15 digits identify
FIXED_TEXT = 64  # digits of a TEXT64 grid from here on: %.nf with n = digits - 64
FIXED_TEXT_LIMIT = int(np.float64(1e21).view(np.int64)) - 1  # where JavaScript's toFixed ends
BASE_32, BASE_64 = 32, 64  # digits of a PRINTED grid: an IEEE number; smaller: so many decimals;
BASE_GENERAL = 128  # larger: BASE_GENERAL + n significant digits, 1 to 15
SHORT_FIXED, SIGNIFICANT, EXPONENT = 64, 128, 192  # styles of a PRINTED grid, n added
MOST_DECIMALS = 40  # of a style
FIXED_TEXT_LIMIT32 = 0x6258D726  # the last binary32 below 10^21
MIN_SCALE, MAX_SCALE = 2.0**-200, 2.0**200  # products with ordinals are normal binary64


class GridKind(IntEnum):
    FIXED = 1  # printf %.nf
    TRIMMED = 2  # printf %.nf without trailing zeros
    GENERAL = 3  # printf %g
    TEXT64 = 4  # text printed from a binary64 (shortest, %.17g, %.nf of many digits)
    TEXT32 = 5  # shortest text of a binary32
    INTEGER = 6  # two's complement integers, value = ordinal
    SCALED = 7  # integers, value = ordinal * scale
    BINARY32 = 8  # IEEE bits
    BINARY64 = 9
    VAX_F = 10  # 32-bit VAX F floating
    PRINTED = 11  # decimals or binary floats, printed by a style of their own


class GridFlag(IntFlag):
    """Print options of a text grid beyond printf; the bits of ``Grid.flags``."""

    POINT_ZERO = 1  # an integral number without exponent ends in ".0"
    POINT = 2  # an integral number without exponent ends in "."
    NO_ZERO = 4  # no zero before the point if digits follow it: ".5"
    PLUS = 8  # numbers without a minus sign have a plus sign
    EXPONENT3 = 16  # at least 3 digits in an exponent (else 2)
    EXPONENT1 = 32  # at least 1 digit in an exponent
    UPPER = 64  # "E" instead of "e"


TEXT_KINDS = (
    *(GridKind.FIXED, GridKind.TRIMMED, GridKind.GENERAL, GridKind.TEXT64, GridKind.TEXT32),
    GridKind.PRINTED,
)
DECIMAL_KINDS = (GridKind.FIXED, GridKind.TRIMMED, GridKind.GENERAL)
# their tokens need more than a check of the shape
CHECKED_KINDS = (GridKind.TEXT64, GridKind.TEXT32)
_STYLE = int(sum(GridFlag))
_TEXT64_DIGITS = (0, 1, 16, 17, *range(FIXED_TEXT + 10, FIXED_TEXT + 41))
# kind: allowed digits, allowed flags
_ALLOWED: dict[GridKind, tuple[Collection[int], int]] = {
    GridKind.FIXED: (range(23), GridFlag.POINT | GridFlag.NO_ZERO | GridFlag.PLUS),
    GridKind.TRIMMED: (range(1, 23), _STYLE & 15),
    GridKind.GENERAL: (range(1, 16), _STYLE),
    GridKind.TEXT64: (_TEXT64_DIGITS, _STYLE),
    GridKind.TEXT32: ((0,), _STYLE),
    GridKind.PRINTED: ((*range(23), BASE_32, BASE_64, *range(129, 144)), _STYLE),
}
_CLASHES = (GridFlag.POINT_ZERO | GridFlag.POINT, GridFlag.EXPONENT3 | GridFlag.EXPONENT1)
_LIMITS = {
    GridKind.FIXED: DECIMAL_LIMIT,
    GridKind.TRIMMED: DECIMAL_LIMIT,
    GridKind.TEXT64: 0x7FEFFFFFFFFFFFFF,
    GridKind.TEXT32: 0x7F7FFFFF,
    GridKind.INTEGER: INTEGER_LIMIT,
    GridKind.SCALED: DECIMAL_LIMIT,
    GridKind.BINARY32: 0x7FFFFFFF,
    GridKind.BINARY64: 0x7FFFFFFFFFFFFFFF,
    GridKind.VAX_F: 0x7FFFFFFF,
}


def grid_fault(kind: GridKind, digits: int, flags: int, scale: float, style: int = 0) -> str | None:
    """Return the fault of a grid, or None."""
    allowed, known = _ALLOWED.get(kind, ((0,), 0))
    if digits not in allowed:  # GRID-02
        return f"{digits} digits"
    if flags & ~known or any(flags & both == both for both in _CLASHES):  # GRID-03, GRID-06
        return f"flags {flags}"
    if kind == GridKind.TEXT64 and digits >= FIXED_TEXT and flags:  # GRID-03
        return f"flags {flags} with {digits} digits"
    # GRID-03
    if kind == GridKind.FIXED and flags & (GridFlag.NO_ZERO if digits == 0 else GridFlag.POINT):
        return f"flags {flags} with {digits} digits"
    # GRID-04
    if not (MIN_SCALE <= scale <= MAX_SCALE if kind == GridKind.SCALED else scale == 1.0):
        return f"scale {scale}"
    if kind == GridKind.PRINTED:
        return _style_fault(digits, flags, style)
    return f"style {style}" if style else None


def _style_fault(digits: int, flags: int, style: int) -> str | None:
    """Return the fault in the style of a PRINTED grid, or None."""
    significant = SIGNIFICANT < style <= SIGNIFICANT + 17
    exponent = EXPONENT <= style <= EXPONENT + MOST_DECIMALS
    if not (significant or exponent or (style < SIGNIFICANT and style % 64 <= MOST_DECIMALS)):
        return f"style {style}"  # GRID-12
    if digits > BASE_GENERAL and style != EXPONENT + digits - BASE_GENERAL - 1:  # GRID-12
        return f"style {style} with {digits} digits"
    exponents = GridFlag.PLUS | GridFlag.EXPONENT3 | GridFlag.EXPONENT1 | GridFlag.UPPER
    if flags & ~(_STYLE if significant else exponents if exponent else 0):  # GRID-03
        return f"flags {flags} with style {style}"
    return None


def limit(kind: GridKind, digits: int, style: int = 0) -> int:
    """The largest magnitude index of a grid."""
    if kind == GridKind.PRINTED:
        fixed = style < SIGNIFICANT
        if digits == BASE_32:
            return FIXED_TEXT_LIMIT32 if fixed else _LIMITS[GridKind.TEXT32]
        if digits == BASE_64:
            return FIXED_TEXT_LIMIT if fixed else _LIMITS[GridKind.TEXT64]
        if digits < BASE_32:
            return DECIMAL_LIMIT
        kind, digits = GridKind.GENERAL, digits - BASE_GENERAL
    if kind == GridKind.GENERAL:
        return (MAX_POWER - MIN_POWER + 1) * 9 * int(10 ** (digits - 1))
    if kind == GridKind.TEXT64 and digits >= FIXED_TEXT:
        return FIXED_TEXT_LIMIT
    return _LIMITS[kind]


FIRST_NAN32 = 0x7F800001
FIRST_NAN64 = 0x7FF0000000000001
_LEAST_POWER = -324  # of ten, at or below every binary64 above 0
POWERS = np.array([float(f"1e{power}") for power in range(_LEAST_POWER, 309)])
_VAX_TINY = 0x00800000  # below it the exponent is 0: zero, or reserved with a minus sign


def general_split(magnitudes: Ints, digits: int) -> tuple[Ints, Ints]:
    """(mantissa, power of ten) of numbers of ``digits`` digits; (0, 0) for zero."""
    block = 10 ** (digits - 1)
    power, mantissa = np.divmod(magnitudes - 1, 9 * block)
    zero = magnitudes == 0
    mantissa = np.where(zero, 0, mantissa + block)
    return mantissa, np.where(zero, 0, power + (MIN_POWER + 1 - digits))  # GRID-09


def general_magnitudes(values: Floats, digits: int) -> Ints:
    """Magnitudes of values (n,): by an exact enough product, else by printing."""
    zero = values == 0
    values = np.where(zero, 1.0, values)
    power = np.floor(np.log10(values)).astype(np.int64)
    # GRID-11
    # just below a power the logarithm equals the power's
    power -= values < POWERS[power - _LEAST_POWER]
    shift = digits - 1 - power
    needs_text = np.abs(shift) > EXACT_POWER
    tens = TENS[np.where(needs_text, 0, np.abs(shift))]
    mantissa = np.rint(np.where(shift < 0, values / tens, np.where(needs_text, 0.0, values) * tens))
    block = 10 ** (digits - 1)
    needs_text |= (mantissa < block) | (mantissa >= 10 * block)
    mantissa = np.where(needs_text, 0, mantissa).astype(np.int64)
    if needs_text.any():
        texts = [f"{value:.{digits - 1}e}".split("e") for value in values[needs_text].tolist()]
        mantissa[needs_text] = [int(digits.replace(".", "")) for digits, _ in texts]
        power[needs_text] = [int(power) for _, power in texts]
    zero |= power < MIN_POWER
    power = np.clip(power, MIN_POWER, MAX_POWER + 1)  # numbers beyond the end exceed the limit
    magnitudes = (power - MIN_POWER) * 9 * block + 1 + mantissa - block
    return np.where(zero, 0, magnitudes)


def scaled_magnitudes(values: Floats, factor: float, divide: bool, limit: int) -> Ints:
    """Index of ``values`` among the multiples of ``factor``, or of its inverse.

    The quotient is off by less than half while the index is at most 2^51 - 1.
    """
    with np.errstate(over="ignore"):
        scaled = values / factor if divide else values * factor
    return np.rint(np.minimum(scaled, float(limit))).astype(np.int64)  # GRID-11


def binary32_values(magnitudes: Ints) -> Floats:
    nan = magnitudes >= FIRST_NAN32  # a signalling one would warn below
    words = np.where(nan, 0, magnitudes).astype(np.uint32)
    return np.where(nan, NAN, words.view(np.float32).astype(np.float64))


def binary32_magnitudes(values: Floats) -> Ints:
    with np.errstate(over="ignore"):
        return values.astype(np.float32).view(np.uint32).astype(np.int64)


def binary64_values(magnitudes: Ints) -> Floats:
    return np.where(magnitudes >= FIRST_NAN64, NAN, magnitudes.view(np.float64))


def vax_values(magnitudes: Ints) -> Floats:
    """(1 + fraction / 2^23) * 2^(exponent - 129); exponent 0 means zero."""
    exponent = magnitudes >> 23
    fraction = (magnitudes & 0x7FFFFF) | 0x800000
    values = np.ldexp(fraction.astype(np.float64), (exponent - 129 - 23).astype(np.int32))
    return np.where(exponent == 0, 0.0, values)  # GRID-09


def vax_magnitudes(values: Floats) -> Ints:
    fraction, exponent = np.frexp(values)  # 0.5 <= fraction < 1
    words = np.rint(np.ldexp(fraction, 24)).astype(np.int64) - (1 << 23)
    words += (exponent.astype(np.int64) + 128) << 23
    words = np.where(words < _VAX_TINY, np.where(values > 2.0**-129, _VAX_TINY, 0), words)
    return np.where(values == 0, 0, np.minimum(words, 0x7FFFFFFF))


def vax_swap(words: Ints) -> Ints:
    """Exchange the 16-bit halves: a VAX stores the half with the sign first."""
    return (words >> 16 & 0xFFFF) | (words & 0xFFFF) << 16
