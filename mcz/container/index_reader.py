"""INDX as a Directory: tables are read in bulk, rows of clips created on first use.

``IndexCheck`` compares it with the chunks before it. SPEC.md, "INDX", is normative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np

from mcz.container.chunks import (
    CRC,
    FRAME,
    FRAMING,
    Chunk,
    ChunkFlag,
    ChunkType,
    build_chunk,
    check_chunk,
)
from mcz.container.directory import (
    AttachmentRow,
    ClipRow,
    ClipRows,
    Directory,
    Index,
    IndexedChunk,
    IndexedPlace,
    IndexPlace,
    Indx,
    Packed,
    PackedClipRow,
    Place,
    PreviousIndex,
    SegmentRow,
    SignalRow,
)
from mcz.container.index import PACKETS, index_record
from mcz.container.limits import check
from mcz.container.segments import FRESH, MASKS, SegmentHeader
from mcz.errors import FormatError
from mcz.model.schema import MAX_COUNT, Table, build, inflate, parse
from mcz.model.schema.columns import Numbers

MOST_INDEXES = 8  # length of a chain of indexes

T = TypeVar("T")
Places = Table[IndexedChunk] | Table[IndexedPlace]
Fetch = Callable[[int, int], bytes]  # bytes by offset and size


@dataclass(frozen=True, slots=True)
class Listed:
    """A parsed INDX: its name in messages, the previous one and its content."""

    chunk: PreviousIndex
    previous: PreviousIndex | None
    n_bytes: int
    index: Index

    @property
    def start(self) -> int:
        """The offset of the first thing that it lists."""
        return 0 if self.previous is None else self.previous.stop


def parse_index(data: bytes, offset: int, limit: int) -> Listed:
    """The INDX in ``data``, the bytes of the whole chunk at ``offset``.

    ``limit`` bounds its inflated size.
    """
    chunk = Chunk(ChunkType.INDX, ChunkFlag.ANCILLARY, offset, len(data) - FRAMING)
    outer, content = _inflate(check_chunk(data, chunk), offset, limit, "INDX")
    index = parse(Index, content, "INDX")
    return Listed(index_name(data, offset), outer.previous, outer.size, index)


def _inflate(payload: bytes, offset: int, limit: int, where: str) -> tuple[Indx, bytes]:
    outer = parse(Indx, payload, where)
    previous = outer.previous
    if previous and (previous.length < FRAMING or previous.stop > offset):  # INDX-06
        raise FormatError(
            f"INDX at {offset} continues an impossible one: {previous.length} bytes at "
            f"{previous.offset}"
        )
    check("INDX: inflated size", outer.size, limit)
    return outer, inflate(outer.data, outer.size, "INDX")


def index_name(data: bytes, offset: int) -> PreviousIndex:
    """The name of the INDX whose bytes at ``offset`` are ``data``."""
    (crc,) = CRC.unpack(data[-CRC.size :])
    return PreviousIndex(offset=offset, length=len(data), crc=crc)


def read_indexes(fetch: Fetch, offset: int, length: int, limit: int) -> Iterator[Listed]:
    """Yield the INDX at an offset, then each one that it continues; raises FormatError."""
    expected: PreviousIndex | None = None
    for _ in range(MOST_INDEXES):
        index = parse_index(fetch(offset, length), offset, limit)
        if expected not in (None, index.chunk):  # INDX-06
            raise FormatError(f"INDX at {offset} differs from the one that the next INDX continues")
        yield index
        if (expected := index.previous) is None:
            return
        offset, length = expected.offset, expected.length
    raise FormatError(f"more than {MOST_INDEXES} INDX chunks are chained")  # INDX-07


def directory_of(indexes: Iterable[Listed]) -> Directory:
    """The Directory of these indexes together, the last one first."""
    each = list(indexes)[::-1]
    directory = Directory(head=each[-1].index.head)
    clips = _Clips()
    for index in each:
        if index.index.head != directory.head:
            raise FormatError("two INDX differ in their copies of HEAD")
        _add_shared(directory, index)
        _add_attachments(directory, index)
        for row in index.index.aliases:
            _add(directory.aliases, row.name, (row.of, row.target))
        clips.add(ClipTables(index))
        directory.clips = ClipRows(clips.names, clips.row, clips.groups_with, clips.places)
        directory.indexes += (place_of(index.chunk, index.n_bytes, directory),)
    if len(directory.clips) < len(clips.names):
        raise FormatError("INDX: two clips have the same name")
    return directory


def place_of(chunk: PreviousIndex, n_bytes: int, directory: Directory) -> IndexPlace:
    """The place of an INDX, after which ``directory`` has everything up to now."""
    return IndexPlace(
        chunk,
        n_bytes,
        len(directory.shared),
        len(directory.attachments),
        len(directory.aliases),
        len(directory.clips),
    )


def _add_shared(directory: Directory, index: Listed) -> None:
    table = index.index.shared
    for kind, id_, chunk in zip(
        table.blobs("type"), table.blobs("id"), _chunks_of(table, index.start), strict=True
    ):
        if (kind, id_) in directory.shared:
            raise FormatError(f"INDX: two {kind.decode()} entries have the id {id_.hex()}")
        directory.shared[kind, id_] = Chunk(kind, 0, chunk.offset, chunk.length)


def _add_attachments(directory: Directory, index: Listed) -> None:
    table, chunks = index.index.attachments, _chunks_of(index.index.parts, index.start)
    bounds = _bounds(table.numbers("n_parts"), len(chunks), "parts").tolist()
    for row, first, stop in zip(table, bounds[:-1], bounds[1:], strict=True):
        _add(directory.attachments, row.name, AttachmentRow(row.name, row.size, chunks[first:stop]))


def _add(table: dict[str, T], name: str, row: T) -> None:
    if name in table:
        raise FormatError(f"INDX: two entries are named {name!r}")
    table[name] = row


def _bounds(counts: Numbers, total: int, label: str) -> Numbers:
    """The first item of each in a table of ``total`` items, and the end of the last ones."""
    if counts.sum(dtype=np.float64) != total:  # INDX-08
        raise FormatError(f"INDX: the number of {label} differs from the sum of their counts")
    return np.concatenate(([0], np.cumsum(counts)))


def _ends(sizes: Numbers, start: int) -> Numbers:
    """The ends of consecutive things of these sizes from ``start`` on."""
    if start + sizes.sum(dtype=np.float64) > MAX_COUNT:  # CONV-01
        raise FormatError("INDX: an offset beyond 2^53 - 1")
    return start + np.cumsum(sizes)


def _chunks_of(table: Places, start: int) -> list[Chunk]:
    """The chunks of a table with ``gap`` and ``length``, the first after ``start``."""
    lengths = table.numbers("length")
    ends = _ends(table.numbers("gap") + lengths + FRAMING, start)
    offsets = (ends - lengths - FRAMING).tolist()
    return [
        Chunk(ChunkType.ATTA, 0, at, n) for at, n in zip(offsets, lengths.tolist(), strict=True)
    ]


class ClipTables:
    """The clips that one INDX lists."""

    def __init__(self, listed: Listed) -> None:
        index = listed.index
        clips = self.clips = index.clips
        self.index, self.start = index, listed.start
        self.names = clips.texts("name")
        self.signal_bounds = _bounds(clips.numbers("n_signals"), len(index.signals), "signals")
        self.segment_bounds = _bounds(clips.numbers("n_segments"), len(index.segments), "segments")
        behind = np.concatenate(([index.n_behind], clips.numbers("n_ancillary")))
        self.ancillary_bounds = _bounds(behind, len(index.ancillary), "ancillary chunks")
        if len(clips) and int(clips.numbers("skeleton").max()) >= len(index.skeletons):  # INDX-08
            raise FormatError("INDX: a clip refers to a skeleton that is not listed")
        self.ends = self._ends()

    def _ends(self) -> Numbers:
        """The end of the CEND of each clip."""  # INDX-01
        number, segments = self.clips.numbers, self.index.segments
        inside = np.concatenate(([0], _ends(segments.numbers("gap") + segments.numbers("size"), 0)))
        data = np.diff(inside[self.segment_bounds])
        rest = number("length") + data + number("cend_gap") + number("cend_length") + 2 * FRAMING
        ends = _ends(number("gap") + rest, self.start)
        self.offsets = ends - rest
        return ends

    @cached_property
    def _fields(self) -> list[tuple[Any, ...]]:
        """Fields of each clip's row, and places in other tables."""
        number, bounds = self.clips.numbers, (self.signal_bounds, self.segment_bounds)
        columns = [
            *(number(name) for name in ("skeleton", "n_frames")),
            *(number(name) for name in ("rate_numerator", "rate_denominator")),
            *(self.offsets, number("length"), self.ends, number("cend_length")),
            *(side for bound in bounds for side in (bound[:-1], bound[1:])),
            number("n_ancillary"),
        ]
        return list(zip(self.names, *(column.tolist() for column in columns), strict=True))

    @cached_property
    def _segments(self) -> Packed:
        return cast(Packed, self.index.segments.rows())

    @cached_property
    def _signals(self) -> list[SignalRow]:
        rows = cast(Packed, self.index.signals.rows())
        known = {row: SignalRow(*row) for row in set(rows)}  # an archive has few different ones
        return [known[row] for row in rows]

    def row(self, number: int) -> ClipRow:
        name, skeleton, n_frames, numerator, denominator, *places = self._fields[number]
        at, length, end, cend_length, first, stop, first_segment, stop_segment, more = places
        row = PackedClipRow(
            name,
            self.index.skeletons[skeleton],
            n_frames,
            numerator,
            denominator,
            tuple(self._signals[first:stop]),
            Chunk(ChunkType.CLIP, 0, at, length),
            cend=Chunk(ChunkType.CEND, 0, end - cend_length - FRAMING, cend_length),
        )
        row.keep_packed(lambda: self._segments[first_segment:stop_segment], parse_segments)
        if more:
            row.ancillary = self.ancillary(number + 1, end)
        return row

    def ancillary(self, group: int, start: int) -> list[Chunk]:
        """The ancillary chunks after clip ``group`` - 1, for group 0 after earlier clips."""
        first, stop = self.ancillary_bounds[group : group + 2]
        table = self.index.ancillary[first:stop]
        return [
            Chunk(kind, ChunkFlag.ANCILLARY, chunk.offset, chunk.length)
            for kind, chunk in zip(table.blobs("type"), _chunks_of(table, start), strict=True)
        ]

    def places(self) -> Iterator[Place]:
        size, cend_size = (self.clips.numbers(n) + FRAMING for n in ("length", "cend_length"))
        columns = self.offsets, size, self.ends - cend_size, cend_size
        return zip(*(column.tolist() for column in columns), strict=True)

    def groups_with(self, kind: bytes) -> Iterator[int]:
        """The groups that have an ancillary chunk of a type."""
        groups = [n for n, one in enumerate(self.index.ancillary.blobs("type")) if one == kind]
        yield from (np.searchsorted(self.ancillary_bounds, groups, side="right") - 1).tolist()


