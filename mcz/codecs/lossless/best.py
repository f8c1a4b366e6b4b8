"""Codec 2, ``best``: the leads of fast, predicted by regressions that learn while they are used.

SPEC.md, "Codec 2: best", is normative; the names below are its field names.

Exactness: lossless and bit-exact. Predictions are binary64 in one stated order, of ``+ - * /`` and
rounding down alone; all else is in integers. A signal is one group, so that each channel can be
predicted from those before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast.decoder import MOST_ROWS, Shape, check_size
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
from mcz.codecs.lossless.best_streams import build_stream, read_stream
from mcz.codecs.segments import Sizing, gather, lossless_segment_frames, segments_by_guess
from mcz.errors import FormatError
from mcz.model.threads import in_force
from mcz.model.types import Params

Ints = NDArray[np.int64]

SIZING = Sizing(60_500, 65_000, value_bytes=1.5, most_rows=MOST_ROWS, spare=1, full=True)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    prepare = partial(_prepare, source)
    return Encoded(
        b"", segments_by_guess(source, params["segment_frames"], SIZING, prepare, in_force())
    )


def _prepare(source: SignalSource, start: int, stop: int) -> Callable[[], tuple[bytes, ...]]:
    """The making of the streams of a segment."""
    layout, grids, ordinals = source.layout, source.grids(start), source.ordinals(start, stop)
    return lambda: tuple(build_stream(ordinals, grids, layout) for _ in layout.groups)


def recode(asked: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
    """The streams of all segments with new values."""
    for span in asked.spans:
        yield _prepare(asked.source, span.first, span.stop)()


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("best", header, layout)  # BEST-01
    if len(layout.groups) > 1:  # BEST-02
        raise FormatError(f"best: {len(layout.groups)} groups of channels")
    shape = Shape(layout.grids, layout.groups)

    def rows(index: int, group: int) -> Ints:
        n_rows = spans[index].n_frames * layout.samples_per_frame
        check_size(n_rows, layout.n_channels, spans[index].n_frames)
        out = np.empty((n_rows, layout.n_channels), np.int64)
        read_stream(shape, fetch(index, 0, group), out)
        return out

    return gather(layout, spans, request, rows)


CODEC = Codec(
    id=2,
    name="best",
    version=0,
    domain="ordinals",
    lossless=True,
    grouping="all",
    encode=encode,
    decode=decode,
    recode=recode,
    parameters=(lossless_segment_frames("57,000", MOST_ROWS),),
)
