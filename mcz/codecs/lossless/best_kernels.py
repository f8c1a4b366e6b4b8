"""Compiled: the rows of one group, coded by ``best``.

SPEC.md, "Codec 2: best", is normative and has the steps below in the same order. One function
serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.lossless.best_numbers import code_number
from mcz.coding.ordinals.kernels import (
    BAD,
    FAST,
    LAST,
    NEAR,
    OTHER,
    SCALE,
    SIDE_1,
    SLOW,
    TRACK_SIZE,
    predict,
)
from mcz.coding.regression import (
    LIMIT,
    bounded,
    estimate,
    follow,
    solve,
    take_in,
    weight_of,
    width_of,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

# Columns of ``links``, one row a coded channel: powers of two that its steps and levels are
# counted in, where its sums begin, how many other channels it looks at, and which.
UNIT, REACH, NEAR_SUMS, BENT_SUMS, N_SEEN, SEEN = range(6)
MAX_SEEN = 8
LINKS_SIZE = SEEN + MAX_SEEN

# The three regressions of a channel, and the figures of each.
NEARBY, BENT, FINAL = range(3)
NEARBY_LAGS, NEARBY_SEEN = 4, 6
BENT_LAGS = 3
MOST_NEARBY = NEARBY_LAGS + 2 * NEARBY_SEEN
MOST_BENT = BENT_LAGS + MAX_SEEN + MAX_SEEN * (MAX_SEEN + 1) // 2
N_FINAL = 3
KEEP = 0.95, 0.998, 0.98
RIDGE = 0.01, 0.001, 0.01
FIRST_ROWS = 8  # in which the final regression is not asked
OFTEN_ROWS = 64  # in which the bent one is solved every other row, later every fourth

# Columns of ``steps``: now and before; of ``levels``: now, before, and the first value.
STEPS = NEARBY_LAGS + 1
NOW, BEFORE, FIRST = range(3)
FARTHEST = 17592186044416.0  # 2^44


def sizes_of(n_seen: int) -> tuple[int, int]:
    """How many numbers the sums of the first two regressions are."""
    near, bent = n_nearby(n_seen), n_bent(n_seen)
    return near * width_of(near), bent * width_of(bent)


def n_nearby(n_seen: int) -> int:
    return NEARBY_LAGS + 2 * min(n_seen, NEARBY_SEEN)


def n_bent(n_seen: int) -> int:
    return BENT_LAGS + n_seen + n_seen * (n_seen + 1) // 2


def look_nearby(features: Floats, link: Ints, channel: int, steps: Floats2) -> None:
    """The features of the first regression: steps, a row's own and those of others."""
    n_seen = min(link[N_SEEN], NEARBY_SEEN)
    for lag in range(NEARBY_LAGS):
        features[lag] = steps[channel, 1 + lag]
    for i in range(n_seen):
        features[NEARBY_LAGS + i] = steps[link[SEEN + i], 0]
        features[NEARBY_LAGS + n_seen + i] = steps[link[SEEN + i], 1]


def look_bent(
    features: Floats, link: Ints, channel: int, steps: Floats2, levels: Floats2, ratio: float
) -> None:
    """Those of the second: steps, and the steps of products of two levels."""
    n_seen = link[N_SEEN]
    for lag in range(BENT_LAGS):
        features[lag] = steps[channel, 1 + lag]
    at = BENT_LAGS + n_seen
    for i in range(n_seen):
        one = link[SEEN + i]
        features[BENT_LAGS + i] = steps[one, 0]
        for j in range(i, n_seen):
            other = link[SEEN + j]
            step = (
                levels[one, NOW] * levels[other, NOW] - levels[one, BEFORE] * levels[other, BEFORE]
            )
            features[at] = step * ratio
            at += 1


def to_next_row(steps: Floats2, levels: Floats2) -> None:
    for channel in range(len(steps)):
        for lag in range(STEPS - 1, 0, -1):
            steps[channel, lag] = steps[channel, lag - 1]
        levels[channel, BEFORE] = levels[channel, NOW]


def foresee(opinions: Floats, weights: Floats, row: int) -> float:
    """The step that is expected, of what the two regressions and the taps say."""
    return opinions[FINAL] if row < FIRST_ROWS else estimate(weights, opinions, N_FINAL)


def learn(
    sums: Floats,
    weights: Floats,
    features: Floats,
    which: int,
    n: int,
    target: float,
    guess: float,
    typical: Floats,
    row: int,
    due: bool,
    work: Floats,
    top: Floats,
    weighted: Floats,
) -> None:
    """Teach a regression, its sums, weights and features, what the step was that it guessed."""
    keep, ridge = KEEP[which], RIDGE[which]
    error = target - guess  # BEST-11
    take_in(sums, features, n, target, weight_of(error, typical[which]), keep, weighted)
    if due:
        solve(sums, weights, n, ridge, work, top)
    typical[which] = follow(typical[which], error, row)


