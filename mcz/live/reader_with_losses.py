"""Reading a live stream of which parts are lost: what came is decoded, what did not is said.

SPEC.md, "Live streams with losses", is normative.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.brief import brief
from mcz.container import payloads
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.directory import parse_head
from mcz.container.limits import check
from mcz.container.packed import chunk_id
from mcz.container.packets import END, SEGMENT, Packet, implied_by
from mcz.container.segments import FRESH, SegmentHeader, mask_of, parse_header
from mcz.container.walk_with_losses import Fault, Piece, WalkerWithLosses, repeated
from mcz.errors import (
    ChecksumError,
    FormatError,
    LimitError,
    LostFrameError,
    TruncatedError,
    UnsupportedError,
)
from mcz.live.clip_state import ClipState, LiveClip, Shared, begin, row_of
from mcz.live.concealment import Concealer, LiveFrame, Lost
from mcz.schema import MAX_COUNT, parse

MOST_MADE_UP = 65_536  # frames in place of lost ones, and one more for every byte that came
MOST_REMARKS = 20


@dataclass(slots=True)
class StreamSummary:
    """What came of a stream, in frames and bytes.

    ``skipped`` frames did not come and were not made up either, since they were too many.
    ``payload_bytes`` are those of the codec's streams, the others of ``stream_bytes`` frame them.
    ``is_cut``: the stream ended before its file did. ``is_checked``: the value hash of each
    clip was found right; it cannot be compared where frames are missing. ``remarks`` tell of the
    first faults, of which there were ``n_faults``.
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

    __repr__ = brief

    def count(self, frame: LiveFrame) -> None:
        setattr(self, frame.state, getattr(self, frame.state) + 1)

    def fault(self, text: str) -> None:
        self.n_faults += 1
        if len(self.remarks) < MOST_REMARKS:
            self.remarks.append(text)


class _Open:
    """An open DATA: the packet and the frame that are due in it.

    ``number`` is None until a packet has told it, ``mask`` is what packets of kind 2 imply then. No
    frame of it comes before ``least``.
    """

    def __init__(self, least: int | None) -> None:
        self.least = least
        self.number: int | None = None
        self.mask = b""
        self.sequence = 0


