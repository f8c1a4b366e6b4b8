"""Compiled: choose the parents of lanes.

Nothing here is normative: any choice decodes. A parent has none itself, so that its residuals do
not change. Roots are chosen one by one, as a greedy facility location does.
"""

from __future__ import annotations

import numpy as np

from mcz.coding.fast.plan_kernels import TRIED_ROWS, cost_of
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Floats, Floats2, Ints, Ints2, Words, Words2

PARENT_COST = 36  # bits
SEEN_ROWS = 96  # that parents are looked for on
REACH = 160  # lanes before and behind that are looked at
LEAST_GAIN = 60.0  # bits, before a parent is tried
MOST_WEIGHT = 32000


def see(residuals: Words2, lane: int, seen: Floats2) -> None:
    """Fill a row of ``seen`` with residuals from the whole lane."""
    n_seen = seen.shape[1]
    step = (residuals.shape[1] - 1) // n_seen
    for row in range(n_seen):
        seen[lane, row] = float(int(residuals[lane, 1 + row * step]))


def share_rows(own: Floats, shares: Floats) -> float:
    """Fill ``shares`` with the weights of rows, where great residuals count less; their cost."""
    size = 0.0
    for row in range(len(own)):
        size += abs(own[row])
    size = 0.35 * size / len(own) + 0.5
    total = 1e-9
    for row in range(len(own)):
        shares[row] = 1.0 / (abs(own[row]) + size)
        total += shares[row] * own[row] * own[row]
    return total


def weigh(own: Floats, other: Floats, shares: Floats, total: float) -> tuple[float, float]:
    """About the bits a row that a parent saves, and its weight in 256ths; or 0."""
    both, square = 0.0, 1e-9
    for row in range(len(own)):
        shared = shares[row] * other[row]
        both += shared * own[row]
        square += shared * other[row]
    weight = np.rint(256.0 * both / square)
    if not abs(weight) < MOST_WEIGHT or weight == 0.0:
        return 0.0, 0.0
    slope = weight / 256.0
    less = min((2.0 * slope * both - slope * slope * square) / total, 0.999)
    return (-0.5 * np.log2(1.0 - less), weight) if less > 0.0 else (0.0, 0.0)


def cross(residuals: Words2, lane: int, parent: int, weight: int, scale: int, tried: Words) -> int:
    """Fill ``tried`` with what is left of a lane's residuals; returns the bits that this saves."""
    n_rows = residuals.shape[1]
    own, other = residuals[lane], residuals[parent]
    tried[0] = 0
    for row in range(1, n_rows):
        crossed = wrapped(128 + weight * int(other[row])) >> 8
        tried[row] = wrapped(int(own[row]) - crossed)
    times = max(int(n_rows) // TRIED_ROWS, 1)
    return (cost_of(own, scale) - cost_of(tried, scale)) * times - PARENT_COST


def is_open(others: Ints2, child: int, group: int) -> bool:
    """A group of lanes, ``child``, may have parents in ``group``."""
    one, two = others[child, 0], others[child, 1]
    return child == group or one == group or two == group or one < 0 or two < 0


def open_group(others: Ints2, child: int, group: int) -> None:
    if child != group and others[child, 0] != group and others[child, 1] != group:
        others[child, 0 if others[child, 0] < 0 else 1] = group


def gain_of(gains: Floats2, bests: Floats, groups: Ints, others: Ints2, root: int) -> float:
    """The bits that one more root saves, which has no parent then."""
    gain = -max(float(bests[root]), 0.0)
    for lane in range(max(0, root - REACH), min(len(bests), root + REACH + 1)):
        own = gains[lane, root - lane + REACH]
        if 0.0 <= bests[lane] < own and is_open(others, groups[lane], groups[root]):
            gain += own - bests[lane]
    return float(gain)


def choose_roots(gains: Floats2, groups: Ints, parents: Ints) -> None:
    """Note parents, roots that have none themselves; the root that saves most comes first."""
    n_lanes = len(groups)
    bests = np.zeros(n_lanes, np.float64)  # what the parent of a lane saves; -1: it is a root
    others = np.zeros((groups[n_lanes - 1] + 1, 2), np.int64)
    for group in range(len(others)):
        others[group, 0] = others[group, 1] = -1
    bounds = np.zeros(n_lanes, np.float64)  # of what a root saves: it gets less as others come
    for root in range(n_lanes):
        bounds[root] = gain_of(gains, bests, groups, others, root)
    while True:
        root = 0
        for lane in range(1, n_lanes):
            if bounds[lane] > bounds[root]:
                root = lane
        if bounds[root] <= 0.0:
            return
        gain = gain_of(gains, bests, groups, others, root)
        if gain < bounds[root]:
            bounds[root] = gain
            continue
        bounds[root] = 0.0
        bests[root] = -1.0
        parents[root] = -1
        for lane in range(max(0, root - REACH), min(n_lanes, root + REACH + 1)):
            own = gains[lane, root - lane + REACH]
            if 0.0 <= bests[lane] < own and is_open(others, groups[lane], groups[root]):
                open_group(others, groups[lane], groups[root])
                bests[lane], parents[lane] = own, root


@kernel
def choose_parents(
    residuals: Words2, scales: Ints, starts: Ints, parents: Ints, weights: Ints
) -> None:
    """Note parents, or -1, and their weights; ``residuals`` (lanes, rows) become what is left.

    ``starts``: the first lane of each group, and the number of all; a group has parents in two
    others at most. ``scales``: those of the heads, in sixteenths.
    """
    n_lanes, n_rows = residuals.shape
    groups = np.zeros(n_lanes, np.int64)
    seen = np.zeros((n_lanes, min(n_rows - 1, SEEN_ROWS)), np.float64)
    shares = np.zeros(seen.shape[1], np.float64)
    gains = np.zeros((n_lanes, 2 * REACH + 1), np.float64)
    tried = np.zeros(n_rows, np.int32)
    for group in range(len(starts) - 1):
        for lane in range(starts[group], starts[group + 1]):
            groups[lane], parents[lane] = group, -1
            see(residuals, lane, seen)
    for lane in range(n_lanes):
        total = share_rows(seen[lane], shares)
        for other in range(max(0, lane - REACH), min(n_lanes, lane + REACH + 1)):
            if other != lane:
                gain, _ = weigh(seen[lane], seen[other], shares, total)
                if gain * n_rows > LEAST_GAIN:
                    gains[lane, other - lane + REACH] = gain * n_rows
    choose_roots(gains, groups, parents)
    for lane in range(n_lanes):
        parent = parents[lane]
        if parent < 0:
            continue
        total = share_rows(seen[lane], shares)
        _, weight = weigh(seen[lane], seen[parent], shares, total)
        weights[lane] = int(weight)
        if cross(residuals, lane, parent, weights[lane], scales[lane], tried) > 0:
            residuals[lane] = tried
        else:
            parents[lane] = -1
