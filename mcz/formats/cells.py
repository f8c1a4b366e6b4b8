"""The text of every number of a signal, printed by its grids, with its exceptions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind, scan
from mcz.types import Values

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Columns = Ints | slice

BLOCK = 2**17  # cells that are printed at a time
INTEGERS = Grid(GridKind.FIXED)
SHORTEST = Grid(GridKind.TEXT64)
SLOW = (
    GridKind.TEXT32,
    GridKind.TEXT64,
    GridKind.PRINTED,
)  # printed by Python, not by a compiled loop


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
        for grid, rows, columns in _by_grid(signal):
            self._print(grid, signal.values[rows, columns], rows, columns)
        self._print_exceptions(signal)
        if numbers is not None:
            ordinals = numbers - (numbers < 0)  # -1 - |n| where n is negative
            self._add(INTEGERS, ordinals, slice(None), slice(n_columns, None))

    def texts(self) -> Bytes:
        texts = np.concatenate([*self._pieces, np.zeros(1, np.uint8)])
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

    def _add(self, grid: Grid, ordinals: Ints, rows: slice, columns: Columns) -> None:
        starts, sizes = self.start[rows], self.size[rows]
        step = max(1, BLOCK // max(1, ordinals.shape[1] if ordinals.ndim > 1 else 1))
        for first in range(0, len(ordinals), step):
            block = slice(first, first + step)
            part = ordinals[block]
            inverse: Ints | slice = slice(None)
            unique: Ints = part.ravel()
            if grid.kind in SLOW:  # what is the same is printed once
                unique, inverse = np.unique(part, return_inverse=True)
            texts = grid.texts(unique)
            shape = starts[block, columns].shape
            starts[block, columns] = (texts.offsets[:-1] + self._total)[inverse].reshape(shape)
            sizes[block, columns] = np.diff(texts.offsets)[inverse].reshape(shape)
            self._append(texts.buffer)

    def _print(self, grid: Grid, values: Values, rows: slice, columns: Columns) -> None:
        """Print values by the nearest number of their grid, by repr where they lie beyond it."""
        if not grid.is_text:
            grid = SHORTEST  # GRID-07
        values = values.astype(np.float64, copy=False)
        ordinals, exact = grid.ordinals(values)
        self._add(grid, ordinals, rows, columns)
        if exact.all():
            return
        edge = np.maximum(ordinals, -1 - ordinals) == grid.limit
        off = np.nonzero(~exact & (edge | ~np.isfinite(values)))
        if len(off[0]):
            all_columns = np.arange(self.start.shape[1])[columns]
            texts = [repr(value).encode() for value in values[off].tolist()]
            self.set(off[0] + (rows.start or 0), all_columns[off[1]], texts)

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


def _by_grid(signal: Signal) -> Iterator[tuple[Grid, slice, Columns]]:
    """Every cell once: (grid, rows, columns), as few and large blocks as there are grids."""
    changes: dict[int, list[tuple[int, Grid]]] = {}
    for row, column, grid in signal.grid_changes:
        changes.setdefault(column, []).append((row, grid))
    of_grid: dict[Grid, list[int]] = {}
    for column, grid in enumerate(signal.grids):
        if column not in changes:
            of_grid.setdefault(grid, []).append(column)
    for grid, columns in of_grid.items():
        together = len(columns) == signal.n_channels
        yield grid, slice(None), slice(0, len(columns)) if together else np.array(columns)
    for column, steps in changes.items():
        edges = [0, *(row for row, _ in steps), signal.n_rows]
        grids = [signal.grids[column], *(grid for _, grid in steps)]
        for grid, start, stop in zip(grids, edges, edges[1:], strict=False):
            yield grid, slice(start, stop), np.array([column])
