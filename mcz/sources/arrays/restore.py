"""Signals, template and detail -> the bytes of an array file.

SPEC.md, "The bytes of arrays", is normative.
"""

from __future__ import annotations

import zlib
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, LimitError
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Motion, Signal
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Ints, Items
from mcz.sources.arrays.archive import Archive, ArchiveMember
from mcz.sources.arrays.columns import NpyHead, file_columns
from mcz.sources.arrays.deflate import describe_stream, restore_stream
from mcz.sources.arrays.layout import (
    BIG_ENDIAN,
    BY_COLUMNS,
    INTEGERS,
    OF_PIECES,
    SIZES,
    TYPES,
    Piece,
    PieceKind,
    check_spans,
    n_file_pieces,
    parse_arrays,
)

SIZE_LIMIT = 2**26  # a file may always be that large,
SIZE_PER_VALUE = 64  # or that large for each value of the clip
MAX_COLUMNS = 2**22  # of all arrays
ROW_SIZES = (1, 2, 4)  # bytes of ROWS
WIDEST = 2**53  # integers beyond it are on no grid
BINARY = {4: Grid(GridKind.BINARY32), 8: Grid(GridKind.BINARY64)}


def restore_arrays(motion: Motion) -> bytes:
    """The file that the source and all signals of ``motion`` make.

    Raises FormatError if the source does not belong to such a motion, and LimitError for a file
    beyond the limits above.
    """
    source = motion.source
    assert source is not None
    parsed = parse_arrays(source.template, source.detail)
    check_spans(parsed)
    stored = _Stored(motion)
    n_columns = sum(piece.n_columns for piece in parsed)
    if n_columns > MAX_COLUMNS:
        raise LimitError(f"source template: {n_columns} columns, limit {MAX_COLUMNS}")
    pieces = _restore_streams(parsed, stored)
    starts = _starts(pieces, stored)
    out = bytearray(starts[-1])
    for piece, at, stop in zip(pieces, starts, starts[1:], strict=False):
        if piece.kind != PieceKind.CRC:
            out[at:stop] = _bytes(piece, stored, starts)
    known: dict[tuple[int, int], bytes] = {}
    for piece, at in zip(pieces, starts, strict=False):
        if piece.kind == PieceKind.CRC:  # ARRAY-15
            span = starts[piece.start], starts[piece.stop]
            if span not in known:
                known[span] = zlib.crc32(memoryview(out)[slice(*span)]).to_bytes(4, "little")
            out[at : at + 4] = known[span]
    return bytes(memoryview(out)[: starts[n_file_pieces(pieces)]])


class _Stored:
    """The signals of a motion as the file has them, and the rows of each piece."""

    def __init__(self, motion: Motion) -> None:
        self.signals = [signal.as_stored() for signal in motion.signals]
        self._numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
        self._ordinals: dict[int, Ints] = {}

    def signal(self, piece: Piece) -> Signal:
        if piece.signal >= len(self.signals):  # ARRAY-09
            raise FormatError(
                f"source template: no signal {piece.signal} among {len(self.signals)}"
            )
        return self.signals[piece.signal]

    def rows(self, piece: Piece) -> range:
        """The rows of its signal that a COUNT, DATA or ROWS piece is of."""
        signal = self.signal(piece)
        if piece.part is None:
            return range(signal.n_rows)
        first, stop = np.searchsorted(self._numbers, piece.part).tolist()  # ARRAY-34
        return range(first * signal.samples_per_frame, stop * signal.samples_per_frame)

    def ordinals(self, piece: Piece) -> Ints:
        """The ordinals of the signal of a piece."""
        if piece.signal not in self._ordinals:
            self._ordinals[piece.signal] = self.signal(piece).to_ordinals()[0]
        return self._ordinals[piece.signal]


def _starts(pieces: Sequence[Piece], stored: _Stored) -> list[int]:
    """The offset of each piece, and the size of all; raises LimitError for too large a one."""
    starts = [0, *accumulate(_size(piece, stored) for piece in pieces)]
    most = max(SIZE_LIMIT, SIZE_PER_VALUE * sum(signal.values.size for signal in stored.signals))
    if starts[-1] > most:
        raise LimitError(f"source template: a file of {starts[-1]} bytes, limit {most}")
    return starts


def _restore_streams(pieces: Sequence[Piece], stored: _Stored) -> Sequence[Piece]:
    """``pieces`` with the stream itself as the text of each DEFLATE piece."""
    if n_file_pieces(pieces) == len(pieces):
        return pieces
    _starts(pieces, stored)
    return [
        replace(piece, text=restore_stream(piece.text, _contents(piece, pieces, stored)))
        if piece.kind == PieceKind.DEFLATE
        else piece
        for piece in pieces
    ]


def _contents(piece: Piece, pieces: Sequence[Piece], stored: _Stored) -> bytes:
    return b"".join(_bytes(part, stored, ()) for part in pieces[piece.start : piece.stop])


