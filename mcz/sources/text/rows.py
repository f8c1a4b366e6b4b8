"""The frames of a text file: find every token, and learn the patterns that lay them out.

A format tells where the next frame is (``Frames``), token by token; that is slow, so it is asked
only where the frame does not follow the pattern of the one before. All others are matched by a
compiled loop. The cost is linear in the bytes of the file.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.text_format import quote
from mcz.sources.text import WORDS, Items, text_kernels
from mcz.sources.text.layout import (
    FRAME_NUMBER,
    FRAME_NUMBER_TEXT,
    MAX_PATTERNS,
    MAX_ROW_GAPS,
    MAX_WIDTH,
    Pattern,
    RowNotes,
    runs_of,
)

Ints = NDArray[np.int64]
Token = tuple[int, int, int]  # start, stop, column
# The tokens of the frame that begins at an offset, and where it ends; None after the last frame.
Frames = Callable[[int], tuple[list[Token], int] | None]

SPARSE, DENSE = 16, 2  # cells a byte: where a row names its columns, and where each has a cell
FEW_CELLS = 2**18  # that any file may have
GROWTH = 16  # of the room for rows at once: the first rows tell little of all others
MAX_NUMBER = 10**15  # of a frame, either sign
LOOK_FOR_PADDING = (8, 64)  # numbers of patterns at which to look for padded columns
_TAIL = re.compile(rb"[\x00-\x09\x0b-\x20]*\n?")


def line_of(data: bytes, offset: int) -> int:
    """The number of the line at ``offset``, from 1."""
    return data.count(b"\n", 0, offset) + 1


def tail_end(data: bytes, at: int) -> int:
    """End of the tail of a frame whose last token ends at ``at``: after the next line end,
    or before the next token of the same line."""
    return _TAIL.match(data, at).end()  # type: ignore[union-attr]  # it matches nothing, too


@dataclass(frozen=True, slots=True, eq=False)
class TokenRows:
    """All frames: ``start`` and ``stop`` (n_rows, n_columns) of each token, 0 if it is absent.

    ``patterns`` come with the most common one first; ``numbers`` are the frame numbers, None if
    there are none or they count 1, 2, 3, ...; ``ending`` is what follows the last token, None if
    that is its pattern's tail.
    """

    start: Ints
    stop: Ints
    patterns: tuple[Pattern, ...]
    notes: RowNotes | None
    numbers: Ints | None
    ending: bytes | None

    @property
    def n_rows(self) -> int:
        return len(self.start)


def number_frames(rows: TokenRows, n_each: int = 1) -> TokenRows:
    """``rows``, ``n_each`` a frame, with numbers that ascend from frame to frame.

    If those of the file do not, they count from the first by 1, and the notes have its texts.
    """
    numbers = rows.numbers
    if numbers is None or (np.diff(numbers[::n_each]) > 0).all():
        return rows
    counted = numbers[0] + np.arange(rows.n_rows) // n_each
    known = {} if rows.notes is None else dict(rows.notes.texts)
    others = np.flatnonzero(counted != numbers).tolist()
    texts = {row: b"%d" % numbers[row] for row in others} | known
    patterns = np.zeros(rows.n_rows, np.int64) if rows.notes is None else rows.notes.patterns
    notes = RowNotes(patterns, tuple(sorted(texts.items())))
    return replace(rows, numbers=None if numbers[0] == 1 else counted, notes=notes)


def read_rows(
    data: bytes,
    at: int,
    n_columns: int,
    frames: Frames,
    cells: int = WORDS,
    widths: dict[int, int] | None = None,
    room: int = SPARSE,
) -> TokenRows:
    """Read all frames of ``data`` from offset ``at`` on; ``widths``: of columns known to be padded.

    ``cells``: what a token is, as ``text_kernels.match_rows`` has it. ``room``: how many cells
    there may be for each byte of ``data``, which bounds the memory.

    Raises SourceError if ``frames`` does, if the layout is too irregular to be worth
    a template, and if rows name so few columns that the table would dwarf the file.
    """
    widths = widths or {}
    for look_at in LOOK_FOR_PADDING:
        try:
            return _RowScanner(data, n_columns, frames, cells, widths, room, look_at).read(at)
        except _Padded as padded:
            widths = padded.widths
    return _RowScanner(data, n_columns, frames, cells, widths, room).read(at)


class _Padded(Exception):
    """The columns are padded; start over with these widths."""

    def __init__(self, widths: dict[int, int]) -> None:
        self.widths = widths


@dataclass(slots=True)
class _RowScanner:
    data: bytes
    n_columns: int
    frames: Frames
    cells: int
    widths: dict[int, int]  # of padded columns
    room: int
    look_at: int = MAX_PATTERNS
    start: Ints = field(init=False)
    stop: Ints = field(init=False)
    numbers: Ints = field(init=False)
    row: int = 0
    patterns: list[Pattern] = field(default_factory=list)
    arrays: list[Items] = field(default_factory=list)  # of each pattern
    ids: dict[object, int] = field(default_factory=dict)  # of items and tail, and of items alone
    used: list[tuple[int, int]] = field(default_factory=list)  # (first row, pattern) of each run
    number_texts: list[tuple[int, bytes]] = field(default_factory=list)
    samples: list[tuple[int, list[Token], int]] = field(default_factory=list)

    def read(self, at: int) -> TokenRows:
        text = np.frombuffer(self.data, np.uint8)
        begin, last_end = at, at
        self._allocate(min(64, self._most_rows()))
        while (frame := self.frames(at)) is not None:
            tokens, end = frame
            if self.row + 1 >= len(self.numbers):
                self._grow(at - begin, len(self.data) - begin)
            last_end = self._learn(at, tokens, end)
            number = self.used[-1][1]
            first, at = self.row, end
            while True:
                self.row, at = text_kernels.match_rows(
                    *(text, at, self.arrays[number], self.row, self.start, self.stop),
                    *(self.numbers, self.cells),
                )
                if self.row < len(self.numbers):
                    break
                self._grow(at - begin, len(self.data) - begin)
            if self.row > first:
                last_end = at - len(self.patterns[number].tail)
        return self._finish(last_end)

    def _allocate(self, n_rows: int) -> None:
        self.start = np.zeros((n_rows, self.n_columns), np.int64)
        self.stop = np.zeros((n_rows, self.n_columns), np.int64)
        self.numbers = np.zeros(n_rows, np.int64)

    def _most_rows(self) -> int:
        """Limit of the number of rows: more would take memory without bytes for it."""
        return (self.room * len(self.data) + FEW_CELLS) // max(1, self.n_columns) + 2

    def _grow(self, done: int, size: int) -> None:
        """Make room for as many rows as the file seems to have, going by the ``done`` bytes."""
        most = self._most_rows()
        if self.row + 2 > most:
            raise SourceError(
                f"frame {self.row}: most of the {self.n_columns} channels are missing from "
                "most frames, so a table would be far larger than the file"
            )
        expected = int((self.row + 1) * size / max(1, done) * 1.01) + 64
        n_rows = max(min(expected, GROWTH * len(self.numbers)), len(self.numbers) * 3 // 2)
        n_rows = max(min(n_rows, most), self.row + 2)
        old = self.start, self.stop, self.numbers
        self._allocate(n_rows)
        for new, array in zip((self.start, self.stop, self.numbers), old, strict=True):
            new[: len(array)] = array

    def _learn(self, at: int, tokens: list[Token], end: int) -> int:
        """Store the tokens of a row and its pattern; return the end of its last token."""
        self.start[self.row] = self.stop[self.row] = 0  # what a match that failed has left
        for start, stop, column in tokens:
            if column == FRAME_NUMBER:
                self._number(self.data[start:stop])
            else:
                self.start[self.row, column] = start
                self.stop[self.row, column] = stop
        items, last_end = self._items(at, tokens)
        tail = self.data[last_end:end]
        number = self.ids.get((items, tail))
        if number is None and end == len(self.data):  # the last row's tail is free: see ``ending``
            number = self.ids.get(items)
        if number is None:
            self.samples.append((at, tokens, end))
            number = self._add(items, tail, at)
        if not self.used or self.used[-1][1] != number:
            self.used.append((self.row, number))
        self.row += 1
        return last_end

    def _items(
        self, at: int, tokens: list[Token]
    ) -> tuple[tuple[tuple[bytes, int, int], ...], int]:
        """(gap, column, width) of each token, and where the last one ends, padding included."""
        items = []
        for start, stop, column in tokens:
            gap, width = self.data[at:start], self.widths.get(column, 0)
            at = stop
            if width:
                pad = blanks_beside(self.data[start:stop], width)
                blanks = gap[len(gap) - pad :] if width > 0 else self.data[stop : stop + pad]
                if blanks != b" " * pad:
                    width = 0
                elif width > 0:
                    gap = gap[: len(gap) - pad]
                else:
                    at = stop + pad
            items.append((gap, column, width))
        return tuple(items), at

    def _add(self, items: tuple[tuple[bytes, int, int], ...], tail: bytes, at: int) -> int:
        number = len(self.patterns)
        if number in LOOK_FOR_PADDING and number >= self.look_at:
            widths = find_widths(self.data, self.samples)
            if widths and widths != self.widths:
                raise _Padded(widths)
        pattern = Pattern(runs_of(items), tail)
        if number >= MAX_PATTERNS or pattern.gap_size > MAX_ROW_GAPS:
            raise SourceError(
                f"the layout is too irregular: frames follow more than {MAX_PATTERNS} "
                f"layouts, or have more than {MAX_ROW_GAPS} bytes besides their numbers",
                line=line_of(self.data, at),
            )
        self.patterns.append(pattern)
        self.arrays.append(pattern.arrays())
        self.ids[items, tail] = number
        self.ids.setdefault(items, number)
        return number

    def _number(self, token: bytes) -> None:
        number = int(token) if FRAME_NUMBER_TEXT.fullmatch(token) else MAX_NUMBER
        if abs(number) >= MAX_NUMBER:
            raise SourceError(
                f"frame {self.row}: {quote(token)} is not a frame number, or too large"
            )
        self.numbers[self.row] = number
        if token != b"%d" % number:
            self.number_texts.append((self.row, token))

    def _finish(self, last_end: int) -> TokenRows:
        """The rows read, with the most common pattern first."""
        n_rows = self.row
        counts: Counter[int] = Counter()
        edges = [*(row for row, _ in self.used), n_rows]
        for (row, number), stop in zip(self.used, edges[1:], strict=True):
            counts[number] += stop - row
        order = sorted(range(len(self.patterns)), key=lambda number: (-counts[number], number))
        rank = np.argsort(np.array(order, dtype=np.int64))
        of_runs = np.array([rank[number] for _, number in self.used], dtype=np.int64)
        notes = RowNotes(np.repeat(of_runs, np.diff(edges)), tuple(self.number_texts))
        numbers = self.numbers[:n_rows]
        numbered = any(run.column == FRAME_NUMBER for p in self.patterns[:1] for run in p.runs)
        numbered = numbered and not np.array_equal(numbers, np.arange(1, n_rows + 1))
        ending = self.data[last_end:]
        usual = self.patterns[self.used[-1][1]].tail if n_rows else b""
        return TokenRows(
            self.start[:n_rows],
            self.stop[:n_rows],
            tuple(self.patterns[number] for number in order),
            notes if notes.cut(0, n_rows) else None,
            numbers if numbered else None,
            None if ending == usual else ending,
        )


_SIGNS = (b"-", b"+")


def blanks_beside(token: bytes, width: int) -> int:
    """Blanks beside ``token`` in a column of this width."""
    if width == 1:
        return int(token[:1] not in _SIGNS)
    return max(0, abs(width) - len(token))


def find_widths(
    data: bytes, samples: Sequence[tuple[int, list[tuple[int, int, int]], int]]
) -> dict[int, int]:
    """The width of each column that seems to be padded, from sample frames (start, tokens, end).

    Only samples with the same columns as the first are looked at.
    """
    columns = [column for _, _, column in samples[0][1]]
    chosen = [s for s in samples if [column for _, _, column in s[1]] == columns]
    widths: dict[int, int] = {}
    for k, column in enumerate(columns):
        tokens = [data[t[k][0] : t[k][1]] for _, t, _ in chosen]
        before = [data[(t[k - 1][1] if k else at) : t[k][0]] for at, t, _ in chosen]
        after = [data[t[k][1] : (t[k + 1][0] if k + 1 < len(t) else end)] for at, t, end in chosen]
        if columns[k - 1 : k] and widths.get(columns[k - 1], 0) < 0:
            before = [b""]  # its blanks belong to the column before
        width = _width(tokens, [len(gap) - len(gap.rstrip(b" ")) for gap in before])
        if not width:
            width = -_width(tokens, [len(gap) - len(gap.lstrip(b" ")) for gap in after])
            width = 0 if width == -1 else width
        if width:
            widths[column] = width
    return widths


def _width(tokens: Sequence[bytes], blanks: Sequence[int]) -> int:
    """The width that explains these numbers of blanks beside the tokens; 0: none does."""
    if len(set(blanks)) < 2:
        return 0
    for fixed in sorted({0, min(blanks)}):
        width = max(n - fixed + len(token) for token, n in zip(tokens, blanks, strict=True))
        for guess in (width, 1):
            pads = [blanks_beside(token, guess) for token in tokens]
            if guess <= MAX_WIDTH and all(
                n - fixed == p for n, p in zip(blanks, pads, strict=True)
            ):
                return guess
    return 0
