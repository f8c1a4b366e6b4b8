"""Channels of rounding noise: angles that were a few units in the last place, printed in degrees.

``of_products`` is normative (SPEC.md, "Codec 1: fast", form 33); finding a unit is not.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.kernels import lacks_compiled_kernels
from mcz.numbers import Grid, GridKind
from mcz.numbers.magnitudes import POWERS
from mcz.numbers.tokens import TENS

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

DEGREE = 180 / np.pi  # in a radian
LARGEST = 1e-12  # degrees: numbers near 1e-9 are products by chance
MOST = 2**24  # units in a value
EXACT = 2**52  # codes below are exact as floats, as are their multiples
_UNITS = DEGREE * 2.0 ** -np.arange(44, 77)
_SAMPLE = 8


def of_products(codes: Ints, unit: float, shifts: int, grid: Grid) -> Ints:
    """The ordinals on ``grid``, which is GENERAL, of the multiples of ``unit`` that ``codes`` say.

    A code has a sign, and its size less 1 is q * shifts + z: it says (2q + 1) * 2^z units.
    """
    from mcz.coding.forms import product_kernels as own  # on first use

    codes = np.ascontiguousarray(codes)
    out = np.full(len(codes), own.PRINTED)
    all_printed = lacks_compiled_kernels() and bool((np.abs(codes) < EXACT).all())
    if all_printed or own.fill(codes, unit, shifts, TENS, POWERS, grid.digits, out):
        printed = out == own.PRINTED
        few, places = np.unique(codes[printed], return_inverse=True)  # often small ones
        out[printed] = grid.ordinals(multiples_of(few, shifts) * np.float64(unit))[0][
            places.ravel()
        ]
    return out


def multiples_of(codes: Ints, shifts: int) -> Floats:
    """The multiples that codes say, exact; 0 for 0."""
    q, z = np.divmod(np.abs(codes) - 1, shifts)
    return np.where(codes == 0, 0.0, np.copysign(np.ldexp(2.0 * q + 1, z), codes))


def codes_of(counts: Ints) -> tuple[Ints, int]:
    """The codes of some multiples below 2^53, and ``shifts``, as few as there may be."""
    sizes = np.maximum(np.abs(counts), 1)
    z = np.frexp((sizes & -sizes).astype(np.float64))[1].astype(np.int64) - 1
    shifts = int(z.max()) + 1
    return np.sign(counts) * ((sizes >> z + 1) * shifts + z + 1), shifts


def is_tiny(ordinals: Ints, grid: Grid) -> bool:
    """Whether a column may be rounding noise: the cheap test."""
    if grid.kind != GridKind.GENERAL or not len(ordinals):
        return False
    least, most = _bounds(grid)
    if not least < ordinals[0] < most:  # nearly all columns
        return False
    return bool(least < ordinals.min() and ordinals.max() < most and ordinals.any())


@cache
def _bounds(grid: Grid) -> tuple[int, int]:
    """The ordinals of -LARGEST and LARGEST."""
    least, most = grid.ordinals(np.array([-LARGEST, LARGEST]))[0].tolist()
    return least, most


def find_products(ordinals: Ints, grid: Grid) -> tuple[float, int, Ints] | None:
    """A unit, shifts and the codes that ``of_products`` turns into these ordinals, or None."""
    if not is_tiny(ordinals, grid):
        return None
    values = grid.values(ordinals)
    some = np.argsort(ordinals)[:: max(1, len(ordinals) // _SAMPLE)]
    products = np.rint(values[some] / _UNITS[:, None]) * _UNITS[:, None]
    fits = (grid.ordinals(products)[0] == ordinals[some]).all(axis=1)
    for unit in _UNITS[fits].tolist():
        counts = np.rint(values / unit).astype(np.int64)
        if np.abs(counts).max() < MOST:
            codes, shifts = codes_of(counts)
            if (of_products(codes, unit, shifts, grid) == ordinals).all():
                return unit, shifts, codes
    return None
