"""CSV files: find the kind of a file, and call its reader.

A Motive file states its format version, a Vicon file has the columns Frame and Sub Frame; any other
is a table of numbers, or is refused.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice

from mcz.errors import MotionError, SourceError
from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.sources.robots import recognize_robot
from mcz.sources.tables.csv_text import (
    COMMENTS,
    cells_of,
    check_names,
    count_columns,
    first_row,
    has_decimal_commas,
    is_blank,
    is_like,
    is_row,
    texts_of,
    whole_cells,
)
from mcz.sources.tables.layout import UNIT_CM
from mcz.sources.tables.motive import HEAD, read_motive
from mcz.sources.tables.restore import restore_table
from mcz.sources.tables.rows import TableRows, lines_from, move_zeros_to_gaps, read_table
from mcz.sources.tables.signals import read_columns, read_text, table_metadata, text_note
from mcz.sources.tables.times import TableTimes, read_times
from mcz.sources.tables.vicon import AXIS, read_vicon
from mcz.sources.text.layout import FRAME_NUMBER
from mcz.sources.text.rows import TokenRows, line_of, number_frames
from mcz.sources.text.source import (
    BOM,
    check_text,
    names_in,
    section_of,
    table_source,
    text_encoding,
    text_start,
)

SNIFFED = 2**16  # bytes at the start that tell the kind
NAMES = ("csv", "motive", "vicon")
MOST_RETURNS = 1024  # most carriage returns to examine

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
    row = first_row(lines)
    if row is None:
        return False
    number, separator, _ = row
    cells = [cells_of(line, separator) for _, line in lines[number:] if not is_blank(line)]
    if separator is not None and all(map(is_row, cells)):
        return True
    names = texts_of(lines[number - 1][1], separator, "latin-1") if number else []
    return any(map(counts_rows, names)) and all(is_like(row, cells[0]) for row in cells)


def _lines(data: bytes) -> list[tuple[int, bytes]]:
    """The lines at the start of ``data`` that are examined, without a partial one."""
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
                "lines end with carriage returns only; save the file with line feeds",
                line=line_of(data, start),
            )


def write(motion: Motion) -> bytes:
    """The CSV file that ``motion`` was read from, with its values.

    Raises MotionError if it was read from none: ``mcz.files.tables`` writes others.
    """
    if motion.source is None or motion.source.format not in NAMES:
        raise MotionError(
            f"motion {motion.name!r} was not read from a CSV file, so it cannot be restored as one"
        )
    return restore_table(motion)


MAX_COLUMNS = 2**18  # of a table; no skeleton is stored with more joints

TIME = re.compile(
    r"(?i)(?:time|t|timestamps?|times|seconds?|secs?|zeit)"
    r"[ _]?[\[(]?(s|sec|secs|seconds?|ms|msec|milliseconds?|us|µs|ns)?[\])]?"
)
FRAME = re.compile(r"(?i)|#|frames?[ _]?(?:#|no\.?|numbers?|index|id)?|index|unnamed: 0")
_CLOCK = re.compile(r"(?i)time|date|stamp|clock")
_UNIT = re.compile(
    r"[\[(]?(?:|[munkµ]?(?:m|s|V|N|Pa|A|W|g|Hz)|cm|in|ft|kg|deg|degrees?|°|rad|radians?|%|-|1"
    r"|BW|sec|Nmm|N\.?m+|N\.mm|(?:deg|rad|m{1,2}|cm)/s(?:\^?2|²)?|g)[\])]?"
)
_COORDINATE = re.compile(r"(?i)(.*[^._: ])[._: ]([xyz])(?:[ _]?[\[(]?(mm|cm|m|in|ft)[\])]?)?")
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_NO_POSITION = re.compile(  # words of a name: LHipAngles, acc, ground_force, ...
    r"acc(?:el(?:eration)?s?)?|gyro?(?:scope)?|mag(?:net\w*)?|vel(?:ocit(?:y|ies))?|speeds?|jerk"
    r"|ang(?:les?|ular)?|rot(?:ations?)?|euler|omega|quat(?:ernions?)?|orient\w*|grf|forces?"
    r"|moments?|torques?|powers?|imu|emg"
)
_SECONDS = {"m": Fraction(1, 1000), "u": Fraction(1, 10**6), "n": Fraction(1, 10**9)}


@dataclass(frozen=True, slots=True)
class _Head:
    """Parsed lines above the rows; ``labels`` is the offset of the line of names."""

    rows: int
    separator: bytes | None
    names: list[str]
    units: list[str]
    labels: tuple[int, int]
    note: str = ""


def read_columns_of(data: bytes, name: str = "motion") -> Motion:
    """The motion in a plain CSV file; ``name`` becomes its name.

    A frame rate is stated if there is a column of uniform times. Raises SourceError, with the
    number of the line.
    """
    encoding = text_encoding(data)
    head = _head(data, encoding)
    called = (k for k, n in enumerate(head.names[:8]) if TIME.fullmatch(n.strip()))
    time = next(called, None) if len(head.names) > 1 else None
    table, cells = _rows(data, head, time)
    text_cells = [cells.index(text.column) for text in table.texts]
    values = [k for k in range(len(cells)) if cells[k] >= 0 and k not in (time, *text_cells)]
    if not values:
        raise SourceError("there is no column of numbers besides the times", line=1)
    at = len(values) + sum(text.n_numbers for text in table.texts)
    timed = time is not None and time not in text_cells
    rows = move_zeros_to_gaps(
        data, number_frames(table.rows), (range(len(values)), [at] if timed else [])
    )
    times = TableTimes(None, (), None, True)
    if time is not None and timed:
        label = head.names[time].strip()
        times = read_times(data, rows, at, unit=_seconds(label, head.units[time]), name=label)
    labels = [head.names[k] for k in text_cells]
    more = (*read_text(data, rows, table.texts, labels, (len(values), 1)), *times.signals)
    if text_cells and table.rows.numbers is None and not any(map(counts_rows, head.names)):
        _check_decimals(data, rows, len(values), labels)
    skeleton = _markers(head, values) or _scalars(head, values)
    names = [joint.name for joint in skeleton.joints]
    start, stop = head.labels
    marked = data[:start] + names_in(data[start:stop], names) + data[stop : head.rows]
    header, missing_and_clock = (marked, data[: head.rows]), (table.missing, times.clock)
    section = section_of(header, missing_and_clock, rows, names, range(1 + len(more)))
    motion = Motion(
        skeleton,
        (read_columns(data, rows, range(len(values))), *more),
        times.rate,
        times.exact,
        name,
        table_metadata(encoding, [text_note(labels), head.note, times.note]),
        table_source("csv", data, [(section, rows, 1)]),
        rows.numbers,
    )
    if head.labels == (0, 0):
        motion = recognize_robot(motion)
    return motion if times.printed is None else motion.at_times(times.printed)


def counts_rows(name: str) -> bool:
    """Tell whether a column of this name says when a row was recorded, as a number or in words."""
    return bool(TIME.fullmatch(name) or (name and FRAME.fullmatch(name)) or _CLOCK.search(name))


def _check_decimals(data: bytes, rows: TokenRows, n_values: int, labels: Sequence[str]) -> None:
    """Refuse texts beside integers alone if nothing counts the rows: a list is no motion."""
    present = rows.stop[:, :n_values] > 0
    start, stop = rows.start[:, :n_values][present], rows.stop[:, :n_values][present]
    if b"." not in b"".join(data[a:b] for a, b in zip(start, stop, strict=True)):
        raise SourceError(
            f"column {labels[0][:40]!r} is text beside integers, without times or frame "
            "numbers: it looks like a list, not a motion",
            line=line_of(data, int(start.max(initial=0))),
        )


def _scalars(head: _Head, values: Sequence[int]) -> Skeleton:
    """A joint with one plain scalar for each column."""
    joints = (Joint(head.names[k], channels=(Channel("", "value", head.units[k]),)) for k in values)
    return Skeleton(tuple(joints), angle_unit="")


def _markers(head: _Head, values: Sequence[int]) -> Skeleton | None:
    """The markers if all columns are their x, y and z, such as LASI.x, LASI.y, LASI.z.

    None if one is not, or if a name or unit excludes positions.
    """
    joints, units = [], set()
    for k in range(0, len(values), 3):
        matches = [_COORDINATE.fullmatch(head.names[column]) for column in values[k : k + 3]]
        axes = [match[2].lower() if match else "" for match in matches]
        name = matches[0][1] if matches[0] else ""
        if sorted(axes) != ["x", "y", "z"] or any(match and match[1] != name for match in matches):
            return None
        if any(_NO_POSITION.fullmatch(word.lower()) for word in _WORDS.findall(name)):
            return None
        joints.append(Joint(name, channels=tuple(Channel(f"t{axis}") for axis in axes)))
        units |= {
            (head.units[column] or (match and match[3]) or "").lower()
            for column, match in zip(values[k : k + 3], matches, strict=True)
        }
    if units - {"", *UNIT_CM} or len({joint.name for joint in joints}) < len(joints):
        return None
    unit_cm = UNIT_CM.get(units.pop()) if len(units) == 1 else None
    return Skeleton(tuple(joints), unit_cm=unit_cm, angle_unit="")


def _rows(data: bytes, head: _Head, time: int | None) -> tuple[TableRows, list[int]]:
    """The rows, and the column of each cell; that of the times is the last one."""
    numbered = FRAME.fullmatch(head.names[0].strip()) is not None and len(head.names) > 1
    numbered = numbered and head.labels != (0, 0)
    for first in (FRAME_NUMBER, 0) if numbered else (0,):
        cells = [0] * len(head.names)
        at = 0
        for k in range(len(cells)):
            if k == 0 and first == FRAME_NUMBER:
                cells[k] = FRAME_NUMBER
            elif k != time:
                cells[k] = at
                at += 1
        if time is not None:
            cells[time] = at
            at += 1
        if not at - (time is not None):
            continue
        try:
            columns = [[cell] for cell in cells]
            numbers_at = at - (time is not None)
            table = read_table(
                data, head.rows, at, columns, head.separator, free=True, numbers_at=numbers_at
            )
            return table, cells
        except SourceError:
            if first != FRAME_NUMBER:
                raise
    raise SourceError("there is no column of numbers besides the times", line=1)


def _head(data: bytes, encoding: str) -> _Head:
    """The layout of a table of numbers: separator, columns, the lines above its rows."""
    lines = whole_cells(lines_from(data, 0))
    row = first_row(lines)
    if row is None:
        if has_decimal_commas(lines):
            raise SourceError(
                "the first numbers have decimal commas, which are not supported; save the "
                "table with decimal points",
                line=1,
            )
        hint = "no row of numbers in the first lines; no table" if lines else "an empty file"
        raise SourceError(hint, line=1)
    number, separator, n_cells = row
    above = [(at, line) for at, line in lines[:number] if not is_blank(line)]
    texts = [texts_of(line, separator, encoding) for _, line in above]
    rows = lines[number][0] or text_start(data)
    heads = [cells for cells in texts[-2:] if len(cells) >= n_cells]
    n_cells = count_columns(heads, data[rows:], separator)
    if n_cells > MAX_COLUMNS:
        raise SourceError(f"{n_cells} columns exceed the limit of {MAX_COLUMNS}", line=number + 1)
    units, labels = [""] * n_cells, (0, 0)
    if len(texts) > 1 and len(texts[-2]) >= n_cells and _are_units(texts[-1]):
        units = [unit.strip("[]()") for unit in texts.pop()[:n_cells]]
        units += [""] * (n_cells - len(units))
        above.pop()
    names: list[str] = []
    note = ""
    if texts and len(texts[-1]) < n_cells and not above[-1][1].startswith(COMMENTS):
        note = check_names(texts[-1], lines[number][1], separator, line_of(data, above[-1][0]))
    if texts and len(texts[-1]) >= n_cells:
        at, line = above[-1]
        names, labels = texts[-1][:n_cells], (at, at + len(line))
        names[0] = names[0].removeprefix("# ") or names[0]
    names = names or [f"column {k + 1}" for k in range(n_cells)]
    names[1:] = [label or f"column {k + 2}" for k, label in enumerate(names[1:])]
    names = [_printable(label) for label in names]
    return _Head(rows, separator, names, [_printable(u) for u in units], labels, note)


def _are_units(cells: Sequence[str]) -> bool:
    """Return True if a line has at least one unit and only units."""
    return any(cells) and all(_UNIT.fullmatch(cell) for cell in cells)


def _printable(text: str) -> str:
    return "".join(character if ord(character) >= 32 else " " for character in text)


def _seconds(label: str, unit: str) -> Fraction:
    """Unit of the times in seconds."""
    match = TIME.fullmatch(label)
    stated = (match[1] if match else None) or unit or "s"
    return _SECONDS.get(stated[0].lower().replace("µ", "u"), Fraction(1))
