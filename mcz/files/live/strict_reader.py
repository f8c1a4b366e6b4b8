"""Reading a clip while it is being written, strictly.

SPEC.md, "Open DATA and packets", is normative. ``reader_with_losses.py`` continues after lost
frames.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.chunks import ChunkType, build_foot
from mcz.container.dictionary_deflate import chunk_id
from mcz.container.directory import SegmentRow
from mcz.container.grammar import ChunkEvent, PacketEvent
from mcz.container.parser_drivers import Stream
from mcz.container.reader import Container
from mcz.container.scanner import Scanner
from mcz.container.segments import FRESH
from mcz.container.source import ByteSource
from mcz.errors import FormatError, OptionError
from mcz.files.live.clip_state import ClipState, LiveClip, LiveFrame, Shared, begin_clip, opening
from mcz.files.live.reader_with_losses import StreamSummary
from mcz.files.reading.clip import Clip
from mcz.model.schema import parse
from mcz.model.types import Values

Frame = tuple[int, Values, NDArray[np.bool_]]
SHARED = (ChunkType.SKEL, ChunkType.MODL, ChunkType.SRCE)  # chunks that clips refer to


def live_frames(stream: BinaryIO) -> Iterator[Frame]:
    """The frames of the MCZ file in a binary stream, each as soon as its bytes are there.

    Yields the number of the frame in its clip, from 0, its values and their validity, both
    (n_channels,) of the motion signal, the values NaN where invalid. A clip whose codec does not
    decode frame by frame comes when it has ended. Raises FormatError at the first fault, after all
    frames before it: TruncatedError where the stream ends too early, ChecksumError where the frames
    of a clip differ from its hash. ``stream_decode`` can continue instead.
    """
    if not hasattr(stream, "read"):
        raise OptionError(f"cannot read from {stream!r}: not a binary stream")
    frames = StrictFrames(stream, StreamSummary()).frames()
    return ((frame.number, frame.values, frame.valid) for frame in frames)


class StrictFrames:
    """The frames of a stream; ``clip`` is the clip of the last one."""

    def __init__(self, stream: BinaryIO, summary: StreamSummary) -> None:
        self._stream, self.summary = Stream(stream), summary
        self.scanner = Scanner(None)
        self.clip: LiveClip | None = None
        self.is_checked = False  # a value hash was right

    @property
    def size(self) -> int:
        return self._stream.size

    def frames(self) -> Iterator[LiveFrame]:
        """As ``live_frames``."""
        head = b""
        shared: Shared = {}
        clip: ClipState | _WholeClip | None = None
        for event in self._stream.events(self.scanner.parser):
            self.scanner.take(event)
            if not isinstance(event, (ChunkEvent, PacketEvent)):
                continue
            kind = event.chunk.type
            if kind == ChunkType.HEAD:
                head = event.data
            elif kind in SHARED:
                shared.setdefault((kind, chunk_id(kind, event.payload)), event.data)
            elif kind == ChunkType.CLIP:
                row = self.scanner.clip
                assert row is not None
                fields = parse(payloads.Clip, event.payload, row.clip.label)
                before = opening(head, shared, fields)
                clip = begin_clip(head, shared, row, fields) or _WholeClip(
                    before + event.data, row.name
                )
            elif isinstance(clip, ClipState):
                if kind == ChunkType.CEND:
                    clip.check_hash(parse(payloads.Cend, event.payload, "CEND"))  # PACK-19
                    self.is_checked = True
                for segment in self.scanner.clip.segments if self.scanner.clip else ():
                    yield from self._frame(clip, segment, event.payload)
            elif clip is not None:
                yield from clip.take(self, kind, event)
            self.scanner.forget()
            clip = None if kind == ChunkType.CEND else clip
        self.summary.is_checked = self.is_checked

    def _frame(self, clip: ClipState, row: SegmentRow, payload: bytes) -> Iterator[LiveFrame]:
        if row.header.signal:
            return
        stream, mask = clip.parts(row.header, row.packet, payload)
        self.summary.payload_bytes += len(stream)
        frame = row.header.first
        fresh = bool(row.header.flags & FRESH)
        if not (frame or fresh):
            raise FormatError("the first segment needs one before it", clip=clip.clip.name)
        values = clip.decoder.push(stream, fresh)
        if clip.shown is not None:
            if frame not in clip.shown:
                return
            frame -= clip.shown.start
        clip.digest(values, mask)
        self.clip = clip.clip
        if mask is None:
            yield LiveFrame(frame, values, np.ones(values.shape, np.bool_))
        else:
            yield LiveFrame(frame, np.where(mask, values, np.nan), mask)


class _WholeClip:
    def __init__(self, data: bytes, name: str) -> None:
        self._parts, self._name = [data], name

    def take(
        self, reader: StrictFrames, kind: bytes, event: ChunkEvent | PacketEvent
    ) -> Iterator[LiveFrame]:
        self._parts.append(event.data)
        if kind != ChunkType.CEND:
            return
        data = b"".join(self._parts) + build_foot(0, 0)
        container = Container(ByteSource(io.BytesIO(data)), verify=True)
        clip = Clip(container, container.directory.clips[self._name])
        values, mask = clip.read_masked()
        reader.clip = LiveClip(clip.name, clip.skeleton, clip.frame_rate, clip.codec)
        reader.summary.payload_bytes += sum(row.size for row in clip.signals[0].rows)
        reader.is_checked = True
        per_frame = clip.signals[0].layout.samples_per_frame
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        if not valid.all():
            values = np.where(valid, values, np.nan)
        for frame in range(clip.n_frames):
            rows = frame if per_frame == 1 else slice(frame * per_frame, (frame + 1) * per_frame)
            yield LiveFrame(frame, values[rows], valid[rows])
