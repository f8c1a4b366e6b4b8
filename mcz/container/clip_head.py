"""What CLIP and CEND begin with, read by hand: who looks through an archive wants no more.

SPEC.md, "CLIP" and "CEND", are normative; a test compares this with their schemas.
"""

from __future__ import annotations

from dataclasses import dataclass

from mcz.container.cursor import Cursor
from mcz.errors import FormatError


@dataclass(frozen=True, slots=True)
class ClipHead:
    """The name of a clip, its metadata, and its source: ids and words, nothing restored.

    ``template`` is the id of the SRCE, empty without a source; ``path`` may be empty.
    """

    name: str
    skeleton: bytes
    metadata: dict[str, str]
    template: bytes = b""
    format: int = 0
    path: str = ""
    size: int = 0


def clip_head(payload: bytes, where: str) -> ClipHead:
    """The head of the CLIP ``payload``; raises FormatError."""
    read = Cursor(payload, where)
    name, _, skeleton = read.text(), read.take(1), read.take(16)
    for _ in ("n_frames", "rate_numerator", "rate_denominator"):
        read.varint()
    metadata = {read.text(): read.text() for _ in range(read.varint())}
    if not _one(read, "source"):
        return ClipHead(name, skeleton, metadata)
    template, source_format = read.take(16), read.take(1)[0]
    read.sized()  # the detail
    return ClipHead(name, skeleton, metadata, template, source_format, read.text(), read.varint())


def source_sha256(payload: bytes, where: str) -> bytes:
    """The hash of the source file in the CEND ``payload``, empty without one."""
    read = Cursor(payload, where)
    read.varint()
    return read.take(32) if _one(read, "source_sha256") else b""


def _one(read: Cursor, what: str) -> bool:
    count = read.varint()
    if count > 1:  # CONV-07
        raise FormatError(f"{read.where}: {what}: {count}, not 0 or 1")
    return bool(count)
