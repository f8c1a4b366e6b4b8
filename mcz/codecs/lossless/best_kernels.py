"""Compiled: the leads and tails of a segment, coded by ``best``, and regressions that predict them.

SPEC.md, "Codec 2: best", is normative and has the steps below in the same order. The functions
that code serve encoder and decoder. All is binary64 in the order written, nothing fused, so that
every machine computes the same bits.

Regressions are weighted recursive least squares, which learn while they are used. Source: S.
Haykin, *Adaptive Filter Theory*, 1986, in the covariance form; rows weigh less where the
prediction fails, as in robust regression.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mcz.codecs.coding.fast.residual_kernels import (
    BEHIND,
    REST,
    Predictors,
    Tails,
    derive_fields,
    is_read,
    read_ordinal,
)
from mcz.codecs.coding.fast.survey_kernels import CodedLanes
from mcz.codecs.coding.fast.write_kernels import put_tail
from mcz.codecs.coding.mixing import code_bits
from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_residual, side_of
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2, Words2

LIMIT = 1048576.0  # 2^20: estimates beyond it are none, targets are cut
SPIKES, LEAST = 0.3, 1e-9  # share of an error in its row's weight; least variance
EARLY_ROWS, EARLY, LATE = 20, 0.2, 0.05  # the speed at which the typical error follows
SLACK, FLOOR, AWAY = 1e-10, 1e-6, 1e300  # of pivots


class Regressions(NamedTuple):
    """Several regressions, an item each: sums of products, weights and typical errors.

    ``starts``: where the sums of each begin, a row a feature, and where the last end.
    """

    n_features: Ints
    starts: Ints
    sums: Floats
    weights: Floats2
    typical: Floats
    work: Floats  # room for the sums while they are solved
    weighted: Floats  # scratch, one row
    second: Floats


def regressions_of(n_features: Sequence[int]) -> Regressions:
    """Create untrained regressions with these numbers of features."""
    sizes = np.array(n_features, np.int64)
    widths = (sizes + 8) // 8 * 8
    starts = np.cumsum([0, *(sizes * widths)])
    most = int(sizes.max(initial=0))
    room = np.zeros(most * width_of(most)), *np.zeros((2, width_of(most)))
    weights = np.zeros((len(sizes), most))
    return Regressions(sizes, starts, np.zeros(starts[-1]), weights, np.ones(len(sizes)), *room)


def width_of(n: int) -> int:
    """Numbers in a row of sums: ``n`` features and the target, in eights."""
    return (n + 8) // 8 * 8


def bound_value(value: float) -> float:
    """``value``, or 0 for one that is too large or no number."""
    return value if abs(value) < LIMIT else 0.0


def estimate(own: Regressions, index: int, features: Floats) -> float:
    weights = own.weights[index]
    total = 0.0
    for i in range(own.n_features[index]):
        total = total + weights[i] * features[i]
    return bound_value(total)


def learn(
    own: Regressions,
    index: int,
    features: Floats,
    target: float,
    guess: float,
    keep: float,
    row: int,
) -> None:
    """Add a row to the sums of products, after multiplying them by ``keep``."""
    error, typical = target - guess, own.typical[index]  # BEST-18
    weight = 1.0 / ((typical * typical + SPIKES * (error * error)) + LEAST)
    n, sums, weighted = own.n_features[index], own.sums, own.weighted
    width = width_of(n)
    for i in range(n):
        weighted[i] = weight * features[i]
    weighted[n] = weight * target
    for i in range(n + 1, width):
        weighted[i] = 0.0
    at = own.starts[index]
    for i in range(n):
        feature = features[i]
        for j in range(i, width):
            sums[at + j] = keep * sums[at + j] + feature * weighted[j]
        at += width
    own.typical[index] = typical + (abs(error) - typical) * (EARLY if row < EARLY_ROWS else LATE)


def set_pivot(work: Floats, at: int, first: int, width: int, floor: float, row: Floats) -> float:
    """Copy a row of ``work`` and return 1 / its pivot, which is at least ``floor``."""
    for j in range(first, width):
        row[j] = work[at + j]
    if not row[first] > floor:
        row[first] = AWAY
        work[at + first] = AWAY
    return float(1.0 / row[first])


def solve(own: Regressions, index: int, ridge: float) -> None:
    """Fit the weights to the sums, by elimination without exchange; pivots have a floor."""
    n, work, one, two = own.n_features[index], own.work, own.weighted, own.second
    width, start, weights = width_of(n), own.starts[index], own.weights[index]
    for i in range(n * width):
        work[i] = own.sums[start + i]
    for i in range(n):
        at = i * width + i
        work[at] = work[at] + (ridge + SLACK * work[at])
    for k in range(0, n, 2):  # two pivots at a time: half the loads and stores
        at = k * width
        inverse = set_pivot(work, at, k, width, ridge * FLOOR, one)
        if k + 1 == n:
            break
        share, at = one[k + 1] * inverse, at + width
        for j in range(k + 1, width):
            work[at + j] = work[at + j] - share * one[j]
        second = set_pivot(work, at, k + 1, width, ridge * FLOOR, two)
        for i in range(k + 2, n):
            share, other, at = one[i] * inverse, two[i] * second, i * width
            for j in range(i, width):
                work[at + j] = (work[at + j] - share * one[j]) - other * two[j]
    for i in range(n - 1, -1, -1):
        at = i * width
        total = work[at + n]
        for j in range(i + 1, n):
            total = total - work[at + j] * weights[j]
        weights[i] = total / work[at + i]


# A row has the references of one channel: their number, then the references.
MOST_REFERENCES, MOST_IN_ALL, COUNT_BITS = 8, 4096, 4

# The regressions of a channel, and the figures of each.
LINEAR, QUADRATIC, BLEND = range(3)
N_KINDS = 3
KEEP = 0.95, 0.998, 0.98
RIDGE = 0.01, 0.001, 0.01
LINEAR_LAGS, LINEAR_REFERENCES, QUADRATIC_LAGS, N_BLENDED = 4, 6, 3, 3
FIRST_ROWS = 8  # that do not use the blend
UNIT_BITS = 2  # a unit is about four times the first scale
REACH = 64.0  # units that a level is counted in

FAST, SLOW, SIDE_1, SIDE_2 = range(4)  # columns of memories, a row a channel
NEAR, OTHER = range(2)  # of what is remembered of a row
STEPS = LINEAR_LAGS + 1
NOW, BEFORE = range(2)
LEAST_WORD, MOST_WORD = -2147483648.0, 2147483647.0
RESIDUALS = 0, 0  # first context and mixer


class Rests(NamedTuple):
    """Rests of counts, (rows, channels), and first scales, -1 of a channel without rests."""

    values: Words2
    scales: Ints


def n_linear(n_references: int) -> int:
    return LINEAR_LAGS + 2 * min(n_references, LINEAR_REFERENCES)


def n_quadratic(n_references: int) -> int:
    return QUADRATIC_LAGS + n_references + n_references * (n_references + 1) // 2


@kernel
def code_references(state: Ints, data: Bytes, references: Ints2) -> int:
    """Code the references of all channels; return how many they are, -1 if one is bad."""
    total = 0
    for channel in range(1, len(references)):
        own = references[channel]
        own[0] = code_bits(state, data, own[0], COUNT_BITS)  # BEST-08
        if own[0] > MOST_REFERENCES:  # BEST-09
            return -1
        total += own[0]
        if total > MOST_IN_ALL:  # BEST-11
            return -1
        for place in range(1, own[0] + 1):
            own[place] = code_bits(state, data, own[place], bits(channel - 1))
            if own[place] >= channel:  # BEST-10
                return -1
    return total


def set_linear(features: Floats, own: Ints, channel: int, steps: Floats2) -> None:
    """Set the features of LINEAR: the steps of a channel and of its references."""
    n = min(own[0], LINEAR_REFERENCES)
    for lag in range(LINEAR_LAGS):
        features[lag] = steps[channel, 1 + lag]
    for i in range(n):
        features[LINEAR_LAGS + i] = steps[own[1 + i], 0]
        features[LINEAR_LAGS + n + i] = steps[own[1 + i], 1]


def set_quadratic(
    features: Floats, own: Ints, channel: int, steps: Floats2, levels: Floats2
) -> None:
    """Set the features of QUADRATIC: steps, and the steps of products of two levels."""
    n = own[0]
    for lag in range(QUADRATIC_LAGS):
        features[lag] = steps[channel, 1 + lag]
    at = QUADRATIC_LAGS + n
    for i in range(n):
        one = own[1 + i]
        features[QUADRATIC_LAGS + i] = steps[one, 0]
        for j in range(i, n):
            two = own[1 + j]
            step = levels[one, NOW] * levels[two, NOW] - levels[one, BEFORE] * levels[two, BEFORE]
            features[at] = step * REACH
            at += 1


def expected_step(lanes: Predictors, leads: Words2, row: int, channel: int) -> int:
    """The step that the taps of fast expect after a row of ``leads``."""
    total = 16
    for lag in range(BEHIND):
        total += int(lanes.behind[lag, channel]) * int(leads[row - 1 - lag, channel])
    return wrapped(total) >> 5


def code_miss(state: Ints, data: Bytes, miss: int, memory: Ints, flow: Ints) -> int:
    """Code a lead minus its prediction; FAULT if it is too long."""
    near = clamp(flow[NEAR] + 3, 0, 7)
    sides = memory[SIDE_1], memory[SIDE_2], flow[OTHER]
    scales = memory[FAST], memory[SLOW]
    return code_residual(state, data, miss, scales, near, sides, RESIDUALS)


def update_memory(miss: int, memory: Ints) -> None:
    size = 16 * abs(miss)  # BEST-15
    memory[FAST] += (size - memory[FAST]) >> 1
    memory[SLOW] += (size - memory[SLOW]) >> 5
    memory[SIDE_2], memory[SIDE_1] = memory[SIDE_1], side_of(miss)


def code_rest(state: Ints, data: Bytes, rest: int, memory: Ints, flow: Ints) -> int:
    """Code the error of a count; FAULT if it is too long."""
    rest_code = code_miss(state, data, rest, memory, flow)
    if rest_code == FAULT or rest_code >> 31 != rest_code >> 63:  # BEST-14
        return FAULT
    update_memory(rest_code, memory)  # BEST-13
    return rest_code


def echo_of(leads: Words2, place: int) -> int:
    """The lead at place |``place``|, counted from 1 over all rows; negated if ``place`` < 0."""
    at = abs(place) - 1
    n_channels = leads.shape[1]
    lead = int(leads[BEHIND + at // n_channels, at % n_channels])
    return lead if place > 0 else -1 - lead


@kernel
def code_leads(
    state: Ints,
    data: Bytes,
    lanes: Predictors,
    references: Ints2,
    own: Regressions,
    echoes: Ints2,
    leads: Words2,
    rests: Rests,
) -> int:
    """Code rests, and all rows but the first of ``leads``, in place; return a bad row or -1.

    ``leads`` (BEHIND + rows, channels): the first rows are those before the first. ``own``:
    N_KINDS regressions a channel. ``echoes``: those of ``table_of``.
    """
    n_channels = leads.shape[1]
    memories, rest_memories = (
        np.zeros((n_channels, 4), np.int64),
        np.zeros((n_channels, 4), np.int64),
    )
    units = np.zeros(n_channels, np.float64)
    for channel in range(n_channels):
        memories[channel, FAST] = memories[channel, SLOW] = lanes.scales[channel]
        rest_memories[channel, FAST] = rest_memories[channel, SLOW] = rests.scales[channel]
        units[channel] = float(1 << (bits(lanes.scales[channel] >> 4) + UNIT_BITS))
        for row in range(BEHIND + 1):
            leads[row, channel] = lanes.first[channel]
    flow = np.zeros(2, np.int64)
    steps = np.zeros((n_channels, STEPS), np.float64)
    levels = np.zeros((n_channels, 2), np.float64)
    linear = np.zeros(own.weights.shape[1], np.float64)
    quadratic = np.zeros(own.weights.shape[1], np.float64)
    opinions = np.zeros(N_BLENDED, np.float64)
    for row in range(len(leads) - BEHIND):
        flow[NEAR], flow[OTHER] = 0, 3
        for channel in range(n_channels):
            for lag in range(STEPS - 1, 0, -1):
                steps[channel, lag] = steps[channel, lag - 1]
            levels[channel, BEFORE] = levels[channel, NOW]
        for channel in range(n_channels):
            if rests.scales[channel] >= 0:
                rest = int(rests.values[row, channel])
                rest = code_rest(state, data, rest, rest_memories[channel], flow)
                if rest == FAULT:
                    return row
                rests.values[row, channel] = wrapped(rest)
            if row == 0:
                continue
            index, unit = N_KINDS * channel, units[channel]
            last, first = float(leads[BEHIND + row - 1, channel]), float(lanes.first[channel])
            is_echo = len(echoes) > 0 and echoes[row, channel] != 0
            guess = 0.0
            if is_echo:  # BEST-24
                leads[BEHIND + row, channel] = wrapped(echo_of(leads, echoes[row, channel]))
            else:
                set_linear(linear, references[channel], channel, steps)  # BEST-17
                set_quadratic(quadratic, references[channel], channel, steps, levels)
                opinions[LINEAR] = estimate(own, index + LINEAR, linear)
                opinions[QUADRATIC] = estimate(own, index + QUADRATIC, quadratic)
                taps = expected_step(lanes, leads, BEHIND + row, channel)
                opinions[BLEND] = bound_value(float(taps) / unit)
                guess = opinions[BLEND]
                if row >= FIRST_ROWS:
                    guess = estimate(own, index + BLEND, opinions)
                place = np.floor(last + guess * unit + 0.5)
                predicted = int(min(max(place, LEAST_WORD), MOST_WORD))
                given = int(leads[BEHIND + row, channel])
                miss = code_miss(state, data, given - predicted, memories[channel], flow)
                lead = predicted + miss
                if miss == FAULT or lead >> 31 != lead >> 63:  # BEST-16
                    return row
                size = bits(16 * abs(miss))
                flow[NEAR] = (flow[NEAR] + size - bits(memories[channel, SLOW])) >> 1
                update_memory(miss, memories[channel])
                flow[OTHER] = memories[channel, SIDE_1]
                leads[BEHIND + row, channel] = wrapped(lead)
            lead_now = float(leads[BEHIND + row, channel])
            step = min(max((lead_now - last) / unit, -LIMIT), LIMIT)
            steps[channel, 0] = step
            levels[channel, NOW] = (lead_now - first) / (REACH * unit)
            if is_echo:
                continue
            learn(own, index + LINEAR, linear, step, opinions[LINEAR], KEEP[LINEAR], row)
            solve(own, index + LINEAR, RIDGE[LINEAR])
            at = index + QUADRATIC
            learn(own, at, quadratic, step, opinions[QUADRATIC], KEEP[QUADRATIC], row)
            if (row + channel) % 2 == 0:
                solve(own, at, RIDGE[QUADRATIC])
            learn(own, index + BLEND, opinions, step, guess, KEEP[BLEND], row)
            solve(own, index + BLEND, RIDGE[BLEND])
    return -1


@kernel
def read_ordinals(tails: Tails, lattices: Ints2, leads: Words2, echoes: Ints2, out: Ints2) -> int:
    """Fill columns of ``out`` (rows, channels) from ``leads`` (rows, lanes) and tails.

    Returns the lane that has no tail, -2 if bits are left, or -1.
    """
    bit, end = tails.bits[0], tails.ends[0]
    columns = tails.columns
    n_lanes = len(lattices)
    for lane in range(n_lanes):
        derive_fields(lattices, lane)
    for row in range(len(out)):
        for lane in range(n_lanes):
            place = echoes[row, lane] if len(echoes) > 0 else 0
            if place != 0:  # BEST-24
                at = abs(place) - 1
                ordinal = int(out[at // n_lanes, columns[at % n_lanes]])
                out[row, columns[lane]] = ordinal if place > 0 else -1 - ordinal
                continue
            ordinal, bit = read_ordinal(tails.data, bit, int(leads[row, lane]), lattices, lane)
            if bit < 0 or bit > end:
                return lane
            out[row, columns[lane]] = ordinal
    return -1 if is_read(tails.data, bit, end) else -2


@kernel
def write_tails(lanes: CodedLanes, columns: Ints2, echoes: Ints2, out: Bytes) -> int:
    """Write the tails of lanes that have no rests, one group; returns their bytes."""
    out[0] = 0
    bit = 0
    for row in range(columns.shape[1]):
        for lane in range(len(lanes.numbers)):
            is_echo = len(echoes) > 0 and echoes[row, lane] != 0
            if is_echo or lanes.lattices[lane, REST] >= 0:
                continue
            tail, lead = columns[lanes.numbers[lane], row], int(lanes.leads[lane, row])
            bit = put_tail(out, bit, tail, lead, lanes.lattices, lane)
    return (bit + 7) >> 3
