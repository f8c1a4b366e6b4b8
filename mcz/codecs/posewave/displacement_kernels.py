"""Compiled: contacts in a stream: when they are, and how their points move.

SPEC.md, "Held contacts", is normative. One function serves encoder and decoder. Imported on first
use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.coding.mixing import ENCODING, code_adaptive, code_mixed
from mcz.codecs.posewave import head_kernels as head
from mcz.codecs.posewave.contact_plan import START_UNITS
from mcz.codecs.posewave.head_kernels import code_number
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Floats3, Ints, Ints2

# Kinds of numbers, each with contexts of its own in ``code_number``.
COUNT, GAP, LENGTH, START, ESCAPE = range(5)
N_SIZES, N_BITS = 16, 16  # classes of magnitudes; bits of a magnitude before it escapes
C_FAST = head.N_CONTEXTS
C_SLOW = C_FAST + N_SIZES * N_BITS
C_OTHER = C_SLOW + N_SIZES * N_BITS
C_SIGN = C_OTHER + N_SIZES * N_BITS
C_MOVED = C_SIGN + 8
N_CONTEXTS = C_MOVED + 1

MAX_DISPLACEMENT = 1 << 30  # in steps
N_FEATURES = 9
DECAY = 255.0 / 256.0
RIDGE = 64.0
FARTHEST = 4096.0  # steps of a frame's movement


class Learner(NamedTuple):
    """Adaptive statistics of point displacements, per axis.

    ``squares`` (3, 9, 9) and ``products`` (3, 9) of features; ``weights`` (3, 9); ``usual`` (7,),
    what they begin with; ``sizes`` (3, 2) of residuals, fast and slow; ``features`` (3, 9) and
    ``means`` (3,) of the next move; ``scratch`` (11, 9).
    """

    squares: Floats3
    products: Floats2
    weights: Floats2
    usual: Floats
    sizes: Floats2
    features: Floats2
    means: Floats
    scratch: Floats2


class Track(NamedTuple):
    """The contacts of a point, frame by frame.

    ``stands`` (n_frames,) is 1 in the first frame of a contact, 2 in the others; ``starts``
    (n_frames, 3), how far the contact begins from the decoded place, in ``START_UNITS`` of a step;
    ``moves`` (n_frames, 3), displacements from there, in steps.
    """

    stands: Ints
    starts: Ints2
    moves: Ints2


class Leader(NamedTuple):
    """The point that another follows: ``stands``, and how far it is shifted, (n_frames, 3)."""

    stands: Ints
    shifts: Floats2


@kernel
def code_point(
    state: Ints,
    data: Bytes,
    learner: Learner,
    places: Floats2,
    step: float,
    contacts: Track,
    leader: Leader,
    target: Floats2,
    radii: Floats,
) -> int:
    """Code the contacts of a point in place; return -1, or the frame of a fault.

    ``places`` (n_frames + 2, 3), the first and the last of them twice, ``target`` (n_frames, 3),
    displacements, and ``radii`` (n_frames,) are in length units. An encoder chooses cheap
    displacements no farther than ``radii`` from ``target``.
    """
    stands, starts, moves = contacts.stands, contacts.starts, contacts.moves
    n_frames, before = len(stands), 0
    place = np.zeros((n_frames + 2, 3))
    for f in range(n_frames + 2):
        for i in range(3):
            place[f, i] = places[f, i] / step
    goals, anchor = np.zeros((len(target), 3)), np.zeros(3)
    for f in range(len(target)):
        for i in range(3):
            goals[f, i] = target[f, i] / step
    count = 0
    if state[ENCODING]:
        for f in range(n_frames):
            count += 1 if stands[f] == 1 else 0
    count = code_number(state, data, 0, COUNT, count)
    if count < 0 or count > n_frames:  # HOLD-09
        return 0
    for _ in range(count):
        first = length = 0
        if state[ENCODING]:
            first = _next_first(stands, before)
            length = _length(stands, first)
        first = before + code_number(state, data, 0, GAP, first - before)
        length = 1 + code_number(state, data, 0, LENGTH, length - 1)
        if first < before or length < 1 or first + length > n_frames:  # HOLD-10
            return before
        for t in range(length):
            stands[first + t] = 2 if t else 1
        fault = _code_start(state, data, starts[first])
        for i in range(3):
            anchor[i] = place[first + 1, i] + starts[first, i] / START_UNITS
        for t in range(1, length):
            if fault == 0:
                at = first + t
                _note_features(learner, place, anchor, moves, first, t)
                _note_leader(learner, leader, at, step)
                for axis in range(3):
                    learner.means[axis] = _expect(learner, axis, learner.features[axis])  # HOLD-12
                if state[ENCODING]:
                    _choose(learner, moves[at - 1], goals[at], radii[at] / step, moves[at])
                fault = _code_move(state, data, learner, moves[at - 1], moves[at])
        if fault:
            return first
        before = first + length
    return -1


def _next_first(stands: Ints, before: int) -> int:
    first = before
    while stands[first] != 1:
        first += 1
    return first


def _length(stands: Ints, first: int) -> int:
    length = 1
    while first + length < len(stands) and stands[first + length] == 2:
        length += 1
    return length


def _code_start(state: Ints, data: Bytes, move: Ints) -> int:
    """Code the displacement that a contact begins with."""
    moved = 1 if move[0] != 0 or move[1] != 0 or move[2] != 0 else 0
    if code_adaptive(state, data, moved, C_MOVED):
        for i in range(3):
            value = code_number(state, data, 0, START, move[i])
            if abs(value) > MAX_DISPLACEMENT:  # HOLD-11
                return 1
            move[i] = value
    return 0


def _code_move(state: Ints, data: Bytes, learner: Learner, last: Ints, move: Ints) -> int:
    """Code a displacement after the ``last`` in place; 1 where it is too large."""
    other, odd = 0.0, 0
    for axis in range(3):
        mean = learner.means[axis] + last[axis]
        middle = _nearest(mean, axis, odd)
        unit = 1 if axis == 0 else 2
        side = int(np.floor((mean - middle) * 4.0 / unit)) + 2  # 0 to 4
        residual = (move[axis] - middle) // unit
        coded = _code_residual(state, data, residual, learner.sizes[axis], other, side)
        move[axis] = middle + unit * coded
        if abs(move[axis]) > MAX_DISPLACEMENT:  # HOLD-13
            return 1
        odd = move[0] & 1
        size = float(min(abs(coded), 1024))
        other = size if axis == 0 else 0.5 * (other + size)
        learner.sizes[axis, 0] += (size - learner.sizes[axis, 0]) * 0.25
        learner.sizes[axis, 1] += (size - learner.sizes[axis, 1]) * 0.03125
        _learn(learner, axis, learner.features[axis], float(move[axis] - last[axis]))
    return 0


def _nearest(value: float, axis: int, odd: int) -> int:
    """The integer next to ``value``; for y and z with the parity of x."""
    if axis == 0:
        return int(np.floor(value + 0.5))
    return 2 * int(np.floor((value - odd) * 0.5 + 0.5)) + odd


def _limit(value: float) -> float:
    return min(max(value, -FARTHEST), FARTHEST)


def _note_features(
    learner: Learner, places: Floats2, anchor: Floats, moves: Ints2, first: int, t: int
) -> None:
    """Set features: the last three moves, the decoded ones around them, and the distance left.

    ``places[f + 1]`` is where it is in frame f.
    """
    at, features = first + t, learner.features
    for axis in range(3):
        for back in range(3):
            moved = 0.0
            if t > back + 1:
                moved = float(moves[at - 1 - back, axis] - moves[at - 2 - back, axis])
            features[axis, back] = _limit(moved)
            features[axis, 3 + back] = _limit(places[at + back, axis] - places[at + back - 1, axis])
        features[axis, 6] = _limit(anchor[axis] + moves[at - 1, axis] - places[at, axis])


def _note_leader(learner: Learner, leader: Leader, at: int, step: float) -> None:
    """Set features: the change of the shift of this point's leader, and its last value."""
    stands, shifts = leader.stands, leader.shifts
    features = learner.features
    for axis in range(3):
        features[axis, 7], features[axis, 8] = 0.0, 0.0
        if stands[at] == 2:
            features[axis, 7] = _limit((shifts[at, axis] - shifts[at - 1, axis]) / step)
            features[axis, 8] = _limit(shifts[at - 1, axis] / step - features[axis, 6])


