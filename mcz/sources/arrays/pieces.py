"""An array file cut into pieces: what numbers and other pieces say is left out."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from mcz.sources.arrays.archive import Archive
from mcz.sources.arrays.columns import file_columns
from mcz.sources.arrays.header import Head
from mcz.sources.arrays.layout import BIG_ENDIAN, BY_COLUMNS, TYPES, Kind, Piece

MAX_OWN = 1024  # bytes of an array that are the clip's own; more go into the template


@dataclass(frozen=True, slots=True)
class Placed:
    """An array and where its columns are: the signal, and the channel of each column."""

    head: Head
    signal: int
    channels: Sequence[int]


def pieces_of(
    data: bytes, placed: Sequence[Placed], archive: Archive, kept: Sequence[tuple[int, int]]
) -> list[Piece]:
    """The pieces of a file; ``kept`` are the spans of numbers that are in no signal."""
    spans: list[tuple[int, int, Piece]] = []
    for array in placed:
        spans += _of_array(data, array)
    for start, stop in kept:
        if stop - start <= MAX_OWN:
            spans.append((start, stop, Piece(Kind.OWN, data[start:stop])))
    for field in archive.fields:
        size = 8 if field.kind == Kind.SIZE8 else 4
        piece = Piece(field.kind, start=field.start, stop=field.stop)
        spans.append((field.at, field.at + size, piece))
    spans.sort(key=lambda span: span[:2])
    cuts = {0, len(data), *(cut for field in archive.fields for cut in (field.start, field.stop))}
    starts, pieces = _cut_pieces(data, spans, sorted(cuts))
    return [
        replace(piece, start=bisect_left(starts, piece.start), stop=bisect_left(starts, piece.stop))
        if piece.kind in (Kind.CRC, Kind.SIZE4, Kind.SIZE8)
        else piece
        for piece in pieces
    ]


def _cut_pieces(
    data: bytes, spans: Sequence[tuple[int, int, Piece]], cuts: Sequence[int]
) -> tuple[list[int], list[Piece]]:
    """The pieces of all spans with the text between, cut where others point; their offsets."""
    starts: list[int] = []
    pieces: list[Piece] = []
    at = 0
    for start, stop, piece in (*spans, (len(data), len(data), Piece(Kind.TEXT))):
        inner = cuts[bisect_left(cuts, at + 1) : bisect_left(cuts, start)]
        for low, high in zip((at, *inner), (*inner, start), strict=True):
            if low < high:
                starts.append(low)
                pieces.append(Piece(Kind.TEXT, data[low:high]))
        if start < stop:
            starts.append(start)
            pieces.append(piece)
        at = stop
    return starts, pieces


def _of_array(data: bytes, array: Placed) -> list[tuple[int, int, Piece]]:
    """The count in the head of an array, and its numbers."""
    head = array.head
    low = head.rows_at[0]
    high = head.end
    while high < head.start and data[high : high + 1] == b" ":
        high += 1
    after = data[head.rows_at[1] : head.end]
    count = Piece(Kind.COUNT, signal=array.signal, after=after, size=high - low)
    flags = BIG_ENDIAN * head.big_endian + BY_COLUMNS * head.by_columns
    order = file_columns(head)
    channels = [array.channels[column] for column in order.tolist()]
    numbers = Piece(
        Kind.DATA,
        signal=array.signal,
        type=TYPES.index(head.code),
        flags=flags,
        runs=tuple(_runs(channels)),
    )
    return [(low, high, count), (head.start, head.start + head.size, numbers)]


def _runs(channels: Sequence[int]) -> list[tuple[int, int]]:
    """Channels as runs of neighbors: the first of each and how many."""
    runs = []
    for _, group in groupby(enumerate(channels), lambda pair: pair[1] - pair[0]):
        members = [channel for _, channel in group]
        runs.append((members[0], len(members)))
    return runs
