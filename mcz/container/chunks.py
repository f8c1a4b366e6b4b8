"""The framing of a file: chunks, packets of an open DATA, the signature and the FOOT.

SPEC.md, "Chunks", "Open DATA and packets" and "FOOT", are normative.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from enum import Enum, IntFlag

from mcz.container.limits import check
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError, LimitError, TruncatedError
from mcz.model.schema import MAX_COUNT, read_varint, varint
from mcz.model.text_format import compression_remark, quote

SIGNATURE = b"\x89MCZ\r\n\x1a\n"
END_MAGIC = b"\x89ZCM\r\n\x1a\n"
HEADER = struct.Struct("<4sBBHQ")  # type, flags, reserved, header_check, length
CRC = struct.Struct("<I")
FRAMING = HEADER.size + CRC.size
FOOT = struct.Struct("<IIQQ8s")  # flags, crc, index offset, index length, end magic
OPEN_LENGTH = 2**64 - 1


class ChunkFlag(IntFlag):
    ANCILLARY = 1  # readers skip the chunk if its type is unknown
    SAFE_TO_COPY = 2  # rewriters keep the chunk if its type is unknown


# An int, since ~ of a ChunkFlag has no other bits.
KNOWN_FLAGS = int(ChunkFlag.ANCILLARY | ChunkFlag.SAFE_TO_COPY)


class ChunkType(bytes, Enum):
    """The types of chunks that SPEC.md has, with their bytes."""

    HEAD = b"HEAD"
    SKEL = b"SKEL"
    MODL = b"MODL"
    SRCE = b"SRCE"
    ATTA = b"ATTA"
    ALIA = b"ALIA"
    CLIP = b"CLIP"
    DATA = b"DATA"
    CEND = b"CEND"
    INDX = b"INDX"
    QUAL = b"QUAL"
    REPT = b"REPT"
    COPY = b"COPY"
    META = b"META"
    RECV = b"RECV"


# CHUNK-16, CHUNK-17, CHUNK-18, CHUNK-19, CHUNK-20, CHUNK-21
FLAGS_OF: dict[bytes, ChunkFlag] = {  # of chunks that are not critical
    ChunkType.INDX: ChunkFlag.ANCILLARY,
    ChunkType.QUAL: ChunkFlag.ANCILLARY | ChunkFlag.SAFE_TO_COPY,
    ChunkType.REPT: ChunkFlag.ANCILLARY,
    ChunkType.COPY: ChunkFlag.ANCILLARY,  # its content is true of this file alone
    ChunkType.META: ChunkFlag.ANCILLARY | ChunkFlag.SAFE_TO_COPY,
    ChunkType.RECV: ChunkFlag.ANCILLARY,
}
# The chunks repeated by a REPT, and by a COPY.
REPEATED = (ChunkType.HEAD, ChunkType.SKEL, ChunkType.MODL, ChunkType.CLIP)
SHARED = (ChunkType.SKEL, ChunkType.MODL, ChunkType.SRCE)  # named by a hash, for clips to refer to
COPIED = (*REPEATED, ChunkType.SRCE, ChunkType.ALIA, ChunkType.CEND)


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk's place in a file; ``length`` is its payload's, None while it is open."""

    type: bytes
    flags: int = field(compare=False)
    offset: int
    length: int | None

    @property
    def payload_offset(self) -> int:
        return self.offset + HEADER.size

    @property
    def size(self) -> int:
        """Bytes of the whole chunk, framing included."""
        if self.length is None:
            raise FormatError(f"chunk {self.label} is open, so its length is unknown")
        return self.length + FRAMING

    @property
    def stop(self) -> int:
        """The offset after it."""
        return self.offset + self.size

    @property
    def label(self) -> str:
        return f"{self.type.decode('latin-1')} at {self.offset}"


@dataclass(frozen=True, slots=True)
class Foot:
    """The trailer; the two numbers span the whole INDX chunk and are 0 without one."""

    index_offset: int
    index_length: int


def build_header(kind: bytes, flags: int, length: int) -> bytes:
    check = zlib.crc32(kind + bytes((flags, 0)) + struct.pack("<Q", length)) & 0xFFFF
    return HEADER.pack(kind, flags, 0, check, length)


def build_chunk(kind: bytes, payload: bytes, flags: int = 0) -> bytes:
    header = build_header(kind, flags, len(payload))
    return header + payload + CRC.pack(zlib.crc32(payload, zlib.crc32(header)))


