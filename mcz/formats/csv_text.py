"""Lines of comma-separated values: their cells, quotes undone, and where rows of numbers begin."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mcz.formats.limits import MOST_CHANNELS, check
from mcz.formats.text_source import BOM

SEPARATORS: tuple[bytes | None, ...] = (b",", b";", b"\t", None)  # None: blanks
NOT_THERE = (b"", b"NA", b"N/A", b"null", b"NULL", b"None")  # what programs write for no number
MOST_CELLS = MOST_CHANNELS
LOOKED_AT = 64  # lines in which rows of numbers have to begin

_NUMBER = re.compile(
    rb"(?i)[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|nan|inf(?:inity)?"
    rb"|[0-9]\.#[a-z]+[0-9]*)"
)
_QUOTED = re.compile(rb'[ \t]*"((?:[^"]|"")*)"[ \t]*')
_COMMA = re.compile(rb"[-+]?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?")


def cells_of(line: bytes, separator: bytes | None) -> list[bytes]:
    """The cells of a line, without blanks and quotes around them; SourceError for too many."""
    line = line.removeprefix(BOM).rstrip(b"\r\n")
    n = len(line) // 2 if separator is None else line.count(separator)
    check("cells in a line", n, MOST_CELLS)
    if separator is None:
        return line.split()
    if b'"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    cells, at = [], 0
    while True:
        quoted = _QUOTED.match(line, at)
        if quoted and line[quoted.end() : quoted.end() + 1] in (b"", separator):
            cells.append(quoted[1].replace(b'""', b'"').strip())
            end = quoted.end()
        else:
            found = line.find(separator, at)
            end = found if found >= 0 else len(line)
            cells.append(line[at:end].strip())
        if end >= len(line):
            return cells
        at = end + len(separator)


def texts_of(line: bytes, separator: bytes | None, encoding: str) -> list[str]:
    """The cells of a line as text."""
    return [cell.decode(encoding, "replace") for cell in cells_of(line, separator)]


def first_row(
    lines: Sequence[tuple[int, bytes]],
) -> tuple[int, bytes | None, int] | None:
    """The number of the first line of numbers, its separator and how many cells it has.

    A line of names may look so; it has no other one below.
    """
    first = None
    for number, (_, line) in enumerate(lines[:LOOKED_AT]):
        found = [
            (len(cells), separator)
            for separator in SEPARATORS
            if is_row(cells := _some_cells(line, separator))
        ]
        if not found:
            continue
        n_cells, separator = max(found, key=lambda entry: entry[0])
        first = first or (number, separator, n_cells)
        below = next((line for _, line in lines[number + 1 :] if line.strip()), None)
        if below is None or is_row(_some_cells(below, separator)):
            return number, separator, n_cells
    return first


def _some_cells(line: bytes, separator: bytes | None) -> list[bytes]:
    """The cells of a line, none where these are too many."""
    n = len(line) // 2 if separator is None else line.count(separator)
    return cells_of(line, separator) if n < MOST_CELLS else []


def is_row(cells: Sequence[bytes]) -> bool:
    """Whether cells are numbers, at least one, and what stands for none."""
    found = False
    for cell in cells:
        if _NUMBER.fullmatch(cell):
            found = True
        elif cell not in NOT_THERE:
            return False
    return found


def has_decimal_commas(lines: Sequence[tuple[int, bytes]]) -> bool:
    """Whether cells between semicolons or tabs are numbers such as 1,5."""
    return any(
        len(cells := cells_of(line, separator)) > 1 and any(map(_COMMA.fullmatch, cells))
        for _, line in lines[:LOOKED_AT]
        for separator in (b";", b"\t")
    )
