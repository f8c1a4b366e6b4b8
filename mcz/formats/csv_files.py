"""CSV files: which kind one is, and the way to its reader.

The suffix .csv says little. A Motive file says its format version, one of Vicon has the columns
Frame and Sub Frame, and all others are columns of numbers, or no table of them.
"""

from __future__ import annotations

import re

from mcz.errors import MotionError
from mcz.formats.csv_text import cells_of, first_row, is_row
from mcz.formats.table_restore import restore_table
from mcz.formats.table_rows import lines_from
from mcz.formats.text_source import BOM
from mcz.motion import Motion

SNIFFED = 2**16  # bytes at the start that tell the kind
NAMES = ("csv", "motive", "vicon")

_MOTIVE = re.compile(rb'[ \t]*"?Format Version"?,')
_VICON = re.compile(rb'(?im)^[ \t]*"?Frame"?([,;\t])[ \t]*"?Sub Frame"?(?=[,;\t\r\n])')


def kind_of(data: bytes) -> str | None:
    """ "motive", "vicon" or "csv"; None for what has no row of numbers near its start."""
    start = data[:SNIFFED]
    if _MOTIVE.match(start.removeprefix(BOM)):
        return "motive"
    if _VICON.search(start):
        return "vicon"
    return "csv" if first_row(lines_from(start, 0)) else None


def is_motion(data: bytes) -> bool:
    """Whether a file that begins with ``data`` seems to be a table of numbers.

    Looked at are the first ``SNIFFED`` bytes, so that a folder can be packed without the tables
    of words that lie in it.
    """
    kind = kind_of(data)
    if kind != "csv":
        return kind is not None
    start = data[:SNIFFED]
    whole = start if len(data) < SNIFFED else start[: start.rfind(b"\n") + 1]
    lines = lines_from(whole, 0)
    found = first_row(lines)
    if found is None:
        return False
    number, separator, _ = found
    rows = (cells_of(line, separator) for _, line in lines[number:] if line.strip())
    return all(map(is_row, rows)) and separator is not None


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in a CSV file, whose source says the kind of file.

    Raises SourceError, with the number of the line.
    """
    kind = kind_of(data)
    if kind == "motive":
        from mcz.formats.motive import read_motive

        return read_motive(data, name)
    if kind == "vicon":
        from mcz.formats.vicon import read_vicon

        return read_vicon(data, name)
    from mcz.formats.columns import read_columns_of

    return read_columns_of(data, name)


def write(motion: Motion) -> bytes:
    """The CSV file that ``motion`` was read from, with its values.

    Raises MotionError where it was read from none: ``mcz.tables`` writes others.
    """
    if motion.source is None or motion.source.format not in NAMES:
        raise MotionError(
            f"motion {motion.name!r} comes from no CSV file; a table of it is written otherwise"
        )
    return restore_table(motion)
