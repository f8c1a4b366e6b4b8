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

from mcz.coding.forms.count_search import find_counts
from mcz.coding.forms.counts import parse_law
from mcz.coding.forms.ids import COUNTS, MULTIPLES, PRODUCTS, WITH_UNIT, has_binary32
from mcz.coding.forms.multiples import find_multiples, of_multiples
from mcz.coding.forms.products import find_products, of_products
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind

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
        law = find_counts(column, found) if every else None
        if law is not None:
            rests = law.rests if law.rests.any() else None
            return InUnits(COUNTS, law.law.fields(rests=rests is not None), law.counts, rests)
        if found is not None:
            return InUnits(MULTIPLES, struct.pack("<d", found[0]), found[1])
    products = find_products(column, grid) if every else None
    if products is not None:
        unit, shifts, codes = products
        return InUnits(PRODUCTS, struct.pack("<dB", unit, shifts), codes)
    return None


def parse_mapping(
    stream: bytes, at: int, form: int, grid: Grid
) -> tuple[Mapping | None, bool, int]:
    """The map of coded integers, of whole columns, to ordinals; rests; the offset after both."""
    if form not in WITH_UNIT:
        return None, False, at
    unit, at = _parse_unit(stream, at)
    if form == MULTIPLES:
        return partial(of_multiples, unit=unit), False, at
    if form == COUNTS:
        law, rests, at = parse_law(stream, at, unit)
        return law.ordinals, rests, at
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
