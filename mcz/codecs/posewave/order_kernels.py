"""Compiled: Euler angles as another order of axes or a vector, and which solution is taken.

SPEC.md, "Axis orders", is normative. Arrays of ``angles``, (n_frames, 3), have a column an axis: x,
y, z. A sequence (3,) has the axes as their rotations are multiplied from the left; that of a
rotation vector is VECTOR three times. Imported on first use only.

Two solutions turn alike: (a, b, c) and (a + half, half - b, c + half), half a turn each. The first
is the one whose b is within a quarter turn of 0; ``told`` (n_frames, 4) says where the other rule
is left: 1 for a switch, then whole turns about x, y and z.
"""

from __future__ import annotations

import math

import numpy as np

from mcz.codecs.posewave.trigonometry import (
    BEYOND,
    LONGEST,
    VECTOR,
    Rule,
    angle_of,
    exponential,
    sine_cosine,
)
from mcz.kernels import kernel
from mcz.kernels.types import FloatColumns, Floats, Floats2, IntColumns, Ints

LONGEST_TURNS = 2.5  # of a vector, which turns nothing from 16 radians on
LATE = 0.75  # of a turn: so far from the source an encoder tells a turn


@kernel
def reorder_axes(angles: Floats2, old_order: Ints, order: Ints, rule: Rule) -> None:
    """Convert angles from ``old_order`` to ``order`` in place: the first solution."""
    m = np.empty(9)
    i, j, k = order[0], order[1], order[2]
    e = 1.0 if (j - i + 3) % 3 == 1 else -1.0
    for row in angles:
        _fill_matrix(m, row, old_order, rule)
        first = angle_of(-e * m[3 * j + k], m[4 * k], rule)
        # What is left when the first is undone has no small numbers in it, also where cos b is 0.
        sine, cosine = sine_cosine(first, rule)
        sine = e * sine
        row[i] = first
        row[j] = angle_of(e * m[3 * i + k], cosine * m[4 * k] - sine * m[3 * j + k], rule)
        up = e * (cosine * m[3 * j + i] + sine * m[3 * k + i])
        row[k] = angle_of(up, cosine * m[4 * j] + sine * m[3 * k + j], rule)


def _fill_matrix(m: Floats, row: Floats, order: Ints, rule: Rule) -> None:
    """Write the rotation by the angles of a sequence, or by a rotation vector."""
    if order[0] == VECTOR:
        _fill_vector_matrix(m, row, rule.radians)
        return
    for n in range(9):
        m[n] = 1.0 if n % 4 == 0 else 0.0
    for p in range(3):
        sine, cosine = sine_cosine(row[order[p]], rule)
        _rotate(m, (order[p] + 1) % 3, (order[p] + 2) % 3, sine, cosine)


def _fill_vector_matrix(m: Floats, row: Floats, radians: float) -> None:
    x, y, z = _limit(row[0]) * radians, _limit(row[1]) * radians, _limit(row[2]) * radians
    square = x * x + y * y + z * z
    if not square < LONGEST:
        x = y = z = square = 0.0
    a, b, _ = exponential(square)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    m[0], m[1], m[2] = 1.0 - b * (yy + zz), b * xy - a * z, b * xz + a * y
    m[3], m[4], m[5] = b * xy + a * z, 1.0 - b * (xx + zz), b * yz - a * x
    m[6], m[7], m[8] = b * xz - a * y, b * yz + a * x, 1.0 - b * (xx + yy)


def _limit(value: float) -> float:
    return value if abs(value) < BEYOND else 0.0


def _rotate(m: Floats, j: int, k: int, sine: float, cosine: float) -> None:
    for i in (0, 3, 6):
        one, other_solution = m[i + j], m[i + k]
        m[i + j] = one * cosine + other_solution * sine
        m[i + k] = other_solution * cosine - one * sine


def whole_turns(step: float, full: float) -> float:
    """Whole turns in ``step``, as ``mcz.kinematics.angles.turns``."""
    ratio = step / full
    count: float = -np.floor(0.5 - abs(ratio))
    return count if ratio >= 0.0 else -count


def angle_distance(step: float, full: float) -> float:
    """The size of a step, less whole turns."""
    return abs(step - full * whole_turns(step, full))


def other_solution(value: float, p: int, half: float) -> float:
    """Return the p-th angle of the other solution."""
    return half - value if p == 1 else value + half


def is_nearer(row: Floats, before: Floats, sequence: Ints, full: float) -> bool:
    """Return True if the second solution of ``row`` is nearer to the row ``before``."""
    one = two = 0.0
    for p in range(3):
        axis = sequence[p]
        one += angle_distance(row[axis] - before[axis], full)
        two += angle_distance(other_solution(row[axis], p, 0.5 * full) - before[axis], full)
    return two < one


