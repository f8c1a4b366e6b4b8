"""Sine, cosine and arc tangent, the same bits on every machine.

SPEC.md, "Pose metric" and "Axis orders", is normative. Sine and cosine: an angle without whole
quarter turns, then two polynomials, by + - * in one order; exact to 1e-12 up to 2^20 quarter turns.
Arc tangent: a quotient of at most tan(1/16 turn), its series, then whole eighths and quarters, by +
- * / in one order; exact to 1e-15 of a turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BEYOND = 2.0**40  # values of this magnitude or more count as 0

STEEP = 0.41421356237309503  # above it an eighth of a turn is subtracted
N_FACTORS = 20
# Of the series x - x^3 / 3 + x^5 / 5 ..., the last factor first.
LAST = 1.0 / (2 * N_FACTORS + 1.0)
ARC = tuple(1.0 / (2 * k + 1.0) for k in range(N_FACTORS - 1, -1, -1))


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
    "": Rule(0.0, 0.0, 0.0, 0.0),  # unknown unit: no turns
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


def angle_of(y: float, x: float, rule: Rule) -> float:
    """Angle of (x, y), finite, in the unit of ``rule``: at most half a turn; 0 for (0, 0)."""
    up, right = abs(y), abs(x)
    small, large = min(up, right), max(up, right)
    ratio = small / large if large > 0.0 else 0.0
    steep = ratio > STEEP
    rest = (ratio - 1.0) / (ratio + 1.0) if steep else ratio
    square = rest * rest
    total = LAST
    for factor in ARC:
        total = factor - square * total
    quarter = rule.high + rule.low
    angle = rest * total / rule.radians
    angle = angle + 0.5 * quarter if steep else angle
    angle = quarter - angle if up > right else angle
    angle = 2.0 * quarter - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle
