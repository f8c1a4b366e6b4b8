"""Content of an array file beside its numbers: a template and a detail.

SPEC.md, "Template of arrays", is normative and has the tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import accumulate, pairwise

import numpy as np
from construct import If, IfThenElse, Int8ul, this
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.model.motion import Source
from mcz.model.schema import POSITIVE, SIZED, UVARINT, Record, build, counted, field, one_of, parse
from mcz.model.types import JsonObject

# Types of NumPy by their number in a template: |b1 to <f8, without byte order.
TYPES = ("b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8")
BIG_ENDIAN, BY_COLUMNS = 1, 2  # flags of a DATA piece
MAX_PIECES, MAX_RUNS = 2**16, 2**18  # of a file


class PieceKind(IntEnum):
    """Kind of a piece of a file."""

    TEXT = 0  # bytes that the template has
    OWN = 1  # bytes that the detail has
    COUNT = 2  # the number of rows, printed
    DATA = 3  # the numbers of an array
    CRC = 4  # CRC-32 of other pieces
    SIZE4 = 5  # how many bytes other pieces have, u32
    SIZE8 = 6  # the same, u64
    DEFLATE = 7  # the deflate stream of other pieces
    ROWS = 8  # the number of rows, an integer
    SIZE1 = 9  # how many bytes other pieces have, u8
    ITEMS = 11  # the number of rows times ``start``, an integer
    PART = 10  # no bytes: pieces after it are of some of the frames


SIZES = {
    PieceKind.SIZE1: 1,
    PieceKind.CRC: 4,
    PieceKind.SIZE4: 4,
    PieceKind.SIZE8: 8,
}  # bytes of these kinds
OF_PIECES = (*SIZES, PieceKind.DEFLATE)
_OF_START = (*OF_PIECES, PieceKind.PART, PieceKind.ITEMS)
_OF_SPAN = (*OF_PIECES, PieceKind.PART)
INTEGERS = (PieceKind.ROWS, PieceKind.ITEMS)
_OF_ROWS = (PieceKind.COUNT, PieceKind.DATA, *INTEGERS)
_OF_DETAIL = (PieceKind.OWN, PieceKind.DEFLATE)


def _if(kinds: Sequence[PieceKind], item: object) -> IfThenElse:
    condition = this.kind == int(kinds[0])
    for kind in kinds[1:]:
        condition |= this.kind == int(kind)
    return If(condition, item)


class ArrayRun(Record):
    """Channels in a row of an array, in ArrayPiece."""

    channel: int = field(UVARINT, "first channel")
    n_channels: int = field(POSITIVE, "channels, at least 1")  # ARRAY-03


class ArrayPiece(Record):
    """A piece of an array file."""

    kind: int = field(one_of(Int8ul, tuple(PieceKind)), "kind of the piece")  # ARRAY-01
    text: bytes | None = field(_if((PieceKind.TEXT,), SIZED), "TEXT only: the bytes")
    signal: int | None = field(
        _if(_OF_ROWS, UVARINT), "COUNT, DATA, ROWS and ITEMS only: index of the signal"
    )
    after: bytes | None = field(
        _if((PieceKind.COUNT,), SIZED), "COUNT only: bytes after the number"
    )
    size: int | None = field(
        _if((PieceKind.COUNT, *INTEGERS), UVARINT),
        "COUNT, ROWS and ITEMS only: bytes, those of blanks included",
    )
    type: int | None = field(
        _if((PieceKind.DATA,), one_of(Int8ul, tuple(range(len(TYPES))))),
        "DATA only: type of a number",
    )  # ARRAY-02
    flags: int | None = field(
        _if((PieceKind.DATA,), one_of(Int8ul, (0, 1, 2, 3))),
        "DATA only: bit 0: big-endian; 1: column after column",
    )  # ARRAY-04
    runs: list[ArrayRun] | None = field(
        _if((PieceKind.DATA,), counted(ArrayRun, kind="runs")), "DATA only: its columns, in order"
    )
    start: int | None = field(
        _if(_OF_START, UVARINT),
        "references: the first piece; PART: first frame number; ITEMS: factor",
    )
    stop: int | None = field(
        _if(_OF_SPAN, UVARINT), "references and PART only: after the last of these"
    )


class ArrayTemplate(Record):
    """Template of arrays."""

    pieces: list[ArrayPiece] = field(
        counted(ArrayPiece, MAX_PIECES), "the file, piece by piece"
    )  # ARRAY-17


class ArrayDetail(Record):
    """Detail of arrays."""

    parts: list[bytes] = field(
        counted(SIZED, MAX_PIECES), "an entry for each OWN and DEFLATE piece, in order"
    )


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a file; what does not go with its kind is empty. See ArrayPiece.

    ``part``: the first and stop of its frame numbers; None: all.
    """

    kind: PieceKind
    text: bytes = b""  # of OWN pieces, too; of a DEFLATE piece its part of the detail
    signal: int = 0
    after: bytes = b""
    size: int = 0
    type: int = 0
    flags: int = 0
    runs: tuple[tuple[int, int], ...] = ()  # (first channel, channels)
    start: int = 0
    stop: int = 0
    part: tuple[int, int] | None = None

    @property
    def n_columns(self) -> int:
        return sum(n for _, n in self.runs)

    @property
    def columns(self) -> NDArray[np.int64]:
        """The channels of all runs, in order."""
        runs = [np.arange(first, first + n) for first, n in self.runs]
        return np.concatenate(runs) if runs else np.zeros(0, np.int64)

    @property
    def dtype(self) -> str:
        """The type of a number as NumPy writes it."""
        return (">" if self.flags & BIG_ENDIAN else "<") + TYPES[self.type]