@kernel
def follow_angles(angles: Floats2, sequence: Ints, full: float, notes: IntColumns) -> None:
    """Make first solutions continuous from row to row, in place."""
    before, last, turns = np.zeros(3), np.zeros(3), np.zeros(3)
    second = False
    for f in range(len(angles)):
        row = angles[f]
        if f > 0 and is_nearer(row, before, sequence, full):
            second = not second
        if notes[f, 0] != 0:
            second = not second
        for p in range(3):
            axis = sequence[p]
            value = row[axis]
            before[axis] = value
            value = other_solution(value, p, 0.5 * full) if second else value
            if f > 0:
                turns[axis] -= whole_turns(value - last[axis], full)  # PWAVE-27
            turns[axis] += notes[f, 1 + axis]
            last[axis] = value
            row[axis] = value + full * turns[axis]  # PWAVE-27


@kernel
def follow_vectors(angles: Floats2, sequence: Ints, full: float, rule: Rule) -> None:
    """Convert a sequence of angles to rotation vectors in place, each near the previous one."""
    m, q, before = np.empty(9), np.empty(4), np.zeros(3)
    for row in angles:
        _fill_matrix(m, row, sequence, rule)
        _fill_quaternion(q, m)
        size = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        share = 1.0 / size if size > 0.0 else 0.0
        angle = 2.0 * angle_of(size, q[0], rule)
        along = (before[0] * q[1] + before[1] * q[2] + before[2] * q[3]) * share
        followed = angle + full * whole_turns(along - angle, full)
        if abs(followed) > LONGEST_TURNS * full:
            followed = angle
        for k in range(3):
            before[k] = row[k] = followed * share * q[1 + k]


def _fill_quaternion(q: Floats, m: Floats) -> None:
    """Write a multiple of the quaternion of a rotation, by its largest part."""
    trace = m[0] + m[4] + m[8]
    largest, most = 0, trace
    for k in range(3):
        if 2.0 * m[4 * k] - trace > most:
            largest, most = 1 + k, 2.0 * m[4 * k] - trace
    u, v, w = m[7] - m[5], m[2] - m[6], m[3] - m[1]
    xy, xz, yz = m[1] + m[3], m[2] + m[6], m[5] + m[7]
    if largest == 0:
        q[0], q[1], q[2], q[3] = 1.0 + most, u, v, w
    elif largest == 1:
        q[0], q[1], q[2], q[3] = u, 1.0 + most, xy, xz
    elif largest == 2:
        q[0], q[1], q[2], q[3] = v, xy, 1.0 + most, yz
    else:
        q[0], q[1], q[2], q[3] = w, xz, yz, 1.0 + most


@kernel
def choose_switches(
    angles: Floats2,
    source: FloatColumns,
    sequence: Ints,
    full: float,
    price: float,
    notes: IntColumns,
) -> None:
    """Fill ``notes`` with the switches that bring first solutions ``angles`` near to ``source``.

    Least in all: how far they are off, and ``price`` a switch.
    """
    n_frames = len(angles)
    switched = np.zeros((n_frames, 2), np.int64)
    natural = np.zeros(n_frames, np.int64)
    first = second = 0.0
    for f in range(n_frames):
        one = two = 0.0
        for p in range(3):
            axis = sequence[p]
            one += angle_distance(angles[f, axis] - source[f, axis], full)
            two += angle_distance(
                other_solution(angles[f, axis], p, 0.5 * full) - source[f, axis], full
            )
        if f == 0:
            second = price
        elif is_nearer(angles[f], angles[f - 1], sequence, full):
            natural[f] = 1
            first, second = second, first
        switched[f, 0] = 1 if second + price < first else 0
        switched[f, 1] = 1 if first + price < second or f == 0 else 0
        least = min(first, second) + price
        first, second = one + min(first, least), two + min(second, least)
    state = 1 if second < first else 0
    for back in range(n_frames):
        f = n_frames - 1 - back
        notes[f, 0] = switched[f, state]
        state = (state + notes[f, 0] + natural[f]) % 2


@kernel
def choose_turns(angles: Floats2, source: FloatColumns, full: float, notes: IntColumns) -> None:
    """Fill ``notes`` with the turns that bring ``angles`` as followed near to ``source``."""
    for axis in range(3):
        turns = 0.0
        for f in range(len(angles)):
            away = source[f, axis] - angles[f, axis] - full * turns
            if abs(away) > LATE * full or f == 0:
                more = whole_turns(away, full)
                notes[f, 1 + axis] = int(more)
                turns += more
