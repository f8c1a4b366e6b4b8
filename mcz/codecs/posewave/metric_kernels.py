"""Compiled: the metric of a pose, and its factor.

SPEC.md, "Pose metric", is normative. A factor holds for each kept channel c the entries L of the
channels above it in its block, and last 1 / root(D): G + regularization = L' D L. So a row x of
values becomes y = root(D) L x, of which one step is one step of the points' mean squared error.

Poses go through in batches of ``LANES``, see ``pose_kernels``. A single pose has a kernel of its
own; both give the same bits. What a factor does to rows of values: ``apply_kernels``.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.pose_kernels import gather_inertia, place_joints
from mcz.codecs.posewave.skeleton_plan import MAX_PATH, PLAIN, Floats, Plan
from mcz.jit import inner, kernel

Row = tuple[Floats, Floats]  # (MAX_PATH, width): entries of G, last 1 / D; and of L

LANES = 8
GREATEST = 2.0**120  # of entries of the metric, whose products then stay finite

# A power of 4, that of which 1 / root is taken off, and the root itself.
OCTAVES = tuple((2.0 ** (2 * n), 2.0 ** (-2 * n), 2.0**-n) for n in (64, 32, 16, 8, 4, 2, 1))
LIFT, LIFT_ROOT = 2.0**102, 2.0**51
HALF_ROOT = 0.7071067811865476


def factor(plan: Plan, values: Floats) -> Floats:
    """The factors at poses ``values`` (n_poses, n_channels): (n_poses, n_entries)."""
    if values.shape[1] != plan.n_channels:
        raise ValueError(f"poses of shape {values.shape} for {plan.n_channels} channels")
    found = np.empty((len(values), plan.n_entries))
    if len(values) == 1:
        factor_one(plan, values, found)
    else:
        factor_batches(plan, values, found, LANES)
    return found


@kernel
def factor_batches(plan: Plan, values: Floats, factors: Floats, lanes: int) -> None:
    """Fill ``factors`` (n_poses, n_entries); ``lanes`` is ``LANES``."""
    factor_rows(plan, values, factors, LANES, lanes)


@kernel
def factor_one(plan: Plan, values: Floats, factors: Floats) -> None:
    """The same of poses one by one."""
    factor_rows(plan, values, factors, 1, 1)


@inner
def factor_rows(plan: Plan, values: Floats, factors: Floats, width: int, lanes: int) -> None:
    n_poses, n_entries = factors.shape
    n_joints, n_turns, n_kept = len(plan.parents), len(plan.turns), len(plan.joints)
    angles, cosines = np.empty((n_turns, width)), np.empty((n_turns, width))
    axes, origins = np.empty((n_joints + 1, 9, width)), np.empty((n_joints + 1, 3, width))
    motions, inertia = np.zeros((n_kept, 6, width)), np.empty((n_joints, 10, width))
    scratch, force = np.empty((9, width)), np.empty((6, width))
    lanes_of = angles, cosines, scratch, axes, origins, motions
    one = np.empty((MAX_PATH, width)), np.empty((MAX_PATH, width))
    other = np.empty((MAX_PATH, width)), np.empty((MAX_PATH, width))
    entries, pivots = np.empty((n_entries, width)), np.empty(n_kept * width)
    for batch in range((n_poses + width - 1) // width):
        first = batch * width
        place_joints(plan, values, first, lanes_of, lanes)
        gather_inertia(plan, axes, origins, inertia, lanes)
        _measure(plan, motions, inertia, force, entries, lanes)
        _eliminate(plan, entries, one, other, pivots, width, lanes)
        for at in range(n_kept * width):
            pivots[at] = inverse_root(pivots[at])
        for number in range(n_kept):
            last = plan.starts[number + 1] - 1
            for p in range(lanes):
                entries[last, p] = pivots[number * width + p]
        for p in range(min(lanes, n_poses - first)):
            for at in range(n_entries):
                factors[first + p, at] = entries[at, p]


@inner
def _measure(
    plan: Plan, motions: Floats, inertia: Floats, force: Floats, entries: Floats, lanes: int
) -> None:
    """The entries of the metric G: what the force that moves one channel does along another."""
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


@inner
def _force(inertia: Floats, motion: Floats, force: Floats, lanes: int) -> None:
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


@inner
def _eliminate(
    plan: Plan, entries: Floats, one: Row, other: Row, pivots: Floats, width: int, lanes: int
) -> None:
    """Entries of G to those of L, from the last channel to the first, without any new entry.

    Two channels of which one comes right after the other on its path go together: what is above
    both is read and written once.
    """
    starts, path = plan.starts, plan.path
    number = len(plan.joints) - 1
    while number >= 0:
        start, above = starts[number], starts[number + 1] - starts[number] - 1
        _take_pivot(plan, entries, number, one, pivots[number * width :], lanes)
        if above > 0 and path[start + above - 1] == number - 1:
            number -= 1
            above -= 1
            _subtract(entries, starts[number], above, one, lanes)
            _take_pivot(plan, entries, number, other, pivots[number * width :], lanes)
            for i in range(above):
                _subtract_both(entries, starts[path[start + i]], i, one, other, lanes)
        else:
            for i in range(above):
                _subtract(entries, starts[path[start + i]], i, one, lanes)
        number -= 1


@inner
def _take_pivot(
    plan: Plan, entries: Floats, number: int, row: Row, pivots: Floats, lanes: int
) -> None:
    """Note a row of G and its pivot, and make it a row of L."""
    own, shares = row
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


@inner
def _subtract(entries: Floats, top: int, i: int, row: Row, lanes: int) -> None:
    """Take off the row of channel i of a path, which starts at ``top``, what is ``row``'s."""
    own, shares = row
    for k in range(i + 1):
        for p in range(lanes):
            entries[top + k, p] -= shares[i, p] * own[k, p]


@inner
def _subtract_both(entries: Floats, top: int, i: int, one: Row, other: Row, lanes: int) -> None:
    """``_subtract`` of ``one``, then of ``other``."""
    own, shares = one
    own_2, shares_2 = other
    for k in range(i + 1):
        for p in range(lanes):
            left = entries[top + k, p] - shares[i, p] * own[k, p]
            entries[top + k, p] = left - shares_2[i, p] * own_2[k, p]


@inner
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
    found = 1.2796 - 0.2929 * value
    for _ in (0, 1, 2, 3):
        found = found * (1.5 - 0.5 * value * found * found)
    return found * scale
