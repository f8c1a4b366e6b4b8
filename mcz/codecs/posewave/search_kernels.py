"""Compiled: an encoder's choice of the values of a row, by Viterbi's search through its channels.

Each state of dependent quantization keeps the path with the least squared error and bits, and what
the model expects of the channels after it. Without dependent quantization there is one path.
Decoders need none of this.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.posewave.channel_kernels import (
    expect,
    follow,
    forget_block,
    next_state,
    note_magnitude,
    twice_value,
)
from mcz.codecs.posewave.decision_kernels import (
    COST_UNIT,
    ROUNDED,
    Contexts,
    cost_of_size,
    costs_of,
    mixed_chance,
)
from mcz.codecs.posewave.model_state import (
    M_FLAG,
    MAX_INDEX,
    N_STATES,
    PATH_COST,
    PATH_MEAN,
    USUAL,
    Model,
)
from mcz.codecs.posewave.prediction_kernels import gather_magnitudes, predict_in_time
from mcz.kernels.types import Floats, Floats2, Ints, Ints2

NEVER = 1e300
HOPELESS = 1.2  # a path worse than the best by so many squared steps is given up
LEAST = 0.5  # steps: a row of less is all zeros
MOST_ZEROED = 2.0  # steps: a greater value is never left out
FROM, TWICE, STILL = range(
    3
)  # columns of ways: previous state, twice the value, 1 for a still channel


def choose_row(
    model: Model,
    q: Ints,
    y: Floats,
    here: Floats2,
    parent: Floats2,
    grand: Floats2,
    level: int,
    row: int,
    lam: float,
    exponent: int,
    flags: tuple[int, int, int],
    dependent: int,
) -> int:
    """Return 1 for a row worth coding, with twice its values in ``q`` (n,), and 0 for zeros.

    ``y`` (n,) are the values of the source, in steps of the row; a bit is worth ``lam`` squares of
    a step. Afterwards the model knows the rows around a live one.
    """
    energy = most = 0.0
    for c in range(len(y)):
        energy += y[c] * y[c]
        most = max(most, abs(y[c]))
    if most < LEAST:
        return 0
    gather_magnitudes(model, here, parent, grand, level, row)
    predict_in_time(model, here, parent, level, row)
    cost = search_row(model, q, y, level, lam, float(1 << exponent), dependent)
    chance = mixed_chance(model.coder, M_FLAG + level, flags)
    saved = model.costs[chance >> 4] - model.costs[(65536 - chance) >> 4]
    return 1 if cost + lam * float(saved) / COST_UNIT < energy and is_live(q) else 0


def is_live(q: Ints) -> bool:
    """Return True for a row with a value other than 0."""
    for c in range(len(q)):
        if q[c] != 0:
            return True
    return False


def search_row(
    model: Model, q: Ints, y: Floats, level: int, lam: float, gain: float, dependent: int
) -> float:
    """Fill ``q`` with the cheapest values, and return their cost in squares of a step."""
    n, blocks = len(model.classes), len(model.columns)
    n_states = N_STATES if dependent else 1
    current, following = model.paths[0], model.paths[1]
    for state in range(n_states):
        current[state, PATH_COST] = NEVER
    current[0] = 0.0
    least = total_usual = 0.0
    block, start, stop = -1, 0, 0
    for c in range(n):
        if c == stop:
            block, start, stop = block + 1, stop, (block + 2) * n // blocks
            forget_block(current)
        for state in range(n_states):
            following[state, PATH_COST] = NEVER
        goal = min(max(y[c], -2.0 * MAX_INDEX), 2.0 * MAX_INDEX)
        for state in range(n_states):
            path = current[state]
            if path[PATH_COST] <= least + HOPELESS:
                contexts = expect(model, path, c, c - start, level, gain, total_usual, state & 1)
                try_values(
                    model, path, following, model.ways[c], state, goal, lam, contexts, dependent
                )
        least = NEVER
        for state in range(n_states):
            if following[state, PATH_COST] < NEVER:
                least = min(least, following[state, PATH_COST])
                way = model.ways[c, state]
                path, value = current[way[FROM]], 0.5 * float(way[TWICE])
                miss = (value - path[PATH_MEAN]) / gain
                follow(path, following[state], model.columns[block, c - start], miss)
                note_magnitude(following[state], value / gain, miss, way[STILL] == 1)
        total_usual += model.features[USUAL, c]
        current, following = following, current
    state = 0
    for other in range(n_states):
        if current[other, PATH_COST] < current[state, PATH_COST]:
            state = other
    for k in range(n):
        way = model.ways[n - 1 - k, state]
        q[n - 1 - k], state = way[TWICE], way[FROM]
    return float(least)


def try_values(
    model: Model,
    path: Floats,
    following: Floats2,
    ways: Ints2,
    state: int,
    goal: float,
    lam: float,
    contexts: Contexts,
    dependent: int,
) -> None:
    """Extend a path by each of the two values next to ``goal``, and by 0 if that is near."""
    between = state & 1
    zero, other = costs_of(model, 0, contexts)
    low = int(np.floor(abs(goal) + 0.5)) if between else int(np.floor(goal))
    for k in range(2 if -2 < low < 1 or abs(goal) > MOST_ZEROED else 3):
        integer = low + k if k < 2 else 0
        if between and goal < 0.0:
            integer = -integer
        twice = twice_value(integer, between)
        distance, error = goal - 0.5 * float(twice), integer - contexts[ROUNDED]
        bits = zero if error == 0 else other + cost_of_size(model, error, contexts)
        cost = path[PATH_COST] + distance * distance + lam * float(bits) / COST_UNIT
        next_ = next_state(state, integer) if dependent else 0
        if cost < following[next_, PATH_COST]:
            following[next_, PATH_COST] = cost
            ways[next_, FROM], ways[next_, TWICE] = state, twice
            ways[next_, STILL] = 1 if integer == 0 and error == 0 else 0