def _expect(learner: Learner, axis: int, features: Floats) -> float:
    mean = 0.0
    for i in range(N_FEATURES):
        mean += learner.weights[axis, i] * features[i]
    return _limit(mean)


def _learn(learner: Learner, axis: int, features: Floats, moved: float) -> None:
    """Weights of least squares, drawn to the usual ones."""
    rest = _limit(moved)
    for i in range(N_FEATURES):
        rest -= learner.usual[i] * features[i]
    squares, products = learner.squares[axis], learner.products[axis]
    for i in range(N_FEATURES):
        products[i] = products[i] * DECAY + rest * features[i]
        for k in range(i + 1):
            squares[i, k] = squares[i, k] * DECAY + features[i] * features[k]
    _solve(squares, products, learner.weights[axis], learner.scratch)
    for i in range(N_FEATURES):
        learner.weights[axis, i] += learner.usual[i]


def _solve(squares: Floats2, products: Floats, solution: Floats, scratch: Floats2) -> None:
    """(squares + ridge) found = products, by L D L'; row 9 of ``scratch`` has D."""
    for i in range(N_FEATURES):
        for k in range(i + 1):
            entry = squares[i, k] + (RIDGE if i == k else 0.0)
            for n in range(k):
                entry -= scratch[i, n] * scratch[k, n] * scratch[N_FEATURES, n]
            if i == k:
                scratch[N_FEATURES, i] = max(entry, RIDGE)
            else:
                scratch[i, k] = entry / scratch[N_FEATURES, k]
    for i in range(N_FEATURES):
        entry = products[i]
        for n in range(i):
            entry -= scratch[i, n] * scratch[N_FEATURES + 1, n]
        scratch[N_FEATURES + 1, i] = entry
    for back in range(N_FEATURES):
        i = N_FEATURES - 1 - back
        entry = scratch[N_FEATURES + 1, i] / scratch[N_FEATURES, i]
        for n in range(i + 1, N_FEATURES):
            entry -= scratch[n, i] * solution[n]
        solution[i] = entry


