"""Write the streams of groups of one segment, and choose the parents of lanes.

SPEC.md, "Codec 1: fast", is normative for the bytes; the choice of a plan is not: any plan decodes.
A parent has no parent, so that its residuals do not change. Compiled functions choose such roots
one by one, as in greedy facility location.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast import (
    decode_kernels,
    plan_kernels,
    residual_kernels,
    survey_kernels,
    write_kernels,
)
from mcz.codecs.coding.fast.decode_kernels import (
    BASE,
    DIGITS,
    DROP,
    FIELDS,
    FORM,
    LINK,
    REST,
    TOP,
    WEIGHT,
)
from mcz.codecs.coding.fast.plan_kernels import TRIED_ROWS, cost_of
from mcz.codecs.coding.fast.survey_kernels import Channels, CodedLanes
from mcz.codecs.coding.forms import BINARY32, form_of_grid, has_binary32, unit_grid
from mcz.codecs.coding.forms.counts import may_be_counts
from mcz.codecs.coding.forms.units import find_units, tiny_limit
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Floats, Floats2, Ints, Ints2, Words, Words2
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Bools

PARENT_COST = 36  # bits
SEEN_ROWS = 96  # sampled rows on which parents are compared
ROWS_AT_ONCE = 4
REACH = 160  # lanes before and after a lane that may be its parent
LEAST_GAIN = 60.0  # bits, before a parent is tried
MOST_WEIGHT = 32000


def sample_residuals(residuals: Words2, lane: int, n_samples: int, samples: Floats2) -> None:
    """Fill a column of ``samples`` with residuals from the whole lane."""
    step = (residuals.shape[1] - 1) // n_samples
    for row in range(n_samples):
        samples[row, lane] = float(int(residuals[lane, 1 + row * step]))


def share_rows(samples: Floats2, lane: int, n_samples: int, shares: Floats) -> float:
    """Fill ``shares`` with weights of rows, less for great residuals; return the energy."""
    size = 0.0
    for row in range(n_samples):
        size += abs(samples[row, lane])
    size = 0.35 * size / n_samples + 0.5
    total = 1e-9
    for row in range(n_samples):
        own = samples[row, lane]
        shares[row] = 1.0 / (abs(own) + size)
        total += shares[row] * own * own
    return total


def add_products(
    samples: Floats2, lane: int, start: int, shares: Floats, both: Floats, squares: Floats
) -> None:
    """Fill ``both`` with a lane's products with lanes from ``start`` on, and ``squares``."""
    stop = start + len(both)
    for other in range(len(both)):
        both[other], squares[other] = 0.0, 1e-9
    for row in range(0, len(samples), ROWS_AT_ONCE):
        own1, own2, own3 = samples[row, lane], samples[row + 1, lane], samples[row + 2, lane]
        own4, share1, share2 = samples[row + 3, lane], shares[row], shares[row + 1]
        share3, share4 = shares[row + 2], shares[row + 3]
        others1, others2 = samples[row, start:stop], samples[row + 1, start:stop]
        others3, others4 = samples[row + 2, start:stop], samples[row + 3, start:stop]
        for other in range(len(both)):  # short loops are vectorised
            shared1, shared2 = share1 * others1[other], share2 * others2[other]
            shared3, shared4 = share3 * others3[other], share4 * others4[other]
            product = both[other] + shared1 * own1 + shared2 * own2
            both[other] = product + shared3 * own3 + shared4 * own4
            square = squares[other] + shared1 * others1[other] + shared2 * others2[other]
            squares[other] = square + shared3 * others3[other] + shared4 * others4[other]


def weigh(both: float, square: float, total: float) -> tuple[float, float]:
    """The share of the energy that a parent removes, and its weight in 256ths; 0 if too large."""
    weight = np.rint(256.0 * both / square)
    if not abs(weight) < MOST_WEIGHT:
        return 0.0, 0.0
    slope = weight / 256.0
    return min((2.0 * slope * both - slope * slope * square) / total, 0.999), weight