class FramesWithLosses:
    """The frames of a stream that survives losses; ``clip`` is the one that the last is of."""

    def __init__(self, stream: BinaryIO, lost: Lost, join: bool, summary: StreamSummary) -> None:
        self._walker = WalkerWithLosses(stream, self._implied_of, join=join)
        self._lost, self._summary = lost, summary
        self._joining = join  # until a frame has come whose number is known
        self._head, self._shared = b"", Shared()
        self._course: _Course | None = None
        self._open = _Open(None)
        self._made_up = 0
        self._all_checked: bool | None = None
        self.clip: LiveClip | None = None

    @property
    def size(self) -> int:
        """The bytes that came."""
        return self._walker.size

    def frames(self) -> Iterator[LiveFrame]:
        """All frames that can be told; raises FormatError where there is no going on."""
        for event in self._walker.events():
            if isinstance(event, Fault):
                if event.is_cut and self._lost == "refuse":
                    raise TruncatedError(event.reason)
                self._fault(f"at {event.offset}: {event.reason}")
            elif isinstance(event, Packet):
                yield from self._packet(event)
            else:
                yield from self._piece(event)
        if self._walker.is_cut and self._lost == "refuse":
            raise TruncatedError(f"the stream ended at {self.size}")
        yield from self._leave("the stream ended")
        self._summary.is_cut = self._walker.is_cut
        self._summary.is_checked = bool(self._all_checked)

    def _fault(self, text: str) -> None:
        if self._joining:  # what lies before the place where one joins is no loss
            return
        self._summary.fault(text)
        if self._lost == "refuse":
            raise FormatError(text)

    def _spend(self, count: int) -> bool:
        """Whether so many frames may be made up; says so where not."""
        if self._made_up + count <= MOST_MADE_UP + self.size:
            self._made_up += count
            return True
        self._summary.skipped += count
        self._fault(f"{count} frames did not come, too many to show something in their place")
        return False

    # Chunks ------------------------------------------------------------------

    def _piece(self, piece: Piece) -> Iterator[LiveFrame]:
        kind, payload = piece.type, piece.payload
        if kind == ChunkType.HEAD:
            self._walker.profile = parse_head(payload or b"")
            self._head = piece.data
        elif kind in (ChunkType.SKEL, ChunkType.MODL):
            self._keep(piece)
        elif kind == ChunkType.CLIP:
            yield from self._begin(piece)
        elif kind == ChunkType.REPT:  # REPT-04
            yield from self._repeat(piece)
        elif kind == ChunkType.DATA and payload is None:
            self._open = _Open(None if self._course is None else self._course.frames.due)
        elif kind == ChunkType.DATA and self._course is not None:
            yield from self._segment(payload or b"", 0, None)
        elif kind == ChunkType.CEND:
            yield from self._close(piece)
        elif kind == b"FOOT":
            yield from self._leave("the file ended")

    def _keep(self, piece: Piece) -> None:
        id_ = chunk_id(piece.type, piece.payload or b"")
        self._shared.setdefault((piece.type, id_), piece.data)
        kept = sum(map(len, self._shared.values()))
        check("SKEL and MODL: bytes", kept, 2 * self._walker.profile.model_bytes)

    def _repeat(self, piece: Piece) -> Iterator[LiveFrame]:
        try:
            pieces = repeated(piece)
        except FormatError as error:
            self._fault(str(error))
            return
        for inner in pieces:
            yield from self._piece(inner)

    def _begin(self, piece: Piece) -> Iterator[LiveFrame]:
        """A clip begins, or is the one that has begun and is told once more."""
        if self._course is not None and self._course.opening == piece.data:
            return
        yield from self._leave("another clip began")
        try:
            chunk = Chunk(ChunkType.CLIP, 0, 0, len(piece.payload or b""))
            fields = parse(payloads.Clip, piece.payload or b"", "CLIP")
            followed = begin(self._head, self._shared, row_of(fields, chunk), fields)
        except (UnsupportedError, LimitError):
            raise
        except FormatError as error:
            self._fault(f"a clip that cannot be read: {error}")
            return
        if followed is None:
            raise UnsupportedError(
                f"clip {fields.name!r} needs all of its frames, and cannot be read with losses"
            )
        counts = followed.info.layout.n_channels, self._lost, followed.shown, self._spend
        self._course = _Course(followed, piece.data, Concealer(*counts, join=self._joining))
        self.clip = followed.clip

    def _close(self, piece: Piece) -> Iterator[LiveFrame]:
        course, self._course = self._course, None
        if course is None:
            return
        try:
            fields = parse(payloads.Cend, piece.payload or b"", "CEND")
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
                f"clip {course.followed.clip.name!r} was closed with {fields.n_frames} frames, "
                "others came"
            )
        else:
            self._all_checked = False

    def _leave(self, why: str) -> Iterator[LiveFrame]:
        """Give up the clip that has begun, whose end did not come."""
        course, self._course = self._course, None
        if course is not None:
            yield from course.frames.end()
            self._all_checked = False  # LIVE-10
            self._fault(f"clip {course.followed.clip.name!r} has no end: {why}")

    # Packets -----------------------------------------------------------------

    def _frame_of(self, sequence: int) -> int | None:
        """The number of the frame in that packet, of signal 0, of the open DATA, where known."""
        course, data = self._course, self._open
        gap = sequence - data.sequence  # LIVE-05
        # LIVE-06
        several = course is None or course.followed.n_signals > 1
        if data.number is None or (gap and several):
            return None  # of several signals it is not known whose frames the lost packets held
        return data.number + gap

    def _implied_of(self, sequence: int) -> bytes | None:
        """What the check of that packet of kind 2 covers beside its bytes, where known."""
        number = self._frame_of(sequence)
        return None if number is None else implied_by(number, self._open.mask)  # PACK-20

    def _packet(self, packet: Packet) -> Iterator[LiveFrame]:
        course, data = self._course, self._open
        number = data.number = self._frame_of(packet.sequence)
        data.sequence = packet.sequence + 1
        if packet.kind == SEGMENT:
            yield from self._segment(packet.body, SEGMENT, packet.fresh)
            return
        if number is not None and packet.kind != END:
            data.number = number + 1
        if course is None:
            return
        if course.followed.n_signals > 1:
            data.least = None
        if number is None:
            if data.least is not None:
                yield from course.frames.reach(min(data.least + packet.sequence, MAX_COUNT))
        elif number >= MAX_COUNT:
            self._fault(f"packet {packet.sequence}: frame {number}")
        elif packet.kind == END:
            yield from course.frames.reach(number)
        else:
            header = SegmentHeader(0, number, 1, flags=FRESH if packet.fresh else 0)
            yield from self._frame(course, header, packet.kind, packet.body)  # PACK-12

    def _segment(self, payload: bytes, kind: int, fresh: bool | None) -> Iterator[LiveFrame]:
        course = self._course
        if course is not None and course.followed.n_signals > 1:
            self._open.least = None
        try:
            header, _ = parse_header(payload)
            mask = mask_of(payload) if kind and not header.signal else b""
        except FormatError as error:
            self._open.number = None  # how many frames it had is not known either
            self._fault(str(error))
            return
        if header.signal:
            return
        self._open.number, self._open.mask = header.stop, mask
        if course is None:
            return
        if fresh in (None, bool(header.flags & FRESH)):
            yield from self._frame(course, header, kind, payload)
        else:
            self._fault(f"frame {header.first}: its packet and its segment differ")

    def _frame(
        self, course: _Course, header: SegmentHeader, kind: int, payload: bytes
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
            for due in (number, number + 1):  # the first frame that is known of counts, too
                yield from frames.reach(due)
            return
        for frame in frames.give(number, values, mask):
            if frame.state == "decoded" and frames.is_whole:
                course.followed.digest(values, mask)
            yield frame


@dataclass(slots=True)
class _Course:
    """A clip that has begun: what decodes it, and what puts its frames in order."""

    followed: ClipState
    opening: bytes  # its CLIP
    frames: Concealer
    at: int = 0  # the frame that the decoder expects

    def decode(self, number: int, stream: bytes, fresh: bool) -> NDArray[np.float64]:
        """The values of a frame; raises FormatError, and takes it for one that was lost then."""
        if number < self.at and not fresh:
            raise LostFrameError(f"frame {number} came behind frame {self.at - 1}")
        if number > self.at:
            self.followed.decoder.skip(number - self.at)
        self.at = number + 1
        return self.followed.decoder.push(stream, fresh)
