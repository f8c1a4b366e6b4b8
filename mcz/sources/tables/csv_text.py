"""Lines of comma-separated values: their cells, quotes undone, and where rows of numbers begin."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mcz.errors import SourceError
from mcz.model.text_format import quote
from mcz.sources.text.source import BOM, MOST_CHANNELS, check_count

SEPARATORS: tuple[bytes | None, ...] = (b",", b";", b"\t", None)  # None: blanks
# words for a number that is not there, those of spreadsheets among them
NO_NUMBER = (
    *(b"NA", b"N/A", b"n/a", b"null", b"NULL", b"None"),
    *(b"#N/A", b"#DIV/0!", b"#VALUE!", b"#REF!", b"#NUM!"),
)
NOT_THERE = (b"", *NO_NUMBER)
MOST_CELLS = MOST_CHANNELS
BLANK_CELLS = b' \t\r\n,;"'  # bytes of cells that say nothing
LOOKED_AT = 64  # rows of numbers begin within so many lines
COMMENTS = (b"#", b"%", b"//")  # how lines begin that are neither names nor rows

_NUMBER = re.compile(
    rb"(?i)[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|nan|inf(?:inity)?"
    rb"|[0-9]\.#[a-z]+[0-9]*)"
)
_OPEN = re.compile(rb'(?:\A|[,;\t])[ ]*"[^"]*\Z')  # a quoted cell that goes on below
MOST_LINES = 16  # of a quoted cell
_QUOTED = re.compile(rb'[ \t]*"((?:[^"]|"")*)"[ \t]*')
_QUOTED_BY_TABS = re.compile(rb' *"((?:[^"]|"")*)" *')
DECIMAL_COMMA = re.compile(rb"[-+]?[0-9]+(?:\.[0-9]{3})*,[0-9]+(?:[eE][-+]?[0-9]+)?")


def cells_of(line: bytes, separator: bytes | None) -> list[bytes]:
    """The cells of a line, without blanks and quotes around them; SourceError for too many."""
    line = line.removeprefix(BOM).rstrip(b"\r\n")
    n = len(line) // 2 if separator is None else line.count(separator)
    check_count("cells in a line", n, MOST_CELLS)
    if separator is None:
        return line.split()
    if b'"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    spans, _ = cell_spans(line, separator, n + 1)
    return [line[start:stop].replace(b'""', b'"') for start, stop in spans]


def whole_cells(lines: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    """``lines``, their offsets and bytes, with the lines of a quoted cell joined."""
    cells: list[tuple[int, bytes]] = []
    n_joined = 0
    for number, (at, line) in enumerate(lines):
        if n_joined:
            n_joined -= 1
            continue
        if b'"' in line and _OPEN.search(line.rstrip(b"\r\n")):
            below = [text for _, text in lines[number + 1 : number + MOST_LINES]]
            n_joined = next((k for k, text in enumerate(below, 1) if text.count(b'"') % 2), 0)
            line = b"".join((line, *below[:n_joined]))
        cells.append((at, line))
    return cells


def cell_spans(line: bytes, separator: bytes, most: int) -> tuple[list[tuple[int, int]], int]:
    """Start and stop of the first ``most`` cells, blanks and quotes around them left out.

    Also returns where the next cell begins, ``len(line)`` if there is none. A separator within
    quotes is text. A blank cell lies at its end.
    """
    spans: list[tuple[int, int]] = []
    at, size = 0, len(line)
    in_quotes = _QUOTED_BY_TABS if separator == b"\t" else _QUOTED
    while len(spans) < most:
        quoted = in_quotes.match(line, at)
        if quoted and line[quoted.end() : quoted.end() + 1] in (b"", separator):
            start, stop = quoted.span(1)
            end = quoted.end()
        else:
            end = line.find(separator, at)
            start, stop = at, end if end >= 0 else size
            end = stop
        bare = line[start:stop].strip()
        start = start + line[start:stop].index(bare) if bare else stop
        spans.append((start, start + len(bare)))
        if end >= size:
            return spans, size
        at = end + len(separator)
    return spans, at


def is_blank(line: bytes) -> bool:
    """Return whether all cells of a line are blank, as spreadsheets fill up empty lines."""
    return not line.removeprefix(BOM).strip(BLANK_CELLS)


def count_columns(heads: Sequence[Sequence[str]], rows: bytes, separator: bytes | None) -> int:
    """The number of columns of a table: up to the last cell that some line fills.

    ``heads``: the cells of the lines above the rows. Spreadsheets fill all lines up to one width,
    so a blank cell at the end of a line is no column. If the first row has more cells than the
    heads, all rows are examined.
    """
    named = max((_count_filled(cells) for cells in heads), default=0)
    if len(cells_of(rows[: rows.find(b"\n") + 1 or len(rows)], separator)) <= named:
        return named
    filled = (_count_filled(cells_of(line, separator)) for line in rows.split(b"\n"))
    return max(named, *filled)


def _count_filled(cells: Sequence[str] | Sequence[bytes]) -> int:
    """The number of cells up to the last one that is not blank."""
    return next((k for k in range(len(cells), 0, -1) if cells[k - 1]), 0)


def texts_of(line: bytes, separator: bytes | None, encoding: str) -> list[str]:
    """The cells of a line as text."""
    return [cell.decode(encoding, "replace") for cell in cells_of(line, separator)]


def first_row(lines: Sequence[tuple[int, bytes]]) -> tuple[int, bytes | None, int] | None:
    """The number of the first row of numbers, its separator and how many cells it has.

    Some columns may be text. A line of names may look like numbers; it has no other one below.
    """
    row = _first_numbers(lines)
    if row is None and not has_decimal_commas(lines, (b";", b"\t")):
        row = _last_row(lines)
    if row is None:
        return None
    number, separator, n_cells = row
    if separator is not None:
        number = _first_like(lines, number, separator)
    return number, separator, n_cells


def _first_like(lines: Sequence[tuple[int, bytes]], number: int, separator: bytes) -> int:
    """The first of the rows that end with line ``number``; cells may be texts.

    Right below a line of names, all lines with numbers are rows: a word may replace a number.
    """
    cells = cells_of(lines[number][1], separator)
    above = [_some_cells(line, separator) for _, line in lines[:number]]
    while number and is_like(above[number - 1], cells):
        number -= 1
    first = number
    while first and len(above[first - 1]) == len(cells) and any(map(_is_number, above[first - 1])):
        first -= 1
    is_named = first and _are_names(lines[first - 1 : first], separator, len(cells))
    return first if is_named else number


def _is_number(cell: bytes) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _first_numbers(lines: Sequence[tuple[int, bytes]]) -> tuple[int, bytes | None, int] | None:
    """The first line whose cells are all numbers or blank."""
    first = None
    for number, (_, line) in enumerate(lines[:LOOKED_AT]):
        candidates = [
            (len(cells), separator)
            for separator in SEPARATORS
            if is_row(cells := _some_cells(line, separator))
        ]
        if not candidates:
            continue
        n_cells, separator = max(candidates, key=lambda entry: entry[0])
        first = first or (number, separator, n_cells)
        below = next((line for _, line in lines[number + 1 :] if line.strip()), None)
        if (
            below is None
            or is_row(_some_cells(below, separator))
            or below.lstrip().startswith(COMMENTS)
            or _are_names(lines[number - 1 : number], separator, n_cells)
        ):
            return number, separator, n_cells
    return first


def _are_names(lines: Sequence[tuple[int, bytes]], separator: bytes | None, n_cells: int) -> bool:
    """Return True for a single line of ``n_cells`` names and no number."""
    cells = [cell for _, line in lines for cell in _some_cells(line, separator)]
    return len(cells) == n_cells and all(cells[1:]) and not any(map(_is_number, cells))


def _last_row(lines: Sequence[tuple[int, bytes]]) -> tuple[int, bytes, int] | None:
    """The last examined line, if it has numbers among its cells, and names or rows above.

    With a column of text no line has only numbers; the last one is the least likely header.
    """
    looked_at = [k for k, (_, line) in enumerate(lines[:LOOKED_AT]) if not is_blank(line)]
    if len(looked_at) < 2:
        return None
    number = looked_at[-1]
    candidates = [
        (len(cells), separator)
        for separator in (b",", b";", b"\t")
        if len(cells := _some_cells(lines[number][1], separator)) > 1
        and any(map(_NUMBER.fullmatch, cells))
        and len(_some_cells(lines[looked_at[-2]][1], separator)) == len(cells)
    ]
    if not candidates:
        return None
    n_cells, separator = max(candidates, key=lambda entry: entry[0])
    return number, separator, n_cells


def is_like(cells: Sequence[bytes], others: Sequence[bytes]) -> bool:
    """Return whether a line has as many cells as another, and numbers if that has numbers."""
    if len(cells) != len(others):
        return False
    pairs = [cell for cell, other in zip(cells, others, strict=True) if _NUMBER.fullmatch(other)]
    return is_row(pairs)


def _some_cells(line: bytes, separator: bytes | None) -> list[bytes]:
    """The cells of a line, none if these are too many."""
    n = len(line) // 2 if separator is None else line.count(separator)
    return cells_of(line, separator) if n < MOST_CELLS else []


def is_row(cells: Sequence[bytes]) -> bool:
    """Return True if the cells are numbers, at least one, and placeholders for missing ones."""
    has_number = False
    for cell in cells:
        if _NUMBER.fullmatch(cell):
            has_number = True
        elif cell not in NOT_THERE:
            return False
    return has_number


def check_points(cells: Sequence[bytes], line: int) -> None:
    """Raise SourceError for a number with a decimal comma among the cells of a line."""
    for cell in cells:
        if DECIMAL_COMMA.fullmatch(cell):
            raise SourceError(
                f"{quote(cell)} has a decimal comma, which is not supported; save the table "
                "with decimal points",
                line=line,
            )


def check_names(names: Sequence[str], row: bytes, separator: bytes | None, line: int) -> str:
    """A note if ``line`` has fewer names than the row below it has cells; "" if it has not.

    Raises SourceError if there are two cells for each name: numbers with decimal commas.
    """
    cells = cells_of(row, separator)
    if not 1 < len(names) < len(cells):
        return ""
    if separator == b"," and len(cells) == 2 * len(names) and b"." not in row:
        raise SourceError(
            f"{len(names)} names above {len(cells)} integers, which may have decimal commas; "
            "save the table with decimal points or with another separator",
            line=line,
        )
    return f"line {line} has {len(names)} names for {len(cells)} columns: no column is named"


def has_decimal_commas(
    lines: Sequence[tuple[int, bytes]], separators: Sequence[bytes] = (b";", b"\t", b",")
) -> bool:
    """Return whether cells are numbers such as 1,5; between commas they are in quotes."""
    return any(
        len(cells := cells_of(line, separator)) > 1 and any(map(DECIMAL_COMMA.fullmatch, cells))
        for _, line in lines[:LOOKED_AT]
        for separator in separators
    )
