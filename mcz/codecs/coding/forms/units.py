"""Channels whose ordinals are made of integers by a unit: fields of a head, and what is coded.

SPEC.md, "Codec 1: fast", is normative; the choice of a form is not.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.forms.count_search import Counted, find_counts
from mcz.codecs.coding.forms.counts import Law, parse_law
from mcz.codecs.coding.forms.ids import (
    BINARY32,
    COUNTS,
    MULTIPLES,
    PRODUCTS,
    WITH_UNIT,
    has_binary32,
    unit_grid,
)
from mcz.codecs.coding.forms.multiples import find_multiples, of_multiples
from mcz.codecs.coding.forms.products import find_products, is_tiny, of_products
from mcz.errors import FormatError
from mcz.model.numbers import Grid, GridKind

Ints = NDArray[np.int64]
Mapping = Callable[[Ints], Ints]

MAX_SHIFTS = 63


@dataclass(frozen=True, slots=True)
class InUnits:
    """A channel in a form with a unit; ``fields``: those of the head that belong to the form.

    ``rests``: what the ordinals of ``integers`` are off, None where nothing is.
    """

    form: int
    fields: bytes
    integers: Ints
    rests: Ints | None = None


def find_units(column: Ints, grid: Grid, *, every: bool = True) -> InUnits | None:
    """The ordinals of ``grid`` in a form with a unit, None where none fits.

    ``every``: products and counts may be chosen, too.
    """
    if has_binary32(grid):
        found = find_multiples(column)
        law = find_counts(column, BINARY32, found) if every else None
        if law is not None:
            return _in_counts(law)
        if found is not None:
            return InUnits(MULTIPLES, struct.pack("<d", found[0]), found[1])
    if not every or grid.kind != GridKind.GENERAL:
        return None
    if is_tiny(column, grid):
        products = find_products(column, grid)
        if products is None:
            return None
        unit, shifts, codes = products
        return InUnits(PRODUCTS, struct.pack("<dB", unit, shifts), codes)
    law = find_counts(column, grid)
    if law is None:
        return None
    if law.law == Law(law.law.unit) and not law.rests.any():  # a byte less
        return InUnits(MULTIPLES, struct.pack("<d", law.law.unit), law.counts)
    return _in_counts(law)


def _in_counts(found: Counted) -> InUnits:
    rests = found.rests if found.rests.any() else None
    return InUnits(COUNTS, found.law.fields(rests=rests is not None), found.counts, rests)


def parse_mapping(
    stream: bytes, at: int, form: int, grid: Grid
) -> tuple[Mapping | None, bool, int]:
    """The map of coded integers, of whole columns, to ordinals; rests; the offset after both."""
    if form not in WITH_UNIT:
        return None, False, at
    unit, at = _parse_unit(stream, at)
    if form == MULTIPLES:
        return partial(of_multiples, unit=unit, grid=unit_grid(grid)), False, at
    if form == COUNTS:
        law, rests, at = parse_law(stream, at, unit)
        return partial(law.ordinals, grid=unit_grid(grid)), rests, at
    if grid.kind != GridKind.GENERAL:  # FAST-49
        raise FormatError(f"form {form} on the grid {grid.kind.name}")
    if at >= len(stream):
        raise FormatError(f"the stream ends at {at}, before the shifts of a unit")
    shifts, at = stream[at], at + 1
    if not 1 <= shifts <= MAX_SHIFTS:  # FAST-50
        raise FormatError(f"form {form}: {shifts} shifts")
    return partial(of_products, unit=unit, shifts=shifts, grid=grid), False, at


def _parse_unit(stream: bytes, at: int) -> tuple[float, int]:
    if at + 8 > len(stream):
        raise FormatError(f"the stream ends at {len(stream)}, in a unit")
    (unit,) = struct.unpack_from("<d", stream, at)
    if not 2.0**-200 <= unit <= 2.0**80:  # FAST-47
        raise FormatError(f"a unit of {unit!r}")
    return unit, at + 8
