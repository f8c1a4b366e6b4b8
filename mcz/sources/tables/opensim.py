"""STO and MOT (tables of OpenSim and SIMM): bytes -> Motion, and back.

SPEC.md, "The text of tables", is normative for the way back. Every column but the times is a joint
without a parent, whose channels are plain scalars: what they move, only the model knows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from mcz.errors import SourceError
from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.model.numbers import scan
from mcz.sources.tables.csv_text import check_points
from mcz.sources.tables.restore import plain_storage, restore_table
from mcz.sources.tables.rows import begins_with_number, lines_from, read_table, without_zeros
from mcz.sources.tables.signals import read_columns, table_metadata
from mcz.sources.tables.source import named_count, names_in, section_of, table_source
from mcz.sources.tables.times import as_times, half_digits_of, rate_of_times, stated_rate
from mcz.sources.text.rows import line_of
from mcz.sources.text.source import check_text, text_encoding

PARTS = {1: ("value",), 3: ("x", "y", "z")}  # names of the numbers of a cell; else 1, 2, ...
QUATERNION = ("w", "x", "y", "z")
MAX_PARTS = 64  # numbers of a cell

_END = re.compile(rb"(?im)^[ \t]*endheader[ \t]*\r?$\n?")
_KEY = re.compile(rb"[A-Za-z]+")
_COUNTS = ("nrows", "datarows")


@dataclass(frozen=True, slots=True)
class _Header:
    values: dict[str, str]  # by key in lower case
    count: tuple[int, int]  # where the number of rows is printed; (0, 0): nowhere
    labels: tuple[int, int]
    rows: int


def read_mot(data: bytes, name: str = "motion") -> Motion:
    """The motion in a MOT file; see ``read_sto``."""
    return _read(data, name, "mot")


def read_sto(data: bytes, name: str = "motion") -> Motion:
    """The motion in a STO file; ``name`` becomes its name.

    A frame rate is stated if the times are uniform. Raises SourceError, with the number of the
    line.
    """
    return _read(data, name, "sto")


def _read(data: bytes, name: str, format_name: str) -> Motion:
    check_text(data)
    encoding = text_encoding(data)
    header = _header(data)
    separator = b"\t" if b"\t" in data[header.rows :].partition(b"\n")[0] else None
    names, sizes = _columns(data, header, separator, encoding)
    label, names, sizes = names[0], names[1:], sizes[1:]
    starts = [0, *accumulate(sizes)]
    time = starts[-1]
    columns = [list(range(a, a + n)) for a, n in zip(starts, sizes, strict=False)]
    table = read_table(data, header.rows, time + 1, [[time], *columns], separator)
    rows = without_zeros(data, table.rows, ([time], range(time)))
    motion = read_columns(data, rows, range(time))
    read = read_columns(data, rows, [time])
    clock, odd = as_times(read, Channel("", label, "s"))
    kind = header.values.get("datatype", "").lower()
    skeleton = Skeleton(
        tuple(
            Joint(name, channels=_channels(size, kind))
            for name, size in zip(names, sizes, strict=True)
        ),
        angle_unit={"yes": "deg", "no": "rad"}.get(header.values.get("indegrees", "").lower(), ""),
    )
    times = np.asarray(read.values[:, 0], np.float64)
    tokens = scan(data, rows.start[:, time], rows.stop[:, time])
    stated = stated_rate(header.values.get("datarate", ""))
    digits = half_digits_of(data, rows.stop[:, time], tokens)
    rate, exact = rate_of_times(times, digits, [stated] if stated else [])
    start, stop = header.labels
    counted = named_count(data, 0, start, header.count, rows.n_rows)
    marked = counted + names_in(data[start:stop], names) + data[stop : header.rows]
    text = marked, data[: header.rows]
    section = section_of(text, (table.missing, None), rows, names, [0, 1])
    return Motion(
        skeleton,
        (motion, clock),
        rate,
        exact,
        name,
        table_metadata(encoding, [_note(header.values, rows.n_rows), odd]),
        table_source(format_name, data, [(section, rows, 1)]),
    )


def _header(data: bytes) -> _Header:
    end = _END.search(data)
    if end is None:
        raise SourceError("no line 'endheader'; not an STO or MOT file, or truncated", line=1)
    values: dict[str, str] = {}
    count = (0, 0)
    for at, line in lines_from(data[: end.start()], 0):
        word = _KEY.match(line)
        if word is None:
            continue
        key, rest = word[0].decode("latin-1").lower(), line[word.end() :]
        value = rest.strip(b" \t\r\n=")
        values.setdefault(key, value.decode("latin-1"))
        if key in _COUNTS and value:
            start = at + word.end() + rest.index(value)
            count = start, start + len(value)
    labels = None
    for at, line in lines_from(data, end.end())[:16]:
        if labels is None and line.strip():
            labels = at, at + len(line)
        elif begins_with_number(line):
            if labels is None:
                break
            return _Header(values, count, labels, at)
    raise SourceError(
        "names and a row of numbers must follow endheader", line=line_of(data, end.end())
    )


def _columns(
    data: bytes, header: _Header, separator: bytes | None, encoding: str
) -> tuple[list[str], list[int]]:
    """The name of every column, and how many numbers a cell of it holds."""
    labels = data[slice(*header.labels)]
    names = [cell.strip().decode(encoding) for cell in labels.split(separator)]
    row = data[header.rows :].partition(b"\n")[0].rstrip()
    cells = [cell.strip() for cell in row.split(separator)]
    while names and not names[-1] and len(names) > len(cells):
        names.pop()
    names += [f"column {k + 1}" for k in range(len(names), len(cells))]
    check_points(cells[:1], line_of(data, header.rows))
    sizes = [cell.count(b",") + 1 for cell in cells]
    if max(sizes) > MAX_PARTS or sizes[0] != 1:
        raise SourceError(
            f"{max(sizes)} numbers in a cell exceed the limit of {MAX_PARTS}, or the first "
            "cell does not have one",
            line=line_of(data, header.rows),
        )
    usual = max(set(sizes[1:]), key=sizes[1:].count, default=1)
    sizes += [usual] * (len(names) - len(sizes))
    return names, sizes


def _channels(size: int, kind: str) -> tuple[Channel, ...]:
    names = QUATERNION if kind == "quaternion" and size == 4 else PARTS.get(size, ())
    names = names or tuple(str(k + 1) for k in range(size))
    return tuple(Channel("", name) for name in names)


def _note(values: dict[str, str], n_rows: int) -> str:
    declared = next((values[key] for key in _COUNTS if key in values), None)
    if declared is None or declared == str(n_rows):
        return ""
    return f"{declared[:40]} frames are declared, {n_rows} are there"


def write_sto(motion: Motion) -> bytes:
    """The STO file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what STO cannot say; see ``plain_storage``.
    """
    return _write(motion, "sto")


def write_mot(motion: Motion) -> bytes:
    """The MOT file of ``motion``, as ``write_sto``."""
    return _write(motion, "mot")


def _write(motion: Motion, format_name: str) -> bytes:
    if motion.source is None or motion.source.format != format_name:
        motion = plain_storage(motion, format_name)
    return restore_table(motion)
