"""What a parser finds in the bytes of a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mcz.container.chunks import FOOT, HEADER, Chunk, Foot
from mcz.container.packets import CHECK_SIZE, Packet, build_packet
from mcz.container.segments import SegmentHeader
from mcz.errors import FormatError


@dataclass(slots=True)
class ChunkEvent:
    """A chunk; ``data`` begins with its header, and has as much of it as was wanted."""

    chunk: Chunk
    data: bytes
    thing: str  # its row in the grammar

    @property
    def offset(self) -> int:
        return self.chunk.offset

    @property
    def end(self) -> int:
        """Where it ends, of an open DATA where its first packet begins."""
        chunk = self.chunk
        return chunk.payload_offset if chunk.length is None else chunk.offset + chunk.size

    @property
    def payload(self) -> bytes:
        """Its payload, or the beginning of it that was wanted."""
        length: Any = self.chunk.length
        return self.data[HEADER.size : HEADER.size + length]


@dataclass(slots=True)
class PacketEvent:
    """A packet of the open DATA ``chunk``, whose body begins at ``body``.

    ``header`` is that of the segment in it: None in an end packet, and where it is not known.
    ``is_sound``: whether its body has the check that it states, as far as that needs no number.
    """

    chunk: Chunk
    packet: Packet
    offset: int
    body: int
    header: SegmentHeader | None = None
    is_sound: bool = True

    @property
    def end(self) -> int:
        return self.body + len(self.packet.body) + CHECK_SIZE

    @property
    def payload(self) -> bytes:
        """Its body."""
        return self.packet.body

    @property
    def data(self) -> bytes:
        """All of it, as ``ChunkEvent.data``."""
        return build_packet(self.packet)


@dataclass(slots=True)
class FootEvent:
    """A FOOT, and the INDX before it."""

    foot: Foot
    offset: int
    index: Chunk | None

    @property
    def place(self) -> tuple[int, int]:
        """Offset and size of that INDX, both 0 without one."""
        return (self.index.offset, self.index.size) if self.index else (0, 0)

    @property
    def is_right(self) -> bool:
        """Return whether it says where that INDX is, or that there is none."""
        return (self.foot.index_offset, self.foot.index_length) == self.place

    @property
    def end(self) -> int:
        return self.offset + FOOT.size


@dataclass(slots=True)
class Fault:
    """A break of the rules in what begins at ``offset``.

    ``chunk`` is the one that lies there, or whose packet does, where its header is sound. ``event``
    is what lies there where its checksums are right, and it alone or its place is wrong: in the
    ``state`` of the grammar. ``is_lost``: where it ends is not known.
    """

    offset: int
    error: FormatError
    chunk: Chunk | None = None
    event: ChunkEvent | PacketEvent | FootEvent | None = None
    state: str = ""
    is_lost: bool = False


Event = ChunkEvent | PacketEvent | FootEvent | Fault
