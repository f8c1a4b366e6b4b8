"""Compiled: poses of a batch of frames, and the composite inertia of every joint.

SPEC.md, "Pose metric", is normative. Arrays end in an axis of ``width`` lanes, one a frame, and
every innermost loop goes over ``lanes``, which is the same number: compilers make vectors of it.
``parts`` (n, width) are the numbers of a turn by a rotation vector or a quaternion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.posewave.skeleton_plan import MAX_PATH, QUATERNION, Plan
from mcz.codecs.posewave.trigonometry import BEYOND, LONGEST, VECTOR, exponential, sine_cosine
from mcz.kernels.types import Floats, Floats2, Floats3


class Lanes(NamedTuple):
    """Scratch space for ``width`` poses at a time.

    ``sines`` (n_turns, width), angles first; ``cosines``, likewise; ``scratch`` (9, width);
    ``axes`` (n_joints + 1, 9, width) and ``origins`` (n_joints + 1, 3, width), index 0 being the
    parent of roots; ``motions`` (n_kept, 6, width), what one unit of a channel does. Of the metric:
    ``inertia`` (n_joints, 10, width) and ``force`` (6, width); ``own`` and ``shares`` (MAX_PATH,
    width), entries of G, last 1 / D, and of L, and the same of a second row; ``entries``
    (n_entries, width) and ``pivots`` (n_kept * width,).
    """

    sines: Floats2
    cosines: Floats2
    scratch: Floats2
    axes: Floats3
    origins: Floats3
    motions: Floats3
    inertia: Floats3
    force: Floats2
    own: Floats2
    shares: Floats2
    own_2: Floats2
    shares_2: Floats2
    entries: Floats2
    pivots: Floats


def lanes_of(plan: Plan, width: int) -> Lanes:
    """Room for ``width`` poses of a skeleton."""
    n_joints, n_turns, n_kept = len(plan.parents), len(plan.turns), len(plan.joints)
    return Lanes(
        sines=np.empty((n_turns, width)),
        cosines=np.empty((n_turns, width)),
        scratch=np.empty((9, width)),
        axes=np.empty((n_joints + 1, 9, width)),
        origins=np.empty((n_joints + 1, 3, width)),
        motions=np.zeros((n_kept, 6, width)),
        inertia=np.empty((n_joints, 10, width)),
        force=np.empty((6, width)),
        own=np.empty((MAX_PATH, width)),
        shares=np.empty((MAX_PATH, width)),
        own_2=np.empty((MAX_PATH, width)),
        shares_2=np.empty((MAX_PATH, width)),
        entries=np.empty((plan.n_entries, width)),
        pivots=np.empty(n_kept * width),
    )


def take_values(columns: Floats2, column: int, first: int, values: Floats, lanes: int) -> None:
    """Read a column from frame ``first`` on; repeat the last frame past the end."""
    last = len(columns) - 1
    for p in range(lanes):
        value = columns[min(first + p, last), column]
        values[p] = value if abs(value) < BEYOND else 0.0


def place_joints(plan: Plan, columns: Floats2, first: int, batch: Lanes, lanes: int) -> None:
    """Place the joints of the frames from ``first`` on; ``columns`` (n_frames, n_channels)."""
    axes, origins = batch.axes, batch.origins
    _take_turns(plan, columns, first, batch.sines, batch.cosines, lanes)
    for p in range(lanes):
        for i in range(9):
            axes[0, i, p] = 1.0 if i % 4 == 0 else 0.0
        for i in range(3):
            origins[0, i, p] = 0.0
    for joint in range(len(plan.parents)):
        parent = plan.parents[joint]
        _attach(axes[parent + 1], origins[parent + 1], plan.arms[joint], origins[joint + 1], lanes)
        _move(plan, joint, columns, first, batch, lanes)
        _turn(plan, joint, batch, lanes)


def _take_turns(
    plan: Plan, columns: Floats2, first: int, angles: Floats2, cosines: Floats2, lanes: int
) -> None:
    for turn in range(len(plan.turns)):
        take_values(columns, plan.turns[turn, 1], first, angles[turn], lanes)
        if plan.turns[turn, 0] < QUATERNION:
            for p in range(lanes):
                angles[turn, p], cosines[turn, p] = sine_cosine(angles[turn, p], plan.rule)


def _attach(above: Floats2, origin: Floats2, arm: Floats, own: Floats2, lanes: int) -> None:
    x, y, z = arm[0], arm[1], arm[2]
    for i in range(3):
        for p in range(lanes):
            way = above[3 * i, p] * x + above[3 * i + 1, p] * y + above[3 * i + 2, p] * z
            own[i, p] = origin[i, p] + way


def _move(plan: Plan, joint: int, columns: Floats2, first: int, batch: Lanes, lanes: int) -> None:
    """Move a joint by its position channels; a root stays where it is."""
    scratch, axes, origins, motions = batch.scratch, batch.axes, batch.origins, batch.motions
    above, origin = axes[plan.parents[joint] + 1], origins[joint + 1]
    for move in range(plan.move_starts[joint], plan.move_starts[joint + 1]):
        column, number = plan.moves[move]
        take_values(columns, column, first, scratch[3], lanes)
        x, y, z = plan.directions[move]
        for i in range(3):
            for p in range(lanes):
                scratch[i, p] = (
                    above[3 * i, p] * x + above[3 * i + 1, p] * y + above[3 * i + 2, p] * z
                )
        if plan.parents[joint] >= 0:
            for i in range(3):
                for p in range(lanes):
                    origin[i, p] += scratch[3, p] * scratch[i, p]
        if number >= 0:
            for i in range(3):
                for p in range(lanes):
                    motions[number, i, p] = 0.0
                    motions[number, 3 + i, p] = scratch[i, p]


def _turn(plan: Plan, joint: int, batch: Lanes, lanes: int) -> None:
    """Turn a joint by its channels, from the outermost to the innermost."""
    sines, own, motions = batch.sines, batch.scratch, batch.motions
    axes, origins = batch.axes, batch.origins
    origin = origins[joint + 1]
    _change(axes[plan.parents[joint] + 1], plan.changes[joint], own, lanes)
    turn, stop = plan.turn_starts[joint], plan.turn_starts[joint + 1]
    while turn < stop:
        axis = plan.turns[turn, 0]
        if axis == QUATERNION:
            turn_by_quaternion(plan, turn, sines, own, origin, motions, lanes)
            turn += 4
        elif axis == VECTOR:
            turn_by_vector(plan, turn, sines, own, origin, motions, lanes)
            turn += 3
        else:
            _turn_about(plan, turn, batch, origin, lanes)
            turn += 1
    for i in range(9):
        for p in range(lanes):
            axes[joint + 1, i, p] = own[i, p]


def _turn_about(plan: Plan, turn: int, batch: Lanes, origin: Floats2, lanes: int) -> None:
    """Turn a joint's axes about one of them, and store the channel's effect."""
    sines, cosines = batch.sines, batch.cosines
    own, motions = batch.scratch, batch.motions
    axis, number = plan.turns[turn, 0], plan.turns[turn, 2]
    if number >= 0:
        _note_turn(own, axis, plan.rule.radians, origin, motions[number], lanes)
    if axis == 0:  # vectors are made only where it is known which columns these are
        _mix(own, 1, 2, sines[turn], cosines[turn], lanes)
    elif axis == 1:
        _mix(own, 2, 0, sines[turn], cosines[turn], lanes)
    else:
        _mix(own, 0, 1, sines[turn], cosines[turn], lanes)


def _change(above: Floats2, change: Floats2, own: Floats2, lanes: int) -> None:
    for i in range(3):
        for k in range(3):
            x, y, z = change[0, k], change[1, k], change[2, k]
            for p in range(lanes):
                own[3 * i + k, p] = (
                    above[3 * i, p] * x + above[3 * i + 1, p] * y + above[3 * i + 2, p] * z
                )


def _note_turn(
    axes: Floats2, axis: int, radians: float, origin: Floats2, motion: Floats2, lanes: int
) -> None:
    """Write the effect of one unit of a rotation: the turn, and the motion at the root."""
    for p in range(lanes):
        x, y, z = axes[axis, p] * radians, axes[axis + 3, p] * radians, axes[axis + 6, p] * radians
        a, b, c = origin[0, p], origin[1, p], origin[2, p]
        motion[0, p] = x
        motion[1, p] = y
        motion[2, p] = z
        motion[3, p] = b * z - c * y
        motion[4, p] = c * x - a * z
        motion[5, p] = a * y - b * x


def _mix(axes: Floats2, j: int, k: int, sines: Floats, cosines: Floats, lanes: int) -> None:
    for p in range(lanes):
        sine, cosine = sines[p], cosines[p]
        for i in range(3):
            one, other = axes[3 * i + j, p], axes[3 * i + k, p]
            axes[3 * i + j, p] = one * cosine + other * sine
            axes[3 * i + k, p] = other * cosine - one * sine


def gather_inertia(
    plan: Plan, axes: Floats3, origins: Floats3, inertia: Floats3, lanes: int
) -> None:
    """Fill ``inertia`` (n_joints, 10, width) with all that a joint moves, about its root."""
    n_joints = len(plan.parents)
    for joint in range(n_joints):
        _own_inertia(plan.masses[joint], axes[joint + 1], origins[joint + 1], inertia[joint], lanes)
    for back in range(n_joints):
        joint = n_joints - 1 - back
        parent = plan.parents[joint]
        if parent >= 0:
            for i in range(10):
                for p in range(lanes):
                    inertia[parent, i, p] += inertia[joint, i, p]


def _own_inertia(
    mass: Floats, axes: Floats2, origin: Floats2, inertia: Floats2, lanes: int
) -> None:
    m, mx, my, mz = mass[0], mass[1], mass[2], mass[3]
    xx, yy, zz, xy, xz, yz = mass[4], mass[5], mass[6], mass[7], mass[8], mass[9]
    for p in range(lanes):
        a, b, c = axes[0, p], axes[1, p], axes[2, p]
        d, e, f = axes[3, p], axes[4, p], axes[5, p]
        g, h, i = axes[6, p], axes[7, p], axes[8, p]
        x, y, z = origin[0, p], origin[1, p], origin[2, p]
        # The first moment about the joint's own origin, and about the root's.
        u, v, w = a * mx + b * my + c * mz, d * mx + e * my + f * mz, g * mx + h * my + i * mz
        r, s, t = m * x + u, m * y + v, m * z + w
        # How much more inertia there is about the root than about the joint.
        ax, ay, az = x * r + u * x, y * s + v * y, z * t + w * z
        # B J, then B J B'.
        a0, a1, a2 = a * xx + b * xy + c * xz, a * xy + b * yy + c * yz, a * xz + b * yz + c * zz
        d0, d1, d2 = d * xx + e * xy + f * xz, d * xy + e * yy + f * yz, d * xz + e * yz + f * zz
        g0, g1, g2 = g * xx + h * xy + i * xz, g * xy + h * yy + i * yz, g * xz + h * yz + i * zz
        inertia[0, p] = m
        inertia[1, p] = r
        inertia[2, p] = s
        inertia[3, p] = t
        inertia[4, p] = (a0 * a + a1 * b + a2 * c) + (ay + az)
        inertia[5, p] = (d0 * d + d1 * e + d2 * f) + (ax + az)
        inertia[6, p] = (g0 * g + g1 * h + g2 * i) + (ax + ay)
        inertia[7, p] = (a0 * d + a1 * e + a2 * f) - (x * s + u * y)
        inertia[8, p] = (a0 * g + a1 * h + a2 * i) - (x * t + u * z)
        inertia[9, p] = (d0 * g + d1 * h + d2 * i) - (y * t + v * z)


LEAST = 2.0**-100  # the square of a quaternion's length below which it turns nothing


def turn_by_vector(
    plan: Plan,
    turn: int,
    parts: Floats2,
    own: Floats2,
    origin: Floats2,
    motions: Floats3,
    lanes: int,
) -> None:
    """Turn ``own``, a joint's axes, by the rotation vector whose parts are from ``turn`` on."""
    radians = plan.rule.radians
    for p in range(lanes):
        x, y, z = (
            parts[turn, p] * radians,
            parts[turn + 1, p] * radians,
            parts[turn + 2, p] * radians,
        )
        square = x * x + y * y + z * z
        short = square < LONGEST
        x, y, z = x if short else 0.0, y if short else 0.0, z if short else 0.0
        a, b, c = exponential(square if short else 0.0)
        xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
        u, v, w = (a + c * xx) * radians, (c * xy + b * z) * radians, (c * xz - b * y) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn, 2], p)
        u, v, w = (c * xy - b * z) * radians, (a + c * yy) * radians, (c * yz + b * x) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn + 1, 2], p)
        u, v, w = (c * xz + b * y) * radians, (c * yz - b * x) * radians, (a + c * zz) * radians
        _note(own, u, v, w, origin, motions, plan.turns[turn + 2, 2], p)
        for i in (0, 3, 6):
            d, e, f = own[i, p], own[i + 1, p], own[i + 2, p]
            own[i, p] = (1.0 - b * (yy + zz)) * d + (b * xy + a * z) * e + (b * xz - a * y) * f
            own[i + 1, p] = (b * xy - a * z) * d + (1.0 - b * (xx + zz)) * e + (b * yz + a * x) * f
            own[i + 2, p] = (b * xz + a * y) * d + (b * yz - a * x) * e + (1.0 - b * (xx + yy)) * f


