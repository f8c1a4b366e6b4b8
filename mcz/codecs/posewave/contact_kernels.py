"""Compiled: where the point of a limb is, and the angles that bring it to a place.

SPEC.md, "Held contacts", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.contact_plan import Limb
from mcz.codecs.posewave.skeleton_plan import Floats, Plan
from mcz.codecs.posewave.turns import BEYOND, sine_cosine
from mcz.jit import inner, kernel

# Axes of the joints of a path, (n_path + 1, 9), and their origins, (n_path + 1, 3), of which 0 is
# what the root hangs from; of each channel of the chain what it turns about and where, a row each.
Work = tuple[Floats, Floats, Floats]

DAMPING = 2.0**-14  # of the mean square of what moves the point
LEAST_DAMPING = 2.0**-100
GREATEST_TURN = 0.25  # of a channel, in radians
SETTLING = 3  # rounds at the end that leave alone what does not move the point


@kernel
def place(plan: Plan, limb: Limb, values: Floats, first: int, found: Floats) -> None:
    """Fill ``found`` (n_frames, 3): where the point is in the frames from ``first`` on."""
    n_path, n_chain = len(limb.joints), len(limb.columns)
    work = np.zeros((n_path + 1, 9)), np.zeros((n_path + 1, 3)), np.zeros((n_chain, 6))
    none = np.zeros(n_chain)
    _hold_root(limb, work)
    for n in range(len(found)):
        _place_joints(plan, limb, values[first + n], none, work, 0, n_path)
        found[n, 0], found[n, 1], found[n, 2] = _point(limb, work)


@kernel
def correct(
    plan: Plan, limb: Limb, values: Floats, first: int, places: Floats, rounds: int, fades: Floats
) -> None:
    """Bring the point to ``places`` (n_frames, 3) in the frames from ``first`` on, in place.

    ``fades`` (2, n_chain) gets the corrections of the first frame and of the last.
    """
    n_path, n_chain = len(limb.joints), len(limb.columns)
    work = np.zeros((n_path + 1, 9)), np.zeros((n_path + 1, 3)), np.zeros((n_chain, 6))
    turns, pulls, square, pull = np.zeros(n_chain), np.zeros((n_chain, 3)), np.zeros(6), np.zeros(3)
    _hold_root(limb, work)
    for n in range(len(places)):
        row = values[first + n]
        _place_joints(plan, limb, row, turns, work, 0, limb.fixed)
        for turn in range(rounds):
            _place_joints(plan, limb, row, turns, work, limb.fixed, n_path)
            x, y, z = _point(limb, work)
            pull[0], pull[1], pull[2] = places[n, 0] - x, places[n, 1] - y, places[n, 2] - z
            _note_pulls(work[2], x, y, z, pulls, square)
            _improve(plan, turns, pulls, square, pull, 1 if turn < rounds - SETTLING else 0)
        for k in range(n_chain):
            row[limb.columns[k]] += turns[k]
            fades[1, k] = turns[k]
            if n == 0:
                fades[0, k] = turns[k]


@inner
def _hold_root(limb: Limb, work: Work) -> None:
    axes, origins, _ = work
    axes[0, 0], axes[0, 4], axes[0, 8] = 1.0, 1.0, 1.0
    for i in range(3):
        origins[0, i] = limb.base[i]


@inner
def _place_joints(
    plan: Plan, limb: Limb, row: Floats, turns: Floats, work: Work, start: int, stop: int
) -> None:
    """Place the joints ``start`` to ``stop`` - 1 of the path, corrected by ``turns``."""
    axes, origins, spins = work
    for at in range(start, stop):
        joint = limb.joints[at]
        above, own, origin = axes[at], axes[at + 1], origins[at + 1]
        x, y, z = plan.arms[joint, 0], plan.arms[joint, 1], plan.arms[joint, 2]
        for i in range(3):
            way = above[3 * i] * x + above[3 * i + 1] * y + above[3 * i + 2] * z
            origin[i] = origins[at, i] + way
        for move in range(plan.move_starts[joint], plan.move_starts[joint + 1]):
            value = row[plan.moves[move, 0]]
            value = value if abs(value) < BEYOND else 0.0
            x, y, z = plan.directions[move, 0], plan.directions[move, 1], plan.directions[move, 2]
            for i in range(3):
                way = above[3 * i] * x + above[3 * i + 1] * y + above[3 * i + 2] * z
                origin[i] += value * way
        for i in range(3):
            for k in range(3):
                x, y = plan.changes[joint, 0, k], plan.changes[joint, 1, k]
                z = plan.changes[joint, 2, k]
                own[3 * i + k] = above[3 * i] * x + above[3 * i + 1] * y + above[3 * i + 2] * z
        for turn in range(plan.turn_starts[joint], plan.turn_starts[joint + 1]):
            axis, column = plan.turns[turn, 0], plan.turns[turn, 1]
            angle, number = row[column], limb.order[column]
            if number >= 0:
                angle = angle + turns[number]
                for i in range(3):
                    spins[number, i] = own[3 * i + axis] * plan.rule.radians
                    spins[number, 3 + i] = origin[i]
            sine, cosine = sine_cosine(angle, plan.rule)
            _mix(own, (axis + 1) % 3, (axis + 2) % 3, sine, cosine)


@inner
def _mix(axes: Floats, j: int, k: int, sine: float, cosine: float) -> None:
    for i in range(3):
        one, other = axes[3 * i + j], axes[3 * i + k]
        axes[3 * i + j] = one * cosine + other * sine
        axes[3 * i + k] = other * cosine - one * sine


@inner
def _point(limb: Limb, work: Work) -> tuple[float, float, float]:
    axes, origins, _ = work
    last = len(limb.joints)
    own, origin = axes[last], origins[last]
    x, y, z = limb.tail[0], limb.tail[1], limb.tail[2]
    return (
        origin[0] + (own[0] * x + own[1] * y + own[2] * z),
        origin[1] + (own[3] * x + own[4] * y + own[5] * z),
        origin[2] + (own[6] * x + own[7] * y + own[8] * z),
    )


@inner
def _note_pulls(spins: Floats, x: float, y: float, z: float, pulls: Floats, square: Floats) -> None:
    """How each channel of the chain moves the point, J, and J J', damped: xx yy zz xy xz yz."""
    for i in range(6):
        square[i] = 0.0
    for n in range(len(spins)):
        u, v, w = spins[n, 0], spins[n, 1], spins[n, 2]
        a, b, c = x - spins[n, 3], y - spins[n, 4], z - spins[n, 5]
        d, e, f = v * c - w * b, w * a - u * c, u * b - v * a
        pulls[n, 0], pulls[n, 1], pulls[n, 2] = d, e, f
        square[0] += d * d
        square[1] += e * e
        square[2] += f * f
        square[3] += d * e
        square[4] += d * f
        square[5] += e * f


