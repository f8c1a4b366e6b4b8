"""Streams of ``fast``, to order: heads that its encoder would never choose.

Nothing here is fitted or estimated, so the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast.decode_kernels import TAP_UNIT, scale_of
from mcz.codecs.coding.forms import form_of_grid
from mcz.codecs.coding.forms.counts import Law
from mcz.model.numbers import Grid
from mcz.model.schema import varint
from tools.vectors.build import fast_heads

if TYPE_CHECKING:
    from mcz.codecs.coding.fast.survey_kernels import CodedLanes

Ints = NDArray[np.int64]
# Forms; 1 to 15: digits of base 10.
PLAIN, MULTIPLES, PRODUCTS, COUNTS = 0, 32, 33, 34
CODE_BYTES = 10  # of a residual, a rest or a tail, at most
ROUNDS = 100  # until residuals are found of which each may have another as its parent


@dataclass(frozen=True, slots=True)
class Coded:
    """A coded channel. ``form`` None: that of the grid, without bit 7 of kind; ``top``, ``tiny``,
    ``first`` None: as the ordinals need. Nothing is checked, so that what is forbidden can be
    written. ``parent``: group, channel, weight; ``exceptions``: row and ordinal of each.
    ``numbers``: coded in place of the ordinals, as with exceptions; with ``unit`` and ``shifts``:
    forms 32, 33; or with a ``law`` and ``rests``: form 34. ``parts``: what form 34 says in their
    place."""

    form: int | None = None
    drop: int = 0
    top: int | None = None
    tiny: bool | None = None
    first: int | None = None
    scale: int = 8
    predictor: int = 0
    taps: tuple[int, ...] = ()
    parent: tuple[int, int, int] | None = None
    exceptions: tuple[tuple[int, int], ...] = ()
    numbers: tuple[int, ...] = ()
    unit: float | None = None
    shifts: int | None = None
    law: Law | None = None
    rests: tuple[int, ...] = ()
    rest_scale: int = 0
    parts: int | None = None


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant channel, of its first ordinal."""


@dataclass(frozen=True, slots=True)
class Copy:
    """A channel that repeats this one."""

    group: int
    channel: int


@dataclass(frozen=True, slots=True)
class Steps:
    """A channel as runs."""


Head = Coded | Constant | Copy | Steps | bytes  # bytes: as they are written
USUAL = Coded()


@dataclass(slots=True)
class _Lane:
    """A coded channel: the numbers that are coded, its head as it is written, its lattice."""

    coded: Coded
    numbers: list[int]
    head: fast_heads.CodedHead
    lattice: list[int]


def streams_of(layout: Any, ordinals: Ints, heads: Sequence[Head]) -> tuple[bytes, ...]:
    """The streams of all groups; channels without a head have ``USUAL``."""
    every = [*heads, *[USUAL] * (layout.n_channels - len(heads))]
    return build_streams(ordinals, layout.grids, layout.groups, every)


def build_streams(
    ordinals: Any, grids: Sequence[Grid], groups: Sequence[Sequence[int]], heads: Sequence[Head]
) -> tuple[bytes, ...]:
    """The streams of ``groups``: ``ordinals`` (rows, channels), grids of the clip, heads."""
    table = np.array(ordinals, np.int64)
    found = [
        [_head_of(heads[channel], grids[channel], table[:, channel]) for channel in group]
        for group in groups
    ]
    lanes = [head for own in found for head in own if isinstance(head, _Lane)]
    if not lanes:
        return tuple(b"".join(head for head in own if isinstance(head, bytes)) for own in found)
    places = [
        (group, place)
        for group, own in enumerate(found)
        for place, head in enumerate(own)
        if isinstance(head, _Lane)
    ]
    columns = np.array([lane.numbers for lane in lanes], np.int64)
    table = _predict_columns(lanes, places, columns)
    for lane, column in zip(lanes, columns, strict=True):
        column[:] = lane.coded.rests or column
    streams, start = [], 0
    for own in found:
        stop = start + sum(isinstance(head, _Lane) for head in own)
        data = b"".join(head.head.build() if isinstance(head, _Lane) else head for head in own)
        if start < stop:
            parts = _parts(table, columns, start, stop)
            data += varint(len(parts[0])) + b"".join(parts)
        streams.append(data)
        start = stop
    return tuple(streams)


def _head_of(head: Head, grid: Grid, column: Ints) -> bytes | _Lane:
    if isinstance(head, Coded):
        return _lane(head, grid, list(head.numbers) or column.tolist())
    if isinstance(head, Copy):
        return fast_heads.copy_head(head.group, head.channel)
    if isinstance(head, Steps):
        return fast_heads.steps_head(column)
    return head if isinstance(head, bytes) else fast_heads.constant_head(int(column[0]))


