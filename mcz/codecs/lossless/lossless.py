"""Codec 128, ``lossless``: predicted ordinals, entropy coded with mixed adaptive contexts.

SPEC.md, "Codec 128: lossless", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only, coder state in u32, products below 2^53 but for
ordinals themselves. A stream holds one group of one segment and needs no other, but for channels
that are copies of another group's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

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
from mcz.codecs.lossless.copying import decode_streams, encode_streams, recode_streams, regroup
from mcz.codecs.lossless.segments import MAX_ROWS, segment_frames
from mcz.codecs.segments import Sizing
from mcz.coding.forms.count_search import find_counts
from mcz.coding.forms.lattice import has_binary32
from mcz.coding.forms.multiples import find_multiples
from mcz.coding.forms.products import is_tiny
from mcz.coding.ordinals.streams import build_stream, parse_stream
from mcz.numbers import GridKind
from mcz.types import Params

Ints = NDArray[np.int64]

FIRST_FRAMES = 64  # that decide on version 1 for form 33
PLACES, TRIED_ROWS, TRIED_CHANNELS = 3, 512, 24  # that decide on it for form 34
SIZING = Sizing(57_000, 64_000, value_bytes=2, most_rows=MAX_ROWS, spare=1)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    version = _least_version(source)
    encoded = encode_streams(source, params, SIZING, partial(build_stream, version=version))
    return replace(encoded, version=version)


def _least_version(source: SignalSource) -> int:
    """1 where some rows have a channel that its forms may help, else 0."""
    return int(_has_noise(source) or _has_counts(source))


def _has_noise(source: SignalSource) -> bool:
    """Whether the first rows have a channel that form 33 may help."""
    layout = source.layout
    if not any(grid.kind == GridKind.GENERAL for grid in layout.grids):
        return False
    columns = source.ordinals(0, min(FIRST_FRAMES, layout.n_frames)).T
    pairs = zip(columns, layout.grids, strict=True)
    return any(column.size > 0 and is_tiny(column, grid) for column, grid in pairs)


def _has_counts(source: SignalSource) -> bool:
    """Whether form 34 helps one of some channels in one of some runs of rows."""
    layout = source.layout
    known = [c for c, grid in enumerate(layout.grids) if has_binary32(grid)]
    tried = known[:: -(-len(known) // TRIED_CHANNELS)] if known else []
    length = min(layout.n_frames, -(-TRIED_ROWS // layout.samples_per_frame))
    if not tried or not length:
        return False
    places = {(layout.n_frames - length) * place // (PLACES - 1) for place in range(PLACES)}
    runs = (source.ordinals(first, first + length) for first in sorted(places))
    return any(find_counts(run[:, c], find_multiples(run[:, c])) for run in runs for c in tried)


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
    parse = partial(parse_stream, version=version)
    return decode_streams(layout, spans, request, fetch, parse)


CODEC = Codec(
    id=128,
    name="lossless",
    version=1,
    earlier={0: partial(decode, version=0)},
    domain="ordinals",
    lossless=True,
    hash_optional=True,
    encode=encode,
    decode=decode,
    regroup=regroup,
    recode=partial(recode_streams, build_stream),
    parameters=(segment_frames("57,000"),),
)
