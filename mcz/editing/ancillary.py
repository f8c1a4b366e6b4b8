"""The ancillary chunks of a clip, which lie between its segments."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.container.chunks import CRC, Chunk, read_chunk
from mcz.container.directory import ClipRow
from mcz.container.feeding import end_of
from mcz.container.reader import Container
from mcz.errors import FormatError


def inside(container: Container, row: ClipRow) -> Iterator[Chunk]:
    """The ancillary chunks between CLIP and CEND."""
    if row.cend is None:  # of a damaged file
        raise FormatError(f"clip {row.name!r} has no CEND")
    source, at = container.source, row.clip.offset + row.clip.size
    ends = {
        segment.chunk().offset: segment.stop + CRC.size
        for segment in row.segments
        if not segment.packet
    }
    while at < row.cend.offset:
        if at in ends:
            at = ends[at]
            continue
        chunk = read_chunk(source, at)
        if chunk.length is None:
            at = end_of(source, chunk)
            continue
        if chunk.flags:
            yield chunk
        at += chunk.size
