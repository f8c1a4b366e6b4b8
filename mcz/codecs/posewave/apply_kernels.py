"""Compiled: rows of values into the metric and out of it, by factors that are at hand.

SPEC.md, "Pose metric", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Ints

GREATEST_VALUE = 2.0**100  # of what comes back


def into_metric(plan: Plan, factors: Floats, rows: Floats, which: Ints) -> Floats:
    """Rows of values, (n_rows, n_kept), in the metric: row n by the factor ``which[n]``."""
    result = _room(plan, factors, rows)
    rows_into(plan, factors, np.ascontiguousarray(rows), result, which)
    return result


def out_of_metric(plan: Plan, factors: Floats, rows: Floats, which: Ints) -> Floats:
    """The inverse of ``into_metric``, which never comes to more than 2^100."""
    result = _room(plan, factors, rows)
    rows_out_of(plan, factors, np.ascontiguousarray(rows), result, which)
    return result


def _room(plan: Plan, factors: Floats, rows: Floats) -> Floats:
    if rows.shape[1] != plan.n_kept or factors.shape[1] != plan.n_entries:
        raise ValueError(f"rows of {rows.shape[1]} values for {plan.n_kept} channels")
    return np.empty(rows.shape)


@kernel
def rows_into(plan: Plan, factors: Floats2, rows: Floats2, result: Floats2, which: Ints) -> None:
    """Fill ``result`` (n_rows, n_kept): row n of ``rows`` in the metric of pose ``which[n]``.

    ``factors`` (n_poses, n_entries).
    """
    for n in range(len(rows)):
        factor, row = factors[which[n]], rows[n]
        for c in range(len(plan.joints)):
            last = plan.starts[c + 1] - 1
            total = row[c]
            for at in range(plan.starts[c], last):
                total += factor[at] * row[plan.path[at]]
            result[n, c] = total / factor[last]


@kernel
def rows_out_of(plan: Plan, factors: Floats2, rows: Floats2, result: Floats2, which: Ints) -> None:
    """The inverse of ``rows_into``."""
    for n in range(len(rows)):
        row_out_of(plan, factors[which[n]], rows[n], result[n])


def row_out_of(plan: Plan, factor: Floats, row: Floats, result: Floats) -> None:
    for c in range(len(plan.joints)):
        last = plan.starts[c + 1] - 1
        total = row[c] * factor[last]
        for at in range(plan.starts[c], last):
            total -= factor[at] * result[plan.path[at]]
        result[c] = min(max(total, -GREATEST_VALUE), GREATEST_VALUE)
