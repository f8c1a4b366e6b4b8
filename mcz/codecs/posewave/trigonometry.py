"""Sine, cosine, arc tangent and rotation vectors, the same bits on every machine.

SPEC.md, "Pose metric" and "Axis orders", is normative. Sine and cosine: an angle without whole
quarter turns, then two polynomials, by + - * in one order; exact to 1e-12 up to 2^20 quarter turns.
Arc tangent: a quotient of at most tan(1/16 turn), its series, then whole eighths and quarters, by +
- * / in one order; exact to 1e-15 of a turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BEYOND = 2.0**40  # values of this magnitude or more count as 0
VECTOR = 4  # in the place of an axis: a part of a rotation vector

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


LONGEST = 256.0  # the square of a vector's length in radians from which on it counts as 0
HALVINGS = (0, 1, 2, 3)
# Of the Taylor series, the last factor first: 1 / (k (k + 1)).
FIRST = tuple(1.0 / (k * (k + 1.0)) for k in (16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0, 2.0))
SECOND = tuple(1.0 / (k * (k + 1.0)) for k in (17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0))
THIRD = tuple(1.0 / (k * (k + 1.0)) for k in (18.0, 16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0))
SIXTH = 0.16666666666666666


def exponential(square: float) -> tuple[float, float, float]:
    """sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3 of t^2, which is below 256.

    Those of a sixteenth of t by their series, then doubled four times.
    """
    q = square * 0.00390625
    a = b = c = 1.0
    for factor in FIRST:
        a = 1.0 - q * a * factor
    for factor in SECOND:
        b = 1.0 - q * b * factor
    for factor in THIRD:
        c = 1.0 - q * c * factor
    b = b * 0.5
    c = c * SIXTH
    for _ in HALVINGS:
        c = (c + a * b) * 0.25
        cosine = 1.0 - q * b
        b = a * a * 0.5
        a = a * cosine
        q = q * 4.0
    return a, b, c
