"""Drivers of a parser, which read a file or a growing stream; the parser of streams with losses.

SPEC.md, "Grammar" and "Live streams with losses", are normative.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator
from itertools import chain
from typing import BinaryIO

from mcz.container.chunks import END_MAGIC, FOOT, FRAME, REPEATED, Chunk, ChunkType, Foot
from mcz.container.grammar import (
    CLIP,
    FILE,
    PACKETS,
    START,
    UNSIGNED,
    ChunkEvent,
    Event,
    Fault,
    FootEvent,
    PacketEvent,
)
from mcz.container.limits import BASE, MIB, check
from mcz.container.parser import UNCHECKED, WHOLE, Parser, Short
from mcz.container.source import ByteSource
from mcz.errors import FormatError

MOST_AT_ONCE = 64 * 1024  # bytes that are read from a stream at a time, if available


def events(source: ByteSource, parser: Parser) -> Iterator[Event]:
    """The events of a file; bytes that the parser passes over are not read."""

    def feed() -> None:
        at, size = parser.wants
        parser.feed(source.read(at, min(max(size, source.block), source.size - at)))

    return _drive(parser, feed)


def _drive(parser: Parser, feed: Callable[[], None]) -> Iterator[Event]:
    while not parser.is_done:
        event = parser.next()
        if event is not None:
            yield event
        elif not parser.is_done:
            feed()


def sound_events(
    source: ByteSource, parser: Parser
) -> Iterator[ChunkEvent | PacketEvent | FootEvent]:
    """The events of a file; raises FormatError at the first fault."""
    for event in events(source, parser):
        if isinstance(event, Fault):
            raise event.error
        yield event


def chunks(source: ByteSource, at: int = 0, state: str = UNSIGNED) -> Iterator[tuple[Chunk, int]]:
    """The chunks from ``at`` on, and the end of each; raises FormatError at a fault.

    Only payloads of packets are read.
    """
    parser = Parser(source.size, at=at, state=state, want=lambda _: UNCHECKED)
    for event in sound_events(source, parser):
        if not isinstance(event, FootEvent) and parser.state != PACKETS:
            yield event.chunk, event.end


def packets(source: ByteSource, chunk: Chunk) -> Iterator[PacketEvent]:
    """The packets of the open DATA ``chunk``, its end packet too; raises FormatError."""
    parser = Parser(source.size, at=chunk.payload_offset, state=PACKETS, chunk=chunk)
    for event in sound_events(source, parser):
        assert isinstance(event, PacketEvent)
        yield event
        if parser.state != PACKETS:
            return


def repeated_chunks(payload: bytes, offset: int) -> list[ChunkEvent]:
    """The chunks in the ``payload`` of a REPT, which begins at ``offset``; raises FormatError."""
    stop = offset + len(payload)
    parser, repeated = Parser(stop, at=offset, state=START), []
    parser.feed(payload)
    while parser.at < stop:
        event = parser.next()
        if isinstance(event, Fault):
            raise event.error
        if not isinstance(event, ChunkEvent):
            raise FormatError(f"REPT before {offset} contains bytes that are no chunk")
        repeated.append(event)
    kinds = [event.chunk.type for event in repeated]
    middle = set(kinds[1:-1]) <= {ChunkType.SKEL, ChunkType.MODL}
    if kinds[:1] != [ChunkType.HEAD] or kinds[-1:] != [ChunkType.CLIP] or not middle:
        names = " ".join(kind.decode() for kind in kinds)
        raise FormatError(f"REPT before {offset} holds {names or 'nothing'}")
    return repeated


class Stream:
    """A stream that is read front to back; it need not be seekable, and its end is unknown.

    ``size`` counts the received bytes. It waits only for bytes that the parser needs.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = 0

    def events(self, parser: Parser) -> Iterator[Event]:
        """The events of the stream, each as soon as its bytes arrive."""
        return _drive(parser, lambda: self._feed(parser))

    def _feed(self, parser: Parser) -> None:
        at, size = parser.wants
        if hasattr(self._stream, "read1"):
            data: bytes = self._stream.read1(MOST_AT_ONCE)
        else:
            data = self._stream.read(at + size - self.size)
        if not data:
            parser.end()
        self.size += len(data)
        parser.feed(data[max(0, len(data) - (self.size - at)) :])


PARSED_TYPES = frozenset((*REPEATED, ChunkType.CEND, ChunkType.DATA, ChunkType.REPT))
SMALL = MIB  # other chunks of up to this length are checked whole in a search
LEAST_MOST = 256  # bytes assumed as the largest packet before one arrived
PATIENCE = 4  # times the largest packet: longer ones are suspect, and searched for other things

_CHUNK = b"(?=" + b"|".join(sorted(kind.value for kind in ChunkType)) + b")"
_ANY_CHUNK = re.compile(_CHUNK)
_ANY_PACKET = re.compile(rb"[\x00-\x02\x80-\x82]|" + _CHUNK)
_NAME_SIZE = 4


