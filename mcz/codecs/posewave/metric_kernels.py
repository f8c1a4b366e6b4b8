"""Compiled: the metric of a pose, and its factor.

SPEC.md, "Pose metric", is normative. A factor holds for each kept channel c the entries L of the
channels above it in its block, and last 1 / root(D): G + regularization = L' D L. So a row x of
values becomes y = root(D) L x, in which one step is one step of the points' mean squared error.

Poses go through in batches of ``LANES``, see ``pose_kernels``. A single pose has a kernel of its
own; both give the same bits. A course is the approximations of a segment, row by row, each at the
pose of the previous one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.posewave.pose_kernels import Lanes, gather_inertia, lanes_of, place_joints
from mcz.codecs.posewave.skeleton_plan import PLAIN, Plan
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Floats3, Ints

LANES = 8
GREATEST = 2.0**120  # bound of entries of the metric, whose products then stay finite

# A power of 4, its inverse, and the inverse of its root.
OCTAVES = tuple((2.0 ** (2 * n), 2.0 ** (-2 * n), 2.0**-n) for n in (64, 32, 16, 8, 4, 2, 1))
LIFT, LIFT_ROOT = 2.0**102, 2.0**51
HALF_ROOT = 0.7071067811865476


def factor(plan: Plan, values: Floats) -> Floats:
    """The factors at poses ``values`` (n_poses, n_channels): (n_poses, n_entries)."""
    if values.shape[1] != plan.n_channels:
        raise ValueError(f"poses of shape {values.shape} for {plan.n_channels} channels")
    factors = np.empty((len(values), plan.n_entries))
    if len(values) == 1:
        factor_one(plan, lanes_of(plan, 1), values, factors)
    else:
        factor_batches(plan, lanes_of(plan, LANES), values, factors, LANES)
    return factors


@kernel
def factor_batches(plan: Plan, batch: Lanes, values: Floats2, factors: Floats2, lanes: int) -> None:
    """Fill ``factors`` (n_poses, n_entries); ``lanes`` is ``LANES``."""
    factor_rows(plan, batch, values, factors, LANES, lanes)


@kernel
def factor_one(plan: Plan, batch: Lanes, values: Floats2, factors: Floats2) -> None:
    """Fill ``factors`` pose by pose, without batches."""
    factor_rows(plan, batch, values, factors, 1, 1)


def factor_rows(
    plan: Plan, batch: Lanes, values: Floats2, factors: Floats2, width: int, lanes: int
) -> None:
    n_poses, n_entries = factors.shape
    n_kept = len(plan.joints)
    axes, origins, motions, inertia = batch.axes, batch.origins, batch.motions, batch.inertia
    force, entries, pivots = batch.force, batch.entries, batch.pivots
    for batch_number in range((n_poses + width - 1) // width):
        first = batch_number * width
        place_joints(plan, values, first, batch, lanes)
        gather_inertia(plan, axes, origins, inertia, lanes)
        _measure(plan, motions, inertia, force, entries, lanes)
        if plan.spread > 0.0:
            _stiffen(plan, motions, inertia, origins, entries, lanes)
        _eliminate(plan, batch, entries, pivots, width, lanes)
        for at in range(n_kept * width):
            pivots[at] = inverse_root(pivots[at])
        for number in range(n_kept):
            last = plan.starts[number + 1] - 1
            for p in range(lanes):
                entries[last, p] = pivots[number * width + p]
        for p in range(min(lanes, n_poses - first)):
            for at in range(n_entries):
                factors[first + p, at] = entries[at, p]


def _measure(
    plan: Plan, motions: Floats3, inertia: Floats3, force: Floats2, entries: Floats2, lanes: int
) -> None:
    """Compute the entries of the metric G: the work of one channel's motion along another."""
    for number in range(len(plan.joints)):
        start, stop, joint = plan.starts[number], plan.starts[number + 1], plan.joints[number]
        if joint == PLAIN:
            for p in range(lanes):
                entries[start, p] = 0.0
            continue
        _force(inertia[joint], motions[number], force, lanes)
        for at in range(start, stop):
            other = plan.path[at]
            for p in range(lanes):
                entries[at, p] = (
                    motions[other, 0, p] * force[0, p]
                    + motions[other, 1, p] * force[1, p]
                    + motions[other, 2, p] * force[2, p]
                    + motions[other, 3, p] * force[3, p]
                    + motions[other, 4, p] * force[4, p]
                    + motions[other, 5, p] * force[5, p]
                )


def _stiffen(
    plan: Plan, motions: Floats3, inertia: Floats3, origins: Floats3, entries: Floats2, lanes: int
) -> None:
    """Add to each turn's diagonal a share of the inertia that its joint moves."""
    for number in range(len(plan.joints)):
        joint, last = plan.joints[number], plan.starts[number + 1] - 1
        if joint != PLAIN:
            moved, place, turn = inertia[joint], origins[joint + 1], motions[number]
            for p in range(lanes):
                x, y, z = place[0, p], place[1, p], place[2, p]
                squared = x * x + y * y + z * z
                along = x * moved[1, p] + y * moved[2, p] + z * moved[3, p]
                whole = moved[4, p] + moved[5, p] + moved[6, p]
                whole = max((whole + 2.0 * (moved[0, p] * squared)) - 4.0 * along, 0.0)
                x, y, z = turn[0, p], turn[1, p], turn[2, p]
                entries[last, p] += (plan.spread * (x * x + y * y + z * z)) * whole


