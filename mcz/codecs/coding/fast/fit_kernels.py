"""Compiled: taps of nearly the least absolute error, by least squares that are weighted anew.

Nothing here is normative: any taps decode.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast.head_kernels import LEAST_TAP, MOST_TAP, N_TAPS, TAP_UNIT
from mcz.kernels.types import Floats, Floats2, Words

FIT_ROWS = 384
ROUNDS = 3
FEWEST_STEPS = 8 * N_TAPS
STEPS, WEIGHTS, PRODUCTS = 0, 1, 2  # rows of the room: from PRODUCTS on one each lag, 0 to N_TAPS
ROOM_ROWS = PRODUCTS + N_TAPS + 1


def solve(normal: Floats2) -> bool:
    """Solve the equations ``normal`` (N_TAPS, N_TAPS + 1) in place; the last column is it.

    What is below the diagonal is that above it; a ridge lets there be an answer nearly always.
    """
    trace = 0.0
    for i in range(N_TAPS):
        trace += normal[i, i]
        for j in range(i + 1, N_TAPS):
            normal[j, i] = normal[i, j]
    for i in range(N_TAPS):
        normal[i, i] += 1e-14 * trace + 1e-30
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


def multiply(steps: Floats, room: Floats2) -> None:
    """Note the products of steps with those of up to N_TAPS rows before."""
    for lag in range(N_TAPS + 1):
        products = room[PRODUCTS + lag]
        for row in range(lag, len(steps)):
            products[row] = steps[row] * steps[row - lag]


def weigh(steps: Floats, taps: Floats, spread: float, weights: Floats) -> float:
    """Weigh rows by how far ``taps`` are off, about ``spread``; returns the mean they are off."""
    tap0, tap1, tap2, tap3 = taps[0], taps[1], taps[2], taps[3]
    for row in range(N_TAPS, len(steps)):  # short loops are vectorised
        error = steps[row] - tap0 * steps[row - 1] - tap1 * steps[row - 2]
        weights[row] = abs(error - tap2 * steps[row - 3] - tap3 * steps[row - 4])
    off = 0.0
    for row in range(N_TAPS, len(steps)):
        off += weights[row]
        weights[row] = 1.0 / (weights[row] + spread)
    return off / (len(steps) - N_TAPS)


def fill_equal(n_steps: int, room: Floats2, normal: Floats2) -> None:
    """Fill in the equations of rows that all weigh 1: sums of products, from rows that move."""
    lag0, lag1, lag2 = room[PRODUCTS], room[PRODUCTS + 1], room[PRODUCTS + 2]
    lag3, lag4 = room[PRODUCTS + 3], room[PRODUCTS + 4]
    total0 = total1 = total2 = total3 = total4 = 0.0
    for row in range(N_TAPS, n_steps):
        total0 += lag0[row]
        total1 += lag1[row]
        total2 += lag2[row]
        total3 += lag3[row]
        total4 += lag4[row]
    normal[0, 0], normal[0, N_TAPS], normal[1, N_TAPS] = total0, total1, total2
    normal[2, N_TAPS], normal[3, N_TAPS] = total3, total4
    for lag in range(N_TAPS):
        total = normal[lag - 1, N_TAPS] if lag else total0
        for tap in range(N_TAPS - lag):
            first, last = N_TAPS - 1 - tap, n_steps - 1 - tap
            total += room[PRODUCTS + lag, first] - room[PRODUCTS + lag, last]
            normal[tap, tap + lag] = total


def fill_weighted(n_steps: int, room: Floats2, normal: Floats2) -> None:
    """Fill in the equations of rows with their weights."""
    weights, lag0, lag1 = room[WEIGHTS], room[PRODUCTS], room[PRODUCTS + 1]
    lag2, lag3, lag4 = room[PRODUCTS + 2], room[PRODUCTS + 3], room[PRODUCTS + 4]
    n00 = n01 = n02 = n03 = n04 = n11 = n12 = n13 = n14 = 0.0
    n22 = n23 = n24 = n33 = n34 = 0.0
    for row in range(N_TAPS, n_steps):
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
    """Find the taps for rows from the middle; False where there are none."""
    n = min(len(column) - 1, FIT_ROWS)
    if n < FEWEST_STEPS:
        return False
    start = 1 + (len(column) - 1 - n) // 2
    steps, weights = room[STEPS, :n], room[WEIGHTS, :n]
    off = 0.0
    for row in range(n):
        steps[row] = float(int(column[start + row]) - int(column[start + row - 1]))
        off += abs(steps[row]) if row >= N_TAPS else 0.0
    off /= n - N_TAPS
    multiply(steps, room)
    for round_ in range(ROUNDS):
        if round_ == 0:
            fill_equal(n, room, normal)
        else:
            off = weigh(steps, taps, 0.25 * off + 1e-6, weights)
            fill_weighted(n, room, normal)
        if not solve(normal):
            return False
        for tap in range(N_TAPS):
            taps[tap] = normal[tap, N_TAPS]
    for tap in range(N_TAPS):
        taps[tap] = min(max(np.rint(TAP_UNIT * taps[tap]), float(LEAST_TAP)), float(MOST_TAP))
    return True
