"""Compiled: how an encoder of ``fast`` chooses the predictor, the scale and the parent of a lane.

Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np

from mcz.coding.fast.residual_kernels import MOST_SIZE, PLAIN
from mcz.kernels import bit_length, kernel, wrapped
from mcz.kernels.types import Floats, Floats2, Ints, Ints2, Words, Words2

N_TAPS, TAP_UNIT, LEAST_TAP, MOST_TAP = 4, 32, -128, 127
FITTED = 3  # the predictor whose taps stand in the head
# That of the differences of order 0 to 3; the last, and what is fitted, stand in the head.
KNOWN_TAPS = (0, 0, 0, 0, 32, 0, 0, 0, 64, -32, 0, 0, 96, -96, 32, 0, 0, 0, 0, 0)
N_KNOWN = 4
TAPS_COST = 32  # bits
TRIED_ROWS = 256  # that predictors are compared on
FIT_ROWS = 384
ROUNDS = 3  # of least squares, reweighted so that outliers count less
FIRST_ROWS = 17  # that the first scale is a mean of
MOST_QUARTERS = 120


def scale_of(quarters: int) -> int:
    """The scale, in sixteenths, that the byte of a head stands for."""
    return (4 + (quarters & 3) << (quarters >> 2)) >> 2


def code_bits(residual: int, k: int) -> int:
    """Bits of a code."""
    folded = 2 * residual if residual >= 0 else -2 * residual - 1
    high = folded >> k
    if high <= PLAIN:
        return high + 1 + k
    more = bit_length((high - 6) >> 1)
    return PLAIN + more + 1 + k + more


def grown(scale: int, residual: int) -> int:
    return scale + ((16 * min(abs(residual), MOST_SIZE) - scale) >> 2)


def find_residuals(
    column: Words, start: int, stop: int, tap0: int, tap1: int, tap2: int, tap3: int, out: Words
) -> None:
    """Fill rows start <= r < stop of ``out``, start > 0, with what a predictor leaves of leads."""
    one, two = int(column[start - 1]), int(column[max(start - 2, 0)])
    three, four = int(column[max(start - 3, 0)]), int(column[max(start - 4, 0)])
    five = int(column[max(start - 5, 0)])
    for row in range(start, stop):
        total = 16 + tap0 * (one - two) + tap1 * (two - three)
        total += tap2 * (three - four) + tap3 * (four - five)
        lead = int(column[row])
        out[row] = wrapped(lead - one - (wrapped(total) >> 5))
        five, four, three, two, one = four, three, two, one, lead


def first_tried(n_rows: int) -> int:
    """The first of the rows that costs are counted of."""
    return 1 + max(0, n_rows - 1 - TRIED_ROWS) // 2


def cost_of(residuals: Words, scale: int) -> int:
    """About the bits of a lane, of rows from the middle."""
    start = first_tried(len(residuals))
    total = 0
    for row in range(start, min(len(residuals), start + TRIED_ROWS)):
        residual = int(residuals[row])
        total += code_bits(residual, bit_length(scale >> 4))
        scale = grown(scale, residual)
    return total


def byte_of(scale: float) -> int:
    """The byte of the greatest scale, in sixteenths, that is not above ``scale``."""
    quarters = 0
    while quarters < MOST_QUARTERS and scale_of(quarters + 1) <= scale:
        quarters += 1
    return quarters


def first_scale(column: Words) -> int:
    """The byte of the mean second difference of the first rows."""
    n = min(len(column), FIRST_ROWS)
    total = before = 0
    for row in range(1, n):
        step = int(column[row]) - int(column[row - 1])
        total += abs(step - before)
        before = step
    return byte_of(float(16 * total // max(n - 1, 1)))


def solve(normal: Floats2) -> bool:
    """Solve the equations ``normal`` (N_TAPS, N_TAPS + 1) in place; the last column is it."""
    for i in range(N_TAPS):
        if not normal[i, i] > 0:
            return False
        for j in range(i + 1, N_TAPS):
            share = normal[j, i] / normal[i, i]
            for k in range(i, N_TAPS + 1):
                normal[j, k] -= share * normal[i, k]
    for i in range(N_TAPS - 1, -1, -1):
        for k in range(i + 1, N_TAPS):
            normal[i, N_TAPS] -= normal[i, k] * normal[k, N_TAPS]
        normal[i, N_TAPS] /= normal[i, i]
    return True


def weigh(steps: Floats, spread: float, normal: Floats2, taps: Floats) -> float:
    """Fill ``normal``, rows weighted by how far ``taps`` are off; returns the mean they are off.

    ``spread`` is about that of the round before, 0 for rows that all weigh 1.
    """
    for i in range(N_TAPS):
        for k in range(N_TAPS + 1):
            normal[i, k] = 0.0
    off = 0.0
    for row in range(N_TAPS, len(steps)):
        d0, d1, d2 = steps[row], steps[row - 1], steps[row - 2]
        d3, d4 = steps[row - 3], steps[row - 4]
        error = abs(d0 - taps[0] * d1 - taps[1] * d2 - taps[2] * d3 - taps[3] * d4)
        off += error
        w = 1.0 / (error + spread) if spread > 0.0 else 1.0
        w1, w2, w3, w4 = w * d1, w * d2, w * d3, w * d4
        normal[0, 0] += w1 * d1
        normal[0, 1] += w1 * d2
        normal[0, 2] += w1 * d3
        normal[0, 3] += w1 * d4
        normal[0, 4] += w1 * d0
        normal[1, 1] += w2 * d2
        normal[1, 2] += w2 * d3
        normal[1, 3] += w2 * d4
        normal[1, 4] += w2 * d0
        normal[2, 2] += w3 * d3
        normal[2, 3] += w3 * d4
        normal[2, 4] += w3 * d0
        normal[3, 3] += w4 * d4
        normal[3, 4] += w4 * d0
    trace = 0.0
    for i in range(N_TAPS):
        for k in range(i):
            normal[i, k] = normal[k, i]
        trace += normal[i, i]
    for i in range(N_TAPS):
        normal[i, i] += 1e-14 * trace + 1e-30
    return off / (len(steps) - N_TAPS)


def fit(column: Words, steps: Floats, normal: Floats2, taps: Floats) -> bool:
    """Find the taps of nearly the least absolute error; False where there are none."""
    n = min(len(column) - 1, FIT_ROWS)
    if n < 8 * N_TAPS:
        return False
    start = 1 + (len(column) - 1 - n) // 2
    for row in range(n):
        steps[row] = float(int(column[start + row]) - int(column[start + row - 1]))
    for tap in range(N_TAPS):
        taps[tap] = 0.0
    spread = 0.0
    for _ in range(ROUNDS):
        off = weigh(steps[:n], spread, normal, taps)
        spread = 0.25 * off + 1e-6
        if not solve(normal):
            return False
        for tap in range(N_TAPS):
            taps[tap] = normal[tap, N_TAPS]
    for tap in range(N_TAPS):
        taps[tap] = min(max(np.rint(TAP_UNIT * taps[tap]), float(LEAST_TAP)), float(MOST_TAP))
    return True


@kernel
def choose_predictors(
    leads: Words2, predictors: Ints, taps: Ints2, scales: Ints, residuals: Words2
) -> None:
    """Choose predictor, taps and scale of each lane, a row of ``leads``; note its residuals."""
    n_lanes, n_rows = leads.shape
    start = first_tried(n_rows)
    stop = min(n_rows, start + TRIED_ROWS)
    tried = np.zeros(n_rows, np.int32)
    steps = np.zeros(FIT_ROWS, np.float64)
    normal = np.zeros((N_TAPS, N_TAPS + 1), np.float64)
    fitted = np.zeros(N_TAPS, np.float64)
    for lane in range(n_lanes):
        own = leads[lane]
        scales[lane] = first_scale(own)
        scale = scale_of(scales[lane])
        best = 1 << 62
        n_tried = N_KNOWN + (1 if fit(own, steps, normal, fitted) else 0)
        for candidate in range(n_tried):
            predictor, cost = candidate, 0
            if candidate >= FITTED:
                predictor, cost = FITTED, TAPS_COST
            tap0, tap1 = KNOWN_TAPS[candidate * N_TAPS], KNOWN_TAPS[candidate * N_TAPS + 1]
            tap2, tap3 = KNOWN_TAPS[candidate * N_TAPS + 2], 0
            if candidate == N_KNOWN:
                tap0, tap1, tap2, tap3 = (
                    int(fitted[0]),
                    int(fitted[1]),
                    int(fitted[2]),
                    int(fitted[3]),
                )
            find_residuals(own, start, stop, tap0, tap1, tap2, tap3, tried)
            cost += cost_of(tried, scale)
            if cost < best:
                best = cost
                predictors[lane] = predictor
                taps[lane, 0], taps[lane, 1] = tap0, tap1
                taps[lane, 2], taps[lane, 3] = tap2, tap3
        tap0, tap1 = taps[lane, 0], taps[lane, 1]
        tap2, tap3 = taps[lane, 2], taps[lane, 3]
        find_residuals(own, 1, n_rows, tap0, tap1, tap2, tap3, residuals[lane])
