"""Compiled: the expectations of a channel of a row, from the channels before it.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. A *path* is
what a row has taught so far: the first ``BLOCK`` numbers predict the channels of a block from the
channels before them; ``model_state`` lists the others. A decoder has one path, an encoder follows
several (``search_kernels``).
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.decision_kernels import Contexts
from mcz.codecs.posewave.model_state import (
    BEFORE_1,
    BEFORE_2,
    BLOCK,
    C_LEVEL,
    C_MEAN,
    C_ROWS,
    N_OWN,
    N_SCALES,
    N_SETS,
    N_SHARED,
    N_SLOTS,
    PARENT,
    PARENT_NEXT,
    PATH_COST,
    PATH_MEAN,
    PATH_ROW,
    PATH_SCALED,
    PATH_SIDE,
    PATH_SIZE,
    PATH_TOTAL,
    ROW,
    ROW_BEFORE,
    ROW_PARENT,
    SCALED,
    SIDE_1,
    SIDE_2,
    SIDE_3,
    SIDE_4,
    USUAL,
    Model,
)
from mcz.codecs.posewave.prediction_kernels import LEAST_SIZE, MOST_SIZE, ONE, TWO, log_of
from mcz.kernels.types import Floats, Floats2

UNIT = 4096.0  # a mean is a multiple of 1 / UNIT
HALF = 2048
MOST_MEAN = float(1 << 31)
# Eight states, four bits each: the next one after an even and after an odd integer.
AFTER_EVEN, AFTER_ODD = 0x73426150, 0x51604372


def next_state(state: int, integer: int) -> int:
    """The state of dependent quantization after an integer."""
    return ((AFTER_ODD if integer & 1 else AFTER_EVEN) >> (4 * state)) & 15  # ROWS-07


def twice_value(integer: int, between: int) -> int:
    """Twice the value, in steps, of an integer; ``between`` 1: values are 0 and the halves."""
    if between == 0 or integer == 0:
        return 2 * integer
    return 2 * integer - (1 if integer > 0 else -1)  # ROWS-08


def expect(
    model: Model,
    path: Floats,
    c: int,
    at_block: int,
    level: int,
    gain: float,
    total_usual: float,
    between: int,
) -> Contexts:
    """Complete ``path`` for channel ``c``; return the contexts of its integer.

    The channel is ``at_block`` in its block; ``total_usual`` sums the usual magnitudes of those
    before. ``between`` 1: values are 0 and the halves.
    """
    logs, features, at, usual = model.logs, model.features, model.at, model.features[USUAL]
    weights, own = model.level_weights[level], model.own_weights
    row_before, row_parent = features[ROW_BEFORE, 0], features[ROW_PARENT, 0]
    mean = min(max((path[at_block] + model.timely[c]) * gain, -MOST_MEAN), MOST_MEAN)
    fixed = int(np.floor(mean * UNIT))
    path[PATH_MEAN] = float(fixed) / UNIT
    side_1, side_2 = path[PATH_SIDE], path[PATH_SIDE + 1]
    side_3, side_4 = path[PATH_SIDE + 2], path[PATH_SIDE + 3]
    total = path[PATH_TOTAL]
    row_mean = total / float(c) if c > 3 else row_before
    scaled = usual[c] * (total + row_before + 0.1) / (total_usual + row_before + 0.1)
    path[PATH_ROW], path[PATH_SCALED] = row_mean, scaled
    size_1 = model.sizes[ONE, c] + weights[SIDE_1] * side_1 + weights[SIDE_2] * side_2
    size_1 += weights[SIDE_3] * side_3 + weights[SIDE_4] * side_4
    size_1 += weights[ROW] * row_mean + weights[SCALED] * scaled
    size_2 = model.sizes[TWO, c] + own[SIDE_1, c] * side_1 + own[SIDE_2, c] * side_2
    size_2 += own[SIDE_3, c] * side_3 + own[SIDE_4, c] * side_4
    size_2 += own[ROW, c] * row_mean + own[SCALED, c] * scaled
    size_1 = min(max(size_1, LEAST_SIZE), MOST_SIZE)
    size_2 = min(max(size_2, LEAST_SIZE), MOST_SIZE)
    path[PATH_SIZE], path[PATH_SIZE + 1] = size_1, size_2
    size_2, size = size_2 * gain, 0.5 * (size_1 + size_2) * gain
    if between:  # ROWS-08
        fixed += min(max(fixed, -HALF), HALF)
        size_2 += min(size_2, 0.5)
        size += min(size, 0.5)
    rounded = (fixed + HALF) >> 12
    fraction = fixed - (rounded << 12)
    before, above = features[BEFORE_1, c], features[PARENT, c]
    log_2, log_size = log_of(logs, size_2), log_of(logs, size)
    log_mean = min(log_of(logs, abs(float(fixed) / UNIT)) // 4, 3)
    distance = min(abs(fraction) >> 8, 7)
    near = min(distance >> 1, 3)
    at[0] = (C_MEAN + ((min(log_2 // 3, 11) * 4 + log_mean) * 4 + near) * 2) * N_SLOTS
    at[1] = (C_LEVEL + (level * 16 + min(log_size // 3, 15)) * 4 + log_mean) * N_SLOTS
    around = min(log_of(logs, (row_before + row_parent) * gain) // 4, 7) * 8
    beyond = min(log_of(logs, (above + features[PARENT_NEXT, c]) * gain) // 5, 7)
    at[2] = (C_ROWS + min(log_of(logs, row_mean * gain) // 4, 7) * 64 + around + beyond) * N_SLOTS
    local = min(log_of(logs, 0.5 * (before + features[BEFORE_2, c] + above) * gain) // 5, 5)
    at[3] = (N_SHARED + c * N_OWN + level * 6 + local) * N_SLOTS
    scale = min(log_size * 3 // 8, N_SCALES - 1)
    opposite = 1 if (fraction < 0) != (fixed < 0) else 0
    return (
        level,
        (min(log_mean, 1) * 4 + near) * 8 + scale // 2,
        N_SETS + c,
        scale,
        min(log_size // 4, 11) * 8 + distance,
        96 + (log_mean * 2 + opposite) * 8 + distance,
        160 + (level * 2 + opposite) * 4 + near,
        1 if fraction >= 0 else 0,
        rounded,
    )


def note_magnitude(path: Floats, value: float, miss: float, still: bool) -> None:
    """Add the magnitude of a channel to the path; ``value`` and ``miss`` in steps of the level.

    ``still``: its integer and the rounded mean are 0.
    """
    for k in range(3):
        path[PATH_SIDE + 3 - k] = path[PATH_SIDE + 2 - k]
    size = 0.0 if still else min(0.5 * abs(miss) + 0.5 * abs(value), MOST_SIZE)  # ROWS-03
    path[PATH_SIDE] = size
    path[PATH_TOTAL] += size


def follow(source: Floats, path: Floats, column: Floats, miss: float) -> None:
    """Fill ``path`` from ``source`` after a channel that is ``miss`` away from its mean."""
    for c in range(BLOCK):
        path[c] = source[c] + column[c] * miss
    for c in range(BLOCK, PATH_COST):
        path[c] = source[c]


def forget_block(paths: Floats2) -> None:
    """Reset the predictions of all ``paths`` at the start of a block."""
    for state in range(len(paths)):
        for c in range(BLOCK):
            paths[state, c] = 0.0
