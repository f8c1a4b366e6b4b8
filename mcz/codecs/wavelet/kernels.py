"""Compiled: wavelet coefficients of one channel and one band, coded as residuals.

SPEC.md, "Codec 16: wavelet", is normative and has the steps below in the same order. One function
serves encoder and decoder. The simulated annealing of ``awt`` binds no decoder. Imported on first
use only.
"""

from __future__ import annotations

import math

import numpy as np

from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_residual, side_of
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, IntColumns, Ints

MAX_INDEX = 1 << 40  # of a coefficient: sums of neighbors then stay far below 2^53
OWN = 0, 0  # a stream has contexts and mixers of its own


def predict(values: Ints, at: int, predictor: int) -> int:
    """An approximation from those before it, by one of the four predictors."""
    step = values[at - 1] - values[at - 2] if at > 1 else 0
    if predictor == 0:
        return int(values[at - 1])
    if predictor == 1:
        return int(values[at - 1] + (step >> 1))
    if predictor == 2:
        return int(values[at - 1] + step)
    before = values[at - 2] - values[at - 3] if at > 2 else 0
    return int(values[at - 1] + ((3 * step - 2 * before) >> 2))  # MRDWT-25


@kernel
def code_approximations(
    state: Ints, data: Bytes, values: Ints, count: int, predictor: int, scale: int
) -> int:
    """Code values[1:count] in place, values[0] being known; return the index of a fault or -1."""
    fast = slow = scale << 4
    near = side_1 = side_2 = 0
    for at in range(1, count):
        predicted = predict(values, at, predictor)
        momentum = side_of(values[at - 1] - values[at - 2]) if at > 1 else 3  # MRDWT-25
        sides = side_1, side_2, momentum
        near_class = clamp(near + 3, 0, 7)
        error = code_residual(
            state, data, values[at] - predicted, (fast, slow), near_class, sides, OWN
        )
        if error == FAULT or abs(predicted + error) > MAX_INDEX:  # MRDWT-26
            return at
        values[at] = predicted + error
        size = abs(error) << 4
        near = (near + bits(size) - bits(slow)) >> 1
        fast += (size - fast) >> 1
        slow += (size - slow) >> 5  # MRDWT-25
        side_2, side_1 = side_1, side_of(error)
    return -1


@kernel
def code_details(
    state: Ints, data: Bytes, values: Ints, count: int, coarser: IntColumns, shift: int, least: int
) -> int:
    """Code values[:count] in place; return the index of a fault or -1.

    ``coarser`` has what the next coarser band says of the activity there, and the side of its
    coefficients, (2, n); coefficient ``at`` lies above its column (at + shift) // 2. No value that
    is not zero is smaller than ``least``.
    """
    n_coarser = coarser.shape[1]
    run = last = before = side_1 = side_2 = 0
    for at in range(count):
        above = (at + shift) >> 1  # MRDWT-28
        activity = beside = 0
        other = 3
        if above < n_coarser:
            activity, other = coarser[0, above], coarser[1, above]
            beside = coarser[0, above - 1] if above > 0 else 0
        if above + 1 < n_coarser:
            beside += coarser[0, above + 1]
        scales = 11 * last + 5 * before, 8 * activity + 4 * beside
        given = values[at]
        size = max(0, abs(given) - least + 1)
        fault = code_residual(
            state,
            data,
            -size if given < 0 else size,
            scales,
            min(bits(run), 7),
            (side_1, side_2, other),
            OWN,
        )
        if fault == FAULT or abs(fault) > MAX_INDEX - least:  # MRDWT-29
            return at
        run = run + 1 if fault == 0 else 0  # MRDWT-28
        before, last = last, abs(fault)
        side_2, side_1 = side_1, side_of(fault)
        values[at] = 0 if fault == 0 else fault + least - 1 if fault > 0 else fault - least + 1
    return -1


MASK = (1 << 31) - 1  # a Lehmer generator: the same numbers on every machine


def following(seed: int) -> int:
    return seed * 48271 % MASK


@kernel
def anneal(
    counts: Ints, most: Ints, starts: Ints, tails: Floats, iterations: int, seed: int
) -> float:
    """Move coefficients between channels, ``counts`` in place, and return the distortion.

    ``tails[starts[c] + k]`` is the distortion of channel c that keeps its k largest coefficients,
    ``k <= most[c]``. A move takes some from one channel and gives them to another; one
    that adds to the distortion is accepted the less often the later it comes. The last tenth of
    the moves accepts only what lowers it. The best allocation that was found is kept.
    """
    n_channels = len(counts)
    total = 0.0
    for c in range(n_channels):
        total += tails[starts[c] + counts[c]]
    if n_channels < 2 or total <= 0:
        return total
    best, best_counts = total, np.empty(n_channels, np.int64)
    best_counts[:] = counts
    hot, cold = total / n_channels / 8, total / n_channels * 1e-7
    cooling = math.exp(math.log(cold / hot) / max(1, iterations))
    heat = hot
    state = 1 + seed % (MASK - 1)
    for _ in range(16):  # small seeds differ from the first move on
        state = following(state)
    greatest = 1
    for c in range(n_channels):
        greatest = max(greatest, counts[c])
    for step in range(iterations):
        state = following(state)
        giver = state % n_channels
        state = following(state)
        taker = state % n_channels
        state = following(state)
        left = iterations - step
        widest = 1 + greatest * left // (4 * iterations)
        moved = min(1 + state % widest, counts[giver], most[taker] - counts[taker])
        state = following(state)
        heat *= cooling
        if giver == taker or moved <= 0:
            continue
        g, t = starts[giver] + counts[giver], starts[taker] + counts[taker]
        change = (tails[g - moved] - tails[g]) + (tails[t + moved] - tails[t])
        if change > 0 and (10 * left <= iterations or state >= MASK * math.exp(-change / heat)):
            continue
        counts[giver] -= moved
        counts[taker] += moved
        total += change
        if total < best:
            best = total
            best_counts[:] = counts
    counts[:] = best_counts
    return best
