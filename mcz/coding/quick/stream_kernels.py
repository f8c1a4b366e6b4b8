"""Compiled: the streams of a segment, as ``fast``, decodes them.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from typing import NamedTuple

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
    Tables,
    bits_at,
    clamp,
    first_value,
    next_value,
    settle,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

# Of a lane, which decodes one stream after the other: the state, or 0; the offset of the next head
# or word; the next bit, and the first one; where the stream ends; its first channel, the next one
# and one more than the last one, which is 0 where nothing is left to decode.
X, AT, BIT, BEGIN, END, FIRST, CHANNEL, STOP = range(8)
FLOW_SIZE = 8
LANES = 2
NO_ROOM = -2  # in place of a channel: there are rests, and no room for them


class Streams(NamedTuple):
    """Streams of groups, one behind the other in ``data``, which has more at both ends.

    ``bounds``: where each stream begins, and the last one ends; ``firsts``: its first channel among
    ``forms``, and how many there are.
    """

    data: Bytes
    bounds: Ints
    firsts: Ints
    forms: Ints


class Rows(NamedTuple):
    """What is decoded, (rows, channels); ``rests``: what is to be added, perhaps no columns."""

    ordinals: Ints2
    rests: Ints2


def read_own_head(data: Bytes, flow: Ints, form: int, plan: Ints, powers: Ints2) -> int:
    """Read the next head of a stream; -1, or what is wrong with it."""
    at, fault = read_head(data, flow[AT], flow[END], form, plan, powers)
    if at < 0:
        return fault
    flow[AT] = at
    if plan[KIND] == CODED:
        settle(plan, powers)
    return -1


def start_values(data: Bytes, flow: Ints) -> bool:
    """Read the state behind the heads; whether it is one."""
    at = flow[AT]
    x = int(data[at]) | int(data[at + 1]) << 8 | int(data[at + 2]) << 16 | int(data[at + 3]) << 24
    flow[X], flow[AT] = x, at + 4
    flow[BEGIN] = flow[BIT] = 8 * (len(data) - flow[END])
    return x >= LEAST_STATE  # FAST-07


def ends_well(data: Bytes, flow: Ints) -> bool:
    """Whether a stream that is decoded has neither words nor bits left."""
    if flow[X] == 0:  # nor had it any
        nothing: bool = flow[AT] == flow[END]  # FAST-06
        return nothing
    i = flow[BIT]
    whole = flow[AT] + (i - flow[BEGIN] + 7 >> 3) == flow[END]  # FAST-17
    spare = bits_at(data, i, -i & 7)
    if spare != 0:  # FAST-17
        return False
    started: bool = flow[X] == LEAST_STATE  # FAST-16
    return whole and started


def read_channel(
    streams: Streams,
    tables: Tables,
    plan: Ints,
    flow: Ints,
    track: Ints,
    inverse: Floats,
    n: int,
    out: Ints2,
) -> bool:
    """Decode a channel of a stream to column ``n`` of ``out``; False where that fails."""
    data, column = streams.data, out[:, n]
    i, last, ordinal, good = first_value(data, flow[BIT], plan, tables.powers)
    column[0] = ordinal
    x, at, f = flow[X], flow[AT], plan[SCALE] << 4
    end = 8 * flow[END] + flow[BEGIN]
    track[:] = 0
    d0 = d1 = d2 = d3 = 0
    for t in range(1, len(out)):
        x, at, i, f, value, ordinal, right = next_value(
            data, tables, plan, track, inverse, x, at, i, f, last, d0, d1, d2, d3
        )
        column[t] = ordinal
        d3, d2, d1, d0 = d2, d1, d0, clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last = value
        if not right or 8 * at + i > end:
            return False
    flow[X], flow[AT], flow[BIT] = x, at, i
    return good


def read_two(
    streams: Streams,
    tables: Tables,
    plans: Ints2,
    flows: Ints2,
    tracks: Ints2,
    inverses: Floats2,
    out: Ints2,
) -> int:
    """Decode the next channels of both lanes, as ``read_channel`` does; the lane that fails, or -1.

    Each value waits for the one before it: here that of the other lane is worked on meanwhile.
    """
    data = streams.data
    flow, flow_b = flows[0], flows[1]
    n, n_b = flow[CHANNEL], flow_b[CHANNEL]
    plan, plan_b = plans[n], plans[n_b]
    track, track_b, inverse, inverse_b = tracks[0], tracks[1], inverses[0], inverses[1]
    i, last, ordinal, good = first_value(data, flow[BIT], plan, tables.powers)
    i_b, last_b, ordinal_b, good_b = first_value(data, flow_b[BIT], plan_b, tables.powers)
    column, column_b = out[:, n], out[:, n_b]
    column[0], column_b[0] = ordinal, ordinal_b
    x, at, f, end = flow[X], flow[AT], plan[SCALE] << 4, 8 * flow[END] + flow[BEGIN]
    x_b, at_b, f_b = flow_b[X], flow_b[AT], plan_b[SCALE] << 4
    end_b = 8 * flow_b[END] + flow_b[BEGIN]
    track[:] = 0
    track_b[:] = 0
    d0 = d1 = d2 = d3 = e0 = e1 = e2 = e3 = 0
    for t in range(1, len(out)):
        x, at, i, f, value, ordinal, right = next_value(
            data, tables, plan, track, inverse, x, at, i, f, last, d0, d1, d2, d3
        )
        column[t] = ordinal
        x_b, at_b, i_b, f_b, value_b, ordinal_b, right_b = next_value(
            data,
            tables,
            plan_b,
            track_b,
            inverse_b,
            x_b,
            at_b,
            i_b,
            f_b,
            last_b,
            e0,
            e1,
            e2,
            e3,
        )
        column_b[t] = ordinal_b
        d3, d2, d1, d0 = d2, d1, d0, clamp(value - last, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        e3, e2, e1, e0 = e2, e1, e0, clamp(value_b - last_b, -MAX_DIFFERENCE, MAX_DIFFERENCE)
        last, last_b = value, value_b
        if not right or 8 * at + i > end:
            return 0
        if not right_b or 8 * at_b + i_b > end_b:
            return 1
    flow[X], flow[AT], flow[BIT] = x, at, i
    flow_b[X], flow_b[AT], flow_b[BIT] = x_b, at_b, i_b
    if not good:
        return 0
    return -1 if good_b else 1


def open_stream(
    streams: Streams, group: int, plans: Ints2, powers: Ints2, flow: Ints, out: Ints2
) -> int:
    """Read the heads of a stream and fill in its constants.

    Returns what is wrong with channel ``flow[CHANNEL]``, or -1.
    """
    flow[AT], flow[END] = streams.bounds[group], streams.bounds[group + 1]
    flow[FIRST], flow[STOP] = streams.firsts[group], streams.firsts[group + 1]
    flow[X] = 0
    coded = flow[STOP]
    for n in range(flow[FIRST], flow[STOP]):
        flow[CHANNEL] = n
        fault = read_own_head(streams.data, flow, streams.forms[n], plans[n], powers)
        if fault >= 0:
            return fault
        if plans[n, KIND] == CONSTANT:
            for t in range(len(out)):
                out[t, n] = plans[n, ORDINAL]
        elif plans[n, KIND] == CODED:
            coded = min(coded, n)
    flow[CHANNEL] = coded
    if coded < flow[STOP] and not start_values(streams.data, flow):
        return BAD_BITS
    return -1


def close_stream(
    streams: Streams,
    tables: Tables,
    plans: Ints2,
    rest: Ints,
    flow: Ints,
    track: Ints,
    inverse: Floats,
    rests: Ints2,
) -> int:
    """Decode the rests of a stream whose channels are decoded: a channel that fails, or -1."""
    for n in range(flow[FIRST], flow[STOP]):
        if plans[n, KIND] == CODED and plans[n, PARTS] & RESTS:  # FAST-02, LOSS-38
            if rests.shape[1] == 0:
                return NO_ROOM
            if not read_channel(streams, tables, rest, flow, track, inverse, n, rests):
                return n
    return -1 if ends_well(streams.data, flow) else flow[STOP] - 1


@kernel
def read_streams(streams: Streams, plans: Ints2, rows: Rows, tables: Tables) -> tuple[int, int]:
    """Decode streams: fill ``plans`` and ``rows.ordinals``, all but copies.

    Returns channel and fault, or -1 -1. To add rests is left to the caller; ``NO_ROOM`` says that
    there have to be columns for them.
    """
    rest = np.zeros(PLAN_SIZE, np.int64)
    rest[KIND], rest[SCALE] = CODED, 1
    settle(rest, tables.powers)
    flows = np.zeros((LANES, FLOW_SIZE), np.int64)
    tracks = np.zeros((LANES, TRACK_SIZE), np.int64)
    inverses = np.zeros((LANES, 1), np.float64)
    out, opened, n_streams = rows.ordinals, 0, len(streams.bounds) - 1
    while True:
        for lane in range(LANES):
            flow = flows[lane]
            while flow[CHANNEL] < flow[STOP] and plans[flow[CHANNEL], KIND] != CODED:
                flow[CHANNEL] += 1
            while flow[CHANNEL] == flow[STOP] and (flow[STOP] or opened < n_streams):
                if flow[STOP]:
                    failed = close_stream(
                        streams, tables, plans, rest, flow, tracks[lane], inverses[lane], rows.rests
                    )
                    if failed != -1:
                        return failed, BAD_BITS
                    flow[CHANNEL] = flow[STOP] = 0
                if opened < n_streams:
                    fault = open_stream(streams, opened, plans, tables.powers, flow, out)
                    if fault >= 0:
                        return flow[CHANNEL], fault
                    opened += 1
        if flows[0, STOP] and flows[1, STOP]:
            failed = read_two(streams, tables, plans, flows, tracks, inverses, out)
            if failed >= 0:
                return flows[failed, CHANNEL], BAD_BITS
            for lane in range(LANES):
                flows[lane, CHANNEL] += 1
            continue
        lane = 0 if flows[0, STOP] else 1
        if flows[lane, STOP] == 0:
            return -1, -1
        n = flows[lane, CHANNEL]
        if not read_channel(
            streams, tables, plans[n], flows[lane], tracks[lane], inverses[lane], n, out
        ):
            return n, BAD_BITS
        flows[lane, CHANNEL] = n + 1