def _lane(coded: Coded, grid: Grid, numbers: list[int]) -> _Lane:
    from mcz.codecs.coding.fast import residual_kernels as tail

    form = form_of_grid(grid) if coded.form is None else coded.form
    base, digits, top = 0, 0, 0
    if form not in (PLAIN, MULTIPLES, PRODUCTS, COUNTS):
        base, digits = (10, form) if form < 64 else (2, form - 64 - coded.drop)
        greatest = max(n if n >= 0 else -1 - n for n in numbers) >> coded.drop
        top = max(0, greatest - (base == 10)) // ((base - 1) * base ** (digits - 1))
        top = top if coded.top is None else coded.top
    fields = struct.pack("<d", coded.unit) if coded.unit is not None else b""
    fields += bytes((coded.shifts,)) if coded.shifts is not None else b""
    fields += law_fields(coded, coded.law) if coded.law is not None else b""
    fields += bytes((coded.rest_scale,)) if coded.rests else b""
    lattice = [0] * tail.LATTICE_SIZE
    lattice[tail.BASE], lattice[tail.DIGITS], lattice[tail.TOP] = base, digits, top
    lattice[tail.DROP], lattice[tail.TINY] = coded.drop, int(bool(coded.tiny))
    lattice[tail.REST] = scale_of(coded.rest_scale) if coded.rests else -1
    head = fast_heads.CodedHead(
        form,
        fast_heads.Lattice(base, digits, coded.drop, top),
        coded.form is not None,
        fields,
        scale=coded.scale,
        predictor=coded.predictor,
        taps=coded.taps,
        parent=coded.parent,
        exceptions=list(coded.exceptions),
    )
    return _Lane(coded, numbers, head, lattice)


def _predict_columns(
    lanes: Sequence[_Lane], places: Sequence[tuple[int, int]], columns: Ints
) -> CodedLanes:
    """The lanes as they are written, whose ``columns`` become tails; heads have all fields then."""
    from mcz.codecs.coding.fast import residual_kernels as tail
    from mcz.codecs.coding.fast import write_kernels as write

    lattices = np.array([lane.lattice for lane in lanes], np.int64)
    leads = np.zeros(columns.shape, np.int32)
    scales = np.array([scale_of(lane.coded.scale) for lane in lanes])
    numbers = np.arange(len(lanes))
    table = write.CodedLanes(numbers, numbers, lattices, leads, leads, numbers, scales)
    write.find_leads(table, columns)
    own = np.zeros(columns.shape, np.int64)
    for number, lane in enumerate(lanes):
        lane.head.first = int(leads[number, 0]) if lane.coded.first is None else lane.coded.first
        lane.head.is_tiny = bool(lattices[number, tail.TINY])
        own[number] = _left(leads[number].astype(np.int64), _taps_of(lane.coded))
    parents = [lane.coded.parent for lane in lanes]
    lane_of = [places.index(p[:2]) if p and p[:2] in places else n for n, p in enumerate(parents)]
    weights = np.array([[p[2] if p else 0] for p in parents], np.int64)
    residuals = own
    for _ in range(ROUNDS):
        before, residuals = (
            residuals,
            _wrap(own - (_wrap(128 + weights * residuals[lane_of]) >> 8)),
        )
        residuals[:, 0] = 0
        if (before == residuals).all():
            return table._replace(residuals=residuals.astype(np.int32))
    raise ValueError("parents in a ring leave no residuals")


def _taps_of(coded: Coded) -> tuple[int, ...]:
    predictors = ((), (TAP_UNIT,), (2 * TAP_UNIT, -TAP_UNIT), coded.taps)
    return predictors[coded.predictor]


def _wrap(values: Ints) -> Ints:
    return (values + 2**31) % 2**32 - 2**31


def _left(leads: Ints, taps: Sequence[int]) -> Ints:
    """The residuals of a predictor of leads; 0 in the first row."""
    steps = _wrap(np.diff(leads, prepend=leads[0]))
    total = np.full(len(leads), 16, np.int64)
    for place, tap in enumerate(taps, 1):
        total[place:] += tap * steps[:-place]
    return _wrap(steps - (_wrap(total) >> 5)) * (np.arange(len(leads)) > 0)


def _parts(lanes: CodedLanes, columns: Ints, start: int, stop: int) -> list[bytes]:
    """Residuals and tails of lanes start <= l < stop."""
    from mcz.codecs.coding.fast import write_kernels as write

    room = np.zeros((2, (columns[start:stop].size + 1) * CODE_BYTES), np.uint8)
    sizes = write.write_parts(lanes, columns, start, stop, room[0], room[1])
    return [row[:size].tobytes() for row, size in zip(room, sizes, strict=True)]


def law_fields(head: Any, law: Law) -> bytes:
    """The fields of form 34 in the head of a channel, of this codec or another."""
    fields = law.fields(rests=bool(head.rests))
    return fields if head.parts is None else fields[:8] + bytes((head.parts,)) + fields[9:]
