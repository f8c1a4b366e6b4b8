"""Reading a live stream with losses: received frames are decoded, missing ones reported.

SPEC.md, "Live streams with losses", is normative; the substitute of a lost frame is a reader's
choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
    LiveClip,
    LiveFrame,
    Lost,
    Mask,
    Shared,
    StreamSummary,
    begin_clip,
    row_of,
)
from mcz.model.schema import MAX_COUNT, parse
from mcz.model.types import Floats

MOST_MADE_UP = 65_536  # frames in place of lost ones, and one more for every received byte


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
        """All frames with a known place; raises FormatError if reading cannot continue."""
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
                yield from self._abandon_clip("the file ended")
        yield from self._abandon_clip("the stream ended")
        self._summary.is_cut = is_cut
        self._summary.is_checked = bool(self._all_checked)

    def _note(self, fault: Fault) -> None:
        """Record a damaged or wrong chunk; a chunk at a wrong place is no fault."""
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
            n_kept = sum(map(len, self._shared.values()))
            check(
                "SKEL and MODL: bytes",
                n_kept,
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
        yield from self._abandon_clip("another clip began")
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
        visible, frames = course.followed.shown, course.frames
        stop = fields.n_frames + (0 if visible is None else visible.start)
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

    def _abandon_clip(self, why: str) -> Iterator[LiveFrame]:
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
        frame = self._parser.frame_due
        if frame is None and self._least is not None:
            frame = self._least + packet.sequence
        if frame is not None:
            yield from course.frames.reach(min(frame, MAX_COUNT))

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


class Concealer:
    """Puts frames in order; ``lost`` chooses the substitutes for missing ones.

    ``shown`` are the stored frames that the clip shows, None for all; input counts stored frames,
    output the shown ones. ``due`` is the next stored frame, None if unknown. ``spend`` decides
    whether a number of frames may be concealed.
    """

    def __init__(
        self,
        n_channels: int,
        lost: Lost,
        visible: range | None,
        spend: Callable[[int], bool],
        *,
        join: bool = False,
    ) -> None:
        self._first = 0 if visible is None else visible.start
        self._stop = None if visible is None else visible.stop
        self.due: int | None = None if join else self._first
        self._lost, self._spend = lost, spend
        self._nothing = np.full(n_channels, np.nan), np.zeros(n_channels, np.bool_)
        self._last: tuple[Floats, Mask] | None = None
        self._owed = 0  # frames before the one due that wait for the next decoded one
        self.is_whole = not join  # every shown frame up to now was decoded

    def give(self, number: int, values: Floats, mask: Mask | None) -> Iterator[LiveFrame]:
        """Add a decoded frame; earlier ones that are due were not decoded."""
        yield from self.reach(number)
        assert self.due is not None
        if number < self.due or (self._stop is not None and number >= self._stop):
            return
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        row = values if mask is None else np.where(valid, values, np.nan)
        if self._owed:
            yield from self._interpolate(row, valid)
        self.due, self._last = number + 1, (row, valid)
        yield LiveFrame(number - self._first, row, valid)  # LIVE-02

    def reach(self, number: int) -> Iterator[LiveFrame]:
        """Conceal or report all missing frames before ``number``."""
        if self.due is None:
            self.due = max(self._first, number)
            self.is_whole = self.due == self._first
        if self._stop is not None:
            number = min(number, self._stop)
        count = number - self.due
        if count <= 0:
            return
        self.is_whole = False
        if self._lost == "refuse":
            raise LostFrameError(f"frame {self.due - self._first} did not arrive")
        if not self._spend(count):  # LIVE-12
            yield from self.end()
            self.due = number
        elif self._lost == "linear" and self._last is not None:
            self.due += count
            self._owed += count
        else:
            for _ in range(count):
                self.due += 1
                yield self._substitute(self.due - 1)

    def end(self) -> Iterator[LiveFrame]:
        """Yield substitutes for the missing frames at the end of a clip."""
        owed, self._owed = self._owed, 0
        for number in range((self.due or 0) - owed, self.due or 0):
            yield self._substitute(number)

    def _substitute(self, number: int) -> LiveFrame:
        if self._last is None or self._lost == "missing":
            return LiveFrame(number - self._first, *self._nothing, "missing")
        return LiveFrame(number - self._first, *self._last, "concealed")  # LIVE-01

    def _interpolate(self, values: Floats, valid: Mask) -> Iterator[LiveFrame]:
        """The frames that are owed, on straight lines from the last decoded one to ``values``."""
        assert self._last is not None
        assert self.due is not None
        before, known = self._last
        both, steps = known & valid, self._owed + 1
        for k in range(1, steps):
            row = np.where(both, before + (values - before) * (k / steps), np.nan)
            yield LiveFrame(self.due - steps + k - self._first, row, both, "concealed")
        self._owed = 0
