"""Sine and cosine of angles, the same bits on every machine.

SPEC.md, "Pose metric", is normative: an angle less whole quarter turns, then two polynomials, by
+ - * in one order. Off by less than 1e-12 up to 2^20 quarter turns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BEYOND = 2.0**40  # a value of this magnitude or more counts as 0


class Rule(NamedTuple):
    """Range reduction of angles in a unit: a quarter turn is ``high`` + ``low``.

    ``high`` of a quarter turn in radians has 33 bits, so that its products are exact.
    """

    quarters: float
    high: float
    low: float
    radians: float


RULES = {
    "deg": Rule(1.0 / 90.0, 90.0, 0.0, 0.017453292519943295),
    "rad": Rule(0.6366197723675814, 1.5707963267341256, 6.077100506506192e-11, 1.0),
    "": Rule(0.0, 0.0, 0.0, 0.0),  # unknown: nothing turns
}

# Of the Taylor series, the last factor first: 1 / (k (k + 1)).
SINE = tuple(1.0 / (k * (k + 1.0)) for k in (12.0, 10.0, 8.0, 6.0, 4.0, 2.0))
COSINE = tuple(1.0 / (k * (k + 1.0)) for k in (13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0))


def sine_cosine(angle: float, rule: Rule) -> tuple[float, float]:
    """Sine and cosine of an angle in the unit of ``rule``; 2^40 or more, or NaN, counts as 0."""
    angle = angle if abs(angle) < BEYOND else 0.0
    turns = np.floor(angle * rule.quarters + 0.5)
    rest = ((angle - turns * rule.high) - turns * rule.low) * rule.radians
    square = rest * rest
    sine = cosine = 1.0
    for factor in SINE:
        sine = 1.0 - square * sine * factor
    for factor in COSINE:
        cosine = 1.0 - square * cosine * factor
    sine = rest * sine
    turns = turns - 4.0 * np.floor(turns * 0.25)  # 0 to 3
    odd = turns == 1.0 or turns == 3.0
    first = cosine if odd else sine
    second = sine if odd else cosine
    return first if turns < 2.0 else -first, -second if 1.0 <= turns <= 2.0 else second