class _Clips:
    def __init__(self) -> None:
        self.names: list[str] = []
        self._tables: list[tuple[int, ClipTables]] = []  # with the number of the first clip
        self._behind: dict[int, list[Chunk]] = {}

    def add(self, tables: ClipTables) -> None:
        if tables.index.n_behind and not (self.names or tables.start):
            raise FormatError("INDX: ancillary chunks precede the first clip")
        if tables.index.n_behind and self.names:
            chunks = tables.ancillary(0, tables.start)
            self._behind.setdefault(len(self.names) - 1, []).extend(chunks)
        self._tables.append((len(self.names), tables))
        self.names += tables.names

    def row(self, number: int) -> ClipRow:
        first, tables = next(pair for pair in reversed(self._tables) if pair[0] <= number)
        row = tables.row(number - first)
        row.ancillary += self._behind.get(number, ())
        return row

    def places(self) -> list[Place]:
        return [place for _, tables in self._tables for place in tables.places()]

    def groups_with(self, kind: bytes) -> set[int]:
        """The numbers of the clips with an ancillary chunk of a type."""
        return {
            first + group - 1
            for first, tables in self._tables
            for group in tables.groups_with(kind)
        }


def parse_segments(clip: ClipRow, rows: Packed) -> list[SegmentRow]:
    segments: list[SegmentRow] = []
    model_row: SegmentRow | None = None  # has the mask of packets of kind 2
    first, where = [0] * len(clip.signals), f"INDX: clip {clip.name!r}"
    end = clip.clip.stop  # INDX-01
    for gap, size, signal, n_frames, lead, tail, flags in rows:
        if signal >= len(first):
            raise FormatError(f"{where} has a segment of signal {signal}, which does not exist")
        kind = next((kind for kind, bit in PACKETS.items() if flags & bit), 0)
        flags &= ~PACKETS.get(kind, 0)
        header = SegmentHeader(signal, first[signal], n_frames, lead, tail, flags)
        row = SegmentRow(end + gap, size, header, kind)
        if kind == FRAME:
            if header != SegmentHeader(0, first[0], 1, flags=flags & FRESH):
                raise FormatError(f"{where}: {header} cannot be a packet of kind {kind}")
            if model_row is not None:
                header = replace(header, flags=header.flags | MASKS)
                row = replace(row, header=header, mask_row=model_row)
        elif signal == 0:
            model_row = row if kind and flags & MASKS else None
        segments.append(row)
        first[signal] += n_frames
        end += gap + size
    return segments


