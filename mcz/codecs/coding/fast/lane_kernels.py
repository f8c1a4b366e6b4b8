"""Compiled: parents and sources of channels, arrays of lanes, and channels that are not coded.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast import head_kernels as head
from mcz.codecs.coding.fast.residual_kernels import Predictors
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Bytes, Ints, Ints2


def link_channel(plans: Ints2, firsts: Ints, n: int, at: int) -> int:
    """Note the parent or the source of channel ``n``, whose group is ``at``; returns the fault."""
    place = plans[n, head.PLACE]
    if at < 0 or place >= firsts[at + 1] - firsts[at]:
        return head.BAD_LINK
    linked = firsts[at] + place
    plans[n, head.LINK] = linked
    if plans[n, head.KIND] == head.COPY:
        return head.BAD_SOURCE if plans[linked, head.KIND] == head.COPY else -1  # FAST-27
    return (
        head.BAD_PARENT if linked == n or plans[linked, head.KIND] != head.CODED else -1
    )  # FAST-34


@kernel
def link(
    plans: Ints2, firsts: Ints, groups: Ints, places: Ints, n_wanted: int, n_whole: int
) -> tuple[int, int]:
    """Note parents and sources; returns a channel and its fault, or -1.

    ``groups``: those whose heads were read; ``places``: where each group of the signal is among
    them, or -1. Sources matter in the first ``n_wanted``, parents in the first ``n_whole``.
    """
    for n_group in range(len(groups)):
        one = two = -1
        for n in range(firsts[n_group], firsts[n_group + 1]):
            plans[n, head.LINK] = -1
            group = plans[n, head.GROUP]
            if group < 0:
                continue
            if plans[n, head.KIND] == head.CODED and group != groups[n_group]:
                if one < 0 or one == group:
                    one = group
                elif two < 0 or two == group:
                    two = group
                else:  # FAST-36
                    return n, head.FAR_PARENTS
            if group >= len(places):  # FAST-27, FAST-34
                return n, head.BAD_LINK
            if n_group < (n_wanted if plans[n, head.KIND] == head.COPY else n_whole):
                fault = link_channel(plans, firsts, n, places[group])
                if fault >= 0:
                    return n, fault
    return -1, 0


@kernel
def fill_lanes(
    plans: Ints2, firsts: Ints, starts: Ints, lanes: Predictors, lattices: Ints2, columns: Ints
) -> None:
    """Number the coded channels, ``columns``, and fill in what their plans say.

    ``starts``: the first lane of each group, and the number of all.
    """
    lane_of = np.zeros(len(plans), np.int64)
    n_lanes = 0
    for group in range(len(firsts) - 1):
        starts[group] = n_lanes
        for n in range(firsts[group], firsts[group + 1]):
            if plans[n, head.KIND] == head.CODED:
                columns[n_lanes] = n
                lane_of[n] = n_lanes
                n_lanes += 1
    starts[len(firsts) - 1] = n_lanes
    for lane in range(n_lanes):
        plan = plans[columns[lane]]
        lanes.first[lane] = wrapped(plan[head.FIRST])
        lanes.scales[lane] = wrapped(plan[head.SCALE])
        lanes.weights[lane] = wrapped(plan[head.WEIGHT])
        lanes.parents[lane] = lane_of[plan[head.LINK]] if plan[head.LINK] >= 0 else -1
        lanes.behind[0, lane] = wrapped(plan[head.TAPS])
        lanes.behind[4, lane] = wrapped(-plan[head.TAPS + 3])
        for tap in range(1, 4):
            lanes.behind[tap, lane] = wrapped(plan[head.TAPS + tap] - plan[head.TAPS + tap - 1])
        for field in range(6):
            lattices[lane, field] = plan[head.BASE + field]


SIGN = 1 << 63


def short_ordinal(data: Bytes, at: int, size: int) -> int:
    folded = 0
    for place in range(size):
        folded |= int(data[at + place]) << 8 * place
    return (folded >> 1 & SIGN - 1) ^ -(folded & 1)


def fill_rows(rows: Ints2, n: int, start: int, stop: int, ordinal: int) -> None:
    for row in range(start, stop):
        rows[row, n] = ordinal


def fill_steps(data: Bytes, at: int, rows: Ints2, n: int) -> None:
    """Fill a channel with the ordinals of runs."""
    n_runs, at = head.varint(data, at, len(data))
    row = 0
    for _ in range(n_runs):
        n_rows, at = head.varint(data, at, len(data))
        size = int(data[at])
        end = min(row + n_rows, len(rows))
        fill_rows(rows, n, row, end, short_ordinal(data, at + 1, size))  # FAST-24
        row += n_rows
        at += 1 + size


def put_exceptions(data: Bytes, at: int, rows: Ints2, n: int) -> None:
    n_exceptions, at = head.varint(data, at, len(data))
    row = -1
    for _ in range(n_exceptions):
        gap, at = head.varint(data, at, len(data))
        row += gap + 1
        size = int(data[at])
        if row < len(rows):
            rows[row, n] = short_ordinal(data, at + 1, size)  # FAST-38
        at += 1 + size


@kernel
def fill_columns(data: Bytes, plans: Ints2, n_wanted: int, rows: Ints2) -> None:
    """Fill ``rows`` (rows, channels) but for what is coded; copies in the first ``n_wanted``.

    ``rows`` may be the first ones of the segment alone. What the heads say was checked.
    """
    n_rows, n_channels = rows.shape
    for n in range(n_channels):
        at = plans[n, head.FIELDS]
        if plans[n, head.KIND] == head.CONSTANT:
            size = int(data[at - 1]) >> 2
            fill_rows(rows, n, 0, n_rows, short_ordinal(data, at, size))  # FAST-23
        elif plans[n, head.KIND] == head.STEPS:
            fill_steps(data, at, rows, n)
        elif plans[n, head.EXCEPTIONS] >= 0:
            put_exceptions(data, plans[n, head.EXCEPTIONS], rows, n)
    for n in range(n_wanted):
        if plans[n, head.KIND] == head.COPY:
            for row in range(n_rows):
                rows[row, n] = rows[row, plans[n, head.LINK]]  # FAST-26
