"""CSV files: which kind one is, and the way to its reader.

The suffix .csv says little. A Motive file says its format version, one of Vicon has the columns
Frame and Sub Frame, and all others are columns of numbers, or no table of them.
"""

from __future__ import annotations

import re
from itertools import islice

from mcz.errors import MotionError, SourceError
from mcz.model.motion import Motion
from mcz.sources.tables.columns import counts_rows, read_columns_of
from mcz.sources.tables.csv_text import (
    cells_of,
    first_row,
    is_blank,
    is_like,
    is_row,
    texts_of,
    whole_cells,
)
from mcz.sources.tables.motive import HEAD, read_motive
from mcz.sources.tables.restore import restore_table
from mcz.sources.tables.rows import lines_from
from mcz.sources.tables.vicon import AXIS, read_vicon
from mcz.sources.text.rows import line_of
from mcz.sources.text.source import BOM, check_text

SNIFFED = 2**16  # bytes at the start that tell the kind
NAMES = ("csv", "motive", "vicon")
MOST_RETURNS = 1024  # carriage returns that are looked at

_RETURN = re.compile(rb"\r(?=[^\r\n])")


def kind_of(data: bytes) -> str | None:
    """Return "motive", "vicon" or "csv"; None for a file with no row of numbers near its start."""
    return vendor_of(data) or ("csv" if first_row(_lines(data)) else None)


def vendor_of(data: bytes) -> str | None:
    """Return "motive" or "vicon" for a file with the header of that vendor, else None."""
    start = data[:SNIFFED]
    if HEAD.match(start.removeprefix(BOM)):
        return "motive"
    return "vicon" if AXIS.search(start) else None


def is_motion(data: bytes) -> bool:
    """Return True if a file that begins with ``data`` seems to be a table of numbers.

    Looked at are the first ``SNIFFED`` bytes, so that a folder can be packed without the tables
    of words that lie in it.
    """
    kind = kind_of(data)
    if kind != "csv":
        return kind is not None
    lines = _lines(data)
    found = first_row(lines)
    if found is None:
        return False
    number, separator, _ = found
    cells = [cells_of(line, separator) for _, line in lines[number:] if not is_blank(line)]
    if separator is not None and all(map(is_row, cells)):
        return True
    names = texts_of(lines[number - 1][1], separator, "latin-1") if number else []
    return any(map(counts_rows, names)) and all(is_like(row, cells[0]) for row in cells)


def _lines(data: bytes) -> list[tuple[int, bytes]]:
    """The lines at the start of ``data`` that are looked at, without one that is cut off."""
    start = data[:SNIFFED]
    whole = start if len(data) < SNIFFED else start[: start.rfind(b"\n") + 1]
    return whole_cells(lines_from(whole, 0))


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in a CSV file, whose source says the kind of file.

    Raises SourceError, with the number of the line.
    """
    check_text(data)
    _check_line_ends(data)
    reader = {"motive": read_motive, "vicon": read_vicon}.get(kind_of(data) or "", read_columns_of)
    return reader(data, name)


def _check_line_ends(data: bytes) -> None:
    """Raise SourceError for a carriage return, outside of quotes, that ends a line by itself."""
    for match in islice(_RETURN.finditer(data), MOST_RETURNS):
        start = data.rfind(b"\n", 0, match.start()) + 1
        if data.count(b'"', start, match.start()) % 2 == 0:
            raise SourceError(
                "lines end with carriage returns alone; save it with line feeds",
                line=line_of(data, start),
            )


def write(motion: Motion) -> bytes:
    """The CSV file that ``motion`` was read from, with its values.

    Raises MotionError where it was read from none: ``mcz.files.tables`` writes others.
    """
    if motion.source is None or motion.source.format not in NAMES:
        raise MotionError(
            f"motion {motion.name!r} comes from no CSV file; a table of it is written otherwise"
        )
    return restore_table(motion)
