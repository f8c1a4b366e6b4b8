"""An attached file put together of its parts.

SPEC.md, "ATTA", is normative.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from mcz.container import payloads
from mcz.container.chunks import Chunk
from mcz.container.dictionary_deflate import decoded
from mcz.container.directory import AttachmentRow
from mcz.errors import ChecksumError, FormatError
from mcz.model.schema import parse


def joined_parts(row: AttachmentRow, payload_of: Callable[[Chunk], bytes]) -> bytes:
    """The bytes of an attached file, its hash checked; ``payload_of`` reads one part."""
    parts = []
    left, digest = row.size, b""
    for number, chunk in enumerate(row.parts):
        fields = parse(payloads.Atta, payload_of(chunk), chunk.label)
        expected = (row.name, number, len(row.parts), row.size)
        # ATTA-01, ATTA-02
        if (fields.name, fields.part, fields.n_parts, fields.size) != expected:
            raise FormatError(f"not part {number} of {row.name!r}", where=f"chunk {chunk.label}")
        if digest not in (b"", fields.sha256):  # ATTA-02
            raise FormatError("another hash than in the part before", where=f"chunk {chunk.label}")
        if fields.part_size > left:  # ATTA-03
            raise FormatError(
                f"more than the {row.size} bytes of the file", where=f"chunk {chunk.label}"
            )
        parts.append(decoded(fields.data, fields.flags, fields.part_size, chunk.label))
        left, digest = left - fields.part_size, fields.sha256  # ATTA-03
    data = b"".join(parts)
    if left or hashlib.sha256(data).digest() != digest:  # ATTA-04, ATTA-05
        raise ChecksumError(f"attachment {row.name!r}: {len(data)} bytes, hash or size is wrong")
    return data
