"""Channels that were counts of a converter: scaled, moved and rounded to binary32.

``Law.ordinals`` and ``ordinals_of_binary32`` are normative (SPEC.md, "Codec 1: fast", form 34);
finding a law, and the cheap test for channels that may have one, are not.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.forms import BINARY32
from mcz.errors import FormatError
from mcz.kernels import lacks_compiled_kernels
from mcz.model.numbers import Grid, GridKind, ordinals_of, values_of
from mcz.model.numbers.rules import POWERS
from mcz.model.types import Bools, Floats, Ints

OFFSET, SHIFT, RESTS = 1, 2, 4  # bits of ``parts``
MOST_OFFSET = 2.0**80  # an offset or a shift: sums are then finite in binary32


@dataclass(frozen=True, slots=True)
class Law:
    """Value of a count: ``binary32(binary32(count * unit + offset) + shift)``.

    ``offset`` None: the first sum is omitted; ``shift`` None: the second too.
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
        """``unit``, ``parts`` and the values of the present parts."""
        terms = self.offset, self.shift
        parts = sum(1 << bit for bit, term in enumerate(terms) if term is not None)
        data = struct.pack("<dB", self.unit, parts | RESTS * rests)
        return data + b"".join(struct.pack("<d", term) for term in terms if term is not None)


def parse_law(stream: bytes, at: int, unit: float) -> tuple[Law, bool, int]:
    """The law whose ``parts`` are at an offset, whether there are rests, the offset after it."""
    if at >= len(stream) or stream[at] > OFFSET | SHIFT | RESTS:  # FAST-52
        raise FormatError(f"the parts of a law are {stream[at : at + 1].hex() or 'missing'}")
    parts, at = stream[at], at + 1
    terms: list[float | None] = [None, None]
    for place, bit in enumerate((OFFSET, SHIFT)):
        if parts & bit:
            if at + 8 > len(stream):
                raise FormatError(f"the stream is truncated at {len(stream)}, within a law")
            (term,) = struct.unpack_from("<d", stream, at)
            if not -MOST_OFFSET <= term <= MOST_OFFSET:  # FAST-53
                raise FormatError(f"offset or shift {term!r} is out of range")
            terms[place], at = term, at + 8
    return Law(unit, *terms), bool(parts & RESTS), at


Floats32 = NDArray[np.float32]

LEAST_NORMAL = 2.0**-126


def ordinals_of_binary32(values: Floats32, grid: Grid) -> Ints:
    """The ordinals of binary32 numbers on ``grid``, which is BINARY32 or GENERAL."""
    if grid.kind == GridKind.BINARY32:
        return grid.ordinals_of_bits(values.view("<u4"))
    wide = values.astype(np.float64)
    if lacks_compiled_kernels():
        return grid.ordinals(wide)[0]
    return ordinals_of(wide[:, None], (grid,))[0].ravel()


def spacing(values: Floats, grid: Grid, least: float = LEAST_NORMAL) -> Floats:
    """Twice the error of values that are binary32 numbers on ``grid``.

    Values below ``least`` count as ``least``.
    """
    sizes = np.maximum(np.abs(values), least)
    steps = np.asarray(np.spacing(sizes.astype("<f4")), np.float64)
    return steps + _last_places(sizes, grid) if grid.kind == GridKind.GENERAL else steps


def bounds(sizes: Floats, grid: Grid) -> tuple[Floats, Floats]:
    """The least and the greatest number that binary32, then ``grid`` may round to each size."""
    low = high = sizes
    if grid.kind == GridKind.GENERAL:
        low = sizes - _last_places(np.nextafter(sizes, 0.0), grid) / 2  # nearer below a power
        high = sizes + _last_places(sizes, grid) / 2
    least, most = low.astype("<f4"), high.astype("<f4")
    least = np.where(least < low, np.nextafter(least, np.float32(np.inf)), least)
    most = np.where(most > high, np.nextafter(most, np.float32(-np.inf)), most)
    below = np.nextafter(least, np.float32(-np.inf)).astype(np.float64)
    above = np.nextafter(most, np.float32(np.inf)).astype(np.float64)
    return (least + below) / 2, (most + above) / 2


