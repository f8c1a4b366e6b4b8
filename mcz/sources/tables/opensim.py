"""TRC, STO and MOT, the tables of OpenSim: bytes -> Motion, and back.

SPEC.md, "The text of tables", is normative for the way back. In TRC every marker is a joint without
a parent. The numbers of frames are those of the file; times follow from them, or are a signal.
In STO and MOT every column but the times is such a joint, whose channels are plain scalars: what
they move, only the model knows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from mcz.errors import SourceError
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Skeleton
from mcz.model.numbers import scan
from mcz.sources.tables.csv_text import check_points
from mcz.sources.tables.layout import NEXT, SAME, UNIT_CM
from mcz.sources.tables.restore import plain_storage, plain_trc, restore_table
from mcz.sources.tables.rows import begins_with_number, lines_from, move_zeros_to_gaps, read_table
from mcz.sources.tables.signals import read_columns, table_metadata
from mcz.sources.tables.times import (
    TableTimes,
    as_times,
    half_digits_of,
    rate_of_times,
    read_times,
    stated_rate,
)
from mcz.sources.text.layout import FRAME_NUMBER
from mcz.sources.text.rows import TokenRows, line_of, number_frames
from mcz.sources.text.source import (
    check_text,
    named_count,
    names_in,
    section_of,
    table_source,
    text_encoding,
)

POSITION = tuple(Channel(kind) for kind in POSITION_KINDS)

_LABELS = re.compile(rb"(?i)[ \t]*frame#?[ \t]")
_AXES = re.compile(rb"([Xx])([0-9]+)|([YyZz])([0-9]+)")
_KEYS = re.compile(rb"(?i)[ \t]*datarate\b")


@dataclass(frozen=True, slots=True)
class _TrcHeader:
    """Parsed header: ``values`` by key in lower case, and the offsets of labels and rows."""

    values: dict[str, str]
    count: tuple[int, int]  # where NumFrames is printed; (0, 0): nowhere
    labels: tuple[int, int]  # the line of labels
    rows: int


def read_trc(data: bytes, name: str = "motion") -> Motion:
    """The motion in a TRC file; ``name`` becomes its name; the up axis is unknown.

    Raises SourceError, with the number of the line.
    """
    check_text(data)
    encoding = text_encoding(data)
    header = _trc_header(data)
    labels = _marker_names(data[slice(*header.labels)], encoding)
    n_markers = max(len(labels), _count_markers(data, header.rows))
    names = (*labels, *(f"marker {k + 1}" for k in range(len(labels), n_markers)))
    time = 3 * n_markers
    columns = [[FRAME_NUMBER], [time], *([c] for c in range(time))]
    separator = b"\t" if b"\t" in data[header.rows :].partition(b"\n")[0] else None
    table = read_table(data, header.rows, time + 1, columns, separator)
    rows = move_zeros_to_gaps(data, number_frames(table.rows), ([time], range(time)))
    markers = read_columns(data, rows, range(time))
    joints = tuple(Joint(marker, channels=POSITION) for marker in names)
    unit_cm = UNIT_CM.get(header.values.get("units", "").lower())
    skeleton = Skeleton(joints, unit_cm=unit_cm, angle_unit="")
    times, note = _trc_times(data, rows, time, header.values)
    text = _mark_header(data, header, rows.n_rows, names[: len(labels)])
    signals = range(1 + len(times.signals))
    section = section_of(text, (table.missing, times.clock), rows, names, signals)
    motion = Motion(
        skeleton,
        (markers, *times.signals),
        times.rate,
        times.exact,
        name,
        table_metadata(encoding, [*note, *_count_notes(header.values, len(labels), rows.n_rows)]),
        table_source("trc", data, [(section, rows, 1)]),
        rows.numbers,
    )
    return motion if times.printed is None else motion.at_times(times.printed)


def _trc_header(data: bytes) -> _TrcHeader:
    """The header, which begins with PathFileType and ends before the first row."""
    lines = lines_from(data, 0)
    keys = next((k for k, (_, line) in enumerate(lines[:16]) if _KEYS.match(line)), None)
    labels = next((k for k, (_, line) in enumerate(lines[:64]) if _LABELS.match(line)), None)
    if labels is None:
        raise SourceError(
            "no line begins with Frame#; not a TRC file, or truncated", line=min(len(lines), 4)
        )
    values, count = {}, (0, 0)
    if keys is not None and keys + 1 < labels:
        names = lines[keys][1].decode("latin-1").split()
        at, line = lines[keys + 1]
        words = [(at + m.start(), m[0]) for m in re.finditer(rb"[^\t\r\n ]+", line)]
        for key, (start, word) in zip(names, words, strict=False):
            values[key.lower()] = word.decode("latin-1")
            if key.lower() == "numframes":
                count = start, start + len(word)
    for at, line in lines[labels + 1 : labels + 16]:
        if begins_with_number(line):
            start = lines[labels][0]
            return _TrcHeader(values, count, (start, start + len(lines[labels][1])), at)
    raise SourceError("no row of numbers follows the marker names", line=labels + 2)


def _marker_names(line: bytes, encoding: str) -> list[str]:
    """The names of the markers: what stands after Frame# and Time."""
    separator = b"\t" if b"\t" in line else None
    cells = [cell.strip() for cell in line.split(separator)]
    return [cell.decode(encoding) for cell in cells[2:] if cell]


