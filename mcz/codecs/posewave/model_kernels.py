"""Compiled: rows of quantized wavelet coefficients, coded in the context of other rows.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. One
function serves encoder and decoder; what only an encoder does is choosing. Imported on first use
only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import adaptive, mixed
from mcz.codecs.posewave.decision_kernels import (
    COST_UNIT,
    Contexts,
    code_error,
    cost_of,
    mixed_chance,
)
from mcz.codecs.posewave.model_state import (
    BEFORE_1,
    BEFORE_2,
    C_EXPONENT,
    C_FLAG,
    C_LEVEL,
    C_MEAN,
    C_ROWS,
    M_FLAG,
    MAX_EXPONENT,
    MAX_INDEX,
    N_OWN,
    N_SCALES,
    N_SETS,
    N_SHARED,
    N_SLOTS,
    PARENT,
    PARENT_NEXT,
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
from mcz.codecs.posewave.prediction_kernels import (
    FOUND,
    LEAST_SIZE,
    MEMORY,
    MOST_SIZE,
    ONE,
    TWO,
    gather_magnitudes,
    learn_in_time,
    learn_sizes,
    log_of,
    predict_in_time,
    spread,
    take_in,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

UNIT = 4096.0  # a mean is a multiple of 1 / UNIT
MOST_MEAN = float(1 << 31)
NO_CHOICE = -1.0  # as ``lam``: the integers are given
FAULTY = -1.0


@kernel
def code_rows(
    model: Model,
    data: Bytes,
    q: Ints2,
    y: Floats2,
    means: Floats2,
    here: Floats2,
    parent: Floats2,
    grand: Floats2,
    level: int,
    first: int,
    last: int,
    lam: float,
    exponents: Ints,
    refining: int,
) -> int:
    """Code the rows ``first`` to ``last`` of a level in place; return the row of a fault, or -1.

    ``q`` and ``means`` (rows, n) are the integers and what the model took for their means; ``y``
    (rows, n) is what an encoder quantizes, with ``lam`` >= 0, as so many squares of a step as a bit
    is worth; with ``NO_CHOICE``, and in a decoder, it is not looked at. ``here`` (3 + rows, 2
    wide) are magnitudes and values of this level's rows, all of it written here but the three rows
    of zeros in front; ``parent`` and ``grand`` those of the two coarser levels, without their
    rows of zeros, or one row of zeros. ``exponents`` (rows,) say how much finer than the level's
    the step of a row is, 2^-s; they are coded where ``refining`` is 1, and otherwise 0.
    """
    coder, n = model.coder, len(model.classes)
    chooses = coder[mixing.ENCODING] != 0 and lam >= 0.0
    for row in range(first, last):
        flags = flag_contexts(model, here, parent, level, row)
        live = 0
        if chooses:
            live = (
                1
                if is_live(
                    model, data, q, y, means, here, parent, grand, level, row, lam, flags, exponents
                )
                else 0
            )
        else:
            for c in range(n):
                live |= 1 if q[row, c] != 0 else 0
        if mixed(coder, data, live, M_FLAG + level, flags[0], flags[1], flags[2]) == 0:
            q[row] = 0
            means[row] = 0.0
            here[row + 3] = 0.0
            exponents[row] = 0
            continue
        if refining:
            earlier = exponents[row - 1] if row > 0 else 0
            exponents[row] = code_exponent(coder, data, exponents[row], earlier)
        cost = code_row(
            model,
            data,
            q[row],
            y[row if chooses else 0],
            means[row],
            here,
            parent,
            grand,
            level,
            row,
            lam,
            exponents[row],
            False,
        )
        if cost == FAULTY:
            return row
        model.seen[0] = model.seen[0] * MEMORY + 1.0  # ROWS-02
    return -1


def code_exponent(coder: Ints, data: Bytes, exponent: int, earlier: int) -> int:
    """Code the refinement of a row in octaves; ``earlier``: that of the row before."""
    at, coded = C_EXPONENT + MAX_EXPONENT * earlier, 0
    while coded < MAX_EXPONENT:
        if adaptive(coder, data, 1 if exponent > coded else 0, at + coded) == 0:
            break
        coded += 1
    return coded


def flag_contexts(
    model: Model, here: Floats2, parent: Floats2, level: int, row: int
) -> tuple[int, int, int]:
    """Three contexts for whether a row is live: which around it are, and how large they are."""
    n, last = len(model.classes), len(parent) - 1
    up = min(row >> 1, last)
    before, above = here[row + 2, n], parent[up, n]
    around = (
        (1 if before > 0.0 else 0)
        + (2 if here[row + 1, n] > 0.0 else 0)
        + (4 if above > 0.0 else 0)
        + (8 if parent[min(up + 1, last), n] > 0.0 else 0)
    )
    large = min(log_of(model.logs, 8.0 * before) // 4, 7)
    larger = min(log_of(model.logs, 8.0 * above) // 4, 7)
    return (
        C_FLAG + level * 16 + around,
        C_FLAG + 96 + level * 8 + large,
        C_FLAG + 144 + large * 8 + larger,
    )


def is_live(
    model: Model,
    data: Bytes,
    q: Ints2,
    y: Floats2,
    means: Floats2,
    here: Floats2,
    parent: Floats2,
    grand: Floats2,
    level: int,
    row: int,
    lam: float,
    flags: tuple[int, int, int],
    exponents: Ints,
) -> bool:
    """An encoder's choice whether to code a row or to let all of it be zero."""
    n = len(model.classes)
    energy, most = 0.0, 0.0
    for c in range(n):
        energy += y[row, c] * y[row, c]
        most = max(most, abs(y[row, c]))
    if most < 0.5:
        return False
    if most >= 2.0 or energy >= 4.0 + 0.1 * n:
        return True
    cost = code_row(
        model,
        data,
        q[row],
        y[row],
        means[row],
        here,
        parent,
        grand,
        level,
        row,
        lam,
        exponents[row],
        True,
    )
    some = False
    for c in range(n):
        some = some or q[row, c] != 0
    chance = mixed_chance(model.coder, M_FLAG + level, flags)
    saved = model.costs[chance >> 4] - model.costs[(65536 - chance) >> 4]
    return some and cost + lam * float(saved) / COST_UNIT < energy