class IndexCheck:
    """Compares each INDX of a file with the chunks before it."""

    def __init__(self) -> None:
        self._found: list[tuple[IndexPlace, int]] = []  # each with the length of its chain

    def check(self, payload: bytes, chunk: Chunk, directory: Directory, limit: int) -> None:
        """Compare the next INDX with the chunks; raises FormatError.

        ``limit`` bounds its inflated size.
        """
        where = f"chunk {chunk.label}"
        outer, content = _inflate(payload, chunk.offset, limit, where)
        since, depth = None, 1
        if outer.previous is not None:
            before = [(place, n) for place, n in self._found if place.chunk == outer.previous]
            if not before:  # INDX-06
                offset = outer.previous.offset
                raise FormatError(
                    f"it continues an INDX at {offset}, which is not there", where=where
                )
            since, depth = before[0][0], before[0][1] + 1
        if depth > MOST_INDEXES:  # INDX-07
            raise FormatError(f"it continues a chain of {depth - 1} others", where=where)
        rebuilt = index_record(directory, since)
        expected = build(rebuilt, where)
        if content[: len(expected)] != expected:  # INDX-04, INDX-05, INDX-08
            raise FormatError(_first_difference(parse(Index, content, where), rebuilt), where=where)
        name = index_name(build_chunk(chunk.type, payload, chunk.flags), chunk.offset)
        self._found.append((place_of(name, outer.size, directory), depth))


def _first_difference(index: Index, rebuilt: Index) -> str:
    for name, values in vars(index).items():
        expected = getattr(rebuilt, name)
        if name == "extension" or values == expected:
            continue
        if name == "head":
            return "its copy of HEAD differs from HEAD"
        if not isinstance(values, Table):
            return f"{name} is {values!r}, the file has {expected!r}"
        if len(values) != len(expected):
            return f"it lists {len(values)} {name}, there are {len(expected)}"
        for row, (one, other) in enumerate(zip(values, expected, strict=True)):
            for field, value in vars(one).items():
                if value != getattr(other, field):
                    return (
                        f"{name}.{row}.{field} is {value!r}, the file has {getattr(other, field)!r}"
                    )
    return "it is not in file order"
