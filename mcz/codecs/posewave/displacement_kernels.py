"""Compiled: contacts in a stream: when they are, and how their points move.

SPEC.md, "Held contacts", is normative. One function serves encoder and decoder. Imported on first
use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.posewave import head_kernels as head
from mcz.codecs.posewave.contact_plan import FADE, FINE, FIRST, LEAD, N_FRAMES, USUAL_FADE, X
from mcz.codecs.posewave.head_kernels import code_number
from mcz.codecs.posewave.skeleton_plan import Floats
from mcz.coding.mixing import ENCODING, Bytes, Ints, adaptive, mixed, number
from mcz.jit import inner, kernel

# What a number is about, of the contexts of ``code_number``.
COUNT, GAP, LENGTH, ANCHOR, ESCAPE = range(5)
N_SIZES, N_BITS = 16, 16  # classes of magnitudes; bits of a magnitude before it escapes
C_FAST = head.N_CONTEXTS
C_SLOW = C_FAST + N_SIZES * N_BITS
C_OTHER = C_SLOW + N_SIZES * N_BITS
C_SIGN = C_OTHER + N_SIZES * N_BITS
C_USUAL = C_SIGN + 8
C_FINE = C_USUAL + 1
N_CONTEXTS = C_FINE + 1

FADE_BITS = 4
MAX_DISPLACEMENT = 1 << 30  # in steps
N_FEATURES = 7
DECAY = 255.0 / 256.0
RIDGE = 64.0
FARTHEST = 4096.0  # steps of a frame's movement


class Learner(NamedTuple):
    """What was learned of how points move, axis by axis.

    ``squares`` (3, 7, 7) and ``products`` (3, 7) of features; ``weights`` (3, 7); ``usual`` (7,),
    what they begin with; ``sizes`` (3, 2) of residuals, fast and slow; ``scratch`` (9, 7).
    """

    squares: Floats
    products: Floats
    weights: Floats
    usual: Floats
    sizes: Floats
    scratch: Floats


@kernel
def code_count(state: Ints, data: Bytes, count: int) -> int:
    """Code how many contacts a limb has."""
    return code_number(state, data, 0, COUNT, count)


@kernel
def code_contact(state: Ints, data: Bytes, fields: Ints, before: int, n_frames: int) -> int:
    """Code ``fields`` of a contact in place; 1 where that is impossible.

    ``before`` is the frame after the limb's last contact, ``n_frames`` are those of the segment.
    """
    first = before + code_number(state, data, 0, GAP, fields[FIRST] - before)
    length = 1 + code_number(state, data, 0, LENGTH, fields[N_FRAMES] - 1)
    if first < before or length < 1 or first + length > n_frames:
        return 1
    fields[FIRST], fields[N_FRAMES] = first, length
    usual = 1 if fields[LEAD] == USUAL_FADE and fields[FADE] == USUAL_FADE else 0
    if adaptive(state, data, usual, C_USUAL):
        fields[LEAD], fields[FADE] = USUAL_FADE, USUAL_FADE
    else:
        fields[LEAD] = number(state, data, fields[LEAD], FADE_BITS)
        fields[FADE] = number(state, data, fields[FADE], FADE_BITS)
    fields[FINE] = adaptive(state, data, fields[FINE], C_FINE)
    for i in range(3):
        found = code_number(state, data, 0, ANCHOR, fields[X + i])
        if abs(found) > MAX_DISPLACEMENT:
            return 1
        fields[X + i] = found
    return 0


@kernel
def code_displacements(
    state: Ints,
    data: Bytes,
    learner: Learner,
    places: Floats,
    anchor: Floats,
    moves: Ints,
    wanted: Floats,
    radius: float,
) -> int:
    """Code ``moves`` (n_frames, 3) from the first place on, in place; 1 where that is impossible.

    ``places`` (n_frames + 2, 3), from the frame before on, and ``anchor`` (3,) are in steps. An
    encoder chooses what is cheap among what is no farther than ``radius`` from ``wanted``.
    """
    features, means, chosen = np.zeros((3, N_FEATURES)), np.zeros(3), np.zeros(3, np.int64)
    for t in range(1, len(moves)):
        for axis in range(3):
            _note_features(learner, places, anchor, moves, t, axis, features)
            means[axis] = _expect(learner, axis, features[axis])
        if state[ENCODING]:
            _choose(learner, means, moves[t - 1], wanted[t], radius, chosen)
        other, odd = 0.0, 0
        for axis in range(3):
            mean = means[axis] + moves[t - 1, axis]
            middle = _nearest(mean, axis, odd)
            unit = 1 if axis == 0 else 2
            side = int(np.floor((mean - middle) * 4.0 / unit)) + 2  # 0 to 4
            residual = (chosen[axis] - middle) // unit
            found = _code_residual(state, data, residual, learner.sizes[axis], other, side)
            moves[t, axis] = middle + unit * found
            if abs(moves[t, axis]) > MAX_DISPLACEMENT:
                return 1
            odd = moves[t, 0] & 1
            size = float(min(abs(found), 1024))
            other = size if axis == 0 else 0.5 * (other + size)
            learner.sizes[axis, 0] += (size - learner.sizes[axis, 0]) * 0.25
            learner.sizes[axis, 1] += (size - learner.sizes[axis, 1]) * 0.03125
            _learn(learner, axis, features[axis], float(moves[t, axis] - moves[t - 1, axis]))
    return 0


@inner
def _nearest(value: float, axis: int, odd: int) -> int:
    """The integer next to ``value``; of y and z that which is odd or even as x is."""
    if axis == 0:
        return int(np.floor(value + 0.5))
    return 2 * int(np.floor((value - odd) * 0.5 + 0.5)) + odd


@inner
def _limit(value: float) -> float:
    return min(max(value, -FARTHEST), FARTHEST)


@inner
def _note_features(
    learner: Learner,
    places: Floats,
    anchor: Floats,
    moves: Ints,
    t: int,
    axis: int,
    features: Floats,
) -> None:
    """The last three moves, those of the decoded point around, and how far it had to be moved."""
    for back in (0, 1, 2):
        at = t - 1 - back
        moved = float(moves[at, axis] - moves[at - 1, axis]) if at >= 1 else 0.0
        features[axis, back] = _limit(moved)
        features[axis, 3 + back] = _limit(places[t + back, axis] - places[t + back - 1, axis])
    features[axis, 6] = _limit(anchor[axis] + moves[t - 1, axis] - places[t, axis])


@inner
def _expect(learner: Learner, axis: int, features: Floats) -> float:
    mean = 0.0
    for i in range(N_FEATURES):
        mean += learner.weights[axis, i] * features[i]
    return _limit(mean)


@inner
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


@inner
def _solve(squares: Floats, products: Floats, found: Floats, scratch: Floats) -> None:
    """(squares + ridge) found = products, by L D L'; row 7 of ``scratch`` has D."""
    for i in range(N_FEATURES):
        for k in range(i + 1):
            entry = squares[i, k] + (RIDGE if i == k else 0.0)
            for n in range(k):
                entry -= scratch[i, n] * scratch[k, n] * scratch[7, n]
            if i == k:
                scratch[7, i] = max(entry, RIDGE)
            else:
                scratch[i, k] = entry / scratch[7, k]
    for i in range(N_FEATURES):
        entry = products[i]
        for n in range(i):
            entry -= scratch[i, n] * scratch[8, n]
        scratch[8, i] = entry
    for back in range(N_FEATURES):
        i = N_FEATURES - 1 - back
        entry = scratch[8, i] / scratch[7, i]
        for n in range(i + 1, N_FEATURES):
            entry -= scratch[n, i] * found[n]
        found[i] = entry