def code_row(
    model: Model,
    data: Bytes,
    q: Ints,
    y: Floats,
    means: Floats,
    here: Floats2,
    parent: Floats2,
    grand: Floats2,
    level: int,
    row: int,
    lam: float,
    exponent: int,
    trial: bool,
) -> float:
    """Code a live row; return its cost to an encoder that chooses, or FAULTY.

    A ``trial`` chooses and learns nothing. What is remembered is in steps of the level, of which
    one is 2^``exponent`` of the row's own.
    """
    n, blocks, width = len(model.classes), len(model.columns), len(model.timely)
    chooses = model.coder[mixing.ENCODING] != 0 and lam >= 0.0
    gain = float(1 << exponent)
    gather_magnitudes(model, here, parent, grand, level, row)
    predict_in_time(model, here, parent, level, row)
    logs, features, timely, usual = model.logs, model.features, model.timely, model.features[USUAL]
    one, two, found = model.sizes[ONE], model.sizes[TWO], model.sizes[FOUND]
    weights, own = model.level_weights[level], model.own_weights
    magnitudes, values = here[row + 3, :width], here[row + 3, width:]
    across, at = model.means, model.at
    side_1 = side_2 = side_3 = side_4 = 0.0
    row_before, row_parent = features[ROW_BEFORE, 0], features[ROW_PARENT, 0]
    around = min(log_of(logs, (row_before + row_parent) * gain) // 4, 7) * 8
    total = total_usual = cost = 0.0
    block, start, stop = -1, 0, 0
    for c in range(n):
        if c == stop:
            block, start, stop = block + 1, stop, (block + 2) * n // blocks
            across[:] = 0.0
        mean = min(max((across[c - start] + timely[c]) * gain, -MOST_MEAN), MOST_MEAN)
        fixed = int(np.floor(mean * UNIT))
        mean = float(fixed) / UNIT
        rounded = (fixed + 2048) >> 12
        fraction = fixed - (rounded << 12)
        row_mean = total / float(c) if c > 3 else row_before
        scaled = usual[c] * (total + row_before + 0.1) / (total_usual + row_before + 0.1)
        features[SIDE_1, c] = side_1
        features[SIDE_2, c] = side_2
        features[SIDE_3, c] = side_3
        features[SIDE_4, c] = side_4
        features[ROW, c] = row_mean
        features[SCALED, c] = scaled
        size_1 = one[c] + weights[SIDE_1] * side_1 + weights[SIDE_2] * side_2
        size_1 += weights[SIDE_3] * side_3 + weights[SIDE_4] * side_4
        size_1 += weights[ROW] * row_mean + weights[SCALED] * scaled
        size_2 = two[c] + own[SIDE_1, c] * side_1 + own[SIDE_2, c] * side_2
        size_2 += own[SIDE_3, c] * side_3 + own[SIDE_4, c] * side_4
        size_2 += own[ROW, c] * row_mean + own[SCALED, c] * scaled
        size_1 = min(max(size_1, LEAST_SIZE), MOST_SIZE)
        size_2 = min(max(size_2, LEAST_SIZE), MOST_SIZE)
        one[c], two[c] = size_1, size_2
        before, above = features[BEFORE_1, c], features[PARENT, c]
        log_2 = log_of(logs, size_2 * gain)
        log_size = log_of(logs, 0.5 * (size_1 + size_2) * gain)
        log_mean = min(log_of(logs, abs(mean)) // 4, 3)
        distance = min(abs(fraction) >> 8, 7)
        near = min(distance >> 1, 3)
        at[0] = (C_MEAN + ((min(log_2 // 3, 11) * 4 + log_mean) * 4 + near) * 2) * N_SLOTS
        at[1] = (C_LEVEL + (level * 16 + min(log_size // 3, 15)) * 4 + log_mean) * N_SLOTS
        beyond = min(log_of(logs, (above + features[PARENT_NEXT, c]) * gain) // 5, 7)
        at[2] = (
            C_ROWS + min(log_of(logs, row_mean * gain) // 4, 7) * 64 + around + beyond
        ) * N_SLOTS
        local = min(log_of(logs, 0.5 * (before + features[BEFORE_2, c] + above) * gain) // 5, 5)
        at[3] = (N_SHARED + c * N_OWN + level * 6 + local) * N_SLOTS
        scale = min(log_size * 3 // 8, N_SCALES - 1)
        opposite = 1 if (fraction < 0) != (fixed < 0) else 0
        where = (
            level,
            (min(log_mean, 1) * 4 + near) * 8 + scale // 2,
            N_SETS + c,
            scale,
            min(log_size // 4, 11) * 8 + distance,
            96 + (log_mean * 2 + opposite) * 8 + distance,
            160 + (level * 2 + opposite) * 4 + near,
            1 if fraction >= 0 else 0,
        )
        if chooses:
            q[c], more = choose(model, y[c], rounded, where, lam)
            cost += more
        error = q[c] - rounded
        if not trial:
            error = code_error(model, data, error, where)
        value = rounded + error
        if abs(value) > MAX_INDEX:  # ROWS-04
            return FAULTY
        q[c], means[c], values[c] = value, mean, float(value) / gain
        miss = (float(value) - mean) / gain
        side_4, side_3, side_2 = side_3, side_2, side_1
        side_1 = min(0.5 * abs(miss) + 0.5 * abs(values[c]), MOST_SIZE)  # ROWS-03
        if value == 0 and rounded == 0:
            side_1 = 0.0
        magnitudes[c], found[c] = side_1, min(abs(miss), MOST_SIZE)
        total += side_1
        total_usual += usual[c]
        spread(across, model.columns[block, c - start], miss)
    if not trial:
        magnitudes[n] = total / float(n)
        learn_from_row(model, here, level, row)
    return cost


def learn_from_row(model: Model, here: Floats2, level: int, row: int) -> None:
    """Update all predictors from a coded row; a row of large values counts for less."""
    n, blocks, width = len(model.classes), len(model.columns), len(model.timely)
    values = here[row + 3, width:]
    learn_sizes(model, level, here[row + 3, :width])
    total = 0.0
    for c in range(n):
        total += abs(values[c])
    share = 1.0 / (1.25 * total / float(n) + 1.0)
    share *= share
    rest = model.means
    for block in range(blocks):
        first, stop = block * n // blocks, (block + 1) * n // blocks
        rest[:] = 0.0
        for c in range(first, stop):
            rest[c - first] = values[c] - model.timely[c]
        take_in(model.columns[block], model.variances[block], rest, stop - first, share)
    learn_in_time(model, values, level, row, share)


def choose(model: Model, y: float, rounded: int, where: Contexts, lam: float) -> tuple[int, float]:
    """The integer next to ``y``, or 0, whose square error and bits cost least, and their cost."""
    y = min(max(y, -2.0 * MAX_INDEX), 2.0 * MAX_INDEX)
    low = int(np.floor(y))
    best, least = low, 0.0
    for k in range(3 if 1.0 < abs(y) < 2.0 else 2):
        candidate = low + k if k < 2 else 0
        away = y - float(candidate)
        cost = away * away + lam * float(cost_of(model, candidate - rounded, where)) / COST_UNIT
        if k == 0 or cost < least:
            best, least = candidate, cost
    return best, least
