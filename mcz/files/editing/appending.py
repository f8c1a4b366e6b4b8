"""Growing a file in place: one process at a time, without risk to its contents.

SPEC.md, "FOOT", defines the bytes after the FOOT of a file that grew.
"""

from __future__ import annotations

import builtins
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

from mcz.container import payloads
from mcz.container.chunks import FOOT, SIGNATURE, Chunk, ChunkType, read_payload
from mcz.container.locks import lock
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import (
    AccessError,
    FormatError,
    LimitError,
    TruncatedError,
    UnsupportedError,
    reason_of,
)
from mcz.model.schema import parse

IN_MEMORY = 1 << 26  # bytes of an addition; a longer one is kept in a file next to the target
BLOCK = 1 << 20


@dataclass(frozen=True, slots=True)
class Tail:
    """Names of intact things after the last FOOT of a truncated file.

    ``kept`` is True if the file continues after them, False if it replaces them.
    """

    names: tuple[str, ...] = ()
    kept: bool = False


@dataclass(frozen=True, slots=True)
class Growth:
    """A file that is about to grow: bytes written to ``added`` will follow ``container``."""

    container: Container
    added: BinaryIO
    tail: Tail


@contextmanager
def growing(path: Path, *, salvage: bool, force: bool) -> Iterator[Growth]:
    """Append the output of the block after the last valid FOOT, over any truncated part.

    Where intact clips, skeletons or attachments follow that FOOT, ``salvage`` keeps them and
    ``force`` drops them; otherwise a FormatError names them. If the end of the file is damaged, not
    just truncated, one of the two is required. If the block fails, the file is unchanged; if
    writing fails, it ends at its old end, or at that FOOT. Raises AccessError where another process
    is appending to the file.
    """
    try:
        stream = builtins.open(path, "r+b", buffering=0)  # noqa: SIM115 - closed by the with below
    except (OSError, ValueError) as error:
        raise AccessError(reason_of(error), path=path) from None
    with stream:
        if not lock(stream):
            raise AccessError("another process is appending to it", path=path)
        container, tail = _whole_part(stream, path, salvage, force)
        end = container.directory.end  # the writer moves it
        with tempfile.SpooledTemporaryFile(IN_MEMORY, dir=str(path.parent)) as added:
            yield Growth(container, cast(BinaryIO, added), tail)
            _check_not_replaced(stream, path)
            _write_at(stream, end, cast(BinaryIO, added))


def _check_not_replaced(stream: BinaryIO, path: Path) -> None:
    try:
        same = os.path.samestat(os.fstat(stream.fileno()), path.stat())
    except OSError:
        same = False
    if not same:
        raise AccessError("it was replaced by another file while its addition was coded", path=path)


def _write_at(stream: BinaryIO, end: int, added: BinaryIO) -> None:
    """Write ``added`` at ``end``; if that fails the file is restored to that end."""
    try:
        stream.seek(end)
        added.seek(0)
        while block := memoryview(added.read(BLOCK)):
            at = 0
            while at < len(block):
                at += stream.write(block[at:])
        stream.truncate()
        os.fsync(stream.fileno())
    except BaseException:
        stream.truncate(end)
        os.fsync(stream.fileno())
        raise


def _whole_part(stream: BinaryIO, path: Path, salvage: bool, force: bool) -> tuple[Container, Tail]:
    """The part of the file that stays, and the rest of it."""

    def up_to(end: int, salvage: bool = False) -> Container:
        return Container(ByteSource(stream, name=str(path), size=end), salvage=salvage)

    size = stream.seek(0, os.SEEK_END)
    try:
        return up_to(size), Tail()
    except FormatError as error:
        reason = error
    if isinstance(reason, TruncatedError):
        foot = reason.last_foot
    elif isinstance(reason, UnsupportedError | LimitError) or not (salvage or force):
        raise reason  # its end is damaged, not just truncated: continuing from before needs consent
    else:
        feet = scan(ByteSource(stream), salvage=True).feet
        foot = feet[-1] + FOOT.size if feet else None
    end = _whole_until(ByteSource(stream), foot or 0)
    longer = up_to(end, salvage=True) if end > (foot or len(SIGNATURE)) else None
    shorter = up_to(foot) if foot else None
    names = _restorable_names(longer) - _restorable_names(shorter)
    if not names or not (salvage or force):
        if shorter is None:
            raise reason
        if names:
            raise FormatError(
                f"its writing was cut short; after the last FOOT, which ends at {foot}, these "
                f"are whole: {', '.join(sorted(names))}; salvage keeps them, force drops them"
            )
        return shorter, Tail()
    if longer is not None and salvage:
        longer.directory.end = end
        return longer, Tail(tuple(sorted(names)), kept=True)
    if shorter is None:
        raise reason
    return shorter, Tail(tuple(sorted(names)))


def _restorable_names(container: Container | None) -> set[str]:
    if container is None:
        return set()
    rows = container.directory
    return {*rows.clips, *rows.attachments, *rows.aliases}


def _whole_until(source: ByteSource, start: int) -> int:
    """End of the last intact thing after ``start``, up to the first fault."""
    end = at = start or len(SIGNATURE)
    inside = False
    scanned = scan(source, salvage=True)
    for chunk in scanned.chunks:
        if chunk.offset < start:
            continue
        if chunk.offset != at or chunk.type == ChunkType.INDX:
            break  # an INDX belongs to its FOOT
        at = scanned.ends[at] if chunk.length is None else at + chunk.size
        inside = chunk.type == ChunkType.CLIP or (inside and chunk.type != ChunkType.CEND)
        if not inside and _is_last_part(source, chunk):
            end = at
    return end


def _is_last_part(source: ByteSource, chunk: Chunk) -> bool:
    """Return True if ``chunk`` ends a thing: of an attachment only the last part does."""
    if chunk.type != ChunkType.ATTA:
        return True
    fields = parse(payloads.Atta, read_payload(source, chunk, chunk.size), chunk.label)
    return bool(fields.part + 1 == fields.n_parts)
