"""INDX: the Directory of a file as bytes, or its additions since another INDX.

SPEC.md, "INDX", is normative; ``index_reader.py`` has the inverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from itertools import chain, islice
from operator import attrgetter

from mcz.container.chunks import FRAME, FRAMING, SEGMENT, Chunk, ChunkFlag, ChunkType, build_chunk
from mcz.container.directory import (
    CONTINUES,
    ClipRow,
    Directory,
    Index,
    IndexedAlias,
    IndexedAttachment,
    IndexedChunk,
    IndexedClip,
    IndexedPlace,
    IndexedSegment,
    IndexedSignal,
    IndexPlace,
    Indx,
    Packed,
    SignalRow,
)
from mcz.container.segments import FRESH, KNOWN_FLAGS
from mcz.errors import FormatError
from mcz.model.schema import Table, build, deflate

# Set in the indexed flags of a segment that is a packet of an open DATA, by the packet's kind.
PACKETS = {SEGMENT: 64, FRAME: 32}
INDEXES = 4  # most INDX chunks of a writer, so that few requests open a file
GROWTH = 27  # an INDX of less than so many times the additions is merged with them
SIGNAL_ROW = attrgetter(*(f.name for f in fields(SignalRow)))


def build_index(directory: Directory) -> bytes:
    """The whole INDX chunk, which continues the present ones of the file if they are larger."""
    indexes = list(directory.indexes)
    while True:
        content = index_content(directory, indexes[-1] if indexes else None)
        if not indexes or not (
            indexes[-1].n_bytes < GROWTH * len(content) or len(indexes) >= INDEXES
        ):
            break
        indexes.pop()
    record = Indx(size=len(content), data=deflate(content))
    if indexes:
        record.flags, record.previous = CONTINUES, indexes[-1].chunk
    return build_chunk(ChunkType.INDX, build(record, "INDX"), ChunkFlag.ANCILLARY)


def index_content(directory: Directory, since: IndexPlace | None = None) -> bytes:
    """The index of the additions ``since`` another one, before deflate."""
    return build(index_record(directory, since), "INDX")


def index_record(directory: Directory, since: IndexPlace | None = None) -> Index:
    """The record of ``index_content``."""
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
        behind = [chunk for chunk in last.ancillary if chunk.offset >= since.chunk.stop]
    return Listing(new, since.chunk.stop, behind).record()


@dataclass(slots=True)
class Listing:
    """The content of an index: all of ``new``, from ``start`` on.

    ``behind``: new ancillary chunks of the clip before.
    """

    new: Directory
    start: int = 0
    behind: list[Chunk] = field(default_factory=list)

    def record(self) -> Index:
        """The content of INDX; raises FormatError for a clip without CEND."""
        new, start = self.new, self.start
        clips = list(new.clips.values())
        segments = [segment_rows(clip) for clip in clips]
        skeletons = {id_: n for n, id_ in enumerate(dict.fromkeys(c.skeleton for c in clips))}
        shared = zip(new.shared, _chunk_places(new.shared.values(), start), strict=True)
        parts = [part for row in new.attachments.values() for part in row.parts]
        ancillary = [*_chunk_places(self.behind, start)]
        rows: list[tuple[str | int, ...]] = []
        end = start
        for clip, packed in zip(clips, segments, strict=True):
            cend = clip.cend
            if cend is None:
                raise FormatError(f"clip {clip.name!r} cannot be indexed, because it has no CEND")
            rows.append(
                (
                    *(clip.name, skeletons[clip.skeleton], clip.n_frames),
                    *(clip.rate_numerator, clip.rate_denominator, len(clip.signals)),
                    *(clip.clip.offset - end, clip.clip.size - FRAMING, len(packed)),
                    *(cend.offset - end_of(clip, packed), cend.size - FRAMING),
                    len(clip.ancillary),
                )
            )
            end = cend.stop
            ancillary += _chunk_places(clip.ancillary, end)
        return Index(
            head=new.head,
            shared=Table.of(IndexedChunk, [(kind, id_, *at) for (_, id_), (kind, *at) in shared]),
            attachments=Table.of(
                IndexedAttachment,
                [(row.name, row.size, len(row.parts)) for row in new.attachments.values()],
            ),
            parts=Table.of(IndexedPlace, list(_chunk_places(parts, start))),
            aliases=Table.of(IndexedAlias, [(name, *row) for name, row in new.aliases.items()]),
            skeletons=list(skeletons),
            clips=Table.of(IndexedClip, rows),
            signals=Table.of(IndexedSignal, [SIGNAL_ROW(s) for c in clips for s in c.signals]),
            segments=Table.of(IndexedSegment, list(chain.from_iterable(segments))),
            n_behind=len(self.behind),
            ancillary=Table.of(IndexedPlace, ancillary),
        )


def _chunk_places(chunks: Iterable[Chunk], end: int) -> Iterator[tuple[bytes, int, int]]:
    """Type, gap and length of chunks in file order, after ``end``."""
    for chunk in chunks:
        yield chunk.type, chunk.offset - end, chunk.size - FRAMING
        end = chunk.stop


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
    """The end of the last of ``rows``, or of the CLIP if there are none."""
    return clip.clip.stop + sum(gap + size for gap, size, *_ in rows)
