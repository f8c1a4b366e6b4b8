"""Compiled: predictions of the coefficients of a row and their sizes, binary64 in a fixed order.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. Loops run
along the channels, item by item, so that they are as quick as the machine's vectors and still have
one right answer. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.posewave.model_state import (
    BEFORE_1,
    BEFORE_2,
    BEFORE_3,
    BLOCK,
    GRAND,
    LANES,
    N_FEATURES,
    N_TAPS,
    PARENT,
    PARENT_LAST,
    PARENT_NEXT,
    ROW_BEFORE,
    ROW_PARENT,
    TAP_BEFORE_1,
    TAP_BEFORE_2,
    TAP_LAST,
    TAP_NEXT,
    TAP_PARENT,
    USUAL,
    Model,
)
from mcz.kernels.types import Floats, Floats2, Ints

MEMORY = 0.996  # share of what was learned that remains after a live row
NOISE = 0.1  # variance that each live row adds to that of a channel
TAP_MEMORY, TAP_RATE, MOST_TAP = 0.98, 0.012, 2.0


def predict_in_time(model: Model, here: Floats2, parent: Floats2, level: int, row: int) -> None:
    """Fill ``timely`` with predictions from earlier rows and the coarser level."""
    timely, sources = model.timely, model.sources
    width, last = len(timely), len(parent) - 1
    up = min(row >> 1, last)
    sources[TAP_BEFORE_1] = here[row + 2, width:]
    sources[TAP_BEFORE_2] = here[row + 1, width:]
    sources[TAP_PARENT] = parent[up, width:]
    sources[TAP_NEXT] = parent[min(up + 1, last), width:]
    sources[TAP_LAST] = parent[max(up - 1, 0), width:]
    timely[:] = 0.0
    for k in range(N_TAPS):
        source, tap = sources[k], model.taps[2 * level + (row & 1), k]
        for c in range(width):
            timely[c] += tap * source[c]


def learn_in_time(model: Model, values: Floats, level: int, row: int, share: float) -> None:
    """Update the taps by their prediction errors; overwrites ``timely``."""
    timely, sources, usual = model.timely, model.sources, model.features[USUAL]
    scale, product = sources[N_TAPS], sources[N_TAPS + 1]
    which = 2 * level + (row & 1)
    taps, energy = model.taps[which], model.tap_energy[which]
    for c in range(len(timely)):
        weight = share / (usual[c] + 0.3)
        timely[c] = (values[c] - timely[c]) * weight
        scale[c] = weight
    for k in range(N_TAPS):
        source = sources[k]
        for c in range(len(timely)):
            product[c] = source[c] * source[c] * scale[c]
        energy[k] = energy[k] * TAP_MEMORY + total_of(product)
        for c in range(len(timely)):
            product[c] = source[c] * timely[c]
        tap = taps[k] + TAP_RATE * total_of(product) / (energy[k] * (1.0 - TAP_MEMORY) + 5.0)
        taps[k] = min(max(tap, -MOST_TAP), MOST_TAP)


def total_of(values: Floats) -> float:
    """The sum of values, whose number is a multiple of ``LANES``; overwrites them."""
    for start in range(LANES, len(values), LANES):
        part = values[start : start + LANES]
        for c in range(LANES):
            values[c] += part[c]
    for c in range(16):
        values[c] += values[c + 16]
    for c in range(8):
        values[c] += values[c + 8]
    for c in range(4):
        values[c] += values[c + 4]
    return float(values[0] + values[1] + (values[2] + values[3]))


def spread(means: Floats, column: Floats, miss: float) -> None:
    """Propagate the error of one channel to the means of later channels of a block.

    As in ``take_in``, results for earlier channels are never used: a loop of fixed length is
    faster.
    """
    for c in range(BLOCK):
        means[c] += column[c] * miss


def take_in(columns: Floats2, variances: Floats, rest: Floats, size: int, share: float) -> None:
    """Add the temporal error ``rest`` to L D L'; ``columns`` has the columns of L.

    One step of Bennett's update for each channel. Overwrites ``rest``.
    """
    for a in range(size):
        miss, before = rest[a], variances[a] * MEMORY + NOISE
        after = before + share * miss * miss
        gain = share * miss / after
        share *= before / after
        variances[a] = after  # ROWS-06
        line = columns[a]
        for b in range(BLOCK):
            left = rest[b] - miss * line[b]
            rest[b] = left
            line[b] += gain * left


OF_ROWS = (
    *(BEFORE_1, BEFORE_2, BEFORE_3, GRAND, PARENT, PARENT_NEXT, PARENT_LAST),
    *(ROW_BEFORE, ROW_PARENT, USUAL),
)
LEAST_SIZE, MOST_SIZE = 0.008, 4096.0
BASE_SIZE = 0.015
ONE, TWO, FOUND, SPARE = range(
    4
)  # rows of ``sizes``: predicted by level, by channel, actual, scratch
LEVEL_RATE, OWN_RATE, CHANNELS = 0.016, 0.032, 62
USUAL_RATE = 0.06


def log_of(logs: Ints, value: float) -> int:
    """Approximate 6 log2(1 + 4 value), 0 <= value < 2^32, at most 95."""
    x = int(value * 16.0)
    return int(logs[x & 1023] if x < 1024 else logs[min(x >> 6, 1023)] + 36)


def gather_magnitudes(
    model: Model, here: Floats2, parent: Floats2, grand: Floats2, level: int, row: int
) -> None:
    """Fill the features of earlier rows, and ``sizes`` predicted from them alone."""
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
