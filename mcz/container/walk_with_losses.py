"""Walking a stream of which parts are lost or damaged: what came whole, as it comes.

SPEC.md, "Live streams with losses", is normative. Nothing of what a strict walk refuses is told
from what was lost: it is a fault, and the walk goes on at the next thing that is whole.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcz.container.chunks import (
    END_MAGIC,
    FOOT,
    HEADER,
    REPEATED,
    SIGNATURE,
    ChunkFlag,
    ChunkType,
    check_chunk,
    parse_header,
)
from mcz.container.limits import BASE, MIB, Search, check
from mcz.container.packets import (
    CHECK_SIZE,
    END,
    NUMBERED,
    Packet,
    check_number,
    read_packet,
)
from mcz.container.repeats import chunks_in
from mcz.container.source import ByteSource
from mcz.errors import FormatError, TruncatedError, UnsupportedError
from mcz.schema import MAX_COUNT

MOST_AT_ONCE = 64 * 1024  # bytes that are taken from the stream where it has them


class PipeSource(ByteSource):
    """A stream that is read front to back; it need not be seekable, and its end is not known."""

    def __init__(self, stream: BinaryIO, name: str = "stream") -> None:
        super().__init__(stream, name=name, size=MAX_COUNT)
        self.block = 0  # nothing is waited for that is not needed yet
        self._start = 0  # offset of the first byte that is kept
        self._kept = bytearray()

    def _request(self, offset: int, size: int) -> bytes:
        stop = offset + size - self._start
        while len(self._kept) < stop:
            more = self._more(stop - len(self._kept))
            if not more:
                raise TruncatedError(f"the stream ended at {self._start + len(self._kept)}")
            self._kept += more
        self.n_requests += 1
        self.n_bytes += size
        return bytes(self._kept[offset - self._start : stop])

    def _more(self, wanted: int) -> bytes:
        """Some of the bytes that come next, waiting for the first of them alone if possible."""
        if hasattr(self._stream, "read1"):
            data: bytes = self._stream.read1(MOST_AT_ONCE)
        else:
            data = self._stream.read(wanted)
        return data

    @property
    def start(self) -> int:
        """What lies before was let go."""
        return self._start

    @property
    def end(self) -> int:
        """The bytes that have come."""
        return self._start + len(self._kept)

    def kept(self, at: int) -> bytes:
        """What has come of the bytes from ``at`` on, which is not before what was let go."""
        return bytes(self._kept[at - self._start :])

    def forget(self, before: int) -> None:
        """Let go of what lies before an offset."""
        del self._kept[: max(0, before - self._start)]
        self._start = max(self._start, before)

    def has_ended(self, at: int) -> bool:
        """Whether the stream ends at ``at``; waits until it goes on or ends."""
        try:
            self.read(at, 1)
        except TruncatedError:
            return True
        return False


KNOWN = frozenset(ChunkType)
WANTED = frozenset((*REPEATED, ChunkType.DATA, ChunkType.CEND, ChunkType.REPT))
SMALL = MIB  # a chunk that is not wanted is checked up to this length, and skipped beyond
TRY = 256  # bytes that a try counts as, beside those that it reads

_CHUNK = b"(?=" + b"|".join(sorted(kind.value for kind in KNOWN)) + b")"
_ANY_CHUNK = re.compile(_CHUNK)
_ANY_PACKET = re.compile(rb"[\x00-\x03\x80-\x83]|" + _CHUNK)
_NAME_SIZE = 4


@dataclass(frozen=True, slots=True)
class Piece:
    """A chunk that came whole; an open DATA that begins has no ``payload``. FOOT is one, too."""

    type: bytes
    data: bytes
    payload: bytes | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """Bytes from ``offset`` on that are not what is due there."""

    offset: int
    reason: str
    is_cut: bool = False  # the stream ended there


Event = Piece | Packet | Fault


class _OtherData(FormatError):
    """A packet of another DATA than the open one, whose end and whose successor's header are lost.

    Its number in the clip is not known, and so that of no packet behind it.
    """


class _Misplaced(FormatError):
    """A packet of kind 3 whose head is right, and whose frame is not the one that is due.

    It ends at ``end`` unless something is lost in its ``body``.
    """

    def __init__(self, reason: str, body: int, end: int) -> None:
        super().__init__(reason)
        self.body, self.end = body, end


def repeated(piece: Piece) -> list[Piece]:
    """The chunks in a REPT; raises FormatError where it has others than it may have."""
    found = chunks_in(piece.payload or b"", 0)
    return [Piece(event.chunk.type, event.data, event.payload) for event in found]


class WalkerWithLosses:
    """A walk along a stream that survives what is lost.

    ``frame_of`` tells, behind the events so far, the number of the frame that a packet with this
    sequence number of the open DATA holds; None where that is not known, and a packet of kind 3
    comes unchecked then: where it ends is not sure before what follows it is found to be whole.

    ``join``: the stream may begin anywhere. ``profile`` is to be set as HEAD says. ``is_cut`` is
    True where the stream ended before its FOOT, or amid something. Memory is bounded by the
    largest chunk. Raises LimitError where the search for what is whole costs too much.
    """

    def __init__(
        self, stream: BinaryIO, frame_of: Callable[[int], int | None], *, join: bool = False
    ) -> None:
        self.pipe = PipeSource(stream)
        self._frame_of = frame_of
        self.profile = BASE
        self.is_cut = True
        self.at = 0  # what lies before was taken, or given up
        self._join = join
        self._due: int | None = None  # the next packet of the open DATA
        # Where the body of the packet before begins whose check is not known to be right.
        self._unchecked: int | None = None
        self._search_budget = Search()

    @property
    def size(self) -> int:
        """The bytes that came so far."""
        return self.pipe.end

    def events(self) -> Iterator[Event]:
        """What came whole, in order, with a Fault wherever something between was not."""
        try:
            yield from self._begin()
            while True:
                event, end = self._next()
                self._move(end)
                self.is_cut = not (isinstance(event, Piece) and event.type == b"FOOT")  # LIVE-11
                yield event
                if isinstance(event, Fault):
                    if self._unchecked is None:
                        self._move(self._search(end))  # LIVE-03
                elif not self.is_cut and self.pipe.has_ended(end):
                    return
        except TruncatedError:
            return

    def _begin(self) -> Iterator[Event]:
        """Take the signature, or whatever comes first that is whole."""
        size = len(SIGNATURE)
        try:
            data = self.pipe.read(0, size)
        except TruncatedError:
            data = b""
        if data == SIGNATURE:
            self._move(size)
            return
        if not self._join:
            yield Fault(0, f"not the beginning of an MCZ file: {data!r}")
        self._move(self._search(0))

    def _move(self, at: int) -> None:
        self.at = at
        self.pipe.forget(at if self._unchecked is None else self._unchecked)

    def _body_unchecked(self, event: Event, end: int) -> int | None:
        """Where the body of a packet begins that ends at ``end`` and whose frame nobody told."""
        if not isinstance(event, Packet) or event.kind != NUMBERED:
            return None
        told = self._frame_of(event.sequence) is not None
        return None if told else end - CHECK_SIZE - len(event.body)

    def _next(self) -> tuple[Event, int]:
        """What lies at ``at`` and where it ends; of a Fault, where to go on, or to search."""
        at, due, before = self.at, self._due, self._unchecked
        self.pipe.read(at, 1)  # a stream that ends between two things has no fault
        self._unchecked = None
        try:
            event, end = self._whole(at)
            self._unchecked = self._body_unchecked(event, end)
            return event, end
        except UnsupportedError:
            raise
        except _Misplaced as error:
            self._unchecked = error.body
            return Fault(at, str(error)), error.end
        except FormatError as error:
            self._due = None if isinstance(error, _OtherData) else due
            behind = max(self.pipe.start, at + 1 if before is None else before)
            is_cut = isinstance(error, TruncatedError)
            if is_cut:
                behind = self._search(behind)  # raises, too, where nothing is whole
            return Fault(at, str(error), is_cut), behind

    def _whole(self, at: int, *, checked: bool = False) -> tuple[Piece | Packet, int]:
        """What is whole at ``at``, and where it ends; raises FormatError.

        ``checked``: and is no large chunk, which would be passed over unchecked, nor a packet whose
        frame nobody told.
        """
        if self.pipe.read(at, 1).isalpha():
            piece, end = self._chunk(at, SMALL if checked else self.profile.chunk_bytes)
            self._due = 0 if piece.payload is None else None
            return piece, end
        if self._due is None:
            return self._foot(at)
        reader = _Reader(self.pipe, at)
        packet = read_packet(reader, self.profile.packet_bytes)
        if packet.kind == NUMBERED:
            try:
                self._check_number(packet, self._due, checked)
            except FormatError as error:
                body = reader.at - CHECK_SIZE - len(packet.body)
                raise _Misplaced(str(error), body, reader.at) from None
        elif packet.sequence < self._due:  # LIVE-07
            raise _OtherData(f"packet {packet.sequence} where {self._due} is due")
        self._due = None if packet.kind == END else packet.sequence + 1
        return packet, reader.at

    def _check_number(self, packet: Packet, due: int, checked: bool) -> None:
        """Raise FormatError for a packet of kind 3 that is not known to be in its place."""
        if packet.sequence < due:
            raise FormatError(f"packet {packet.sequence} where {due} is due")
        number = self._frame_of(packet.sequence)
        if number is not None:
            check_number(packet, number)
        elif checked:
            raise FormatError(f"packet {packet.sequence}: nobody told which frame it is")

    def _chunk(self, at: int, most: int) -> tuple[Piece, int]:
        header = self.pipe.read(at, HEADER.size)
        chunk = parse_header(header, at)
        if (
            chunk.flags != (ChunkFlag.ANCILLARY if chunk.type == ChunkType.REPT else 0)
            and chunk.type in WANTED
        ):
            raise FormatError(f"chunk {chunk.label}: flags {chunk.flags:#x}")
        if chunk.length is None:
            return Piece(chunk.type, header), chunk.payload_offset
        most = self.profile.model_bytes if chunk.type in WANTED else most
        check(f"chunk {chunk.label}: bytes", chunk.length, most)
        if chunk.type not in WANTED and chunk.length > SMALL:
            self._pass_over(at, at + chunk.size)
            return Piece(chunk.type, b"", b""), at + chunk.size
        data = self.pipe.read(at, chunk.size)
        payload = check_chunk(data, chunk)
        if chunk.type not in KNOWN and not chunk.flags & ChunkFlag.ANCILLARY:
            raise UnsupportedError(f"chunk {chunk.label} is critical and unknown")
        return Piece(chunk.type, data, payload), at + chunk.size

    def _pass_over(self, at: int, end: int) -> None:
        while at < end:
            at += len(self.pipe.read(at, min(SMALL, end - at)))
            self.pipe.forget(at)

    def _foot(self, at: int) -> tuple[Piece, int]:
        """A FOOT; what it says of an index has no meaning for who joined."""
        data = self.pipe.read(at, FOOT.size)
        crc = int.from_bytes(data[4:8], "little")
        if data[24:] != END_MAGIC or crc != zlib.crc32(data[:4] + data[8:]):
            raise FormatError("neither a chunk nor a FOOT")
        return Piece(b"FOOT", data, b""), at + FOOT.size

    def _search(self, at: int) -> int:
        """Where something whole begins, at ``at`` or behind it; raises TruncatedError.

        A packet counts in an open DATA alone; behind one of a lower number than is due none does.
        What is found is not taken: it is read again.
        """
        while True:
            data = self.pipe.kept(at)
            pattern = _ANY_CHUNK if self._due is None else _ANY_PACKET
            for match in pattern.finditer(data):
                due = self._due
                found = self._is_whole(at + match.start())
                if found is not None:
                    self._due = due if found else None
                    at += match.start()
                    break
                self._due = due
            else:
                found = None
                at += max(0, len(data) - _NAME_SIZE + 1)  # a name may have begun
            if found:
                return at
            self.pipe.forget(at)
            self.pipe.read(at, _NAME_SIZE)

    def _is_whole(self, at: int) -> bool | None:
        """Whether something is, None where not; False for a packet of another DATA.

        Counts what is read in vain, which is seldom much.
        """
        before = self.pipe.n_bytes
        try:
            self._whole(at, checked=True)
        except _OtherData:
            return False
        except FormatError:
            return None
        finally:
            spent = self.pipe.n_bytes - before + TRY
            self._search_budget.spend(spent, self.size, "a chunk or packet")  # LIVE-04
        return True


class _Reader:
    """Reads on from an offset."""

    def __init__(self, pipe: PipeSource, at: int) -> None:
        self.at, self._pipe = at, pipe

    def __call__(self, size: int) -> bytes:
        data = self._pipe.read(self.at, size)
        self.at += size
        return data
