"""Compiled: how an encoder of codec 14, ``fast``, chooses the predictor of a channel.

Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.coding.quick.kernels import (
    FROM_LAST,
    MAX_DIFFERENCE,
    MAX_TAPS,
    SCALE,
    TAPS,
    Ints,
    clamp,
)
from mcz.coding.quick.record_kernels import record_column, spread_column
from mcz.jit import inner, kernel

Floats = NDArray[np.float64]

FIXED = 4  # predictors of no fitted tap
FIRST_ROWS = 12  # that the first scale is a mean of
TAP_UNIT, MAX_TAP, TAP_COST = 32, 511, 9 << 8
MAX_SCALE_BITS = 43
ROUNDS = 3  # of least squares, reweighted so that outliers count less
RIDGE = 1e-9


@inner
def set_fixed(plan: Ints, order: int) -> None:
    """Polynomials of order 0 to 2 through the last values; 3: nothing is expected."""
    plan[FROM_LAST] = 0 if order == 3 else 1
    for tap in range(MAX_TAPS):
        plan[TAPS + tap] = 0
    if order == 1:
        plan[TAPS] = TAP_UNIT
    elif order == 2:
        plan[TAPS], plan[TAPS + 1] = 2 * TAP_UNIT, -TAP_UNIT


@inner
def first_scale(values: Ints, plan: Ints) -> int:
    """About the mean error in the first rows but one, as a byte of quarters of an octave."""
    last = d0 = d1 = d2 = d3 = total = 0
    n = min(len(values), FIRST_ROWS)
    for t in range(n):
        p = plan[TAPS] * d0 + plan[TAPS + 1] * d1 + plan[TAPS + 2] * d2 + plan[TAPS + 3] * d3
        p = (p + 16) >> 5
        if plan[FROM_LAST]:
            p += last
        if t:
            total += min(abs(values[t] - p), 1 << MAX_SCALE_BITS)
            d3, d2, d1 = d2, d1, d0
            d0 = clamp(values[t] - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last = values[t]
    mean = total // max(n - 1, 1)
    quarters = 0
    while quarters < 4 * MAX_SCALE_BITS and (4 + (quarters & 3) << (quarters >> 2)) >> 2 < mean:
        quarters += 1
    return quarters


@inner
def solve(normal: Floats) -> bool:
    """Solve the equations ``normal`` (MAX_TAPS, MAX_TAPS + 1) in place; the last column is it."""
    for i in range(MAX_TAPS):
        if not normal[i, i] > 0:
            return False
        for j in range(i + 1, MAX_TAPS):
            share = normal[j, i] / normal[i, i]
            for k in range(i, MAX_TAPS + 1):
                normal[j, k] -= share * normal[i, k]
    for i in range(MAX_TAPS - 1, -1, -1):
        for k in range(i + 1, MAX_TAPS):
            normal[i, MAX_TAPS] -= normal[i, k] * normal[k, MAX_TAPS]
        normal[i, MAX_TAPS] /= normal[i, i]
    return True


@inner
def fit(values: Ints, plan: Ints, normal: Floats, taps: Floats) -> bool:
    """Note the taps of nearly the least absolute error; False where there are none."""
    n = len(values)
    if n < 8 * MAX_TAPS:
        return False
    total = 0.0
    for t in range(1, n):
        total += abs(float(values[t] - values[t - 1]))
    if total == 0.0:
        return False
    unit = total / (n - 1)
    spread = 1.0
    for tap in range(MAX_TAPS):
        taps[tap] = 0.0
    for attempt in range(ROUNDS):
        for i in range(MAX_TAPS):
            for k in range(MAX_TAPS + 1):
                normal[i, k] = 0.0
            normal[i, i] = RIDGE
        missed = 0.0
        d1 = float(values[4] - values[3]) / unit
        d2 = float(values[3] - values[2]) / unit
        d3 = float(values[2] - values[1]) / unit
        d4 = float(values[1] - values[0]) / unit
        for t in range(5, n):
            d0 = float(values[t] - values[t - 1]) / unit
            error = abs(d0 - taps[0] * d1 - taps[1] * d2 - taps[2] * d3 - taps[3] * d4)
            missed += min(error, 8 * spread)
            w = 1.0 if attempt == 0 else 1.0 / (error + 0.4 * spread + 1e-6)
            normal[0, 0] += w * d1 * d1
            normal[0, 1] += w * d1 * d2
            normal[0, 2] += w * d1 * d3
            normal[0, 3] += w * d1 * d4
            normal[0, 4] += w * d1 * d0
            normal[1, 1] += w * d2 * d2
            normal[1, 2] += w * d2 * d3
            normal[1, 3] += w * d2 * d4
            normal[1, 4] += w * d2 * d0
            normal[2, 2] += w * d3 * d3
            normal[2, 3] += w * d3 * d4
            normal[2, 4] += w * d3 * d0
            normal[3, 3] += w * d4 * d4
            normal[3, 4] += w * d4 * d0
            d4, d3, d2, d1 = d3, d2, d1, d0
        spread = missed / (n - 5)
        for i in range(1, MAX_TAPS):
            for k in range(i):
                normal[i, k] = normal[k, i]
        if not solve(normal):
            return False
        for tap in range(MAX_TAPS):
            taps[tap] = normal[tap, MAX_TAPS]
    plan[FROM_LAST] = 1
    for tap in range(MAX_TAPS):
        found = min(max(taps[tap] * TAP_UNIT, -float(MAX_TAP)), float(MAX_TAP))
        plan[TAPS + tap] = int(found + 512.5) - 512
    return True


@kernel
def record_best(
    ordinals: Ints,
    plan: Ints,
    powers: Ints,
    costs: Ints,
    spread: Ints,
    records: Ints,
    work: Floats,
) -> int:
    """Choose the predictor of a channel, note it in ``plan`` and what is coded in ``records``.

    ``plan`` has the lattice; ``spread`` is (2, n_rows), ``work`` (MAX_TAPS + 1, MAX_TAPS + 1).
    Returns the byte of its first scale.
    """
    spread_column(ordinals, plan, powers, spread)
    values = spread[1]
    best = best_cost = -1
    for order in range(FIXED + 1):
        if order == FIXED:
            if not fit(values, plan, work, work[MAX_TAPS]):
                break
        else:
            set_fixed(plan, order)
        quarters = first_scale(values, plan)
        plan[SCALE] = (4 + (quarters & 3) << (quarters >> 2)) >> 2
        cost = record_column(ordinals, spread, plan, powers, costs, records)
        for tap in range(MAX_TAPS):
            cost += TAP_COST if plan[TAPS + tap] else 0
        if best < 0 or cost < best_cost:
            best, best_cost, chosen = order, cost, quarters
    if best == FIXED:
        return quarters
    set_fixed(plan, best)
    plan[SCALE] = (4 + (chosen & 3) << (chosen >> 2)) >> 2
    record_column(ordinals, spread, plan, powers, costs, records)
    return chosen