def parse_chunk_header(data: bytes, offset: int) -> Chunk:
    """The chunk with the header ``data``, which was read at ``offset``."""
    if len(data) < HEADER.size:
        raise TruncatedError(
            f"a chunk header at {offset} ends after {len(data)} of 16 bytes", offset=offset
        )
    kind, flags, reserved, check, length = HEADER.unpack(data[: HEADER.size])
    if check != zlib.crc32(data[:6] + data[8:16]) & 0xFFFF:  # CHUNK-02
        raise ChecksumError(
            f"header_check of the chunk at {offset} is {check:#06x}, which is wrong",
            offset=offset,
            value=check,
        )
    if not (kind.isalpha() and kind.isascii()):  # CHUNK-08
        raise FormatError(
            f"chunk type {kind!r} at {offset} is not four ASCII letters", offset=offset
        )
    if reserved or flags & ~KNOWN_FLAGS:  # CHUNK-09
        raise FormatError(
            f"chunk {kind.decode()} at {offset}: flags {flags:#x} or reserved field "
            f"{reserved} not allowed",
            offset=offset,
            value=flags,
        )
    if length == OPEN_LENGTH:
        if kind != ChunkType.DATA:  # CHUNK-10
            raise FormatError(
                f"chunk {kind.decode()} at {offset} is open; only a DATA chunk may be",
                offset=offset,
            )
        return Chunk(kind, flags, offset, None)
    if length > MAX_COUNT:
        raise FormatError(
            f"chunk {kind.decode()} at {offset}: length {length} is beyond 2^53 - 1",
            offset=offset,
            value=length,
        )
    return Chunk(kind, flags, offset, length)


def read_chunk(source: ByteSource, offset: int) -> Chunk:
    """The chunk at ``offset``, its payload not read; raises TruncatedError past the file's end."""
    if offset + HEADER.size > source.size:
        raise TruncatedError(
            f"the file ends at {source.size}, in a chunk header at {offset}", offset=offset
        )
    chunk = parse_chunk_header(source.read(offset, HEADER.size), offset)
    if chunk.length is not None and chunk.offset + chunk.size > source.size:  # CHUNK-05
        raise TruncatedError(
            f"chunk {chunk.label} ends at {chunk.offset + chunk.size}, the file at {source.size}",
            offset=offset,
            value=chunk.length,
        )
    return chunk


def read_payload(source: ByteSource, chunk: Chunk, limit: int) -> bytes:
    """The checked payload of ``chunk``; raises ChecksumError, or LimitError beyond ``limit``."""
    if chunk.length is None:
        raise FormatError(
            f"chunk {chunk.label} is open, so its length is unknown", offset=chunk.offset
        )
    if chunk.length > limit:
        raise LimitError(
            f"chunk {chunk.label}: {chunk.length} bytes are over the limit of {limit}",
            offset=chunk.offset,
            value=chunk.length,
        )
    return check_chunk(source.read(chunk.offset, chunk.size), chunk)


def check_chunk(data: bytes, chunk: Chunk) -> bytes:
    """The payload in ``data``, the bytes of the whole ``chunk``, after a check of its crc."""
    parsed = parse_chunk_header(data, chunk.offset)
    if chunk.length is None or len(data) != chunk.size:
        raise FormatError(f"chunk {chunk.label} is incomplete", offset=chunk.offset)
    if (parsed.type, parsed.length) != (chunk.type, chunk.length):
        raise FormatError(f"chunk {chunk.label} differs from the index", offset=chunk.offset)
    check_crc(chunk, zlib.crc32(memoryview(data)[: -CRC.size]), data[-CRC.size :])
    return data[HEADER.size : -CRC.size]


def check_crc(chunk: Chunk, computed: int, crc: bytes) -> None:
    """Raise ChecksumError if the ``crc`` of a chunk differs from the computed one."""
    (stored,) = CRC.unpack(crc)
    if stored != computed:  # CHUNK-03
        raise ChecksumError(
            f"crc of chunk {chunk.label} is {computed:#010x}, stored is {stored:#010x}",
            offset=chunk.offset,
            value=stored,
        )


def build_foot(index_offset: int, index_length: int) -> bytes:
    rest = struct.pack("<QQ", index_offset, index_length) + END_MAGIC
    return struct.pack("<II", 0, zlib.crc32(bytes(4) + rest)) + rest  # no flags