def _count_markers(data: bytes, at: int) -> int:
    """Number of markers of the longest row."""
    cells = max((line.rstrip().count(b"\t") for line in data[at:].split(b"\n")), default=1)
    return max(0, -(-(cells - 1) // 3))


def _trc_times(
    data: bytes, rows: TokenRows, column: int, values: dict[str, str]
) -> tuple[TableTimes, list[str]]:
    """The times, and notes on oddities."""
    stated = [
        rate for key in ("datarate", "camerarate") if (rate := stated_rate(values.get(key, "")))
    ]
    times = read_times(data, rows, column, stated)
    rate, odd = times.rate, []
    if stated and rate is None:
        odd = ["the times are not uniform"]
    elif stated and rate is not None and rate not in stated:
        odd = [f"DataRate is {values['datarate'][:40]}, the times are {float(rate):g} a second"]
    return times, [*odd, times.note]


def _mark_header(
    data: bytes, header: _TrcHeader, n_rows: int, names: Sequence[str]
) -> tuple[bytes, bytes]:
    """The header with marks for names, their numbers and the count of rows; and unmarked."""
    start, stop = header.labels
    parts = (
        named_count(data, 0, start, header.count, n_rows),
        names_in(data[start:stop], names),
        _AXES.sub(lambda m: m[1] + NEXT if m[1] else m[3] + SAME, data[stop : header.rows]),
    )
    return b"".join(parts), data[: header.rows]


def _count_notes(values: dict[str, str], n_labels: int, n_rows: int) -> list[str]:
    notes = []
    declared = values.get("numframes", "")
    if declared != str(n_rows):
        notes.append(f"{declared[:40] or 'no'} frames are declared, {n_rows} are there")
    declared = values.get("nummarkers", "")
    if declared != str(n_labels):
        notes.append(f"{declared[:40] or 'no'} markers are declared, {n_labels} are named")
    return notes


def write_trc(motion: Motion) -> bytes:
    """The TRC file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what TRC cannot say; see ``plain_trc``.
    """
    if motion.source is None or motion.source.format != "trc":
        motion = plain_trc(motion)
    return restore_table(motion)


PARTS = {1: ("value",), 3: ("x", "y", "z")}  # names of the numbers of a cell; else 1, 2, ...
QUATERNION = ("w", "x", "y", "z")
MAX_PARTS = 64  # numbers of a cell

_END = re.compile(rb"(?im)^[ \t]*endheader[ \t]*\r?$\n?")
_KEY = re.compile(rb"[A-Za-z]+")
_COUNTS = ("nrows", "datarows")


@dataclass(frozen=True, slots=True)
class _StorageHeader:
    values: dict[str, str]  # by key in lower case
    count: tuple[int, int]  # where the number of rows is printed; (0, 0): nowhere
    labels: tuple[int, int]
    rows: int


def read_storage(data: bytes, name: str = "motion", *, format_name: str) -> Motion:
    """The motion in a STO or MOT file, by ``format_name``; ``name`` becomes its name.

    A frame rate is stated if the times are uniform. Raises SourceError, with the number of the
    line.
    """
    check_text(data)
    encoding = text_encoding(data)
    header = _storage_header(data)
    separator = b"\t" if b"\t" in data[header.rows :].partition(b"\n")[0] else None
    names, sizes = _cell_sizes(data, header, separator, encoding)
    label, names, sizes = names[0], names[1:], sizes[1:]
    starts = [0, *accumulate(sizes)]
    time = starts[-1]
    columns = [list(range(a, a + n)) for a, n in zip(starts, sizes, strict=False)]
    table = read_table(data, header.rows, time + 1, [[time], *columns], separator)
    rows = move_zeros_to_gaps(data, table.rows, ([time], range(time)))
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
    count = named_count(data, 0, start, header.count, rows.n_rows)
    marked = count + names_in(data[start:stop], names) + data[stop : header.rows]
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


def _storage_header(data: bytes) -> _StorageHeader:
    """Parse the keys above the rows of an STO or MOT file."""
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
            return _StorageHeader(values, count, labels, at)
    raise SourceError(
        "names and a row of numbers must follow endheader", line=line_of(data, end.end())
    )


def _cell_sizes(
    data: bytes, header: _StorageHeader, separator: bytes | None, encoding: str
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


def write_storage(motion: Motion, *, format_name: str) -> bytes:
    """The STO or MOT file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what these cannot hold; see ``plain_storage``.
    """
    if motion.source is None or motion.source.format != format_name:
        motion = plain_storage(motion, format_name)
    return restore_table(motion)
