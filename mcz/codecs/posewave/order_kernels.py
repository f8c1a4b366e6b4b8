"""Compiled: Euler angles in another order of axes, and which of their solutions is taken.

SPEC.md, "Axis orders", is normative. Arrays of ``angles``, (n_frames, 3), have a column an axis: x,
y, z. A sequence (3,) has the axes as their rotations are multiplied from the left. Imported on
first use only.

Two solutions turn alike: (a, b, c) and (a + half, half - b, c + half), half a turn each. The first
is the one whose b is within a quarter turn of 0; ``told`` (n_frames, 4) says where the other rule
is left: 1 for a switch, then whole turns about x, y and z.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.trigonometry import Rule, angle_of, sine_cosine
from mcz.kernels import kernel
from mcz.kernels.types import FloatColumns, Floats, Floats2, IntColumns, Ints

LATE = 0.75  # of a turn: so far from the source an encoder tells a turn


@kernel
def reorder_axes(angles: Floats2, old_order: Ints, order: Ints, rule: Rule) -> None:
    """Convert angles from sequence ``given`` to ``wanted``, in place: the first solution."""
    m = np.empty(9)
    i, j, k = order[0], order[1], order[2]
    e = 1.0 if (j - i + 3) % 3 == 1 else -1.0
    for row in angles:
        for n in range(9):
            m[n] = 1.0 if n % 4 == 0 else 0.0
        for p in range(3):
            sine, cosine = sine_cosine(row[old_order[p]], rule)
            _rotate(m, (old_order[p] + 1) % 3, (old_order[p] + 2) % 3, sine, cosine)
        first = angle_of(-e * m[3 * j + k], m[4 * k], rule)
        # What is left when the first is undone has no small numbers in it, also where cos b is 0.
        sine, cosine = sine_cosine(first, rule)
        sine = e * sine
        row[i] = first
        row[j] = angle_of(e * m[3 * i + k], cosine * m[4 * k] - sine * m[3 * j + k], rule)
        up = e * (cosine * m[3 * j + i] + sine * m[3 * k + i])
        row[k] = angle_of(up, cosine * m[4 * j] + sine * m[3 * k + j], rule)


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