def is_due(row: int, channel: int) -> bool:
    """Whether the second regression is solved."""
    return row % 2 == 0 if row < OFTEN_ROWS else (row + channel) % 4 == 0


def echo_of(ordinals: Ints2, place: int) -> int:
    """The number at ``place``, counted through from 1; of the other sign where that is below 0."""
    at = abs(place) - 1
    found = int(ordinals[at // ordinals.shape[1], at % ordinals.shape[1]])
    return found if place > 0 else -1 - found


@kernel
def code_rows(
    state: Ints,
    data: Bytes,
    ordinals: Ints2,
    plans: Ints2,
    powers: Ints2,
    links: Ints2,
    n_sums: int,
    echoes: Ints2,
) -> int:
    """Code all rows of (n_rows, n_channels) ordinals in place; return the row of a fault or -1.

    ``powers`` has the powers of 2 in row 0 and those of 10 in row 1; ``n_sums`` is where the sums
    of all channels end. ``echoes`` are those of ``table_of``.
    """
    n_channels = len(plans)
    tracks = np.zeros((n_channels, TRACK_SIZE), np.int64)
    tracks[:, FAST] = tracks[:, SLOW] = plans[:, SCALE]
    flow = np.zeros(3, np.int64)
    sums = np.zeros(n_sums, np.float64)
    final_sums = np.zeros((n_channels, N_FINAL * width_of(N_FINAL)), np.float64)
    near_weights = np.zeros((n_channels, MOST_NEARBY), np.float64)
    bent_weights = np.zeros((n_channels, MOST_BENT), np.float64)
    final_weights = np.zeros((n_channels, N_FINAL), np.float64)
    typical = np.zeros((n_channels, 3), np.float64)
    typical[:, :] = 1.0
    steps = np.zeros((n_channels, STEPS), np.float64)
    levels = np.zeros((n_channels, 3), np.float64)
    near, bent = np.zeros(MOST_NEARBY, np.float64), np.zeros(MOST_BENT, np.float64)
    opinions = np.zeros(N_FINAL, np.float64)
    work = np.zeros(MOST_BENT * width_of(MOST_BENT), np.float64)
    top, weighted = np.zeros(64, np.float64), np.zeros(64, np.float64)
    for row in range(len(ordinals)):
        flow[NEAR], flow[OTHER] = 0, 3
        to_next_row(steps, levels)
        for channel in range(n_channels):
            if len(echoes) > 0 and echoes[row, channel] != 0:  # BEST-23
                ordinals[row, channel] = echo_of(ordinals, echoes[row, channel])
                steps[channel, 0] = 0.0
                continue
            plan, track, link = plans[channel], tracks[channel], links[channel]
            unit, reach = float(powers[0, link[UNIT]]), float(powers[0, link[REACH]])
            n_near, n_bend = n_nearby(link[N_SEEN]), n_bent(link[N_SEEN])
            last = float(track[LAST])  # BEST-10
            look_nearby(near, link, channel, steps)
            look_bent(bent, link, channel, steps, levels, reach / unit)
            opinions[NEARBY] = estimate(near_weights[channel], near, n_near)
            opinions[BENT] = estimate(bent_weights[channel], bent, n_bend)
            opinions[FINAL] = bounded((float(predict(plan, track)) - last) / unit)
            guess = foresee(opinions, final_weights[channel], row)
            place = np.floor(last + guess * unit + 0.5)
            predicted = int(min(max(place, -FARTHEST), FARTHEST))
            given = ordinals[row, channel]
            found = code_number(state, data, given, predicted, plan, track, flow, powers)
            if flow[BAD]:
                return row
            ordinals[row, channel] = found
            flow[OTHER] = track[SIDE_1]
            value = float(track[LAST])
            if row == 0:
                levels[channel, FIRST] = value
                continue
            step = min(max((value - last) / unit, -LIMIT), LIMIT)
            steps[channel, 0] = step
            levels[channel, NOW] = (value - levels[channel, FIRST]) / reach
            at, end = link[NEAR_SUMS], link[BENT_SUMS]
            learn(
                sums[at:end],
                near_weights[channel],
                near,
                NEARBY,
                n_near,
                step,
                opinions[NEARBY],
                typical[channel],
                row,
                True,
                work,
                top,
                weighted,
            )
            own = sums[end : end + n_bend * width_of(n_bend)]
            learn(
                own,
                bent_weights[channel],
                bent,
                BENT,
                n_bend,
                step,
                opinions[BENT],
                typical[channel],
                row,
                is_due(row, channel),
                work,
                top,
                weighted,
            )
            learn(
                final_sums[channel],
                final_weights[channel],
                opinions,
                FINAL,
                N_FINAL,
                step,
                guess,
                typical[channel],
                row,
                True,
                work,
                top,
                weighted,
            )
    return -1
