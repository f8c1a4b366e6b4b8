"""Packets: the contents of an open DATA chunk.

SPEC.md, "Open DATA and packets", is normative.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mcz.container.limits import check
from mcz.errors import ChecksumError, FormatError
from mcz.schema import take_varint, varint

END, SEGMENT, FRAME, NUMBERED = 0, 1, 2, 3  # kinds, bits 0 to 3 of the first byte
SHORT = (FRAME, NUMBERED)  # kinds with a segment that is not spelled out: one frame, one stream
FRESH = 0x80  # the packet needs none before it
CHECK_SIZE = 2  # bytes of head_check, and of body_check
MOST_NUMBER = 8  # bytes of a sequence number


@dataclass(slots=True)
class Packet:
    """A packet; ``check`` is its body_check where the body alone does not tell it: in kind 3."""

    kind: int
    sequence: int
    body: bytes
    fresh: bool = True
    check: bytes | None = None


def numbered_frame(sequence: int, number: int, body: bytes, *, fresh: bool) -> Packet:
    """A packet of kind 3 with the stored frame ``number``."""
    return Packet(NUMBERED, sequence, body, fresh, body_check(body, number))


def body_check(body: bytes, number: int | None = None) -> bytes:
    """The check of a body; ``number`` is that of the frame in a packet of kind 3."""
    return check16(body if number is None else body + struct.pack("<Q", number))


def check_number(packet: Packet, number: int) -> None:
    """Raise ChecksumError for a packet of kind 3 that is not frame ``number``, or is damaged."""
    if packet.check not in (None, body_check(packet.body, number)):  # INDX-03, PACK-15
        raise ChecksumError(
            f"body_check of packet {packet.sequence} is not that of frame {number}, which is due"
        )


def check16(data: bytes) -> bytes:
    """The check of the head of a packet, and of a body."""
    return struct.pack("<H", zlib.crc32(data) & 0xFFFF)


def _head(kind: int, fresh: bool, sequence: int, length: int) -> bytes:
    return bytes((kind | (FRESH if fresh else 0),)) + varint(sequence) + varint(length)


def build_packet(packet: Packet) -> bytes:
    head = _head(packet.kind, packet.fresh, packet.sequence, len(packet.body))
    check = body_check(packet.body) if packet.check is None else packet.check
    return head + check16(head) + packet.body + check


def head_size(sequence: int, length: int) -> int:
    """The bytes of a packet before its body of ``length`` bytes."""
    return 1 + len(varint(sequence)) + len(varint(length)) + CHECK_SIZE


def is_head(data: bytes, kind: int, fresh: bool, length: int) -> bool:
    """Whether ``data`` ends with the head of such a packet, whatever its number in its chunk."""
    first, ending = _head(kind, fresh, 0, length)[:1], varint(length)
    for size in range(1, MOST_NUMBER + 1):
        start = len(data) - CHECK_SIZE - len(ending) - size - 1
        if start < 0:
            return False
        head = data[start:-CHECK_SIZE]
        number = head[1 : 1 + size]
        whole = number[-1] < 0x80 and all(byte >= 0x80 for byte in number[:-1])
        fits = whole and (head[:1], head[1 + size :]) == (first, ending)
        if fits and check16(head) == data[-CHECK_SIZE:]:
            return True
    return False


def read_packets(read: Callable[[int], bytes], limit: int) -> Iterator[Packet]:
    """The packets of an open DATA up to its end packet, which is not yielded.

    ``read(n)`` returns exactly n bytes or raises TruncatedError. Raises ChecksumError or
    FormatError at the first packet that is damaged or out of order. A packet of kind 3 still has
    to pass ``check_number``.
    """
    sequence = 0
    while True:  # PACK-01
        packet = read_packet(read, limit)
        if packet.sequence != sequence:  # PACK-02
            raise FormatError(f"packet {packet.sequence} where {sequence} is due")
        if packet.kind == END:
            if packet.body:  # PACK-05, PACK-07
                raise FormatError(f"end packet with {len(packet.body)} bytes")
            return
        yield packet
        sequence += 1


def read_packet(read: Callable[[int], bytes], limit: int) -> Packet:
    """One packet, whatever its number; raises as ``read_packets`` does."""
    head = bytearray(read(1))

    def seen() -> int:
        head.extend(read(1))
        return head[-1]

    values = [take_varint(iter(seen, None), "packet") for _ in range(2)]
    if read(2) != check16(bytes(head)):  # PACK-03
        raise ChecksumError(f"head_check of packet {values[0]} is wrong")
    kind = head[0] & 0x0F
    if kind > NUMBERED or head[0] & 0x70:  # PACK-08, PACK-09
        raise FormatError(f"packet {values[0]}: kind {head[0]:#04x}")
    check(f"packet {values[0]}", values[1], limit)
    body = read(values[1])
    stored, fresh = read(CHECK_SIZE), bool(head[0] & FRESH)
    if kind == NUMBERED:
        return Packet(kind, values[0], body, fresh, stored)
    if stored != body_check(body):  # PACK-04, PACK-06
        raise ChecksumError(f"body_check of packet {values[0]} is wrong")
    return Packet(kind, values[0], body, fresh)
