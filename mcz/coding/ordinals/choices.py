"""How an encoder of ``lossless`` chooses: lattice, predictor and first scale of every channel.

mcz/codecs/lossless/README.md describes it. Nothing here is normative: any plan decodes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.coding.forms.lattice import Lattice, base_and_digits
from mcz.numbers import Grid

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

DECIMAL_WIDTH, BINARY_WIDTH = 13, 44
TAP_UNIT = 32
MAX_TAP = 16 * TAP_UNIT - 1
FIXED_ORDERS = ((1, ()), (1, (32,)), (1, (64, -32)), (0, ()))  # from_last, taps
_FITTED = 4  # taps of a fitted predictor
_ROUNDS = 3  # of reweighted least squares, so that outliers count less


def lattice(grid: Grid, ordinals: Ints) -> Lattice:
    """The lattice of one channel's ordinals in a segment."""
    base, digits = base_and_digits(grid)
    if base == 0:
        largest = max(int(ordinals.max()), -1 - int(ordinals.min()))
        return Lattice(0, 0, max(0, largest.bit_length() - BINARY_WIDTH))
    magnitudes = ordinals ^ (ordinals >> 63)
    drop = 0
    if base == 2:
        used = int(np.bitwise_or.reduce(magnitudes))
        drop = min(_trailing_zeros(used), digits - 2)
    digits -= drop
    per_class = (base - 1) * base ** (digits - 1)
    top = (int(magnitudes.max() >> drop) - (base == 10)) // per_class
    return Lattice(base, digits, drop, max(0, top))


def _trailing_zeros(value: int) -> int:
    return (value & -value).bit_length() - 1 if value else 0


def fixed_point(ordinals: Ints, shape: Lattice) -> Floats:
    """The ordinals as the decoder's predictors see them, binary64 (n_rows,)."""
    if shape.base == 0:
        return (ordinals >> shape.drop).astype(np.float64)
    magnitudes = (ordinals ^ (ordinals >> 63)) >> shape.drop
    first = int(shape.base == 10)
    low = shape.base ** (shape.digits - 1)
    per_class = (shape.base - 1) * low
    width = DECIMAL_WIDTH if shape.base == 10 else BINARY_WIDTH
    power = (magnitudes - first) // per_class + width - shape.top - shape.digits
    mantissa = ((magnitudes - first) % per_class + low).astype(np.float64)
    sizes = np.floor(mantissa * float(shape.base) ** np.maximum(power, -300) + 0.5)
    return np.where(magnitudes == 0, 0.0, np.where(ordinals < 0, -sizes, sizes))


def choose_predictor(values: Floats, *, fitted: bool = True) -> tuple[int, tuple[int, ...], int]:
    """(from_last, taps, scale) that predict ``values`` best; scale is the mean error there.

    ``fitted``: taps may be fitted to the values, too.
    """
    before = np.concatenate([[0.0], values[:-1]])
    differences = np.clip(values - before, -(2.0**40), 2.0**40)
    lagged = np.zeros((len(values), _FITTED))
    for tap in range(_FITTED):
        lagged[tap + 1 :, tap] = differences[: max(0, len(values) - tap - 1)]
    candidates = [*FIXED_ORDERS, *(_fitted(differences, lagged) if fitted else ())]
    costs, scales = [], []
    for from_last, taps in candidates:
        guess = np.floor((lagged[:, : len(taps)] @ np.array(taps, float) + 16) / 32)
        errors = np.abs(values - guess - (before if from_last else 0.0))
        typical = _middle(errors)
        costs.append(float(np.log2(errors + 0.1 * typical + 1).sum()) + 9 * len(taps))
        scales.append(typical)
    best = int(np.argmin(costs))
    return *candidates[best], int(min(scales[best] * 1.4, 2.0**43))


def _middle(errors: Floats) -> float:
    """The upper median; numpy's own checks would cost more than the sorting."""
    middle = len(errors) // 2
    return float(np.partition(errors, middle)[middle])


def _fitted(differences: Floats, lagged: Floats) -> list[tuple[int, tuple[int, ...]]]:
    """Predictors of least absolute error, nearly, by reweighted least squares."""
    wanted, known = differences[_FITTED:], lagged[_FITTED:]
    unit = float(np.mean(np.abs(wanted))) if len(wanted) else 0.0
    if len(wanted) < 8 * _FITTED or unit == 0:
        return []
    wanted, known = wanted / unit, known / unit
    weights = np.ones(len(wanted))
    for _ in range(_ROUNDS):
        weighted = known * weights[:, None]
        normal = weighted.T @ known + 1e-9 * np.eye(_FITTED)
        solution = np.linalg.lstsq(normal, weighted.T @ wanted, rcond=None)[0]
        errors = np.abs(wanted - known @ solution)
        weights = 1 / (errors + 0.5 * _middle(errors) + 1e-6)
    taps = np.clip(np.rint(solution * TAP_UNIT), -MAX_TAP, MAX_TAP).astype(int)
    return [(1, tuple(taps.tolist()))]
