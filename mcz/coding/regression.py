"""Compiled: weighted recursive least squares, a regression that is learned while it is used.

SPEC.md, "Codec 2: best", is normative. All is binary64 in the order written, nothing fused, so
that every machine computes the same bits. Imported on first use only.

Source: S. Haykin, *Adaptive Filter Theory*, 1986, in the covariance form; rows weigh less where
the prediction fails, as in robust regression.
"""

from __future__ import annotations

from mcz.kernels.types import Floats

# Room to work in: for the sums while they are solved, for a row of them, for a weighted row.

LIMIT = 1048576.0  # 2^20: estimates beyond it are none, targets are cut
SPIKES, LEAST = 0.3, 1e-9  # how much an error takes from its row's weight; of a variance
EARLY_ROWS, EARLY, LATE = 20, 0.2, 0.05  # how fast the typical error follows
SLACK, FLOOR, AWAY = 1e-10, 1e-6, 1e300  # of pivots


def width_of(n: int) -> int:
    """How many numbers a row of sums has: ``n`` features and the target, in eights."""
    return (n + 8) // 8 * 8


def bounded(value: float) -> float:
    """``value``, or 0 for one that is too large or no number."""
    return value if abs(value) < LIMIT else 0.0


def estimate(weights: Floats, features: Floats, n: int) -> float:
    total = 0.0
    for i in range(n):
        total = total + weights[i] * features[i]
    return bounded(total)


def weight_of(error: float, typical: float) -> float:
    """How much a row counts that was missed by ``error``."""
    return 1.0 / ((typical * typical + SPIKES * (error * error)) + LEAST)


def follow(typical: float, error: float, row: int) -> float:
    """The typical error after one more."""
    return typical + (abs(error) - typical) * (EARLY if row < EARLY_ROWS else LATE)


def take_in(
    sums: Floats,
    features: Floats,
    n: int,
    target: float,
    weight: float,
    keep: float,
    weighted: Floats,
) -> None:
    """Let a row join the sums of products, what they held multiplied by ``keep``."""
    width = width_of(n)
    for i in range(n):
        weighted[i] = weight * features[i]
    weighted[n] = weight * target
    for i in range(n + 1, width):
        weighted[i] = 0.0
    for i in range(n):
        feature = features[i]
        row = sums[i * width : (i + 1) * width]
        for j in range(i, width):
            row[j] = keep * row[j] + feature * weighted[j]


def solve(sums: Floats, weights: Floats, n: int, ridge: float, work: Floats, top: Floats) -> None:
    """The weights that fit the sums, by elimination without exchange; pivots have a floor."""
    width = width_of(n)
    for i in range(n * width):
        work[i] = sums[i]
    for i in range(n):
        at = i * width + i
        work[at] = work[at] + (ridge + SLACK * work[at])
    for k in range(n):
        for j in range(k, width):
            top[j] = work[k * width + j]
        if not top[k] > ridge * FLOOR:
            top[k] = AWAY
            work[k * width + k] = AWAY
        inverse = 1.0 / top[k]
        for i in range(k + 1, n):
            share = top[i] * inverse
            row = work[i * width : (i + 1) * width]
            for j in range(i, width):
                row[j] = row[j] - share * top[j]
    for i in range(n - 1, -1, -1):
        row = work[i * width : (i + 1) * width]
        total = row[n]
        for j in range(i + 1, n):
            total = total - row[j] * weights[j]
        weights[i] = total / row[i]
