"""Magnitude indices and the binary64 that they stand for, a pair of functions for each family.

A magnitude index is an int64 >= 0 within the limit of its grid (the caller checks that); values
here have no sign. ``*_values`` are normative (SPEC.md, "Number grids"); ``*_magnitudes`` find the
index of a finite value >= 0, or of the nearest number of the grid.
"""

from __future__ import annotations

import numpy as np

from mcz.model.numbers.rules import MAX_POWER, MIN_POWER
from mcz.model.numbers.tokens import EXACT_POWER, NAN, TENS
from mcz.model.types import Floats, Ints

FIRST_NAN32 = 0x7F800001
FIRST_NAN64 = 0x7FF0000000000001
_LEAST_POWER = -324  # of ten, at or below every binary64 above 0
POWERS = np.array([float(f"1e{power}") for power in range(_LEAST_POWER, 309)])
_VAX_TINY = 0x00800000  # below it the exponent is 0: zero, or reserved with a minus sign


def general_split(magnitudes: Ints, digits: int) -> tuple[Ints, Ints]:
    """(mantissa, power of ten) of numbers of so many digits; (0, 0) for zero."""
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
