"""The payload of DATA: one segment, its stream table first, and its masks and group notes.

SPEC.md, "DATA", "Masks" and "Group notes", are normative. Tables are bulk data, so they are read
and written by hand.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as slot

import numpy as np
from numpy.typing import NDArray

from mcz.errors import ChecksumError, FormatError, TruncatedError
from mcz.model.motion import Exceptions
from mcz.model.numbers import GRID, Grid, values_of_texts
from mcz.model.schema import (
    EXTENDED,
    MAX_COUNT,
    SIZED,
    UVARINT,
    Record,
    counted,
    field,
    parse,
    read_varint,
    varint,
)

FRESH, FRAME_NOTES, GROUP_NOTES, MASKS = 1, 2, 4, 8
KNOWN_FLAGS = 15 | EXTENDED


@dataclass(frozen=True, slots=True)
class StreamCounts:
    """Counts of one signal's streams, from CLIP."""

    n_groups: int
    n_resolutions: int

    def total(self, flags: int) -> int:
        """Streams of a segment with ``flags``."""
        notes = bool(flags & FRAME_NOTES) + self.n_groups * bool(flags & GROUP_NOTES)
        return notes + self.n_groups * (bool(flags & MASKS) + self.n_resolutions)


@dataclass(frozen=True, slots=True)
class SegmentHeader:
    """The fields of a segment before its table."""

    signal: int
    first: int
    n_frames: int
    lead: int = 0
    tail: int = 0
    flags: int = FRESH

    @property
    def stop(self) -> int:
        return self.first + self.n_frames


@dataclass(frozen=True, slots=True)
class StreamTable:
    """Places of streams in a payload; an empty one has length 0.

    ``size`` is the offset of the first stream.
    """

    header: SegmentHeader
    counts: StreamCounts
    size: int
    offsets: tuple[int, ...]
    lengths: tuple[int, ...]
    extension: bytes = b""
    _codec_start: int = slot(init=False, repr=False, compare=False)  # needed for each stream

    def __post_init__(self) -> None:
        n_coded = self.counts.n_groups * self.counts.n_resolutions
        object.__setattr__(self, "_codec_start", len(self.lengths) - n_coded)

    @property
    def payload_size(self) -> int:
        return self.size + sum(self.lengths)

    def frame_notes(self) -> int | None:
        """Index of the frame notes, None if the segment has none."""
        return 0 if self.header.flags & FRAME_NOTES else None

    def group_notes(self, group: int) -> int | None:
        if not self.header.flags & GROUP_NOTES:
            return None
        return bool(self.header.flags & FRAME_NOTES) + group  # DATA-03

    def mask(self, group: int) -> int | None:
        if not self.header.flags & MASKS:
            return None
        return self._codec_start - self.counts.n_groups + group  # DATA-03

    def codec(self, resolution: int, group: int) -> int:
        """Index of the codec's stream; resolution 0 is the coarsest here, as stored."""
        return self._codec_start + resolution * self.counts.n_groups + group

    def runs(self, indices: Sequence[int], gap: int) -> list[list[int]]:
        """The streams ``indices``, ascending, in runs to be read together; empty ones join any."""
        runs: list[list[int]] = []
        end = 0
        for index in indices:
            if runs and self.offsets[index] - end <= gap:
                runs[-1].append(index)
            else:
                runs.append([index])
            end = self.offsets[index] + self.lengths[index]
        return runs


