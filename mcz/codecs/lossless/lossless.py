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
from mcz.coding.ordinals.heads import COPY, read_heads
from mcz.coding.ordinals.streams import Own, Seen, build_stream, parse_stream
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

MAX_ROWS = 2**16
SIZING = Sizing(target=TARGET_BYTES, value_bytes=2, aim=95, most_rows=MAX_ROWS, spare=1)

PLAIN = Grid(GridKind.INTEGER)
PARAMETERS = (
    Parameter(
        "segment_frames",
        0,
        "frames a segment; 0: as many as make about 62,000 bytes",
        integer("segment_frames", 0, MAX_ROWS),
    ),
)

# (stream, grids, rows) -> the ordinals of a group, and which of its channels copy which.
Parse = Callable[[bytes, Sequence[Grid], int], tuple[Ints, dict[int, tuple[int, int]]]]
Build = Callable[[Ints, Sequence[Own], int, Seen | None], bytes]  # as ``build_stream``


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    return encode_streams(source, params, SIZING, build_stream)


def encode_streams(
    source: SignalSource, params: Mapping[str, Any], sizing: Sizing, build: Build
) -> Encoded:
    """The same with streams that ``build`` makes."""
    code = partial(_build_segment, source, build)
    return Encoded(header=b"", segments=guessing(source, params["segment_frames"], sizing, code))


def _build_segment(source: SignalSource, build: Build, start: int, stop: int) -> tuple[bytes, ...]:
    ordinals = source.ordinals(start, stop)
    grids = source.grids(start)
    seen: Seen = {}
    streams = []
    for index, group in enumerate(source.layout.groups):
        columns = ordinals[:, list(group)]
        own = [(grids[c], source.layout.grids[c]) for c in group]
        streams.append(build(columns, own, index, seen))
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
    return recode_streams(source, groups, spans, build_stream)


def recode_streams(
    source: SignalSource, groups: tuple[int, ...], spans: Sequence[Span], build: Build
) -> Iterator[tuple[bytes, ...]]:
    """The same with streams that ``build`` makes."""
    layout = source.layout
    for span in spans:
        ordinals, grids = source.ordinals(span.first, span.stop), source.grids(span.first)
        yield tuple(
            build(
                ordinals[:, list(layout.groups[group])],
                [(grids[c], layout.grids[c]) for c in layout.groups[group]],
                group,
                None,
            )
            for group in groups
        )


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("lossless", header, layout)
    return decode_streams(layout, spans, request, fetch, parse_stream)


def decode_streams(
    layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch, parse: Parse
) -> Ints:
    """The same of streams that ``parse`` turns into ordinals and copies."""
    per_frame = layout.samples_per_frame
    readers = {
        index: _Segment(layout, span.n_frames * per_frame, partial(fetch, index, 0), parse)
        for index, span in enumerate(spans)
        if span.first < request.stop and request.start < span.stop
    }
    return gather(layout, spans, request, lambda index, group: readers[index].group(group))


class _Segment:
    """The groups of one segment, decoded as they are asked for."""

    def __init__(
        self, layout: Layout, n_rows: int, stream: Callable[[int], bytes], parse: Parse
    ) -> None:
        self.layout, self.n_rows, self.stream, self.parse = layout, n_rows, stream, parse
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
            self._done[group] = self.parse(self.stream(group), grids, self.n_rows)
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
    parameters=PARAMETERS,
)