@inner
def _choose(
    learner: Learner, means: Floats, before: Ints, wanted: Floats, radius: float, chosen: Ints
) -> None:
    """The displacement near ``wanted`` that the expected one makes cheapest."""
    best = -1.0
    for place in range(54):
        odd = place // 27
        x = 2 * int(np.floor((wanted[0] - odd) * 0.5 + 0.5)) + odd + 2 * (place % 3 - 1)
        y = _nearest(wanted[1], 1, odd) + 2 * (place // 3 % 3 - 1)
        z = _nearest(wanted[2], 2, odd) + 2 * (place // 9 % 3 - 1)
        a, b, c = wanted[0] - x, wanted[1] - y, wanted[2] - z
        off = a * a + b * b + c * c
        cost = abs(x - before[0] - means[0]) / (1.0 + learner.sizes[0, 0])
        cost += abs(y - before[1] - means[1]) / (2.0 + 2.0 * learner.sizes[1, 0])
        cost += abs(z - before[2] - means[2]) / (2.0 + 2.0 * learner.sizes[2, 0])
        if off > radius * radius:
            cost += 1e6 * off
        if best < 0.0 or cost < best:
            best = cost
            chosen[0], chosen[1], chosen[2] = x, y, z


@inner
def _class_of(size: float) -> int:
    """0 to 15, about two to an octave of a mean magnitude."""
    found, limit = 0, 0.1
    while size > limit and found < N_SIZES - 1:
        limit = limit * 1.5
        found += 1
    return found


@inner
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
        if not mixed(state, data, more, size, a + size, b + size, c + size):
            break
        size += 1
    if size == N_BITS:
        more = code_number(state, data, 0, ESCAPE, magnitude - N_BITS)
        size = N_BITS + more if 0 <= more < MAX_DISPLACEMENT else 4 * MAX_DISPLACEMENT
    if size == 0:
        return 0
    negative = adaptive(state, data, 1 if residual < 0 else 0, C_SIGN + side)
    return -size if negative else size