def build_arrays(pieces: Sequence[Piece]) -> tuple[bytes, bytes]:
    """The template and the detail of pieces."""
    fields = [
        ArrayPiece(
            kind=int(piece.kind),
            text=piece.text,
            signal=piece.signal,
            after=piece.after,
            size=piece.size,
            type=piece.type,
            flags=piece.flags,
            runs=[ArrayRun(channel=c, n_channels=n) for c, n in piece.runs],
            start=piece.start,
            stop=piece.stop,
        )
        for piece in pieces
    ]
    parts = [piece.text for piece in pieces if piece.kind in _OF_DETAIL]
    return (
        build(ArrayTemplate(pieces=fields), "source template"),
        build(ArrayDetail(parts=parts), "source detail"),
    )


def parse_arrays(template: bytes, detail: bytes) -> tuple[Piece, ...]:
    """The inverse of ``build_arrays``; raises FormatError on bad bytes."""
    limits = {"runs": MAX_RUNS}  # ARRAY-17
    fields = parse(ArrayTemplate, template, "source template", limits).pieces
    parts = list(parse(ArrayDetail, detail, "source detail").parts)
    n_parts = sum(row.kind in _OF_DETAIL for row in fields)
    if n_parts != len(parts):  # ARRAY-05
        raise FormatError(f"source detail: {len(parts)} parts, but {n_parts} pieces have one")
    own = iter(parts)
    pieces, part = [], None
    for row in fields:
        piece = Piece(
            PieceKind(row.kind),
            next(own) if row.kind in _OF_DETAIL else row.text or b"",
            row.signal or 0,
            row.after or b"",
            row.size or 0,
            row.type or 0,
            row.flags or 0,
            tuple((run.channel, run.n_channels) for run in row.runs or ()),
            row.start or 0,
            row.stop or 0,
            part,
        )
        if piece.kind == PieceKind.PART:
            part = piece.start, piece.stop
            if piece.start > piece.stop:  # ARRAY-33
                raise FormatError(f"source template: frames {piece.start} to {piece.stop} descend")
        pieces.append(piece)
    return tuple(pieces)


def n_file_pieces(pieces: Sequence[Piece]) -> int:
    """The number of pieces that are the file; the others are the contents of DEFLATE pieces."""
    return min((p.start for p in pieces if p.kind == PieceKind.DEFLATE), default=len(pieces))