def _force(inertia: Floats2, motion: Floats2, force: Floats2, lanes: int) -> None:
    for p in range(lanes):
        m, a, b, c = inertia[0, p], inertia[1, p], inertia[2, p], inertia[3, p]
        x, y, z = motion[0, p], motion[1, p], motion[2, p]
        u, v, w = motion[3, p], motion[4, p], motion[5, p]
        xx, yy, zz = inertia[4, p], inertia[5, p], inertia[6, p]
        xy, xz, yz = inertia[7, p], inertia[8, p], inertia[9, p]
        force[0, p] = (xx * x + xy * y + xz * z) + (b * w - c * v)
        force[1, p] = (xy * x + yy * y + yz * z) + (c * u - a * w)
        force[2, p] = (xz * x + yz * y + zz * z) + (a * v - b * u)
        force[3, p] = m * u + (y * c - z * b)
        force[4, p] = m * v + (z * a - x * c)
        force[5, p] = m * w + (x * b - y * a)


def _eliminate(
    plan: Plan, batch: Lanes, entries: Floats2, pivots: Floats, width: int, lanes: int
) -> None:
    """Turn entries of G into those of L, from the last channel to the first, without fill-in.

    Two channels that are neighbors on a path go together: what is above both is read and written
    once.
    """
    starts, path = plan.starts, plan.path
    own, shares, own_2, shares_2 = batch.own, batch.shares, batch.own_2, batch.shares_2
    number = len(plan.joints) - 1
    while number >= 0:
        start, above = starts[number], starts[number + 1] - starts[number] - 1
        _take_pivot(plan, entries, number, own, shares, pivots[number * width :], lanes)
        if above > 0 and path[start + above - 1] == number - 1:
            number -= 1
            above -= 1
            _subtract(entries, starts[number], above, own, shares, lanes)
            _take_pivot(plan, entries, number, own_2, shares_2, pivots[number * width :], lanes)
            for i in range(above):
                _subtract_both(
                    entries, starts[path[start + i]], i, own, shares, own_2, shares_2, lanes
                )
        else:
            for i in range(above):
                _subtract(entries, starts[path[start + i]], i, own, shares, lanes)
        number -= 1


def _take_pivot(
    plan: Plan,
    entries: Floats2,
    number: int,
    own: Floats2,
    shares: Floats2,
    pivots: Floats,
    lanes: int,
) -> None:
    """Save a row of G and its pivot, and turn it into a row of L."""
    start, above = plan.starts[number], plan.starts[number + 1] - plan.starts[number] - 1
    added = plan.regularization[number]
    least = 0.5 * added
    for p in range(lanes):
        pivots[p] = min(max(entries[start + above, p] + added, least), GREATEST)
        own[above, p] = 1.0 / pivots[p]  # POSE-01
    for i in range(above):
        for p in range(lanes):
            entry = min(max(entries[start + i, p], -GREATEST), GREATEST)
            own[i, p] = entry
            shares[i, p] = entry * own[above, p]
            entries[start + i, p] = shares[i, p]


def _subtract(
    entries: Floats2, top: int, i: int, own: Floats2, shares: Floats2, lanes: int
) -> None:
    """Subtract ``own`` times its share from the row at ``top``, that of channel i of a path."""
    for k in range(i + 1):
        for p in range(lanes):
            entries[top + k, p] -= shares[i, p] * own[k, p]


def _subtract_both(
    entries: Floats2,
    top: int,
    i: int,
    own: Floats2,
    shares: Floats2,
    own_2: Floats2,
    shares_2: Floats2,
    lanes: int,
) -> None:
    """``_subtract`` of ``own`` with its shares, then of ``own_2``."""
    for k in range(i + 1):
        for p in range(lanes):
            left = entries[top + k, p] - shares[i, p] * own[k, p]
            entries[top + k, p] = left - shares_2[i, p] * own_2[k, p]


def inverse_root(value: float) -> float:
    """1 / root(value) for 2^-102 to 2^121, exact to about 1e-15: octaves first, then Newton."""
    value = value * LIFT
    scale = LIFT_ROOT
    for power, inverse, root in OCTAVES:
        large = value >= power
        value = value * inverse if large else value
        scale = scale * root if large else scale
    large = value >= 2.0
    value = value * 0.5 if large else value
    scale = scale * HALF_ROOT if large else scale
    estimate = 1.2796 - 0.2929 * value
    for _ in (0, 1, 2, 3):
        estimate = estimate * (1.5 - 0.5 * value * estimate * estimate)
    return estimate * scale


MEMORY = 0.97  # of what was learned, from row to row
PRIOR, PRIOR_SHARE = 0.25, 0.5  # (PRIOR * greatest step)^2 times 4, and its share


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
def take_rows(plan: Plan, lanes: Lanes, course: Course, rows: Floats2, approx: Floats2) -> None:
    """Approximations (n_rows, n_kept) from rows in the metric."""
    n_kept = len(course.kept)
    factor, difference = np.empty((1, len(plan.path))), np.empty(n_kept)
    for m in range(len(rows)):
        factor_rows(plan, lanes, course.pose, factor, 1, 1)
        row_out_of(plan, factor[0], rows[m], difference)
        continue_course(course, difference)
        for k in range(n_kept):
            approx[m, k] = course.pose[0, course.kept[k]]


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
        row_into(plan, factors[which[n]], rows[n], result[n])


def row_into(plan: Plan, factor: Floats, row: Floats, result: Floats) -> None:
    for c in range(len(plan.joints)):
        last = plan.starts[c + 1] - 1
        total = row[c]
        for at in range(plan.starts[c], last):
            total += factor[at] * row[plan.path[at]]
        result[c] = total / factor[last]


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