def _choose(learner: Learner, before: Ints, target: Floats, radius: float, chosen: Ints) -> None:
    """Choose the cheapest displacement near ``target``, given the expected one."""
    best = -1.0
    for place in range(54):
        odd = place // 27
        x = 2 * int(np.floor((target[0] - odd) * 0.5 + 0.5)) + odd + 2 * (place % 3 - 1)
        y = _nearest(target[1], 1, odd) + 2 * (place // 3 % 3 - 1)
        z = _nearest(target[2], 2, odd) + 2 * (place // 9 % 3 - 1)
        a, b, c = target[0] - x, target[1] - y, target[2] - z
        off = a * a + b * b + c * c
        cost = abs(x - before[0] - learner.means[0]) / (1.0 + learner.sizes[0, 0])
        cost += abs(y - before[1] - learner.means[1]) / (2.0 + 2.0 * learner.sizes[1, 0])
        cost += abs(z - before[2] - learner.means[2]) / (2.0 + 2.0 * learner.sizes[2, 0])
        if off > radius * radius:
            cost += 1e6 * off
        if best < 0.0 or cost < best:
            best = cost
            chosen[0], chosen[1], chosen[2] = x, y, z


def _class_of(size: float) -> int:
    """0 to 15, about two to an octave of a mean magnitude."""
    index, limit = 0, 0.1
    while size > limit and index < N_SIZES - 1:
        limit = limit * 1.5
        index += 1
    return index


def _code_residual(
    state: Ints, data: Bytes, residual: int, sizes: Floats, other: float, side: int
) -> int:
    """Code an integer: its magnitude in unary, its sign."""
    a = C_FAST + N_BITS * _class_of(sizes[0])
    b = C_SLOW + N_BITS * _class_of(sizes[1])
    c = C_OTHER + N_BITS * _class_of(other)
    magnitude, size = abs(residual), 0
    while size < N_BITS:
        more = 1 if magnitude > size else 0
        if not code_mixed(state, data, more, size, a + size, b + size, c + size):
            break
        size += 1
    if size == N_BITS:
        more = code_number(state, data, 0, ESCAPE, magnitude - N_BITS)
        size = N_BITS + more if 0 <= more < MAX_DISPLACEMENT else 4 * MAX_DISPLACEMENT
    if size == 0:
        return 0
    negative = code_adaptive(state, data, 1 if residual < 0 else 0, C_SIGN + side)
    return -size if negative else size