class TolerantParser(Parser):
    """A parser of a stream with losses, which may begin anywhere.

    A chunk may follow a packet, and a packet one that came long before. An incomplete packet is
    waited for until a later thing is intact. ``profile`` is set from HEAD, ``n_signals`` from CLIP.
    Memory is bounded by the largest chunk.
    """

    def __init__(self) -> None:
        super().__init__(want=lambda chunk: WHOLE * (chunk.type in PARSED_TYPES))
        self.n_signals = 1  # of the clip
        self._most = LEAST_MOST  # bytes of the largest packet up to now
        self._searched = 0  # everything that begins before was tried
        self._short: dict[int, int] = {}  # start and end of incomplete packets
        self._suspect: int | None = None  # start of a packet that is very long
        self._next: Event | None = None

    @property
    def frame_due(self) -> int | None:
        """The number of the next frame of the open DATA, if known."""
        return self._number if self._is_numbered else None

    def next(self) -> Event | None:
        event, self._next = self._next, None
        return event or super().next()

    def search(self, at: int) -> None:
        state = self.state
        super().search(at)
        self.state = PACKETS if state == PACKETS else self.state
        self._searched = at
        self._short.clear()

    def _read_signature(self) -> Event | None:
        event = super()._read_signature()
        if isinstance(event, Fault) and event.offset == 0:
            self.search(0)
        return event

    def _read_next(self) -> Event | None:
        if self.state != PACKETS or self._parts is not None:
            return super()._read_next()
        at = self.at
        if self._bytes(at, at + 1).isalpha():
            return self._read_chunk(at)
        try:
            event = self._read_packet()
        except Short:
            is_long = self._start + len(self._data) - at > PATIENCE * self._most
            if self._is_lost or not is_long:
                raise
            self.search(at)
            self._suspect = at
            return self._search_next()
        self._most = max(self._most, self.at - at)
        return event

    def _search_next(self) -> Event | None:
        """The next intact thing; an incomplete packet is tried when it has arrived."""
        while True:
            end = self._start + len(self._data)
            pattern = _ANY_PACKET if self.state == PACKETS else _ANY_CHUNK
            ahead = pattern.finditer(self._data, self._searched - self._start)
            for at in chain(
                [at for at, stop in self._short.items() if stop <= end],
                (self._start + match.start() for match in ahead),
            ):
                event = self._try_at(at)
                if event is not None:
                    return event
                if self.state != PACKETS and pattern is _ANY_PACKET:  # a packet of another DATA
                    self._searched = at
                    break
            else:
                if self.size is not None and end >= self.size:
                    self._is_lost, self.at = False, self.size
                    self.state = CLIP if self.state == PACKETS else self.state
                    return super()._read_next()
                self._searched = max(self._searched, end - _NAME_SIZE + 1)  # a name may have begun
                self.at = min((self._searched, *self._short))
                raise Short(max(end + 1, min(self._short.values(), default=0)))

    def _try_at(self, at: int) -> Event | None:
        """The intact thing at ``at``, or the end of an exhausted search."""
        state, chunk = self.state, self._chunk
        self.at, self._tried = at, 0
        self._short.pop(at, None)
        try:
            event = self._read_next()
        except Short as short:
            if self._data[at - self._start : at - self._start + 1].isalpha():
                self._searched = at
                self.at = min((at, *self._short))
                raise
            self._short[at] = short.stop
            return None
        except FormatError:
            self._chunk = chunk
            if self.state == CLIP and state == PACKETS:
                self._short.clear()
            else:
                self.state = state
            return self._spend(at)
        self._is_lost = False
        suspect, self._suspect = self._suspect, None
        if suspect not in (None, at):
            self._next = event
            return Fault(suspect, FormatError(f"a packet extends beyond {at}"))
        return event

    def _pass(self, chunk: Chunk) -> None:
        """Search for intact things inside a bad chunk."""

    def _read_payload(self, chunk: Chunk, most_bytes: int) -> Event:
        most = self.profile.chunk_bytes
        if most_bytes == WHOLE:
            most = min(most, max(self.profile.model_bytes, BASE.model_bytes))
        elif self._is_lost:
            most = SMALL
        check(f"chunk {chunk.label}: bytes", chunk.length or 0, most)
        return super()._read_payload(chunk, most_bytes)

    def _place(self, event: ChunkEvent) -> Event:
        self.state = CLIP if self.state == PACKETS else self.state
        return super()._place(event)

    def _read_foot(self, at: int) -> Event:
        """A FOOT, without the place of its index, which is useless after a late start."""
        data = self._bytes(at, at + FOOT.size)
        crc = int.from_bytes(data[4:8], "little")
        if data[24:] != END_MAGIC or crc != zlib.crc32(data[:4] + data[8:]):
            raise FormatError("expected a chunk or a FOOT")
        self.at, self.state = at + FOOT.size, FILE
        return FootEvent(Foot(0, 0), at, None)

    def _may_skip(self, kind: int, count: int) -> bool:
        # LIVE-06: with several signals the signal of lost packets is unknown
        return kind != FRAME or count == 0 or (count > 0 and self.n_signals == 1)

    def _skip(self, count: int) -> None:
        if count < 0:  # LIVE-07
            self.state = CLIP
            raise FormatError(
                f"packet {self._sequence + count} where packet {self._sequence} is expected"
            )
        self._number += count  # LIVE-05
        self._is_numbered = self._is_numbered and (count == 0 or self.n_signals == 1)  # LIVE-06
