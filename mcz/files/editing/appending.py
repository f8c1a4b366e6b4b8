"""Growing a file in place: one process at a time, without risk to its contents.

Recovery data are appended, too. SPEC.md, "FOOT" and "RECV", are normative;
``mcz/container/recovery`` has the code of the latter.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

from mcz.container import payloads
from mcz.container.chunks import (
    CRC,
    FOOT,
    SIGNATURE,
    Chunk,
    ChunkFlag,
    ChunkType,
    build_foot,
    build_header,
    read_payload,
)
from mcz.container.directory import Directory
from mcz.container.index import build_index
from mcz.container.reader import Container
from mcz.container.recovery import Shape, Step, encode_packets, protected_shapes, shape_for
from mcz.container.scan import scan
from mcz.container.source import ByteSource, locked_file
from mcz.errors import (
    AccessError,
    FormatError,
    LimitError,
    OptionError,
    TruncatedError,
    UnsupportedError,
)
from mcz.model.schema import parse
from mcz.model.text_format import fields_text

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
def append_at_end(path: Path, *, salvage: bool, force: bool) -> Iterator[Growth]:
    """Append the output of the block after the last valid FOOT, over any truncated part.

    Where intact clips, skeletons or attachments follow that FOOT, ``salvage`` keeps them and
    ``force`` drops them; otherwise a FormatError names them. If the end of the file is damaged, not
    just truncated, one of the two is required. If the block fails, the file is unchanged; if
    writing fails, it ends at its old end, or at that FOOT. Raises AccessError if another process
    is appending to the file.
    """
    with locked_file(path) as stream:
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
        raise AccessError("another file replaced it while the addition was encoded", path=path)


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
                "an earlier write was interrupted; these clips are complete after the last "
                f"FOOT, which ends at {foot}: {', '.join(sorted(names))}; salvage keeps them, "
                "force drops them"
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
    """End of the last intact item after ``start``, up to the first fault."""
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
    """Return True if ``chunk`` ends an item, such as the last part of an attachment."""
    if chunk.type != ChunkType.ATTA:
        return True
    fields = parse(payloads.Atta, read_payload(source, chunk, chunk.size), chunk.label)
    return bool(fields.part + 1 == fields.n_parts)


DEFAULT = 0.05  # redundancy
TRIES = 16  # to find the size of an index that contains the size of its own chunk


@dataclass(frozen=True, slots=True)
class Protection:
    """Strength of recovery data: any ``n_recovery`` of ``n_blocks`` blocks may be bad.

    So may any run of ``burst`` bytes. ``start`` and ``stop``: the protected bytes of the file;
    ``cost``: size of the recovery data.
    """

    start: int
    stop: int
    n_blocks: int
    block_size: int
    n_recovery: int
    burst: int
    cost: int

    __repr__ = fields_text


def add_recovery(
    target: str | os.PathLike[str], redundancy: float, progress: Step | None = None
) -> list[Protection]:
    """Append recovery data for unprotected bytes; returns all of the file, in file order."""
    with append_at_end(Path(target), salvage=False, force=False) as growth:
        protected = [protection_of(shape) for shape in protected_shapes(growth.container)]
        start, end = protected[-1].stop if protected else 0, growth.container.directory.end
        if start < end:
            shape = write_recovery(growth.container, growth.added, start, redundancy, progress)
            protected.append(protection_of(shape))
    return protected


def protect_written(stream: BinaryIO, redundancy: float, progress: Step | None = None) -> Shape:
    """Write recovery data after the file in ``stream``, before that gets its name."""
    stream.flush()
    container = Container(ByteSource(stream))
    with tempfile.SpooledTemporaryFile(
        IN_MEMORY
    ) as added:  # the stream is read while it is written
        shape = write_recovery(container, cast(BinaryIO, added), 0, redundancy, progress)
        added.seek(0)
        stream.seek(0, os.SEEK_END)
        shutil.copyfileobj(added, stream)
    return shape


def still_protect(target: str | os.PathLike[str], redundancy: float | None) -> bool:
    """Protect bytes appended to a protected file likewise; return whether it was protected."""
    if redundancy is not None:
        add_recovery(target, redundancy)
    return redundancy is not None


def protection_of(shape: Shape) -> Protection:
    sizes = shape.n_blocks, shape.block_size, shape.n_recovery, shape.burst
    return Protection(shape.start, shape.stop, *sizes, shape.chunk_size)


def redundancy_of(container: Container) -> float | None:
    """Redundancy of a file's greatest protected part; None for an unprotected file."""
    greatest = max(protected_shapes(container), key=lambda shape: shape.size, default=None)
    return None if greatest is None else min(1.0, greatest.n_recovery / greatest.n_blocks)


def write_recovery(
    container: Container, added: BinaryIO, start: int, redundancy: float, step: Step | None
) -> Shape:
    """Write RECV, INDX and FOOT after the end of a file, for its bytes from ``start`` on."""
    directory, end = container.directory, container.directory.end
    shape, tail = _settle(directory, start, end, redundancy)

    def read(offset: int, size: int) -> bytes:
        at = offset - shape.stop + len(tail)  # in the bytes that will follow
        return container.source.read(offset, size) if at < 0 else tail[at : at + size]

    _, packets = encode_packets(shape, lambda block: shape.block(block, read), step)
    for data in chunk_bytes(shape, packets):
        added.write(data)
    added.write(tail)
    return shape


def chunk_bytes(shape: Shape, packets: Iterator[bytes]) -> Iterator[bytes]:
    """The RECV chunk, piece by piece."""
    header = build_header(ChunkType.RECV, ChunkFlag.ANCILLARY, shape.payload_size)
    crc = zlib.crc32(header)
    yield header
    for packet in packets:
        crc = zlib.crc32(packet, crc)
        yield packet
    yield CRC.pack(crc)


def _settle(directory: Directory, start: int, end: int, redundancy: float) -> tuple[Shape, bytes]:
    last = directory.clips.last
    t_size = FOOT.size
    for _ in range(TRIES):
        shape = shape_for(start, end - start, t_size, redundancy)
        chunk = Chunk(ChunkType.RECV, ChunkFlag.ANCILLARY, end, shape.payload_size)
        if last is not None:
            last.ancillary.append(chunk)
        index = build_index(directory)
        if last is not None:
            last.ancillary.pop()
        tail = index + build_foot(end + shape.chunk_size, len(index))
        if len(tail) == t_size:
            return shape, tail
        t_size = len(tail)
    raise OptionError(
        f"redundancy {redundancy:g} leads to no valid layout; try a slightly different value"
    )
