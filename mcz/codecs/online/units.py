"""The stream of a segment of ``online``: units, each a group of frames or a part of one.

SPEC.md, "Codec 21: online", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mcz.errors import FormatError
from mcz.model.schema import read_varint, varint

STR, LTR, INTRA = 0, 1, 2  # reference of a frame: the last frame, the last LTR, none
MIXED, GOLOMB = 0, 1  # coders
MODES = ("mod", "rc", "rca", "steady")  # of an encoder's rate control


@dataclass(frozen=True, slots=True)
class Unit:
    """Frames coded together; ``kind`` of the first, the others are STR.

    ``distance``: number of frames from the first back to the LTR that it is predicted from, if it
    is one itself.
    """

    kind: int
    n_frames: int
    data: bytes
    distance: int = 0


def build_units(units: Sequence[Unit]) -> bytes:
    """The stream of a segment of these units."""
    parts = []
    for number, unit in enumerate(units, 1):
        parts.append(varint(4 * unit.n_frames + unit.kind))
        if unit.kind == LTR:
            parts.append(varint(unit.distance))
        if number < len(units):
            parts.append(varint(len(unit.data)))
        parts.append(unit.data)
    return b"".join(parts)


def parse_units(name: str, stream: bytes, n_frames: int) -> list[Unit]:
    """The units of a segment of ``n_frames``; raises FormatError on bad bytes."""
    units: list[Unit] = []
    at, left = 0, n_frames
    while left:  # ONLINE-08
        label = f"{name}: unit {len(units)}"
        head, at = read_varint(stream, at)
        kind, size = head % 4, head // 4
        if kind > INTRA or not 1 <= size <= left:  # ONLINE-09, ONLINE-10, ONLINE-11
            raise FormatError(
                f"{label}: kind {kind} cannot have {size} of the remaining {left} frames"
            )
        distance = 0
        if kind == LTR:
            distance, at = read_varint(stream, at)
        left -= size
        n_bytes = len(stream) - at
        if left:
            n_bytes, at = read_varint(stream, at)
        if n_bytes > len(stream) - at:  # ONLINE-12
            raise FormatError(f"{label}: {n_bytes} bytes, but {len(stream) - at} are left")
        units.append(Unit(kind, size, stream[at : at + n_bytes], distance))
        at += n_bytes
    return units
