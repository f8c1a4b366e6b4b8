"""INDX: the Directory of a file as bytes, or what is new in it since another INDX.

SPEC.md, "INDX", is normative; ``index_reader.py`` has the way back.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import islice

import numpy as np

from mcz.container import index_records
from mcz.container.chunks import FRAMING, Chunk, ChunkFlag, ChunkType, build_chunk
from mcz.container.directory import (
    ClipRow,
    Directory,
    IndexPlace,
    Packed,
)
from mcz.container.index_records import (
    Index,
    IndexedAlias,
    IndexedAttachment,
    IndexedChunk,
    IndexedClip,
    IndexedPlace,
    IndexedSegment,
    IndexedSignal,
)
from mcz.container.packets import FRAME, SEGMENT
from mcz.container.segments import FRESH, KNOWN_FLAGS
from mcz.errors import FormatError
from mcz.schema import Table, build, deflate

# Set in the indexed flags of a segment that is a packet of an open DATA, by the packet's kind.
PACKETS = {SEGMENT: 64, FRAME: 32}
INDEXES = 4  # of these a writer leaves no more, so that few requests open a file
GROWTH = 27  # times the bytes of what is new: a smaller INDX is made part of it

SIGNAL_ROW = tuple(f.name for f in fields(IndexedSignal))
SEGMENT_ROW = tuple(f.name for f in fields(IndexedSegment))


def build_index(directory: Directory) -> bytes:
    """The whole INDX chunk, which continues what the file has of them where that is larger."""
    kept = list(directory.indexes)
    while True:
        content = index_content(directory, kept[-1] if kept else None)
        if not kept or not (kept[-1].n_bytes < GROWTH * len(content) or len(kept) >= INDEXES):
            break
        kept.pop()
    return index_chunk(content, kept[-1] if kept else None)


def index_chunk(content: bytes, since: IndexPlace | None = None) -> bytes:
    """The INDX chunk of this content."""
    record = index_records.Indx(size=len(content), data=deflate(content))
    if since is not None:
        record.flags, record.previous = index_records.CONTINUES, previous_of(since)
    return build_chunk(ChunkType.INDX, build(record, "INDX"), ChunkFlag.ANCILLARY)


def previous_of(place: IndexPlace) -> index_records.PreviousIndex:
    """How an INDX names the one that it continues."""
    return index_records.PreviousIndex(offset=place.offset, length=place.length, crc=place.crc)


def index_content(directory: Directory, since: IndexPlace | None = None) -> bytes:
    """The index of what is new ``since`` another one, not deflated yet."""
    return build(index_record(directory, since), "INDX")


def index_record(directory: Directory, since: IndexPlace | None = None) -> Index:
    """The same as a record."""
    if since is None:
        return Listing(directory).record()
    new = Directory(
        head=directory.head,
        shared=dict(islice(directory.shared.items(), since.n_shared, None)),
        attachments=dict(islice(directory.attachments.items(), since.n_attachments, None)),
        aliases=dict(islice(directory.aliases.items(), since.n_aliases, None)),
    )
    for name in islice(directory.clips, since.n_clips, None):
        new.clips[name] = directory.clips[name]
    behind: list[Chunk] = []
    if since.n_clips:
        last = directory.clips[next(islice(directory.clips, since.n_clips - 1, None))]
        behind = [chunk for chunk in last.ancillary if chunk.offset >= since.stop]
    return Listing(new, since.stop, behind).record()


@dataclass(slots=True)
class Listing:
    """What an index lists: all of ``new``, which lies behind ``start``.

    ``behind``: new ancillary chunks of the clip before.
    """

    new: Directory
    start: int = 0
    behind: list[Chunk] = field(default_factory=list)

    def record(self) -> Index:
        """The content of INDX; raises FormatError for a clip without CEND."""
        attachments, clips = list(self.new.attachments.values()), list(self.new.clips.values())
        parts = [part for row in attachments for part in row.parts]
        signals = [signal for clip in clips for signal in clip.signals]
        segments = [segment_rows(clip) for clip in clips]
        columns = np.array([row for rows in segments for row in rows], np.int64)
        skeletons = {id_: n for n, id_ in enumerate(dict.fromkeys(c.skeleton for c in clips))}
        return Index(
            head=self.new.head,
            shared=Table.of(
                IndexedChunk,
                type=[kind for kind, _ in self.new.shared],
                id=[id_ for _, id_ in self.new.shared],
                **_places(self.new.shared.values(), self.start),
            ),
            attachments=Table.of(
                IndexedAttachment,
                name=[row.name for row in attachments],
                size=[row.size for row in attachments],
                n_parts=[len(row.parts) for row in attachments],
            ),
            parts=Table.of(
                IndexedPlace, type=[ChunkType.ATTA] * len(parts), **_places(parts, self.start)
            ),
            aliases=Table.of(
                IndexedAlias,
                name=list(self.new.aliases),
                of=[of for of, _ in self.new.aliases.values()],
                target=[target for _, target in self.new.aliases.values()],
            ),
            skeletons=list(skeletons),
            clips=self._clips(clips, segments, skeletons),
            signals=Table.of(
                IndexedSignal, **{name: [getattr(s, name) for s in signals] for name in SIGNAL_ROW}
            ),
            segments=Table.of(
                IndexedSegment,
                **dict(zip(SEGMENT_ROW, columns.reshape(-1, len(SEGMENT_ROW)).T, strict=True)),
            ),
            n_behind=len(self.behind),
            ancillary=self._ancillary(clips),
        )

    def _clips(
        self, clips: Sequence[ClipRow], segments: Sequence[Packed], skeletons: Mapping[bytes, int]
    ) -> Table[IndexedClip]:
        ends = [self.start, *(_cend_of(clip).stop for clip in clips)]
        return Table.of(
            IndexedClip,
            name=[clip.name for clip in clips],
            skeleton=[skeletons[clip.skeleton] for clip in clips],
            n_frames=[clip.n_frames for clip in clips],
            rate_numerator=[clip.rate_numerator for clip in clips],
            rate_denominator=[clip.rate_denominator for clip in clips],
            n_signals=[len(clip.signals) for clip in clips],
            gap=[clip.clip.offset - end for clip, end in zip(clips, ends, strict=False)],
            length=[clip.clip.size - FRAMING for clip in clips],
            n_segments=[len(rows) for rows in segments],
            cend_gap=[
                _cend_of(clip).offset - end_of(clip, rows)
                for clip, rows in zip(clips, segments, strict=True)
            ],
            cend_length=[_cend_of(clip).size - FRAMING for clip in clips],
            n_ancillary=[len(clip.ancillary) for clip in clips],
        )

    def _ancillary(self, clips: Sequence[ClipRow]) -> Table[IndexedPlace]:
        groups = [
            (self.behind, self.start),
            *((clip.ancillary, _cend_of(clip).stop) for clip in clips),
        ]
        places = [_places(chunks, start) for chunks, start in groups]
        return Table.of(
            IndexedPlace,
            type=[chunk.type for chunks, _ in groups for chunk in chunks],
            gap=[gap for columns in places for gap in columns["gap"]],
            length=[length for columns in places for length in columns["length"]],
        )


def _cend_of(clip: ClipRow) -> Chunk:
    if clip.cend is None or clip.cend.length is None:
        raise FormatError(f"clip {clip.name!r} has no CEND and cannot be indexed")
    return clip.cend


def _places(chunks: Iterable[Chunk], end: int) -> dict[str, list[int]]:
    """The columns ``gap`` and ``length`` of chunks in file order, behind ``end``."""
    gaps, lengths = [], []
    for chunk in chunks:
        gaps.append(chunk.offset - end)
        lengths.append(chunk.size - FRAMING)
        end = chunk.stop
    return {"gap": gaps, "length": lengths}


def segment_rows(clip: ClipRow) -> Packed:
    """The segments of a clip, each the fields of an IndexedSegment in their order."""
    if (packed := clip.packed) is not None:
        return packed
    rows, end = [], clip.clip.stop
    for row in clip.segments:
        header = row.header
        flags = header.flags & (FRESH if row.packet == FRAME else KNOWN_FLAGS)
        flags |= PACKETS.get(row.packet, 0)
        covers = header.signal, header.n_frames, header.lead, header.tail
        rows.append((row.offset - end, row.size, *covers, flags))
        end = row.stop
    return rows


def end_of(clip: ClipRow, rows: Packed) -> int:
    """Where the last of these segments of a clip ends, or its CLIP."""
    return clip.clip.stop + sum(gap + size for gap, size, *_ in rows)