def _size(piece: Piece, stored: _Stored) -> int:
    """The bytes of a piece; raises FormatError if it does not fit the signals."""
    match piece.kind:
        case PieceKind.TEXT | PieceKind.OWN | PieceKind.DEFLATE:
            return len(piece.text)
        case PieceKind.COUNT | PieceKind.ROWS | PieceKind.ITEMS:
            stored.signal(piece)
            if piece.kind in INTEGERS and piece.size not in ROW_SIZES:  # ARRAY-30
                raise FormatError(
                    f"source template: a number of rows cannot have {piece.size} bytes"
                )
            return piece.size
        case PieceKind.DATA:
            signal = stored.signal(piece)
            if any(first + n > signal.n_channels for first, n in piece.runs):  # ARRAY-10
                raise FormatError(
                    f"source template: a run exceeds the {signal.n_channels} channels of signal "
                    f"{signal.name!r}"
                )
            return len(stored.rows(piece)) * piece.n_columns * int(TYPES[piece.type][1])
    return SIZES.get(piece.kind, 0)


def _bytes(piece: Piece, stored: _Stored, starts: Sequence[int]) -> Any:
    """The bytes of a piece of any kind but CRC."""
    if piece.kind in SIZES:
        size = SIZES[piece.kind]
        number = starts[piece.stop] - starts[piece.start]
        if number >= 256**size:  # ARRAY-12, ARRAY-32
            raise FormatError(f"source template: a size of {number} does not fit {size} bytes")
        return number.to_bytes(8, "little")[:size]
    if piece.kind in INTEGERS:
        number = len(stored.rows(piece)) * (piece.start if piece.kind == PieceKind.ITEMS else 1)
        if number >= 2 ** (8 * piece.size - (piece.size == 4)):  # ARRAY-31
            raise FormatError(f"source template: {number} does not fit {piece.size} bytes")
        return number.to_bytes(8, "little")[: piece.size]
    if piece.kind == PieceKind.COUNT:  # ARRAY-13
        text = b"%d" % len(stored.rows(piece)) + piece.after
        if len(text) > piece.size:  # ARRAY-11
            raise FormatError(f"source template: a count of {len(text)} bytes, not {piece.size}")
        return text.ljust(piece.size)
    if piece.kind == PieceKind.DATA:
        return _words(piece, stored)
    return piece.text


def _words(piece: Piece, stored: _Stored) -> memoryview:
    """The numbers of a DATA piece, as it stores them."""
    kind, size = TYPES[piece.type][0], int(TYPES[piece.type][1])
    columns: Any = piece.columns
    if len(piece.runs) == 1:
        columns = slice(piece.runs[0][0], sum(piece.runs[0]))
    rows = stored.rows(piece)
    cells = slice(rows.start, rows.stop), columns
    values = stored.signal(piece).values[cells]
    if kind == "f":
        words = _floats(values, piece, stored, cells)
    else:
        words = _integers(values, kind, size)
    if piece.flags & BY_COLUMNS:
        words = words.T
    return np.ascontiguousarray(words, piece.dtype).reshape(-1).view(np.uint8).data


def _floats(values: Items, piece: Piece, stored: _Stored, cells: Any) -> Items:
    """Items as floats; NaNs keep the bits that a binary grid of their type has.

    ``cells`` are the rows and columns of ``values`` in the signal.
    """
    signal, type_ = stored.signal(piece), TYPES[piece.type]
    with np.errstate(over="ignore", invalid="ignore"):
        words = values.astype(type_)  # ARRAY-14
    invalid = np.isnan(words)
    if signal.mask is not None:
        invalid |= ~signal.mask[cells]
    if not invalid.any():
        return words
    bits = words.view(f"u{words.itemsize}")
    canonical = {2: 0x7E00, 4: 0x7FC00000, 8: 0x7FF8000000000000}[words.itemsize]
    bits[invalid] = canonical
    grid = BINARY.get(words.itemsize)
    nan = np.isnan(values)
    if grid is not None and nan.any():
        is_stored = nan & _on_grid(signal, grid.kind)[cells]
        bits[is_stored] = grid.bits(stored.ordinals(piece)[cells][is_stored])
    return words


def _on_grid(signal: Signal, kind: GridKind) -> NDArray[np.bool_]:
    """Mask of the values on a grid of that kind, (rows, channels)."""
    is_on_grid = np.zeros(signal.values.shape, np.bool_)
    for rows, columns, grid in signal.grid_blocks():
        if grid.kind == kind:
            is_on_grid[rows, columns] = True
    return is_on_grid


def _integers(values: Items, kind: str, size: int) -> Items:
    """Items as integers of a type, rounded and limited to what it holds."""
    low, high = (-(2 ** (8 * size - 1)), 2 ** (8 * size - 1) - 1) if kind == "i" else (0, 1)
    high = 2 ** (8 * size) - 1 if kind == "u" else high
    if values.dtype == np.float64:
        values = np.rint(np.where(np.isnan(values), 0, values))
    limited: Items = np.clip(values, max(low, -WIDEST), min(high, WIDEST))  # ARRAY-14
    return limited.astype(f"{'u' if kind == 'b' else kind}{size}")


