"""The packets of a RECV: each says what it belongs to, so that any of them is found by itself."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import construct
from construct import Int8ul, Int32ul, Int64ul

from mcz.container.recovery.layout import HASH, HEAD, Shape
from mcz.container.source import ByteSource
from mcz.errors import FormatError, LimitError
from mcz.model.schema import Exactly, Record, bounded, build, field, parse_until

MAGIC = b"\x89RCV\r\n\x1a\n"
WINDOW = 1 << 22
BODY_AT = HEAD - HASH  # offset of the body in a packet


def body_size(packet: RecvPacket) -> int:
    """Bytes of the body of a packet; raises FormatError or LimitError."""
    shape = shape_of(packet)
    return shape.block_size if packet.kind else shape.section_size


def shape_of(packet: RecvPacket) -> Shape:
    """The sizes that a packet states; raises FormatError or LimitError."""
    sizes = packet.start, packet.a_size, packet.t_size, packet.block_size, packet.n_recovery
    return Shape(*sizes)


class RecvPacket(Record):
    """A packet of RECV, its body and the check behind that included."""

    magic: bytes = field(construct.Const(MAGIC), "`89 52 43 56 0D 0A 1A 0A`", default=MAGIC)
    kind: int = field(bounded(Int8ul, 0, 1), "0 section of the table, 1 recovery block")
    set: bytes = field(Exactly(16), "first 16 bytes of the SHA-256 of the stream")
    start: int = field(Int64ul, "offset in the file of the first byte that is protected")
    a_size: int = field(Int64ul, "bytes that are protected before the RECV")
    t_size: int = field(Int64ul, "bytes that are protected behind the RECV")
    block_size: int = field(Int32ul, "bytes of a block, a multiple of 8")
    n_recovery: int = field(Int32ul, "recovery blocks")
    index: int = field(Int32ul, "which section or recovery block this is, from 0")
    body: bytes = field(Exactly(body_size), "the section or block, of the size that follows")
    check: bytes = field(Exactly(HASH), "first 8 bytes of the SHA-256 of all before in the packet")


class Key(NamedTuple):
    """Common fields of the packets of one RECV."""

    set_id: bytes
    shape: Shape


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet as it was found at ``offset``, which need not be its place."""

    kind: int
    index: int
    body: bytes
    offset: int


def short_hash(data: bytes | memoryview) -> bytes:
    return hashlib.sha256(data).digest()[:HASH]


def build_packet(key: Key, kind: int, index: int, body: bytes) -> bytes:
    """The bytes of a packet."""
    s = key.shape
    packet = RecvPacket(
        kind=kind,
        set=key.set_id,
        start=s.start,
        a_size=s.a_size,
        t_size=s.t_size,
        block_size=s.block_size,
        n_recovery=s.n_recovery,
        index=index,
        body=body,
        check=bytes(HASH),
    )
    data = build(packet, "RECV")[:-HASH]
    return data + short_hash(data)


def read_packet(source: ByteSource, offset: int) -> tuple[Key, Packet] | None:
    """The packet at ``offset``, or None where there is no whole one."""
    try:
        head = parse_until(RecvPacket, source.read(offset, BODY_AT), "RECV", "body")
        shape, size = shape_of(head), body_size(head)
    except (FormatError, LimitError):
        return None
    if offset + HEAD + size > source.size:
        return None
    data = source.read(offset, HEAD + size)
    if short_hash(memoryview(data)[:-HASH]) != data[-HASH:]:
        return None
    return Key(head.set, shape), Packet(head.kind, head.index, data[BODY_AT:-HASH], offset)


def find_packets(source: ByteSource) -> Iterator[tuple[Key, Packet]]:
    """Every whole packet of a file, wherever it lies and whatever else is there."""
    mark = re.compile(re.escape(MAGIC))
    start = 0
    while start < source.size:
        data = source.read(start, min(WINDOW + len(MAGIC) - 1, source.size - start))
        for match in mark.finditer(data):
            found = read_packet(source, start + match.start())
            if found is not None:
                yield found
        start += WINDOW
