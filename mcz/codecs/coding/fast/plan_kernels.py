"""Compiled: how an encoder of ``fast`` chooses the predictor, the scale and the parent of a lane.

Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast.fit_kernels import FIT_ROWS, ROOM_ROWS, fit
from mcz.codecs.coding.fast.head_kernels import FIRST, FITTED, N_TAPS, SCALE, TAPS, scale_of
from mcz.codecs.coding.fast.residual_kernels import MOST_SIZE, PLAIN
from mcz.codecs.coding.fast.survey_kernels import PREDICTOR, CodedLanes
from mcz.kernels import bit_length, kernel, wrapped
from mcz.kernels.types import Ints, Ints2, Words

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
    folded = residual << 1 ^ residual >> 63  # no branch: nobody can guess the sign
    high = folded >> k
    if high <= PLAIN:
        return high + 1 + k
    more = bit_length((high - 6) >> 1)
    return PLAIN + more + 1 + k + more


def grown(scale: int, residual: int) -> int:
    return scale + ((16 * min(abs(residual), MOST_SIZE) - scale) >> 2)


def find_steps(column: Words, steps: Words) -> None:
    """Fill ``steps``, of which the first N_TAPS are none, with the differences of rows."""
    steps[N_TAPS] = 0
    for row in range(1, len(column)):
        steps[row + N_TAPS] = wrapped(int(column[row]) - int(column[row - 1]))


def find_residuals(steps: Words, taps: Ints, start: int, stop: int, out: Words) -> None:
    """Fill rows start <= r < stop of ``out`` with what a predictor leaves."""
    tap0, tap1, tap2, tap3 = taps[0], taps[1], taps[2], taps[3]
    for row in range(start, stop):  # short loops are vectorised
        total = 16 + tap0 * int(steps[row + 3]) + tap1 * int(steps[row + 2])
        total += tap2 * int(steps[row + 1]) + tap3 * int(steps[row])
        out[row] = wrapped(int(steps[row + N_TAPS]) - (wrapped(total) >> 5))


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
        scale = grown(scale, residual)
        row += 1
    return most - left


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


@kernel
def choose_predictors(lanes: CodedLanes, plans: Ints2) -> None:
    """Choose taps and scale of each lane; note its residuals and their cost."""
    n_rows = lanes.leads.shape[1]
    start = first_tried(n_rows)
    stop = min(n_rows, start + TRIED_ROWS)
    steps, residuals = np.zeros(N_TAPS + n_rows, np.int32), np.zeros(n_rows, np.int32)
    room = np.zeros((ROOM_ROWS, FIT_ROWS), np.float64)
    normal = np.zeros((N_TAPS, N_TAPS + 1), np.float64)
    fitted = np.zeros(N_TAPS, np.float64)
    taps = np.zeros((N_TRIED, N_TAPS), np.int64)
    for candidate in range(1, N_TRIED):
        for tap in range(N_TAPS):
            taps[candidate, tap] = KNOWN_TAPS[TRIED[candidate] * N_TAPS + tap]
    for lane in range(len(lanes.numbers)):
        column, plan = lanes.leads[lane], plans[lanes.numbers[lane]]
        plan[FIRST] = int(column[0])
        plan[SCALE] = first_scale(column)
        lanes.scales[lane] = scale_of(plan[SCALE])
        find_steps(column, steps)
        has_fit = fit(column, room, normal, fitted)
        for tap in range(N_TAPS):
            taps[0, tap] = int(fitted[tap])
        least, chosen = MOST_COST, 0
        for candidate in range(0 if has_fit else 1, N_TRIED):
            more = TAPS_COST if TRIED[candidate] >= FITTED else 0
            find_residuals(steps, taps[candidate], start, stop, residuals)
            cost = more + cost_of(residuals, lanes.scales[lane], least - more)
            if cost < least or (cost == least and TRIED[candidate] < TRIED[chosen]):
                least, chosen = cost, candidate
                lanes.costs[lane] = cost - more
        plan[PREDICTOR] = min(TRIED[chosen], FITTED)
        for tap in range(N_TAPS):
            plan[TAPS + tap] = taps[chosen, tap]
        find_residuals(steps, taps[chosen], 1, n_rows, lanes.residuals[lane])
