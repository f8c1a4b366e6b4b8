"""Channels whose values are whole multiples of a unit: integers scaled by some recorder.

``of_multiples`` is normative (SPEC.md, "Codec 1: fast", form 32); finding a unit is not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.forms.ids import BINARY32
from mcz.codecs.coding.forms.rounding import ordinals_of_binary32
from mcz.model.numbers import Grid

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

MOST = 2**20  # units in a value: beyond, the multiples take as many bits as the mantissas
GREATEST = 2.0**80  # unit that a head may have
_STEPS = 24  # of Euclid's algorithm


def of_multiples(multiples: Ints, unit: float, grid: Grid = BINARY32) -> Ints:
    """The ordinals on ``grid`` of the binary32 that are nearest to ``multiples * unit``."""
    with np.errstate(over="ignore"):
        values = (multiples * np.float64(unit)).astype("<f4")
    return ordinals_of_binary32(values, grid)


@np.errstate(over="ignore")  # numbers near the greatest
def find_multiples(ordinals: Ints) -> tuple[float, Ints] | None:
    """A unit and the multiples of it that ``of_multiples`` turns into these ordinals, or None."""
    if ordinals.max() > BINARY32.limit or ordinals.min() < BINARY32.lowest:
        return None
    values = BINARY32.values(ordinals)
    sizes = np.unique(np.abs(values))
    sizes = sizes[sizes > 0]
    if not np.isfinite(values).all() or not len(sizes):
        return None
    slack = float(np.spacing(np.float32(sizes[-1])))
    guess = _common_measure(sizes, slack)
    if guess * MOST < sizes[-1]:
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
    for size in sizes:  # small multiples first: each narrows what the next one is divided by
        count = max(1.0, np.rint(size / unit))
        half = float(np.spacing(np.float32(size))) / 2
        low, high = max(low, (size - half) / count), min(high, (size + half) / count)
        unit = (low + high) / 2
    return unit
