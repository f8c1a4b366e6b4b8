"""Compiled: weighted recursive least squares, regressions that learn while they are used.

SPEC.md, "Codec 2: best", is normative. All is binary64 in the order written, nothing fused, so
that every machine computes the same bits. Imported on first use only.

Source: S. Haykin, *Adaptive Filter Theory*, 1986, in the covariance form; rows weigh less where
the prediction fails, as in robust regression.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mcz.kernels.types import Floats, Floats2, Ints

LIMIT = 1048576.0  # 2^20: estimates beyond it are none, targets are cut
SPIKES, LEAST = 0.3, 1e-9  # the part of an error in its row's weight; of a variance
EARLY_ROWS, EARLY, LATE = 20, 0.2, 0.05  # the speed at which the typical error follows
SLACK, FLOOR, AWAY = 1e-10, 1e-6, 1e300  # of pivots


class Regressions(NamedTuple):
    """Several regressions, an item each: sums of products, weights and typical errors.

    ``starts``: where the sums of each begin, a row a feature, and where the last end.
    """

    n_features: Ints
    starts: Ints
    sums: Floats
    weights: Floats2
    typical: Floats
    work: Floats  # room for the sums while they are solved
    weighted: Floats  # room for a row of them
    second: Floats


def regressions_of(n_features: Sequence[int]) -> Regressions:
    """Create untrained regressions with these numbers of features."""
    sizes = np.array(n_features, np.int64)
    widths = (sizes + 8) // 8 * 8
    starts = np.cumsum([0, *(sizes * widths)])
    most = int(sizes.max(initial=0))
    room = np.zeros(most * width_of(most)), *np.zeros((2, width_of(most)))
    weights = np.zeros((len(sizes), most))
    return Regressions(sizes, starts, np.zeros(starts[-1]), weights, np.ones(len(sizes)), *room)


def width_of(n: int) -> int:
    """Numbers in a row of sums: ``n`` features and the target, in eights."""
    return (n + 8) // 8 * 8


def bound_value(value: float) -> float:
    """``value``, or 0 for one that is too large or no number."""
    return value if abs(value) < LIMIT else 0.0


def estimate(own: Regressions, index: int, features: Floats) -> float:
    weights = own.weights[index]
    total = 0.0
    for i in range(own.n_features[index]):
        total = total + weights[i] * features[i]
    return bound_value(total)


def learn(
    own: Regressions,
    index: int,
    features: Floats,
    target: float,
    guess: float,
    keep: float,
    row: int,
) -> None:
    """Add a row to the sums of products, after multiplying them by ``keep``."""
    error, typical = target - guess, own.typical[index]  # BEST-18
    weight = 1.0 / ((typical * typical + SPIKES * (error * error)) + LEAST)
    n, sums, weighted = own.n_features[index], own.sums, own.weighted
    width = width_of(n)
    for i in range(n):
        weighted[i] = weight * features[i]
    weighted[n] = weight * target
    for i in range(n + 1, width):
        weighted[i] = 0.0
    at = own.starts[index]
    for i in range(n):
        feature = features[i]
        for j in range(i, width):
            sums[at + j] = keep * sums[at + j] + feature * weighted[j]
        at += width
    own.typical[index] = typical + (abs(error) - typical) * (EARLY if row < EARLY_ROWS else LATE)


def set_pivot(work: Floats, at: int, first: int, width: int, floor: float, row: Floats) -> float:
    """Copy a row of ``work`` and return 1 / its pivot, which is at least ``floor``."""
    for j in range(first, width):
        row[j] = work[at + j]
    if not row[first] > floor:
        row[first] = AWAY
        work[at + first] = AWAY
    return float(1.0 / row[first])


def solve(own: Regressions, index: int, ridge: float) -> None:
    """Fit the weights to the sums, by elimination without exchange; pivots have a floor."""
    n, work, one, two = own.n_features[index], own.work, own.weighted, own.second
    width, start, weights = width_of(n), own.starts[index], own.weights[index]
    for i in range(n * width):
        work[i] = own.sums[start + i]
    for i in range(n):
        at = i * width + i
        work[at] = work[at] + (ridge + SLACK * work[at])
    for k in range(0, n, 2):  # two pivots at a time: half the loads and stores
        at = k * width
        inverse = set_pivot(work, at, k, width, ridge * FLOOR, one)
        if k + 1 == n:
            break
        share, at = one[k + 1] * inverse, at + width
        for j in range(k + 1, width):
            work[at + j] = work[at + j] - share * one[j]
        second = set_pivot(work, at, k + 1, width, ridge * FLOOR, two)
        for i in range(k + 2, n):
            share, other, at = one[i] * inverse, two[i] * second, i * width
            for j in range(i, width):
                work[at + j] = (work[at + j] - share * one[j]) - other * two[j]
    for i in range(n - 1, -1, -1):
        at = i * width
        total = work[at + n]
        for j in range(i + 1, n):
            total = total - work[at + j] * weights[j]
        weights[i] = total / work[at + i]