@inner
def _improve(
    plan: Plan, turns: Floats, pulls: Floats, square: Floats, pull: Floats, anew: int
) -> None:
    """Better ``turns`` of the chain; ``anew``: the least ones that do it, not the nearest."""
    a, b, c = pull[0], pull[1], pull[2]
    if anew:
        for n in range(len(turns)):
            a += pulls[n, 0] * turns[n]
            b += pulls[n, 1] * turns[n]
            c += pulls[n, 2] * turns[n]
    damping = DAMPING * (square[0] + square[1] + square[2]) + LEAST_DAMPING
    # (J J' + damping) = L' D L with ones on the diagonal of L; no pivot is below the damping.
    one = square[0] + damping
    xy, xz = square[3] / one, square[4] / one
    two = max(square[1] + damping - xy * square[3], damping)
    rest = square[5] - xy * square[4]
    yz = rest / two
    three = max(square[2] + damping - xz * square[4] - yz * rest, damping)
    b = b - xy * a
    c = (c - xz * a - yz * b) / three
    b = b / two - yz * c
    a = a / one - xy * b - xz * c
    most = GREATEST_TURN / plan.rule.radians if plan.rule.radians > 0.0 else 0.0
    for n in range(len(turns)):
        turn = pulls[n, 0] * a + pulls[n, 1] * b + pulls[n, 2] * c
        turn = turn if anew else turns[n] + turn
        turns[n] = min(max(turn, -most), most)
