"""The head of a channel, as it is written.

SPEC.md, "Codec 1: fast", is normative; the names below are its field names.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcz.model.schema import varint

CODED, CONSTANT, COPY, STEPS = range(4)  # bits 0 and 1 of ``kind``
PREDICTOR = 2  # shift; 2 bits
TINY, HAS_PARENT, HAS_EXCEPTIONS, OWN_FORM = 16, 32, 64, 128
FITTED = 3

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Lattice:
    """Split of a channel's ordinals: base 0 plain, else classes of mantissas."""

    base: int
    digits: int
    drop: int = 0
    top: int = 0


@dataclass(slots=True)
class CodedHead:
    """The head of a coded channel; ``fields`` are those of its form up to ``top``."""

    form: int
    shape: Lattice
    is_own: bool
    fields: bytes = b""
    first: int = 0
    scale: int = 0
    predictor: int = 0
    taps: tuple[int, ...] = ()
    is_tiny: bool = False
    parent: tuple[int, int, int] | None = None  # group, channel, weight
    exceptions: list[tuple[int, int]] = field(default_factory=list)  # row, ordinal

    def build(self) -> bytes:
        kind = CODED | self.predictor << PREDICTOR | TINY * self.is_tiny | OWN_FORM * self.is_own
        kind |= HAS_PARENT * (self.parent is not None) | HAS_EXCEPTIONS * bool(self.exceptions)
        parts = [bytes((kind,)), bytes((self.form, self.shape.drop)) if self.is_own else b""]
        parts += [self.fields, varint(self.shape.top) if self.shape.base else b""]
        parts += [_zigzag(self.first), bytes((self.scale,))]
        parts += [struct.pack("<4b", *self.taps)] if self.predictor == FITTED else []
        if self.parent is not None:
            group, channel, weight = self.parent
            parts += [varint(group), varint(channel), _zigzag(weight)]
        if self.exceptions:
            parts.append(varint(len(self.exceptions)))
            before = -1
            for row, ordinal in self.exceptions:
                short = short_ordinal(ordinal)
                parts += [varint(row - before - 1), bytes((len(short),)), short]
                before = row
        return b"".join(parts)


def _zigzag(value: int) -> bytes:
    return varint(2 * value if value >= 0 else -2 * value - 1)


def short_ordinal(ordinal: int) -> bytes:
    folded = 2 * ordinal if ordinal >= 0 else -2 * ordinal - 1
    return folded.to_bytes((folded.bit_length() + 7) // 8, "little")


def constant_head(ordinal: int) -> bytes:
    short = short_ordinal(ordinal)
    return bytes((CONSTANT | len(short) << 2,)) + short


def copy_head(group: int, channel: int) -> bytes:
    return bytes((COPY,)) + varint(group) + varint(channel)


def steps_head(column: Ints) -> bytes:
    """The head of a channel whose ordinals change rarely."""
    starts = np.concatenate([[0], 1 + np.flatnonzero(np.diff(column))])
    lengths = np.diff(np.append(starts, len(column))).tolist()
    parts = [bytes((STEPS,)), varint(len(starts))]
    for rows, ordinal in zip(lengths, column[starts].tolist(), strict=True):
        short = short_ordinal(ordinal)
        parts += [varint(rows), bytes((len(short),)), short]
    return b"".join(parts)
