"""Whether the recovery data of a file are those of its bytes: made anew, and compared."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.container.chunks import Chunk, ChunkType
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MczError, remark_of
from mcz.reading.quick_check import Problem
from mcz.recovery.making import made
from mcz.recovery.packets import read_packet


def recovery_chunks(container: Container) -> list[Chunk]:
    """The RECV chunks of a file; without a clip no index lists them, and the file is walked."""
    if container.directory.clips:
        return container.directory.clips.ancillary(ChunkType.RECV)
    return [chunk for chunk in scan(container.source).chunks if chunk.type == ChunkType.RECV]


def recovery_problems(container: Container) -> Iterator[tuple[str, list[Problem]]]:
    """Of each RECV the bytes that it protects, and what is wrong with it."""
    for chunk in recovery_chunks(container):
        try:
            yield _checked(container.source, chunk), []
        except MczError as error:
            yield f"at {chunk.offset}", [Problem(chunk.offset, "RECV", remark_of(error))]


def _checked(source: ByteSource, chunk: Chunk) -> str:
    first = read_packet(source, chunk.payload_offset)
    if first is None:
        raise FormatError("its first packet is damaged", where=f"chunk {chunk.label}")
    shape = first[0].shape
    sizes = shape.chunk_offset, shape.payload_size
    if sizes != (chunk.offset, chunk.length) or shape.stop > source.size:
        raise FormatError(
            f"it is about {shape}, not what is around it", where=f"chunk {chunk.label}"
        )
    _, packets = made(shape, lambda block: shape.block(block, source.read))
    at = chunk.payload_offset
    for packet in packets:
        if source.read(at, len(packet)) != packet:
            raise FormatError(
                f"the packet at {at} is not that of its bytes", where=f"chunk {chunk.label}"
            )
        at += len(packet)
    return f"bytes {shape.start} to {shape.stop}"