MAX_OWN = 1024  # bytes of an array that are the clip's own; more go into the template


@dataclass(frozen=True, slots=True)
class Placed:
    """An array and where its columns are: the signal, and the channel of each column.

    ``part`` are the frame numbers of its rows, see ``Piece``.
    """

    head: NpyHead
    signal: int
    channels: Sequence[int]
    part: tuple[int, int] | None = None


def pieces_of(
    archive: Archive, placed: Sequence[Placed], unread: Sequence[tuple[int, int]]
) -> list[Piece]:
    """The pieces of a file; ``unread`` are the spans of numbers that are in no signal."""
    data = archive.data
    spans = [_of_stream(data, member) for member in archive.members if _is_restored(member)]
    for array in placed:
        spans += _of_array(data, array)
    for start, stop in unread:
        if stop - start <= MAX_OWN:
            spans.append((start, stop, Piece(PieceKind.OWN, data[start:stop])))
    for field in archive.fields:
        piece = Piece(field.kind, start=field.start, stop=field.stop)
        spans.append((field.at, field.at + SIZES[field.kind], piece))
    spans.sort(key=lambda span: span[:2])
    referring = [piece for _, _, piece in spans if piece.kind in OF_PIECES]
    cuts = {0, archive.size, len(data), *(cut for p in referring for cut in (p.start, p.stop))}
    starts, pieces = _cut_pieces(data, spans, sorted(cuts))
    return [
        replace(piece, start=bisect_left(starts, piece.start), stop=bisect_left(starts, piece.stop))
        if piece.kind in OF_PIECES
        else piece
        for piece in pieces
    ]


def _is_restored(member: ArchiveMember) -> bool:
    """Return True if the stream of a member is restored from its contents."""
    return member.is_deflated and member.contents is not None and member.size > 0


def _of_stream(data: bytes, member: ArchiveMember) -> tuple[int, int, Piece]:
    assert member.contents is not None
    start, stop = member.contents
    part = describe_stream(data[member.start : member.stop], data[start:stop])
    return member.start, member.stop, Piece(PieceKind.DEFLATE, part, start=start, stop=stop)


def _cut_pieces(
    data: bytes, spans: Sequence[tuple[int, int, Piece]], cuts: Sequence[int]
) -> tuple[list[int], list[Piece]]:
    """The pieces of all spans with the text between, cut if others point; their offsets.

    A PART stands where the frames become others.
    """
    starts: list[int] = []
    pieces: list[Piece] = []
    at, part = 0, None
    for start, stop, piece in (*spans, (len(data), len(data), Piece(PieceKind.TEXT))):
        inner = cuts[bisect_left(cuts, at + 1) : bisect_left(cuts, start)]
        for low, high in zip((at, *inner), (*inner, start), strict=True):
            if low < high:
                starts.append(low)
                pieces.append(Piece(PieceKind.TEXT, data[low:high]))
        if piece.part is not None and piece.part != part:
            part = piece.part
            starts.append(start)
            pieces.append(Piece(PieceKind.PART, start=part[0], stop=part[1]))
        if start < stop:
            starts.append(start)
            pieces.append(piece)
        at = stop
    return starts, pieces


def _of_array(data: bytes, array: Placed) -> list[tuple[int, int, Piece]]:
    """The counts in the head of an array, and its numbers."""
    head = array.head
    low, high = head.rows_at
    count = Piece(PieceKind.ROWS, signal=array.signal, size=high - low, part=array.part)
    if head.is_printed:
        high = head.end
        while high < head.start and data[high : high + 1] == b" ":
            high += 1
        after = data[head.rows_at[1] : head.end]
        count = replace(count, kind=PieceKind.COUNT, after=after, size=high - low)
    flags = BIG_ENDIAN * head.big_endian + BY_COLUMNS * head.is_fortran
    order = file_columns(head)
    channels = [array.channels[column] for column in order.tolist()]
    numbers = Piece(
        PieceKind.DATA,
        signal=array.signal,
        type=TYPES.index(head.code),
        flags=flags,
        runs=tuple(_runs(channels)),
        part=array.part,
    )
    low_items, high_items = head.items_at
    factor = len(channels)
    items = replace(count, kind=PieceKind.ITEMS, size=high_items - low_items, start=factor)
    spans = [(low, high, count), (head.start, head.start + head.size, numbers)]
    return [*spans, (low_items, high_items, items)] if high_items else spans


def _runs(channels: Sequence[int]) -> list[tuple[int, int]]:
    """Channels as runs of neighbors: the first of each and how many."""
    runs = []
    for _, group in groupby(enumerate(channels), lambda pair: pair[1] - pair[0]):
        members = [channel for _, channel in group]
        runs.append((members[0], len(members)))
    return runs
