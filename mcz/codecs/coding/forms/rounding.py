"""Binary32 numbers on the grid of a channel: their ordinals, and what grids keep of them.

``ordinals_of_binary32`` is normative (SPEC.md, "Codec 1: fast"); the rest serves encoders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.kernels import lacks_compiled_kernels
from mcz.model.numbers import Grid, GridKind, ordinals_of
from mcz.model.numbers.magnitudes import POWERS

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
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

    Values below ``least`` are taken for it.
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
