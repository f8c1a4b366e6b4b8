"""Codec 1, ``fast``: linear prediction and adaptive Rice codes, for fast reading.

SPEC.md, "Codec 1: fast", is normative.

Exactness: lossless and bit-exact; integers only, in 32 bits except for ordinals. All streams of a
segment are coded together, as a channel may depend on one of another group.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mcz.codecs.coding.fast.decoder import (
    MOST_ROWS,
    MOST_VALUES,
    SegmentDecoder,
    Shape,
    check_size,
    read_segments,
)
from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    RecodeRequest,
    Request,
    SignalSource,
    Span,
    refuse_extras,
)
from mcz.codecs.segments import Sizing, lossless_segment_frames, segments_by_guess
from mcz.kernels import lacks_compiled_kernels
from mcz.model.identity import IdentityCache
from mcz.model.types import Ints, Params

USUAL_ROWS = 1024
SIZING = Sizing(60_000, 63_000, value_bytes=1.5, most_rows=USUAL_ROWS, spare=1)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the ordinals of ``source``; ``segment_frames`` 0 chooses lengths by size."""
    fixed: int = params["segment_frames"]
    most = min(MOST_ROWS if fixed else USUAL_ROWS, MOST_VALUES // max(1, source.layout.n_channels))
    prepare = partial(_prepare, source, _builder(source.layout))
    return Encoded(b"", segments_by_guess(source, fixed, replace(SIZING, most_rows=most), prepare))


def _builder(layout: Layout) -> StreamBuilder:
    return StreamBuilder(layout.grids, layout.groups)


def _prepare(
    source: SignalSource, builder: StreamBuilder, start: int, stop: int
) -> Callable[[], tuple[bytes, ...]]:
    grids, ordinals = source.grids(start), source.ordinals(start, stop)
    return lambda: builder.build(ordinals, grids)


def recode(request: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
    """The streams of all groups with new values."""
    builder = _builder(request.source.layout)
    for span in request.spans:
        yield _prepare(request.source, builder, span.first, span.stop)()


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes.

    Rows after the requested ones are not decoded, except by numpy.
    """
    refuse_extras("fast", header, layout)
    per_frame = layout.samples_per_frame
    shape = _shape(layout)
    n_channels = len(shape.columns(request.groups).channels)
    out = np.empty(((request.stop - request.start) * per_frame, n_channels), np.int64)
    segments, parts = [], []
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start < stop:
            n_rows = _rows(layout, span)
            target = out[(start - request.start) * per_frame : (stop - request.start) * per_frame]
            first, last = (start - span.first) * per_frame, (stop - span.first) * per_frame
            last = n_rows if lacks_compiled_kernels() else last
            rows = target if len(target) == last else np.empty((last, n_channels), np.int64)
            fetch_group = partial(fetch, index, 0)
            segments.append(SegmentDecoder(shape, request.groups, fetch_group, rows, n_rows))
            if rows is not target:
                parts.append((target, rows[first : first + len(target)]))
    read_segments(segments)
    for target, rows in parts:
        target[:] = rows
    return out


def _rows(layout: Layout, span: Span) -> int:
    n_rows = span.n_frames * layout.samples_per_frame
    check_size(n_rows, layout.n_channels, span.n_frames)
    return n_rows


_shapes = IdentityCache(Shape)


def _shape(layout: Layout) -> Shape:
    return _shapes(layout.grids, layout.groups)


def subset(layout: Layout, span: Span, groups: Sequence[int], fetch: Fetch) -> tuple[bytes, ...]:
    """The streams of some groups of a segment, coded without the others."""
    shape = _shape(layout)
    stream = partial(fetch, 0, 0)
    n_channels = sum(len(layout.groups[group]) for group in groups)
    ordinals = np.empty((n_rows := _rows(layout, span), n_channels), np.int64)
    read_segments([SegmentDecoder(shape, tuple(groups), stream, ordinals, n_rows)])
    grids = tuple(layout.grids[c] for group in groups for c in layout.groups[group])
    stops = np.cumsum([len(layout.groups[group]) for group in groups]).tolist()
    left = [range(start, stop) for start, stop in zip([0, *stops], stops, strict=False)]
    return StreamBuilder(grids, left).build(ordinals, grids)


CODEC = Codec(
    id=1,
    name="fast",
    version=0,
    domain="ordinals",
    lossless=True,
    hash_optional=True,
    by_rows=True,
    encode=encode,
    decode=decode,
    subset=subset,
    recode=recode,
    parameters=(lossless_segment_frames("60,000", MOST_ROWS),),
)
