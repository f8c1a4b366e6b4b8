"""Where the chunks of a file lie, as a walk over its bytes found them: what INDX must say."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

from mcz.container.chunks import Chunk, ChunkType
from mcz.container.directory import ClipRow, Directory

_PLACE = struct.Struct("<QQB")  # of a segment: offset, size, kind of its packet


@dataclass(slots=True)
class ClipPlaces:
    """The chunks of a clip; of its segments, which may be many, a count and a CRC-32 of places."""

    clip: Chunk
    n_segments: int = 0
    segments: int = 0
    cend: Chunk | None = None
    ancillary: list[Chunk] = field(default_factory=list)

    def segment(self, offset: int, size: int, packet: int = 0) -> None:
        """Add a segment; ``packet`` is the kind of its packet, as of ``SegmentRow``."""
        self.n_segments += 1
        self.segments = zlib.crc32(_PLACE.pack(offset, size, packet), self.segments)


@dataclass(slots=True)
class Places:
    """The chunks of a file, in file order."""

    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = field(default_factory=dict)
    attachments: list[Chunk] = field(default_factory=list)
    n_aliases: int = 0
    clips: list[ClipPlaces] = field(default_factory=list)

    def add(self, chunk: Chunk) -> None:
        """Take in the next chunk, whatever it is; those in ``shared`` come by themselves."""
        clip = self.clips[-1] if self.clips else None
        if chunk.type == ChunkType.CLIP:
            self.clips.append(ClipPlaces(chunk))
        elif chunk.type == ChunkType.ATTA:
            self.attachments.append(chunk)
        elif chunk.type == ChunkType.ALIA:
            self.n_aliases += 1
        elif clip is None:
            return
        elif chunk.type == ChunkType.CEND:
            clip.cend = chunk
        elif chunk.type == ChunkType.DATA and chunk.length is not None:
            clip.segment(chunk.payload_offset, chunk.length)
        elif chunk.flags and chunk.type != ChunkType.INDX and clip.cend is not None:
            clip.ancillary.append(chunk)

    def differences(self, listed: Directory) -> list[str]:
        """What an index says that is not so, in words; empty where it is right."""
        found = []
        if listed.head != self.head:
            found.append("its copy of HEAD differs from HEAD")
        if list(listed.shared.items()) != list(self.shared.items()):
            found.append("it lists other skeletons, models or sources than there are")
        if [part for row in listed.attachments.values() for part in row.parts] != self.attachments:
            found.append("it lists other attachments than there are")
        if self.n_aliases != len(listed.aliases):
            found.append(f"it lists {len(listed.aliases)} aliases, there are {self.n_aliases}")
        return found + _differing(self.clips, list(listed.clips.values()))


def _differing(places: Sequence[ClipPlaces], rows: Sequence[ClipRow]) -> list[str]:
    if len(places) != len(rows):
        return [f"it lists {len(rows)} clips, there are {len(places)}"]
    return [
        f"clip {row.name!r} does not lie where it says"
        for place, row in zip(places, rows, strict=True)
        if place != places_of(row)
    ]


def places_of(row: ClipRow) -> ClipPlaces:
    """Those of a clip that an index lists; raises FormatError where the index is wrong."""
    places = ClipPlaces(row.clip, cend=row.cend, ancillary=row.ancillary)
    for segment in row.segments:
        places.segment(segment.offset, segment.size, segment.packet)
    return places
