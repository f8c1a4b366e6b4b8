"""Compiled: rows of values into the metric and out of it, by factors that are at hand.

SPEC.md, "Pose metric", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.posewave.skeleton_plan import Floats, Ints, Plan
from mcz.jit import inner, kernel

GREATEST_VALUE = 2.0**100  # of what comes back


@kernel
def rows_into(plan: Plan, factors: Floats, rows: Floats, result: Floats, which: Ints) -> None:
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
def rows_out_of(plan: Plan, factors: Floats, rows: Floats, result: Floats, which: Ints) -> None:
    """The inverse of ``rows_into``."""
    for n in range(len(rows)):
        row_out_of(plan, factors[which[n]], rows[n], result[n])


@inner
def row_out_of(plan: Plan, factor: Floats, row: Floats, result: Floats) -> None:
    for c in range(len(plan.joints)):
        last = plan.starts[c + 1] - 1
        total = row[c] * factor[last]
        for at in range(plan.starts[c], last):
            total -= factor[at] * result[plan.path[at]]
        result[c] = min(max(total, -GREATEST_VALUE), GREATEST_VALUE)