def turn_by_quaternion(
    plan: Plan,
    turn: int,
    parts: Floats2,
    own: Floats2,
    origin: Floats2,
    motions: Floats3,
    lanes: int,
) -> None:
    """Turn ``own``, a joint's axes, by the quaternion whose parts are from ``turn`` on."""
    for p in range(lanes):
        w, x, y, z = parts[turn, p], parts[turn + 1, p], parts[turn + 2, p], parts[turn + 3, p]
        square = w * w + x * x + y * y + z * z
        whole = square >= LEAST
        two = 2.0 / square if whole else 2.0  # POSE-01
        w = w if whole else 1.0
        x, y, z = x if whole else 0.0, y if whole else 0.0, z if whole else 0.0
        a, i, j, k = w * two, x * two, y * two, z * two
        _note(own, -i, -j, -k, origin, motions, plan.turns[turn, 2], p)
        _note(own, a, k, -j, origin, motions, plan.turns[turn + 1, 2], p)
        _note(own, -k, a, i, origin, motions, plan.turns[turn + 2, 2], p)
        _note(own, j, -i, a, origin, motions, plan.turns[turn + 3, 2], p)
        xx, yy, zz, xy, xz, yz = i * x, j * y, k * z, i * y, i * z, j * z
        for row in (0, 3, 6):
            d, e, f = own[row, p], own[row + 1, p], own[row + 2, p]
            own[row, p] = (1.0 - (yy + zz)) * d + (xy + k * w) * e + (xz - j * w) * f
            own[row + 1, p] = (xy - k * w) * d + (1.0 - (xx + zz)) * e + (yz + i * w) * f
            own[row + 2, p] = (xz + j * w) * d + (yz - i * w) * e + (1.0 - (xx + yy)) * f


def _note(
    own: Floats2,
    u: float,
    v: float,
    w: float,
    origin: Floats2,
    motions: Floats3,
    number: int,
    p: int,
) -> None:
    """Write the effect of one unit of a part: a turn by u, v, w, and the root's motion."""
    if number >= 0:
        x = own[0, p] * u + own[1, p] * v + own[2, p] * w
        y = own[3, p] * u + own[4, p] * v + own[5, p] * w
        z = own[6, p] * u + own[7, p] * v + own[8, p] * w
        motions[number, 0, p] = x
        motions[number, 1, p] = y
        motions[number, 2, p] = z
        motions[number, 3, p] = origin[1, p] * z - origin[2, p] * y
        motions[number, 4, p] = origin[2, p] * x - origin[0, p] * z
        motions[number, 5, p] = origin[0, p] * y - origin[1, p] * x
