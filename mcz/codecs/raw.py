"""Codec 0, ``raw``: grid ordinals in as few whole bytes as they need.

SPEC.md, "Codec 0: raw", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only. A stream holds one group of one segment:
for each of its channels the least ordinal, the width, and one offset a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

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
from mcz.codecs.segments import Sizing, gather, lossless_segment_frames, segments_by_guess
from mcz.errors import FormatError
from mcz.model.types import Ints, Params

MAX_ROWS = 2**20
SIZING = Sizing(target=58_000, most=62_000, value_bytes=4, most_rows=MAX_ROWS)

HEAD_SIZE = 9


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the ordinals of ``source``; ``segment_frames`` 0 chooses lengths by size."""

    def prepare(first: int, stop: int) -> Callable[[], tuple[bytes, ...]]:
        ordinals = source.ordinals(first, stop)
        return lambda: tuple(
            _build_stream(ordinals[:, list(group)]) for group in source.layout.groups
        )

    return Encoded(b"", segments_by_guess(source, params["segment_frames"], SIZING, prepare))


def _build_stream(ordinals: Ints) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels)."""
    parts = []
    for column in ordinals.T:
        least = column.min()
        offsets = np.ascontiguousarray(column).view(np.uint64) - least.view(np.uint64)
        width = (int(offsets.max()).bit_length() + 7) // 8
        packed = offsets.astype("<u8").view("u1").reshape(-1, 8)[:, :width]
        parts += [least.astype("<i8").tobytes(), bytes((width,)), packed.tobytes()]
    return b"".join(parts)


def recode(request: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
    """The streams of some groups with new values."""
    groups = [list(request.source.layout.groups[group]) for group in request.groups]
    for span in request.spans:
        ordinals = request.source.ordinals(span.first, span.stop)
        yield tuple(_build_stream(ordinals[:, columns]) for columns in groups)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("raw", header, layout)

    def rows(index: int, group: int) -> Ints:
        n_rows = spans[index].n_frames * layout.samples_per_frame
        return _parse(fetch(index, 0, group), n_rows, len(layout.groups[group]))

    return gather(layout, spans, request, rows)


def _parse(stream: bytes, n_rows: int, n_channels: int) -> Ints:
    columns, at = [], 0
    for channel in range(n_channels):
        head = stream[at : at + HEAD_SIZE]
        if len(head) < HEAD_SIZE:
            raise FormatError(f"raw: the stream is truncated in the head of channel {channel}")
        least, width = int.from_bytes(head[:8], "little"), head[8]
        at += HEAD_SIZE
        if width > 8:  # RAW-02
            raise FormatError(f"raw: channel {channel} cannot have offsets of {width} bytes")
        size = width * n_rows
        if at + size > len(stream):
            raise FormatError(
                f"raw: channel {channel} needs {size} bytes, {len(stream) - at} are left"
            )
        offsets = np.zeros((n_rows, 8), "u1")
        offsets[:, :width] = np.frombuffer(stream, "u1", size, at).reshape(n_rows, width)
        columns.append((offsets.view("<u8")[:, 0] + np.uint64(least)).view(np.int64))  # RAW-03
        at += size
    if at != len(stream):  # RAW-04
        raise FormatError(f"raw: {len(stream) - at} bytes follow the last channel")
    return np.stack(columns, axis=1) if columns else np.empty((n_rows, 0), np.int64)


CODEC = Codec(
    id=0,
    name="raw",
    version=0,
    domain="ordinals",
    lossless=True,
    hash_optional=True,
    encode=encode,
    decode=decode,
    recode=recode,
    parameters=(lossless_segment_frames("60,000", MAX_ROWS),),
)
