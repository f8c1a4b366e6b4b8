"""Channels that were counts of a converter: scaled, moved and rounded to binary32.

``Law.ordinals`` is normative (SPEC.md, "Codec 1: fast", form 34); finding a law is not.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.forms.ids import BINARY32
from mcz.codecs.coding.forms.rounding import ordinals_of_binary32
from mcz.errors import FormatError
from mcz.model.numbers import Grid

Ints = NDArray[np.int64]

OFFSET, SHIFT, RESTS = 1, 2, 4  # bits of ``parts``
MOST = 2.0**80  # an offset or a shift: sums are then finite in binary32


@dataclass(frozen=True, slots=True)
class Law:
    """Value of a count: ``binary32(binary32(count * unit + offset) + shift)``.

    ``offset`` None: nothing is added; ``shift`` None: nor is the second sum made.
    """

    unit: float
    offset: float | None = None
    shift: float | None = None

    def ordinals(self, counts: Ints, grid: Grid = BINARY32) -> Ints:
        """The ordinals of counts on ``grid``, which is BINARY32 or GENERAL."""
        values = counts * np.float64(self.unit)
        if self.offset is not None:
            values = values + self.offset
        rounded = values.astype("<f4")
        if self.shift is not None:
            rounded = (rounded.astype(np.float64) + self.shift).astype("<f4")
        return ordinals_of_binary32(rounded, grid)

    def fields(self, *, rests: bool) -> bytes:
        """``unit``, ``parts`` and what they say is there."""
        terms = self.offset, self.shift
        parts = sum(1 << bit for bit, term in enumerate(terms) if term is not None)
        data = struct.pack("<dB", self.unit, parts | RESTS * rests)
        return data + b"".join(struct.pack("<d", term) for term in terms if term is not None)


def parse_law(stream: bytes, at: int, unit: float) -> tuple[Law, bool, int]:
    """The law whose ``parts`` stand at an offset, whether there are rests, the offset after it."""
    if at >= len(stream) or stream[at] > OFFSET | SHIFT | RESTS:  # FAST-52
        raise FormatError(f"parts {stream[at : at + 1].hex() or 'missing'} of a law")
    parts, at = stream[at], at + 1
    terms: list[float | None] = [None, None]
    for place, bit in enumerate((OFFSET, SHIFT)):
        if parts & bit:
            if at + 8 > len(stream):
                raise FormatError(f"the stream ends at {len(stream)}, in a law")
            (term,) = struct.unpack_from("<d", stream, at)
            if not -MOST <= term <= MOST:  # FAST-53
                raise FormatError(f"an offset or shift of {term!r}")
            terms[place], at = term, at + 8
    return Law(unit, *terms), bool(parts & RESTS), at
