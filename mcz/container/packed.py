"""Encodings of chunks, deflate after words among them; ids are of what they say uncompressed.

SPEC.md, "Conventions" and "SKEL", is normative.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache

from mcz.annexes import annex_bytes
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.limits import LARGE, Profile, check, check_decoded
from mcz.errors import FormatError
from mcz.schema import EXTENDED, build, deflate, inflate, parse, read_varint, varint

PACKED = 2  # bit 1 of the flags of SKEL


@cache
def words() -> bytes:
    """The annex to which distances may reach back."""
    return annex_bytes("words.bin")


def smallest(data: bytes, *, short: bool, plain: bool = False) -> tuple[int, bytes]:
    """The encoding of SRCE, ATTA and META and its bytes; ``short``: also after words.

    ``plain``: stored.
    """
    if plain:
        return payloads.STORED, data
    found = [(payloads.STORED, data), (payloads.DEFLATED, deflate(data))]
    if short:
        found.append((payloads.AFTER_WORDS, deflate(data, words=words())))
    return min(found, key=lambda row: len(row[1]))


def decoded(data: bytes, flags: int, size: int, where: str) -> bytes:
    """The ``size`` bytes that SRCE, ATTA, COPY and META hold as ``data``."""
    encoding = flags & payloads.ENCODING
    if encoding == payloads.STORED:
        if len(data) != size:  # ATTA-03, SRCE-01
            raise FormatError(f"{len(data)} bytes stored, {size} stated", where=where)
        return bytes(data)
    after = words() if encoding == payloads.AFTER_WORDS else b""
    return inflate(data, size, where, words=after)


def plain_payload(
    kind: bytes, payload: bytes, where: str, profile: Profile, most: int | None = None
) -> bytes:
    """The payload of a SKEL, MODL or SRCE that says the same uncompressed.

    ``most``: the bytes that a template may decode to. Raises FormatError.
    """
    if kind == ChunkType.SKEL:
        return unpacked(payload, where, profile)
    if kind != ChunkType.SRCE:
        return payload
    fields = parse(payloads.Srce, payload, where)
    check(f"{where}: bytes", fields.size, profile.text_bytes)
    if most is not None:
        check_decoded(where, fields.size, most)
    template = decoded(fields.data, fields.flags, fields.size, where)
    if not fields.flags & payloads.ENCODING:
        return payload
    return build(replace(fields, flags=fields.flags & EXTENDED, data=template), where)


def plain_id(kind: bytes, plain: bytes) -> bytes:
    """The id of a chunk with this payload, which is not compressed."""
    return hashlib.sha256(kind + plain).digest()[:16]


def chunk_id(kind: bytes, payload: bytes, profile: Profile = LARGE) -> bytes:
    """The id of a SKEL, MODL or SRCE; raises FormatError where it cannot be inflated."""
    return plain_id(kind, plain_payload(kind, payload, kind.decode(), profile))


def pack_skeleton(payload: bytes) -> bytes:
    """The payload of a SKEL with its fields packed, where that is shorter."""
    at = _flags_at(payload, "SKEL")
    rest = payload[at + 1 :]
    flags = bytes((payload[at] | PACKED,))
    packed = payload[:at] + flags + varint(len(rest)) + deflate(rest, words=words())
    return min(payload, packed, key=len)


def is_packed(payload: bytes, where: str) -> bool:
    """Whether the fields of a SKEL are packed."""
    at = _flags_at(payload, where)
    return at < len(payload) and bool(payload[at] & PACKED)


def unpacked(payload: bytes, where: str, profile: Profile) -> bytes:
    """The payload of a SKEL without packing; one that was never packed as it is."""
    if not is_packed(payload, where):
        return payload
    at = _flags_at(payload, where)
    try:
        size, start = read_varint(payload, at + 1)
    except FormatError as error:
        error.add(where=where)
        raise
    check(f"{where}: bytes", size, profile.text_bytes)  # SKEL-09
    rest = inflate(payload[start:], size, where, words=words())
    return payload[:at] + bytes((payload[at] & ~PACKED,)) + rest


def parse_skel(payload: bytes, where: str, profile: Profile) -> payloads.Skel:
    """The fields of SKEL, packed or not."""
    return parse(payloads.Skel, unpacked(payload, where, profile), where, profile.counts)


def _flags_at(payload: bytes, where: str) -> int:
    """Where the flags are, behind the name; what is beyond the end ``parse`` will refuse."""
    try:
        length, at = read_varint(payload, 0)
    except FormatError as error:
        raise FormatError(f"name: {error}", where=where) from None
    return at + length
