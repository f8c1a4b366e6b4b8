"""Compiled: rows of quantized wavelet coefficients, coded in the context of other rows.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. One
function serves encoder and decoder; what only an encoder does is choosing. It also codes
approximations one after the other, each at the pose that those before end in; decoders read all
rows of a level at once.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import code_adaptive, code_mixed
from mcz.codecs.posewave.channel_kernels import (
    expect,
    forget_block,
    next_state,
    note_magnitude,
    twice_value,
)
from mcz.codecs.posewave.decision_kernels import ROUNDED, code_error
from mcz.codecs.posewave.metric_kernels import (
    Course,
    continue_course,
    factor_rows,
    row_into,
    row_out_of,
)
from mcz.codecs.posewave.model_state import (
    C_EXPONENT,
    C_FLAG,
    M_FLAG,
    MAX_EXPONENT,
    MAX_INDEX,
    PATH_MEAN,
    PATH_ROW,
    PATH_SCALED,
    PATH_SIDE,
    PATH_SIZE,
    PATH_TOTAL,
    ROW,
    SCALED,
    SIDE_1,
    USUAL,
    LevelRows,
    Model,
)
from mcz.codecs.posewave.pose_kernels import Lanes
from mcz.codecs.posewave.prediction_kernels import (
    FOUND,
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
from mcz.codecs.posewave.search_kernels import choose_row, is_live
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints


@kernel
def code_rows(
    model: Model,
    data: Bytes,
    rows: LevelRows,
    level: int,
    first: int,
    last: int,
    lam: float,
    refining: int,
    dependent: int,
) -> int:
    """Code the rows ``first`` to ``last`` of a level in place; return the row of a fault, or -1.

    ``lam``: squares of a step that a bit is worth to an encoder. Exponents are coded if
    ``refining`` is 1, and otherwise 0. ``dependent`` 1: each integer decides which numbers the next
    value may take.
    """
    q, exponents, is_kept = rows.q, rows.exponents, rows.is_kept
    here, parent, grand = rows.here, rows.parent, rows.grand
    coder, chooses = model.coder, model.coder[mixing.ENCODING] != 0
    for row in range(first, last):
        flags = flag_contexts(model, here, parent, level, row)
        exponent, live = exponents[row], 0
        if is_kept[row]:
            live = 1 if is_live(q[row]) else 0
        elif chooses:
            live = choose_row(
                model,
                q[row],
                rows.y[row],
                here,
                parent,
                grand,
                level,
                row,
                lam,
                exponent,
                flags,
                dependent,
            )
        if code_mixed(coder, data, live, M_FLAG + level, flags[0], flags[1], flags[2]) == 0:
            q[row] = 0
            here[row + 3] = 0.0
            exponents[row] = 0
            continue
        if refining:
            earlier = exponents[row - 1] if row > 0 else 0
            exponents[row] = code_exponent(coder, data, exponent, earlier)
        if not chooses or is_kept[row]:
            gather_magnitudes(model, here, parent, grand, level, row)
            predict_in_time(model, here, parent, level, row)
        if code_row(model, data, q[row], here[row + 3], level, exponents[row], dependent) != 0:
            return row
        learn_from_row(model, here, level, row)
        model.seen[0] = model.seen[0] * MEMORY + 1.0  # ROWS-02
    return -1


def code_exponent(coder: Ints, data: Bytes, exponent: int, earlier: int) -> int:
    """Code the refinement of a row in octaves; ``earlier``: that of the row before."""
    at, coded = C_EXPONENT + MAX_EXPONENT * earlier, 0
    while coded < MAX_EXPONENT:
        if code_adaptive(coder, data, 1 if exponent > coded else 0, at + coded) == 0:
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


def code_row(
    model: Model, data: Bytes, q: Ints, row: Floats, level: int, exponent: int, dependent: int
) -> int:
    """Code a live row, whose surroundings the model knows; return 1 for a fault, else 0.

    ``row`` (2 wide,) are its magnitudes and values in steps of the level, of which one is
    2^``exponent`` of the row's own.
    """
    n, blocks, width = len(model.classes), len(model.columns), len(model.timely)
    gain = float(1 << exponent)
    features, usual = model.features, model.features[USUAL]
    one, two, found = model.sizes[ONE], model.sizes[TWO], model.sizes[FOUND]
    paths, path = model.paths[0], model.paths[0, 0]
    path[:] = 0.0
    total_usual = 0.0
    state, block, start, stop = 0, -1, 0, 0
    for c in range(n):
        if c == stop:
            block, start, stop = block + 1, stop, (block + 2) * n // blocks
            forget_block(paths)
        between = state & 1
        where = expect(model, path, c, c - start, level, gain, total_usual, between)
        one[c], two[c] = path[PATH_SIZE], path[PATH_SIZE + 1]
        features[ROW, c], features[SCALED, c] = path[PATH_ROW], path[PATH_SCALED]
        for k in range(4):
            features[SIDE_1 + k, c] = path[PATH_SIDE + k]
        integer = (abs(q[c]) + between) >> 1
        error = code_error(model, data, (-integer if q[c] < 0 else integer) - where[ROUNDED], where)
        integer = where[ROUNDED] + error
        if abs(integer) > MAX_INDEX:  # ROWS-04
            return 1
        q[c] = twice_value(integer, between)
        if dependent:
            state = next_state(state, integer)
        value = 0.5 * float(q[c])
        miss = (value - path[PATH_MEAN]) / gain
        note_magnitude(path, value / gain, miss, integer == 0 and error == 0)
        row[c], row[width + c] = path[PATH_SIDE], value / gain
        found[c] = min(abs(miss), MOST_SIZE)
        total_usual += usual[c]
        spread(path, model.columns[block, c - start], miss)
    row[n] = path[PATH_TOTAL] / float(n)
    return 0


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
    rest = model.paths[0, 0]
    for block in range(blocks):
        first, stop = block * n // blocks, (block + 1) * n // blocks
        rest[:] = 0.0
        for c in range(first, stop):
            rest[c - first] = values[c] - model.timely[c]
        take_in(model.columns[block], model.variances[block], rest, stop - first, share)
    learn_in_time(model, values, level, row, share)


MOST_WANTED = 2.0**29
NO_FAULT, TOO_LARGE = -1, -2


@kernel
def code_course(
    plan: Plan,
    lanes: Lanes,
    course: Course,
    source: Floats2,
    steps: Floats,
    approx: Floats2,
    model: Model,
    data: Bytes,
    rows: LevelRows,
    kind: int,
    start: int,
    lam: float,
    refining: int,
    dependent: int,
) -> int:
    """Code the approximations ``source`` (n_rows, n_kept), the first as row ``start`` of a level.

    ``steps`` (n_rows,) are those of rows; the others are those of ``code_rows``. Fills ``approx``
    (n_rows, n_kept) with what a decoder has, and returns ``NO_FAULT``, ``TOO_LARGE`` for a
    coefficient of ``MOST_WANTED`` steps or NaN, or the row of another fault.
    """
    n_kept = len(course.kept)
    factor = np.empty((1, len(plan.path)))
    difference, row = np.empty(n_kept), np.empty(n_kept)
    for m in range(len(source)):
        factor_rows(plan, lanes, course.pose, factor, 1, 1)
        for k in range(n_kept):
            difference[k] = source[m, k] - course.expected[k]
        row_into(plan, factor[0], difference, row)
        for k in range(n_kept):
            coefficient = row[k] / steps[m]
            if not abs(coefficient) < MOST_WANTED:
                return TOO_LARGE
            rows.y[start + m, k] = coefficient
        at = start + m
        fault = code_rows(model, data, rows, kind, at, at + 1, lam, refining, dependent)
        if fault >= 0:
            return fault
        for k in range(n_kept):
            row[k] = 0.5 * float(rows.q[at, k]) * steps[m]
        row_out_of(plan, factor[0], row, difference)
        continue_course(course, difference)
        for k in range(n_kept):
            approx[m, k] = course.pose[0, course.kept[k]]
    return NO_FAULT
