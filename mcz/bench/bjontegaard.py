"""Bjontegaard deltas: two rate-distortion curves as two numbers.

docs/reference/measures.md, "Bjontegaard deltas", is normative.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
Curve = Iterable[tuple[float, float]]  # (size in bytes, quality in dB)

FEWEST = 4  # points of a curve


def pareto_front(curve: Curve) -> tuple[Values, Values]:
    """Sizes and qualities of the points that no smaller point matches, both ascending.

    >>> pareto_front([(20, 3.0), (10, 2.0), (30, 2.5)])
    (array([10., 20.]), array([2., 3.]))
    """
    kept: list[tuple[float, float]] = []
    for size, quality in sorted(curve, key=lambda point: (point[0], -point[1])):
        if not kept or quality > kept[-1][1]:
            kept.append((float(size), float(quality)))
    return np.array([p[0] for p in kept]), np.array([p[1] for p in kept])


def bd_rate(reference: Curve, other: Curve) -> float | None:
    """Percent of bytes that ``other`` needs more at equal quality; None without a common range."""
    a, b = pareto_front(reference), pareto_front(other)
    mean = _mean_difference((a[1], np.log10(a[0])), (b[1], np.log10(b[0])))
    return None if mean is None else float((10.0**mean - 1) * 100)


def bd_sqnr(reference: Curve, other: Curve) -> float | None:
    """Gain of ``other`` in dB at equal size; None if the ranges do not overlap."""
    a, b = pareto_front(reference), pareto_front(other)
    return _mean_difference((np.log10(a[0]), a[1]), (np.log10(b[0]), b[1]))


def _mean_difference(a: tuple[Values, Values], b: tuple[Values, Values]) -> float | None:
    """The mean of y of ``b`` minus y of ``a`` over their common x."""
    if min(len(a[0]), len(b[0])) < FEWEST:
        return None
    low, high = max(a[0][0], b[0][0]), min(a[0][-1], b[0][-1])
    if not low < high:
        return None
    return float((_integral(*b, low, high) - _integral(*a, low, high)) / (high - low))


def _integral(x: Values, y: Values, low: float, high: float) -> float:
    """Integrate the PCHIP through (x, y), x ascending, from ``low`` to ``high``."""
    h = np.diff(x)
    secants = np.diff(y) / h
    slopes = pchip_slopes(h, secants)
    # Of each piece y + d t + c t^2 + b t^3, t = distance from its first point.
    c = (3 * secants - 2 * slopes[:-1] - slopes[1:]) / h
    b = (slopes[:-1] + slopes[1:] - 2 * secants) / h**2

    def until(t: Values) -> Values:
        return np.asarray(t * (y[:-1] + t * (slopes[:-1] / 2 + t * (c / 3 + t * b / 4))))

    start, stop = np.clip(low - x[:-1], 0, h), np.clip(high - x[:-1], 0, h)
    return float(np.sum(until(stop) - until(start)))


def pchip_slopes(h: Values, secants: Values) -> Values:
    """Slopes at the points of a PCHIP from the pieces' widths and secants, at least two pieces."""
    before, behind = secants[:-1], secants[1:]
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    rising = before * behind > 0
    safe = np.where(rising, before, 1.0), np.where(rising, behind, 1.0)
    inner = np.where(rising, (w1 + w2) / (w1 / safe[0] + w2 / safe[1]), 0.0)
    first = _end_slope(h[0], h[1], secants[0], secants[1])
    last = _end_slope(h[-1], h[-2], secants[-1], secants[-2])
    return np.concatenate([[first], inner, [last]])


def _end_slope(h0: float, h1: float, s0: float, s1: float) -> float:
    slope = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if slope * s0 <= 0:
        return 0.0
    if s0 * s1 < 0 and abs(slope) > 3 * abs(s0):
        return 3 * s0
    return slope
