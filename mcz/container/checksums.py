"""Every checksum of a file in one pass over its bytes, without decoding.

The pass runs at the speed of the disk, holds a block at a time, and continues after a fault to
report all of them. SPEC.md, "Chunks", "Open DATA and packets", "INDX" and "FOOT", are normative.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from mcz.container.chunks import END, Chunk, ChunkType
from mcz.container.directory import ClipRow, Directory
from mcz.container.encodings import chunk_id
from mcz.container.grammar import INDEX, START, ChunkEvent, Event, Fault, PacketEvent
from mcz.container.index_reader import directory_of, read_indexes
from mcz.container.limits import index_limit
from mcz.container.model_records import parse_head
from mcz.container.parser import WHOLE, Parser
from mcz.container.parser_drivers import events
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError, UnsupportedError

SHARED = (ChunkType.SKEL, ChunkType.MODL, ChunkType.SRCE)
KEPT = (ChunkType.HEAD, *SHARED)  # chunks whose payloads the pass needs
_PLACE = struct.Struct("<QQB")  # of a segment: offset, size, kind of its packet

Report = Callable[[int, int], object]


@dataclass(slots=True)
class ChecksumReport:
    """Findings of one pass; ``faults``: the place and kind of each, in file order.

    ``indexed``: the file ends with an INDX, which was compared with the chunks.
    """

    n_chunks: int = 0
    n_packets: int = 0
    indexed: bool = False
    faults: list[tuple[int, str]] = field(default_factory=list)


def check_checksums(source: ByteSource, progress: Report | None = None) -> ChecksumReport:
    """Check each checksum of ``source``, and compare INDX and FOOT with the chunks.

    Nothing is decoded: only a full check finds faults within sound checksums. ``progress`` is
    called with the number of bytes done and the size of the file. Raises UnsupportedError where the
    file needs a newer reader, AccessError where it cannot be read.
    """
    check = _Check(source)
    for event in events(source, check.parser):
        check.take(event)
        if progress is not None and not isinstance(event, PacketEvent):
            progress(min(check.parser.at, source.size), source.size)
    check.finish()
    return check.seen


class _Check:
    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self.parser = Parser(source.size, want=lambda chunk: WHOLE * (chunk.type in KEPT))
        self.seen = ChecksumReport()
        self._places = _Places()
        self._index: Chunk | None = None  # that the last FOOT closes
        self._end = 0  # of the last FOOT
        self._has_lost = False  # an unknown part of the file was passed

    def take(self, event: Event) -> None:
        """Process an event; raises UnsupportedError."""
        if isinstance(event, PacketEvent):
            self._take_packet(event)
        elif isinstance(event, Fault):
            self._take_fault(event)
        elif isinstance(event, ChunkEvent):
            self._take_chunk(event)
        else:
            self._index, self._end = event.index, event.end

    def _note(self, at: int, text: str) -> None:
        self.seen.faults.append((at, text))

    def _take_fault(self, fault: Fault) -> None:
        """Note a fault of a checksum, or of the grammar if everything before is known."""
        event, chunk = fault.event, fault.chunk
        if isinstance(fault.error, UnsupportedError):
            raise fault.error
        if fault.offset and fault.offset >= self._source.size:  # the end, see ``finish``
            return
        is_known = fault.state in (START, INDEX) or not (
            self._has_lost or isinstance(event, PacketEvent)
        )
        if event is None or is_known or isinstance(fault.error, ChecksumError):
            self._note(fault.offset, str(fault.error))
        if event is not None:
            self.take(event)
        elif fault.is_lost:
            self._has_lost = True
        elif chunk is not None:
            self._has_lost = self._has_lost or chunk.type in (*KEPT, ChunkType.INDX)
            self.seen.n_chunks += 1
            self._places.add(chunk)

    def _take_chunk(self, event: ChunkEvent) -> None:
        chunk = event.chunk
        self.seen.n_chunks += 1
        if chunk.type == ChunkType.HEAD:
            self._places.head = event.payload
            try:
                self.parser.profile = parse_head(event.payload)
            except UnsupportedError:
                raise
            except FormatError as error:
                self._note(chunk.offset, str(error))
        elif chunk.type in SHARED:
            with suppress(FormatError):  # its content is not checked here
                id_ = chunk_id(chunk.type, event.payload, self.parser.profile)
                self._places.shared.setdefault((chunk.type, id_), chunk)
        self._places.add(chunk)

    def _take_packet(self, event: PacketEvent) -> None:
        packet = event.packet
        if packet.kind != END:
            self.seen.n_packets += 1
            if self._places.clips:
                self._places.clips[-1].segment(event.body, len(packet.body), packet.kind)

    def finish(self) -> None:
        """Compare the last index with the file, if all of the file is known."""
        size, index = self._source.size, self._index
        if self._end != size:
            self._note(size, f"the file ends at {size} without a FOOT")
        elif index is not None and not self._has_lost:
            try:
                listed = read_indexes(
                    self._source.read, index.offset, index.size, index_limit(size)
                )
                faults = self._places.differences(directory_of(listed))
            except FormatError as error:
                faults = [str(error)]
            for text in faults:
                self._note(index.offset, f"chunk {index.label}: {text}")
            self.seen.indexed = True


@dataclass(slots=True)
class _ClipPlaces:
    """The chunks of a clip; of its segments, which may be many, a count and a CRC-32 of places."""

    clip: Chunk
    n_segments: int = 0
    segments: int = 0
    cend: Chunk | None = None
    ancillary: list[Chunk] = field(default_factory=list)

    def segment(self, offset: int, size: int, packet: int = 0) -> None:
        """Add a segment; ``packet`` is the kind of its packet, as in ``SegmentRow``."""
        self.n_segments += 1
        self.segments = zlib.crc32(_PLACE.pack(offset, size, packet), self.segments)


@dataclass(slots=True)
class _Places:
    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = field(default_factory=dict)
    attachments: list[Chunk] = field(default_factory=list)
    n_aliases: int = 0
    clips: list[_ClipPlaces] = field(default_factory=list)

    def add(self, chunk: Chunk) -> None:
        """Add the next chunk of any type; chunks of ``shared`` are added separately."""
        clip = self.clips[-1] if self.clips else None
        if chunk.type == ChunkType.CLIP:
            self.clips.append(_ClipPlaces(chunk))
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
        """The faults of an index, in words; empty if it is right."""
        faults = []
        if listed.head != self.head:
            faults.append("its copy of HEAD differs from HEAD")
        if list(listed.shared.items()) != list(self.shared.items()):
            faults.append("it lists other skeletons, models or sources than the file has")
        if [part for row in listed.attachments.values() for part in row.parts] != self.attachments:
            faults.append("it lists other attachments than the file has")
        if self.n_aliases != len(listed.aliases):
            faults.append(
                f"it lists {len(listed.aliases)} aliases, but the file has {self.n_aliases}"
            )
        return faults + _clip_differences(self.clips, list(listed.clips.values()))


def _clip_differences(places: Sequence[_ClipPlaces], rows: Sequence[ClipRow]) -> list[str]:
    if len(places) != len(rows):
        return [f"it lists {len(rows)} clips, there are {len(places)}"]
    return [
        f"clip {row.name!r} does not lie where it says"
        for place, row in zip(places, rows, strict=True)
        if place != places_of(row)
    ]


def places_of(row: ClipRow) -> _ClipPlaces:
    """Places of a clip as listed by an index; raises FormatError for a wrong index."""
    places = _ClipPlaces(row.clip, cend=row.cend, ancillary=row.ancillary)
    for segment in row.segments:
        places.segment(segment.offset, segment.size, segment.packet)
    return places
