"""Drivers of a parser: they read its input from a file or from a growing stream."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import BinaryIO

from mcz.container.chunks import Chunk, ChunkType
from mcz.container.grammar import (
    PACKETS,
    START,
    UNSIGNED,
    ChunkEvent,
    Event,
    Fault,
    FootEvent,
    PacketEvent,
)
from mcz.container.parser import UNCHECKED, Parser
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
