"""Compiled: how an encoder of ``fast``, chooses lattice and predictor of a channel.

Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np

from mcz.coding.quick.kernels import (
    BASE,
    BINARY_WIDTH,
    DEPTH,
    DIGITS,
    DROP,
    FROM_LAST,
    MAX_DIFFERENCE,
    MAX_TAPS,
    PER_CLASS,
    SCALE,
    TAPS,
    TOP,
    clamp,
    settle,
)
from mcz.coding.quick.record_kernels import record_column, spread_column
from mcz.kernels import bit_length, kernel
from mcz.kernels.types import Floats, Floats2, Ints, Ints2

FIXED = 4  # predictors of no fitted tap
FIRST_ROWS = 12  # that the first scale is a mean of
TAP_UNIT, MAX_TAP, TAP_COST = 32, 511, 36  # in quarters of a bit
MAX_SCALE_BITS = 43
MAX_RANK_BITS = 60
ROUNDS = 3  # of least squares, reweighted so that outliers count less
RIDGE = 1e-9
MOST = 0x7FFFFFFFFFFFFFFF


def survey(ordinals: Ints, plan: Ints, max_top: int, powers: Ints2) -> None:
    """Note drop, top and depth; numbers that classes cannot hold become plain ones."""
    greatest = used = 0
    least = MOST
    for t in range(len(ordinals)):
        magnitude = ordinals[t] ^ (ordinals[t] >> 63)
        greatest = max(greatest, magnitude)
        used |= magnitude
        if magnitude:
            least = min(least, magnitude)
    plan[DROP] = plan[TOP] = plan[DEPTH] = 0
    if plan[BASE] == 2 and used:
        while used >> plan[DROP] & 1 == 0 and plan[DROP] < plan[DIGITS] - 2:
            plan[DROP] += 1
        plan[DIGITS] -= plan[DROP]
    if plan[BASE]:
        settle(plan, powers)
        first = 1 if plan[BASE] == 10 else 0
        plan[TOP] = ((greatest >> plan[DROP]) - first) // plan[PER_CLASS] if greatest else 0
        if greatest:
            plan[DEPTH] = plan[TOP] - ((least >> plan[DROP]) - first) // plan[PER_CLASS]
        wide = bit_length(plan[PER_CLASS]) + bit_length(plan[DEPTH] + 1) > MAX_RANK_BITS
        if plan[TOP] > max_top or wide:
            plan[BASE] = plan[DIGITS] = plan[TOP] = plan[DEPTH] = 0
    if plan[BASE] == 0:
        plan[DROP] = max(0, bit_length(greatest) - BINARY_WIDTH)


def set_fixed(plan: Ints, order: int) -> None:
    """Polynomials of order 0 to 2 through the last values; 3: nothing is expected."""
    plan[FROM_LAST] = 0 if order == 3 else 1
    for tap in range(MAX_TAPS):
        plan[TAPS + tap] = 0
    if order == 1:
        plan[TAPS] = TAP_UNIT
    elif order == 2:
        plan[TAPS], plan[TAPS + 1] = 2 * TAP_UNIT, -TAP_UNIT


def quarters(value: int) -> int:
    """About 4 log2 of a positive number: four times the bits of an error that is so large."""
    length = bit_length(value) - 1
    return 4 * length + (4 * value >> length & 3)


def choose(values: Ints, steps: Ints, plan: Ints, normal: Floats2, taps: Floats) -> None:
    """Note the predictor of ``values`` whose errors, in ``steps``, take the fewest bits."""
    fitted = fit(values, plan, normal, taps)
    tap0, tap1, tap2, tap3 = plan[TAPS], plan[TAPS + 1], plan[TAPS + 2], plan[TAPS + 3]
    last = values[0]
    d0 = d1 = d2 = d3 = 0
    near0 = near1 = near2 = near3 = near4 = 0  # errors, of late
    cost0 = cost1 = cost2 = cost3 = cost4 = 0
    for t in range(1, len(values)):
        d, step = values[t] - last, steps[t]
        e0, e1, e2, e3 = abs(d), abs(d - d0), abs(d - 2 * d0 + d1), abs(values[t])
        cost0 += quarters(near0 + step + e0)
        cost1 += quarters(near1 + step + e1)
        cost2 += quarters(near2 + step + e2)
        cost3 += quarters(near3 + step + e3)
        near0 += (e0 - near0) >> 2
        near1 += (e1 - near1) >> 2
        near2 += (e2 - near2) >> 2
        near3 += (e3 - near3) >> 2
        if fitted:
            e4 = abs(d - ((tap0 * d0 + tap1 * d1 + tap2 * d2 + tap3 * d3 + 16) >> 5))
            cost4 += quarters(near4 + step + e4)
            near4 += (e4 - near4) >> 2
        d3, d2, d1, d0 = d2, d1, d0, clamp(d, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last = values[t]
    best, order = cost0, 0
    if cost1 + TAP_COST < best:
        best, order = cost1 + TAP_COST, 1
    if cost2 + 2 * TAP_COST < best:
        best, order = cost2 + 2 * TAP_COST, 2
    if cost3 < best and plan[BASE] == 0:  # from 0 on, ranks of classes are far apart
        best, order = cost3, 3
    if not fitted or best <= cost4 + MAX_TAPS * TAP_COST:
        set_fixed(plan, order)


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
    scale = 0
    while scale < 4 * MAX_SCALE_BITS and (4 + (scale & 3) << (scale >> 2)) >> 2 < mean:
        scale += 1
    return scale


def solve(normal: Floats2) -> bool:
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


def fit(values: Ints, plan: Ints, normal: Floats2, taps: Floats) -> bool:
    """Note the taps of nearly the least absolute error; False where there are none."""
    n = len(values)
    if n < 8 * MAX_TAPS:
        return False
    total = 0.0
    for t in range(1, n):
        total += abs(float(values[t] - values[t - 1]))
    if total == 0.0:
        return False
    scale = (n - 1) / total
    spread = 1.0
    for tap in range(MAX_TAPS):
        taps[tap] = 0.0
    for attempt in range(ROUNDS):
        weigh(values, scale, spread if attempt else 0.0, normal, taps)
        spread = normal[MAX_TAPS, 0]
        if not solve(normal):
            return False
        for tap in range(MAX_TAPS):
            taps[tap] = normal[tap, MAX_TAPS]
    plan[FROM_LAST] = 1
    for tap in range(MAX_TAPS):
        found = min(max(taps[tap] * TAP_UNIT, -float(MAX_TAP)), float(MAX_TAP))
        plan[TAPS + tap] = int(found + 512.5) - 512
    return True


def weigh(values: Ints, scale: float, spread: float, normal: Floats2, taps: Floats) -> None:
    """Fill ``normal`` with the equations, rows weighted by how far ``taps`` are off there.

    ``spread`` is about what they are off, 0 for rows that all weigh 1; that of this round is left
    in ``normal[MAX_TAPS, 0]``.
    """
    a00 = a11 = a22 = a33 = RIDGE
    a01 = a02 = a03 = a04 = a12 = a13 = a14 = a23 = a24 = a34 = missed = 0.0
    d1 = float(values[4] - values[3]) * scale
    d2 = float(values[3] - values[2]) * scale
    d3 = float(values[2] - values[1]) * scale
    d4 = float(values[1] - values[0]) * scale
    most = 8 * spread if spread else 8.0
    for t in range(5, len(values)):
        d0 = float(values[t] - values[t - 1]) * scale
        error = abs(d0 - taps[0] * d1 - taps[1] * d2 - taps[2] * d3 - taps[3] * d4)
        missed += min(error, most)
        w = 1.0 / (error + 0.4 * spread + 1e-6) if spread else 1.0
        w1, w2, w3 = w * d1, w * d2, w * d3
        a00 += w1 * d1
        a01 += w1 * d2
        a02 += w1 * d3
        a03 += w1 * d4
        a04 += w1 * d0
        a11 += w2 * d2
        a12 += w2 * d3
        a13 += w2 * d4
        a14 += w2 * d0
        a22 += w3 * d3
        a23 += w3 * d4
        a24 += w3 * d0
        a33 += w * d4 * d4
        a34 += w * d4 * d0
        d4, d3, d2, d1 = d3, d2, d1, d0
    normal[0, 0], normal[0, 1], normal[0, 2], normal[0, 3] = a00, a01, a02, a03
    normal[1, 0], normal[1, 1], normal[1, 2], normal[1, 3] = a01, a11, a12, a13
    normal[2, 0], normal[2, 1], normal[2, 2], normal[2, 3] = a02, a12, a22, a23
    normal[3, 0], normal[3, 1], normal[3, 2], normal[3, 3] = a03, a13, a23, a33
    normal[0, 4], normal[1, 4], normal[2, 4], normal[3, 4] = a04, a14, a24, a34
    normal[MAX_TAPS, 0] = missed / (len(values) - 5)


@kernel
def plan_columns(
    columns: Ints2, max_tops: Ints, plans: Ints2, powers: Ints2, scales: Ints, records: Ints2
) -> None:
    """Choose how each of ``columns`` (channels, rows) is coded, and note what is coded.

    ``plans`` have base and digits of the channels, of which ``max_tops`` are the greatest classes;
    ``scales`` get the bytes of their first scales, ``records`` (channels * rows, RECORD_SIZE) what
    is coded.
    """
    n_rows = columns.shape[1]
    spread = np.zeros((3, n_rows), np.int64)
    normal = np.zeros((MAX_TAPS + 2, MAX_TAPS + 1), np.float64)
    for n in range(len(columns)):
        column, plan = columns[n], plans[n]
        survey(column, plan, max_tops[n], powers)
        settle(plan, powers)
        spread_column(column, plan, powers, spread)
        choose(spread[1], spread[2], plan, normal, normal[MAX_TAPS + 1])
        scale = scales[n] = first_scale(spread[1], plan)
        plan[SCALE] = (4 + (scale & 3) << (scale >> 2)) >> 2
        record_column(column, spread, plan, powers, records[n * n_rows : (n + 1) * n_rows])


@kernel
def record_columns(columns: Ints2, plans: Ints2, powers: Ints2, records: Ints2) -> None:
    """Note what is coded of ``columns`` by ``plans`` as they are."""
    n_rows = columns.shape[1]
    spread = np.zeros((3, n_rows), np.int64)
    for n in range(len(columns)):
        settle(plans[n], powers)
        spread_column(columns[n], plans[n], powers, spread)
        record_column(columns[n], spread, plans[n], powers, records[n * n_rows : (n + 1) * n_rows])
