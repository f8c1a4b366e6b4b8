"""INDX: the Directory of a file as bytes, or what is new in it since another INDX.

SPEC.md, "INDX", is normative; ``index_reader.py`` has the way back.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from itertools import islice
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import (
    ANCILLARY,
    FRAMING,
    Chunk,
    build_chunk,
)
from mcz.container.directory import (
    ClipRow,
    Directory,
    IndexPlace,
    Packed,
)
from mcz.container.index_records import (
    Index,
    IndexedAlias,
    IndexedAncillary,
    IndexedAttachment,
    IndexedChunk,
    IndexedClip,
    IndexedPart,
    IndexedSegment,
    IndexedSignal,
)
from mcz.container.packets import FRAME, NUMBERED, SEGMENT
from mcz.errors import FormatError
from mcz.schema import Table, build, deflate
from mcz.schema.columns import Numbers

# Set in the indexed flags of a segment that is a packet of an open DATA, by the packet's kind.
PACKETS = {SEGMENT: 128, FRAME: 64, NUMBERED: 32}
INDEXES = 4  # of these a writer leaves no more, so that few requests open a file
GROWTH = 27  # times the bytes of what is new: a smaller INDX is made part of it

SIGNAL = tuple(f.name for f in fields(IndexedSignal))
SEGMENT_COLUMNS = tuple(f.name for f in fields(IndexedSegment))


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
    record = payloads.Indx(size=len(content), data=deflate(content))
    if since is not None:
        place = payloads.PreviousIndex(offset=since.offset, length=since.length, crc=since.crc)
        record.flags, record.previous = payloads.CONTINUES, place
    return build_chunk(b"INDX", build(record, "INDX"), ANCILLARY)


def index_content(directory: Directory, since: IndexPlace | None = None) -> bytes:
    """The index of what is new ``since`` another one, not deflated yet."""
    return build(index_record(directory, since), "INDX")


def index_record(directory: Directory, since: IndexPlace | None = None) -> Index:
    """The same as a record."""
    start = 0 if since is None else since.stop
    shared = list(islice(directory.shared.items(), since.n_shared if since else 0, None))
    skip = since.n_attachments if since else 0
    attachments = [*islice(directory.attachments.values(), skip, None)]
    aliases = list(islice(directory.aliases.items(), since.n_aliases if since else 0, None))
    names = list(islice(directory.clips, since.n_clips if since else 0, None))
    clips = [directory.clips[name] for name in names]
    behind: list[Chunk] = []
    if since is not None and since.n_clips:
        last = next(islice(directory.clips, since.n_clips - 1, None))
        behind = [chunk for chunk in directory.clips[last].ancillary if chunk.offset >= start]
    return Index(
        head=directory.head,
        shared=Table.of(
            IndexedChunk,
            type=[kind for (kind, _), _ in shared],
            id=[id_ for (_, id_), _ in shared],
            **_places((chunk for _, chunk in shared), start),
        ),
        attachments=Table.of(
            IndexedAttachment,
            name=[row.name for row in attachments],
            size=[row.size for row in attachments],
            n_parts=[len(row.parts) for row in attachments],
        ),
        parts=Table.of(
            IndexedPart, **_places((part for row in attachments for part in row.parts), start)
        ),
        aliases=Table.of(
            IndexedAlias,
            name=[name for name, _ in aliases],
            of=[of for _, (of, _) in aliases],
            target=[target for _, (_, target) in aliases],
        ),
        **_clip_tables(clips, behind, start),
    )


def _places(chunks: Iterable[Chunk], end: int) -> dict[str, list[int]]:
    """The columns ``gap`` and ``length`` of chunks in file order, behind ``end``."""
    gaps, lengths = [], []
    for chunk in chunks:
        gaps.append(chunk.offset - end)
        lengths.append(chunk.size - FRAMING)
        end = chunk.offset + chunk.size
    return {"gap": gaps, "length": lengths}


def _clip_tables(clips: Sequence[ClipRow], behind: Sequence[Chunk], start: int) -> dict[str, Any]:
    """The fields of an index that are about clips."""
    skeletons: dict[bytes, int] = {}
    packed = [clip.packed or packed_segments(clip) for clip in clips]
    ancillary: dict[str, list[int]] = {"gap": [], "length": []}
    at, gaps = start, []
    for name, column in _places(behind, start).items():
        ancillary[name] += column
    for clip in clips:
        skeletons.setdefault(clip.skeleton, len(skeletons))
        gaps.append(clip.clip.offset - at)
        assert clip.cend is not None
        at = clip.cend.offset + clip.cend.size
        for name, column in _places(clip.ancillary, at).items():
            ancillary[name] += column
    signals = [signal for clip in clips for signal in clip.signals]
    chunks = [*behind, *(chunk for clip in clips for chunk in clip.ancillary)]
    return {
        "skeletons": list(skeletons),
        "clips": Table.of(
            IndexedClip,
            name=[clip.name for clip in clips],
            skeleton=[skeletons[clip.skeleton] for clip in clips],
            n_frames=[clip.n_frames for clip in clips],
            rate_numerator=[clip.rate_numerator for clip in clips],
            rate_denominator=[clip.rate_denominator for clip in clips],
            n_signals=[len(clip.signals) for clip in clips],
            gap=gaps,
            length=[clip.clip.size - FRAMING for clip in clips],
            n_segments=[len(table) for table, _, _ in packed],
            cend_gap=[gap for _, gap, _ in packed],
            cend_length=[length for _, _, length in packed],
            n_ancillary=[len(clip.ancillary) for clip in clips],
        ),
        "signals": Table.of(
            IndexedSignal, **{name: [getattr(s, name) for s in signals] for name in SIGNAL}
        ),
        "segments": Table.of(
            IndexedSegment,
            **{
                name: np.concatenate(
                    [np.zeros(0, np.int64), *(t.numbers(name) for t, _, _ in packed)]
                )
                for name in SEGMENT_COLUMNS
            },
        ),
        "n_behind": len(behind),
        "ancillary": Table.of(IndexedAncillary, type=[chunk.type for chunk in chunks], **ancillary),
    }


def _joined(columns: Iterable[Numbers]) -> Numbers:
    return np.concatenate([np.zeros(0, np.int64), *columns])


def packed_segments(clip: ClipRow) -> Packed:
    """The segments of a clip as columns, and the fields ``cend_gap`` and ``cend_length``."""
    if clip.cend is None or clip.cend.length is None:
        raise FormatError(f"clip {clip.name!r} has no CEND and cannot be indexed")
    rows, end = [], clip.clip.offset + clip.clip.size
    for row in clip.segments:
        header = row.header
        flags = header.flags | PACKETS.get(row.packet, 0)
        covers = header.signal, header.n_frames, header.lead, header.tail
        rows.append((row.offset - end, row.size, *covers, flags))
        end = row.stop
    values = np.array(rows, np.int64).reshape(-1, len(SEGMENT_COLUMNS)).T
    table = Table.of(IndexedSegment, **dict(zip(SEGMENT_COLUMNS, values, strict=True)))
    return table, clip.cend.offset - end, clip.cend.length
