"""The stream of a group as ``fast``, has it: heads of its channels, then their values.

SPEC.md, "Codec 1: fast", is normative; the names below are its field names.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.coding.ordinals.choices import Lattice, base_and_digits, max_top
from mcz.coding.ordinals.counts import parse_law
from mcz.coding.ordinals.degrees import of_products
from mcz.coding.ordinals.heads import (
    CODED,
    COPY,
    OWN_FORM,
    check_unit,
    form_of,
    form_of_grid,
)
from mcz.coding.ordinals.streams import constant_head, in_units
from mcz.coding.ordinals.units import of_multiples
from mcz.errors import FormatError
from mcz.kernels import lacks_compiled_kernels
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

if TYPE_CHECKING:
    from mcz.coding.quick.kernels import Tables

Ints = NDArray[np.int64]

UNIT_SIZE, LAW_SIZE = 8, 17  # bytes of a unit; of the longest law behind it
SPARE = 32  # bytes at both ends of the streams that a reader of a hostile one may look at
FAULTS = (
    "it ends in the head",
    "its kind is unknown",
    "its constant is not as short as it can be",
    "its form is unknown",
    "its classes are out of range",
    "its taps are out of range",
    "its scale is out of range",
    "it cannot be decoded",
)


class Channels(NamedTuple):
    """Channels of streams: their grids in the clip, and what forms these name."""

    grids: tuple[Grid, ...]
    forms: Ints


def channels_of(grids: Iterable[Grid]) -> Channels:
    known = tuple(grids)
    return Channels(known, np.array([form_of_grid(grid) for grid in known], np.int64))


@cache
def loops() -> tuple[ModuleType, ModuleType, ModuleType, ModuleType]:
    """The compiled loops, imported on first use: of values, of streams; of an encoder."""
    from mcz.coding.quick import choice_kernels, kernels, record_kernels, stream_kernels

    return kernels, stream_kernels, choice_kernels, record_kernels


@cache
def tables() -> Tables:
    """The distributions that all streams have."""
    from mcz.coding.quick import tables

    return tables.tables()


@dataclass(slots=True)
class Coded:
    """A coded channel: what is coded, its form in the clip, and what its head says.

    ``form``: its own, which has ``fields`` and perhaps ``rests``; None: that of the ``shape``.
    """

    numbers: Ints
    clip_form: int
    shape: Lattice
    form: int | None = None
    fields: bytes = b""
    rests: Ints | None = None
    plan: Sequence[int] = ()
    scale: int = 0

    def head(self) -> bytes:
        own = loops()[0]
        base, digits, drop, top, depth = self.plan[own.BASE : own.DEPTH + 1]
        taps = list(self.plan[own.TAPS : own.TAPS + own.MAX_TAPS])
        while taps and not taps[-1]:
            taps.pop()
        form = form_of(Lattice(base, digits, drop)) if self.form is None else self.form
        own_form = drop > 0 or form != self.clip_form
        kind = CODED | self.plan[own.FROM_LAST] << 2 | len(taps) << 3 | OWN_FORM * own_form
        parts = [bytes((kind,)), bytes((form, drop)) if own_form else b""]
        parts += [self.fields]
        parts += [varint(top), varint(depth)] if base else []
        parts += [bytes((self.scale,)), *(varint(2 * t if t >= 0 else -2 * t - 1) for t in taps)]
        return b"".join(parts)


def build_streams(
    ordinals: Ints,
    grids: Sequence[tuple[Grid, Grid]],
    groups: Sequence[Sequence[int]],
    numbers: Sequence[int],
    copying: bool,
) -> list[bytes]:
    """The streams of some groups, whose channels ``groups`` are columns of ``ordinals``.

    ``grids`` are those in force and of the clip, ``numbers`` the groups'. ``copying``: a channel
    may repeat one before it.
    """
    heads = _heads(np.ascontiguousarray(ordinals.T), grids, groups, numbers, copying)
    coded = [[head for head in group if isinstance(head, Coded)] for group in heads]
    records = plan([head for group in coded for head in group])
    ends = len(ordinals) * np.cumsum([len(group) for group in coded], dtype=np.int64)
    return [
        b"".join(head.head() if isinstance(head, Coded) else head for head in group) + bits
        for group, bits in zip(heads, write(*_with_rests(records, ends, coded)), strict=True)
    ]


def _with_rests(records: Ints, ends: Ints, groups: Sequence[Sequence[Coded]]) -> tuple[Ints, Ints]:
    """The records of groups with those of their rests behind them, and where they end."""
    own, _, choice, _ = loops()
    found: list[list[Ints]] = [
        [head.rests for head in group if head.rests is not None] for group in groups
    ]
    if not any(found):
        return records, ends
    parts = np.split(records, ends[:-1])
    for place, rests in enumerate(found):
        if rests:
            plans = np.zeros((len(rests), own.PLAN_SIZE), np.int64)
            plans[:, own.SCALE] = 1
            more = np.zeros((len(rests) * len(rests[0]), records.shape[1]), np.int64)
            choice.record_columns(np.stack(rests), plans, tables().powers, more)
            parts[place] = np.concatenate([parts[place], more])
    return np.concatenate(parts), np.cumsum([len(part) for part in parts], dtype=np.int64)


def _heads(
    columns: Ints,
    grids: Sequence[tuple[Grid, Grid]],
    groups: Sequence[Sequence[int]],
    numbers: Sequence[int],
    copying: bool,
) -> list[list[Coded | bytes]]:
    """Of each group what its channels are; those of constants and copies as they are written."""
    seen: dict[bytes, bytes] = {}
    heads: list[list[Coded | bytes]] = []
    for number, group in zip(numbers, groups, strict=True):
        heads.append([])
        for place, channel in enumerate(group):
            column = columns[channel]
            key = column.tobytes()
            if (column == column[0]).all():
                heads[-1].append(constant_head(int(column[0])))
            elif copying and key in seen:
                heads[-1].append(seen[key])
            else:
                seen[key] = bytes((COPY,)) + varint(number) + varint(place)
                heads[-1].append(_coded(column, *grids[channel]))
    return heads


def _coded(column: Ints, grid: Grid, clip_grid: Grid) -> Coded:
    clip_form, version = form_of_grid(clip_grid), int(grid == clip_grid)
    form, fields, numbers, rests = in_units(column, grid, version)
    shape = Lattice(*base_and_digits(grid)) if form is None else Lattice(0, 0)
    return Coded(numbers, clip_form, shape, form, fields, rests)


def plan(coded: Sequence[Coded]) -> Ints:
    """Choose how channels are coded; what is coded, one after the other, for ``write``."""
    own, _, choice, record = loops()
    if not coded:
        return np.empty((0, record.RECORD_SIZE), np.int64)
    columns = np.stack([head.numbers for head in coded])
    plans = np.zeros((len(coded), own.PLAN_SIZE), np.int64)
    plans[:, own.BASE] = [head.shape.base for head in coded]
    plans[:, own.DIGITS] = [head.shape.digits for head in coded]
    max_tops = np.array([max_top(head.shape) for head in coded], np.int64)
    scales = np.zeros(len(coded), np.int64)
    records = np.empty((columns.size, record.RECORD_SIZE), np.int64)
    choice.plan_columns(columns, max_tops, plans, tables().powers, scales, records)
    for head, found, scale in zip(coded, plans.tolist(), scales.tolist(), strict=True):
        head.plan, head.scale = found, scale
    return records


def write(records: Ints, ends: Ints) -> list[bytes]:
    """State, words and bits of groups whose records end at ``ends``; b"" where there are none."""
    own = loops()[3]
    words = np.empty(len(records), np.int64)
    data = np.zeros(own.MAX_VALUE_SIZE * len(records), np.uint8)
    sizes = np.empty((len(ends), 3), np.int64)
    own.write_records(records, ends, tables(), words, data, sizes)
    parts, start = [], 0
    for end, (state, n_words, n_bits) in zip(ends.tolist(), sizes.tolist(), strict=True):
        at = own.MAX_VALUE_SIZE * start
        coded = words[start : start + n_words][::-1].astype("<u2").tobytes()
        bits = data[at : at + (n_bits + 7) // 8][::-1].tobytes()
        parts.append(state.to_bytes(4, "little") + coded + bits if end > start else b"")
        start = end
    return parts


def parse_streams(
    streams: Sequence[bytes], sizes: Sequence[int], channels: Channels, out: Ints
) -> dict[int, tuple[int, int]]:
    """Fill ``out`` (rows, channels) with the ordinals of groups of ``sizes`` channels.

    Returns the columns that are copies: of which group and which of its channels. Raises
    FormatError on bad bytes.
    """
    own, read, _, _ = loops()
    data = _spared(streams)
    bounds = np.cumsum([SPARE, *map(len, streams)], dtype=np.int64)
    firsts = np.cumsum([0, *sizes], dtype=np.int64)
    given = read.Streams(data, bounds, firsts, channels.forms)
    plans = np.zeros((len(channels.forms), own.PLAN_SIZE), np.int64)
    rests = np.zeros((len(out), 0), np.int64)
    channel, fault = _read(given, plans, read.Rows(out, rests))
    if channel == read.NO_ROOM:
        rests = np.zeros(out.shape, np.int64)
        channel, fault = _read(given, plans, read.Rows(out, rests))
    if fault >= 0:
        raise FormatError(f"fast: channel {channel} of those read: {FAULTS[fault]}")
    for n in np.flatnonzero((plans[:, own.KIND] == CODED) & (plans[:, own.UNIT] > 0)):
        (unit,) = struct.unpack_from("<d", data.data, plans[n, own.UNIT])
        check_unit("fast", unit)
        shifts, grid = int(plans[n, own.SHIFTS]), channels.grids[n]
        if plans[n, own.PARTS]:
            at = int(plans[n, own.UNIT]) + UNIT_SIZE
            law, has_rests, _ = parse_law(bytes(data[at : at + LAW_SIZE]), 0, unit)
            out[:, n] = law.ordinals(out[:, n]) + (rests[:, n] if has_rests else 0)  # FAST-12
        elif not shifts:
            out[:, n] = of_multiples(out[:, n], unit)  # FAST-12
        elif grid.kind == GridKind.GENERAL:  # FAST-02, LOSS-32
            out[:, n] = of_products(out[:, n], unit, shifts, grid)  # FAST-12
        else:
            raise FormatError(f"fast: products on the grid {grid.kind.name}")
    return {
        int(n): (int(plans[n, own.GROUP]), int(plans[n, own.COLUMN]))
        for n in np.flatnonzero(plans[:, own.KIND] == COPY)
    }


def _read(streams: Any, plans: Ints, rows: Any) -> tuple[int, int]:
    """The streams decoded, compiled or in the quickest plain Python: see ``read_streams``."""
    if lacks_compiled_kernels():
        from mcz.coding.quick import plain

        return plain.read_streams(streams, plans, rows)
    found: tuple[int, int] = loops()[1].read_streams(streams, plans, rows, tables())
    return found


def renumbered(stream: bytes, channels: Channels, number_of: Callable[[int, int], int]) -> bytes:
    """``stream`` with the groups that its copies name numbered anew."""
    from mcz.coding.quick import head_kernels as read

    own = loops()[0]
    forms = channels.forms
    plans = np.zeros((len(forms), own.PLAN_SIZE), np.int64)
    ends = np.zeros(len(forms), np.int64)
    end = SPARE + len(stream)
    fault = read.read_ends(_spared([stream]), SPARE, end, forms, plans, ends, tables().powers)
    if fault >= 0:
        raise FormatError(f"fast: {FAULTS[fault]}")
    parts, start = [], 0
    for head, end in zip(plans, (ends - SPARE).tolist(), strict=True):
        part = stream[start:end]
        if head[own.KIND] == COPY:
            group, column = int(head[own.GROUP]), int(head[own.COLUMN])
            part = bytes((COPY,)) + varint(number_of(group, column)) + varint(column)
        parts.append(part)
        start = end
    return b"".join(parts) + stream[start:]


def _spared(streams: Sequence[bytes]) -> NDArray[np.uint8]:
    """The streams one behind the other, with zeros at both ends."""
    spare = bytes(SPARE)
    return np.frombuffer(bytearray(b"".join((spare, *streams, spare))), np.uint8)
