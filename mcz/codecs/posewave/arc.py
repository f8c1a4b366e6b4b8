"""Angles of directions, the same bits on every machine: the inverse of ``turns``.

SPEC.md, "Axis orders", is normative: a quotient of at most tan(1/16 turn), the series of its arc,
then whole eighths and quarters, by + - * / in one order. Off by less than 1e-15 of a turn.
"""

from __future__ import annotations

from mcz.codecs.posewave.trigonometry import Rule

STEEP = 0.41421356237309503  # above it an eighth of a turn is taken off
N_FACTORS = 20
# Of the series x - x^3 / 3 + x^5 / 5 ..., the last factor first.
LAST = 1.0 / (2 * N_FACTORS + 1.0)
ARC = tuple(1.0 / (2 * k + 1.0) for k in range(N_FACTORS - 1, -1, -1))


def angle_of(y: float, x: float, rule: Rule) -> float:
    """The angle of (x, y), finite, in the unit of ``rule``: at most half a turn; 0 of (0, 0)."""
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
