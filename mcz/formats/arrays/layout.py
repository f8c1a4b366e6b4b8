"""What an array file holds beside its numbers, as a template and a detail.

SPEC.md, "Template of arrays", is normative and has the tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.schema import (
    SIZED,
    UVARINT,
    ExprValidator,
    If,
    Int8ul,
    OneOf,
    Struct,
    build,
    counted,
    parse,
)
from mcz.schema.fields import Field, IfThenElse

# Types of NumPy by their number in a template: |b1 to <f8, without byte order.
TYPES = ("b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8")
BIG_ENDIAN, BY_COLUMNS = 1, 2  # flags of a DATA piece
MAX_PIECES, MAX_RUNS = 2**16, 2**18  # of a file


class Kind(IntEnum):
    """What a piece of a file is."""

    TEXT = 0  # bytes that the template has
    OWN = 1  # bytes that the detail has
    COUNT = 2  # the number of rows, printed
    DATA = 3  # the numbers of an array
    CRC = 4  # CRC-32 of other pieces
    SIZE4 = 5  # how many bytes other pieces have, u32
    SIZE8 = 6  # the same, u64


_OF_ROWS = (Kind.COUNT, Kind.DATA)
_OF_PIECES = (Kind.CRC, Kind.SIZE4, Kind.SIZE8)


def _if(kinds: Sequence[Kind], item: Field) -> IfThenElse:
    return If(lambda fields: fields.kind in kinds, item)


ARRAY_RUN = Struct(
    "channel" / UVARINT * "first channel",
    # ARRAY-03
    "n_channels" / ExprValidator(UVARINT, lambda n, ctx: n >= 1) * "channels, at least 1",
)
ARRAY_PIECE = Struct(
    "kind" / OneOf(Int8ul, tuple(Kind)) * "what the piece is",  # ARRAY-01
    "text" / _if((Kind.TEXT,), SIZED) * "TEXT only: the bytes",
    "signal" / _if(_OF_ROWS, UVARINT) * "COUNT and DATA only: index of the signal",
    "after" / _if((Kind.COUNT,), SIZED) * "COUNT only: what follows the number",
    "size" / _if((Kind.COUNT,), UVARINT) * "COUNT only: bytes, those of blanks included",
    "type"
    / _if((Kind.DATA,), OneOf(Int8ul, tuple(range(len(TYPES)))))  # ARRAY-02
    * "DATA only: type of a number",
    "flags"
    / _if((Kind.DATA,), OneOf(Int8ul, (0, 1, 2, 3)))  # ARRAY-04
    * "DATA only: bit 0: big-endian; 1: column after column",
    "runs"
    / _if((Kind.DATA,), counted(ARRAY_RUN, kind="runs"))
    * "DATA only: its columns, in order",
    "start" / _if(_OF_PIECES, UVARINT) * "CRC and SIZE only: first piece",
    "stop" / _if(_OF_PIECES, UVARINT) * "CRC and SIZE only: the piece behind the last",
)
ARRAY_TEMPLATE = Struct(
    "pieces" / counted(ARRAY_PIECE, MAX_PIECES) * "the file, piece by piece"  # ARRAY-17
)
ARRAY_DETAIL = Struct("parts" / counted(SIZED, MAX_PIECES) * "bytes of the OWN pieces, in order")


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a file; what does not go with its kind is empty. See ARRAY_PIECE."""

    kind: Kind
    text: bytes = b""  # of OWN pieces, too
    signal: int = 0
    after: bytes = b""
    size: int = 0
    type: int = 0
    flags: int = 0
    runs: tuple[tuple[int, int], ...] = ()  # (first channel, channels)
    start: int = 0
    stop: int = 0

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
        {
            **{name: getattr(piece, name) for name in Piece.__slots__},
            "kind": int(piece.kind),
            "runs": [{"channel": c, "n_channels": n} for c, n in piece.runs],
        }
        for piece in pieces
    ]
    parts = [piece.text for piece in pieces if piece.kind == Kind.OWN]
    return (
        build(ARRAY_TEMPLATE, {"pieces": fields}, "source template"),
        build(ARRAY_DETAIL, {"parts": parts}, "source detail"),
    )


def parse_arrays(template: bytes, detail: bytes) -> tuple[Piece, ...]:
    """The inverse of ``build_arrays``; raises FormatError on bad bytes."""
    limits = {"runs": MAX_RUNS}  # ARRAY-17
    fields = parse(ARRAY_TEMPLATE, template, "source template", limits).pieces
    parts = list(parse(ARRAY_DETAIL, detail, "source detail").parts)
    wanted = sum(row.kind == Kind.OWN for row in fields)
    if wanted != len(parts):  # ARRAY-05
        raise FormatError(f"source detail: {len(parts)} parts, but {wanted} pieces are its own")
    own = iter(parts)
    return tuple(
        Piece(
            Kind(row.kind),
            next(own) if row.kind == Kind.OWN else row.text or b"",
            row.signal or 0,
            row.after or b"",
            row.size or 0,
            row.type or 0,
            row.flags or 0,
            tuple((run.channel, run.n_channels) for run in row.runs or ()),
            row.start or 0,
            row.stop or 0,
        )
        for row in fields
    )


def check_spans(pieces: Sequence[Piece]) -> None:
    """Raise FormatError where pieces speak of others that there are not, or of themselves."""
    spans = set()
    checks = [0, *accumulate(piece.kind == Kind.CRC for piece in pieces)]
    for piece in pieces:
        if piece.kind not in _OF_PIECES:
            continue
        if not piece.start <= piece.stop <= len(pieces):  # ARRAY-06
            raise FormatError(
                f"source template: pieces {piece.start} to {piece.stop} of {len(pieces)}"
            )
        if piece.kind == Kind.CRC:
            if checks[piece.start] != checks[piece.stop]:  # ARRAY-07
                raise FormatError("source template: a CRC-32 of a CRC-32")
            if piece.start < piece.stop:  # no pieces overlap none
                spans.add((piece.start, piece.stop))
    end = 0
    for start, stop in sorted(spans):
        if start < end:  # ARRAY-08
            raise FormatError(f"source template: CRC-32 of pieces {start} to {stop}, which overlap")
        end = stop
