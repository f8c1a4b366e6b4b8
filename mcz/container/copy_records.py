"""The records of COPY. SPEC.md, "COPY", has their tables."""

from __future__ import annotations

from construct import GreedyBytes

from mcz.container.payloads import ENCODED, encoding_flags
from mcz.schema import SIZED, SIZED_EXTENSION, UVARINT, Exactly, Record, field


class Copy(Record):
    """COPY, copies of small chunks."""

    flags: int = field(encoding_flags(), ENCODED, default=0)
    size: int = field(UVARINT, "bytes of the copies, decoded")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "the copies, encoded")


class CopiedChunk(Record):
    """A copy in the decoded data of COPY."""

    distance: int = field(UVARINT, "bytes from where the chunk begins to where this COPY begins")
    type: bytes = field(Exactly(4), "its type")
    payload: bytes = field(SIZED, "its payload")
