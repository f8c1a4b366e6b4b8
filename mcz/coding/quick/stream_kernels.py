"""Compiled: the streams of a segment, two at a time, so that neither waits for itself.

SPEC.md, "Codec 14: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.coding.quick.head_kernels import BAD_BITS, read_head
from mcz.coding.quick.kernels import (
    BASE,
    CODED,
    CONSTANT,
    KIND,
    LEAST_STATE,
    MAX_DIFFERENCE,
    ORDINAL,
    PLAN_SIZE,
    QUARTERS,
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

# Columns of flows, one row a stream that is being decoded: its state, the offset of the next word,
# the next bit, the bit that is its first one, where it ends, its next channel, and the end of these.
X, AT, BIT, BEGIN, END, CHANNEL, STOP = range(7)
FLOW_SIZE = 7


@inner
def next_coded(plans: Ints, flow: Ints) -> None:
    """Let the flow stand at its next coded channel, or at its end."""
    while flow[CHANNEL] < flow[STOP] and plans[flow[CHANNEL], KIND] != CODED:
        flow[CHANNEL] += 1


@inner
def open_stream(
    data: Bytes, flow: Ints, forms: Ints, plans: Ints, out: Ints, powers: Ints
) -> int:
    """Read the heads of a stream, and its state; returns -1, or a fault of the channel noted."""
    at, first = flow[AT], flow[CHANNEL]
    while flow[CHANNEL] < flow[STOP]:
        n = flow[CHANNEL]
        at, fault = read_head(data, at, flow[END], forms[n], plans[n], powers)
        if at < 0:
            return fault
        if plans[n, KIND] == CONSTANT:
            for t in range(len(out)):
                out[t, n] = plans[n, ORDINAL]
        elif plans[n, KIND] == CODED:
            settle(plans[n], powers)
        flow[CHANNEL] += 1
    flow[CHANNEL] = first
    next_coded(plans, flow)
    flow[X], flow[AT] = LEAST_STATE, at
    if flow[CHANNEL] < flow[STOP]:
        flow[X] = int(data[at]) | int(data[at + 1]) << 8
        flow[X] |= int(data[at + 2]) << 16 | int(data[at + 3]) << 24
        flow[AT] = at + 4
    flow[BEGIN] = flow[BIT] = 8 * (len(data) - flow[END])
    return BAD_BITS if flow[X] < LEAST_STATE else -1


@inner
def ends_well(flow: Ints, words: Ints) -> bool:
    """Whether a stream that is decoded has neither words nor bits left."""
    i = flow[BIT]
    whole = flow[AT] + (i - flow[BEGIN] + 7 >> 3) == flow[END]
    return flow[X] == LEAST_STATE and whole and bits_at(words, i, -i & 7) == 0


@inner
def begin_column(
    words: Ints, flow: Ints, plan: Ints, track: Ints, powers: Ints
) -> tuple[int, int, bool]:
    """Decode the first value of a channel: in fixed point, its ordinal, and whether it is right."""
    for place in range(TRACK_SIZE):
        track[place] = 0
    i, value, ordinal, good = first_value(words, flow[BIT], plan, powers)
    flow[BIT] = i
    return value, ordinal, good


@inner
def read_columns(
    data: Bytes,
    words: Ints,
    tables: Tables,
    plans: Ints,
    flows: Ints,
    tracks: Ints,
    inverses: Floats,
    both: bool,
    out: Ints,
) -> int:
    """Decode the next channel of the first flow and, where ``both``, that of the second.

    Returns -1, or the number of one that cannot be decoded.
    """
    flow_a, flow_b = flows[0], flows[1]
    track_a, track_b = tracks[0], tracks[1]
    inverse_a, inverse_b = inverses[0], inverses[1]
    n = flow_a[CHANNEL]
    m = flow_b[CHANNEL] if both else n
    plan_a, plan_b = plans[n], plans[m]
    last_a, ordinal, good = begin_column(words, flow_a, plan_a, track_a, tables.powers)
    if not good:
        return n
    out[0, n] = ordinal
    last_b = 0
    if both:
        last_b, ordinal, good = begin_column(words, flow_b, plan_b, track_b, tables.powers)
        if not good:
            return m
        out[0, m] = ordinal
    x, at, i, f = flow_a[X], flow_a[AT], flow_a[BIT], plan_a[SCALE] << 4
    y, to, j, g = flow_b[X], flow_b[AT], flow_b[BIT], plan_b[SCALE] << 4
    end_a, end_b = 8 * flow_a[END] + flow_a[BEGIN], 8 * flow_b[END] + flow_b[BEGIN]
    a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = 0
    for t in range(1, len(out)):
        x, at, i, f, value, ordinal, good = next_value(
            data, words, tables, plan_a, track_a, inverse_a, x, at, i, f, last_a, a0, a1, a2, a3
        )
        out[t, n] = ordinal
        a3, a2, a1, a0 = a2, a1, a0, clamp(value - last_a, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last_a = value
        if not good or 8 * at + i > end_a:
            return n
        if both:
            y, to, j, g, value, ordinal, good = next_value(
                data, words, tables, plan_b, track_b, inverse_b, y, to, j, g, last_b, b0, b1, b2, b3
            )
            out[t, m] = ordinal
            b3, b2, b1, b0 = b2, b1, b0, clamp(value - last_b, -MAX_DIFFERENCE, MAX_DIFFERENCE)
            last_b = value
            if not good or 8 * to + j > end_b:
                return m
    flow_a[X], flow_a[AT], flow_a[BIT] = x, at, i
    flow_a[CHANNEL] += 1
    if both:
        flow_b[X], flow_b[AT], flow_b[BIT] = y, to, j
        flow_b[CHANNEL] += 1
    return -1


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
    tables: Tables,
) -> tuple[int, int]:
    """Decode the streams of groups, which lie one behind the other in ``data`` from ``at`` on.

    ``ends`` and ``firsts``: where each stream ends, and its first channel among ``forms``, ``plans``
    and the columns of ``out``; one more says how many there are. ``words`` of 32 bits are ``data``
    backwards; both have more at their ends than streams have. Returns channel and fault, or -1 -1.
    Copies are left to the caller.
    """
    flows = np.zeros((2, FLOW_SIZE), np.int64)
    tracks = np.zeros((2, TRACK_SIZE), np.int64)
    inverses = np.zeros((2, 1), np.float64)
    opened = 0
    working = True
    while working:
        for lane in range(2):
            flow = flows[lane]
            while flow[CHANNEL] == flow[STOP] and opened < len(ends):
                flow[AT] = ends[opened - 1] if opened else at
                flow[END], flow[CHANNEL], flow[STOP] = ends[opened], firsts[opened], firsts[opened + 1]
                opened += 1
                fault = open_stream(data, flow, forms, plans, out, tables.powers)
                if fault >= 0:
                    return flow[CHANNEL], fault
                if flow[CHANNEL] == flow[STOP] and not ends_well(flow, words):
                    return flow[STOP] - 1, BAD_BITS
        if flows[0, CHANNEL] == flows[0, STOP]:  # the second one goes on alone
            for place in range(FLOW_SIZE):
                flows[0, place] = flows[1, place]
            flows[1, CHANNEL] = flows[1, STOP]
        working = flows[0, CHANNEL] < flows[0, STOP]
        both = flows[1, CHANNEL] < flows[1, STOP]
        if working:
            wrong = read_columns(data, words, tables, plans, flows, tracks, inverses, both, out)
            if wrong >= 0:
                return wrong, BAD_BITS
            for lane in range(2 if both else 1):
                next_coded(plans, flows[lane])
                if flows[lane, CHANNEL] == flows[lane, STOP] and not ends_well(flows[lane], words):
                    return flows[lane, STOP] - 1, BAD_BITS
    return -1, -1
