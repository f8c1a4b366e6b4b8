"""Codec mrdwt, ``best``: ordinals predicted by regressions that are learned while they are used.

SPEC.md, "Codec 2: best", is normative; the names below are its field names.

Exactness: lossless and bit-exact. Predictions are binary64 in one stated order, of ``+ - * /`` and
rounding down alone; all else is in integers. A stream holds all channels of a segment, so that each
can look at those before it, and needs no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

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
from mcz.codecs.lossless import copying
from mcz.codecs.lossless.best_streams import build_stream, parse_stream
from mcz.codecs.lossless.copying import Ints
from mcz.codecs.lossless.segments import MAX_ROWS, segment_frames
from mcz.codecs.segments import Sizing
from mcz.threads import in_force
from mcz.types import Params

SIZING = Sizing(60_500, 65_000, value_bytes=1.5, most_rows=MAX_ROWS, spare=1, full=True)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    return copying.encode_streams(source, params, SIZING, build_stream, in_force())


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("best", header, layout)  # BEST-01
    return copying.decode_streams(layout, spans, request, fetch, parse_stream)


def regroup(stream: bytes, layout: Layout, group: int, numbers: Mapping[int, int]) -> bytes:
    """``stream`` of ``group`` with its copies referring to the groups' new ``numbers``."""
    return stream[:1] + copying.regroup(stream[1:], layout, group, numbers)


CODEC = Codec(
    id=2,
    name="best",
    version=0,
    domain="ordinals",
    lossless=True,
    grouping="all",
    encode=encode,
    decode=decode,
    regroup=regroup,
    recode=partial(copying.recode_streams, build_stream),
    parameters=(segment_frames("57,000"),),
)
