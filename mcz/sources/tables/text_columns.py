"""Text columns of a table: time codes, dates, labels, flags.

The letters and signs of a text are literals of its row's pattern. Its digits are columns of
integers, one column a digit, or one a number if no number has leading zeros. A time code then costs
as little as a counter. docs/reference/readers.md, "Tables".
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mcz.errors import SourceError
from mcz.model.numbers import decimal_kernels as kernels
from mcz.model.numbers import scan
from mcz.model.types import Bools, Ints
from mcz.sources.tables.csv_text import DECIMAL_COMMA, NO_NUMBER, check_points
from mcz.sources.text.layout import MAX_PATTERNS, Pattern, RowNotes, runs_of
from mcz.sources.text.rows import DENSE, FEW_CELLS, TokenRows, blanks_beside, line_of

# A column of few texts is stored whole if they seldom change, or if many rows share each.
FEW_TEXTS = 16
FEW_CHANGES = 64
ROWS_A_TEXT = 8  # on average
_DIGITS = re.compile(rb"[0-9]+")
_PLAIN = re.compile(rb"0|[1-9][0-9]{0,14}")


@dataclass(frozen=True, slots=True)
class TextColumn:
    """A column of text: its index, and how many number columns it becomes."""

    column: int
    n_numbers: int


@dataclass(frozen=True, slots=True, eq=False)
class OddCells:
    """The cells that hold no plain number: their rows, columns, texts.

    ``is_missing``: mask of the words that mean no number (nan). ``n_cells``: cells of each column
    that are not blank.
    """

    rows: Ints
    columns: Ints
    texts: list[bytes]
    is_missing: Bools
    n_cells: Ints

    def missing(self, text_columns: Sequence[int]) -> tuple[bytes, int]:
        """The commonest word for a missing number, and its count; b"" if there is none."""
        chosen = self.is_missing & ~np.isin(self.columns, text_columns)
        counts = Counter(self.texts[k] for k in np.flatnonzero(chosen).tolist())
        return counts.most_common(1)[0] if counts else (b"", 0)

    def text_columns(self) -> list[int]:
        """The columns whose cells are mostly texts."""
        n_columns = len(self.n_cells)
        is_comma = np.array(
            [DECIMAL_COMMA.fullmatch(text) is not None for text in self.texts], np.bool_
        )
        columns = self.columns[~self.is_missing]
        n_texts = np.bincount(columns, minlength=n_columns)
        n_words = np.bincount(self.columns[self.is_missing], minlength=n_columns)
        n_commas = np.bincount(self.columns[is_comma], minlength=n_columns)
        chosen = (2 * n_texts > self.n_cells - n_words) & (2 * n_commas <= n_texts)
        chosen_columns: list[int] = np.flatnonzero(chosen).tolist()
        return chosen_columns


def odd_cells(data: bytes, rows: TokenRows) -> OddCells:
    """The cells of ``rows`` that hold no plain number, and are not blank."""
    present = rows.stop > rows.start
    chosen = slice(None) if present.all() else np.flatnonzero(present)
    tokens = scan(data, rows.start.ravel()[chosen], rows.stop.ravel()[chosen])
    odd = np.flatnonzero(tokens.fields[:, 2] & (kernels.BAD | kernels.SPECIAL))
    cells = tokens[odd]
    texts = cells.texts().tolist() if len(odd) else []
    is_bad = cells.bad()
    is_missing = np.array([text in NO_NUMBER for text in texts], np.bool_)
    is_missing[~is_bad] = np.isnan(cells[~is_bad].values())
    odd = odd if isinstance(chosen, slice) else chosen[odd]
    places = np.divmod(odd, rows.start.shape[1])
    return OddCells(*places, texts, is_missing, np.count_nonzero(present, axis=0))


def refuse_commas(data: bytes, odd: OddCells, start: Ints, text_columns: Sequence[int]) -> None:
    """Raise SourceError for numbers with decimal commas outside of ``text_columns``."""
    for k in np.flatnonzero(~np.isin(odd.columns, text_columns)).tolist():
        if DECIMAL_COMMA.fullmatch(odd.texts[k]):
            check_points([odd.texts[k]], line_of(data, int(start[odd.rows[k], odd.columns[k]])))


@dataclass(frozen=True, slots=True)
class _Shape:
    """A text: literals around its numbers, and the column of each number.

    ``padded``: sample text with the same padding, b"" if the column is not padded.
    """

    literals: tuple[bytes, ...]
    columns: tuple[int, ...]
    padded: bytes


def split_text(
    data: bytes, rows: TokenRows, columns: Mapping[int, int], at: int
) -> tuple[TokenRows, list[TextColumn]]:
    """``rows`` without the text ``columns``, with number columns inserted before ``at``.

    ``columns``: the cell number of each, for messages. Raises SourceError if the texts have too
    many different letters and signs.
    """
    shapes: list[tuple[Ints, list[_Shape]]] = []  # of each column: the shape of each row, and all
    numbers: list[tuple[Ints, Ints]] = []  # start and stop of each column of numbers
    text_columns = []
    padded = {
        r.column + k for p in rows.patterns for r in p.runs if r.width for k in range(r.n_columns)
    }
    for column in columns:
        places = rows.start[:, column], rows.stop[:, column]
        split = _split(data, *places, len(numbers), column in padded)
        shapes.append(split[:2])
        numbers += split[2]
        text_columns.append(TextColumn(column, len(split[2])))
    others = [c for c in range(rows.start.shape[1]) if c not in set(columns)]
    before = sum(c < at for c in others)
    place = {c: k + (len(numbers) if k >= before else 0) for k, c in enumerate(others)}
    start, stop = (
        np.column_stack(
            [
                array[:, others[:before]],
                *(pair[k] for pair in numbers),
                array[:, others[before:]],
            ]
        )
        for k, array in enumerate((rows.start, rows.stop))
    )
    usual = np.zeros(rows.n_rows, np.int64)
    layouts, of_row = np.unique(
        np.column_stack(
            [usual if rows.notes is None else rows.notes.patterns] + [of for of, _ in shapes]
        ),
        axis=0,
        return_inverse=True,
    )
    if len(layouts) > MAX_PATTERNS:
        most = max(zip(columns, shapes, strict=True), key=lambda entry: len(entry[1][1]))[0]
        raise SourceError(
            f"the texts of column {columns[most]} follow more than {MAX_PATTERNS} patterns "
            "(digits aside)",
            line=line_of(data, int(rows.start[:, most].max())),
        )
    of_row = of_row.ravel()
    order = np.argsort(-np.bincount(of_row), kind="stable")
    rank = np.argsort(order)
    patterns, last_carry = [], b""
    for layout in layouts[order].tolist():
        mine = {c: of[k] for c, (_, of), k in zip(columns, shapes, layout[1:], strict=True)}
        pattern, carry = _merge_columns(rows.patterns[layout[0]], mine, place, before)
        patterns.append(pattern)
        if layout == layouts[of_row[-1]].tolist():
            last_carry = carry
    texts = () if rows.notes is None else rows.notes.texts
    notes = RowNotes(rank[of_row], texts)
    return replace(
        rows,
        start=np.ascontiguousarray(start),
        stop=np.ascontiguousarray(stop),
        patterns=tuple(patterns),
        notes=notes if notes.cut(0, rows.n_rows) else None,
        ending=None if rows.ending is None else last_carry + rows.ending,
    ), text_columns


def _merge_columns(
    pattern: Pattern, shapes: dict[int, _Shape], place: dict[int, int], first: int
) -> tuple[Pattern, bytes]:
    """``pattern`` with texts in its gaps, and the prefix of its tail."""
    items, carry = [], b""
    for run in pattern.runs:
        for column in range(run.column, run.column + run.n_columns):
            gap, carry = carry + run.gap, b""
            shape = shapes.get(column)
            if shape is None:
                items.append((gap, place.get(column, column), run.width))
                continue
            pad = b" " * blanks_beside(shape.padded, run.width) if run.width else b""
            gap += pad if run.width > 0 else b""
            for literal, number in zip(shape.literals, shape.columns, strict=False):
                items.append((gap + literal, first + number, 0))
                gap = b""
            carry = gap + shape.literals[-1] + (pad if run.width < 0 else b"")
    return Pattern(runs_of(items), carry + pattern.tail), carry


def _split(
    data: bytes, start: Ints, stop: Ints, first: int, is_padded: bool
) -> tuple[Ints, list[_Shape], list[tuple[Ints, Ints]]]:
    """The shape of each row, all shapes, and the start and stop of each column of numbers.

    ``first``: the number of the first of these columns.
    """
    texts = [data[a:b] for a, b in zip(start.tolist(), stop.tolist(), strict=True)]
    counts = Counter(texts)
    n_changes = sum(text != after for text, after in pairwise(texts))
    seldom = n_changes <= max(FEW_CHANGES, len(texts) // ROWS_A_TEXT)
    whole = len(counts) <= FEW_TEXTS and seldom
    widths = [] if whole else _widths(counts)
    if len(start) * sum(widths) > DENSE * len(data) + FEW_CELLS:
        widths = []  # more cells than bytes: a few texts of many digits
    edges = np.cumsum([0, *(width or 1 for width in widths)]).tolist()
    split = {text: _shape(text, widths, edges, first, is_padded) for text in counts}
    shapes = list(dict.fromkeys(shape for shape, _ in split.values()))
    number = {shape: k for k, shape in enumerate(shapes)}
    columns = [
        (np.zeros(len(start), np.int64), np.zeros(len(start), np.int64)) for _ in range(edges[-1])
    ]
    of_row = np.zeros(len(start), np.int64)
    for row, (at, text) in enumerate(zip(start.tolist(), texts, strict=True)):
        shape, spans = split[text]
        of_row[row] = number[shape]
        for column, (a, b) in zip(shape.columns, spans, strict=True):
            columns[column - first][0][row] = at + a
            columns[column - first][1][row] = at + b
    return of_row, shapes, columns


def _widths(texts: Counter[bytes]) -> list[int]:
    """Digits of each padded number of the texts, a column each; 0: one unpadded column."""
    widths: list[int] = []
    plain: list[bool] = []
    for text in texts:
        for k, digits in enumerate(_DIGITS.findall(text)):
            if k == len(widths):
                widths.append(0)
                plain.append(True)
            widths[k] = max(widths[k], len(digits))
            plain[k] &= _PLAIN.fullmatch(digits) is not None
    return [0 if is_plain else width for width, is_plain in zip(widths, plain, strict=True)]


def _shape(
    text: bytes, widths: Sequence[int], edges: Sequence[int], first: int, is_padded: bool
) -> tuple[_Shape, tuple[tuple[int, int], ...]]:
    """The shape of a text, and where each of its numbers lies in it."""
    literals: list[bytes] = []
    columns: list[int] = []
    spans: list[tuple[int, int]] = []
    at = 0
    for width, stop, match in zip(widths, edges[1:], _DIGITS.finditer(text), strict=False):
        a, b = match.span()
        pieces = [(a, b)] if not width else [(k, k + 1) for k in range(a, b)]
        for k, piece in enumerate(pieces):
            literals.append(text[at : piece[0]])
            columns.append(first + stop - len(pieces) + k)
            spans.append(piece)
            at = piece[1]
    padded = (text[:1] if text[:1] in b"+-" else b"x") * len(text) if is_padded else b""
    return _Shape((*literals, text[at:]), tuple(columns), padded), tuple(spans)
