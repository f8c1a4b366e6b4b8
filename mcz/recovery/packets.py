"""The packets of a RECV: each says what it belongs to, so that any of them is found by itself."""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from mcz.container.source import ByteSource
from mcz.errors import FormatError, LimitError
from mcz.recovery.shape import HASH, HEAD, Shape

MAGIC = b"\x89RCV\r\n\x1a\n"
FIELDS = struct.Struct("<8sB16sQQQIII")  # magic, kind, set, the five sizes of Shape, index
WINDOW = 1 << 22

# Each packet of a RECV: (name, type, meaning).
RECV_PACKET_FIELDS = (
    ("magic", "8 bytes", "`89 52 43 56 0D 0A 1A 0A`"),
    ("kind", "u8", "0 section of the table, 1 recovery block"),
    ("set", "16 bytes", "first 16 bytes of the SHA-256 of the stream"),
    ("start", "u64", "offset in the file of the first byte that is protected"),
    ("a_size", "u64", "bytes that are protected before the RECV"),
    ("t_size", "u64", "bytes that are protected behind the RECV"),
    ("block_size", "u32", "bytes of a block, a multiple of 8"),
    ("n_recovery", "u32", "recovery blocks"),
    ("index", "u32", "which section or recovery block this is, from 0"),
    ("body", "bytes", "the section or block, of the size that follows"),
    ("check", "8 bytes", "first 8 bytes of the SHA-256 of all before in the packet"),
)


class Key(NamedTuple):
    """What the packets of one RECV have in common."""

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
    s = key.shape
    sizes = s.start, s.a_size, s.t_size, s.block_size, s.n_recovery
    data = FIELDS.pack(MAGIC, kind, key.set_id, *sizes, index) + body
    return data + short_hash(data)


def read_packet(source: ByteSource, offset: int) -> tuple[Key, Packet] | None:
    """The packet at ``offset``, or None where there is no whole one."""
    if offset + HEAD > source.size:
        return None
    magic, kind, set_id, *sizes, index = FIELDS.unpack(source.read(offset, FIELDS.size))
    try:
        key = Key(set_id, Shape(*sizes))
    except (FormatError, LimitError):
        return None
    size = key.shape.block_size if kind else key.shape.section_size
    if magic != MAGIC or kind > 1 or offset + HEAD + size > source.size:
        return None
    data = source.read(offset, HEAD + size)
    if short_hash(memoryview(data)[:-HASH]) != data[-HASH:]:
        return None
    return key, Packet(kind, index, data[FIELDS.size : -HASH], offset)


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