def subtract_parent(own: Words, other: Words, weight: int, trial: Words) -> None:
    """Fill ``trial`` with a lane's residuals less the prediction from its parent's."""
    for row in range(1, len(own)):
        crossed = wrapped(128 + weight * int(other[row])) >> 8
        trial[row] = wrapped(int(own[row]) - crossed)


def is_open(others: Ints2, child: int, group: int) -> bool:
    """Return True if lanes of group ``child`` may have parents in ``group``."""
    one, two = others[child, 0], others[child, 1]
    return child == group or one == group or two == group or one < 0 or two < 0


def open_group(others: Ints2, child: int, group: int) -> None:
    if child != group and others[child, 0] != group and others[child, 1] != group:
        others[child, 0 if others[child, 0] < 0 else 1] = group


def gain_of(gains: Floats2, bests: Floats, groups: Ints, others: Ints2, root: int) -> float:
    """The bits saved if ``root`` becomes a root, and so loses its parent."""
    gain = -max(float(bests[root]), 0.0)
    for lane in range(max(0, root - REACH), min(len(bests), root + REACH + 1)):
        own = gains[lane, root - lane + REACH]
        if 0.0 <= bests[lane] < own and is_open(others, groups[lane], groups[root]):
            gain += own - bests[lane]
    return float(gain)


def choose_roots(gains: Floats2, groups: Ints, parents: Ints) -> None:
    """Fill ``parents``, greedily: the root that saves most comes first; -1 for a root."""
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


def find_gains(residuals: Words2, samples: Floats2, n_samples: int, gains: Floats2) -> None:
    """Fill ``gains``, (lanes, 2 * REACH + 1), with the bits that others would save as parents."""
    n_lanes, n_rows = residuals.shape
    shares = np.zeros(len(samples), np.float64)
    both, squares = np.zeros(n_lanes, np.float64), np.zeros(n_lanes, np.float64)
    least = 1.0 - 0.5 ** (2.0 * LEAST_GAIN / n_rows)
    for lane in range(n_lanes):
        start, stop = max(0, lane - REACH), min(n_lanes, lane + REACH + 1)
        total = share_rows(samples, lane, n_samples, shares)
        add_products(samples, lane, start, shares, both[: stop - start], squares[: stop - start])
        for other in range(start, stop):
            part, _ = weigh(both[other - start], squares[other - start], total)
            if part > least and other != lane:
                gains[lane, other - lane + REACH] = -0.5 * n_rows * np.log2(1.0 - part)


