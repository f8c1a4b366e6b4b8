"""Encodings of chunks, deflate after words among them, and second copies of chunks.

Ids hash the uncompressed payload; a copy makes up for a flipped bit in the original. SPEC.md,
"Conventions", "SKEL", "ATTA" and "COPY", are normative.
"""

from __future__ import annotations

import hashlib
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

from construct import GreedyBytes, If, Int8ul, this

from mcz.container import payloads
from mcz.container.chunks import COPIED, FRAMING, SIGNATURE, Chunk, ChunkType, build_chunk
from mcz.container.directory import AttachmentRow, Directory
from mcz.container.limits import LARGE, Profile, check, check_decoded
from mcz.container.parser_drivers import chunks
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError
from mcz.model.extras import annex_bytes
from mcz.model.schema import (
    EXTENDED,
    TEXT,
    UVARINT,
    Record,
    build,
    deflate,
    field,
    inflate,
    parse,
    parse_all,
)

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


MOST_BYTES = 64 * 1024  # decoded bytes of the copies in one COPY, so that a bad byte costs no more
SMALL_PART = 64  # a model is copied if the file has this many times its bytes


@dataclass(frozen=True, slots=True)
class Copy:
    """A copy of one chunk, from COPY: its offset, type and payload."""

    offset: int
    type: bytes
    payload: bytes

    @property
    def stop(self) -> int:
        return self.offset + FRAMING + len(self.payload)

    @property
    def chunk(self) -> bytes:
        """The original chunk: types that may be copied have no flags."""
        return build_chunk(self.type, self.payload)

    @property
    def label(self) -> str:
        return f"{self.type.decode()} at {self.offset}"


def group_copies(copies: Iterable[Copy]) -> Iterator[list[Copy]]:
    """``copies`` in groups, one for each COPY."""
    run: list[Copy] = []
    size = 0
    for copy in copies:
        size += copy.stop - copy.offset
        if run and size > MOST_BYTES:
            yield run
            run, size = [], copy.stop - copy.offset
        run.append(copy)
    if run:
        yield run


def is_worth_copying(copy: Copy, n_bytes: int) -> bool:
    """Return True if a copy is worthwhile in a file of ``n_bytes``: not one of a large model."""
    return copy.type != ChunkType.MODL or len(copy.payload) * SMALL_PART <= n_bytes


def build_copies(copies: Iterable[Copy], offset: int) -> bytes:
    """The payload of a COPY that will begin at ``offset``."""
    records = (
        payloads.CopiedChunk(distance=offset - copy.offset, type=copy.type, payload=copy.payload)
        for copy in copies
    )
    content = b"".join(build(record, "COPY") for record in records)
    packed = deflate(content)
    flags = payloads.DEFLATED if len(packed) < len(content) else payloads.STORED
    data = packed if flags else content
    return build(payloads.Copy(flags=flags, size=len(content), data=data), "COPY")


def parse_copies(payload: bytes, chunk: Chunk, limit: int) -> list[Copy]:
    """Parse ``payload`` of the COPY ``chunk``; copies decode to at most ``limit`` bytes.

    Raises FormatError if they are not in file order, or not before the COPY.
    """
    fields = parse(payloads.Copy, payload, chunk.label)
    check(f"chunk {chunk.label}: bytes of the copies", fields.size, limit)  # LIMIT-16
    content = decode_data(fields.data, fields.flags, fields.size, chunk.label)
    copies: list[Copy] = []
    end = 0
    for stored in parse_all(payloads.CopiedChunk, content, f"chunk {chunk.label}"):
        if stored.type not in COPIED:  # COPY-01
            raise FormatError(
                f"chunk type {stored.type!r} must not be copied", where=f"chunk {chunk.label}"
            )
        copy = Copy(chunk.offset - stored.distance, stored.type, stored.payload)
        if not end <= copy.offset <= copy.stop <= chunk.offset:  # COPY-03
            raise FormatError(
                f"the copy of {copy.label}, which ends at {copy.stop}, overlaps that of a "
                f"chunk that ends at {end}, or is out of order",
                where=f"chunk {chunk.label}",
            )
        end = copy.stop
        copies.append(copy)
    return copies


def copy_chunks(source: ByteSource, directory: Directory) -> list[Chunk]:
    """The COPY chunks of a file that belong to a clip; without clips all, up to a fault."""
    if directory.clips:
        return directory.clips.ancillary(ChunkType.COPY)
    copies: list[Chunk] = []
    with suppress(FormatError):
        copies.extend(chunk for chunk, _ in chunks(source) if chunk.type == ChunkType.COPY)
    return copies


def find_uncopied(
    source: ByteSource, directory: Directory, payload_of: Callable[[Chunk], bytes]
) -> list[Copy]:
    """Find chunks without copies, those after the last COPY; aliases are not in the directory."""
    copies = copy_chunks(source, directory)
    last = copies[-1].offset if copies else 0
    later = [
        Chunk(ChunkType.HEAD, 0, len(SIGNATURE), len(directory.head)),
        *directory.shared.values(),
    ]
    for name in reversed(directory.clips):  # in file order
        row = directory.clips[name]
        if row.clip.offset < last:
            break
        later += [chunk for chunk in (row.clip, row.cend) if chunk is not None]
    later = sorted((c for c in later if c.offset > last), key=lambda chunk: chunk.offset)
    return [Copy(chunk.offset, chunk.type, payload_of(chunk)) for chunk in later]


def check_copies(
    copies: Sequence[Copy],
    chunk: Chunk,
    before: Sequence[Chunk],
    payload_of: Callable[[Chunk], bytes],
) -> None:
    """Compare the COPY ``chunk`` with the chunks ``before`` it, in file order."""
    for copy in copies:
        at = bisect_left(before, copy.offset, key=lambda other: other.offset)
        original = before[at] if at < len(before) else None
        same = original is not None and (original.offset, original.type) == (copy.offset, copy.type)
        if original is None or not same or payload_of(original) != copy.payload:  # COPY-02
            raise FormatError(f"{copy.label} differs from its copy", where=f"chunk {chunk.label}")