def check_spans(pieces: Sequence[Piece]) -> None:
    """Raise FormatError if pieces refer to others that do not exist, or to themselves."""
    n_file = n_file_pieces(pieces)
    for index, piece in enumerate(pieces[n_file:], n_file):
        if piece.kind in OF_PIECES:  # ARRAY-18
            raise FormatError(
                f"source template: contents cannot have piece {index} of kind {piece.kind}"
            )
    spans = set()
    checks = [0, *accumulate(piece.kind == PieceKind.CRC for piece in pieces)]
    for piece in pieces:
        if piece.kind not in OF_PIECES:
            continue
        if not piece.start <= piece.stop <= len(pieces):  # ARRAY-06
            raise FormatError(
                f"source template: pieces {piece.start} to {piece.stop} exceed the {len(pieces)}"
            )
        if piece.start < n_file < piece.stop:  # ARRAY-19
            raise FormatError(
                f"source template: pieces {piece.start} to {piece.stop} mix file and contents"
            )
        if piece.kind == PieceKind.CRC:
            if checks[piece.start] != checks[piece.stop]:  # ARRAY-07
                raise FormatError("source template: a CRC-32 covers another one")
            if piece.start < piece.stop:  # no pieces overlap none
                spans.add((piece.start, piece.stop))
    end = 0
    for start, stop in sorted(spans):
        if start < end:  # ARRAY-08
            raise FormatError(
                f"source template: CRC-32 of pieces {start} to {stop} overlaps another"
            )
        end = stop


LOCAL, HEADER = b"PK\3\4", 30  # how a member of a ZIP begins; bytes before its name


def list_arrays(source: Source, signals: Sequence[str]) -> list[JsonObject]:
    """The arrays of a file in order: ``name type order columns signal``, ``name`` alone if kept.

    ``columns`` are the numbers of a row, ``order`` is "C" or "F"; ``signals`` are the names of the
    clip's. The name is "" in an NPY file. Raises FormatError on bad bytes.
    """
    pieces = parse_arrays(source.template, source.detail)
    members = members_of(pieces) if source.format == "npz" else [("", pieces)]
    return [list_pieces(name, own, signals) for name, own in members]


def members_of(pieces: Sequence[Piece]) -> list[tuple[str, Sequence[Piece]]]:
    """The members of an NPZ: the name of each array, and its pieces from its header on.

    Those of a deflated member are followed by the pieces of its contents.
    """
    n_file = n_file_pieces(pieces)
    starts = [
        index
        for index, piece in enumerate(pieces[:n_file])
        if piece.kind == PieceKind.TEXT and piece.text.startswith(LOCAL)
    ]
    return [
        (_name(pieces[start:]), (*own, *_contents(pieces, own)))
        for start, stop in pairwise((*starts, n_file))
        for own in (pieces[start:stop],)
    ]


def _contents(pieces: Sequence[Piece], own: Sequence[Piece]) -> Iterator[Piece]:
    for piece in own:
        if piece.kind == PieceKind.DEFLATE:
            yield from pieces[piece.start : piece.stop]


def list_pieces(name: str, pieces: Sequence[Piece], signals: Sequence[str]) -> JsonObject:
    """The array of these pieces, see ``list_arrays``."""
    listed = {"name": name} | dict.fromkeys(("type", "order", "columns", "signal"))
    for piece in pieces:
        if piece.kind == PieceKind.DATA:
            listed |= {
                "type": (">" if piece.flags & BIG_ENDIAN else "<") + TYPES[piece.type],
                "order": "F" if piece.flags & BY_COLUMNS else "C",
                "columns": piece.n_columns,
                "signal": signals[piece.signal] if piece.signal < len(signals) else "",
            }
    return listed


def _name(pieces: Sequence[Piece]) -> str:
    """The name in a local header, which begins with the first of ``pieces``."""
    header = b""
    for piece in pieces:
        if piece.kind == PieceKind.TEXT:
            header += piece.text
        elif piece.kind in SIZES:
            header += bytes(SIZES[piece.kind])
        else:
            break
    size = int.from_bytes(header[26:28], "little")
    return header[HEADER : HEADER + size].decode("utf-8", "replace").removesuffix(".npy")
