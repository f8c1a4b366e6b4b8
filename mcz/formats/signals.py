"""Tokens of a table of rows -> a Signal: values, number grids, exceptions and mask."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.formats.rows import Rows, line_of
from mcz.motion import Exceptions, Signal
from mcz.numbers import Grid, Tokens, choose_grid, scan

Bools = NDArray[np.bool_]

CANDIDATES = 8  # grids of single columns that are tried on all of them
BLOCK = 512  # rows that may have a grid of their own
WORTH = 32  # exceptions that a change of grid must save


def read_signal(data: bytes, rows: Rows) -> Signal:
    """The motion signal of ``rows``; raises SourceError for a token that is no number.

    A token that is absent has mask False and the value of the row before (0 in the first row).
    """
    shape = rows.start.shape
    mask = rows.stop > 0
    dense = bool(mask.all())
    chosen = slice(None) if dense else np.flatnonzero(mask)
    tokens = scan(data, rows.start.ravel()[chosen], rows.stop.ravel()[chosen])
    bad = np.flatnonzero(tokens.bad())
    if len(bad):
        at, token = int(tokens.start[bad[0]]), tokens.token(int(bad[0]))
        raise SourceError(f"line {line_of(data, at)}: {token[:40]!r} is not a number")
    values = np.zeros(shape)
    values.ravel()[chosen] = tokens.values()
    if not dense:
        _hold(values, mask)
    of_token = np.nonzero(mask)
    grids, changes, printed = _grids(tokens, of_token[1], of_token[0], shape[1])
    odd = np.flatnonzero(~printed)
    return Signal(
        values,
        grids,
        mask=None if dense else mask,
        exceptions=Exceptions(
            of_token[0][odd], of_token[1][odd], tuple(tokens[odd].texts()) if len(odd) else ()
        ),
        grid_changes=changes,
    )


def _hold(values: NDArray[np.float64], mask: Bools) -> None:
    """Put the value of the row before beneath every False of the mask."""
    rows = np.where(mask, np.arange(len(mask))[:, None], 0)
    values[:] = np.take_along_axis(values, np.maximum.accumulate(rows, axis=0), axis=0)


def _grids(
    tokens: Tokens, column: NDArray[np.int64], row: NDArray[np.int64], n_columns: int
) -> tuple[tuple[Grid, ...], tuple[tuple[int, int, Grid], ...], Bools]:
    """The grid of every column, its changes, and which tokens the grids print."""
    common = choose_grid(tokens)
    printed = common.ordinals_of_tokens(tokens)[1]
    if printed.all():
        return (common,) * n_columns, (), printed
    order = np.argsort(column, kind="stable")  # column by column, rows in order
    edges = np.searchsorted(column[order], np.arange(n_columns + 1))
    mine = [order[a:b] for a, b in pairwise(edges)]
    common = _common_grid(tokens, [choose_grid(tokens[chosen]) for chosen in mine], common)
    grids, changes = [], []
    for c, chosen in enumerate(mine):
        grid, more, printed[chosen] = _column(tokens[chosen], row[chosen], common)
        grids.append(grid)
        changes += [(at, c, change) for at, change in more]
    return tuple(grids), tuple(sorted(changes, key=lambda change: change[:2])), printed


def _common_grid(tokens: Tokens, grids: Sequence[Grid], guess: Grid) -> Grid:
    """The grid that prints most tokens, of ``guess`` and the most frequent of ``grids``."""
    frequent = [grid for grid, _ in Counter(grids).most_common(CANDIDATES)]
    return max(
        (guess, *frequent),
        key=lambda grid: np.count_nonzero(grid.ordinals_of_tokens(tokens)[1]),
    )


def _column(
    tokens: Tokens, row: NDArray[np.int64], common: Grid
) -> tuple[Grid, list[tuple[int, Grid]], Bools]:
    """The grid of one column, its changes (row, grid), and which tokens are printed.

    ``common`` is kept where no grid does better, so that columns share a grid where they can.
    """
    grid = choose_grid(tokens, prefer=(common,))
    printed = grid.ordinals_of_tokens(tokens)[1]
    if np.count_nonzero(~printed) < WORTH:
        return grid, [], printed
    return _by_blocks(tokens, row, grid, printed)


def _by_blocks(
    tokens: Tokens, row: NDArray[np.int64], grid: Grid, printed: Bools
) -> tuple[Grid, list[tuple[int, Grid]], Bools]:
    """As ``_column``, with another grid for each run of blocks where that saves exceptions."""
    current, changes = None, []
    result = printed.copy()
    for start in range(0, len(row), BLOCK):
        block = slice(start, start + BLOCK)
        some = tokens[block]
        usual = (current or grid).ordinals_of_tokens(some)[1]
        best = choose_grid(some)
        better = best.ordinals_of_tokens(some)[1]
        if np.count_nonzero(better) >= np.count_nonzero(usual) + WORTH:
            changes.append((int(row[start]), best))
            current, usual = best, better
        result[block] = usual
    if not changes:
        return grid, [], printed
    return grid, changes, result
