"""Encodings of chunks, deflate after words among them; ids hash the uncompressed payload.

SPEC.md, "Conventions", "SKEL" and "ATTA", are normative.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache

from construct import GreedyBytes, If, Int8ul, this

from mcz.container import payloads
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.directory import AttachmentRow
from mcz.container.limits import LARGE, Profile, check, check_decoded
from mcz.errors import ChecksumError, FormatError
from mcz.model.extras import annex_bytes
from mcz.model.schema import EXTENDED, TEXT, UVARINT, Record, build, deflate, field, inflate, parse

PACKED = 2  # bit 1 of the flags of SKEL


@cache
def words() -> bytes:
    """The annex that serves as a dictionary of deflate."""
    return annex_bytes("words.bin")


def encode_smallest(data: bytes, *, short: bool, plain: bool = False) -> tuple[int, bytes]:
    """The encoding of SRCE, ATTA and META and its bytes; ``short``: also after words.

    ``plain``: stored.
    """
    if plain:
        return payloads.STORED, data
    encodings = [(payloads.STORED, data), (payloads.DEFLATED, deflate(data))]
    if short:
        encodings.append((payloads.AFTER_WORDS, deflate(data, words=words())))
    return min(encodings, key=lambda row: len(row[1]))


def decode_data(data: bytes, flags: int, size: int, where: str) -> bytes:
    """The ``size`` bytes that SRCE, ATTA, COPY and META store as ``data``."""
    encoding = flags & payloads.ENCODING
    if encoding == payloads.STORED:
        if len(data) != size:  # ATTA-03, SRCE-01
            raise FormatError(
                f"{len(data)} bytes are stored, but the stated size is {size}", where=where
            )
        return bytes(data)
    after = words() if encoding == payloads.AFTER_WORDS else b""
    return inflate(data, size, where, words=after)


def plain_payload(
    kind: bytes, payload: bytes, where: str, profile: Profile, most: int | None = None
) -> bytes:
    """The equivalent uncompressed payload of a SKEL, MODL or SRCE.

    ``most``: greatest decoded size of a template. Raises FormatError.
    """
    if kind == ChunkType.SKEL:
        return unpack_skeleton(payload, where, profile)
    if kind != ChunkType.SRCE:
        return payload
    fields = parse(payloads.Srce, payload, where)
    check(f"{where}: bytes", fields.size, profile.text_bytes)
    if most is not None:
        check_decoded(where, fields.size, most)
    template = decode_data(fields.data, fields.flags, fields.size, where)
    if not fields.flags & payloads.ENCODING:
        return payload
    return build(replace(fields, flags=fields.flags & EXTENDED, data=template), where)


def plain_id(kind: bytes, plain: bytes) -> bytes:
    """The id of a chunk with this uncompressed payload."""
    return hashlib.sha256(kind + plain).digest()[:16]


def chunk_id(kind: bytes, payload: bytes, profile: Profile = LARGE) -> bytes:
    """The id of a SKEL, MODL or SRCE; raises FormatError if it cannot be inflated."""
    return plain_id(kind, plain_payload(kind, payload, kind.decode(), profile))


class PackedSkel(Record):
    """SKEL up to its flags, and the rest, perhaps packed."""

    name: str = field(TEXT, "name of the skeleton")
    flags: int = field(Int8ul, "bit 1: packed")
    size: int | None = field(If(this.flags & PACKED, UVARINT), "bytes of the rest", default=None)
    rest: bytes = field(GreedyBytes, "the other fields of SKEL")


def pack_skeleton(payload: bytes) -> bytes:
    """The payload of a SKEL with its fields packed, if that is shorter."""
    plain = parse(PackedSkel, payload, "SKEL")
    flags, data = plain.flags | PACKED, deflate(plain.rest, words=words())
    packed = PackedSkel(name=plain.name, flags=flags, size=len(plain.rest), rest=data)
    return min(payload, build(packed, "SKEL"), key=len)


def is_packed(payload: bytes, where: str) -> bool:
    return parse(PackedSkel, payload, where).size is not None


def unpack_skeleton(payload: bytes, where: str, profile: Profile) -> bytes:
    """The payload of a SKEL without packing."""
    packed = parse(PackedSkel, payload, where)
    if packed.size is None:
        return payload
    check(f"{where}: bytes", packed.size, profile.text_bytes)  # SKEL-09
    rest = inflate(packed.rest, packed.size, where, words=words())
    return build(PackedSkel(name=packed.name, flags=packed.flags & ~PACKED, rest=rest), where)


def parse_skel(payload: bytes, where: str, profile: Profile) -> payloads.Skel:
    """The fields of SKEL, packed or not."""
    return parse(payloads.Skel, unpack_skeleton(payload, where, profile), where, profile.counts)


def join_parts(row: AttachmentRow, payload_of: Callable[[Chunk], bytes]) -> bytes:
    """The bytes of an attached file, its hash checked; ``payload_of`` reads one part."""
    parts = []
    left, digest = row.size, b""
    for number, chunk in enumerate(row.parts):
        fields = parse(payloads.Atta, payload_of(chunk), chunk.label)
        expected = (row.name, number, len(row.parts), row.size)
        # ATTA-01, ATTA-02
        if (fields.name, fields.part, fields.n_parts, fields.size) != expected:
            raise FormatError(
                f"expected part {number} of {row.name!r}", where=f"chunk {chunk.label}"
            )
        if digest not in (b"", fields.sha256):  # ATTA-02
            raise FormatError(
                "the hash differs from that of the previous part", where=f"chunk {chunk.label}"
            )
        if fields.part_size > left:  # ATTA-03
            raise FormatError(
                f"the parts exceed the stated size of {row.size} bytes",
                where=f"chunk {chunk.label}",
            )
        parts.append(decode_data(fields.data, fields.flags, fields.part_size, chunk.label))
        left, digest = left - fields.part_size, fields.sha256  # ATTA-03
    data = b"".join(parts)
    if left or hashlib.sha256(data).digest() != digest:  # ATTA-04, ATTA-05
        raise ChecksumError(
            f"attachment {row.name!r}: hash or size of its {len(data)} bytes is wrong"
        )
    return data
