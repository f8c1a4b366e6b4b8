"""The stream of a group as codec 14, ``fast``, has it: heads of its channels, then their bits.

SPEC.md, "Codec 14: fast", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.coding.ordinals.choices import Lattice, lattice, max_top
from mcz.coding.ordinals.heads import CODED, COPY, OWN_FORM, form_of, form_of_grid
from mcz.coding.ordinals.streams import constant_head
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]

PLAIN = Grid(GridKind.INTEGER)
MAX_VALUE_SIZE = 12  # bytes of bits beside a symbol
SPARE = 32  # bytes behind the streams that a reader of a hostile one may look at
FAULTS = (
    "it ends in the head",
    "its kind is unknown",
    "its constant is not as short as it can be",
    "its form is unknown",
    "its classes are out of range",
    "its taps are out of range",
    "its scale is out of range",
    "its bits cannot be decoded",
)


@cache
def loops() -> tuple[Any, Any, Any]:
    from mcz.coding.quick import choice_kernels, kernels, stream_kernels

    return kernels, stream_kernels, choice_kernels


def build_stream(
    ordinals: Ints,
    grids: Sequence[tuple[Grid, Grid]],
    group: int,
    seen: dict[bytes, tuple[int, int]] | None,
) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels); grids in force and of the clip.

    ``seen``: where a channel was coded that a later one may repeat; None: there shall be no copies.
    """
    heads, coded = [], []
    for channel, column in enumerate(np.ascontiguousarray(ordinals.T)):
        key = column.tobytes()
        if (column == column[0]).all():
            heads.append(constant_head(int(column[0])))
        elif seen is not None and key in seen:
            heads.append(bytes((COPY,)) + b"".join(map(varint, seen[key])))
        else:
            if seen is not None:
                seen[key] = group, channel
            head, records = _code_column(column, *grids[channel])
            heads.append(head)
            coded.append(records)
    return b"".join(heads) + (_write(np.concatenate(coded)) if coded else b"")


def _code_column(column: Ints, grid: Grid, clip_grid: Grid) -> tuple[bytes, Ints]:
    """The head of a coded channel, and what is coded of its rows."""
    own, _, choice = loops()
    from mcz.coding.quick import tables
    from mcz.coding.quick.record_kernels import RECORD_SIZE

    shape = lattice(grid, column)
    depth = _depth(column, shape)
    if shape.base and (shape.top > max_top(shape) or _too_wide(shape, depth)):
        shape, depth = lattice(PLAIN, column), 0
    plan = np.zeros(own.PLAN_SIZE, np.int64)
    plan[[own.BASE, own.DIGITS, own.DROP]] = shape.base, shape.digits, shape.drop
    plan[[own.TOP, own.DEPTH]] = shape.top, depth
    records = np.empty((len(column), RECORD_SIZE), np.int64)
    spread = np.empty((2, len(column)), np.int64)
    work = np.empty((own.MAX_TAPS + 1, own.MAX_TAPS + 1))
    scale = choice.record_best(column, plan, tables.tables().powers, tables.costs(), spread, records, work)
    taps = plan[own.TAPS : own.TAPS + own.MAX_TAPS].tolist()
    while taps and not taps[-1]:
        taps.pop()
    form = form_of(shape)
    own_form = shape.drop > 0 or form != form_of_grid(clip_grid)
    kind = CODED | int(plan[own.FROM_LAST]) << 2 | len(taps) << 3 | OWN_FORM * own_form
    head = [bytes((kind,)), bytes((form, shape.drop)) if own_form else b""]
    head += [varint(shape.top), varint(depth)] if shape.base else []
    head += [bytes((scale,)), *(varint(2 * t if t >= 0 else -2 * t - 1) for t in taps)]
    return b"".join(head), records


def _depth(column: Ints, shape: Lattice) -> int:
    """How many classes below the greatest one there are numbers, but for zeros."""
    if not shape.base:
        return 0
    magnitudes = (column ^ (column >> 63)) >> shape.drop
    least = int(magnitudes[magnitudes > 0].min()) - (shape.base == 10)
    return shape.top - least // ((shape.base - 1) * shape.base ** (shape.digits - 1))


def _too_wide(shape: Lattice, depth: int) -> bool:
    per_class = (shape.base - 1) * shape.base ** (shape.digits - 1)
    return (depth + 1) * per_class > 1 << 60


def _write(records: Ints) -> bytes:
    """The bits of the coded channels."""
    from mcz.coding.quick import record_kernels, tables

    words = np.empty(len(records), np.int64)
    data = np.zeros(MAX_VALUE_SIZE * len(records), np.uint8)
    state, n_words, n_bits = record_kernels.write_records(records, tables.tables(), words, data)
    bits = data[: (n_bits + 7) // 8][::-1].tobytes()
    return int(state).to_bytes(4, "little") + words[:n_words][::-1].astype("<u2").tobytes() + bits


def parse_streams(
    streams: Sequence[bytes], sizes: Sequence[int], forms: Ints, out: Ints
) -> dict[int, tuple[int, int]]:
    """Fill ``out`` (rows, channels) with the ordinals of groups of ``sizes`` channels.

    Returns the columns that are copies: of which group and which of its channels.
    """
    own, read, _ = loops()
    from mcz.coding.quick import tables

    data = _spared(streams)
    words = np.ascontiguousarray(data[::-1]).view("<u4").astype(np.int64)
    ends = SPARE + np.cumsum([len(stream) for stream in streams])
    firsts = np.concatenate(([0], np.cumsum(sizes)))
    heads = np.zeros((len(forms), own.PLAN_SIZE), np.int64)
    channel, fault = read.read_streams(
        data, words, SPARE, ends, firsts, forms, heads, out, tables.tables()
    )
    if fault >= 0:
        raise FormatError(f"fast: channel {channel} of those read: {FAULTS[fault]}")
    return {
        int(n): (int(heads[n, own.GROUP]), int(heads[n, own.COLUMN]))
        for n in np.flatnonzero(heads[:, own.KIND] == COPY)
    }


def renumbered(stream: bytes, forms: Ints, number_of: Callable[[int, int], int]) -> bytes:
    """``stream`` with the groups that its copies name numbered anew."""
    own, read, _ = loops()
    from mcz.coding.quick import tables

    heads = np.zeros((len(forms), own.PLAN_SIZE), np.int64)
    ends = np.zeros(len(forms), np.int64)
    fault = read.read_ends(_spared([stream]), SPARE, SPARE + len(stream), forms, heads, ends, tables.tables().powers)
    if fault >= 0:
        raise FormatError(f"fast: {FAULTS[fault]}")
    parts, start = [], 0
    for head, end in zip(heads, (ends - SPARE).tolist(), strict=True):
        part = stream[start:end]
        if head[own.KIND] == COPY:
            group, column = int(head[own.GROUP]), int(head[own.COLUMN])
            part = bytes((COPY,)) + varint(number_of(group, column)) + varint(column)
        parts.append(part)
        start = end
    return b"".join(parts) + stream[start:]


def _spared(streams: Sequence[bytes]) -> NDArray[np.uint8]:
    """The streams one behind the other, with zeros at both ends, in whole words."""
    padding = -sum(map(len, streams)) % 4
    return np.frombuffer(bytearray(b"".join((bytes(SPARE), *streams, bytes(SPARE + padding)))), np.uint8)
