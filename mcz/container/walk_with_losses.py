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
    FRAME,
    FRESH,
    KIND,
    Packet,
    packet_check,
    parse_packet_head,
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
        self.data = bytearray()  # from ``start`` on

    def _request(self, offset: int, size: int) -> bytes:
        stop = offset + size - self._start
        while len(self.data) < stop:
            self.take(stop - len(self.data))
        self.n_requests += 1
        self.n_bytes += size
        return bytes(self.data[offset - self._start : stop])

    def take(self, wanted: int) -> None:
        """Wait for some of the ``wanted`` bytes that come next; raises TruncatedError."""
        more = self._more(wanted)
        if not more:
            raise TruncatedError(f"the stream ended at {self.end}")
        self.data += more

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
        return self._start + len(self.data)

    def kept(self, at: int) -> bytes:
        """What has come of the bytes from ``at`` on, which is not before what was let go."""
        return bytes(self.data[at - self._start :])

    def forget(self, before: int) -> None:
        """Let go of what lies before an offset."""
        del self.data[: max(0, before - self._start)]
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
LEAST_MOST = 256  # bytes that packets have as far as is known before one came
PATIENCE = 4  # times as long as any before may a packet be without anything else being looked for

_CHUNK = b"(?=" + b"|".join(sorted(kind.value for kind in KNOWN)) + b")"
_ANY_CHUNK = re.compile(_CHUNK)
_ANY_PACKET = re.compile(rb"[\x00-\x02\x80-\x82]|" + _CHUNK)
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


class _Short(FormatError):
    """A packet has not come up to ``stop``."""

    def __init__(self, stop: int) -> None:
        super().__init__("it has not come whole")
        self.stop = stop


class _Endless(FormatError):
    """A packet does not end before the next thing that is whole, at ``found``."""

    def __init__(self, found: int) -> None:
        super().__init__(f"a packet that does not end before {found}")
        self.found = found


def repeated(piece: Piece) -> list[Piece]:
    """The chunks in a REPT; raises FormatError where it has others than it may have."""
    found = chunks_in(piece.payload or b"", 0)
    return [Piece(event.chunk.type, event.data, event.payload) for event in found]