def parse_foot(data: bytes, offset: int) -> Foot | None:
    """The FOOT whose 32 bytes are ``data``, or None if they are not one.

    Raises ChecksumError if the magic is right and the crc wrong, FormatError for a bad field.
    """
    if len(data) != FOOT.size or data[24:] != END_MAGIC:  # FOOT-03
        return None
    flags, crc, index_offset, index_length, _ = FOOT.unpack(data)
    if crc != zlib.crc32(data[:4] + data[8:]):  # FOOT-02
        raise ChecksumError(
            f"crc of FOOT at {offset} is {crc:#010x}, which is wrong", offset=offset, value=crc
        )
    if flags:  # FOOT-01
        raise FormatError(f"FOOT at {offset}: flags {flags:#x}, but no flag is defined")
    if index_length and (
        index_offset > MAX_COUNT
        or index_length > MAX_COUNT
        or index_offset + index_length != offset  # GRAM-01
    ):
        raise FormatError(
            f"FOOT at {offset}: no index of {index_length} bytes fits at {index_offset}"
        )
    if not index_length and index_offset:
        raise FormatError(f"FOOT at {offset}: index offset {index_offset} without an index")
    return Foot(index_offset, index_length)


def check_signature(source: ByteSource) -> None:
    check_signature_in(source.read(0, min(len(SIGNATURE), source.size)))


def check_signature_in(data: bytes) -> None:
    """Raise FormatError unless ``data`` begins with the signature of a file."""
    if not data:
        raise TruncatedError("the file is empty")
    if data != SIGNATURE[: len(data)]:  # CHUNK-01
        remark = compression_remark(data) or f"it begins with {quote(data)}"
        raise FormatError(f"not an MCZ file: {remark}")
    if len(data) < len(SIGNATURE):
        raise TruncatedError(f"the file ends at {len(data)}, in its signature")


END, SEGMENT, FRAME = 0, 1, 2  # kinds, bits 0 to 3 of the first byte
KIND, FRESH = 0x0F, 0x80  # bits of the first byte: its kind, and that it needs none before it
CHECK_SIZE = 4  # bytes of the check
MOST_SEQUENCE, MOST_LENGTH = 8, 3  # bytes of the varints of a head
MOST_HEAD = 1 + MOST_SEQUENCE + MOST_LENGTH


@dataclass(slots=True)
class Packet:
    """A packet; ``implied`` are bytes that its check covers too, see ``implied_by``."""

    kind: int
    sequence: int
    body: bytes
    fresh: bool = True
    implied: bytes = b""


def implied_by(number: int, mask: bytes) -> bytes:
    """The bytes that a packet of kind 2 implies: the frame's number, and its mask."""
    return struct.pack("<Q", number) + mask


def packet_check(head: bytes, body: bytes, implied: bytes = b"") -> bytes:
    return struct.pack("<I", zlib.crc32(body, zlib.crc32(implied, zlib.crc32(head))))


def _head(kind: int, fresh: bool, sequence: int, length: int) -> bytes:
    return bytes((kind | (FRESH if fresh else 0),)) + varint(sequence) + varint(length)


def build_packet(packet: Packet) -> bytes:
    head = _head(packet.kind, packet.fresh, packet.sequence, len(packet.body))
    return head + packet.body + packet_check(head, packet.body, packet.implied)


def head_size(sequence: int, length: int) -> int:
    """The bytes of a packet before its body of ``length`` bytes."""
    return 1 + len(varint(sequence)) + len(varint(length))


def parse_packet_head(data: bytes | bytearray, at: int, limit: int) -> tuple[int, int, int, int]:
    """The first byte of the packet at ``at``, its sequence, the start and the end of its body.

    Its checksum is not checked. Raises TruncatedError if ``data`` ends in the head, FormatError
    for a bad head, LimitError for a body over ``limit``.
    """
    first = data[at]
    if first & 0x70:  # PACK-08
        raise FormatError(f"packet kind {first:#04x} has reserved bits set")
    if first & KIND > FRAME:  # PACK-09
        raise FormatError(f"packet kind {first & KIND} is unknown")
    try:
        sequence, here = read_varint(data, at + 1)
        length, here = read_varint(data, here)
    except TruncatedError:
        raise
    except FormatError:  # CONV-02, CONV-03
        raise FormatError("a packet has a varint beyond 2^53 - 1, or not shortest") from None
    if length > limit:
        check(f"packet {sequence}", length, limit)
    return first, sequence, here, here + length


def is_packet(data: bytes, packet: Packet) -> bool:
    """Return True if ``data`` ends with ``packet``, with any sequence number."""
    length = len(packet.body)
    body_at = len(data) - CHECK_SIZE - length
    first, ending = _head(packet.kind, packet.fresh, 0, length)[:1], varint(length)
    for size in range(1, MOST_SEQUENCE + 1):
        start = body_at - len(ending) - size - 1
        if start < 0:
            return False
        head = data[start:body_at]
        number = head[1 : 1 + size]
        whole = number[-1] < 0x80 and all(byte >= 0x80 for byte in number[:-1])
        if whole and (head[:1], head[1 + size :]) == (first, ending):
            check_ = packet_check(head, packet.body, packet.implied)
            if check_ == data[body_at + length :]:
                return True
    return False
