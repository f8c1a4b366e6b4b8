"""Compiled: choose the parents of lanes.

Nothing here is normative: any choice decodes. A parent has none itself, so that its residuals do
not change. Roots are chosen one by one, as a greedy facility location does.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast.decode_kernels import LINK, WEIGHT
from mcz.codecs.coding.fast.plan_kernels import TRIED_ROWS, cost_of
from mcz.codecs.coding.fast.survey_kernels import CodedLanes
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Floats, Floats2, Ints, Ints2, Words, Words2

PARENT_COST = 36  # bits
SEEN_ROWS = 96  # that parents are looked for on
ROWS_AT_ONCE = 4
REACH = 160  # lanes before and behind that are looked at
LEAST_GAIN = 60.0  # bits, before a parent is tried
MOST_WEIGHT = 32000


def see(residuals: Words2, lane: int, n_seen: int, seen: Floats2) -> None:
    """Fill a column of ``seen`` with residuals from the whole lane."""
    step = (residuals.shape[1] - 1) // n_seen
    for row in range(n_seen):
        seen[row, lane] = float(int(residuals[lane, 1 + row * step]))


def share_rows(seen: Floats2, lane: int, n_seen: int, shares: Floats) -> float:
    """Fill ``shares`` with the weights of rows, where great residuals count less; their cost."""
    size = 0.0
    for row in range(n_seen):
        size += abs(seen[row, lane])
    size = 0.35 * size / n_seen + 0.5
    total = 1e-9
    for row in range(n_seen):
        own = seen[row, lane]
        shares[row] = 1.0 / (abs(own) + size)
        total += shares[row] * own * own
    return total


def add_products(
    seen: Floats2, lane: int, start: int, shares: Floats, both: Floats, squares: Floats
) -> None:
    """Fill in the products of a lane, and the squares, of as many others from ``start`` on."""
    stop = start + len(both)
    for other in range(len(both)):
        both[other], squares[other] = 0.0, 1e-9
    for row in range(0, len(seen), ROWS_AT_ONCE):
        own1, own2, own3 = seen[row, lane], seen[row + 1, lane], seen[row + 2, lane]
        own4, share1, share2 = seen[row + 3, lane], shares[row], shares[row + 1]
        share3, share4 = shares[row + 2], shares[row + 3]
        others1, others2 = seen[row, start:stop], seen[row + 1, start:stop]
        others3, others4 = seen[row + 2, start:stop], seen[row + 3, start:stop]
        for other in range(len(both)):  # short loops are vectorised
            shared1, shared2 = share1 * others1[other], share2 * others2[other]
            shared3, shared4 = share3 * others3[other], share4 * others4[other]
            product = both[other] + shared1 * own1 + shared2 * own2
            both[other] = product + shared3 * own3 + shared4 * own4
            square = squares[other] + shared1 * others1[other] + shared2 * others2[other]
            squares[other] = square + shared3 * others3[other] + shared4 * others4[other]


def weigh(both: float, square: float, total: float) -> tuple[float, float]:
    """The part of its cost that a parent saves, and its weight in 256ths; or 0."""
    weight = np.rint(256.0 * both / square)
    if not abs(weight) < MOST_WEIGHT:
        return 0.0, 0.0
    slope = weight / 256.0
    return min((2.0 * slope * both - slope * slope * square) / total, 0.999), weight


def cross(own: Words, other: Words, weight: int, tried: Words) -> None:
    """Fill ``tried`` with what a parent's residuals leave of a lane's own."""
    for row in range(1, len(own)):
        crossed = wrapped(128 + weight * int(other[row])) >> 8
        tried[row] = wrapped(int(own[row]) - crossed)


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


def find_gains(residuals: Words2, seen: Floats2, n_seen: int, gains: Floats2) -> None:
    """Fill ``gains``, (lanes, 2 * REACH + 1), with the bits that others would save as parents."""
    n_lanes, n_rows = residuals.shape
    shares = np.zeros(len(seen), np.float64)
    both, squares = np.zeros(n_lanes, np.float64), np.zeros(n_lanes, np.float64)
    least = 1.0 - 0.5 ** (2.0 * LEAST_GAIN / n_rows)
    for lane in range(n_lanes):
        start, stop = max(0, lane - REACH), min(n_lanes, lane + REACH + 1)
        total = share_rows(seen, lane, n_seen, shares)
        add_products(seen, lane, start, shares, both[: stop - start], squares[: stop - start])
        for other in range(start, stop):
            part, _ = weigh(both[other - start], squares[other - start], total)
            if part > least and other != lane:
                gains[lane, other - lane + REACH] = -0.5 * n_rows * np.log2(1.0 - part)


@kernel
def choose_parents(lanes: CodedLanes, plans: Ints2) -> None:
    """Note parents and their weights; residuals become what is left.

    A group has parents in two others at most.
    """
    residuals, numbers, costs = lanes.residuals, lanes.numbers, lanes.costs
    n_lanes, n_rows = residuals.shape
    groups, parents = np.zeros(n_lanes, np.int64), np.zeros(n_lanes, np.int64)
    n_seen = min(n_rows - 1, SEEN_ROWS)
    n_blocks = (n_seen + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE
    seen = np.zeros((ROWS_AT_ONCE * n_blocks, n_lanes), np.float64)  # 0 behind n_seen
    for group in range(len(lanes.starts) - 1):
        for lane in range(lanes.starts[group], lanes.starts[group + 1]):
            groups[lane], parents[lane] = group, -1
            see(residuals, lane, n_seen, seen)
    gains = np.zeros((n_lanes, 2 * REACH + 1), np.float64)
    find_gains(residuals, seen, n_seen, gains)
    choose_roots(gains, groups, parents)
    shares, sums = np.zeros(len(seen), np.float64), np.zeros((2, 1), np.float64)
    tried = np.zeros(n_rows, np.int32)
    times = max(int(n_rows) // TRIED_ROWS, 1)
    for lane in range(n_lanes):
        parent = parents[lane]
        if parent < 0:
            continue
        total = share_rows(seen, lane, n_seen, shares)
        add_products(seen, lane, parent, shares, sums[0], sums[1])
        _, weight = weigh(sums[0, 0], sums[1, 0], total)
        cross(residuals[lane], residuals[parent], int(weight), tried)
        saved = costs[lane] - cost_of(tried, lanes.scales[lane], costs[lane])
        if saved * times > PARENT_COST:
            plans[numbers[lane], LINK], plans[numbers[lane], WEIGHT] = numbers[parent], int(weight)
            residuals[lane] = tried
