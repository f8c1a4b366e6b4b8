"""Use of each array of a file, from its template."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from mcz.model.motion import Source
from mcz.model.types import JsonObject
from mcz.sources.arrays.layout import BIG_ENDIAN, BY_COLUMNS, TYPES, Kind, Piece, parse_arrays

LOCAL, HEADER = b"PK\3\4", 30  # how a member of a ZIP begins; bytes before its name


def list_arrays(source: Source, signals: Sequence[str]) -> list[JsonObject]:
    """The arrays of a file in order: ``name type order columns signal``, ``name`` alone where kept.

    ``columns`` are the numbers of a row, ``order`` is "C" or "F"; ``signals`` are the names of the
    clip's. The name is "" in an NPY file. Raises FormatError on bad bytes.
    """
    pieces = parse_arrays(source.template, source.detail)
    members = members_of(pieces) if source.format == "npz" else [("", pieces)]
    return [_list_array(name, own, signals) for name, own in members]


def members_of(pieces: Sequence[Piece]) -> list[tuple[str, Sequence[Piece]]]:
    """The members of an NPZ: the name of each array, and its pieces from its header on."""
    starts = [
        index
        for index, piece in enumerate(pieces)
        if piece.kind == Kind.TEXT and piece.text.startswith(LOCAL)
    ]
    return [
        (_name(pieces[start:]), pieces[start:stop])
        for start, stop in pairwise((*starts, len(pieces)))
    ]


def _list_array(name: str, pieces: Sequence[Piece], signals: Sequence[str]) -> JsonObject:
    listed = _unlisted_array(name)
    for piece in pieces:
        if piece.kind == Kind.DATA:
            listed |= {
                "type": (">" if piece.flags & BIG_ENDIAN else "<") + TYPES[piece.type],
                "order": "F" if piece.flags & BY_COLUMNS else "C",
                "columns": piece.n_columns,
                "signal": signals[piece.signal] if piece.signal < len(signals) else "",
            }
    return listed


def _unlisted_array(name: str) -> JsonObject:
    return {"name": name, "type": None, "order": None, "columns": None, "signal": None}


def _name(pieces: Sequence[Piece]) -> str:
    """The name in a local header, which begins with the first of ``pieces``."""
    header = b""
    for piece in pieces:
        if piece.kind == Kind.TEXT:
            header += piece.text
        elif piece.kind in (Kind.CRC, Kind.SIZE4, Kind.SIZE8):
            header += bytes(8 if piece.kind == Kind.SIZE8 else 4)
        else:
            break
    size = int.from_bytes(header[26:28], "little")
    return header[HEADER : HEADER + size].decode("utf-8", "replace").removesuffix(".npy")