def build_segment(header: SegmentHeader, streams: Sequence[bytes], extension: bytes = b"") -> bytes:
    """The DATA payload; ``streams`` in stored order, without absent kinds.

    ``extension`` is written if the flags of ``header`` include it.
    """
    present = bytearray((len(streams) + 7) // 8)
    for index, stream in enumerate(streams):
        if stream:
            present[index // 8] |= 1 << index % 8
    table = b"".join(
        (
            *map(varint, (header.signal, header.first, header.n_frames, header.lead, header.tail)),
            bytes((header.flags,)),
            bytes(present),
            *(varint(len(stream)) for stream in streams if stream),
            varint(len(extension)) + extension if header.flags & EXTENDED else b"",
        )
    )
    return b"".join((table, struct.pack("<I", zlib.crc32(table)), *streams))


def parse_segment_header(data: bytes) -> tuple[SegmentHeader, int]:
    """Parse the fields before the table, unchecked; return them and the offset after them."""
    at, fields = 0, []
    for _ in range(5):
        value, at = read_varint(data, at)
        fields.append(value)
    if at >= len(data):
        raise TruncatedError(f"the segment header is truncated at byte {at}")
    flags = data[at]
    if flags & ~KNOWN_FLAGS:
        raise FormatError(f"segment flags {flags:#x}: bits {flags & ~KNOWN_FLAGS:#x} are reserved")
    if fields[2] == 0:  # DATA-07
        raise FormatError("a segment must have at least one frame")
    if fields[1] + fields[2] + fields[4] > MAX_COUNT or fields[3] > fields[1]:  # CONV-18, DATA-10
        raise FormatError(
            f"segment of {fields[2]} frames from {fields[1]} on, lead and tail {fields[3:]}: "
            "out of range"
        )
    signal, first, n_frames, lead, tail = fields
    return SegmentHeader(signal, first, n_frames, lead, tail, flags), at + 1


def parse_stream_table(data: bytes, counts: StreamCounts) -> StreamTable:
    """The table at the start of ``data``, which may be cut after it.

    Raises TruncatedError if ``data`` ends inside the table.
    """
    header, at = parse_segment_header(data)
    n_streams = counts.total(header.flags)
    bitmap_size = (n_streams + 7) // 8
    if at + bitmap_size > len(data):
        raise TruncatedError(
            f"the stream table is truncated after {len(data)} bytes, in its bitmap"
        )
    bitmap = int.from_bytes(data[at : at + bitmap_size], "little")
    if bitmap >> n_streams:  # DATA-05
        raise FormatError(f"the stream bitmap has bits set beyond its {n_streams} streams")
    at += bitmap_size
    lengths = []
    for index, is_present in enumerate(reversed(f"{bitmap:0{n_streams}b}"[:n_streams])):
        length = 0
        if is_present == "1":
            length, at = read_varint(data, at)
            if length == 0:  # DATA-04
                raise FormatError(f"stream {index} is marked as present, but has no bytes")
        lengths.append(length)
    extension = b""
    if header.flags & EXTENDED:  # CONV-10
        size, at = read_varint(data, at)
        extension, at = data[at : at + size], at + size
    if at + 4 > len(data):
        raise TruncatedError(f"the stream table is truncated after {len(data)} bytes")
    (stored,) = struct.unpack_from("<I", data, at)
    if stored != zlib.crc32(data[:at]):  # CHUNK-06, DATA-02
        raise ChecksumError(f"the table_crc of a segment is {stored:#010x}, which is wrong")
    offsets, offset = [], at + 4
    for length in lengths:
        offsets.append(offset)
        offset += length
    return StreamTable(header, counts, at + 4, tuple(offsets), tuple(lengths), extension)


def mask_of(segment: bytes) -> bytes:
    """The mask that packets of kind 2 after the packet of a ``segment`` imply."""
    header, _ = parse_segment_header(segment)
    if not header.flags & MASKS:
        return b""
    if header.n_frames != 1:  # PACK-21
        raise FormatError(f"the masks of a frame packet cover {header.n_frames} frames, not one")
    table = parse_stream_table(segment, StreamCounts(1, 1))
    index = table.mask(0) or 0
    return segment[table.offsets[index] : table.offsets[index] + table.lengths[index]]


def frame_table(
    header: SegmentHeader, counts: StreamCounts, size: int, mask_size: int
) -> StreamTable:
    """The table of a packet of kind 2: its body of ``size`` bytes is one stream, its mask implied.

    The mask, if it has one, is the first stream.
    """
    if (counts.n_groups, counts.n_resolutions) != (1, 1):  # PACK-13
        raise FormatError(
            f"frame {header.first}: a packet without a table, but the signal has "
            f"{counts.n_groups} groups and {counts.n_resolutions} resolutions"
        )
    if header.flags & MASKS:
        return StreamTable(header, counts, 0, (0, 0), (mask_size, size))
    return StreamTable(header, counts, 0, (0,), (size,))


Mask = NDArray[np.bool_]


def build_mask(mask: Mask) -> bytes:
    """The runs of a mask of shape (n_rows, n_channels), column after column."""
    flat = np.concatenate([[True], mask.T.reshape(-1)])
    edges = [0, *np.flatnonzero(np.diff(flat)).tolist(), mask.size]
    runs = [b - a for a, b in zip(edges, edges[1:], strict=False)]
    return b"".join(map(varint, runs))


def parse_mask(data: bytes, n_rows: int, n_channels: int, name: str) -> Mask:
    """The mask of shape (n_rows, n_channels); raises FormatError."""
    size = n_rows * n_channels
    flat = np.ones(size, np.bool_)
    at = start = 0
    valid = True
    while at < len(data):
        run, after = read_varint(data, at)
        if run > size - start or (run == 0 and at > 0):  # MASK-02
            raise FormatError(
                f"a mask run of {run} values at {start} exceeds the mask of {size}", clip=name
            )
        flat[start : start + run] = valid
        start, at, valid = start + run, after, not valid
    if start != size:  # MASK-03
        raise FormatError(f"a mask has {start} values; expected {size}", clip=name)
    return flat.reshape(n_channels, n_rows).T  # MASK-01


class GridChange(Record):
    """A grid that differs from the clip's, in GROUP_NOTES."""

    channel: int = field(UVARINT, "channel, counted within the group")
    grid: Grid = field(GRID, "its grid in this segment")


class OddToken(Record):
    """A token that its grid does not print, in GROUP_NOTES."""

    row: int = field(UVARINT, "rows after the exception before, or after the segment's first row")
    channel: int = field(UVARINT, "channel, counted within the group")
    text: bytes = field(SIZED, "the token")


class GroupNotes(Record):
    """The notes stream of a group in a segment."""

    grid_changes: list[GridChange] = field(
        counted(GridChange), "grids that differ from the clip's", default=[]
    )
    exceptions: list[OddToken] = field(
        counted(OddToken), "tokens that the grid does not print, sorted", default=[]
    )


# Grid changes (channel, grid) and exceptions (row, channel, text) of one group in one segment.
ParsedNotes = tuple[list[tuple[int, Grid]], list[tuple[int, int, bytes]]]


class Noted:
    """Notes of segments on ``n_rows`` rows, whose grids in CLIP are ``baseline``."""

    def __init__(self, baseline: Sequence[Grid], n_rows: int) -> None:
        self._baseline, self._n_rows = baseline, n_rows
        self._grids: dict[int, dict[int, Grid]] = {}  # by row, grids that differ from CLIP
        self._exceptions: list[tuple[int, int, bytes]] = []
        self._row = 0

    def begin(self, row: int) -> None:
        """Begin a segment at ``row``, which may be before the first row of the range."""
        self._row = max(0, row)
        self._grids.setdefault(self._row, {})

    def add(self, shift: int, columns: Sequence[int], notes: ParsedNotes) -> None:
        """Add the notes of a group with the first row ``shift`` and the channels ``columns``."""
        for channel, grid in notes[0]:
            self._grids[self._row][columns[channel]] = grid
        self._exceptions += [
            (shift + row, columns[channel], text)
            for row, channel, text in notes[1]
            if 0 <= shift + row < self._n_rows
        ]

    def exceptions(self) -> Exceptions:
        entries = sorted(self._exceptions)
        return Exceptions(
            np.array([row for row, _, _ in entries], np.int64),
            np.array([column for _, column, _ in entries], np.int64),
            tuple(text for _, _, text in entries),
        )

    def grid_changes(self) -> tuple[tuple[int, int, Grid], ...]:
        """Convert grids stated segment by segment to changes from the row before."""
        changes: list[tuple[int, int, Grid]] = []
        if not any(self._grids.values()):
            return ()
        current = list(self._baseline)
        for row in sorted(self._grids):
            for column, grid in enumerate(self._baseline):
                new_grid = self._grids[row].get(column, grid)  # NOTES-06
                if new_grid != current[column]:
                    changes.append((row, column, new_grid))
                    current[column] = new_grid
        return tuple(changes)


def parse_group_notes(data: bytes, n_rows: int, grids: Sequence[Grid], name: str) -> ParsedNotes:
    """Grid changes (channel, grid) and exceptions (row, channel, text) of one group.

    ``grids`` are those of its channels in CLIP.
    """
    if not data:
        return [], []
    where = f"clip {name!r}, group notes"
    fields = _group_notes(data, where)
    n_channels = len(grids)
    changes = [(c.channel, c.grid) for c in fields.grid_changes]
    channels = [channel for channel, _ in changes]
    # NOTES-02, NOTES-03
    if channels != sorted(set(channels)) or any(c >= n_channels for c in channels):
        raise FormatError(f"grid changes of nonexistent channels {channels}", where=where)
    current = dict(enumerate(grids)) | dict(changes)  # NOTES-08
    row, last, exceptions = 0, (-1, -1), []
    for e in fields.exceptions:
        row += e.row
        # NOTES-03, NOTES-04, NOTES-05
        if row >= n_rows or e.channel >= n_channels or (row, e.channel) <= last:
            raise FormatError(
                f"exception outside the segment: row {row}, channel {e.channel}", where=where
            )
        if not current[e.channel].is_text:  # NOTES-08
            raise FormatError(
                f"an exception needs a text grid, but the grid is {current[e.channel]}", where=where
            )
        last = row, e.channel
        exceptions.append((row, e.channel, bytes(e.text)))
    return changes, exceptions


def values_of_exceptions(texts: Sequence[bytes], name: str) -> NDArray[np.float64]:
    """The numbers that exceptions spell; raises FormatError for a bad one."""
    values, bad = values_of_texts(texts)  # TEXT-05
    if bad.any():
        text = texts[int(np.argmax(bad))]
        raise FormatError(f"exception {text[:40]!r} is not a number", clip=name)
    return values


_known: dict[bytes, GroupNotes] = {}
MOST_KNOWN, MOST_BYTES = 1024, 64  # notes that are kept, and bytes of one


def _group_notes(data: bytes, where: str) -> GroupNotes:
    """The record of ``data``; shared, since many groups have equal short notes: read-only."""
    fields = _known.get(data)
    if fields is None:
        fields = parse(GroupNotes, data, where)
        if len(data) <= MOST_BYTES:
            if len(_known) >= MOST_KNOWN:
                _known.clear()  # as other threads may do: nothing is iterated over
            _known[data] = fields
    return fields
