"""Compiled: quadratic Bezier curves fitted to the points of a joint within a bound.

Encoder only; mcz/codecs/curves/README.md describes it. Imported on first use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Flags, Floats, Floats2, Ints

PUBLISHED, LEAST_SQUARES = 0, 1  # how a middle point is found


class Rule(NamedTuple):
    """Rule by which curves are fitted.

    ``closed``: ends and middle are rounded before the error is measured, so that the bound holds
    for what is decoded; to multiples of 1 / ``per``, or of ``step`` where that is 0.
    """

    method: int
    per: float
    step: float
    closed: int


def round_to_grid(value: float, per: float, step: float) -> float:
    """``value`` on the grid, halves away from zero; ``per`` 10^decimals, or 0 for ``step``."""
    scaled = abs(value) * per if per > 0 else abs(value) / step
    index = np.floor(scaled + 0.5)
    nearest = index / per if per > 0 else index * step
    return float(-nearest if value < 0 else nearest)


def middle(points: Floats2, a: int, b: int, ends: Floats2, method: int, out: Floats) -> None:
    """The middle control point of the curve over frames a to b, written to ``out``.

    ``ends`` are its end points, (2, channels).
    """
    n_channels = points.shape[1]
    length = b - a
    if length < 2:
        for c in range(n_channels):
            out[c] = ends[0, c]
        return
    if length == 2 and method == PUBLISHED:
        for c in range(n_channels):
            out[c] = points[a + 1, c]
        return
    for c in range(n_channels):
        out[c] = 0.0
    total = 0.0
    for i in range(1, length):
        t = i / length
        u = 1.0 - t
        weight = 2.0 * t * u
        share = 1.0 if method == PUBLISHED else weight
        total += share * weight
        for c in range(n_channels):
            rest = points[a + i, c] - u * u * ends[0, c] - t * t * ends[1, c]
            out[c] += share * rest
    for c in range(n_channels):
        out[c] /= total


def worst(
    points: Floats2, a: int, b: int, ends: Floats2, mid: Floats, enough: float
) -> tuple[float, int]:
    """The greatest squared distance from the curve, and the first frame that has it.

    It is looked for until it exceeds ``enough``.
    """
    n_channels = points.shape[1]
    length = b - a
    greatest, at = -1.0, a
    for i in range(length + 1):
        t = i / length if length else 0.0
        u = 1.0 - t
        square = 0.0
        for c in range(n_channels):
            curve = u * u * ends[0, c] + 2.0 * t * u * mid[c] + t * t * ends[1, c]
            square += (points[a + i, c] - curve) ** 2
        if square > greatest:
            greatest, at = square, a + i
            if greatest > enough:
                break
    return greatest, at


def fit(
    points: Floats2,
    exact: Floats2,
    a: int,
    b: int,
    rule: Rule,
    enough: float,
    work: Floats2,
) -> tuple[float, int]:
    """Fit one curve; ``work`` (3, channels) then has its two ends and its middle.

    ``exact`` are the ends that are used, the points or the rounded points.
    """
    for c in range(points.shape[1]):
        work[0, c], work[1, c] = exact[a, c], exact[b, c]
    middle(points, a, b, work[:2], rule.method, work[2])
    if rule.closed:
        for c in range(points.shape[1]):
            work[2, c] = round_to_grid(work[2, c], rule.per, rule.step)
    return worst(points, a, b, work[:2], work[2], enough)


@kernel
def breaks_by_splitting(
    points: Floats2,
    exact: Floats2,
    marks: Ints,
    limit: float,
    rule: Rule,
    is_break: Flags,
) -> None:
    """Set ``is_break`` at the frames at which curves meet between marks: split at the worst one."""
    work = np.zeros((3, points.shape[1]))
    stack = np.zeros((len(points) + 2, 2), np.int64)
    for k in range(len(marks) - 1):
        depth = 1
        stack[0, 0], stack[0, 1] = marks[k], marks[k + 1]
        while depth:
            depth -= 1
            a, b = stack[depth, 0], stack[depth, 1]
            greatest, at = fit(points, exact, a, b, rule, np.inf, work)
            if greatest <= limit or b - a < 2:
                continue
            if at == a or at == b:  # the ends themselves are rounded too far
                at = (a + b) // 2
            is_break[at] = True
            stack[depth, 0], stack[depth, 1] = a, at
            stack[depth + 1, 0], stack[depth + 1, 1] = at, b
            depth += 2


@kernel
def breaks_of_fewest(
    points: Floats2,
    exact: Floats2,
    marks: Ints,
    limit: float,
    rule: Rule,
    is_break: Flags,
) -> None:
    """Set ``is_break`` at the fewest frames that keep the bound; of equals, the best fit.

    Dynamic programming between two marks: the work grows with the cube of their distance.
    """
    work = np.zeros((3, points.shape[1]))
    count, origin = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    error = np.empty(len(points))
    for k in range(len(marks) - 1):
        first, last = marks[k], marks[k + 1]
        size = last - first + 1
        count[:size] = size
        error[:size] = 0.0
        origin[:size] = 0
        count[0] = 0
        for b in range(1, size):
            for a in range(b - 1, -1, -1):
                if count[a] + 1 > count[b]:
                    continue
                greatest, _ = fit(points, exact, first + a, first + b, rule, limit, work)
                if greatest > limit and b - a > 1:
                    continue
                total = error[a] + greatest
                if count[a] + 1 < count[b] or total < error[b]:
                    count[b], error[b], origin[b] = count[a] + 1, total, a
        at = size - 1
        while at > 0:
            is_break[first + at] = True
            at = origin[at]


@kernel
def middles(out: Floats2, points: Floats2, exact: Floats2, breaks: Ints, method: int) -> None:
    """Write the middle point of every curve, unrounded, (curves, channels)."""
    ends = np.zeros((2, points.shape[1]))
    for k in range(len(breaks) - 1):
        for c in range(points.shape[1]):
            ends[0, c], ends[1, c] = exact[breaks[k], c], exact[breaks[k + 1], c]
        middle(points, breaks[k], breaks[k + 1], ends, method, out[k])
