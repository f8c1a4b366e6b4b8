"""Compiled: multiples of a unit to ordinals of a GENERAL grid, a column at a time.

SPEC.md, "Value to ordinal", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.jit import kernel
from mcz.numbers.rules import MIN_POWER

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

LEAST_POWER = -324  # of ten: where the table of powers begins
EXACT_POWER = 22
PRINTED = 1 << 62  # no ordinal: the decimal of such a product is to be printed


@kernel
def fill(
    codes: Ints, unit: float, shifts: int, tens: Floats, powers: Floats, block: int, out: Ints
) -> int:
    """Fill ``out`` with ordinals, ``PRINTED`` where one product is not exact enough: how many.

    ``block``: the least mantissa; ``tens``: the exact powers of ten; ``powers``: all of them, from
    ``LEAST_POWER`` on.
    """
    digits = 1
    while int(tens[digits - 1]) < block:
        digits += 1
    power = left = 0  # power: of ten, of the number before
    for t in range(len(codes)):
        if codes[t] == 0:
            out[t] = 0
            continue
        before = abs(codes[t]) - 1
        odd = 2 * (before // shifts) + 1  # LOSS-33
        value = float(odd) * float(1 << before % shifts) * unit
        while value < powers[power - LEAST_POWER]:
            power -= 1
        while value >= powers[power + 1 - LEAST_POWER]:
            power += 1
        shift = digits - 1 - power
        mantissa = 0
        if 0 <= shift and shift <= EXACT_POWER:
            mantissa = int(np.rint(value * tens[shift]))
        elif shift < 0 and shift >= -EXACT_POWER:
            mantissa = int(np.rint(value / tens[-shift]))
        if mantissa < block or mantissa >= 10 * block:
            out[t] = PRINTED
            left += 1
            continue
        magnitude = (power - MIN_POWER) * 9 * block + 1 + mantissa - block
        out[t] = -1 - magnitude if codes[t] < 0 else magnitude
    return left
