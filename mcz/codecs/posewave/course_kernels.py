"""Compiled: the approximations of a segment, row after row, each at the pose of the one before.

SPEC.md, "Codec 3: posewave", is normative and has the steps below in the same order. Imported on
first use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.posewave.apply_kernels import row_out_of
from mcz.codecs.posewave.metric_kernels import factor_rows
from mcz.codecs.posewave.pose_kernels import Lanes
from mcz.codecs.posewave.pose_kernels import lanes_of as lanes_of
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Ints

MEMORY = 0.97  # of what was learned, from row to row
PRIOR, PRIOR_SHARE = 0.25, 0.5  # (PRIOR * greatest step)^2 times 4, and the share it stands for


class Course(NamedTuple):
    """Linear extrapolation state of the approximation rows.

    ``pose`` (1, n_channels) is the last one, ``kept`` (n_kept,) are its columns that change. By
    kept channel: ``expected`` is the next row, ``moved`` the last difference of rows, ``above`` and
    ``below`` the products of neighboring differences and their squares. ``n_rows`` (1,).
    """

    pose: Floats2
    kept: Ints
    expected: Floats
    moved: Floats
    above: Floats
    below: Floats
    n_rows: Ints


def course_of(still: Floats, kept: Ints, greatest: Floats) -> Course:
    """Before the first row: ``still`` (n_channels,) is the pose, ``greatest`` (n_kept,) steps."""
    scale = PRIOR * greatest
    below = 4.0 * scale * scale
    return Course(
        pose=still[None].copy(),
        kept=kept,
        expected=still[kept],
        moved=np.zeros(len(kept)),
        above=PRIOR_SHARE * below,
        below=below,
        n_rows=np.zeros(1, np.int64),
    )


def continue_course(course: Course, difference: Floats) -> None:
    """Advance by a row that is ``difference`` (n_kept,) away from the expected one."""
    n_rows = course.n_rows[0]
    for k in range(len(course.kept)):
        c = course.kept[k]
        value = course.expected[k] + difference[k]
        moved = value - course.pose[0, c]
        if n_rows >= 2:
            course.above[k] = course.above[k] * MEMORY + moved * course.moved[k]
            course.below[k] = course.below[k] * MEMORY + course.moved[k] * course.moved[k]
        share = min(max(course.above[k] / course.below[k], 0.0), 1.0)
        course.pose[0, c] = value  # PWAVE-21
        course.expected[k] = value + (share * moved if n_rows >= 1 else 0.0)  # PWAVE-21
        course.moved[k] = moved if n_rows >= 1 else 0.0
    course.n_rows[0] = n_rows + 1


@kernel
def next_factor(plan: Plan, lanes: Lanes, course: Course, factor: Floats2) -> None:
    """Fill ``factor`` (1, n_entries) at the last pose."""
    factor_rows(plan, lanes, course.pose, factor, 1, 1)


@kernel
def take_row(plan: Plan, course: Course, factor: Floats2, row: Floats2) -> None:
    """Go on by a row (1, n_kept) that is in the metric."""
    difference = np.empty(len(course.kept))
    row_out_of(plan, factor[0], row[0], difference)
    continue_course(course, difference)


@kernel
def take_rows(plan: Plan, lanes: Lanes, course: Course, rows: Floats2, approx: Floats2) -> None:
    """The approximations, (n_rows, n_kept), of rows in the metric."""
    n_kept = len(course.kept)
    factor, difference = np.empty((1, len(plan.path))), np.empty(n_kept)
    for m in range(len(rows)):
        factor_rows(plan, lanes, course.pose, factor, 1, 1)
        row_out_of(plan, factor[0], rows[m], difference)
        continue_course(course, difference)
        for k in range(n_kept):
            approx[m, k] = course.pose[0, course.kept[k]]
