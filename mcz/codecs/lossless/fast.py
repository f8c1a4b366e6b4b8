"""Codec fast: linear prediction and adaptive Rice codes, made to be read.

SPEC.md, "Codec 1: fast", is normative.

Exactness: lossless and bit-exact; integers only, in 32 bits but for ordinals. All streams of a
segment are coded together, as a channel may follow one of another group.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Recoding,
    Request,
    SignalSource,
    Span,
    refuse_extras,
)
from mcz.codecs.lossless.segments import segment_frames
from mcz.codecs.segments import Sizing, guessing
from mcz.coding.fast.decoder import (
    MOST_ROWS,
    MOST_VALUES,
    SegmentDecoder,
    Shape,
    check_size,
    read_segments,
)
from mcz.coding.fast.encoder import build_streams
from mcz.numbers import Grid
from mcz.types import Params

Ints = NDArray[np.int64]

USUAL_ROWS = 1024
SIZING = Sizing(60_000, 63_000, value_bytes=1.5, most_rows=USUAL_ROWS, spare=1)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    fixed: int = params["segment_frames"]
    most = min(MOST_ROWS if fixed else USUAL_ROWS, MOST_VALUES // max(1, source.layout.n_channels))
    groups = range(len(source.layout.groups))
    prepare = partial(_prepare, source, groups)
    return Encoded(b"", guessing(source, fixed, replace(SIZING, most_rows=most), prepare))


def _prepare(
    source: SignalSource, groups: Sequence[int], start: int, stop: int
) -> Callable[[], tuple[bytes, ...]]:
    """The making of the streams of a segment."""
    layout = source.layout
    grids = list(zip(source.grids(start), layout.grids, strict=True))
    ordinals = source.ordinals(start, stop)
    return lambda: tuple(build_streams(ordinals, grids, layout.groups))


def recode(asked: Recoding) -> Iterator[tuple[bytes, ...]]:
    """The streams of all groups with new values."""
    for span in asked.spans:
        yield _prepare(asked.source, asked.groups, span.first, span.stop)()


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("fast", header, layout)
    per_frame = layout.samples_per_frame
    n_channels = sum(len(layout.groups[group]) for group in request.groups)
    out = np.empty(((request.stop - request.start) * per_frame, n_channels), np.int64)
    shape = _shape(layout.grids, layout.groups)
    segments, parts = [], []
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start < stop:
            n_rows = _rows(layout, span)
            target = out[(start - request.start) * per_frame : (stop - request.start) * per_frame]
            rows = target if len(target) == n_rows else np.empty((n_rows, n_channels), np.int64)
            fetch_group = partial(fetch, index, 0)
            segments.append(SegmentDecoder(shape, request.groups, fetch_group, rows))
            if rows is not target:
                first = (start - span.first) * per_frame
                parts.append((target, rows[first : first + len(target)]))
    read_segments(segments)
    for target, rows in parts:
        target[:] = rows
    return out


def _rows(layout: Layout, span: Span) -> int:
    n_rows = span.n_frames * layout.samples_per_frame
    check_size(n_rows, layout.n_channels, span.n_frames)
    return n_rows


@lru_cache(maxsize=64)
def _shape(grids: tuple[Grid, ...], groups: tuple[tuple[int, ...], ...]) -> Shape:
    return Shape(grids, groups)


def subset(layout: Layout, span: Span, groups: Sequence[int], fetch: Fetch) -> tuple[bytes, ...]:
    """The streams of some groups of a segment, coded without the others."""
    shape = _shape(layout.grids, layout.groups)
    stream = partial(fetch, 0, 0)
    n_channels = sum(len(layout.groups[group]) for group in groups)
    ordinals = np.empty((_rows(layout, span), n_channels), np.int64)
    read_segments([SegmentDecoder(shape, tuple(groups), stream, ordinals)])
    grids = [layout.grids[channel] for group in groups for channel in layout.groups[group]]
    stops = np.cumsum([len(layout.groups[group]) for group in groups]).tolist()
    left = [range(start, stop) for start, stop in zip([0, *stops], stops, strict=False)]
    return tuple(build_streams(ordinals, list(zip(grids, grids, strict=True)), left))


CODEC = Codec(
    id=1,
    name="fast",
    version=0,
    domain="ordinals",
    lossless=True,
    hash_optional=True,
    encode=encode,
    decode=decode,
    subset=subset,
    recode=recode,
    parameters=(segment_frames("60,000", MOST_ROWS),),
)
