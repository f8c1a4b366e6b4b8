"""Compiled: simulated annealing of how many coefficients each channel keeps.

mcz/codecs/wavelet/README.md says what is sought; nothing here binds a decoder. Imported on first
use only.
"""

from __future__ import annotations

import math

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Ints

MASK = (1 << 31) - 1  # a Lehmer generator: the same numbers on every machine


def following(seed: int) -> int:
    return seed * 48271 % MASK


@kernel
def anneal(
    counts: Ints, most: Ints, starts: Ints, tails: Floats, iterations: int, seed: int
) -> float:
    """Move coefficients between channels, ``counts`` in place, and return the distortion.

    ``tails[starts[c] + k]`` is the distortion of channel c that keeps its k largest coefficients,
    ``k <= most[c]``. A move takes some from one channel and gives them to another; one
    that adds to the distortion is accepted the less often the later it comes. The last tenth of
    the moves accepts only what lowers it. The best allocation that was found is kept.
    """
    n_channels = len(counts)
    total = 0.0
    for c in range(n_channels):
        total += tails[starts[c] + counts[c]]
    if n_channels < 2 or total <= 0:
        return total
    best, best_counts = total, np.empty(n_channels, np.int64)
    best_counts[:] = counts
    hot, cold = total / n_channels / 8, total / n_channels * 1e-7
    cooling = math.exp(math.log(cold / hot) / max(1, iterations))
    heat = hot
    state = 1 + seed % (MASK - 1)
    for _ in range(16):  # small seeds differ from the first move on
        state = following(state)
    greatest = 1
    for c in range(n_channels):
        greatest = max(greatest, counts[c])
    for step in range(iterations):
        state = following(state)
        giver = state % n_channels
        state = following(state)
        taker = state % n_channels
        state = following(state)
        left = iterations - step
        widest = 1 + greatest * left // (4 * iterations)
        moved = min(1 + state % widest, counts[giver], most[taker] - counts[taker])
        state = following(state)
        heat *= cooling
        if giver == taker or moved <= 0:
            continue
        g, t = starts[giver] + counts[giver], starts[taker] + counts[taker]
        change = (tails[g - moved] - tails[g]) + (tails[t + moved] - tails[t])
        if change > 0 and (10 * left <= iterations or state >= MASK * math.exp(-change / heat)):
            continue
        counts[giver] -= moved
        counts[taker] += moved
        total += change
        if total < best:
            best = total
            best_counts[:] = counts
    counts[:] = best_counts
    return best
