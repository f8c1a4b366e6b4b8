"""Values, number grids, template, detail and notes -> the text of AMC, BVH or a table.

SPEC.md, "Source reconstruction", is normative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import SEEK_END, BytesIO
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, LimitError
from mcz.kernels import SPARE
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Motion, Signal, Source
from mcz.model.numbers import Grid, GridKind, print_values, scan
from mcz.model.numbers.rules import POWERS, TENS
from mcz.model.numbers.text_grids import WIDEST
from mcz.model.numbers.values import print_rules
from mcz.model.types import Floats, Ints, Values
from mcz.sources.text import Items, text_kernels
from mcz.sources.text.layout import FRAME_NUMBER, FrameLayout, Pattern, RowNotes, parse_layout
from mcz.sources.text.rows import MAX_NUMBER

TEXT_LIMIT = 2**26  # bytes that any text may have
TEXT_PER_CELL = 512  # bytes a cell of a larger text, with one more row and channel
Bytes = NDArray[np.uint8]
Run = tuple[Pattern, int, int]  # the pattern of rows start <= r < stop
TEXT_PER_SIZE = 4  # most bytes of a larger text, as a multiple of the source file's stated size


def restore(motion: Motion, source: Source) -> bytes:
    """The text that ``source`` and the values of ``motion`` make.

    Rows after the last note use pattern 0. A value that its grid does not have is printed as the
    nearest number of the grid.

    Raises FormatError if the source does not belong to such a motion, and LimitError for a text
    that is larger than the limits above.
    """
    signal = motion.signals[0]
    layout = parse_layout(source.template, source.detail, signal.n_channels)
    limit = text_limit(source, [(signal.n_rows, signal.n_channels)])
    notes = source.notes if isinstance(source.notes, RowNotes) else None
    runs = pattern_runs(layout, notes, signal.n_rows)
    if prints_frame_numbers(runs) and signal.samples_per_frame != 1:  # AMC-08
        raise FormatError(f"source template: frame numbers of {signal.samples_per_frame} rows each")
    header = layout.header[0]
    if len(layout.header) > 1:
        header = printed_count(layout, signal.n_rows).join(layout.header)
    out = BytesIO()
    out.write(header)
    numbers = numbers_or_rows(motion.frame_numbers, signal.n_rows)
    write_rows(out, signal, layout, notes, numbers, limit)
    return out.getvalue()


def printed_count(layout: FrameLayout, n_rows: int) -> bytes:
    """The number of rows as a header prints it."""
    return layout.count if layout.count and layout.rows == n_rows else b"%d" % n_rows  # AMC-06


def text_limit(source: Source, shapes: Sequence[tuple[int, int]]) -> int:
    """Most bytes for the rows of tables of these (rows, channels)."""
    limit = max(TEXT_LIMIT, TEXT_PER_CELL * sum(rows * (columns + 1) for rows, columns in shapes))
    return min(limit, max(TEXT_LIMIT, TEXT_PER_SIZE * source.size)) if source.size else limit


def write_rows(
    out: BytesIO,
    signal: Signal,
    layout: FrameLayout,
    notes: RowNotes | None,
    numbers: Ints,
    limit: int,
    missing: bytes | None = None,
) -> None:
    """Write all rows and what follows them; ``signal`` has the columns of the patterns.

    ``numbers`` are the frame numbers of the rows. ``missing``: what stands where the signal is
    invalid, None if that does not matter. Raises as ``restore`` does.
    """
    runs = pattern_runs(layout, notes, signal.n_rows)
    texts: list[tuple[int, bytes]] = []
    if notes is not None and prints_frame_numbers(runs):
        texts = [entry for entry in notes.texts if entry[0] < signal.n_rows]  # AMC-06
    missing = None if signal.mask is None else missing
    for piece in PrintedRows(signal, numbers, runs, texts, missing, limit).pieces():
        out.write(piece)
    if layout.ending is not None:
        out.seek(-len(runs[-1][0].tail) if runs else 0, SEEK_END)
        out.write(layout.ending)  # AMC-06
        out.truncate()


def prints_frame_numbers(runs: Sequence[Run]) -> bool:
    """Return True if rows print their frame number."""
    return any(run.column == FRAME_NUMBER for pattern, _, _ in runs for run in pattern.runs)


def pattern_runs(layout: FrameLayout, notes: RowNotes | None, n_rows: int) -> list[Run]:
    indices = np.zeros(n_rows, np.int64)
    if notes is not None:
        indices[: len(notes.patterns)] = notes.patterns[:n_rows]
    if not n_rows:
        return []
    if indices.max() >= len(layout.patterns):  # AMC-03
        raise FormatError(f"source notes: no pattern {indices.max()} among {len(layout.patterns)}")
    edges = [0, *(np.flatnonzero(np.diff(indices)) + 1).tolist(), n_rows]
    return [(layout.patterns[indices[a]], a, b) for a, b in pairwise(edges)]


SCRATCH = 2**20  # bytes for rows while they are printed, fewer than a processor's cache has
NEAR = 64  # rows near one with an odd cell are printed with it


@dataclass(slots=True)
class PrintedRows:
    """The rows of a table: ``print_rows`` prints most, ``PrintedCells`` those with odd cells.

    ``texts``: (row, odd text of its frame number). ``missing``: what stands where the mask of the
    signal is False, None for its values.
    """

    signal: Signal
    numbers: Ints
    runs: Sequence[Run]
    texts: Sequence[tuple[int, bytes]]
    missing: bytes | None
    limit: int
    size: int = 0  # of all rows so far
    items: dict[int, Items] = field(default_factory=dict)  # of patterns, by identity
    scratch: Bytes = field(default_factory=lambda: np.empty(0, np.uint8))

    def pieces(self) -> Iterator[memoryview]:
        """The text of all rows; a piece is valid until the next one.

        Raises LimitError before it takes more memory than the limit allows.
        """
        row = 0
        for first, last in self._odd_spans():
            yield from self._restore_plain(row, first)
            yield self._restore_any(first, last)
            row = last
        yield from self._restore_plain(row, self.signal.n_rows)

    def _odd_spans(self) -> list[tuple[int, int]]:
        """Rows start <= r < stop that ``print_rows`` cannot print, as far as is known before."""
        n_rows = self.signal.n_rows
        padded = any(run.width for pattern, _, _ in self.runs for run in pattern.runs)
        simple = self.missing is None and self.signal.samples_per_frame == 1 and not padded
        if n_rows and not (simple and np.abs(self.numbers).max() < MAX_NUMBER):
            return [(0, n_rows)]
        spans: list[tuple[int, int]] = []
        for row in sorted({*self.signal.exceptions.rows.tolist(), *(r for r, _ in self.texts)}):
            near = spans and row < spans[-1][1] + NEAR
            spans.append((spans.pop()[0] if near else row, row + 1))
        return spans

    def _restore_any(self, first: int, last: int) -> memoryview:
        """Restore rows with cells of any kind; their size is known before the first is written."""
        whole = (first, last) == (0, self.signal.n_rows)
        signal = self.signal if whole else self.signal.cut(first, last)
        runs = [(p, a - first, b - first) for p, a, b in _clip_runs(self.runs, first, last)]
        cells = PrintedCells(
            signal, self.numbers[first:last] if prints_frame_numbers(runs) else None
        )
        odd = [(row - first, text) for row, text in self.texts if first <= row < last]
        rows = np.array([row for row, _ in odd], dtype=np.int64)
        cells.set(rows, np.full_like(rows, -1), [text for _, text in odd])
        if self.missing is not None and signal.mask is not None:
            cells.set_same(~signal.mask, self.missing)  # TABLE-04
        texts = cells.texts()
        size = 0
        for pattern, a, b in runs:
            size += text_kernels.measure_rows(
                self._items(pattern), pattern.gap_size, texts, cells.start[a:b], cells.size[a:b]
            )
        self._count(size)
        out = np.empty(size + SPARE, np.uint8)
        at = 0
        for pattern, a, b in runs:
            at = text_kernels.fill_rows(
                out, at, self._items(pattern), texts, cells.start[a:b], cells.size[a:b]
            )
        return out.data[:size]

    def _restore_plain(self, first: int, last: int) -> Iterator[memoryview]:
        """Restore rows without odd cells; those near unprintable numbers go to ``_restore_any``."""
        values = np.ascontiguousarray(self.signal.values, np.float64)
        n_odd = NEAR
        for start, stop, grids in _grid_runs(self.signal):
            rules = print_rules(grids)
            for pattern, row, end in _clip_runs(self.runs, max(first, start), min(last, stop)):
                while row < end:
                    done, text = self._print_rows(pattern, values[row:end], row, rules)
                    row += done
                    if done:
                        yield text
                    else:
                        yield self._restore_any(row, min(row + n_odd, end))
                        row, n_odd = min(row + n_odd, end), 2 * n_odd  # a few calls at most

    def _print_rows(
        self, pattern: Pattern, values: Floats, row: int, rules: Ints
    ) -> tuple[int, memoryview]:
        """The number of rows printed, from ``row`` on, and their text."""
        items = self._items(pattern)
        room = pattern.gap_size + WIDEST * len(items.columns)
        n_rows = max(1, min(len(values), SCRATCH // max(1, room)))
        if len(self.scratch) < n_rows * room + SPARE:
            self.scratch = np.empty(n_rows * room + SPARE, np.uint8)
        numbers = self.numbers[row : row + n_rows]
        done, size = text_kernels.print_rows(
            values[:n_rows], numbers, rules, TENS, POWERS, items, self.scratch
        )
        self._count(size)
        return done, self.scratch.data[:size]

    def _items(self, pattern: Pattern) -> Items:
        if id(pattern) not in self.items:
            self.items[id(pattern)] = pattern.arrays()
        return self.items[id(pattern)]

    def _count(self, size: int) -> None:
        self.size += size
        if self.size > self.limit:  # AMC-07, LIMIT-12
            raise LimitError(f"source template: a text of {self.size} bytes, limit {self.limit}")


def _clip_runs(runs: Sequence[Run], first: int, last: int) -> Iterator[Run]:
    """The runs of rows first <= r < last."""
    for pattern, start, stop in runs:
        if max(start, first) < min(stop, last):
            yield pattern, max(start, first), min(stop, last)


BLOCK = 2**17  # cells that are printed at a time
INTEGERS = Grid(GridKind.FIXED)
SHORTEST = Grid(GridKind.TEXT64)


class PrintedCells:
    """Token (row, column) is ``texts[start[row, column]:][:size[row, column]]``.

    ``start`` and ``size`` have shape (n_rows, n_channels + 1); the last column holds the frame
    numbers, if any. Raises FormatError for an odd token that is not a number, or lies outside the
    signal.
    """

    def __init__(self, signal: Signal, numbers: Ints | None) -> None:
        n_rows, n_columns = signal.values.shape
        self.start = np.zeros((n_rows, n_columns + 1), np.int64)
        self.size = np.zeros((n_rows, n_columns + 1), np.int64)
        self._pieces: list[Bytes] = []
        self._total = 0
        step = max(1, BLOCK // max(1, n_columns))
        for first, last, grids in _grid_runs(signal):
            for row in range(first, last, step):
                self._print_rows(signal.values, slice(row, min(row + step, last)), grids)
        self._print_exceptions(signal)
        if numbers is not None:
            texts = INTEGERS.texts(numbers - (numbers < 0))  # -1 - |n| if n is negative
            self.start[:, -1] = texts.offsets[:-1] + self._total
            self.size[:, -1] = np.diff(texts.offsets)
            self._append(texts.buffer)

    def texts(self) -> Bytes:
        texts = np.concatenate([*self._pieces, np.zeros(SPARE, np.uint8)])
        texts.flags.writeable = False  # the frozen copy is final
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
        # The padding loop reads the first byte, even of an empty text.
        self._append(np.frombuffer(text + b"\0", np.uint8))

    def _append(self, buffer: Bytes) -> None:
        self._pieces.append(buffer)
        self._total += len(buffer)

    def _print_rows(self, values: Values, rows: slice, grids: Sequence[Grid]) -> None:
        """Print rows in which each column has one grid; columns of decimal grids first."""
        values, size = values[rows], self.size[rows]
        self._append(print_values(values, grids, self._total, self.start[rows], size))
        if size[:, :-1].all():
            return
        row, column = np.nonzero(size[:, :-1] == 0)
        for grid in dict.fromkeys(grids[c] for c in np.flatnonzero(np.bincount(column)).tolist()):
            has_grid = np.array([known == grid for known in grids])[column]
            own_row, own_column = row[has_grid], column[has_grid]
            self._print(grid, values[own_row, own_column], own_row + rows.start, own_column)

    def _print(self, grid: Grid, values: Values, rows: Ints, columns: Ints) -> None:
        """Print values by the nearest number of their grid; beyond its range, by repr."""
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
        """Print the stored text of an exception if its value is unchanged."""
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
        valid = np.flatnonzero(same)  # AMC-06
        self.set(rows[valid], columns[valid], [exceptions.texts[k] for k in valid])


def _grid_runs(signal: Signal) -> Iterator[tuple[int, int, list[Grid]]]:
    """Runs of rows in which no column changes its grid, with the grid of each column."""
    changes: dict[int, list[tuple[int, Grid]]] = {}
    for row, column, grid in signal.grid_changes:
        changes.setdefault(row, []).append((column, grid))
    grids = list(signal.grids)
    for first, last in pairwise(sorted({0, signal.n_rows, *changes})):
        for column, grid in changes.get(first, ()):
            grids[column] = grid
        yield first, last, grids
