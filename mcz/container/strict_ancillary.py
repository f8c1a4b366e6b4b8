"""What a reader of the whole file checks of the ancillary chunks that it knows.

SPEC.md, "QUAL", "META" and "COPY", are normative.
"""

from __future__ import annotations

from collections.abc import Callable

from mcz.container import payloads
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.copies import check_copies, parse_copies
from mcz.container.directory import Found
from mcz.container.metadata import parse_meta
from mcz.errors import FormatError
from mcz.schema import parse


def check_ancillary(
    chunk: Chunk,
    payload: bytes,
    file_bytes: int,
    found: Found,
    payload_of: Callable[[Chunk], bytes] | None,
) -> None:
    """Check ``chunk`` of a file of ``file_bytes``; ``found`` lies before it. Raises FormatError.

    Without ``payload_of``, which reads that again, copies are not compared with it.
    """
    if chunk.type == ChunkType.QUAL:
        parse(payloads.Qual, payload, chunk.label)  # QUAL-02
    elif chunk.type == ChunkType.META:
        if not found.directory.clips:  # META-01
            raise FormatError(f"chunk {chunk.label} lies before the first clip")
        parse_meta(payload, chunk, file_bytes)
    elif chunk.type == ChunkType.COPY:
        copies = parse_copies(payload, chunk, file_bytes)
        if payload_of is not None:
            check_copies(copies, chunk, found.chunks, payload_of)
