"""Read the streams of groups of one segment.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mcz.codecs.coding.fast import decode_kernels, residual_kernels
from mcz.codecs.coding.fast.lanes import Lanes, read_all
from mcz.codecs.coding.forms import WITH_UNIT, form_of_grid
from mcz.codecs.coding.forms.units import parse_mapping
from mcz.errors import FormatError
from mcz.model.numbers import Grid
from mcz.model.types import Ints

Fetch = Callable[[int], bytes]  # a group -> its stream

MOST_ROWS, MOST_VALUES = 4096, 2**23  # of a segment
MOST_KNOWN = 64  # most requests whose columns are cached
SPARE = 16  # bytes after the streams that a window may read
FAULTS = (
    "it ends in the head",
    "its kind is unknown",
    "an ordinal is not as short as it can be",
    "its runs are not the rows of the segment",
    "its form is unknown",
    "its greatest class is out of range",
    "its first lead is out of range",
    "its scale is out of range",
    "its weight is out of range",
    "an exception is not in the segment",
    "bytes follow the heads",
    "its parent or source does not exist",
    "its parent is not another coded channel",
    "its source is a copy",
    "its group has parents in more than two others",
)


class Shape:
    """A signal for its decoder: grids of its channels in CLIP, their forms, its groups."""

    def __init__(self, grids: Sequence[Grid], groups: Sequence[Sequence[int]]) -> None:
        self.grids, self.groups = grids, groups
        forms = [form_of_grid(grid) for grid in grids]  # FAST-28
        self.forms = np.array(forms, np.int64)
        self._known: dict[tuple[int, ...], Columns] = {}

    def columns(self, groups: tuple[int, ...]) -> Columns:
        """The channels of ``groups``, group by group; raises FormatError."""
        result = self._known.get(groups)
        if result is None:
            if (most := max(groups, default=0)) >= max(1, len(self.groups)):  # FAST-27, FAST-34
                raise FormatError(
                    f"fast: group {most} does not exist; there are {len(self.groups)}"
                )
            channels = np.array([c for group in groups for c in self.groups[group]], np.int64)
            firsts = np.cumsum([0, *(len(self.groups[group]) for group in groups)])
            places = np.full(len(self.groups), -1)
            places[list(groups)] = np.arange(len(groups))
            result = Columns(
                channels, self.forms[channels], firsts, np.array(groups, np.int64), places
            )
            if len(self._known) < MOST_KNOWN:
                self._known[groups] = result
        return result


@dataclass(frozen=True, slots=True)
class Columns:
    """The channels of some groups: numbers in the signal, and forms.

    ``firsts``: the first channel of each group, and the number of all; ``places``: the place of
    each group of the signal in ``groups``, or -1.
    """

    channels: Ints
    forms: Ints
    firsts: Ints
    groups: Ints
    places: Ints


@dataclass(frozen=True, slots=True)
class Heads:
    """The heads of some groups of a segment, one after the other.

    ``plans``: a row a channel, as in ``decode_kernels``; ``parts``: for each group the offsets of
    residuals and tails, and the end.
    """

    groups: tuple[int, ...]
    columns: Columns
    data: bytes  # their streams, and ``SPARE`` bytes
    plans: Ints
    parts: Ints

    def absent(self, kind: int) -> list[int]:
        """Absent groups with sources of copies or parents of coded channels here."""
        groups = self.plans[self.plans[:, decode_kernels.KIND] == kind, decode_kernels.GROUP]
        return sorted(set(groups[groups >= 0].tolist()).difference(self.groups))

    def fault(self, channel: int, fault: int) -> FormatError:
        at = int(np.searchsorted(self.columns.firsts, channel, "right")) - 1
        where = f"channel {channel - self.columns.firsts[at]} of group {self.groups[at]}"
        return FormatError(f"fast: {where}: {FAULTS[fault]}")


def check_size(n_rows: int, n_channels: int, n_frames: int) -> None:
    """Raise FormatError for a segment above the limits."""
    if (n_rows > MOST_ROWS and n_frames > 1) or n_rows * n_channels > MOST_VALUES:
        raise FormatError(
            f"fast: a segment of {n_rows} rows and {n_channels} channels is too large"
        )  # FAST-18


def read_heads(shape: Shape, groups: tuple[int, ...], fetch: Fetch, n_rows: int) -> Heads:
    """The heads of groups; raises FormatError for bad heads."""
    columns = shape.columns(groups)
    streams = [fetch(group) for group in groups]
    bounds = np.cumsum([0, *map(len, streams)])
    data = b"".join((*streams, bytes(SPARE)))
    plans = np.zeros((len(columns.channels), decode_kernels.PLAN_SIZE), np.int64)
    parts = np.zeros((len(groups), 3), np.int64)
    parts[:, 2] = bounds[1:]
    heads = Heads(groups, columns, data, plans, parts)
    text = np.frombuffer(data, np.uint8)
    channel, fault = decode_kernels.read_heads(
        text, bounds, columns.firsts, n_rows, columns.forms, plans, parts
    )
    if channel >= 0:
        raise heads.fault(channel, fault)
    return heads


def read_heads_of(
    shape: Shape, groups: tuple[int, ...], fetch: Fetch, n_rows: int
) -> tuple[Heads, int]:
    """Read the heads of ``groups``, and of groups that these depend on.

    The second are those with sources of copies, then those with parents. Also returns the number of
    groups without the latter.
    """
    heads = read_heads(shape, groups, fetch, n_rows)
    if len(groups) == len(shape.groups):
        return heads, len(groups)
    if absent := heads.absent(decode_kernels.COPY):
        heads = read_heads(shape, (*groups, *absent), fetch, n_rows)
    n_whole = len(heads.groups)
    if absent := heads.absent(decode_kernels.CODED):
        heads = read_heads(shape, (*heads.groups, *absent), fetch, n_rows)
    return heads, n_whole


class SegmentDecoder:
    """Decodes some groups of a segment: heads, then lanes, then dependent columns."""

    def __init__(
        self, shape: Shape, groups: tuple[int, ...], fetch: Fetch, out: Ints, n_rows: int
    ) -> None:
        """Fill ``out`` (rows, channels of ``groups``) with the first rows; raises FormatError."""
        heads, n_whole = read_heads_of(shape, groups, fetch, n_rows)
        columns = heads.columns
        channel, fault = decode_kernels.link(
            heads.plans, columns.firsts, columns.groups, columns.places, len(groups), n_whole
        )
        if channel >= 0:
            raise heads.fault(channel, fault)
        self.shape, self.heads, self.out = shape, heads, out
        self.n_channels = int(columns.firsts[n_whole])
        is_exact = self.n_channels == out.shape[1]
        self.rows = out if is_exact else np.empty((len(out), self.n_channels), np.int64)
        self.lanes = _lanes_of(heads, n_whole, self.rows, len(out) == n_rows)

    def finish(self) -> None:
        """Fill ``out``, after the lanes were decoded."""
        self._map_units()
        n_wanted = self.out.shape[1]
        decode_kernels.fill_columns(self.lanes.data, self.heads.plans, n_wanted, self.rows)
        if self.rows is not self.out:
            self.out[:] = self.rows[:, :n_wanted]

    def _map_units(self) -> None:
        plans = self.heads.plans
        n_whole = len(self.lanes.tails)
        columns = self.lanes.columns[: self.lanes.starts[n_whole]]
        forms = plans[columns, decode_kernels.FORM]
        for number in np.flatnonzero((forms >= WITH_UNIT[0]) & (forms <= WITH_UNIT[-1])).tolist():
            plan, column = plans[columns[number]], self.rows[:, columns[number]]
            grid = self.shape.grids[self.heads.columns.channels[columns[number]]]
            at, form = int(plan[decode_kernels.FIELDS]), int(plan[decode_kernels.FORM])
            mapping, has_rests, _ = parse_mapping(self.heads.data, at, form, grid)
            assert mapping is not None
            leads = self.lanes.leads[residual_kernels.BEHIND :, number].astype(np.int64)
            ordinals = mapping(leads)  # FAST-48, FAST-51, FAST-54
            column[:] = ordinals + column if has_rests else ordinals


def _lanes_of(heads: Heads, n_whole: int, out: Ints, is_whole: bool) -> Lanes:
    n_lanes = int(np.sum(heads.plans[:, decode_kernels.KIND] == decode_kernels.CODED))
    starts, columns = np.empty(len(heads.groups) + 1, np.int64), np.empty(n_lanes, np.int64)
    lattices = np.zeros((n_lanes, residual_kernels.LATTICE_SIZE), np.int64)
    predictors = residual_kernels.predictors_of(n_lanes)
    decode_kernels.fill_lanes(
        heads.plans, heads.columns.firsts, starts, predictors, lattices, columns
    )
    leads = np.empty((residual_kernels.BEHIND + len(out), n_lanes), np.int32)
    bits = 8 * heads.parts
    data = np.frombuffer(heads.data, np.uint8)
    parts = bits[:, :2], bits[:n_whole, 1:]
    return Lanes(data, *parts, starts, columns, predictors, lattices, leads, out, is_whole)


def read_segments(segments: Sequence[SegmentDecoder]) -> None:
    """Fill the rows of segments, several at a time; raises FormatError for bad bytes."""
    read_all([segment.lanes for segment in segments])
    for segment in segments:
        segment.finish()


def read_alone(shape: Shape, stream: bytes, n_rows: int) -> Ints:
    """The ordinals of the only group of a signal in a segment; raises FormatError."""
    n_channels = len(shape.grids)
    check_size(n_rows, n_channels, n_rows)
    out = np.empty((n_rows, n_channels), np.int64)
    read_segments([SegmentDecoder(shape, (0,), lambda group: stream, out, n_rows)])
    return out
