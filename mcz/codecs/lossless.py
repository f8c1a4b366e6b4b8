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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs._lossless_heads import (
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
from mcz.codecs._lossless_plan import choose_predictor, fixed_point, lattice, max_top
from mcz.codecs._lossless_units import find_unit, of_multiples
from mcz.codecs.base import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Parameter,
    Request,
    Segment,
    SignalSource,
    Span,
    gather,
    integer,
    refuse_extras,
)
from mcz.coding.start import start_state
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

TARGET_BYTES = 62_000  # of a segment: under the 64 KiB that DATA should have, table included
MAX_ROWS = 2**16
START_TABLE = Path(__file__).with_name("lossless_start.json")

# The head of each channel of a stream, as SPEC.md's table has it: (name, type, meaning).
LOSSLESS_FIELDS = (
    ("kind", "u8", "bits 0-1: 0 coded, 1 constant, 2 copy; the others by kind"),
    ("ordinal", "bytes", "constant: the ordinal, zigzag, in as many bytes as bits 2-5 of kind say"),
    ("group", "varint", "copy: group of the channel that this one repeats"),
    ("channel", "varint", "copy: that channel, counted within its group"),
    (
        "form",
        "u8",
        "coded, bit 7 of kind: 0 plain, 32 multiples, others classes",
    ),
    ("drop", "u8", "coded, bit 7 of kind: low bits of an ordinal or magnitude that are apart"),
    ("unit", "binary64", "coded, form 32: what the coded integers are multiplied by"),
    ("top", "varint", "coded, form neither 0 nor 32: the greatest class"),
    ("scale", "u8", "coded: first scale, in quarters of an octave"),
    ("taps", "zigzag varint each", "coded: as many as bits 3-6 of kind say; bit 2: from_last"),
)
PLAIN = Grid(GridKind.INTEGER)


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    return Encoded(header=b"", segments=_segments(source, params["segment_frames"]))


def _segments(source: SignalSource, fixed: int) -> Iterator[Segment]:
    layout = source.layout
    ends = sorted({*source.breaks, layout.n_frames})
    most = min(layout.most_frames, max(1, MAX_ROWS // layout.samples_per_frame))
    per_frame = max(1, layout.n_channels) * layout.samples_per_frame
    guess = fixed or max(1, TARGET_BYTES // (2 * per_frame))
    first = 0
    while first < layout.n_frames:
        end = next(e for e in ends if e > first)
        n_frames = min(guess, end - first, most)
        streams = _build_segment(source, first, first + n_frames)
        size = sum(map(len, streams)) + 1
        if size > TARGET_BYTES and n_frames > 1 and not fixed:
            guess = max(1, n_frames * TARGET_BYTES * 95 // (size * 100))
            continue
        yield Segment(first, n_frames, streams)
        first += n_frames
        if not fixed:
            guess = max(1, min(4 * n_frames, n_frames * TARGET_BYTES * 95 // (size * 100)))


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
    from mcz.codecs import _lossless_kernels
    from mcz.coding import kernels

    return _lossless_kernels, kernels


@cache
def _start_state() -> Ints:
    """The state of a coder before its first bit; SPEC.md's annex has the numbers."""
    import json

    return start_state(json.loads(START_TABLE.read_text()))


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
        state = _start_state().copy()
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
        for channel, (other, place) in copies.items():
            _check_copy(self.layout, other, place)
            source, others = self._own(other)
            if place in others:
                raise FormatError(f"lossless: a copy of a copy, channel {place} of group {other}")
            columns[:, channel] = source[:, place]
        return columns

    def _own(self, group: int) -> tuple[Ints, dict[int, tuple[int, int]]]:
        """The columns of a group that are no copies, and which are."""
        if group not in self._done:
            grids = [self.layout.grids[c] for c in self.layout.groups[group]]
            self._done[group] = _parse(self.stream(group), grids, self.n_rows)
        return self._done[group]


def _check_copy(layout: Layout, group: int, place: int) -> None:
    if not group < len(layout.groups) or not place < len(layout.groups[group]):
        raise FormatError(f"lossless: a copy of channel {place} of group {group}")


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
            columns[:, channel] = found
        elif found[1] is not None:
            columns[:, channel] = of_multiples(columns[:, channel], found[1])
    return columns, copies


def _uncode(data: bytes, plans: Sequence[Ints], n_rows: int) -> Ints:
    """The ordinals of the coded channels, (n_rows, len(plans))."""
    if not plans:
        if data:
            raise FormatError(f"lossless: {len(data)} bytes follow the last channel")
        return np.empty((n_rows, 0), np.int64)
    loops, coding = _kernels()
    bits = np.frombuffer(data, np.uint8).copy()  # one kind of array, one compiled loop
    state = _start_state().copy()
    rows = np.zeros((n_rows, len(plans)), np.int64)
    coding.start(state, bits, 0)
    fault = loops.code_rows(state, bits, rows, np.stack(plans), _powers())
    if fault >= 0:
        raise FormatError(f"lossless: row {fault} cannot be decoded")
    if coding.coded_size(state) != len(bits):
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
