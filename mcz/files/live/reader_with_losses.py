"""Reading a live stream with losses: received frames are decoded, missing ones reported.

SPEC.md, "Live streams with losses", is normative.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.encodings import chunk_id
from mcz.container.grammar import ChunkEvent, Fault, FootEvent, PacketEvent
from mcz.container.limits import BASE, check
from mcz.container.model_records import parse_head
from mcz.container.parser_drivers import Stream, TolerantParser, repeated_chunks
from mcz.container.segments import FRESH, SegmentHeader, parse_segment_header
from mcz.errors import (
    ChecksumError,
    FormatError,
    LimitError,
    LostFrameError,
    TruncatedError,
    UnsupportedError,
)
from mcz.files.live.clip_state import (
    ClipState,
    Concealer,
    LiveClip,
    LiveFrame,
    Lost,
    Shared,
    begin_clip,
    row_of,
)
from mcz.model.schema import MAX_COUNT, parse
from mcz.model.text_format import fields_text

MOST_MADE_UP = 65_536  # frames in place of lost ones, and one more for every received byte
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


class FramesWithLosses:
    """The frames of a stream with losses; ``clip`` is the clip of the last one."""

    def __init__(self, stream: BinaryIO, lost: Lost, join: bool, summary: StreamSummary) -> None:
        self._stream, self._parser = Stream(stream), TolerantParser()
        self._lost, self._summary = lost, summary
        self._joining = join  # until a frame with a known number has come
        self._head, self._shared = b"", Shared()
        self._course: _ClipCourse | None = None
        self._least: int | None = None  # no frame of the open DATA comes before
        self._made_up = 0
        self._all_checked: bool | None = None
        self.clip: LiveClip | None = None

    @property
    def size(self) -> int:
        return self._stream.size

    def frames(self) -> Iterator[LiveFrame]:
        """All frames with a known place; raises FormatError where reading cannot continue."""
        is_cut, cuts = True, list[Fault]()  # not faults if nothing follows
        for event in self._stream.events(self._parser):
            if isinstance(event, Fault) and isinstance(event.error, TruncatedError):
                if self._lost == "refuse":
                    raise event.error
                cuts.append(event)
                continue
            is_cut = not isinstance(event, FootEvent)  # LIVE-11
            while cuts:
                self._note(cuts.pop())
            parsed = event.event if isinstance(event, Fault) else event
            if isinstance(event, Fault):
                self._note(event)
            elif isinstance(event, PacketEvent):
                yield from self._packet(event)
            if isinstance(parsed, ChunkEvent):
                yield from self._chunk(parsed)
            elif isinstance(parsed, FootEvent):
                yield from self._leave("the file ended")
        yield from self._leave("the stream ended")
        self._summary.is_cut = is_cut
        self._summary.is_checked = bool(self._all_checked)

    def _note(self, fault: Fault) -> None:
        """Note a damaged or wrong chunk; a chunk at a wrong place is no fault."""
        if isinstance(fault.error, UnsupportedError) or self._parser.is_done:
            raise fault.error
        if not fault.state:
            self._fault(f"at {fault.offset}: {fault.error}")

    def _fault(self, text: str) -> None:
        if self._joining:  # losses before the place of joining do not count
            return
        self._summary.fault(text)
        if self._lost == "refuse":
            raise FormatError(text)

    def _spend(self, count: int) -> bool:
        """Return True if so many frames may be concealed; else note the limit."""
        if self._made_up + count <= MOST_MADE_UP + self.size:
            self._made_up += count
            return True
        self._summary.skipped += count
        self._fault(f"{count} frames did not come, too many to show something in their place")
        return False

    def _chunk(self, event: ChunkEvent) -> Iterator[LiveFrame]:
        kind = event.chunk.type
        if kind == ChunkType.HEAD:
            self._parser.profile = parse_head(event.payload)
            self._head = event.data
        elif kind in (ChunkType.SKEL, ChunkType.MODL):
            self._shared.setdefault((kind, chunk_id(kind, event.payload)), event.data)
            kept = sum(map(len, self._shared.values()))
            check(
                "SKEL and MODL: bytes",
                kept,
                2 * max(self._parser.profile.model_bytes, BASE.model_bytes),
            )
        elif kind == ChunkType.CLIP:
            yield from self._begin(event)
        elif kind == ChunkType.REPT:  # REPT-04
            yield from self._repeat(event)
        elif kind == ChunkType.DATA and event.chunk.length is None:
            is_single = self._parser.n_signals == 1
            self._least = self._course.frames.due if self._course and is_single else None
        elif kind == ChunkType.DATA and self._course is not None:
            yield from self._segment(self._course, event.payload)
        elif kind == ChunkType.CEND:
            yield from self._close(event)

    def _repeat(self, event: ChunkEvent) -> Iterator[LiveFrame]:
        try:
            events = repeated_chunks(event.payload, 0)
        except FormatError as error:
            self._fault(str(error))
            return
        for inner in events:
            yield from self._chunk(inner)

    def _begin(self, event: ChunkEvent) -> Iterator[LiveFrame]:
        """Begin a clip, unless it is the open one repeated."""
        if self._course is not None and self._course.opening == event.data:
            return
        yield from self._leave("another clip began")
        try:
            fields = parse(payloads.Clip, event.payload, "CLIP")
            followed = begin_clip(self._head, self._shared, row_of(fields, event.chunk), fields)
        except (UnsupportedError, LimitError):
            raise
        except FormatError as error:
            self._fault(f"a clip that cannot be read: {error}")
            return
        if followed is None:
            raise UnsupportedError(
                f"clip {fields.name!r} cannot be read with losses, because its codec needs "
                "all frames"
            )
        counts = followed.info.layout.n_channels, self._lost, followed.shown, self._spend
        self._course = _ClipCourse(followed, event.data, Concealer(*counts, join=self._joining))
        self.clip, self._parser.n_signals = followed.clip, followed.n_signals

    def _close(self, event: ChunkEvent) -> Iterator[LiveFrame]:
        course, self._course = self._course, None
        if course is None:
            return
        try:
            fields = parse(payloads.Cend, event.payload, "CEND")
        except FormatError as error:
            self._course = course
            self._fault(str(error))
            return
        shown, frames = course.followed.shown, course.frames
        stop = fields.n_frames + (0 if shown is None else shown.start)
        if frames.due is not None:
            yield from frames.reach(stop)
        yield from frames.end()
        if frames.is_whole and frames.due == stop:
            course.followed.check_hash(fields)  # LIVE-09
            self._all_checked = self._all_checked is not False
        elif frames.is_whole:
            raise ChecksumError(
                f"clip {course.followed.clip.name!r} was closed with {fields.n_frames} "
                "frames, but another number arrived"
            )
        else:
            self._all_checked = False

    def _leave(self, why: str) -> Iterator[LiveFrame]:
        """Give up the open clip, whose end did not come."""
        course, self._course = self._course, None
        if course is not None:
            yield from course.frames.end()
            self._all_checked = False  # LIVE-10
            self._fault(f"clip {course.followed.clip.name!r} has no end: {why}")

    def _packet(self, event: PacketEvent) -> Iterator[LiveFrame]:
        course, packet, header = self._course, event.packet, event.header
        if course is None:
            return
        if header is not None:
            if header.first >= MAX_COUNT:
                self._fault(f"packet {packet.sequence}: frame {header.first}")
            elif header.signal == 0:
                yield from self._frame(course, header, packet.kind, packet.body)  # PACK-12
            return
        due = self._parser.frame_due
        if due is None and self._least is not None:
            due = self._least + packet.sequence
        if due is not None:
            yield from course.frames.reach(min(due, MAX_COUNT))

    def _segment(self, course: _ClipCourse, payload: bytes) -> Iterator[LiveFrame]:
        try:
            header, _ = parse_segment_header(payload)
        except FormatError as error:
            self._fault(str(error))
            return
        if header.signal == 0:
            yield from self._frame(course, header, 0, payload)

    def _frame(
        self, course: _ClipCourse, header: SegmentHeader, kind: int, payload: bytes
    ) -> Iterator[LiveFrame]:
        number, frames = header.first, course.frames
        self._joining = False
        values: NDArray[np.float64] | None = None
        try:
            stream, mask = course.followed.parts(header, kind, payload)
            self._summary.payload_bytes += len(stream)
            values = course.decode(number, stream, bool(header.flags & FRESH))
        except UnsupportedError:
            raise
        except FormatError as error:
            if not isinstance(error, LostFrameError) or self._lost == "refuse":
                self._fault(f"frame {number}: {error}")
        if values is None:
            for due in (number, number + 1):  # the first known frame counts too
                yield from frames.reach(due)
            return
        for frame in frames.give(number, values, mask):
            if frame.state == "decoded" and frames.is_whole:
                course.followed.digest(values, mask)
            yield frame


@dataclass(slots=True)
class _ClipCourse:
    """A clip that has begun: its decoder, and the order of its frames."""

    followed: ClipState
    opening: bytes  # its CLIP
    frames: Concealer
    at: int = 0  # the frame that the decoder expects

    def decode(self, number: int, stream: bytes, fresh: bool) -> NDArray[np.float64]:
        """The values of a frame; raises FormatError, and counts it as lost then."""
        if number < self.at and not fresh:
            raise LostFrameError(f"frame {number} arrived after frame {self.at - 1}")
        if number > self.at:
            self.followed.decoder.skip(number - self.at)
        self.at = number + 1
        return self.followed.decoder.push(stream, fresh)
