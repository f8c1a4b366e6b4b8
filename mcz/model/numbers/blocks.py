"""The parts of a signal that have one grid each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from mcz.model.numbers.grid import Grid


def grid_blocks(
    n_rows: int, grids: Sequence[Grid], changes: Sequence[tuple[int, int, Grid]]
) -> Iterator[tuple[slice, list[int], Grid]]:
    """Blocks (rows, columns, grid) that cover ``n_rows``; see ``Signal.grid_changes``."""
    cuts = sorted({0, n_rows, *(row for row, _, _ in changes)})
    current = list(grids)
    ordered = sorted(changes, key=lambda change: change[0])
    for start, stop in pairwise(cuts):
        for row, channel, grid in ordered:
            if row == start:
                current[channel] = grid
        for grid in dict.fromkeys(current):
            yield slice(start, stop), [c for c, g in enumerate(current) if g == grid], grid
