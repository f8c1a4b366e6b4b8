"""Drivers of a parser: they read what it needs, from a file or from a stream that goes on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from mcz.container.chunks import Chunk
from mcz.container.events import Event, Fault, PacketEvent
from mcz.container.grammar import PACKETS
from mcz.container.packets import END
from mcz.container.parser import Parser
from mcz.container.source import ByteSource

MOST_AT_ONCE = 64 * 1024  # bytes that are taken from a stream where it has them


def events(source: ByteSource, parser: Parser) -> Iterator[Event]:
    """The events of a file; bytes that the parser passes over are not read."""
    while True:
        event = parser.next()
        if event is not None:
            yield event
        elif parser.is_done:
            return
        else:
            at, size = parser.wants
            parser.feed(source.read(at, min(max(size, source.block), source.size - at)))


def packets(source: ByteSource, chunk: Chunk) -> Iterator[PacketEvent]:
    """The packets of the open DATA ``chunk``, its end packet too; raises FormatError."""
    parser = Parser(source.size, at=chunk.payload_offset, state=PACKETS, chunk=chunk)
    for event in events(source, parser):
        if isinstance(event, Fault):
            raise event.error
        if isinstance(event, PacketEvent):
            yield event
            if event.packet.kind == END:
                return


def end_of(source: ByteSource, chunk: Chunk) -> int:
    """Where the open DATA ``chunk`` ends; raises FormatError."""
    end = chunk.payload_offset
    for event in packets(source, chunk):
        end = event.end
    return end


class Stream:
    """A stream that is read front to back; it need not be seekable, and its end is not known.

    ``size`` counts the bytes that came. Nothing is waited for that the parser does not need yet.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = 0

    def events(self, parser: Parser) -> Iterator[Event]:
        """The events of the stream, each as soon as its bytes are there."""
        while True:
            event = parser.next()
            if event is not None:
                yield event
            elif parser.is_done:
                return
            else:
                self._feed(parser)

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
