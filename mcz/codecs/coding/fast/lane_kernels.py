"""Compiled: parents and sources of channels, and the arrays that lanes are decoded with.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast.head_kernels import (
    BAD_LINK,
    BAD_PARENT,
    BAD_SOURCE,
    BASE,
    CODED,
    COPY,
    FAR_PARENTS,
    FIRST,
    GROUP,
    KIND,
    LINK,
    PLACE,
    SCALE,
    TAPS,
    WEIGHT,
)
from mcz.codecs.coding.fast.residual_kernels import Predictors
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Ints, Ints2


def link_channel(plans: Ints2, firsts: Ints, n: int, at: int) -> int:
    """Note the parent or the source of channel ``n``, whose group is ``at``; returns the fault."""
    place = plans[n, PLACE]
    if at < 0 or place >= firsts[at + 1] - firsts[at]:
        return BAD_LINK
    linked = firsts[at] + place
    plans[n, LINK] = linked
    if plans[n, KIND] == COPY:
        return BAD_SOURCE if plans[linked, KIND] == COPY else -1  # FAST-27
    return BAD_PARENT if linked == n or plans[linked, KIND] != CODED else -1  # FAST-34


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
            plans[n, LINK] = -1
            group = plans[n, GROUP]
            if group < 0:
                continue
            if plans[n, KIND] == CODED and group != groups[n_group]:
                if one < 0 or one == group:
                    one = group
                elif two < 0 or two == group:
                    two = group
                else:  # FAST-36
                    return n, FAR_PARENTS
            if group >= len(places):  # FAST-27, FAST-34
                return n, BAD_LINK
            if n_group < (n_wanted if plans[n, KIND] == COPY else n_whole):
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
            if plans[n, KIND] == CODED:
                columns[n_lanes] = n
                lane_of[n] = n_lanes
                n_lanes += 1
    starts[len(firsts) - 1] = n_lanes
    for lane in range(n_lanes):
        plan = plans[columns[lane]]
        lanes.first[lane] = wrapped(plan[FIRST])
        lanes.scales[lane] = wrapped(plan[SCALE])
        lanes.weights[lane] = wrapped(plan[WEIGHT])
        lanes.parents[lane] = lane_of[plan[LINK]] if plan[LINK] >= 0 else -1
        lanes.behind[0, lane] = wrapped(plan[TAPS])
        lanes.behind[4, lane] = wrapped(-plan[TAPS + 3])
        for tap in range(1, 4):
            lanes.behind[tap, lane] = wrapped(plan[TAPS + tap] - plan[TAPS + tap - 1])
        for field in range(6):
            lattices[lane, field] = plan[BASE + field]
