"""Values and ordinals of a whole matrix, whose channels have grids of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcz.kernels import SPARE, lacks_compiled_kernels
from mcz.model.identity import IdentityCache
from mcz.model.numbers import token_kernels, value_kernels
from mcz.model.numbers.grid import Grid, grid_blocks
from mcz.model.numbers.rules import DECIMAL_KINDS, MIN_POWER, POWERS, TENS, GridKind
from mcz.model.numbers.text_grids import WIDEST, printed_exponents
from mcz.model.types import Bools, Floats, Ints, Values

Bytes = NDArray[np.uint8]


def values_of(
    ordinals: Values,
    grids: Sequence[Grid],
    changes: Sequence[tuple[int, int, Grid]] = (),
    out: Values | None = None,
) -> Floats:
    """The binary64 of each ordinal, (rows, channels); see ``Signal.grid_changes``.

    Values and errors are those of ``Grid.values``. ``out``, if given, receives them.
    """
    values = np.empty(ordinals.shape) if out is None else np.asarray(out, np.float64)
    if not changes and ordinals.flags.c_contiguous:
        left = np.ones(len(grids), np.int64)
        if not lacks_compiled_kernels():
            left[:] = 0
            integers = np.asarray(ordinals, np.int64)
            value_kernels.fill_values(integers, _known_rules(tuple(grids)), TENS, values, left)
        for grid, columns in _unfilled_channels(left, grids):
            values[:, columns] = grid.values(ordinals[:, columns])
        return values
    for rows, columns, grid in grid_blocks(len(ordinals), grids, changes):
        values[rows, columns] = grid.values(ordinals[rows][:, columns])
    return values


def ordinals_of(values: Values, grids: Sequence[Grid]) -> tuple[Ints, Bools]:
    """The ordinal of each value, (rows, channels), and whether it restores exactly this value.

    Results equal those of ``Grid.ordinals``.
    """
    numbers: Floats = np.ascontiguousarray(values, np.float64)
    ordinals, exact = np.empty(numbers.shape, np.int64), np.empty(numbers.shape, np.uint8)
    left = np.zeros(len(grids), np.int64)
    value_kernels.fill_ordinals(numbers, _rules(tuple(grids)), TENS, POWERS, ordinals, exact, left)
    for grid, columns in _unfilled_channels(left, grids):
        ordinals[:, columns], exact[:, columns] = grid.ordinals(numbers[:, columns])
    return ordinals, exact.view(np.bool_)


def print_values(
    values: Values, grids: Sequence[Grid], base: int, start: Ints, size: Ints
) -> Bytes:
    """The texts of the numbers nearest to values, (rows, channels), on their decimal grids.

    ``start``, counted from ``base``, and ``size`` locate each, except on other grids, for values
    beyond their grid, and if no product or quotient of tens is exact.
    """
    of_channels = print_rules(grids)
    out = np.empty(values.size * WIDEST + SPARE, np.uint8)
    numbers = np.asarray(values, np.float64)
    n_bytes = token_kernels.print_rows(numbers, of_channels, TENS, POWERS, out, base, start, size)
    return out[:n_bytes].copy()


def print_rules(grids: Sequence[Grid]) -> Ints:
    """The rules (channels, RULE_SIZE) of ``print_rows``, which changes their last column."""
    rules = {grid: _print_rule(grid) for grid in dict.fromkeys(grids)}
    size = token_kernels.RULE_SIZE
    return np.array([rules[grid] for grid in grids], np.int64).reshape(-1, size)


def _print_rule(grid: Grid) -> tuple[int, ...]:
    """Rules for the compiled loop that prints numbers of a grid."""
    if grid.kind not in DECIMAL_KINDS:
        return value_kernels.OTHER, *[0] * 7
    digits, *exponents = printed_exponents(grid.kind, grid.digits)
    trim = int(grid.kind != GridKind.FIXED)
    return digits, grid.digits, grid.limit, trim, *exponents, grid.flags, 0


def _unfilled_channels(
    is_unfilled: Ints, grids: Sequence[Grid]
) -> Iterator[tuple[Grid, list[int]]]:
    """The channels that a compiled loop did not fill, by grid."""
    channels = np.flatnonzero(is_unfilled).tolist()
    for grid in dict.fromkeys(grids[c] for c in channels):
        yield grid, [c for c in channels if grids[c] == grid]


@lru_cache(maxsize=64)
def _rules(grids: tuple[Grid, ...]) -> Ints:
    rules = np.empty((len(grids), value_kernels.RULE_SIZE), np.int64)
    for rule, grid in zip(rules, grids, strict=True):
        match grid.kind:
            case GridKind.GENERAL:
                rule[:] = grid.digits, MIN_POWER + 1 - grid.digits, grid.limit
            case GridKind.FIXED | GridKind.TRIMMED:
                rule[:] = value_kernels.FIXED, grid.digits, grid.limit
            case _:
                rule[:] = value_kernels.OTHER, 0, 0
    return rules


_known_rules = IdentityCache(_rules)