def _last_places(sizes: Floats, grid: Grid) -> Floats:
    """The place values of the last digits of sizes above 0 on a GENERAL grid."""
    first = np.searchsorted(POWERS, sizes, "right") - 1
    return POWERS[np.maximum(first - (grid.digits - 1), 0)]


WINDOWS, SEEN = 4, 128  # runs of rows of the test, and their length
FEWEST = 9  # distinct values in a window that shows something
ENOUGH = 2  # windows that show something
WIDE = 4.0  # last places of a difference between values, at least
FEWEST_UNITS = 16.0  # units of a difference that can confirm a unit
PARTS = 1, 2, 3  # fractions of the least difference, one of which may be the unit
LOOSE = 0.25  # of a unit, greatest deviation of a difference
ROUNDING = 2.0**-23  # of a number: twice its greatest rounding error


def may_be_counts(ordinals: Ints, columns: Ints, grids: Sequence[Grid]) -> Bools:
    """Mask of ``columns`` of ``ordinals`` in which no window of rows disproves a unit.

    Columns of few distinct values are included; ``grids`` are of the columns.
    """
    hopeful, left = np.ones(len(columns), np.bool_), np.full(len(columns), ENOUGH)
    digits = np.array([grid.digits for grid in grids])
    lows, limits = np.array([(grid.lowest, grid.limit) for grid in grids]).reshape(-1, 2).T
    size = min(SEEN, len(ordinals))
    for window in range(WINDOWS):
        some = np.flatnonzero(hopeful & (left > 0))
        if not len(some):
            break
        start = window * (len(ordinals) - size) // (WINDOWS - 1)
        block = np.ascontiguousarray(ordinals[start : start + size, columns[some]])
        are_numbers = (block.max(axis=0) <= limits[some]) & (block.min(axis=0) >= lows[some])
        hopeful[some] = are_numbers
        some, block = some[are_numbers], np.ascontiguousarray(block[:, are_numbers])
        values = np.sort(values_of(block, tuple(grids[n] for n in some.tolist())).T)
        with np.errstate(over="ignore"):  # a difference beyond binary64 proves nothing
            gaps = np.diff(values)
        tells = 1 + np.count_nonzero(gaps, axis=1) >= FEWEST
        some = some[tells]
        greatest = np.abs(values[tells][:, [0, -1]]).max(axis=1)
        hopeful[some] = _have_unit(gaps[tells], greatest, digits[some])
        left[some] -= 1
    return hopeful


def _have_unit(gaps: Floats, greatest: Floats, digits: Ints) -> Bools:
    """Mask of columns whose differences are mostly multiples of one unit."""
    places = 10.0 ** (np.floor(np.log10(greatest)) - digits + 1)  # values of last digits
    slack = (places + ROUNDING * greatest)[:, None]
    gaps = np.where(gaps > WIDE * slack, gaps, np.inf)
    least = gaps.min(axis=1, keepdims=True, initial=np.inf)
    least[np.isinf(least)] = 1.0  # no difference is wide
    ratios = gaps / least
    has_unit = np.zeros(len(digits), np.bool_)
    for parts in PARTS:
        unit, near = least / parts, parts * ratios <= FEWEST_UNITS
        counts = np.where(near, parts * ratios, 0.0)
        off = np.abs(counts - np.rint(counts)) * unit
        good = near & (off <= np.minimum(LOOSE * unit, slack * (1.0 + counts / parts)))
        n_near, n_good = near.sum(axis=1), good.sum(axis=1)
        has_unit |= (n_near >= FEWEST - 1) & (8 * n_good >= 7 * n_near)
    return has_unit
