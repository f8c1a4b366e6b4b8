"""Compiled: multiples of a unit to ordinals of a GENERAL grid, a column at a time.

SPEC.md, "Value to ordinal", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels import kernel, truncated
from mcz.kernels.types import Floats, Ints
from mcz.numbers.ordinal_kernels import decimal, magnitude_of

EXACT = 1 << 53  # up to which quotients of floats are right
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
        value = float(2 * q + 1) * float(1 << before - q * shifts) * unit  # LOSS-33
        mantissa, power = decimal(value, power, digits, tens, powers)
        if mantissa == 0:
            out[t] = PRINTED
            left += 1
            continue
        magnitude = magnitude_of(mantissa, power, digits, tens)
        out[t] = -1 - magnitude if codes[t] < 0 else magnitude
    return left
