"""The cheap test for channels of GENERAL grids that may be counts of a converter.

Nothing here is normative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.model.numbers import Grid, values_of

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WINDOWS, SEEN = 4, 128  # runs of rows that are looked at, and their length
FEWEST = 9  # distinct values in a window that shows something
ENOUGH = 2  # windows that show something
WIDE = 4.0  # last places in a gap between values, at least
NEAR = 16.0  # times the unit that a gap may have to tell something
PARTS = 1, 2, 3  # of the least gap, one of which may be the unit
LOOSE = 0.25  # of a unit that a gap may be off
BINARY32 = 2.0**-23  # of a number: twice what rounding takes of it, at most


def may_be_counts(ordinals: Ints, columns: Ints, grids: Sequence[Grid]) -> Bools:
    """Tell the ``columns`` of ``ordinals`` in which no window of rows shows that there is no unit.

    Those with few distinct values are among them; ``grids`` are of the columns.
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
        with np.errstate(over="ignore"):  # a gap beyond binary64 tells nothing
            gaps = np.diff(values)
        tells = 1 + np.count_nonzero(gaps, axis=1) >= FEWEST
        some = some[tells]
        greatest = np.abs(values[tells][:, [0, -1]]).max(axis=1)
        hopeful[some] = _have_unit(gaps[tells], greatest, digits[some])
        left[some] -= 1
    return hopeful


def _have_unit(gaps: Floats, greatest: Floats, digits: Ints) -> Bools:
    """Most gaps between sorted values are whole numbers of the least one, or of a part of it."""
    places = 10.0 ** (np.floor(np.log10(greatest)) - digits + 1)  # values of last digits
    slack = (places + BINARY32 * greatest)[:, None]
    gaps = np.where(gaps > WIDE * slack, gaps, np.inf)
    least = gaps.min(axis=1, keepdims=True, initial=np.inf)
    least[np.isinf(least)] = 1.0  # no gap is wide
    ratios = gaps / least
    found = np.zeros(len(digits), np.bool_)
    for parts in PARTS:
        unit, near = least / parts, parts * ratios <= NEAR
        counts = np.where(near, parts * ratios, 0.0)
        off = np.abs(counts - np.rint(counts)) * unit
        good = near & (off <= np.minimum(LOOSE * unit, slack * (1.0 + counts / parts)))
        n_near, n_good = near.sum(axis=1), good.sum(axis=1)
        found |= (n_near >= FEWEST - 1) & (8 * n_good >= 7 * n_near)
    return found
