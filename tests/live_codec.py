"""A codec for tests alone that works frame by frame, steps from the frame before; a slow stream.

A stream holds, for each of its frames, the zigzag varint of each channel's difference to the frame
before in steps; one of zeros alone is empty. Every so many frames one starts fresh.
"""

from __future__ import annotations

import io

import numpy as np

from mcz import FormatError, LostFrameError, OptionError
from mcz.codecs.contract import Codec, Encoded, LiveEncoder, Segment
from mcz.codecs.parameters import Parameter, integer, number
from mcz.files.live.generators import begin_live
from mcz.model.schema import read_varint, varint

ID = 252
HEADER = b"stairs"


def _pack_steps(steps):
    if not steps.any():
        return b""
    return b"".join(varint(2 * n if n >= 0 else -2 * n - 1) for n in steps.ravel().tolist())


def _unpack_steps(stream, n_frames, n_channels):
    if not stream:
        return np.zeros((n_frames, n_channels), np.int64)
    at, found = 0, []
    for _ in range(n_frames * n_channels):
        value, at = read_varint(stream, at)
        found.append(value // 2 if value % 2 == 0 else -(value + 1) // 2)
    if at != len(stream) or not any(found):
        raise FormatError(f"stairs: {len(stream)} bytes of steps")
    return np.array(found, np.int64).reshape(n_frames, n_channels)


class Encoder(LiveEncoder):
    models = ()
    version: int | None = None
    preset = 0
    header = HEADER

    def __init__(self, layout, options):
        self.every, self.step = options["every"], options["step"]
        self.last = np.zeros(layout.n_channels, np.int64)
        self.at = 0

    def push(self, values, valid=None):
        indices = np.rint(values / self.step).astype(np.int64)
        if valid is not None:
            indices = np.where(valid, indices, self.last)
        fresh = self.at % self.every == 0
        steps = indices if fresh else indices - self.last
        self.last = indices
        self.at += 1
        return _pack_steps(steps), fresh

    def change(self, options):
        raise OptionError("stairs: nothing changes")


class Decoder:
    def __init__(self, header, layout):
        if header != HEADER:
            raise FormatError(f"stairs: header {header!r}")
        self.last = None
        self.n_channels = layout.n_channels

    def push(self, stream, fresh):
        steps = _unpack_steps(stream, 1, self.n_channels)[0]
        if fresh:
            self.last = np.zeros(self.n_channels, np.int64)
        if self.last is None:
            raise LostFrameError("stairs: nothing fresh came")
        self.last = self.last + steps
        if (np.abs(self.last) > 2**50).any():
            raise FormatError("stairs: too high")
        return self.last / 8

    def skip(self, n_frames):
        self.last = None if n_frames else self.last


def encode(source, params):
    def segments():
        encoder = Encoder(source.layout, params)
        for frame in range(source.layout.n_frames):
            stream, fresh = encoder.push(source.values(frame, frame + 1)[0])
            yield Segment(frame, 1, (stream,), fresh=fresh)

    return Encoded(HEADER, segments())


def decode(header, layout, spans, request, fetch):
    decoder = Decoder(header, layout)
    out = np.zeros((request.stop - request.start, layout.n_channels if request.groups else 0))
    if not out.size:
        return out
    first = max(i for i, s in enumerate(spans) if s.fresh and s.first <= request.start)
    for index in range(first, len(spans)):
        span = spans[index]
        if span.first >= request.stop:
            break
        if span.n_frames != 1:
            raise FormatError("stairs: one frame a segment")
        values = decoder.push(fetch(index, 0, 0), span.fresh)
        if span.first >= request.start:
            out[span.first - request.start] = values
    return out


CODEC = Codec(
    id=ID,
    name="stairs",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    grouping="all",
    positions=True,
    live=Encoder,
    follow=Decoder,
    parameters=(
        Parameter("every", 10, "frames from one fresh one to the next", integer("every", 1, 10**9)),
        Parameter("step", 0.125, "a step", number("step", 0.125, 0.125)),
        Parameter("domain", "channels", "channels or positions", str),
    ),
)


def encode_live(*arguments):
    """The live clip of ``begin_live``, with all of its frames."""
    live = begin_live(*arguments)
    with live.writer:
        live.push_all()
    return live


class Trickle(io.RawIOBase):
    """A stream that gives a byte at a time and knows how many were taken."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        self.at += 1
        return self.data[self.at - 1 : self.at]

    read1 = read
