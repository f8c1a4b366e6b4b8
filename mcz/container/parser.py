"""The parser of files: bytes in, events out, from any reader of bytes.

It follows the table of ``grammar.py``, and reports the place of every break; the receiver of the
events decides what to do about it. SPEC.md, "Chunks", "Grammar", "Open DATA and packets" and
"Salvage", are normative.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable

from mcz.container.chunks import (
    CHECK_SIZE,
    CRC,
    END_MAGIC,
    FOOT,
    FRAME,
    HEADER,
    KIND,
    SEGMENT,
    SIGNATURE,
    Chunk,
    Packet,
    check_crc,
    check_signature_in,
    implied_by,
    packet_check,
    parse_chunk_header,
    parse_foot,
    parse_packet_head,
)
from mcz.container.chunks import END as END_KIND
from mcz.container.chunks import FRESH as FRESH_PACKET
from mcz.container.grammar import (
    BODY,
    CLIP,
    END,
    END_PACKET,
    FOOT_THING,
    GRAMMAR,
    INDEX,
    NAMED,
    OPEN_DATA,
    OTHER,
    PACKET,
    PACKETS,
    START,
    UNSIGNED,
    ChunkEvent,
    Event,
    Fault,
    FootEvent,
    PacketEvent,
    grammar_row_of,
    order_error,
    state_after_misplaced,
)
from mcz.container.limits import BASE, search_limit
from mcz.container.segments import FRESH, MASKS, mask_of, parse_segment_header
from mcz.errors import ChecksumError, FormatError, LimitError, TruncatedError
from mcz.model.schema import MAX_COUNT

BLOCK = 2 * 1024 * 1024  # a longer chunk whose payload is not requested is checked in parts
WHOLE = MAX_COUNT  # the payload is requested whole, and then checked
UNCHECKED = -1  # neither read nor checked
TRIAL_BYTES = 256  # cost of a trial in a search, added to the bytes of the chunk

Want = Callable[[Chunk], int]


class Short(Exception):
    """More bytes are needed: up to ``stop``."""

    def __init__(self, stop: int) -> None:
        super().__init__()
        self.stop = stop


class Parser:
    """The state of a parser, which is fed with bytes and asked for events.

    ``size`` is the size of the file, None if unknown until ``end``. ``want`` returns the number of
    bytes of a payload that its event needs, ``WHOLE`` or ``UNCHECKED``; with ``check`` the
    others are read too, for the checksum.

    The thing at ``at`` is next, in the state ``state`` of the grammar. After a Fault the parser
    continues after the faulty thing if its end is known, else with the next intact thing.
    """

    candidate = re.compile(  # looks like the beginning of a chunk or of a FOOT
        rb"(?=[A-Za-z]{4}[\x00-\x03]\x00|\x00{4}.{20}" + re.escape(END_MAGIC) + b")", re.DOTALL
    )

    def __init__(
        self,
        size: int | None = None,
        *,
        at: int = 0,
        state: str = UNSIGNED,
        chunk: Chunk | None = None,
        want: Want = lambda chunk: WHOLE,
        check: bool = True,
    ) -> None:
        self.size, self.at, self.state = size, at, state
        self.profile = BASE
        self.is_done = False
        self._number, self._is_numbered = 0, False  # of the next frame, if a packet states it
        self._want, self._check, self._name = want, check, "the file"
        self._start, self._data = at, b""  # fed bytes that may still be needed
        self._stop = at + 1  # bytes up to here are needed
        self._sequence = 0  # of the packet that is due
        self._mask_segment = b""  # the segment of signal 0 that packets of kind 2 continue
        self._is_masked = False
        self._implied: bytes | None = b""  # its mask, None if it must be extracted
        self._index: Chunk | None = None  # an INDX that waits for its FOOT
        self._chunk = chunk  # the chunk at ``at``, or the open DATA around it
        self._parts: tuple[ChunkEvent, int] | None = None  # a chunk in parts, its crc up to now
        self._is_lost = False
        self._vain = 0  # bytes that searches have read
        self._tried = 0  # size of the last tried chunk

    @property
    def wants(self) -> tuple[int, int]:
        """Offset and least number of the bytes that are to be fed next."""
        end = self._start + len(self._data)
        return end, self._stop - end

    def feed(self, data: bytes) -> None:
        """Append the bytes requested by ``wants``, or more."""
        n_used = min(max(0, self.at - self._start), len(self._data))
        self._start, self._data = self._start + n_used, self._data[n_used:] + data

    def end(self) -> None:
        """End the stream after the bytes that were fed."""
        self.size, self._name = self._start + len(self._data), "the stream"

    def next(self) -> Event | None:
        """The next event; None if it needs more bytes, or none follows."""
        if self.state == UNSIGNED:
            return self._read_signature()
        begin = self.at if self._parts is None else self._parts[0].offset
        try:
            return (
                None
                if self.is_done
                else self._search_next()
                if self._is_lost
                else self._read_next()
            )
        except Short as short:
            self._stop = short.stop
            return None
        except FormatError as error:
            return self._fault(begin, error)

    def search(self, at: int) -> None:
        """Continue with the first intact thing at ``at`` or after it."""
        self._go_to(at)
        self._is_lost, self._index = True, None
        self.state = {PACKETS: CLIP, INDEX: BODY}.get(self.state, self.state)

    def _fault(self, begin: int, error: FormatError) -> Fault:
        """The Fault of the thing at ``begin``; ``at`` stays there unless its end is known."""
        is_lost = self.at == begin
        if is_lost:
            self.search(begin if self.state == PACKETS else begin + 1)
        return Fault(begin, error, self._chunk, is_lost=is_lost)

    def _search_next(self) -> Event | None:
        """The next intact thing, at ``at`` or after it."""
        while True:
            begin = self.at
            for match in self.candidate.finditer(self._data, begin - self._start):
                self.at = at = self._start + match.start()
                self._chunk, self._tried = None, 0
                state = self.state
                try:
                    event = self._read_next()
                except FormatError as error:
                    if self.at != at:  # intact, but wrong
                        self._is_lost = False
                        return self._fault(at, error)
                    self.state = state
                    limit = self._spend(begin)
                    if limit is not None:
                        return limit
                else:
                    self._is_lost = False
                    return event
            end = self._start + len(self._data)
            if self.size is not None and end >= self.size:
                self._is_lost, self.at = False, self.size
                return self._read_next()
            self.at = max(begin, end - FOOT.size + 1)  # one may begin there that is incomplete
            raise Short(end + 1)

    def _spend(self, begin: int) -> Fault | None:
        """Count bytes searched in vain; return the last event if they are too many."""
        came = self._start + len(self._data) if self.size is None else self.size
        self._vain += self._tried + TRIAL_BYTES
        if self._vain <= search_limit(came):  # LIVE-04
            return None
        self.is_done = True
        error = LimitError(f"too many false starts of a chunk; {self._vain} bytes read")
        return Fault(begin, error, is_lost=True)

    def _go_to(self, at: int) -> None:
        self.at = at
        if at > self._start + len(self._data):
            self._start, self._data = at, b""
            self._stop = at + 1

    def _pass(self, chunk: Chunk) -> None:
        if self._is_lost:
            return
        self._go_to(chunk.offset + chunk.size)  # SALV-01
        rows = GRAMMAR[NAMED.get(chunk.type, OTHER)]
        if rows.get(self.state) in (BODY, CLIP):
            self.state = rows[self.state]

    def _position(self, start: int, stop: int, noun: str = "a packet") -> int:
        """The place of the byte at ``start`` in the buffer, which has all up to ``stop``."""
        if stop > self._start + len(self._data):
            if self.size is not None and stop > self.size:
                raise TruncatedError(f"{self._name} ends at {self.size}, in {noun} at {self.at}")
            raise Short(stop)
        return start - self._start

    def _bytes(self, start: int, stop: int, label: str = "a packet") -> bytes:
        pos = self._position(start, stop, label)
        return self._data[pos : pos + stop - start]

    def _read_next(self) -> Event | None:
        """The thing at ``at``; raises FormatError if it is not intact."""
        if self._parts is not None:
            return self._continue_large(*self._parts)
        if self.state == PACKETS:
            return self._read_packet()
        self._chunk, at = None, self.at
        if self.size is not None and at >= self.size:
            self.is_done = True
            if self.state in GRAMMAR[END]:  # STRICT-01
                return None
            error = TruncatedError(f"{self._name} ends at {at} without a FOOT")
            return Fault(at, error, is_lost=True)
        return self._read_chunk(at) if self._bytes(at, at + 1).isalpha() else self._read_foot(at)

    def _read_signature(self) -> Event | None:
        size, data = len(SIGNATURE), self._data
        if (self.size is None and len(data) < size) or (not data and self.size):
            self._stop = size
            return None
        self.at, self.state = size, START
        try:
            check_signature_in(data[:size])
        except FormatError as error:
            return Fault(0, error)
        return self.next()

    def _read_chunk(self, at: int) -> Event:
        header = self._bytes(at, at + HEADER.size, "a chunk header")
        chunk = self._chunk = parse_chunk_header(header, at)
        if chunk.length is None:
            event = ChunkEvent(chunk, header, OPEN_DATA)
            self.at = event.end
            placed = self._place(event)
            if chunk.flags:  # CHUNK-10, PACK-10
                error = FormatError(f"chunk {chunk.label}: flags {chunk.flags:#x} on an open DATA")
                return Fault(at, error, chunk, event)
            return placed
        end = self._tried = at + chunk.size
        if self.size is not None and end > self.size:  # CHUNK-05
            raise TruncatedError(f"chunk {chunk.label} ends at {end}, {self._name} at {self.size}")
        return self._read_payload(chunk, self._want(chunk))

    def _read_payload(self, chunk: Chunk, most_bytes: int) -> Event:
        """Read a chunk, and check what is read of it."""
        assert chunk.length is not None
        at, end = chunk.offset, chunk.offset + chunk.size
        payload = (
            chunk.size
            if most_bytes == WHOLE
            else HEADER.size + min(max(0, most_bytes), chunk.length)
        )
        if most_bytes == WHOLE or (self._check and most_bytes != UNCHECKED):
            if chunk.length > self.profile.chunk_bytes:
                self._pass(chunk)
                limit = self.profile.chunk_bytes  # CHUNK-04, LIMIT-07
                raise LimitError(
                    f"chunk {chunk.label}: {chunk.length} bytes are over the limit of {limit}"
                )
            if chunk.size > max(BLOCK, payload) and not self._is_lost:
                return self._continue_large(ChunkEvent(chunk, self._bytes(at, at + payload), ""), 0)
            data = self._bytes(at, end)
            try:
                check_crc(chunk, zlib.crc32(memoryview(data)[: -CRC.size]), data[-CRC.size :])
            except ChecksumError:
                self._pass(chunk)
                raise
            data = data[:payload]
        else:
            data = self._bytes(at, at + payload)
        self._go_to(end)
        return self._place(ChunkEvent(chunk, data, grammar_row_of(chunk)))

    def _continue_large(self, event: ChunkEvent, crc: int) -> Event:
        """Continue a large chunk; only its last part is in memory."""
        chunk = event.chunk
        covered = chunk.offset + chunk.size - CRC.size
        part = self._data[self.at - self._start : covered - self._start]
        crc = zlib.crc32(part, crc)
        self.at += len(part)
        self._parts = event, crc
        if self.at < covered:
            raise Short(min(self.at + BLOCK, covered + CRC.size))
        stored = self._bytes(covered, covered + CRC.size)
        self._parts, self.at = None, covered + CRC.size
        check_crc(chunk, crc, stored)
        event.thing = grammar_row_of(chunk)
        return self._place(event)

    def _place(self, event: ChunkEvent) -> Event:
        rows, state = GRAMMAR[event.thing], self.state
        self.state = rows.get(state) or state_after_misplaced(event.thing, state)
        self._index = event.chunk if event.thing == "INDX" else None
        self._sequence, self._is_numbered = 0, False
        if state in rows:  # GRAM-01
            return event
        error = order_error(event.thing, event.chunk.label, state)
        return Fault(event.offset, error, event.chunk, event, state)

    def _read_foot(self, at: int) -> Event:
        foot = parse_foot(self._bytes(at, at + FOOT.size, "a FOOT"), at)
        if foot is None:
            raise FormatError(f"neither a chunk nor a FOOT begins at {at}")
        event, state, rows = FootEvent(foot, at, self._index), self.state, GRAMMAR[FOOT_THING]
        self.at, self.state, self._index = event.end, rows[BODY], None
        if not event.is_right:  # FOOT-04
            error = FormatError(f"FOOT at {at} points to {foot}, but the index is at {event.place}")
            return Fault(at, error, None, event, state)
        if state not in rows:
            return Fault(at, order_error(FOOT_THING, f"FOOT at {at}", state), None, event, state)
        return event

    def _read_packet(self) -> Event:
        at, data = self.at, self._data
        pos = self._position(at, at + 1)
        try:
            head = parse_packet_head(data, pos, self.profile.packet_bytes)
        except TruncatedError:
            self._position(at, self._start + len(data) + 1)
            raise
        first, sequence, start, stop = head
        skipped, kind = sequence - self._sequence, first & KIND
        if not self._may_skip(kind, skipped):  # PACK-02
            raise FormatError(f"packet {sequence} where packet {self._sequence} is expected")
        end = stop + CHECK_SIZE
        if end > len(data):
            self._position(at, self._start + end)
        self._tried = end - pos
        body, implied = data[start:stop], b""
        if kind == FRAME:
            implied = implied_by(self._due() + skipped, self._mask())
        # INDX-03, PACK-04, PACK-15
        if packet_check(data[pos:start], body, implied) != data[stop:end]:
            hint = f", or it is not frame {self._number + skipped}" if implied else ""
            raise ChecksumError(f"crc of packet {sequence} is wrong{hint}")
        self._skip(skipped)
        packet = Packet(kind, sequence, body, first >= FRESH_PACKET, implied)
        assert self._chunk is not None
        event = PacketEvent(self._chunk, packet, at, self._start + start)
        self.at, self._sequence = self._start + end, sequence + 1
        self.state = GRAMMAR[END_PACKET if kind == END_KIND else PACKET][PACKETS]  # PACK-01
        try:
            self._count_frames(event)
        except FormatError as error:
            return Fault(at, error, event.chunk, event)
        return event

    def _may_skip(self, kind: int, count: int) -> bool:
        """Return True if ``count`` packets may be missing before one of this kind."""
        return count == 0

    def _skip(self, count: int) -> None:
        """Skip ``count`` missing packets; raises FormatError."""

    def _due(self) -> int:
        if not self._is_numbered:  # PACK-14
            raise FormatError(f"packet at {self.at}: no packet before it states its frame")
        return self._number

    def _mask(self) -> bytes:
        """The mask of the last segment of signal 0 in the open DATA."""
        if self._implied is None:
            self._implied = mask_of(self._mask_segment)  # PACK-20
        return self._implied

    def _count_frames(self, event: PacketEvent) -> None:
        """Count the frames of a packet; raises FormatError."""
        packet = event.packet
        if packet.kind == FRAME:
            event.number, event.is_masked = self._number, self._is_masked
            self._number += 1
        elif packet.kind == SEGMENT:
            was_numbered, self._is_numbered = self._is_numbered, False
            header, _ = parse_segment_header(packet.body)
            if header.signal == 0:
                self._mask_segment, self._is_masked = packet.body, bool(header.flags & MASKS)
                self._implied = None if self._is_masked else b""
                self._number = header.stop
            self._is_numbered = was_numbered or header.signal == 0
            if packet.fresh != bool(header.flags & FRESH):  # PACK-11
                raise FormatError(
                    f"packet at {event.body}: packet and segment disagree whether it starts fresh"
                )
            event.segment = header
        elif packet.kind == END_KIND and packet.body:  # PACK-05, PACK-07
            raise FormatError(f"the end packet must be empty, but has {len(packet.body)} bytes")
