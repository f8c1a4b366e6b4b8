"""Codec 0, ``raw``: grid ordinals in as few whole bytes as they need.

SPEC.md, "Codec 0: raw", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only. A stream holds one group of one segment:
for each of its channels the least ordinal, the width, and one offset a row.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from mcz.errors import FormatError

TARGET_BYTES = 60_000  # of a segment: under the 64 KiB that DATA should have, table included
MAX_ROWS = 2**20

# Each channel of a stream, as SPEC.md's table has it: (name, type, meaning).
RAW_FIELDS = (
    ("least", "8 bytes", "least ordinal, two's complement: low u32, then high u32"),
    ("width", "u8", "bytes of each offset, 0 to 8"),
    ("offsets", "width bytes each", "ordinal - least of every row, modulo 2^64"),
)
HEAD_SIZE = 9


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    return Encoded(header=b"", segments=_segments(source, params["segment_frames"]))


def _segments(source: SignalSource, fixed: int) -> Iterator[Segment]:
    layout = source.layout
    ends = sorted({*source.breaks, layout.n_frames})
    guess = fixed or max(
        1, TARGET_BYTES // (4 * layout.samples_per_frame * max(1, layout.n_channels))
    )
    most = min(layout.most_frames, max(1, MAX_ROWS // layout.samples_per_frame))
    first = 0
    while first < layout.n_frames:
        end = next(e for e in ends if e > first)
        n_frames = min(guess, end - first, most)
        ordinals = source.ordinals(first, first + n_frames)
        streams = tuple(_build(ordinals[:, list(group)]) for group in layout.groups)
        size = sum(map(len, streams))
        if size > TARGET_BYTES and n_frames > 1 and not fixed:
            guess = max(1, n_frames * TARGET_BYTES * 97 // (size * 100))
            continue
        yield Segment(first, n_frames, streams)
        first += n_frames
        if not fixed and size:
            guess = max(1, min(4 * n_frames, n_frames * TARGET_BYTES * 97 // (size * 100)))


def _build(ordinals: NDArray[np.int64]) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels)."""
    parts = []
    for column in ordinals.T:
        least = column.min()
        offsets = np.ascontiguousarray(column).view(np.uint64) - least.view(np.uint64)
        width = (int(offsets.max()).bit_length() + 7) // 8
        packed = offsets.astype("<u8").view("u1").reshape(-1, 8)[:, :width]
        parts += [least.astype("<i8").tobytes(), bytes((width,)), packed.tobytes()]
    return b"".join(parts)


def recode(
    header: bytes,
    source: SignalSource,
    groups: tuple[int, ...],
    spans: Sequence[Span],
    options: Mapping[str, Any],
    fetch: Fetch,
) -> Iterator[tuple[bytes, ...]]:
    """The streams of some groups with new values."""
    for span in spans:
        ordinals = source.ordinals(span.first, span.stop)
        yield tuple(_build(ordinals[:, list(source.layout.groups[group])]) for group in groups)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> NDArray[np.int64]:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("raw", header, layout)

    def rows(index: int, group: int) -> NDArray[np.int64]:
        n_rows = spans[index].n_frames * layout.samples_per_frame
        return _parse(fetch(index, 0, group), n_rows, len(layout.groups[group]))

    return gather(layout, spans, request, rows)


def _parse(stream: bytes, n_rows: int, n_channels: int) -> NDArray[np.int64]:
    """The ordinals of one stream, (n_rows, n_channels)."""
    columns, at = [], 0
    for channel in range(n_channels):
        head = stream[at : at + HEAD_SIZE]
        if len(head) < HEAD_SIZE:
            raise FormatError(f"raw: the stream ends in the head of channel {channel}")
        least, width = int.from_bytes(head[:8], "little"), head[8]
        at += HEAD_SIZE
        if width > 8:
            raise FormatError(f"raw: channel {channel} has offsets of {width} bytes")
        size = width * n_rows
        if at + size > len(stream):
            raise FormatError(
                f"raw: channel {channel} needs {size} bytes, {len(stream) - at} are left"
            )
        offsets = np.zeros((n_rows, 8), "u1")
        offsets[:, :width] = np.frombuffer(stream, "u1", size, at).reshape(n_rows, width)
        columns.append((offsets.view("<u8")[:, 0] + np.uint64(least)).view(np.int64))
        at += size
    if at != len(stream):
        raise FormatError(f"raw: {len(stream) - at} bytes follow the last channel")
    return np.stack(columns, axis=1) if columns else np.empty((n_rows, 0), np.int64)


CODEC = Codec(
    id=0,
    name="raw",
    version=0,
    domain="ordinals",
    lossless=True,
    encode=encode,
    decode=decode,
    recode=recode,
    parameters=(
        Parameter(
            "segment_frames",
            0,
            "frames a segment; 0: as many as make about 60,000 bytes",
            integer("segment_frames", 0, MAX_ROWS),
        ),
    ),
)