@kernel
def choose_parents(lanes: CodedLanes, plans: Ints2) -> None:
    """Choose parents and weights in ``plans``; subtract them from the residuals.

    A group has parents in at most two other groups.
    """
    residuals, numbers, costs = lanes.residuals, lanes.numbers, lanes.costs
    n_lanes, n_rows = residuals.shape
    groups, parents = np.zeros(n_lanes, np.int64), np.zeros(n_lanes, np.int64)
    n_samples = min(n_rows - 1, SEEN_ROWS)
    n_blocks = (n_samples + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE
    samples = np.zeros((ROWS_AT_ONCE * n_blocks, n_lanes), np.float64)  # 0 after n_seen
    for group in range(len(lanes.starts) - 1):
        for lane in range(lanes.starts[group], lanes.starts[group + 1]):
            groups[lane], parents[lane] = group, -1
            sample_residuals(residuals, lane, n_samples, samples)
    gains = np.zeros((n_lanes, 2 * REACH + 1), np.float64)
    find_gains(residuals, samples, n_samples, gains)
    choose_roots(gains, groups, parents)
    shares, sums = np.zeros(len(samples), np.float64), np.zeros((2, 1), np.float64)
    trial = np.zeros(n_rows, np.int32)
    times = max(int(n_rows) // TRIED_ROWS, 1)
    for lane in range(n_lanes):
        parent = parents[lane]
        if parent < 0:
            continue
        total = share_rows(samples, lane, n_samples, shares)
        add_products(samples, lane, parent, shares, sums[0], sums[1])
        _, weight = weigh(sums[0, 0], sums[1, 0], total)
        subtract_parent(residuals[lane], residuals[parent], int(weight), trial)
        saved = costs[lane] - cost_of(trial, lanes.scales[lane], costs[lane])
        if saved * times > PARENT_COST:
            plans[numbers[lane], LINK], plans[numbers[lane], WEIGHT] = numbers[parent], int(weight)
            residuals[lane] = trial


FEWEST_ROWS = 32  # for a search of parents
VALUE_BYTES = 20  # bound for a residual with its tail, a run or an exception
HEAD_BYTES = 128  # bound for a head without runs and exceptions, and for the size of residuals
SPARE = 16  # bytes after the end that may be overwritten
ANY = 2**62  # above all magnitudes


@dataclass(frozen=True, slots=True)
class Plan:
    """A segment to write: its channels, the coded ones, the fields of all units."""

    channels: Channels
    lanes: CodedLanes
    fields: NDArray[np.uint8]

    @property
    def most_bytes(self) -> int:
        """An upper bound of the bytes of a stream, and of its parts."""
        sizes = self.channels.ordinals.size * VALUE_BYTES, len(self.channels.plans) * HEAD_BYTES
        return sum(sizes) + SPARE


class StreamBuilder:
    """Builds the streams of a signal, segment by segment."""

    def __init__(self, clip_grids: Sequence[Grid], groups: Sequence[Sequence[int]]) -> None:
        """``clip_grids``: the grid of each channel as CLIP states it."""
        sizes = list(map(len, groups))
        self.numbers = np.array([number for group in groups for number in group], np.int64)
        self.firsts = np.cumsum([0, *sizes])
        self.groups = np.repeat(np.arange(len(groups)), sizes)
        self.clip_grids = tuple(clip_grids[number] for number in self.numbers.tolist())
        self.clip_forms = _forms(self.clip_grids)
        self._set_grids(tuple(clip_grids))

    def _set_grids(self, signal_grids: tuple[Grid, ...]) -> None:
        self._signal_grids = signal_grids
        self.grids = tuple(signal_grids[number] for number in self.numbers.tolist())
        self.forms = _forms(self.grids)
        pairs = list(zip(self.grids, self.clip_grids, strict=True))
        limits = {pair: _unit_limit(*pair) for pair in dict.fromkeys(pairs)}
        self.unit_limits = np.array([limits[pair] for pair in pairs], np.int64)
        self.may_be_counts = np.array(
            [grid == clip_grid and grid.kind == GridKind.GENERAL for grid, clip_grid in pairs],
            np.bool_,
        )

    def build(self, ordinals: Ints, grids: tuple[Grid, ...]) -> tuple[bytes, ...]:
        """The streams of a segment, ``ordinals`` (rows, channels); ``grids``: those in force."""
        return self.write(self.plan(ordinals, grids))

    def plan(self, ordinals: Ints, grids: tuple[Grid, ...]) -> Plan:
        """The heads of a segment, without parents, and its lanes."""
        if grids != self._signal_grids:
            self._set_grids(grids)
        channels = self._channels(ordinals)
        survey_kernels.survey(channels)
        rests, fields = self._find_units(channels)
        survey_kernels.choose_steps(channels)
        lanes = self._find_leads(channels)
        for n, column in rests.items():
            channels.columns[n] = column  # in the place of tails
        plan_kernels.choose_predictors(lanes, channels.plans)
        return Plan(channels, lanes, np.frombuffer(fields, np.uint8))

    def write(self, plan: Plan) -> tuple[bytes, ...]:
        """The streams of a plan with parents."""
        if len(plan.lanes.numbers) > 1 and len(plan.channels.ordinals) >= FEWEST_ROWS:
            choose_parents(plan.lanes, plan.channels.plans)
        buffers = np.empty((3, plan.most_bytes), np.uint8)
        ends = np.empty(len(self.firsts) - 1, np.int64)
        write_kernels.write_streams(plan.channels, plan.lanes, plan.fields, buffers, ends)
        stops = ends.tolist()
        starts = [0, *stops[:-1]]
        return tuple(buffers[0, a:b].tobytes() for a, b in zip(starts, stops, strict=False))

    def _channels(self, ordinals: Ints) -> Channels:
        columns = np.empty((len(self.numbers), len(ordinals)), np.int64)
        plans = np.zeros((len(self.numbers), survey_kernels.PLAN_SIZE), np.int64)
        result: Channels = survey_kernels.Channels(
            ordinals,
            self.numbers,
            self.firsts,
            self.groups,
            self.forms,
            self.clip_forms,
            columns,
            plans,
        )
        return result

    def _find_units(self, channels: Channels) -> tuple[dict[int, Ints], bytes]:
        """Code channels in units if possible; returns rests, and the fields of all units."""
        plans = channels.plans
        candidates = self._find_candidates(channels)
        rests: dict[int, Ints] = {}
        fields = b""
        for n in np.flatnonzero(candidates).tolist():
            column = np.ascontiguousarray(channels.ordinals[:, self.numbers[n]])
            units = find_units(column, self.grids[n], every=self.grids[n] == self.clip_grids[n])
            if units is None:
                continue
            leads, own, rest = units.integers, units.fields, units.rests
            if int((leads ^ (leads >> 63)).max()) >> survey_kernels.LEAD_BITS:
                continue
            channels.columns[n] = leads
            rest_scale = -1
            if rest is not None:
                rests[n] = rest
                quarters = plan_kernels.byte_of(16 * float(np.abs(rest).mean()))
                rest_scale, own = decode_kernels.scale_of(quarters), own + bytes((quarters,))
            plans[n, [FORM, REST, survey_kernels.LIMIT]] = units.form, rest_scale, -1
            plans[n, [BASE, DIGITS, DROP, TOP]] = 0
            end = len(fields) + len(own)
            plans[n, [FIELDS, survey_kernels.FIELDS_END]] = len(fields), end
            fields += own
        return rests, fields

    def _find_candidates(self, channels: Channels) -> Bools:
        is_coded = channels.plans[:, decode_kernels.KIND] == decode_kernels.CODED
        is_small = channels.plans[:, survey_kernels.MOST] < self.unit_limits
        candidates: Bools = is_coded & is_small
        others = np.flatnonzero(is_coded & ~is_small & self.may_be_counts)
        grids = [self.grids[n] for n in others.tolist()]
        candidates[others] = may_be_counts(channels.ordinals, self.numbers[others], grids)
        return candidates

    def _find_leads(self, channels: Channels) -> CodedLanes:
        """The coded channels, split into leads and tails, which replace their columns."""
        plans = channels.plans
        numbers = np.flatnonzero(plans[:, decode_kernels.KIND] == decode_kernels.CODED)
        starts = np.searchsorted(numbers, self.firsts)
        lattices = np.zeros((len(numbers), residual_kernels.LATTICE_SIZE), np.int64)
        lattices[:, : decode_kernels.SCALE - BASE] = plans[numbers, BASE : decode_kernels.SCALE]
        leads, residuals = np.empty((2, len(numbers), len(channels.ordinals)), np.int32)
        costs, scales = np.zeros((2, len(numbers)), np.int64)
        lanes: CodedLanes = survey_kernels.CodedLanes(
            numbers, starts, lattices, leads, residuals, costs, scales
        )
        write_kernels.find_leads(lanes, channels.columns)
        plans[numbers, decode_kernels.TINY] = lattices[:, decode_kernels.TINY - BASE]
        return lanes


def _forms(grids: Sequence[Grid]) -> Ints:
    forms = {grid: form_of_grid(grid) for grid in dict.fromkeys(grids)}
    return np.array([forms[grid] for grid in grids], np.int64)


def _unit_limit(grid: Grid, clip_grid: Grid) -> int:
    """The magnitude below which ``find_units`` may find a unit."""
    if has_binary32(grid):
        return ANY if unit_grid(clip_grid) == BINARY32 else 0
    return tiny_limit(grid) if grid == clip_grid else 0


BLOCK_ROWS = 1024


def channel_bytes(ordinals: Ints, grid: Grid) -> int:
    """Size in bytes of the streams of one channel, (n_rows,), coded alone."""
    builder, starts = StreamBuilder([grid], [[0]]), range(0, len(ordinals), BLOCK_ROWS)
    blocks = (ordinals[start : start + BLOCK_ROWS, None] for start in starts)
    return sum(len(builder.build(block, (grid,))[0]) for block in blocks)
