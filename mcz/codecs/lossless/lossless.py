"""Codec 1, ``lossless``: predicted ordinals, entropy coded with mixed adaptive contexts.

SPEC.md, "Codec 1: lossless", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only, coder state in u32, products below 2^53 but for
ordinals themselves. A stream holds one group of one segment and needs no other, but for channels
that are copies of another group's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
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
from mcz.codecs.parameters import Parameter, integer
from mcz.codecs.segments import TARGET_BYTES, Sizing, gather, guessing
from mcz.coding.ordinals.degrees import is_tiny
from mcz.coding.ordinals.heads import COPY, read_heads
from mcz.coding.ordinals.streams import build_stream, parse_stream
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

MAX_ROWS = 2**16
FIRST_FRAMES = 64  # that decide on the version
SIZING = Sizing(target=TARGET_BYTES, value_bytes=2, aim=95, most_rows=MAX_ROWS, spare=1)

PLAIN = Grid(GridKind.INTEGER)


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    version = _least_version(source)
    code = partial(_build_segment, source, version)
    segments = guessing(source, params["segment_frames"], SIZING, code)
    return Encoded(header=b"", segments=segments, version=version)


def _least_version(source: SignalSource) -> int:
    """1 where the first rows have a channel that its form may help, else 0."""
    if not any(grid.kind == GridKind.GENERAL for grid in source.layout.grids):
        return 0
    columns = source.ordinals(0, min(FIRST_FRAMES, source.layout.n_frames)).T
    pairs = zip(columns, source.layout.grids, strict=True)
    return int(any(column.size > 0 and is_tiny(column, grid) for column, grid in pairs))


def _build_segment(source: SignalSource, version: int, start: int, stop: int) -> tuple[bytes, ...]:
    ordinals = source.ordinals(start, stop)
    grids = source.grids(start)
    seen: dict[bytes, tuple[int, int]] = {}
    streams = []
    for index, group in enumerate(source.layout.groups):
        columns = ordinals[:, list(group)]
        own = [(grids[c], source.layout.grids[c]) for c in group]
        streams.append(build_stream(columns, own, index, seen, version))
    return tuple(streams)


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
            build_stream(
                ordinals[:, list(layout.groups[group])],
                [(grids[c], layout.grids[c]) for c in layout.groups[group]],
                group,
                None,
            )
            for group in groups
        )


def decode(
    header: bytes,
    layout: Layout,
    spans: Sequence[Span],
    request: Request,
    fetch: Fetch,
    version: int = 1,
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("lossless", header, layout)
    readers = {
        index: _Segment(
            layout, span.n_frames * layout.samples_per_frame, partial(fetch, index, 0), version
        )
        for index, span in enumerate(spans)
        if span.first < request.stop and request.start < span.stop
    }
    return gather(layout, spans, request, lambda index, group: readers[index].group(group))


class _Segment:
    """The groups of one segment, decoded as they are asked for."""

    def __init__(
        self, layout: Layout, n_rows: int, stream: Callable[[int], bytes], version: int
    ) -> None:
        self.layout, self.n_rows, self.stream, self.version = layout, n_rows, stream, version
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
            self._done[group] = parse_stream(self.stream(group), grids, self.n_rows, self.version)
        return self._done[group]


def _check_copy(layout: Layout, group: int, column: int) -> None:
    if not group < len(layout.groups) or not column < len(layout.groups[group]):  # LOSS-10
        raise FormatError(f"lossless: a copy of channel {column} of group {group}")


def regroup(stream: bytes, layout: Layout, group: int, numbers: Mapping[int, int]) -> bytes:
    """``stream`` of ``group`` with its copies referring to the groups' new ``numbers``."""
    heads, end = read_heads(stream, [layout.grids[c] for c in layout.groups[group]], 1)
    parts = []
    for kind, found, head in heads:
        if kind == COPY:
            _check_copy(layout, *found)
            head = bytes((COPY,)) + varint(numbers[found[0]]) + varint(found[1])
        parts.append(head)
    return b"".join(parts) + stream[end:]


CODEC = Codec(
    id=1,
    name="lossless",
    version=1,
    earlier={0: partial(decode, version=0)},
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
