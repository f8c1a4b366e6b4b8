"""Channels of rounding noise: angles that were a few units in the last place, printed in degrees.

``of_products`` is normative (SPEC.md, "Codec 1: lossless", form 33); finding a unit is not.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.numbers import Grid, GridKind
from mcz.numbers.magnitudes import POWERS
from mcz.numbers.tokens import TENS

Ints = NDArray[np.int64]

DEGREE = 180 / np.pi  # in a radian
LARGEST = 1e-12  # degrees: numbers near 1e-9 are products by chance
MOST = 2**24  # units in a value
_HALVINGS = range(44, 77)  # of a radian, that a unit may be
_SAMPLE = 16


def of_products(counts: Ints, unit: float, grid: Grid) -> Ints:
    """The ordinals of ``counts * unit`` on ``grid``, which is GENERAL."""
    from mcz.coding.ordinals import product_kernels as own  # on first use

    counts = np.ascontiguousarray(counts)
    out = np.empty(len(counts), np.int64)
    if own.fill(counts, unit, TENS, POWERS, 10 ** (grid.digits - 1), out):
        printed = out == own.PRINTED
        few, places = np.unique(counts[printed], return_inverse=True)  # often small ones
        out[printed] = grid.ordinals(few * np.float64(unit))[0][places.ravel()]
    return out


def is_tiny(ordinals: Ints, grid: Grid) -> bool:
    """Whether a column may be rounding noise: the cheap test."""
    if grid.kind != GridKind.GENERAL or not ordinals.any():
        return False
    least, most = _bounds(grid)
    return bool(least < ordinals.min() and ordinals.max() < most)


@cache
def _bounds(grid: Grid) -> tuple[int, int]:
    """The ordinals of -LARGEST and LARGEST."""
    least, most = grid.ordinals(np.array([-LARGEST, LARGEST]))[0].tolist()
    return least, most


def find_degrees(ordinals: Ints, grid: Grid) -> tuple[float, Ints] | None:
    """A unit and the counts that ``of_products`` turns into these ordinals, or None."""
    if not is_tiny(ordinals, grid):
        return None
    sample = np.unique(ordinals)
    sample = sample[:: max(1, len(sample) // _SAMPLE)]
    for halvings in _HALVINGS:
        unit = DEGREE * 2.0**-halvings
        if _counts(sample, unit, grid) is not None:
            counts = _counts(ordinals, unit, grid)
            if counts is not None:
                return unit, counts
    return None


def _counts(ordinals: Ints, unit: float, grid: Grid) -> Ints | None:
    counts = np.rint(grid.values(ordinals) / unit).astype(np.int64)
    if np.abs(counts).max() >= MOST or (of_products(counts, unit, grid) != ordinals).any():
        return None
    return counts
