"""Codec 1, ``lossless``: predicted ordinals, entropy coded with mixed adaptive contexts.

SPEC.md, "Codec 1: lossless", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only, coder state in u32, products below 2^53 but for
ordinals themselves. A stream holds one group of one segment and needs no other, but for channels
that are copies of another group's.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Request,
    SignalSource,
    Span,
    refuse_extras,
)
from mcz.codecs.lossless.choices import choose_predictor, fixed_point, lattice, max_top
from mcz.codecs.lossless.heads import (
    CODED,
    CONSTANT,
    COPY,
    MAX_SCALE,
    MULTIPLES,
    OWN_FORM,
    form_of,
    form_of_grid,
    make_plan,
    read_heads,
    scale_of,
)
from mcz.codecs.lossless.units import find_unit, of_multiples
from mcz.codecs.parameters import Parameter, integer
from mcz.codecs.segments import TARGET_BYTES, Sizing, gather, guessing
from mcz.coding.start import start_states
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

MAX_ROWS = 2**16
SIZING = Sizing(target=TARGET_BYTES, value_bytes=2, aim=95, most_rows=MAX_ROWS, spare=1)

PLAIN = Grid(GridKind.INTEGER)


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    code = partial(_build_segment, source)
    return Encoded(header=b"", segments=guessing(source, params["segment_frames"], SIZING, code))


def _build_segment(source: SignalSource, start: int, stop: int) -> tuple[bytes, ...]:
    ordinals = source.ordinals(start, stop)
    grids = source.grids(start)
    seen: dict[bytes, tuple[int, int]] = {}
    streams = []
    for index, group in enumerate(source.layout.groups):
        columns = ordinals[:, list(group)]
        own = [(grids[c], source.layout.grids[c]) for c in group]
        streams.append(_build(columns, own, index, seen))
    return tuple(streams)


def _build(
    ordinals: Ints,
    grids: Sequence[tuple[Grid, Grid]],
    group: int,
    seen: dict[bytes, tuple[int, int]] | None,
) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels); grids in force and of the clip.

    ``seen``: where a channel was coded that a later one may repeat; None: there shall be no copies.
    """
    heads, plans, coded = [], [], []
    for channel, column in enumerate(ordinals.T):
        column = np.ascontiguousarray(column)
        key = column.tobytes()
        if (column == column[0]).all():
            heads.append(_constant_head(int(column[0])))
        elif seen is not None and key in seen:
            heads.append(bytes((COPY,)) + b"".join(map(varint, seen[key])))
        else:
            if seen is not None:
                seen[key] = group, channel
            head, plan, numbers = _coded_head(column, *grids[channel])
            heads.append(head)
            plans.append(plan)
            coded.append(numbers)
    return b"".join(heads) + (_code(np.stack(coded, axis=1), plans) if plans else b"")


def recode(
    header: bytes,
    source: SignalSource,
    groups: tuple[int, ...],
    spans: Sequence[Span],
    options: Mapping[str, Any],
    fetch: Fetch,
) -> Iterator[tuple[bytes, ...]]:
    """The streams of some groups with new values, without copies.

    What such a stream repeated, or who repeated it, need not be looked at then.
    """
    layout = source.layout
    for span in spans:
        ordinals, grids = source.ordinals(span.first, span.stop), source.grids(span.first)
        yield tuple(
            _build(
                ordinals[:, list(layout.groups[group])],
                [(grids[c], layout.grids[c]) for c in layout.groups[group]],
                group,
                None,
            )
            for group in groups
        )


def _constant_head(ordinal: int) -> bytes:
    folded = 2 * ordinal if ordinal >= 0 else -2 * ordinal - 1
    size = (folded.bit_length() + 7) // 8
    return bytes((CONSTANT | size << 2,)) + folded.to_bytes(size, "little")


def _coded_head(column: Ints, grid: Grid, clip_grid: Grid) -> tuple[bytes, Ints, Ints]:
    """The head of a coded channel, its plan for the compiled loop, and the integers to code."""
    found = find_unit(column) if grid.kind == GridKind.BINARY32 else None
    unit, column = found if found is not None else (0.0, column)
    shape = lattice(grid if found is None else PLAIN, column)
    if shape.base and shape.top > max_top(shape):
        shape = lattice(PLAIN, column)
    from_last, taps, error = choose_predictor(fixed_point(column, shape))
    scale = next((q for q in range(MAX_SCALE) if scale_of(q) >= error), MAX_SCALE)
    form = form_of(shape) if found is None else MULTIPLES
    own_form = shape.drop > 0 or form != form_of_grid(clip_grid)
    kind = CODED | from_last << 2 | len(taps) << 3 | OWN_FORM * own_form
    head = [bytes((kind,)), bytes((form, shape.drop)) if own_form else b""]
    head += [struct.pack("<d", unit)] if form == MULTIPLES else []
    head += [varint(shape.top)] if shape.base else []
    head += [bytes((scale,)), *(varint(2 * t if t >= 0 else -2 * t - 1) for t in taps)]
    return b"".join(head), make_plan(shape, scale, from_last, taps), column


@cache
def _kernels() -> tuple[Any, Any]:
    from mcz.codecs.lossless import kernels
    from mcz.coding import mixing

    return kernels, mixing


