"""Compiled: how large the coefficients of a row are likely to be, from magnitudes around them.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. Imported
on first use only.
"""

from __future__ import annotations

from mcz.codecs.posewave.model_state import (
    BEFORE_1,
    BEFORE_2,
    BEFORE_3,
    GRAND,
    N_FEATURES,
    PARENT,
    PARENT_LAST,
    PARENT_NEXT,
    ROW_BEFORE,
    ROW_PARENT,
    USUAL,
    Model,
)
from mcz.codecs.posewave.prediction_kernels import total_of
from mcz.kernels.types import Floats, Floats2, Ints

OF_ROWS = (
    *(BEFORE_1, BEFORE_2, BEFORE_3, GRAND, PARENT, PARENT_NEXT, PARENT_LAST),
    *(ROW_BEFORE, ROW_PARENT, USUAL),
)
LEAST_SIZE, MOST_SIZE = 0.008, 4096.0
BASE_SIZE = 0.015
ONE, TWO, FOUND, SPARE = range(4)  # of ``sizes``: by level, by channel, what they should have been
LEVEL_RATE, OWN_RATE, CHANNELS = 0.016, 0.032, 62
USUAL_RATE = 0.06


def log_of(logs: Ints, value: float) -> int:
    """Approximate 6 log2(1 + 4 value), 0 <= value < 2^32, at most 95."""
    x = int(value * 16.0)
    return int(logs[x & 1023] if x < 1024 else logs[min(x >> 6, 1023)] + 36)


def gather_magnitudes(
    model: Model, here: Floats2, parent: Floats2, grand: Floats2, level: int, row: int
) -> None:
    """Fill the features that earlier rows have, and ``sizes`` by them alone."""
    features, n = model.features, len(model.classes)
    one, two = model.sizes[ONE], model.sizes[TWO]
    last = len(parent) - 1
    up = min(row >> 1, last)
    width = len(one)
    features[BEFORE_1] = here[row + 2, :width]
    features[BEFORE_2] = here[row + 1, :width]
    features[BEFORE_3] = here[row, :width]
    features[GRAND] = grand[min(up >> 1, len(grand) - 1), :width]
    features[PARENT] = parent[up, :width]
    features[PARENT_NEXT] = parent[min(up + 1, last), :width]
    features[PARENT_LAST] = parent[max(up - 1, 0), :width]
    features[ROW_BEFORE] = here[row + 2, n]
    features[ROW_PARENT] = parent[up, n]
    one[:] = BASE_SIZE
    two[:] = BASE_SIZE
    for k in OF_ROWS:
        source, weight, own = features[k], model.level_weights[level, k], model.own_weights[k]
        for c in range(width):
            one[c] += weight * source[c]
            two[c] += own[c] * source[c]


def learn_sizes(model: Model, level: int, magnitudes: Floats) -> None:
    """Update the weights of both sizes, and the usual size, from a coded row."""
    features, n = model.features, len(model.classes)
    one, two, found, spare = (
        model.sizes[ONE],
        model.sizes[TWO],
        model.sizes[FOUND],
        model.sizes[SPARE],
    )
    width = len(one)
    spare[:] = 2.0
    for k in range(N_FEATURES):
        source = features[k]
        for c in range(width):
            spare[c] += source[c] * source[c]
    rate = LEVEL_RATE * CHANNELS / max(n, CHANNELS)
    for c in range(width):
        energy = 1.0 / spare[c]
        one[c] = (found[c] - one[c]) * rate * energy
        two[c] = (found[c] - two[c]) * OWN_RATE * energy
    one[n:] = 0.0
    for k in range(N_FEATURES):
        source, own = features[k], model.own_weights[k]
        for c in range(width):
            own[c] += two[c] * source[c]
            spare[c] = one[c] * source[c]
        model.level_weights[level, k] += total_of(spare)
    usual = features[USUAL]
    for c in range(n):
        usual[c] += (magnitudes[c] - usual[c]) * USUAL_RATE
