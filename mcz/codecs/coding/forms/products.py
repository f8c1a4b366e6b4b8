"""Channels of rounding noise: angles that were a few units in the last place, printed in degrees.

``of_products`` is normative (SPEC.md, "Codec 1: fast", form 33); finding a unit is not.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from mcz.codecs.coding.forms import product_kernels
from mcz.kernels import lacks_compiled_kernels
from mcz.model.numbers import Grid, GridKind, values_of
from mcz.model.numbers.magnitudes import POWERS
from mcz.model.numbers.tokens import TENS
from mcz.model.types import Floats, Ints

DEGREE = 180 / np.pi  # in a radian
LARGEST = 1e-12  # degrees: numbers near 1e-9 are products by chance
EXACT_CODES = 2**52  # smaller codes are exact as floats, as are their multiples
_UNITS = np.asarray(DEGREE * 2.0 ** -np.arange(44, 77), np.float64)


def of_products(codes: Ints, unit: float, shifts: int, grid: Grid) -> Ints:
    """The ordinals on ``grid``, which is GENERAL, of the multiples of ``unit`` in ``codes``.

    A code has a sign, and its size less 1 is q * shifts + z: it stands for (2q + 1) * 2^z units.
    """
    codes = np.ascontiguousarray(codes)
    out = np.full(len(codes), product_kernels.PRINTED)
    all_printed = lacks_compiled_kernels() and bool((np.abs(codes) < EXACT_CODES).all())
    if all_printed or product_kernels.fill(codes, unit, shifts, TENS, POWERS, grid.digits, out):
        printed = out == product_kernels.PRINTED
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
        place, n_open = product_kernels.next_unit(
            values, ordinals, _UNITS, start, TENS, POWERS, grid.digits
        )
        if place == len(_UNITS):
            return None
        unit = float(_UNITS[place])
        shifts = product_kernels.fill_codes(values, unit, codes)
        if not n_open or (of_products(codes, unit, shifts, grid) == ordinals).all():
            return unit, shifts, codes
