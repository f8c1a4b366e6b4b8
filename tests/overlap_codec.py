"""A codec for tests alone: overlapping support and two resolutions prove the contract.

Even rows of a segment are stored as they are (resolution 1); an odd row is stored as its
difference to the mean of its neighbors, the right one of which may lie in the next segment.
So a segment bears upon one frame before its own (the odd row at the end of the segment before).
"""

from __future__ import annotations

import numpy as np

from mcz import FormatError
from mcz.codecs.contract import Codec, Encoded, Segment
from mcz.codecs.parameters import Parameter, integer

ID = 251


def encode(source, params):
    return Encoded(b"overlap", _segments(source, params["length"]), n_resolutions=2)


def _segments(source, length):
    n = source.layout.n_frames
    for first in range(0, n, length):
        count = min(length, n - first)
        values = source.values(first, min(n, first + count + 1))
        streams = [_coarse(values[:count:2, list(g)]) for g in source.layout.groups]
        streams += [_detail(values[:, list(g)], count) for g in source.layout.groups]
        yield Segment(first, count, tuple(streams), lead=min(1, first))


def _coarse(even):
    return even.astype("<f8").tobytes()


def _detail(values, count):
    out = []
    for row in range(1, count, 2):
        left, right = values[row - 1], values[min(row + 1, len(values) - 1)]
        if row + 1 >= len(values):
            right = left
        out.append(values[row] - (left + right) / 2)
    return np.array(out, "<f8").tobytes()


def decode(header, layout, spans, request, fetch):
    if header != b"overlap":
        raise FormatError(f"overlap: header {header!r}")
    n_columns = sum(len(layout.groups[g]) for g in request.groups)
    out = np.zeros((request.stop - request.start, n_columns))
    for index, span in enumerate(spans):
        if span.first >= request.stop or span.stop <= request.start:
            continue
        column = 0
        for group in request.groups:
            width = len(layout.groups[group])
            coarse = layout.n_resolutions - request.resolution == 1  # details not wanted, or cut
            rows = _rows(index, span, spans, group, width, coarse, fetch)
            for frame in range(max(span.first, request.start), min(span.stop, request.stop)):
                place = slice(column, column + width)
                out[frame - request.start, place] = rows[frame - span.first]
            column += width
    return out


def _rows(index, span, spans, group, width, coarse, fetch):
    even = _floats(fetch(index, 0, group), (span.n_frames + 1) // 2, width)
    after = even[-1]
    if span.n_frames % 2 == 0 and index + 1 < len(spans) and spans[index + 1].lead:
        after = _floats(fetch(index + 1, 0, group), (spans[index + 1].n_frames + 1) // 2, width)[0]
    right = np.concatenate([even[1:], after[None]])
    odd = (even + right)[: span.n_frames // 2] / 2
    if not coarse:
        odd = odd + _floats(fetch(index, 1, group), span.n_frames // 2, width)
    rows = np.empty((span.n_frames, width))
    rows[0::2], rows[1::2] = even, odd
    return rows


def _floats(stream, n_rows, width):
    if len(stream) != n_rows * width * 8:
        raise FormatError(f"overlap: a stream of {len(stream)} bytes")
    return np.frombuffer(stream, "<f8").reshape(n_rows, width)


CODEC = Codec(
    id=ID,
    name="overlap",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    parameters=(Parameter("length", 10, "frames a segment", integer("length", 2, 2**20)),),
)
