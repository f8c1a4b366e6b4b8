"""Write the streams of groups of one segment.

SPEC.md, "Codec 1: fast", is normative for the bytes; the choice of a plan is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.coding.fast.heads import CodedHead, constant_head, copy_head, steps_head
from mcz.coding.forms.lattice import Lattice, base_and_digits, form_of, form_of_grid, max_top
from mcz.coding.forms.units import find_units
from mcz.numbers import Grid
from mcz.schema import varint

Ints = NDArray[np.int64]
Words = NDArray[np.int32]
Own = tuple[Grid, Grid]  # the grid in force and that of the clip

LEAD_BITS = 31  # of a lead without its sign
FEW = 64  # one row in so many may be an exception
FEWEST_ROWS = 32  # for which parents are looked for
HEAD_BITS = 80  # of a coded channel, about
FALL = 0.415  # bits that a code shrinks by in each row after a jump
CODE_BYTES = 10  # of a residual, a rest or a tail, at most


@cache
def kernels() -> tuple[ModuleType, ModuleType, ModuleType, ModuleType]:
    """The compiled loops, imported on first use: of plans, parents, tails and bits."""
    from mcz.coding.fast import parent_kernels, plan_kernels, tail_kernels, write_kernels

    return plan_kernels, parent_kernels, tail_kernels, write_kernels


@dataclass(slots=True)
class Lane:
    """A coded channel: its group and its place there, what is coded of it, and its head."""

    group: int
    place: int
    ordinals: Ints
    head: CodedHead
    rests: Ints | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """A segment as its encoder sees it: the heads of each group, and its lanes, one after another.

    ``starts``: the first lane of each group, and the number of all. The arrays are (lanes, rows).
    """

    heads: list[list[Lane | bytes]]
    lanes: list[Lane]
    starts: Ints
    ordinals: Ints
    rests: Ints
    lattices: Ints
    leads: Words

    @property
    def n_rows(self) -> int:
        return int(self.ordinals.shape[1])

    def head(self, group: int) -> bytes:
        """All heads of a group."""
        own = self.heads[group]
        return b"".join(head.head.build() if isinstance(head, Lane) else head for head in own)

    def room(self, n_lanes: int) -> NDArray[np.uint8]:
        """Zeros for the codes of so many lanes."""
        return np.zeros((self.n_rows * n_lanes + 1) * CODE_BYTES, np.uint8)


def plan_segment(
    ordinals: Ints, grids: Sequence[Own], groups: Sequence[Sequence[int]]
) -> tuple[Plan, Words]:
    """The plan of a segment, whose heads have predictors, and its residuals, (lanes, rows).

    ``groups``: their channels, columns of ``ordinals``; ``grids``: those in force and of the clip,
    of each channel.
    """
    heads = _heads(np.ascontiguousarray(ordinals.T), grids, groups)
    coded = [[head for head in own if isinstance(head, Lane)] for own in heads]
    lanes = [lane for own in coded for lane in own]
    starts = np.cumsum([0, *map(len, coded)])
    columns = np.array([lane.ordinals for lane in lanes], np.int64).reshape(-1, len(ordinals))
    rests = np.zeros(columns.shape, np.int64)
    for row, lane in zip(rests, lanes, strict=True):
        row[:] = 0 if lane.rests is None else lane.rests
    lattices, leads = _lattices(lanes), np.zeros(columns.shape, np.int32)
    if lanes:
        kernels()[3].find_leads(columns, lattices, leads)
    plan = Plan(heads, lanes, starts, columns, rests, lattices, leads)
    return plan, _predict(plan)


def build_streams(
    ordinals: Ints, grids: Sequence[Own], groups: Sequence[Sequence[int]]
) -> list[bytes]:
    """The streams of all groups; ``plan_segment`` says what the arguments are."""
    plan, residuals = plan_segment(ordinals, grids, groups)
    choice, _, _, write = kernels()
    scales = np.array([choice.scale_of(lane.head.scale) for lane in plan.lanes], np.int64)
    if len(plan.lanes) > 1 and plan.n_rows >= FEWEST_ROWS:
        _choose_parents(plan.lanes, residuals, scales, plan.starts)
    streams = []
    for group, (start, stop) in enumerate(pairwise(plan.starts.tolist())):
        parts = [plan.head(group)]
        if start < stop:
            room = plan.room(stop - start)
            size = write.write_residuals(residuals, scales, start, stop, room)
            parts += [varint(size), room[:size].tobytes()]
            room[:] = 0
            size = write.write_tails(plan.ordinals, plan.rests, plan.lattices, start, stop, room)
            parts.append(room[:size].tobytes())
        streams.append(b"".join(parts))
    return streams


def _heads(
    columns: Ints, grids: Sequence[Own], groups: Sequence[Sequence[int]]
) -> list[list[Lane | bytes]]:
    """Of each group the heads of its channels; those that are coded as lanes."""
    copies: dict[bytes, bytes] = {}
    heads: list[list[Lane | bytes]] = []
    for number, group in enumerate(groups):
        heads.append([])
        for place, channel in enumerate(group):
            column = columns[channel]
            key = column.tobytes()
            if (column == column[0]).all():
                heads[-1].append(constant_head(int(column[0])))
            elif key in copies:
                heads[-1].append(copies[key])
            else:
                copies[key] = copy_head(number, place)
                lane = _coded(column, *grids[channel], number, place)
                heads[-1].append(_steps(column, lane) or lane)
    return heads


def _steps(column: Ints, lane: Lane) -> bytes | None:
    """The head of a channel that seldom changes, where codes would cost more."""
    changes = np.flatnonzero(np.diff(column))
    if 2 * len(changes) > len(column):
        return None
    leads = lane.ordinals.astype(np.float64)
    jumps = np.log2(1.0 + np.abs(leads[changes + 1] - leads[changes]))
    rows = np.diff(np.append(changes, len(column) - 1))
    coded = HEAD_BITS + len(column) + np.minimum(jumps * jumps / (2 * FALL), jumps * rows).sum()
    head = steps_head(column)
    return head if 8 * len(head) < coded else None


def _coded(column: Ints, grid: Grid, clip_grid: Grid, group: int, place: int) -> Lane:
    """A channel as a lane, whose head has no predictor yet."""
    units = find_units(column, grid, every=grid == clip_grid)
    exceptions: list[tuple[int, int]] = []
    if units is not None and _greatest(units.integers).bit_length() <= LEAD_BITS:
        form, fields, leads, rests = units.form, units.fields, units.integers, units.rests
        shape = Lattice(0, 0)
    else:
        fields, leads, rests = b"", column, None
        shape, is_apart = _shape(leads, grid)
        if is_apart.any():
            rows = np.flatnonzero(is_apart)
            exceptions = list(zip(rows.tolist(), column[rows].tolist(), strict=True))
            kept = np.where(is_apart, -1, np.arange(len(column)))
            leads = column[np.maximum(np.maximum.accumulate(kept), np.argmin(is_apart))]
            leads[: np.argmin(is_apart)] = column[np.argmin(is_apart)]
        form = form_of(shape)
    if rests is not None:
        scale = kernels()[0].byte_of(16 * float(np.abs(rests).mean()))
        fields += bytes((scale,))
    is_own = shape.drop > 0 or form != form_of_grid(clip_grid)
    head = CodedHead(form, shape, is_own, fields, exceptions=exceptions)
    return Lane(group, place, leads, head, rests)


def _greatest(ordinals: Ints) -> int:
    return int((ordinals ^ (ordinals >> 63)).max())


def _shape(ordinals: Ints, grid: Grid) -> tuple[Lattice, NDArray[np.bool_]]:
    """The lattice of ordinals, and those that are exceptions to it."""
    base, digits = base_and_digits(grid)
    magnitudes = ordinals ^ (ordinals >> 63)
    drop = 0
    if base == 2:
        used = int(np.bitwise_or.reduce(magnitudes))
        drop = min((used & -used).bit_length() - 1 if used else 0, digits - 2)
        digits -= drop
    if base:
        per_class = (base - 1) * base ** (digits - 1)
        classes = np.maximum((magnitudes >> drop) - (base == 10), 0) // per_class
        is_apart = _outliers(classes, min(digits, 9 if base == 10 else 30) // 2)
        shape = Lattice(base, digits, drop, int(classes[~is_apart].max()))
        if shape.top <= max_top(shape):
            return shape, is_apart
    sizes = np.frexp(magnitudes.astype(np.float64))[1]
    is_apart = _outliers(sizes, 8)
    greatest = int(magnitudes[~is_apart].max())
    return Lattice(0, 0, max(0, greatest.bit_length() - LEAD_BITS)), is_apart


def _outliers(sizes: Ints, margin: int) -> NDArray[np.bool_]:
    """Few rows whose sizes exceed those of all others by more than ``margin``."""
    usual = np.partition(sizes, -1 - len(sizes) // FEW)[-1 - len(sizes) // FEW]
    return np.asarray(sizes > usual + margin)


def _lattices(lanes: Sequence[Lane]) -> Ints:
    tail = kernels()[2]
    lattices = np.zeros((len(lanes), tail.LATTICE_SIZE), np.int64)
    for lattice, lane in zip(lattices, lanes, strict=True):
        shape, rest = lane.head.shape, -1
        if lane.rests is not None:
            rest = kernels()[0].scale_of(lane.head.fields[-1])
        fields = tail.BASE, tail.DIGITS, tail.TOP, tail.DROP, tail.REST
        lattice[list(fields)] = shape.base, shape.digits, shape.top, shape.drop, rest
    return lattices


def _predict(plan: Plan) -> Words:
    """The residuals of lanes, (lanes, rows); their heads say the predictors then."""
    choice, _, tail, _ = kernels()
    lanes, leads = plan.lanes, plan.leads
    predictors, scales = np.zeros((2, len(lanes)), np.int64)
    taps = np.zeros((len(lanes), choice.N_TAPS), np.int64)
    residuals = np.zeros(leads.shape, np.int32)
    if lanes:
        choice.choose_predictors(leads, predictors, taps, scales, residuals)
    for number, lane in enumerate(lanes):
        lane.head.first = int(leads[number, 0])
        lane.head.is_tiny = bool(plan.lattices[number, tail.TINY])
        lane.head.predictor = int(predictors[number])
        lane.head.scale = int(scales[number])
        lane.head.taps = tuple(taps[number].tolist())
    return residuals


def _choose_parents(lanes: Sequence[Lane], residuals: Words, scales: Ints, starts: Ints) -> None:
    parents, weights = np.zeros((2, len(lanes)), np.int64)
    kernels()[1].choose_parents(residuals, scales, starts, parents, weights)
    for number in np.flatnonzero(parents >= 0).tolist():
        parent = lanes[int(parents[number])]
        lanes[number].head.parent = parent.group, parent.place, int(weights[number])
