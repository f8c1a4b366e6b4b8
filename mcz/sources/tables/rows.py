"""Rows of a table in text: cells between separators, with one or several numbers.

``read_table`` finds the token of every column of every row, the text of a missing value, and the
patterns of the layout.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.numbers import decimal_kernels as kernels
from mcz.model.numbers import scan
from mcz.model.text_format import quote
from mcz.sources.tables.csv_text import BLANK_CELLS, cell_spans
from mcz.sources.tables.text_columns import TextColumn, odd_cells, refuse_commas, split_text
from mcz.sources.text import BLANKS, FREE, FULL
from mcz.sources.text.layout import FRAME_NUMBER, MAX_WIDTH, Pattern, runs_of
from mcz.sources.text.rows import DENSE, Token, TokenRows, line_of, read_rows

Bools = NDArray[np.bool_]

LOOKED_AT = 64  # rows, for columns that are padded
_BLANKS = b" \t\r\n"
_AROUND = _BLANKS + b'"'  # of a cell
_WORDS = re.compile(rb"[^ \t\r\n]+")
_PART = b","  # between the numbers of a cell
_FIRST = re.compile(rb'[ \t]*"?[-+]?\.?[0-9]')


def lines_from(data: bytes, at: int) -> list[tuple[int, bytes]]:
    """(offset, line with its end) of the lines from ``at`` on, at most 4096 of them."""
    lines: list[tuple[int, bytes]] = []
    while at < len(data) and len(lines) < 4096:
        end = data.find(b"\n", at) + 1 or len(data)
        lines.append((at, data[at:end]))
        at = end
    return lines


def begins_with_number(line: bytes) -> bool:
    return _FIRST.match(line) is not None


class RowCells:
    """The tokens of the row that begins at an offset; see ``rows.Frames``.

    ``columns``: the columns of each cell, several if it holds several numbers. ``separator`` None:
    blanks. ``blanks``: cells may be empty. ``free``: the first one, too.
    """

    def __init__(
        self,
        data: bytes,
        columns: Sequence[Sequence[int]],
        separator: bytes | None,
        blanks: bool = True,
        free: bool = False,
    ) -> None:
        self.data, self.columns, self.separator = data, columns, separator
        self.blanks, self.free = blanks, free

    def __call__(self, at: int) -> tuple[list[Token], int] | None:
        while True:
            end = self.data.find(b"\n", at) + 1 or len(self.data)
            line = self.data[at:end]
            if line.strip(_BLANKS if self.free else BLANK_CELLS):
                break
            if end == len(self.data):
                return None
            at = end
        if not (self.free or begins_with_number(line)):
            raise SourceError(f"not a row of numbers: {quote(line)}", line=line_of(self.data, at))
        tokens: list[Token] = []
        for (start, stop), columns in zip(self._cells(at, line), self.columns, strict=False):
            tokens += self._cell(start, stop, columns)
        return tokens, end

    def _cells(self, at: int, line: bytes) -> list[tuple[int, int]]:
        """Start and stop of every cell without its blanks; a blank cell at its end.

        More than there are columns are blank, or refused before they take memory.
        """
        most, first = len(self.columns), at
        if self.separator is None:
            words = islice(_WORDS.finditer(line), most + 1)
            spans = [(at + m.start(), at + m.end()) for m in words]
            rest = line if len(spans) > most else b""
        elif b'"' in line:
            spans, end = cell_spans(line.rstrip(b"\r\n"), self.separator, most)
            rest = line[end:].strip(_AROUND + self.separator)
            spans = [(at + start, at + stop) for start, stop in spans]
        else:
            cells = line.rstrip(b"\r\n").split(self.separator, most)
            rest = cells.pop().strip(_AROUND + self.separator) if len(cells) > most else b""
            spans = []
            for cell in cells:
                bare = cell.strip(_BLANKS)
                start = at + (cell.index(bare) if bare else len(cell))
                spans.append((start, start + len(bare)))
                at += len(cell) + len(self.separator)
        if rest:
            raise SourceError(f"more than {most} cells", line=line_of(self.data, first))
        return spans

    def _cell(self, start: int, stop: int, columns: Sequence[int]) -> list[Token]:
        if start == stop and (len(columns) > 1 or not self.blanks):
            return []
        if len(columns) == 1:
            return [(start, stop, columns[0])]
        n_parts = self.data.count(_PART, start, stop) + 1
        if n_parts != len(columns):
            raise SourceError(
                f"{n_parts} numbers in a cell; expected {len(columns)}",
                line=line_of(self.data, start),
            )
        parts = self.data[start:stop].split(_PART)
        tokens, at = [], start
        for part, column in zip(parts, columns, strict=True):
            bare = part.strip(_BLANKS)
            first = at + part.index(bare)
            tokens.append((first, first + len(bare), column))
            at += len(part) + len(_PART)
        return tokens


@dataclass(frozen=True, slots=True)
class TableRows:
    """All rows, and the text of a missing value, which has start and stop 0.

    ``texts``: the columns of text, whose numbers ``rows`` has.
    """

    rows: TokenRows
    missing: bytes
    texts: tuple[TextColumn, ...] = ()


def read_table(
    data: bytes,
    at: int,
    n_columns: int,
    columns: Sequence[Sequence[int]],
    separator: bytes | None,
    *,
    free: bool = False,
    numbers_at: int | None = None,
) -> TableRows:
    """Read all rows of ``data`` from offset ``at`` on; ``free``: they may begin with none.

    ``numbers_at``: in front of which column the numbers of text columns come; None: text is left
    if it is, and no number. Raises SourceError for what is no table, and if ``read_rows``
    does.
    """
    whole = data
    if free:  # lines of blank cells at the end are no rows
        data = data[: data.find(b"\n", len(data.rstrip(BLANK_CELLS))) + 1 or len(data)]

    def attempt(blanks: bool) -> TokenRows:
        cells = RowCells(data, columns, separator, blanks, free)
        empty = FREE if free and len(columns) > 1 else BLANKS  # an empty line is no row
        mode = empty if blanks else FULL
        return read_rows(data, at, n_columns, cells, mode, _padded_cells(data, at, cells), DENSE)

    rows = attempt(True)
    if not rows.n_rows:
        raise SourceError("there is no row of numbers", line=line_of(data, min(at, len(data))))
    blank = (rows.stop > 0) & (rows.start == rows.stop)
    odd = odd_cells(data, rows)
    texts = odd.text_columns() if numbers_at is not None else []
    refuse_commas(data, odd, rows.start, texts)
    blank[:, texts] = False
    missing, n_missing = odd.missing(texts)
    if n_missing <= np.count_nonzero(blank):
        missing = b""
    elif blank.any():  # both: what is blank is left out of the layout
        rows = attempt(False)  # which may have others, if a row had blanks alone
        blank = np.zeros(rows.start.shape, np.bool_)
    gone = blank
    if missing:
        gone = blank | _are(data, rows, missing)
        gone[:, texts] = False
    rows = append_rest(_drop_tokens(rows, gone), whole[len(data) :])
    if not texts or numbers_at is None:
        return TableRows(rows, missing)
    cell_numbers = {column: list(columns).index([column]) + 1 for column in texts}
    rows, text_columns = split_text(data, rows, cell_numbers, numbers_at)
    return TableRows(rows, missing, tuple(text_columns))


def append_rest(rows: TokenRows, rest: bytes) -> TokenRows:
    """``rows`` with what follows the last one."""
    ending = rows.patterns[last_pattern(rows)].tail if rows.ending is None else rows.ending
    return replace(rows, ending=ending + rest) if rest else rows


def _padded_cells(data: bytes, at: int, cells: RowCells) -> dict[int, int]:
    """The width of each column that its first rows show to be right justified."""
    totals: dict[int, list[tuple[int, int]]] = {}
    for _ in range(LOOKED_AT):
        spans = cells(at)
        if spans is None:
            break
        before = at
        for start, stop, column in spans[0]:
            gap = data[before:start]
            totals.setdefault(column, []).append((len(gap) - len(gap.rstrip(b" ")), stop - start))
            before = stop
        at = spans[1]
    widths = {}
    for column, seen in totals.items():
        width = max(n + size for n, size in seen)
        if any(n for n, _ in seen) and all(n == max(0, width - size) for n, size in seen):
            widths[column] = width
    return {column: width for column, width in widths.items() if 1 < width <= MAX_WIDTH}


def _are(data: bytes, rows: TokenRows, word: bytes) -> Bools:
    """Mask of the tokens equal to ``word``."""
    text = np.frombuffer(data, np.uint8)
    same: Bools = rows.stop - rows.start == len(word)
    for k, byte in enumerate(word):
        same &= text[np.minimum(rows.start + k, len(text) - 1)] == byte
    return same


def _drop_tokens(rows: TokenRows, gone: Bools) -> TokenRows:
    if not gone.any():
        return rows
    keep = ~gone
    return replace(rows, start=rows.start * keep, stop=rows.stop * keep)


def move_zeros_to_gaps(data: bytes, rows: TokenRows, groups: Sequence[Sequence[int]]) -> TokenRows:
    """``rows`` with the zeros that end every number of a group of columns moved to the gaps.

    ``%.6f`` of what has 3 decimals prints three zeros that say nothing.
    """
    zeros: dict[int, bytes] = {}
    for columns in groups:
        shared = _shared_zeros(data, rows, columns)
        if shared:
            zeros |= dict.fromkeys(columns, shared)
    for item in (item for pattern in rows.patterns for item in _split(pattern)):
        if item.width < 0 or (item.width > 1 and item.width - len(zeros.get(item.column, b"")) < 2):
            zeros.pop(item.column, None)  # blanks come between, or the width would mean another
    if not zeros:
        return rows
    less = np.zeros(rows.stop.shape[1], np.int64)
    less[list(zeros)] = [len(zero) for zero in zeros.values()]
    ending = rows.ending
    moved = [_move_pattern(pattern, zeros) for pattern in rows.patterns]
    if ending is not None:
        last = rows.patterns[last_pattern(rows)].runs
        column = last[-1].column + last[-1].n_columns - 1 if last else FRAME_NUMBER
        ending = zeros.get(column, b"") + ending
    return replace(rows, stop=rows.stop - less, patterns=tuple(moved), ending=ending)


def last_pattern(rows: TokenRows) -> int:
    """The number of the pattern of the last row."""
    if rows.notes is None or not len(rows.notes.patterns):
        return 0
    return int(rows.notes.patterns[-1])


def _split(pattern: Pattern) -> list[_Item]:
    return [
        _Item(run.gap, run.column + k, run.width)
        for run in pattern.runs
        for k in range(run.n_columns)
    ]


@dataclass(frozen=True, slots=True)
class _Item:
    gap: bytes
    column: int
    width: int


def _move_pattern(pattern: Pattern, zeros: dict[int, bytes]) -> Pattern:
    """``pattern`` with the zeros after each token moved to the front of the next gap."""
    items, before = [], b""
    for item in _split(pattern):
        zero = zeros.get(item.column, b"")
        width = item.width - len(zero) if item.width > 1 else item.width
        items.append((before + item.gap, item.column, width))
        before = zero
    return Pattern(runs_of(items), before + pattern.tail)


def _shared_zeros(data: bytes, rows: TokenRows, columns: Sequence[int]) -> bytes:
    """The zeros that end all tokens of the columns, with the point if nothing is before them."""
    chosen = list(columns)
    start, stop = rows.start[:, chosen].ravel(), rows.stop[:, chosen].ravel()
    if not len(start) or not stop.all():
        return b""
    tokens = scan(data, start, stop)
    mantissa, _, shape = tokens.fields.T
    odd = kernels.EXPONENT | kernels.LONG | kernels.SPECIAL | kernels.BAD
    places = shape >> kernels.FRACTION_DIGITS
    if (shape & odd).any() or (places != places[0]).any() or places[0] > 17:
        return b""
    decimals = int(places[0])
    if not mantissa.any():
        return b""  # a constant costs nothing
    n = 0
    while n < decimals and not (mantissa % 10 ** (n + 1)).any():
        n += 1
    return b"" if not n else b"." * (n == decimals) + b"0" * n
