"""The text of every number of a signal, printed by its grids, with its exceptions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.kernels import SPARE
from mcz.model.motion import Signal
from mcz.model.numbers import Grid, GridKind, print_values, scan
from mcz.model.types import Values

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]
BLOCK = 2**17  # cells that are printed at a time
INTEGERS = Grid(GridKind.FIXED)
SHORTEST = Grid(GridKind.TEXT64)


class Cells:
    """Token (row, column) is ``texts[start[row, column]:][:size[row, column]]``.

    ``start`` and ``size`` have shape (n_rows, n_channels + 1); the last column holds the frame
    numbers, if any. Raises FormatError for an exception that is no number or lies outside.
    """

    def __init__(self, signal: Signal, numbers: Ints | None) -> None:
        n_rows, n_columns = signal.values.shape
        self.start = np.zeros((n_rows, n_columns + 1), np.int64)
        self.size = np.zeros((n_rows, n_columns + 1), np.int64)
        self._pieces: list[Bytes] = []
        self._total = 0
        step = max(1, BLOCK // max(1, n_columns))
        for first, last, grids in _by_rows(signal):
            for row in range(first, last, step):
                self._print_rows(signal.values, slice(row, min(row + step, last)), grids)
        self._print_exceptions(signal)
        if numbers is not None:
            texts = INTEGERS.texts(numbers - (numbers < 0))  # -1 - |n| where n is negative
            self.start[:, -1] = texts.offsets[:-1] + self._total
            self.size[:, -1] = np.diff(texts.offsets)
            self._append(texts.buffer)

    def texts(self) -> Bytes:
        texts = np.concatenate([*self._pieces, np.zeros(SPARE, np.uint8)])
        texts.flags.writeable = False  # nobody writes to it
        return texts

    def set(self, rows: Ints, columns: Ints, texts: Sequence[bytes]) -> None:
        """Give single cells another text."""
        if len(texts):
            sizes = np.array([len(text) for text in texts], dtype=np.int64)
            stops = np.cumsum(sizes)
            self.start[rows, columns] = self._total + stops - sizes
            self.size[rows, columns] = sizes
            self._append(np.frombuffer(b"".join(texts), np.uint8))

    def set_same(self, chosen: NDArray[np.bool_], text: bytes) -> None:
        """Give the ``chosen`` cells (n_rows, n_channels) one text, which may be empty."""
        self.start[:, :-1][chosen] = self._total
        self.size[:, :-1][chosen] = len(text)
        self._append(np.frombuffer(text + b"\0", np.uint8))  # what is empty begins with no sign

    def _append(self, buffer: Bytes) -> None:
        self._pieces.append(buffer)
        self._total += len(buffer)

    def _print_rows(self, values: Values, rows: slice, grids: Sequence[Grid]) -> None:
        """Print rows of one grid a column, those of decimal grids at once."""
        values, size = values[rows], self.size[rows]
        self._append(print_values(values, grids, self._total, self.start[rows], size))
        if size[:, :-1].all():
            return
        row, column = np.nonzero(size[:, :-1] == 0)
        for grid in dict.fromkeys(grids[c] for c in np.flatnonzero(np.bincount(column)).tolist()):
            mine = np.array([known == grid for known in grids])[column]
            own_row, own_column = row[mine], column[mine]
            self._print(grid, values[own_row, own_column], own_row + rows.start, own_column)

    def _print(self, grid: Grid, values: Values, rows: Ints, columns: Ints) -> None:
        """Print values by the nearest number of their grid, by repr where they lie beyond it."""
        if not grid.is_text:
            grid = SHORTEST  # GRID-07
        values = values.astype(np.float64, copy=False)
        words, inverse = np.unique(values.view(np.int64), return_inverse=True)
        unique = words.view(np.float64)  # what is the same is printed once
        ordinals, exact = grid.ordinals(unique)
        texts = grid.texts(ordinals)
        self.start[rows, columns] = (texts.offsets[:-1] + self._total)[inverse]
        self.size[rows, columns] = np.diff(texts.offsets)[inverse]
        self._append(texts.buffer)
        edge = np.maximum(ordinals, -1 - ordinals) == grid.limit
        off = np.flatnonzero((~exact & (edge | ~np.isfinite(unique)))[inverse])
        if len(off):
            self.set(rows[off], columns[off], [repr(v).encode() for v in values[off].tolist()])

    def _print_exceptions(self, signal: Signal) -> None:
        """Print exceptions as they were where the value still is that of their text."""
        exceptions = signal.exceptions
        if not len(exceptions):
            return
        rows, columns = exceptions.rows, exceptions.channels
        shape = np.array(signal.values.shape)[:, None]
        cells = np.stack([rows, columns])
        stops = np.cumsum([len(text) + 1 for text in exceptions.texts])
        starts = np.concatenate([[0], stops[:-1]])
        tokens = scan(b" ".join((*exceptions.texts, b"")), starts, stops - 1)
        if (cells < 0).any() or (cells >= shape).any() or tokens.bad().any():
            raise FormatError("an exception is no number, or lies outside of the signal")
        now, then = signal.values[rows, columns].astype(np.float64), tokens.values()
        same = (now.view(np.int64) == then.view(np.int64)) | (np.isnan(now) & np.isnan(then))
        kept = np.flatnonzero(same)  # AMC-06
        self.set(rows[kept], columns[kept], [exceptions.texts[k] for k in kept])


def _by_rows(signal: Signal) -> Iterator[tuple[int, int, list[Grid]]]:
    """Runs of rows in which no column changes its grid, with the grid of each column."""
    changes: dict[int, list[tuple[int, Grid]]] = {}
    for row, column, grid in signal.grid_changes:
        changes.setdefault(row, []).append((column, grid))
    grids = list(signal.grids)
    for first, last in pairwise(sorted({0, signal.n_rows, *changes})):
        for column, grid in changes.get(first, ()):
            grids[column] = grid
        yield first, last, grids
