"""Streams of groups of one segment each, with constants and copies: what lossless and best share.

SPEC.md, "Codec 128: lossless", is normative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Encoded, Fetch, Layout, Recoding, Request, SignalSource, Span
from mcz.codecs.lossless.segments import check_copy
from mcz.codecs.segments import Sizing, gather, guessing
from mcz.coding.ordinals.heads import COPY, read_heads
from mcz.coding.ordinals.streams import Own, Seen
from mcz.errors import FormatError
from mcz.numbers import Grid
from mcz.schema import varint
from mcz.types import Params

Ints = NDArray[np.int64]

# (stream, grids, rows) -> the ordinals of a group, and which of its channels copy which.
Parse = Callable[[bytes, Sequence[Grid], int], tuple[Ints, dict[int, tuple[int, int]]]]
Build = Callable[[Ints, Sequence[Own], int, Seen | None], bytes]  # makes the stream of a group


def encode_streams(
    source: SignalSource,
    params: Params,
    sizing: Sizing,
    build: Build,
    threads: int = 1,
) -> Encoded:
    """Code the ordinals of ``source`` in streams that ``build`` makes."""
    prepare = partial(_prepare, source, build)
    return Encoded(b"", guessing(source, params["segment_frames"], sizing, prepare, threads))


def _prepare(
    source: SignalSource, build: Build, start: int, stop: int
) -> Callable[[], tuple[bytes, ...]]:
    """What makes the streams of a segment."""
    layout, grids, ordinals = source.layout, source.grids(start), source.ordinals(start, stop)

    def streams() -> Iterator[bytes]:
        seen: Seen = {}
        for index, group in enumerate(layout.groups):
            own = [(grids[c], layout.grids[c]) for c in group]
            yield build(ordinals[:, list(group)], own, index, seen)

    return lambda: tuple(streams())


def recode_streams(build: Build, asked: Recoding) -> Iterator[tuple[bytes, ...]]:
    """Streams of some groups with new values, without copies.

    What such a stream repeated, or who repeated it, need not be looked at then.
    """
    source, layout = asked.source, asked.source.layout
    for span in asked.spans:
        ordinals, grids = source.ordinals(span.first, span.stop), source.grids(span.first)
        yield tuple(
            build(
                ordinals[:, list(layout.groups[group])],
                [(grids[c], layout.grids[c]) for c in layout.groups[group]],
                group,
                None,
            )
            for group in asked.groups
        )


def decode_streams(
    layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch, parse: Parse
) -> Ints:
    """The ordinals that were requested, of streams that ``parse`` reads."""
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
            check_copy("lossless", self.layout, other, column)
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


def regroup(stream: bytes, layout: Layout, group: int, numbers: Mapping[int, int]) -> bytes:
    """``stream`` of ``group`` with its copies referring to the groups' new ``numbers``."""
    heads, end = read_heads(stream, [layout.grids[c] for c in layout.groups[group]], 1)
    parts = []
    for kind, found, head in heads:
        if kind == COPY:
            check_copy("lossless", layout, *found)
            head = bytes((COPY,)) + varint(numbers[found[0]]) + varint(found[1])
        parts.append(head)
    return b"".join(parts) + stream[end:]
