"""A live clip in its reader: its head, its decoder, its frames and their hash; strict reading.

``reader_with_losses.py`` continues after lost frames. SPEC.md, "Open DATA and packets", is
normative.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_id
from mcz.codecs.contract import LiveDecoder
from mcz.codecs.known_answers import check_known_answer
from mcz.container import payloads
from mcz.container.chunks import FRAME, SHARED, SIGNATURE, Chunk, ChunkType, build_foot
from mcz.container.directory import ClipRow, SegmentRow
from mcz.container.encodings import chunk_id
from mcz.container.grammar import ChunkEvent, PacketEvent
from mcz.container.model_records import ValueDigest
from mcz.container.parser_drivers import Stream
from mcz.container.reader import Container
from mcz.container.scanner import Scanner
from mcz.container.segments import (
    FRESH,
    MASKS,
    SegmentHeader,
    frame_table,
    parse_mask,
    parse_stream_table,
)
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError, TruncatedError, UnsupportedError
from mcz.files.reading.clip import Clip
from mcz.files.reading.signal_info import SignalInfo, check_roles, read_signal
from mcz.model.motion import Skeleton
from mcz.model.schema import parse
from mcz.model.text_format import fields_text
from mcz.model.types import Floats, Values

Mask = NDArray[np.bool_]
State = Literal["decoded", "concealed", "missing"]
Lost = Literal["refuse", "missing", "hold", "linear"]
LOST = ("refuse", "missing", "hold", "linear")


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """A frame of a clip, from 0: its values and their validity, both (n_channels,).

    ``values`` are NaN where invalid. ``state``: they come from the file (``decoded``), are a
    substitute for a frame that is lost or could not be decoded (``concealed``), or are unknown
    (``missing``).
    """

    number: int
    values: Values
    valid: Mask
    state: State = "decoded"

    __repr__ = fields_text


Shared = dict[tuple[bytes, bytes], bytes]  # kind and id -> chunk


@dataclass(frozen=True, slots=True)
class LiveClip:
    """Head of a clip that is being read; ``frame_rate`` None: unknown."""

    name: str
    skeleton: Skeleton
    frame_rate: Fraction | None
    codec: str


def needed_chunks(fields: payloads.Clip) -> Iterator[tuple[bytes, bytes]]:
    """Kind and id of the chunks that a clip with these ``fields`` cannot be read without."""
    yield ChunkType.SKEL, bytes(fields.skeleton)
    if fields.source is not None:
        yield ChunkType.SRCE, fields.source.template
    for signal in fields.signals:
        with suppress(FormatError):  # reported when the signal is read
            uses = codec_by_id(signal.codec, signal.codec_version, signal.preset).uses
            for id_ in () if uses is None else uses(bytes(signal.header)):
                yield ChunkType.MODL, id_


def row_of(fields: payloads.Clip, chunk: Chunk) -> ClipRow:
    """A clip from its CLIP alone; raises FormatError."""
    if not fields.name or not fields.signals:
        raise FormatError("a clip must have a name and a signal", where=f"chunk {chunk.label}")
    check_roles(fields.signals, f"chunk {chunk.label}")
    return ClipRow.of(fields, chunk)


def begin_clip(
    head: bytes, shared: Shared, row: ClipRow, fields: payloads.Clip
) -> ClipState | None:
    """Return a decoder for a new clip; None for a codec that needs all frames.

    ``head`` is HEAD, ``shared`` the chunks before the clip. Raises FormatError for a missing one.
    """
    container = Container(
        ByteSource(io.BytesIO(opening_bytes(head, shared, fields) + build_foot(0, 0)))
    )
    skeleton = container.skeleton(row.skeleton)
    rate = Fraction(row.rate_numerator, row.rate_denominator) if row.rate_numerator else None
    motion = fields.signals[0]
    visible = range(motion.skip, motion.skip + fields.n_frames)
    motion.skip = motion.spare = 0
    nothing = replace(row, n_frames=0, segments=[])  # its later parts are unknown
    info = read_signal(container, nothing, fields, 0, skeleton, rate)
    one = (info.counts.n_groups, info.counts.n_resolutions, info.layout.samples_per_frame)
    if info.codec.follow is None or one != (1, 1, 1):
        return None
    is_open = bool(fields.flags & payloads.OPEN_CLIP)
    clip = LiveClip(row.name, skeleton, rate, info.codec.name)
    return ClipState(clip, info, None if is_open else visible, len(fields.signals))


def opening_bytes(head: bytes, shared: Shared, fields: payloads.Clip) -> bytes:
    """A file up to the clip with these ``fields``: only the chunks that it needs."""
    needed = [shared[key] for key in needed_chunks(fields) if key in shared]
    return b"".join([SIGNATURE, head, *needed])


class ClipState:
    """A clip that is decoded frame by frame.

    ``shown`` are the stored frames that the clip shows, None for all.
    """

    def __init__(
        self, clip: LiveClip, info: SignalInfo, visible: range | None, n_signals: int
    ) -> None:
        assert info.codec.follow is not None
        self.clip, self.info, self.shown, self.n_signals = clip, info, visible, n_signals
        self._where = f"clip {clip.name!r}"
        check_known_answer(info.codec)
        self.decoder: LiveDecoder = info.codec.follow(info.header, info.layout)
        self._digest = ValueDigest()
        self._mask: NDArray[np.bool_] | None = None  # that packets of kind 2 imply

    def parts(
        self, header: SegmentHeader, packet: int, payload: bytes
    ) -> tuple[bytes, NDArray[np.bool_] | None]:
        """The codec's stream of a segment of one frame, and its mask, (n_channels,).

        ``packet`` is the kind of its packet, 0 for a closed DATA. Raises FormatError,
        UnsupportedError for a segment of several frames.
        """
        if packet == FRAME:
            frame_table(header, self.info.counts, len(payload), 0)
            return payload, self._mask
        where = f"{self._where}, frame {header.first}"
        if header.n_frames != 1 or header.flags & ~(FRESH | MASKS):
            raise UnsupportedError(
                f"a segment of {header.n_frames} frames with flags {header.flags} cannot be "
                "read live; read the whole file",
                where=self._where,
            )
        try:
            table = parse_stream_table(payload, self.info.counts)
        except TruncatedError as error:
            raise FormatError(str(error), where=where) from None
        if table.payload_size != len(payload):
            raise FormatError(
                f"the sizes of the streams do not add up to {len(payload)} bytes", where=where
            )
        streams = [
            payload[at : at + size] for at, size in zip(table.offsets, table.lengths, strict=True)
        ]
        number = table.mask(0)
        mask = self._mask = None
        if number is not None and streams[number]:
            n_channels = self.info.layout.n_channels
            mask = self._mask = parse_mask(streams[number], 1, n_channels, self._where)[0]
        return streams[table.codec(0, 0)], mask

    def digest(self, values: Floats, mask: NDArray[np.bool_] | None) -> None:
        self._digest.update(values[None], None if mask is None else mask[None])

    def check_hash(self, fields: payloads.Cend) -> None:
        """Compare the hash of all frames with that of CEND; raises ChecksumError."""
        hashes = fields.value_sha256
        if len(hashes) != self.n_signals:
            raise FormatError(
                f"{len(hashes)} hashes for {self.n_signals} signals", where=self._where
            )
        if self._digest.digest() != hashes[0]:
            raise ChecksumError("its frames differ from the hash in CEND", where=self._where)


MOST_REMARKS = 20


@dataclass(slots=True)
class StreamSummary:
    """Result of a stream, in frames and bytes.

    ``skipped`` frames did not come and were too many to conceal. ``payload_bytes`` are those of the
    codec's streams, the others of ``stream_bytes`` frame them. ``is_cut``: the stream ended before
    its file did. ``is_checked``: the value hash of each clip was right; it cannot be compared where
    frames are missing. ``remarks`` describe the first of ``n_faults`` faults.
    """

    decoded: int = 0
    concealed: int = 0
    missing: int = 0
    skipped: int = 0
    payload_bytes: int = 0
    stream_bytes: int = 0
    is_cut: bool = False
    is_checked: bool = False
    n_faults: int = 0
    remarks: list[str] = field(default_factory=list)

    __repr__ = fields_text

    def count(self, frame: LiveFrame) -> None:
        setattr(self, frame.state, getattr(self, frame.state) + 1)

    def fault(self, text: str) -> None:
        self.n_faults += 1
        if len(self.remarks) < MOST_REMARKS:
            self.remarks.append(text)


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
        """Yield the frames, as ``live_frames`` does."""
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
                before = opening_bytes(head, shared, fields)
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
            raise FormatError("the first segment depends on an earlier one", clip=clip.clip.name)
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
