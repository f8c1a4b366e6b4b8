"""Packets: the contents of an open DATA chunk.

SPEC.md, "Open DATA and packets", is normative.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from mcz.container.limits import check
from mcz.errors import FormatError, TruncatedError
from mcz.model.schema import read_varint, varint

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

    Its checksum is not checked. Raises TruncatedError where ``data`` ends in the head, FormatError
    for a bad head, LimitError for a body over ``limit``.
    """
    first = data[at]
    if first & 0x70:  # PACK-08
        raise FormatError(f"a packet with reserved bits, kind {first:#04x}")
    if first & KIND > FRAME:  # PACK-09
        raise FormatError(f"a packet of kind {first & KIND}")
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
    """True where ``data`` ends with such a packet, of any sequence number."""
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
