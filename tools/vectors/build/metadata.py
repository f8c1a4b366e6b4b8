"""META payloads of records, checked or not."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.container import payloads
from mcz.container.encodings import words
from mcz.container.metadata import Record, record_bytes
from mcz.model.schema import deflate
from tools.records import build_record


def content_of(records: Sequence[Record]) -> bytes:
    """The records of a META, decoded; nothing is checked."""
    return b"".join(map(record_bytes, records))


def meta_of(records: Sequence[Record], *, stored: bool = False, after: bool = False) -> bytes:
    """The payload of a META; ``after``: deflated after the words of the annex."""
    return payload_of(content_of(records), stored=stored, after=after)


def payload_of(
    content: bytes, *, size: int | None = None, stored: bool = False, after: bool = False
) -> bytes:
    """The payload of a META with ``content``; ``size`` is what it says that there is."""
    data = content if stored else deflate(content, words=words() if after else b"")
    encoding = 0 if stored else 2 if after else 1
    fields = {
        "flags": encoding,
        "size": len(content) if size is None else size,
        "data": data,
    }
    return build_record(payloads.Meta, fields, "META")
