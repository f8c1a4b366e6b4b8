"""Second copies of chunks in a file, so that a flipped bit in the first costs nothing.

SPEC.md, "COPY", is normative.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from mcz.container import payloads
from mcz.container.chunks import COPIED, FRAMING, SIGNATURE, Chunk, ChunkType, build_chunk
from mcz.container.dictionary_deflate import decode_data
from mcz.container.directory import Directory
from mcz.container.limits import check
from mcz.container.parser_drivers import chunks
from mcz.container.source import ByteSource
from mcz.errors import FormatError
from mcz.model.schema import build, deflate, parse, parse_all

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
    """The copies in ``payload``, of the COPY ``chunk``; they decode to ``limit`` at most.

    Raises FormatError where they are not in file order, or not before the COPY.
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
    """Copies of the chunks after the last COPY of a file; of aliases the directory has none."""
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
        there = before[at] if at < len(before) else None
        same = there is not None and (there.offset, there.type) == (copy.offset, copy.type)
        if there is None or not same or payload_of(there) != copy.payload:  # COPY-02
            raise FormatError(f"{copy.label} differs from its copy", where=f"chunk {chunk.label}")