class WalkerWithLosses:
    """A walk along a stream that survives what is lost.

    ``implied_of`` tells, behind the events so far, what a packet of kind 2 with this sequence
    number of the open DATA implies (``packets.implied_by``); None where that is not known.

    ``join``: the stream may begin anywhere. ``profile`` is to be set as HEAD says. ``is_cut`` is
    True where the stream ended before its FOOT, or amid something. Memory is bounded by the
    largest chunk. Raises LimitError where the search for what is whole costs too much.
    """

    def __init__(
        self, stream: BinaryIO, implied_of: Callable[[int], bytes | None], *, join: bool = False
    ) -> None:
        self.pipe = PipeSource(stream)
        self._implied_of = implied_of
        self.profile = BASE
        self.is_cut = True
        self.at = 0  # what lies before was taken, or given up
        self._join = join
        self._due: int | None = None  # the next packet of the open DATA
        self._most = LEAST_MOST  # bytes of the largest packet so far
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
        self.pipe.forget(at)

    def _next(self) -> tuple[Event, int]:
        """What lies at ``at`` and where it ends; of a Fault, where to search."""
        at, due = self.at, self._due
        self.pipe.read(at, 1)  # a stream that ends between two things has no fault
        try:
            return self._whole(at)
        except UnsupportedError:
            raise
        except _Endless as error:
            return Fault(at, str(error)), error.found
        except FormatError as error:
            self._due = None if isinstance(error, _OtherData) else due
            behind, is_cut = at + 1, isinstance(error, TruncatedError)
            if is_cut:
                behind = self._search(behind)  # raises, too, where nothing is whole
            return Fault(at, str(error), is_cut), behind

    def _whole(self, at: int, *, searched: bool = False) -> tuple[Piece | Packet, int]:
        """What is whole at ``at``, and where it ends; raises FormatError.

        ``searched``: and is no large chunk, which would be passed over unchecked. A packet is not
        waited for then.
        """
        if self.pipe.read(at, 1).isalpha():
            piece, end = self._chunk(at, SMALL if searched else self.profile.chunk_bytes)
            self._due = 0 if piece.payload is None else None
            return piece, end
        if self._due is None:
            return self._foot(at)
        packet, end = self._packet(at) if searched else self._awaited(at)
        self._due = None if packet.kind == END else packet.sequence + 1
        return packet, end

    def _awaited(self, at: int) -> tuple[Packet, int]:
        """The packet at ``at``, waited for: no longer than until something else is whole behind
        it, where it is far longer than those before, as one with a damaged head is."""
        while True:
            try:
                packet, end = self._packet(at)
            except _Short as short:
                if self.pipe.end - at > PATIENCE * self._most:
                    found = self._search(at)
                    if found != at:
                        raise _Endless(found) from None
                else:
                    self.pipe.take(short.stop - self.pipe.end)
            else:
                self._most = max(self._most, end - at)
                return packet, end

    def _packet(self, at: int) -> tuple[Packet, int]:
        """The packet at ``at``, and where it ends; raises _Short, or FormatError."""
        start, data, due = self.pipe.start, self.pipe.data, self._due or 0
        try:
            head = parse_packet_head(data, at - start, self.profile.packet_bytes)
        except TruncatedError:
            raise _Short(self.pipe.end + 1) from None
        first, sequence, begin, stop = head
        kind, implied = first & KIND, b""
        if kind == FRAME:
            if sequence < due:
                raise FormatError(f"packet {sequence} where {due} is due")
            known = self._implied_of(sequence)
            if known is None:
                raise FormatError(f"packet {sequence}: it is not known which frame it is")
            implied = known
        end = start + stop + CHECK_SIZE
        if end > self.pipe.end:
            raise _Short(end)
        self.pipe.n_bytes += end - at
        body = bytes(data[begin:stop])
        check = packet_check(bytes(data[at - start : begin]), body, implied)
        if check != data[stop : stop + CHECK_SIZE]:
            raise FormatError(f"crc of packet {sequence} is wrong, or it is another frame")
        if sequence < due:  # LIVE-07
            raise _OtherData(f"packet {sequence} where {due} is due")
        return Packet(kind, sequence, body, first >= FRESH, implied), end

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
        What is found is not taken: it is read again. Packets that have not come whole are tried
        again when they have, unless something behind them is whole before.
        """
        short: dict[int, int] = {}  # where such packets begin and end
        while True:
            for begin in [begin for begin, stop in short.items() if stop <= self.pipe.end]:
                if self._is_whole(begin, short):
                    return begin
            data = self.pipe.kept(at)
            pattern = _ANY_CHUNK if self._due is None else _ANY_PACKET
            for match in pattern.finditer(data):
                due = self._due
                if self._is_whole(at + match.start(), short):
                    return at + match.start()
                if self._due != due:  # a packet of another DATA
                    at += match.start()
                    short.clear()
                    break
            else:
                at += max(0, len(data) - _NAME_SIZE + 1)  # a name may have begun
                self.pipe.take(max(1, min(short.values(), default=0) - self.pipe.end))
            self.pipe.forget(min((at, *short)))

    def _is_whole(self, at: int, short: dict[int, int]) -> bool:
        """Whether something is; what is ``short`` is noted there.

        Counts what is read in vain, which is seldom much.
        """
        before, due = self.pipe.n_bytes, self._due
        short.pop(at, None)
        try:
            self._whole(at, searched=True)
        except _OtherData:
            due = None
        except _Short as error:
            short[at] = error.stop
        except FormatError:
            pass
        else:
            return True
        finally:
            self._due = due
            spent = self.pipe.n_bytes - before + TRY
            self._search_budget.spend(spent, self.size, "a chunk or packet")  # LIVE-04
        return False