@cache
def _powers() -> Ints:
    """Powers of 2, then of 10, up to where they stand for "too large", (2, 64)."""
    twos = [min(2**k, 2**62) for k in range(64)]
    return np.array([twos, [min(10**k, 10**18) for k in range(64)]], np.int64)


def _code(ordinals: Ints, plans: Sequence[Ints]) -> bytes:
    """The bits of the coded channels, at least one."""
    loops, coding = _kernels()
    rows = np.ascontiguousarray(ordinals)
    size = 4 * rows.size + 1024
    while True:
        data = np.zeros(size, np.uint8)
        state = start_states("lossless")[0].copy()
        coding.start(state, data, 1)
        fault = loops.code_rows(state, data, rows.copy(), np.stack(plans), _powers())
        used = coding.finish(state, data)
        if fault >= 0:
            raise AssertionError(f"lossless: row {fault} has no code")
        if used <= size:
            return data[:used].tobytes()
        size = used + 1024


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("lossless", header, layout)
    readers = {
        index: _Segment(layout, span.n_frames * layout.samples_per_frame, partial(fetch, index, 0))
        for index, span in enumerate(spans)
        if span.first < request.stop and request.start < span.stop
    }
    return gather(layout, spans, request, lambda index, group: readers[index].group(group))


class _Segment:
    """The groups of one segment, decoded as they are asked for."""

    def __init__(self, layout: Layout, n_rows: int, stream: Callable[[int], bytes]) -> None:
        self.layout, self.n_rows, self.stream = layout, n_rows, stream
        self._done: dict[int, tuple[Ints, dict[int, tuple[int, int]]]] = {}

    def group(self, group: int) -> Ints:
        """The ordinals of one group, (n_rows, channels), its copies filled in."""
        columns, copies = self._own(group)
        for channel, (other, column) in copies.items():
            _check_copy(self.layout, other, column)
            source, others = self._own(other)
            if column in others:  # LOSS-11
                raise FormatError(f"lossless: a copy of a copy, channel {column} of group {other}")
            columns[:, channel] = source[:, column]  # LOSS-09
        return columns

    def _own(self, group: int) -> tuple[Ints, dict[int, tuple[int, int]]]:
        """The columns of a group that are no copies, and which are."""
        if group not in self._done:
            grids = [self.layout.grids[c] for c in self.layout.groups[group]]
            self._done[group] = _parse(self.stream(group), grids, self.n_rows)
        return self._done[group]


def _check_copy(layout: Layout, group: int, column: int) -> None:
    if not group < len(layout.groups) or not column < len(layout.groups[group]):  # LOSS-10
        raise FormatError(f"lossless: a copy of channel {column} of group {group}")


def regroup(stream: bytes, layout: Layout, group: int, numbers: Mapping[int, int]) -> bytes:
    """``stream`` of ``group`` with its copies referring to the groups' new ``numbers``."""
    heads, end = read_heads(stream, [layout.grids[c] for c in layout.groups[group]])
    parts = []
    for kind, found, head in heads:
        if kind == COPY:
            _check_copy(layout, *found)
            head = bytes((COPY,)) + varint(numbers[found[0]]) + varint(found[1])
        parts.append(head)
    return b"".join(parts) + stream[end:]


def _parse(
    stream: bytes, grids: Sequence[Grid], n_rows: int
) -> tuple[Ints, dict[int, tuple[int, int]]]:
    columns = np.zeros((n_rows, len(grids)), np.int64)
    heads, end = read_heads(stream, grids)
    coded = [channel for channel, (kind, _, _) in enumerate(heads) if kind == CODED]
    columns[:, coded] = _uncode(stream[end:], [heads[c][1][0] for c in coded], n_rows)
    copies = {}
    for channel, (kind, found, _) in enumerate(heads):
        if kind == COPY:
            copies[channel] = found
        elif kind == CONSTANT:
            columns[:, channel] = found  # LOSS-08
        elif found[1] is not None:
            columns[:, channel] = of_multiples(columns[:, channel], found[1])
    return columns, copies


def _uncode(data: bytes, plans: Sequence[Ints], n_rows: int) -> Ints:
    """The ordinals of the coded channels, (n_rows, len(plans))."""
    if not plans:
        if data:  # LOSS-21
            raise FormatError(f"lossless: {len(data)} bytes follow the last channel")
        return np.empty((n_rows, 0), np.int64)
    loops, coding = _kernels()
    bits = np.frombuffer(data, np.uint8).copy()  # one kind of array, one compiled loop
    state = start_states("lossless")[0].copy()  # LOSS-22
    rows = np.zeros((n_rows, len(plans)), np.int64)
    coding.start(state, bits, 0)
    fault = loops.code_rows(state, bits, rows, np.stack(plans), _powers())
    if fault >= 0:
        raise FormatError(f"lossless: row {fault} cannot be decoded")
    if coding.coded_size(state) != len(bits):  # LOSS-23, RANGE-04
        raise FormatError(
            f"lossless: {len(bits)} bytes, of which {coding.coded_size(state)} belong"
        )
    return rows


CODEC = Codec(
    id=1,
    name="lossless",
    version=0,
    domain="ordinals",
    lossless=True,
    encode=encode,
    decode=decode,
    regroup=regroup,
    recode=recode,
    parameters=(
        Parameter(
            "segment_frames",
            0,
            "frames a segment; 0: as many as make about 62,000 bytes",
            integer("segment_frames", 0, MAX_ROWS),
        ),
    ),
)
