"""Compiled: where points are, and the least change of a pose that brings them to their places.

SPEC.md, "Held contacts", is normative. How large a change is says the metric of the pose: so no
knee is bent far where the body can move by a hair instead. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.contact_plan import START_UNITS, HeldPoints
from mcz.codecs.posewave.displacement_kernels import Track
from mcz.codecs.posewave.metric_kernels import factor_rows, row_out_of
from mcz.codecs.posewave.pose_kernels import Lanes, place_joints
from mcz.codecs.posewave.pose_kernels import lanes_of as lanes_of
from mcz.codecs.posewave.skeleton_plan import Plan
from mcz.codecs.posewave.trigonometry import BEYOND
from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Floats3, Ints, Ints2

DAMPING = 2.0**-14  # of the trace of the normal equations
LEAST_DAMPING = 2.0**-100
GREATEST_PULL = 2.0**100
LEANING, STANDING = 1, 2  # a point before or after a contact, and in one


@kernel
def place_points(
    plan: Plan, points: HeldPoints, lanes: Lanes, values: Floats2, positions: Floats3
) -> None:
    """Fill ``positions`` (n_points, n_frames, 3) from the frames ``values`` (n_frames, ...)."""
    for n in range(positions.shape[1]):
        place_joints(plan, values, n, lanes, 1)
        for k in range(len(points.joints)):
            _place_point(plan, points, k, values[n], lanes, positions[k, n])


@kernel
def set_shifts(
    places: Floats2, contacts: Track, step: float, ramp: int, shifts: Floats2, active: Ints
) -> None:
    """Set the target shift of a point, at ``places`` (n_frames, 3), and when it applies.

    ``shifts`` (n_frames, 3) and ``active`` (n_frames,) are filled.
    """
    stands, starts, moves = contacts.stands, contacts.starts, contacts.moves
    n_frames, first = len(stands), 0
    for f in range(n_frames):
        if stands[f] == 0:
            continue
        first = f if stands[f] == 1 else first
        active[f] = STANDING
        for i in range(3):
            start = places[first, i] + starts[first, i] / START_UNITS * step
            shifts[f, i] = (start + moves[f, i] * step) - places[f, i]  # HOLD-14
    last = -1 - ramp
    for f in range(n_frames):
        if stands[f] == 1 and (starts[f, 0] != 0 or starts[f, 1] != 0 or starts[f, 2] != 0):
            span = min(ramp, f - 1 - last)
            for n in range(1, min(span, f) + 1):
                _shift_between(f, f - n, 1.0 - n / (span + 1.0), shifts, active)
        if stands[f] != 0 and (f == n_frames - 1 or stands[f + 1] != 2):
            last, span = f, 0
            while span < ramp and (f + span + 1 >= n_frames or stands[f + span + 1] == 0):
                span += 1
            for n in range(1, min(span, n_frames - 1 - f) + 1):
                _shift_between(f, f + n, 1.0 - n / (span + 1.0), shifts, active)


def _shift_between(end: int, f: int, share: float, shifts: Floats2, active: Ints) -> None:
    """Shift a frame outside contacts by a share of the shift at the nearest contact."""
    active[f] = LEANING
    for i in range(3):
        shifts[f, i] += share * shifts[end, i]


@kernel
def correct_poses(
    plan: Plan,
    held_points: HeldPoints,
    lanes: Lanes,
    values: Floats2,
    active: Ints2,
    shifts: Floats3,
    rounds: int,
) -> None:
    """Shift the points in frames ``values`` (n_frames, n_channels), in place.

    ``active`` (n_points, n_frames) is not 0 where a point is to be ``shifts`` (n_points, n_frames,
    3) away from where it is. Points that only lean to a contact are left alone after a round.
    """
    n_points, n_kept = len(held_points.joints), len(plan.joints)
    pose, factors = np.empty((1, values.shape[1])), np.empty((1, len(plan.path)))
    points, goals = np.empty((n_points, 3)), np.empty((n_points, 3))
    pulls, square = np.zeros((3 * n_points, n_kept)), np.zeros((3 * n_points, 3 * n_points))
    targets, pivots = np.zeros(3 * n_points), np.zeros(3 * n_points)
    row, change, total = np.zeros(n_kept), np.zeros(n_kept), np.zeros(n_kept)
    which = np.zeros(n_points, np.int64)
    for n in range(len(values)):
        n_active = _note_active(active, n, LEANING, which)
        if n_active == 0:
            continue
        for c in range(values.shape[1]):
            pose[0, c] = values[n, c]
        for c in range(n_kept):
            total[c] = 0.0
        factor_rows(plan, lanes, pose, factors, 1, 1)
        factor = factors[0]
        n_next = 0
        for turn in range(rounds):
            place_joints(plan, pose, 0, lanes, 1)
            for a in range(n_active):
                k = which[a]
                _place_point(plan, held_points, k, pose[0], lanes, points[k])
                for i in range(3):
                    if turn == 0:
                        goals[k, i] = points[k, i] + shifts[k, n, i]
                    targets[3 * a + i] = goals[k, i] - points[k, i]
                _note_pulls(plan, held_points, k, lanes, factor, pulls[3 * a :])
            if turn == 0:
                n_next = _note_active(active, n, STANDING, which)
            _solve(pulls, targets, square, pivots, 3 * n_active)  # HOLD-15
            for c in range(n_kept):
                row[c] = 0.0
            for a in range(3 * n_active):
                for c in range(n_kept):
                    row[c] += pulls[a, c] * targets[a]
            row_out_of(plan, factor, row, change)
            for c in range(n_kept):
                limit = held_points.limits[c]
                total[c] = min(max(total[c] + change[c], -limit), limit)
                pose[0, held_points.columns[c]] = values[n, held_points.columns[c]] + total[c]
            n_active = n_next
            if n_active == 0:
                break
        for c in range(n_kept):
            values[n, held_points.columns[c]] = pose[0, held_points.columns[c]]


def _note_active(active: Ints2, n: int, least: int, which: Ints) -> int:
    """List the points at least that active in a frame; return their number."""
    n_active = 0
    for k in range(len(active)):
        if active[k, n] >= least:
            which[n_active] = k
            n_active += 1
    return n_active


def _place_point(
    plan: Plan, points: HeldPoints, k: int, row: Floats, lanes: Lanes, point: Floats
) -> None:
    """Compute the position of point ``k``, from its root on, and that of the root."""
    joint, root = points.joints[k], points.roots[k]
    own, origin = lanes.axes[joint + 1], lanes.origins[joint + 1]
    x, y, z = points.tails[k, 0], points.tails[k, 1], points.tails[k, 2]
    for i in range(3):
        way = own[3 * i, 0] * x + own[3 * i + 1, 0] * y + own[3 * i + 2, 0] * z
        point[i] = origin[i, 0] + way
    for move in range(plan.move_starts[root], plan.move_starts[root + 1]):
        value = row[plan.moves[move, 0]]
        value = value if abs(value) < BEYOND else 0.0  # HOLD-01
        for i in range(3):
            point[i] += value * plan.directions[move, i]


def _note_pulls(
    plan: Plan, points: HeldPoints, k: int, lanes: Lanes, factor: Floats, pulls: Floats2
) -> None:
    """Write the Jacobian of point ``k`` in the metric: three rows of J R^-1."""
    joint = points.joints[k]
    own, origin, motions = lanes.axes[joint + 1], lanes.origins[joint + 1], lanes.motions
    x, y, z = points.tails[k, 0], points.tails[k, 1], points.tails[k, 2]
    a = origin[0, 0] + (own[0, 0] * x + own[1, 0] * y + own[2, 0] * z)
    b = origin[1, 0] + (own[3, 0] * x + own[4, 0] * y + own[5, 0] * z)
    c = origin[2, 0] + (own[6, 0] * x + own[7, 0] * y + own[8, 0] * z)
    for i in range(3):
        for number in range(pulls.shape[1]):
            pulls[i, number] = 0.0
    for at in range(points.starts[k], points.starts[k + 1]):
        number = points.chains[at]
        motion = motions[number]
        u, v, w = motion[0, 0], motion[1, 0], motion[2, 0]
        pulls[0, number] = motion[3, 0] + (v * c - w * b)
        pulls[1, number] = motion[4, 0] + (w * a - u * c)
        pulls[2, number] = motion[5, 0] + (u * b - v * a)
    for i in range(3):
        for back in range(points.starts[k + 1] - points.starts[k]):
            number = points.chains[points.starts[k + 1] - 1 - back]
            last = plan.starts[number + 1] - 1
            pull = min(max(pulls[i, number], -GREATEST_PULL), GREATEST_PULL)
            for at in range(plan.starts[number], last):
                pulls[i, plan.path[at]] -= factor[at] * pull
            pulls[i, number] = min(max(pull * factor[last], -GREATEST_PULL), GREATEST_PULL)


def _solve(pulls: Floats2, solution: Floats, square: Floats2, pivots: Floats, n: int) -> None:
    """Solve (pulls pulls' + damping) x = ``solution`` by L D L', in place."""
    trace = 0.0
    for i in range(n):
        for k in range(i + 1):
            entry = 0.0
            for c in range(pulls.shape[1]):
                entry += pulls[i, c] * pulls[k, c]
            square[i, k] = entry
        trace += square[i, i]
    damping = DAMPING * trace + LEAST_DAMPING
    for i in range(n):
        for k in range(i + 1):
            entry = square[i, k] + (damping if i == k else 0.0)
            for m in range(k):
                entry -= square[i, m] * square[k, m] * pivots[m]
            if i == k:
                pivots[i] = max(entry, damping)
            else:
                square[i, k] = entry / pivots[k]
        for k in range(i):
            solution[i] -= square[i, k] * solution[k]
    for back in range(n):
        i = n - 1 - back
        solution[i] = solution[i] / pivots[i]
        for k in range(i + 1, n):
            solution[i] -= square[k, i] * solution[k]
