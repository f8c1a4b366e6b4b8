"""Compute recovery data for an MCZ file and append them.

SPEC.md, "RECV", is normative; ``mcz/container/recovery`` has the code.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

from mcz.container.chunks import CRC, FOOT, Chunk, ChunkFlag, ChunkType, build_foot, build_header
from mcz.container.directory import Directory
from mcz.container.index import build_index
from mcz.container.reader import Container
from mcz.container.recovery.blocks import Key, Shape, Step, encode_packets, read_packet, shape_for
from mcz.container.source import ByteSource
from mcz.errors import FormatError, OptionError
from mcz.files.editing.appending import IN_MEMORY, growing
from mcz.files.reading.faults import recovery_chunks
from mcz.model.text_format import brief

DEFAULT = 0.05  # redundancy
TRIES = 16  # to find the size of an index that contains the size of its own chunk


@dataclass(frozen=True, slots=True)
class Protection:
    """Strength of recovery data: of ``n_blocks`` blocks any ``n_recovery`` may be bad.

    So may a run of ``burst`` bytes anywhere. ``start`` and ``stop``: the protected bytes of the
    file; ``cost``: size of the recovery data.
    """

    start: int
    stop: int
    n_blocks: int
    block_size: int
    n_recovery: int
    burst: int
    cost: int

    __repr__ = brief


def add_recovery(
    target: str | os.PathLike[str], redundancy: float, progress: Step | None = None
) -> list[Protection]:
    """Append recovery data for unprotected bytes; returns all of the file, in file order."""
    with growing(Path(target), salvage=False, force=False) as growth:
        protected = [protection_of(key.shape) for key in protections(growth.container)]
        start, end = protected[-1].stop if protected else 0, growth.container.directory.end
        if start < end:
            shape = write_recovery(growth.container, growth.added, start, redundancy, progress)
            protected.append(protection_of(shape))
    return protected


def protect_written(stream: BinaryIO, redundancy: float, progress: Step | None = None) -> Shape:
    """Write recovery data after the file in ``stream``, before that gets its name."""
    stream.flush()
    container = Container(ByteSource(stream))
    with tempfile.SpooledTemporaryFile(IN_MEMORY) as added:  # the stream is read meanwhile
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


def protections(container: Container) -> list[Key]:
    """Keys of the RECV chunks of a file, in its order, unchecked."""
    keys = []
    for chunk in recovery_chunks(container):
        packet = read_packet(container.source, chunk.payload_offset)
        if packet is None:
            raise FormatError("its first packet is damaged", where=f"chunk {chunk.label}")
        keys.append(packet[0])
    return keys


def redundancy_of(container: Container) -> float | None:
    """Redundancy of a file's greatest protected part; None for an unprotected file."""
    shapes = [key.shape for key in protections(container)]
    if not shapes:
        return None
    greatest = max(shapes, key=lambda shape: shape.size)
    return min(1.0, greatest.n_recovery / greatest.n_blocks)


def write_recovery(
    container: Container, added: BinaryIO, start: int, redundancy: float, step: Step | None
) -> Shape:
    """Write RECV, INDX and FOOT after the end of a file, for its bytes from ``start`` on."""
    directory, end = container.directory, container.directory.end
    shape, tail = _settle(directory, start, end, redundancy)

    def read(offset: int, size: int) -> bytes:
        behind = offset - shape.stop + len(tail)
        return container.source.read(offset, size) if behind < 0 else tail[behind : behind + size]

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
    raise OptionError(f"redundancy {redundancy:g}: no index fits; another one may do")
