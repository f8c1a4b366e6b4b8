"""Write the streams of groups of one segment.

SPEC.md, "Codec 1: fast", is normative for the bytes; the choice of a plan is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast import (
    decode_kernels,
    parent_kernels,
    plan_kernels,
    residual_kernels,
    survey_kernels,
    write_kernels,
)
from mcz.codecs.coding.fast.survey_kernels import Channels, CodedLanes
from mcz.codecs.coding.forms import BINARY32, form_of_grid, has_binary32, unit_grid
from mcz.codecs.coding.forms.counts import may_be_counts
from mcz.codecs.coding.forms.products import tiny_limit
from mcz.codecs.coding.forms.units import find_units
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Bools, Ints

FEWEST_ROWS = 32  # for a search of parents
VALUE_BYTES = 20  # of a residual and a tail, of a run or of an exception, at most
HEAD_BYTES = 128  # besides runs and exceptions, at most, and of the size of residuals
SPARE = 16  # bytes after the last that are written to
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
    """Builds the streams of all groups of segments of one signal."""

    def __init__(self, clip_grids: Sequence[Grid], groups: Sequence[Sequence[int]]) -> None:
        """``clip_grids``: those in CLIP, of each channel of the signal."""
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
            parent_kernels.choose_parents(plan.lanes, plan.channels.plans)
        rooms = np.empty((3, plan.most_bytes), np.uint8)
        ends = np.empty(len(self.firsts) - 1, np.int64)
        write_kernels.write_streams(plan.channels, plan.lanes, plan.fields, rooms, ends)
        stops = ends.tolist()
        starts = [0, *stops[:-1]]
        return tuple(rooms[0, a:b].tobytes() for a, b in zip(starts, stops, strict=False))

    def _channels(self, ordinals: Ints) -> Channels:
        columns = np.empty((len(self.numbers), len(ordinals)), np.int64)
        plans = np.zeros((len(self.numbers), survey_kernels.PLAN_SIZE), np.int64)
        numbers, firsts, groups = self.numbers, self.firsts, self.groups
        forms = self.forms, self.clip_forms
        given = ordinals, numbers, firsts, groups, *forms
        result: Channels = survey_kernels.Channels(*given, columns, plans)
        return result

    def _find_units(self, channels: Channels) -> tuple[dict[int, Ints], bytes]:
        """Code channels in units where possible; returns rests, and the fields of all units."""
        plans = channels.plans
        tried = self._find_candidates(channels)
        rests: dict[int, Ints] = {}
        fields = b""
        for n in np.flatnonzero(tried).tolist():
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
            plans[n, [decode_kernels.FORM, decode_kernels.REST, survey_kernels.LIMIT]] = (
                units.form,
                rest_scale,
                -1,
            )
            plans[
                n,
                [
                    decode_kernels.BASE,
                    decode_kernels.DIGITS,
                    decode_kernels.DROP,
                    decode_kernels.TOP,
                ],
            ] = 0
            plans[n, [decode_kernels.FIELDS, survey_kernels.FIELDS_END]] = (
                len(fields),
                len(fields) + len(own),
            )
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
        lattices[:, : decode_kernels.SCALE - decode_kernels.BASE] = plans[
            numbers, decode_kernels.BASE : decode_kernels.SCALE
        ]
        leads, residuals = np.empty((2, len(numbers), len(channels.ordinals)), np.int32)
        costs, scales = np.zeros((2, len(numbers)), np.int64)
        lanes: CodedLanes = survey_kernels.CodedLanes(
            numbers, starts, lattices, leads, residuals, costs, scales
        )
        write_kernels.find_leads(lanes, channels.columns)
        plans[numbers, decode_kernels.TINY] = lattices[:, decode_kernels.TINY - decode_kernels.BASE]
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
