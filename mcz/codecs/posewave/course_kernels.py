"""Compiled: approximations coded one after the other, each at the pose that those before end in.

SPEC.md, "Codec 3: posewave", is normative for what a decoder has then. Decoders need none of this:
they read all rows of a level at once. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.metric_kernels import (
    Course,
    continue_course,
    factor_rows,
    row_into,
    row_out_of,
)
from mcz.codecs.posewave.model_kernels import code_rows
from mcz.codecs.posewave.model_state import LevelRows, Model
from mcz.codecs.posewave.pose_kernels import Lanes
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2

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
