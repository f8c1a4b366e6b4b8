"""Channels of rounding noise: angles that were a few units in the last place, printed in degrees.

``of_products`` is normative (SPEC.md, "Codec 1: fast", form 33, and "Value to ordinal"); finding a
unit is not. Loops over the codes and values of a column are compiled.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from mcz.kernels import kernel, lacks_compiled_kernels, trailing_zeros, truncated
from mcz.kernels.types import Floats, Ints
from mcz.model.numbers import Grid, GridKind, values_of
from mcz.model.numbers.rules import POWERS, TENS
from mcz.model.numbers.value_kernels import decimal, magnitude_of

EXACT = 1 << 53  # up to which quotients of floats are right
MOST = float(1 << 24)  # units in a value, for which one is looked for
PRINTED = 1 << 62  # no ordinal: the decimal of such a product is to be printed


@kernel
def fill(
    codes: Ints, unit: float, shifts: int, tens: Floats, powers: Floats, digits: int, out: Ints
) -> int:
    """Fill ``out`` with ordinals of ``digits``, ``PRINTED`` for an inexact product; count those.

    ``tens``: the exact powers of ten; ``powers``: all of them.
    """
    power = left = 0  # power: of ten, of the number before
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
    """The first unit from ``start`` on of which all values are multiples, as their ordinals show.

    If there is none: how many units there are. Also how many of the products show nothing, as
    they are to be printed.
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
