"""Compiled: the streams of a segment, as codec 14, ``fast``, decodes them.

SPEC.md, "Codec 14: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.coding.quick.head_kernels import BAD_BITS, read_head
from mcz.coding.quick.kernels import (
    CODED,
    CONSTANT,
    KIND,
    LEAST_STATE,
    MAX_DIFFERENCE,
    ORDINAL,
    PARTS,
    PLAN_SIZE,
    RESTS,
    SCALE,
    TRACK_SIZE,
    Bytes,
    Floats,
    Ints,
    Tables,
    bits_at,
    clamp,
    first_value,
    next_value,
    settle,
)
from mcz.jit import inner, kernel

# Of a stream that is being decoded: its state, or 0; the offset of the next head or word; the next
# bit, and the first one; where it ends.
X, AT, BIT, BEGIN, END = range(5)
FLOW_SIZE = 5
NO_ROOM = -2  # in place of a channel: there are rests, and no room for them


@inner
def read_own_head(data: Bytes, flow: Ints, form: int, plan: Ints, powers: Ints) -> int:
    """Read the next head of a stream; -1, or what is wrong with it."""
    at, fault = read_head(data, flow[AT], flow[END], form, plan, powers)
    if at < 0:
        return fault
    flow[AT] = at
    if plan[KIND] == CODED:
        settle(plan, powers)
    return -1


@inner
def start_values(data: Bytes, flow: Ints) -> bool:
    """Read the state behind the heads; whether it is one."""
    at = flow[AT]
    x = int(data[at]) | int(data[at + 1]) << 8 | int(data[at + 2]) << 16 | int(data[at + 3]) << 24
    flow[X], flow[AT] = x, at + 4
    flow[BEGIN] = flow[BIT] = 8 * (len(data) - flow[END])
    return x >= LEAST_STATE  # FAST-07


@inner
def ends_well(flow: Ints, words: Ints) -> bool:
    """Whether a stream that is decoded has neither words nor bits left."""
    if flow[X] == 0:  # nor had it any
        nothing: bool = flow[AT] == flow[END]  # FAST-06
        return nothing
    i = flow[BIT]
    whole = flow[AT] + (i - flow[BEGIN] + 7 >> 3) == flow[END]  # FAST-17
    spare = bits_at(words, i, -i & 7)
    if spare != 0:  # FAST-17
        return False
    started: bool = flow[X] == LEAST_STATE  # FAST-16
    return whole and started


@inner
def read_channel(
    data: Bytes,
    words: Ints,
    tables: Tables,
    plan: Ints,
    flow: Ints,
    track: Ints,
    inverse: Floats,
    n: int,
    out: Ints,
) -> bool:
    """Decode the next channel of a stream to column ``n`` of ``out``; False where that fails."""
    i, last, ordinal, good = first_value(words, flow[BIT], plan, tables.powers)
    out[0, n] = ordinal
    x, at, f = flow[X], flow[AT], plan[SCALE] << 4
    end = 8 * flow[END] + flow[BEGIN]
    track[:] = 0
    d0 = d1 = d2 = d3 = 0
    for t in range(1, len(out)):
        x, at, i, f, value, ordinal, right = next_value(
            data, words, tables, plan, track, inverse, x, at, i, f, last, d0, d1, d2, d3
        )
        out[t, n] = ordinal
        d3, d2, d1, d0 = d2, d1, d0, clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last = value
        if not right or 8 * at + i > end:
            return False
    flow[X], flow[AT], flow[BIT] = x, at, i
    return good


@kernel
def read_streams(
    data: Bytes,
    words: Ints,
    at: int,
    ends: Ints,
    firsts: Ints,
    forms: Ints,
    plans: Ints,
    out: Ints,
    rests: Ints,
    tables: Tables,
) -> tuple[int, int]:
    """Decode the streams of groups, which lie one behind the other in ``data`` from ``at`` on.

    ``ends`` and ``firsts``: where each stream ends, and its first channel among ``forms``,
    ``plans`` and the columns of ``out``; one more says how many there are. ``words`` of 32 bits are
    ``data`` backwards; both have more at their ends than streams have. Returns channel and fault,
    or -1 -1. Copies are left to the caller, and so is to add ``rests``, which are as large as
    ``out`` or have no columns: ``NO_ROOM`` says that they have to.
    """
    rest = np.zeros(PLAN_SIZE, np.int64)
    rest[KIND], rest[SCALE] = CODED, 1
    settle(rest, tables.powers)
    flow = np.zeros(FLOW_SIZE, np.int64)
    track = np.zeros(TRACK_SIZE, np.int64)
    inverse = np.zeros(1, np.float64)
    for group in range(len(ends)):
        flow[AT] = ends[group - 1] if group else at
        flow[END] = ends[group]
        for n in range(firsts[group], firsts[group + 1]):
            fault = read_own_head(data, flow, forms[n], plans[n], tables.powers)
            if fault >= 0:
                return n, fault
            if plans[n, KIND] == CONSTANT:
                for t in range(len(out)):
                    out[t, n] = plans[n, ORDINAL]
        flow[X] = 0
        for n in range(firsts[group], firsts[group + 1]):
            if plans[n, KIND] == CODED:
                if flow[X] == 0 and not start_values(data, flow):
                    return n, BAD_BITS
                if not read_channel(data, words, tables, plans[n], flow, track, inverse, n, out):
                    return n, BAD_BITS
        for n in range(firsts[group], firsts[group + 1]):
            if plans[n, KIND] == CODED and plans[n, PARTS] & RESTS:  # FAST-02, LOSS-38
                if rests.shape[1] == 0:
                    return NO_ROOM, BAD_BITS
                if not read_channel(data, words, tables, rest, flow, track, inverse, n, rests):
                    return n, BAD_BITS
        if not ends_well(flow, words):
            return firsts[group + 1] - 1, BAD_BITS
    return -1, -1
