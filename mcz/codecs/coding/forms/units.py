"""Channels with ordinals from integers and a unit: fields of a head, and coded integers.

SPEC.md, "Codec 1: fast", is normative; the choice of a form is not. ``of_multiples`` is form 32:
integers scaled by some recorder. ``of_products`` is form 33 ("Value to ordinal" as well): rounding
noise, angles that were a few units in the last place, printed in degrees. Loops over the codes and
values of a column are compiled.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

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
from mcz.errors import FormatError
from mcz.kernels import kernel, lacks_compiled_kernels, trailing_zeros, truncated
from mcz.kernels.types import Floats, Ints
from mcz.model.numbers import Grid, GridKind, values_of
from mcz.model.numbers.rules import POWERS, TENS
from mcz.model.numbers.value_kernels import decimal, magnitude_of

EXACT = 1 << 53  # quotients of floats are exact up to here
MOST = float(1 << 24)  # units in a value, beyond which none is searched
PRINTED = 1 << 62  # no ordinal: such a product must be printed to find its decimal


@kernel
def fill(
    codes: Ints, unit: float, shifts: int, tens: Floats, powers: Floats, digits: int, out: Ints
) -> int:
    """Fill ``out`` with ordinals of ``digits``, ``PRINTED`` for an inexact product; count those.

    ``tens``: the exact powers of ten; ``powers``: all of them.
    """
    power = left = 0  # power of ten of the previous number
    for t in range(len(codes)):
        if codes[t] == 0:
            out[t] = 0
            continue
        before = abs(codes[t]) - 1
        q = truncated(float(before) / float(shifts)) if before < EXACT else before // shifts
        value = float(2 * q + 1) * float(1 << before - q * shifts) * unit
        mantissa, power = decimal(value, power, digits, tens, powers)
        if mantissa == 0:
            out[t] = PRINTED
            left += 1
            continue
        magnitude = magnitude_of(mantissa, power, digits, tens)
        out[t] = -1 - magnitude if codes[t] < 0 else magnitude
    return left


@kernel
def next_unit(
    values: Floats,
    ordinals: Ints,
    units: Floats,
    start: int,
    tens: Floats,
    powers: Floats,
    digits: int,
) -> tuple[int, int]:
    """The first unit from ``start`` on that divides all values; the number of units if none does.

    Also returns the number of products that decide nothing, since they must be printed.
    """
    for place in range(start, len(units)):
        left = count_open(values, ordinals, units[place], tens, powers, digits)
        if left >= 0:
            return place, left
    return len(units), 0


def count_open(
    values: Floats, ordinals: Ints, unit: float, tens: Floats, powers: Floats, digits: int
) -> int:
    """Count the multiples of a unit to be printed; -1 if another has another ordinal."""
    power = left = 0
    for row in range(len(values)):
        size = np.rint(abs(values[row]) / unit)
        magnitude = 0
        if size >= MOST:
            return -1
        if size > 0.0:
            mantissa, power = decimal(size * unit, power, digits, tens, powers)
            if mantissa == 0:
                left += 1
                continue
            magnitude = magnitude_of(mantissa, power, digits, tens)
        if ordinals[row] != (-1 - magnitude if values[row] < 0.0 and size > 0.0 else magnitude):
            return -1
    return left


@kernel
def fill_codes(values: Floats, unit: float, codes: Ints) -> int:
    """Fill in the codes of multiples below ``MOST``; returns ``shifts``, as few as there may be."""
    shifts = 1
    for row in range(len(values)):
        codes[row] = truncated(np.rint(values[row] / unit))
        if codes[row]:
            shifts = max(shifts, trailing_zeros(codes[row]) + 1)
    for row in range(len(values)):
        if codes[row]:
            z = trailing_zeros(codes[row])
            code = (abs(codes[row]) >> (z + 1)) * shifts + z + 1
            codes[row] = -code if codes[row] < 0 else code
    return shifts


DEGREE = 180 / np.pi  # in a radian
LARGEST = 1e-12  # degrees: numbers near 1e-9 are products by chance
EXACT_CODES = 2**52  # smaller codes are exact as floats, as are their multiples
_UNITS = np.asarray(DEGREE * 2.0 ** -np.arange(44, 77), np.float64)


def of_products(codes: Ints, unit: float, shifts: int, grid: Grid) -> Ints:
    """The ordinals on ``grid``, which is GENERAL, of the multiples of ``unit`` in ``codes``.

    A code has a sign, and its size less 1 is q * shifts + z: it stands for (2q + 1) * 2^z units.
    """
    codes = np.ascontiguousarray(codes)
    out = np.full(len(codes), PRINTED)
    all_printed = lacks_compiled_kernels() and bool((np.abs(codes) < EXACT_CODES).all())
    if all_printed or fill(codes, unit, shifts, TENS, POWERS, grid.digits, out):
        printed = out == PRINTED
        few, places = np.unique(codes[printed], return_inverse=True)  # often small ones
        out[printed] = grid.ordinals(multiples_of(few, shifts) * np.float64(unit))[0][
            places.ravel()
        ]
    return out


def multiples_of(codes: Ints, shifts: int) -> Floats:
    """The multiples of codes, exact; 0 for 0."""
    q, z = np.divmod(np.abs(codes) - 1, shifts)
    return np.where(codes == 0, 0.0, np.copysign(np.ldexp(2.0 * q + 1, z), codes))


def is_tiny(ordinals: Ints, grid: Grid) -> bool:
    """Return True if a column may be rounding noise (a cheap test)."""
    limit = tiny_limit(grid)
    if not len(ordinals) or not -1 - limit < ordinals[0] < limit:  # nearly all columns
        return False
    return bool(-1 - limit < ordinals.min() and ordinals.max() < limit and ordinals.any())


@cache
def tiny_limit(grid: Grid) -> int:
    """The magnitude of LARGEST; 0 on grids without rounding noise."""
    return int(grid.ordinals(np.array([LARGEST]))[0][0]) if grid.kind == GridKind.GENERAL else 0


def find_products(ordinals: Ints, grid: Grid) -> tuple[float, int, Ints] | None:
    """A unit, shifts and the codes of these ordinals for ``of_products``, or None."""
    if not is_tiny(ordinals, grid):
        return None
    values = np.ravel(values_of(ordinals[:, None], (grid,)))
    codes = np.empty(len(values), np.int64)
    place = -1
    while True:
        start = place + 1
        place, n_open = next_unit(values, ordinals, _UNITS, start, TENS, POWERS, grid.digits)
        if place == len(_UNITS):
            return None
        unit = float(_UNITS[place])
        shifts = fill_codes(values, unit, codes)
        if not n_open or (of_products(codes, unit, shifts, grid) == ordinals).all():
            return unit, shifts, codes


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
    """A function from coded integers to ordinals, whether rests follow, the offset after both."""
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
