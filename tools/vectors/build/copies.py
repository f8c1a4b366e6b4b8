"""COPY chunks made to order."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.container import payloads
from mcz.container.chunks import COPIED, HEADER, SIGNATURE, parse_chunk_header
from mcz.container.encodings import Copy
from mcz.model.schema import deflate, varint
from tools.records import build_record
from tools.vectors.build.files import Crafter


def copies_of(crafter: Crafter, start: int = len(SIGNATURE)) -> list[Copy]:
    """Copies of those chunks that ``crafter`` wrote after ``start`` and that may be copied."""
    data, at, found = crafter.data, start, []
    while at < len(data):
        chunk = parse_chunk_header(data[at : at + HEADER.size], at)
        if chunk.type in COPIED:
            payload = data[chunk.payload_offset :][: chunk.length]
            found.append(Copy(at, chunk.type, payload))
        at += chunk.size
    return found


def content_of(copies: Sequence[Copy], offset: int) -> bytes:
    """The copies, decoded, of a COPY at ``offset``; nothing is checked."""
    return b"".join(
        varint(offset - copy.offset) + copy.type + varint(len(copy.payload)) + copy.payload
        for copy in copies
    )


def payload_of(content: bytes, *, size: int | None = None, stored: bool = False) -> bytes:
    """The payload of a COPY; ``size`` is what it says that there is."""
    data = content if stored else deflate(content)
    stated = len(content) if size is None else size
    fields = {"flags": int(not stored), "size": stated, "data": data}
    return build_record(payloads.Copy, fields, "COPY")
