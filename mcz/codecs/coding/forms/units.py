"""Channels with ordinals from integers and a unit: fields of a head, and coded integers.

SPEC.md, "Codec 1: fast", is normative; the choice of a form is not. ``of_multiples`` is form 32:
integers scaled by some recorder.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from mcz.codecs.coding.forms import (
    BINARY32,
    COUNTS,
    MULTIPLES,
    PRODUCTS,
    WITH_UNIT,
    has_binary32,
    unit_grid,
)
from mcz.codecs.coding.forms.count_search import Counted, find_counts
from mcz.codecs.coding.forms.counts import Law, ordinals_of_binary32, parse_law
from mcz.codecs.coding.forms.products import find_products, is_tiny, of_products
from mcz.errors import FormatError
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Floats, Ints

Mapping = Callable[[Ints], Ints]

MAX_SHIFTS = 63


@dataclass(frozen=True, slots=True)
class InUnits:
    """A channel in a form with a unit; ``fields``: the fields of the form in the head.

    ``rests``: errors of the ordinals of ``integers``, None without any.
    """

    form: int
    fields: bytes
    integers: Ints
    rests: Ints | None = None


def find_units(column: Ints, grid: Grid, *, every: bool = True) -> InUnits | None:
    """The ordinals of ``grid`` in a form with a unit, None if none fits.

    ``every``: products and counts are tried too.
    """
    if has_binary32(grid):
        in_units = find_multiples(column)
        law = find_counts(column, BINARY32, in_units) if every else None
        if law is not None:
            return _in_counts(law)
        if in_units is not None:
            return InUnits(MULTIPLES, struct.pack("<d", in_units[0]), in_units[1])
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


def _in_counts(counted: Counted) -> InUnits:
    rests = counted.rests if counted.rests.any() else None
    return InUnits(COUNTS, counted.law.fields(rests=rests is not None), counted.counts, rests)


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
        raise FormatError(f"form {form} is not allowed on a {grid.kind.name} grid")
    if at >= len(stream):
        raise FormatError(f"the stream is truncated at {at}, before the shifts of a unit")
    shifts, at = stream[at], at + 1
    if not 1 <= shifts <= MAX_SHIFTS:  # FAST-50
        raise FormatError(f"form {form}: the number of shifts is {shifts}")
    return partial(of_products, unit=unit, shifts=shifts, grid=grid), False, at


def _parse_unit(stream: bytes, at: int) -> tuple[float, int]:
    if at + 8 > len(stream):
        raise FormatError(f"the stream is truncated at {len(stream)}, within a unit")
    (unit,) = struct.unpack_from("<d", stream, at)
    if not 2.0**-200 <= unit <= 2.0**80:  # FAST-47
        raise FormatError(f"unit {unit!r} is out of range")
    return unit, at + 8


MOST_UNITS = 2**20  # units in a value: beyond, the multiples take as many bits as the mantissas
GREATEST = 2.0**80  # unit that a head may have
_STEPS = 24  # of Euclid's algorithm


def of_multiples(multiples: Ints, unit: float, grid: Grid = BINARY32) -> Ints:
    """The ordinals on ``grid`` of the binary32 that are nearest to ``multiples * unit``."""
    with np.errstate(over="ignore"):
        values = (multiples * np.float64(unit)).astype("<f4")
    return ordinals_of_binary32(values, grid)


@np.errstate(over="ignore")  # numbers near the greatest
def find_multiples(ordinals: Ints) -> tuple[float, Ints] | None:
    """A unit and the multiples of it that ``of_multiples`` maps to these ordinals, or None."""
    if ordinals.max() > BINARY32.limit or ordinals.min() < BINARY32.lowest:
        return None
    values = BINARY32.values(ordinals)
    sizes = np.unique(np.abs(values))
    sizes = sizes[sizes > 0]
    if not np.isfinite(values).all() or not len(sizes):
        return None
    slack = float(np.spacing(np.float32(sizes[-1])))
    guess = _common_measure(sizes, slack)
    if guess * MOST_UNITS < sizes[-1]:
        return None
    unit = _within_rounding(sizes, guess)
    if unit > GREATEST:
        return None
    multiples = np.rint(values / unit).astype(np.int64)
    return (unit, multiples) if (of_multiples(multiples, unit) == ordinals).all() else None


def _common_measure(sizes: Floats, slack: float) -> float:
    """Approximate the greatest common divisor of sizes, each to within ``slack``."""
    measure = float(sizes[0])
    for _ in range(_STEPS):
        rest = np.abs(sizes - np.rint(sizes / measure) * measure)
        wrong = rest > np.maximum(slack, sizes / measure * 2.0**-24 * measure)
        if not wrong.any() or measure <= 4 * slack:
            break
        measure = float(rest[wrong].min())
    return measure


def _within_rounding(sizes: Floats, guess: float) -> float:
    """The middle of the units that round to all sizes, close to ``guess``."""
    low, high = 0.0, np.inf
    unit = guess
    for size in sizes:  # small multiples first: each narrows the divisors of the next
        count = max(1.0, np.rint(size / unit))
        half = float(np.spacing(np.float32(size))) / 2
        low, high = max(low, (size - half) / count), min(high, (size + half) / count)
        unit = (low + high) / 2
    return unit
