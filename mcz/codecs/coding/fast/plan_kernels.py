"""Compiled: encoder choice of predictor, scale and parent for each lane of ``fast``.

Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast import decode_kernels as head
from mcz.codecs.coding.fast.residual_kernels import MOST_SIZE, PLAIN
from mcz.codecs.coding.fast.survey_kernels import PREDICTOR, CodedLanes
from mcz.kernels import bit_length, kernel, wrapped
from mcz.kernels.types import Floats, Floats2, Ints, Ints2, Words

# Taps of the differences of order 0 to 3; the last, and what is fitted, stand in the head.
KNOWN_TAPS = (0, 0, 0, 0, 32, 0, 0, 0, 64, -32, 0, 0, 96, -96, 32, 0)
TRIED = (4, 2, 3, 1, 0)  # 4: taps that are fitted; the likely ones first, to compare others with
N_TRIED = len(TRIED)
TAPS_COST = 32  # bits
MOST_COST = 1 << 62
TRIED_ROWS = 256  # that predictors are compared on
FIRST_ROWS = 17  # that the first scale is a mean of
MOST_QUARTERS = 120


def code_bits(residual: int, k: int) -> int:
    """Bits of a code."""
    folded = residual << 1 ^ residual >> 63  # no branch: the sign is unpredictable
    high = folded >> k
    if high <= PLAIN:
        return high + 1 + k
    more = bit_length((high - 6) >> 1)
    return PLAIN + more + 1 + k + more


def update_scale(scale: int, residual: int) -> int:
    return scale + ((16 * min(abs(residual), MOST_SIZE) - scale) >> 2)


def find_steps(column: Words, steps: Words) -> None:
    """Fill ``steps`` from N_TAPS on with the differences of rows."""
    steps[head.N_TAPS] = 0
    for row in range(1, len(column)):
        steps[row + head.N_TAPS] = wrapped(int(column[row]) - int(column[row - 1]))


def find_residuals(steps: Words, taps: Ints, start: int, stop: int, out: Words) -> None:
    """Fill rows start <= r < stop of ``out`` with what a predictor leaves."""
    tap0, tap1, tap2, tap3 = taps[0], taps[1], taps[2], taps[3]
    for row in range(start, stop):  # short loops are vectorised
        total = 16 + tap0 * int(steps[row + 3]) + tap1 * int(steps[row + 2])
        total += tap2 * int(steps[row + 1]) + tap3 * int(steps[row])
        out[row] = wrapped(int(steps[row + head.N_TAPS]) - (wrapped(total) >> 5))


def first_tried(n_rows: int) -> int:
    """The first of the rows that costs are counted of."""
    return 1 + max(0, n_rows - 1 - TRIED_ROWS) // 2


def cost_of(residuals: Words, scale: int, most: int) -> int:
    """Estimate the bits of a lane from its middle rows; more than ``most`` is any larger number."""
    row = first_tried(len(residuals))
    stop = min(len(residuals), row + TRIED_ROWS)
    left = most - (stop - row)  # each row has a bit at least
    while row < stop and left >= 0:
        residual = int(residuals[row])
        left += 1 - code_bits(residual, bit_length(scale >> 4))
        scale = update_scale(scale, residual)
        row += 1
    return most - left


def byte_of(scale: float) -> int:
    """The byte of the greatest scale, in sixteenths, that is not above ``scale``."""
    quarters = 0
    while quarters < MOST_QUARTERS and head.scale_of(quarters + 1) <= scale:
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


@kernel
def choose_predictors(lanes: CodedLanes, plans: Ints2) -> None:
    """Choose taps and scale of each lane; note its residuals and their cost."""
    n_rows = lanes.leads.shape[1]
    start = first_tried(n_rows)
    stop = min(n_rows, start + TRIED_ROWS)
    steps, residuals = np.zeros(head.N_TAPS + n_rows, np.int32), np.zeros(n_rows, np.int32)
    room = np.zeros((ROOM_ROWS, FIT_ROWS), np.float64)
    normal = np.zeros((head.N_TAPS, head.N_TAPS + 1), np.float64)
    fitted = np.zeros(head.N_TAPS, np.float64)
    taps = np.zeros((N_TRIED, head.N_TAPS), np.int64)
    for candidate in range(1, N_TRIED):
        for tap in range(head.N_TAPS):
            taps[candidate, tap] = KNOWN_TAPS[TRIED[candidate] * head.N_TAPS + tap]
    for lane in range(len(lanes.numbers)):
        column, plan = lanes.leads[lane], plans[lanes.numbers[lane]]
        plan[head.FIRST] = int(column[0])
        plan[head.SCALE] = first_scale(column)
        lanes.scales[lane] = head.scale_of(plan[head.SCALE])
        find_steps(column, steps)
        has_fit = fit(column, room, normal, fitted)
        for tap in range(head.N_TAPS):
            taps[0, tap] = int(fitted[tap])
        least, chosen = MOST_COST, 0
        for candidate in range(0 if has_fit else 1, N_TRIED):
            more = TAPS_COST if TRIED[candidate] >= head.FITTED else 0
            find_residuals(steps, taps[candidate], start, stop, residuals)
            cost = more + cost_of(residuals, lanes.scales[lane], least - more)
            if cost < least or (cost == least and TRIED[candidate] < TRIED[chosen]):
                least, chosen = cost, candidate
                lanes.costs[lane] = cost - more
        plan[PREDICTOR] = min(TRIED[chosen], head.FITTED)
        for tap in range(head.N_TAPS):
            plan[head.TAPS + tap] = taps[chosen, tap]
        find_residuals(steps, taps[chosen], 1, n_rows, lanes.residuals[lane])


FIT_ROWS = 384
ROUNDS = 3
FEWEST_STEPS = 8 * head.N_TAPS
STEPS, WEIGHTS, PRODUCTS = 0, 1, 2  # rows of the room: from PRODUCTS on one each lag, 0 to N_TAPS
ROOM_ROWS = PRODUCTS + head.N_TAPS + 1


def solve(normal: Floats2) -> bool:
    """Solve the equations ``normal`` (N_TAPS, N_TAPS + 1) in place; the last column is it.

    What is below the diagonal is that above it; a ridge lets there be an answer nearly always.
    """
    trace = 0.0
    for i in range(head.N_TAPS):
        trace += normal[i, i]
        for j in range(i + 1, head.N_TAPS):
            normal[j, i] = normal[i, j]
    for i in range(head.N_TAPS):
        normal[i, i] += 1e-14 * trace + 1e-30
    for i in range(head.N_TAPS):
        if not normal[i, i] > 0:
            return False
        for j in range(i + 1, head.N_TAPS):
            share = normal[j, i] / normal[i, i]
            for k in range(i, head.N_TAPS + 1):
                normal[j, k] -= share * normal[i, k]
    for i in range(head.N_TAPS - 1, -1, -1):
        for k in range(i + 1, head.N_TAPS):
            normal[i, head.N_TAPS] -= normal[i, k] * normal[k, head.N_TAPS]
        normal[i, head.N_TAPS] /= normal[i, i]
    return True


def multiply(steps: Floats, room: Floats2) -> None:
    """Compute the products of steps with those of up to N_TAPS earlier rows."""
    for lag in range(head.N_TAPS + 1):
        products = room[PRODUCTS + lag]
        for row in range(lag, len(steps)):
            products[row] = steps[row] * steps[row - lag]


def weigh(steps: Floats, taps: Floats, spread: float, weights: Floats) -> float:
    """Weigh rows by how far ``taps`` are off, about ``spread``; returns the mean they are off."""
    tap0, tap1, tap2, tap3 = taps[0], taps[1], taps[2], taps[3]
    for row in range(head.N_TAPS, len(steps)):  # short loops are vectorised
        error = steps[row] - tap0 * steps[row - 1] - tap1 * steps[row - 2]
        weights[row] = abs(error - tap2 * steps[row - 3] - tap3 * steps[row - 4])
    off = 0.0
    for row in range(head.N_TAPS, len(steps)):
        off += weights[row]
        weights[row] = 1.0 / (weights[row] + spread)
    return off / (len(steps) - head.N_TAPS)


def fill_equal(n_steps: int, room: Floats2, normal: Floats2) -> None:
    """Fill in the equations of rows that all weigh 1: sums of products, from rows that move."""
    lag0, lag1, lag2 = room[PRODUCTS], room[PRODUCTS + 1], room[PRODUCTS + 2]
    lag3, lag4 = room[PRODUCTS + 3], room[PRODUCTS + 4]
    total0 = total1 = total2 = total3 = total4 = 0.0
    for row in range(head.N_TAPS, n_steps):
        total0 += lag0[row]
        total1 += lag1[row]
        total2 += lag2[row]
        total3 += lag3[row]
        total4 += lag4[row]
    normal[0, 0], normal[0, head.N_TAPS], normal[1, head.N_TAPS] = total0, total1, total2
    normal[2, head.N_TAPS], normal[3, head.N_TAPS] = total3, total4
    for lag in range(head.N_TAPS):
        total = normal[lag - 1, head.N_TAPS] if lag else total0
        for tap in range(head.N_TAPS - lag):
            first, last = head.N_TAPS - 1 - tap, n_steps - 1 - tap
            total += room[PRODUCTS + lag, first] - room[PRODUCTS + lag, last]
            normal[tap, tap + lag] = total


def fill_weighted(n_steps: int, room: Floats2, normal: Floats2) -> None:
    """Fill in the equations of rows with their weights."""
    weights, lag0, lag1 = room[WEIGHTS], room[PRODUCTS], room[PRODUCTS + 1]
    lag2, lag3, lag4 = room[PRODUCTS + 2], room[PRODUCTS + 3], room[PRODUCTS + 4]
    n00 = n01 = n02 = n03 = n04 = n11 = n12 = n13 = n14 = 0.0
    n22 = n23 = n24 = n33 = n34 = 0.0
    for row in range(head.N_TAPS, n_steps):
        w = weights[row]
        n00 += w * lag0[row - 1]
        n01 += w * lag1[row - 1]
        n02 += w * lag2[row - 1]
        n03 += w * lag3[row - 1]
        n04 += w * lag1[row]
        n11 += w * lag0[row - 2]
        n12 += w * lag1[row - 2]
        n13 += w * lag2[row - 2]
        n14 += w * lag2[row]
        n22 += w * lag0[row - 3]
        n23 += w * lag1[row - 3]
        n24 += w * lag3[row]
        n33 += w * lag0[row - 4]
        n34 += w * lag4[row]
    normal[0, 0], normal[0, 1], normal[0, 2], normal[0, 3] = n00, n01, n02, n03
    normal[1, 1], normal[1, 2], normal[1, 3], normal[2, 2] = n11, n12, n13, n22
    normal[2, 3], normal[3, 3], normal[0, 4], normal[1, 4] = n23, n33, n04, n14
    normal[2, 4], normal[3, 4] = n24, n34


def fit(column: Words, room: Floats2, normal: Floats2, taps: Floats) -> bool:
    """Find the taps for rows from the middle; False if there are none."""
    n = min(len(column) - 1, FIT_ROWS)
    if n < FEWEST_STEPS:
        return False
    start = 1 + (len(column) - 1 - n) // 2
    steps, weights = room[STEPS, :n], room[WEIGHTS, :n]
    off = 0.0
    for row in range(n):
        steps[row] = float(int(column[start + row]) - int(column[start + row - 1]))
        off += abs(steps[row]) if row >= head.N_TAPS else 0.0
    off /= n - head.N_TAPS
    multiply(steps, room)
    for round_ in range(ROUNDS):
        if round_ == 0:
            fill_equal(n, room, normal)
        else:
            off = weigh(steps, taps, 0.25 * off + 1e-6, weights)
            fill_weighted(n, room, normal)
        if not solve(normal):
            return False
        for tap in range(head.N_TAPS):
            taps[tap] = normal[tap, head.N_TAPS]
    for tap in range(head.N_TAPS):
        taps[tap] = min(
            max(np.rint(head.TAP_UNIT * taps[tap]), float(head.LEAST_TAP)), float(head.MOST_TAP)
        )
    return True
