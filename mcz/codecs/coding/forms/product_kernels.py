"""Compiled: multiples of a unit and ordinals of a GENERAL grid, a column at a time.

SPEC.md, "Value to ordinal", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel, trailing_zeros, truncated
from mcz.kernels.types import Floats, Ints
from mcz.model.numbers.value_kernels import decimal, magnitude_of

EXACT = 1 << 53  # up to which quotients of floats are right
MOST = float(1 << 24)  # units in a value, for which one is looked for
PRINTED = 1 << 62  # no ordinal: the decimal of such a product is to be printed


@kernel
def fill(
    codes: Ints, unit: float, shifts: int, tens: Floats, powers: Floats, digits: int, out: Ints
) -> int:
    """Fill ``out`` with ordinals, ``PRINTED`` where one product is not exact enough: how many.

    Of so many ``digits``; ``tens``: the exact powers of ten; ``powers``: all of them.
    """
    power = left = 0  # power: of ten, of the number before
    for t in range(len(codes)):
        if codes[t] == 0:
            out[t] = 0
            continue
        before = abs(codes[t]) - 1
        q = truncated(float(before) / float(shifts)) if before < EXACT else before // shifts
        value = float(2 * q + 1) * float(1 << before - q * shifts) * unit
        mantissa, power = decimal(value, power, digits, tens, powers)
        if mantissa == 0:
            out[t] = PRINTED
            left += 1
            continue
        magnitude = magnitude_of(mantissa, power, digits, tens)
        out[t] = -1 - magnitude if codes[t] < 0 else magnitude
    return left


@kernel
def next_unit(
    values: Floats,
    ordinals: Ints,
    units: Floats,
    start: int,
    tens: Floats,
    powers: Floats,
    digits: int,
) -> tuple[int, int]:
    """The first unit from ``start`` on of which all values are multiples, as their ordinals show.

    Where there is none: how many units there are. Also how many of the products show nothing, as
    they are to be printed.
    """
    for place in range(start, len(units)):
        left = count_open(values, ordinals, units[place], tens, powers, digits)
        if left >= 0:
            return place, left
    return len(units), 0


def count_open(
    values: Floats, ordinals: Ints, unit: float, tens: Floats, powers: Floats, digits: int
) -> int:
    """Count the multiples of a unit to be printed; -1 where another has another ordinal."""
    power = left = 0
    for row in range(len(values)):
        size = np.rint(abs(values[row]) / unit)
        magnitude = 0
        if size >= MOST:
            return -1
        if size > 0.0:
            mantissa, power = decimal(size * unit, power, digits, tens, powers)
            if mantissa == 0:
                left += 1
                continue
            magnitude = magnitude_of(mantissa, power, digits, tens)
        if ordinals[row] != (-1 - magnitude if values[row] < 0.0 and size > 0.0 else magnitude):
            return -1
    return left


@kernel
def fill_codes(values: Floats, unit: float, codes: Ints) -> int:
    """Fill in the codes of multiples below ``MOST``; returns ``shifts``, as few as there may be."""
    shifts = 1
    for row in range(len(values)):
        codes[row] = truncated(np.rint(values[row] / unit))
        if codes[row]:
            shifts = max(shifts, trailing_zeros(codes[row]) + 1)
    for row in range(len(values)):
        if codes[row]:
            z = trailing_zeros(codes[row])
            code = (abs(codes[row]) >> (z + 1)) * shifts + z + 1
            codes[row] = -code if codes[row] < 0 else code
    return shifts
