"""The grammar of a file: events of a parser and their order, as in SPEC.md, "Grammar"."""

from __future__ import annotations

from dataclasses import dataclass

from mcz.container.chunks import (
    CHECK_SIZE,
    FLAGS_OF,
    FOOT,
    HEADER,
    Chunk,
    ChunkFlag,
    ChunkType,
    Foot,
    Packet,
    build_packet,
)
from mcz.container.segments import FRESH, MASKS, SegmentHeader
from mcz.errors import FormatError, UnsupportedError

# States: the last thing read, and so the possible next ones.
UNSIGNED, START, BODY, CLIP, PACKETS, INDEX, FILE = (
    *("signature", "start", "body", "clip"),
    *("packets", "index", "file"),
)
# Things with other names than the type of their chunk.
OPEN_DATA, PACKET, END_PACKET = "open DATA", "packet", "end packet"
OTHER, FOOT_THING, END = "ancillary", "FOOT", "end of file"

GRAMMAR: dict[str, dict[str, str]] = {
    "HEAD": {START: BODY},
    "SKEL": {BODY: BODY, FILE: BODY},
    "MODL": {BODY: BODY, FILE: BODY},
    "SRCE": {BODY: BODY, FILE: BODY},
    "ATTA": {BODY: BODY, FILE: BODY},
    "ALIA": {BODY: BODY, FILE: BODY},
    "CLIP": {BODY: CLIP, FILE: CLIP},  # GRAM-09
    "DATA": {CLIP: CLIP},
    OPEN_DATA: {CLIP: PACKETS},
    PACKET: {PACKETS: PACKETS},
    END_PACKET: {PACKETS: CLIP},
    "CEND": {CLIP: BODY},
    OTHER: {BODY: BODY, CLIP: CLIP, FILE: BODY},
    "INDX": {BODY: INDEX, FILE: INDEX},
    FOOT_THING: {BODY: FILE, INDEX: FILE, FILE: FILE},
    END: {FILE: END},
}
NAMED: dict[bytes, str] = {kind: kind.name for kind in ChunkType if kind.name in GRAMMAR}


def grammar_row_of(chunk: Chunk) -> str:
    """The row of the grammar that a closed chunk belongs to; raises FormatError for wrong flags."""
    thing = NAMED.get(chunk.type)
    if chunk.flags != FLAGS_OF.get(chunk.type, 0 if thing else chunk.flags):  # CHUNK-15
        raise FormatError(
            f"chunk {chunk.label}: flags {chunk.flags:#x} are not allowed for its type"
        )
    if thing is not None:
        return thing
    if chunk.flags & ChunkFlag.ANCILLARY:  # CHUNK-12
        return OTHER
    raise UnsupportedError(f"chunk {chunk.label} is critical, and its type is unknown")  # CHUNK-11


def order_error(thing: str, label: str, state: str) -> FormatError:
    """The error of a thing at a wrong place."""
    if state == START:
        return FormatError(f"the first chunk is {label}, not HEAD")
    if state == INDEX:
        return FormatError(f"INDX must be followed by a FOOT, not by {label}")
    if thing == "HEAD":
        return FormatError(f"a second {label} is not allowed")
    if state == CLIP:
        return FormatError(f"chunk {label} is inside a clip")
    return FormatError(f"{label} is outside a clip")


def state_after_misplaced(thing: str, state: str) -> str:
    """The state after a thing at a wrong place."""
    began = {"CLIP": CLIP, "INDX": INDEX, OPEN_DATA: PACKETS}.get(thing)
    return began or (BODY if state in (START, INDEX) else state)


@dataclass(slots=True)
class ChunkEvent:
    """A chunk; ``data`` is its header and as much of the rest as was requested."""

    chunk: Chunk
    data: bytes
    thing: str  # its row in the grammar

    @property
    def offset(self) -> int:
        return self.chunk.offset

    @property
    def end(self) -> int:
        """The offset after it, or of the first packet of an open DATA."""
        chunk = self.chunk
        return chunk.payload_offset if chunk.length is None else chunk.offset + chunk.size

    @property
    def payload(self) -> bytes:
        """The requested beginning of its payload."""
        length = self.chunk.length or 0
        return self.data[HEADER.size : HEADER.size + length]


@dataclass(slots=True)
class PacketEvent:
    """A packet of the open DATA ``chunk``; its body begins at ``body``.

    ``number``: the frame of a packet without a segment; ``segment``: the header of the segment of
    another one, None in an end packet or if unknown. ``is_masked``: it implies the mask of the
    previous packet.
    """

    chunk: Chunk
    packet: Packet
    offset: int
    body: int
    number: int | None = None
    segment: SegmentHeader | None = None
    is_masked: bool = False

    @property
    def header(self) -> SegmentHeader | None:
        """The header of its segment, also if it is implied."""
        if self.number is None:
            return self.segment
        flags = self.packet.fresh * FRESH | self.is_masked * MASKS  # PACK-20
        return SegmentHeader(0, self.number, 1, flags=flags)  # PACK-12

    @property
    def end(self) -> int:
        return self.body + len(self.packet.body) + CHECK_SIZE

    @property
    def payload(self) -> bytes:
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
        """Return whether it refers to that INDX, or to none."""
        return (self.foot.index_offset, self.foot.index_length) == self.place

    @property
    def end(self) -> int:
        return self.offset + FOOT.size


@dataclass(slots=True)
class Fault:
    """A break of the rules by a thing at ``offset``.

    ``chunk`` is the chunk there, or the chunk of the packet there, if its header is sound.
    ``event`` is the thing itself if its checksums are right, and only its content or its place in
    the ``state`` of the grammar is wrong. ``is_lost``: its end is unknown.
    """

    offset: int
    error: FormatError
    chunk: Chunk | None = None
    event: ChunkEvent | PacketEvent | FootEvent | None = None
    state: str = ""
    is_lost: bool = False


Event = ChunkEvent | PacketEvent | FootEvent | Fault
