"""CSV files of Vicon Nexus (its ASCII export) and Tracker, of several sections: bytes -> Motion.

SPEC.md, "The text of tables", is normative for the way back. The trajectories, else the objects are
the motion, every marker and object a joint without a parent; the other sections are signals, of
several rows a frame if the file has sub frames.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import scan
from mcz.sources.tables.csv_text import count_columns, texts_of
from mcz.sources.tables.layout import MAX_SECTIONS, UNIT_CM, Section
from mcz.sources.tables.rows import (
    TableRows,
    append_rest,
    begins_with_number,
    move_zeros_to_gaps,
    read_table,
)
from mcz.sources.tables.signals import TEXT, read_columns, read_text, table_metadata, text_note
from mcz.sources.tables.times import stated_rate
from mcz.sources.text.layout import FRAME_NUMBER
from mcz.sources.text.rows import TokenRows, line_of, number_frames
from mcz.sources.text.source import names_in, section_of, table_source, text_encoding

Ints = NDArray[np.int64]

MOTIONS = ("trajectories", "objects", "segments")  # sections with positions, the first first
POSITIONS = {"tx": "tx", "ty": "ty", "tz": "tz"}
QUATERNION = {"rx": "qx", "ry": "qy", "rz": "qz", "rw": "qw"}
HELICAL = {"rx": "vx", "ry": "vy", "rz": "vz"}  # an axis times an angle

AXIS = re.compile(
    rb'(?im)^(?:\xef\xbb\xbf)?[ \t]*"?Frame"?([,;\t])[ \t]*"?Sub Frame"?(?=[,;\t\r\n])[^\n]*\n?'
)
_END = re.compile(rb'(?m)^(?![ \t]*"?[-+]?\.?[0-9])')
_OBJECT = re.compile(r"(?i)Global Angle(?: \((\w+)\))? (?=\S)")


@dataclass(frozen=True, slots=True)
class _Part:
    """A section as it is found: where it lies, its title, its rate, what its columns are called."""

    start: int
    rows: int
    stop: int
    separator: bytes
    title: str
    rate: str
    labels: tuple[int, int]
    groups: list[tuple[str, list[tuple[str, str]]]]  # name, and axis and unit of each column
    texts: tuple[str, ...] = ()  # names of the columns that are text, which no group has

    @property
    def n_columns(self) -> int:
        return sum(len(columns) for _, columns in self.groups)


@dataclass(slots=True)
class _Read:
    """A section with its rows; ``numbers`` are the frames of these.

    ``n_each``: rows a frame. ``spare``: the sub frames do not count 0, 1, 2, ...
    """

    part: _Part
    table: TableRows
    rows: TokenRows
    numbers: Ints
    n_each: int
    spare: bool


def read_vicon(data: bytes, name: str = "motion") -> Motion:
    """The motion in a CSV file of Vicon; ``name`` becomes its name; the up axis is unknown.

    Raises SourceError, with the number of the line, also if sections differ in their frames.
    """
    encoding = text_encoding(data)
    parts = _parts(data, encoding)
    parts_read = [_read(data, part) for part in parts]
    parts_read[-1].rows = append_rest(parts_read[-1].rows, data[parts[-1].stop :])
    first = _motion_of(parts_read)
    rated = parts_read[first or 0]
    numbers = rated.numbers[:: rated.n_each]
    for one in parts_read:
        _check_frames(data, one, numbers)
    signals, of_section = _signals(data, parts_read, first, len(numbers))
    joints = _joints(parts_read[first].part) if first is not None else ()
    sections = []
    for k, one in enumerate(parts_read):
        names = [joint.name for joint in joints] if k == first else []
        sections.append((_section(data, one, names, of_section[k]), one.rows, one.n_each))
    usual = np.array_equal(numbers, np.arange(1, len(numbers) + 1))
    rate = stated_rate(rated.part.rate)
    return Motion(
        Skeleton(
            joints,
            unit_cm=None if first is None else _unit_cm(parts_read[first].part),
            angle_unit="" if first is None else _angle_unit(parts_read[first].part),
        ),
        signals,
        rate and rate / rated.n_each,
        True,
        name,
        table_metadata(encoding, [text_note([t for one in parts_read for t in one.part.texts])]),
        table_source("vicon", data, sections),
        None if usual else numbers,
    )


def _parts(data: bytes, encoding: str) -> list[_Part]:
    """The sections: each line Frame,Sub Frame with the lines above it and the rows below."""
    parts: list[_Part] = []
    at = 0
    for match in AXIS.finditer(data):
        if match.start() < at:
            continue
        rows, end = match.end(), match.end()
        for _ in range(2):  # a line of units may come between
            if begins_with_number(data[rows : data.find(b"\n", rows) + 1 or len(data)]):
                break
            rows = data.find(b"\n", rows) + 1 or len(data)
        if not begins_with_number(data[rows : rows + 64]):
            raise SourceError("no row of numbers below Frame,Sub Frame", line=line_of(data, end))
        stop = _END.search(data, rows)
        if len(parts) == MAX_SECTIONS:
            raise SourceError(f"more than {MAX_SECTIONS} sections", line=line_of(data, end))
        lines = (match[1], match.start(), match.end(), rows)
        parts.append(_part(data, at, lines, stop.start() if stop else len(data), encoding))
        at = parts[-1].stop
    if not parts:
        raise SourceError("no line begins with Frame,Sub Frame; not a Vicon file", line=1)
    return parts


def _part(
    data: bytes, start: int, lines: tuple[bytes, int, int, int], stop: int, encoding: str
) -> _Part:
    """Read one part of the file: its title, rate, labels, axes and rows."""
    separator, axis, below, rows = lines
    above: list[tuple[int, int]] = []
    end = axis
    while len(above) < 3 and end > start:
        begin = data.rfind(b"\n", start, end - 1) + 1 or start
        above.append((begin, end))
        end = begin
    above += [(start, start)] * (3 - len(above))
    labels, rate, title = above
    names = texts_of(data[slice(*labels)], separator, encoding)
    axes = texts_of(data[axis:below], separator, encoding)
    units = texts_of(data[below:rows], separator, encoding) if rows > below else []
    width = count_columns((names, axes, units), data[rows:stop], separator)
    groups: list[tuple[str, list[tuple[str, str]]]] = []
    for k in range(2, width):
        name = names[k] if k < len(names) else ""
        axis_name = (axes[k] if k < len(axes) else "") or f"{k + 1}"
        if (
            not groups
            or (name and groups[-1][0] != name)
            or axis_name in (before for before, _ in groups[-1][1])  # another one of that name
        ):
            groups.append((name or f"column {k + 1}", []))
        groups[-1][1].append((axis_name, units[k] if k < len(units) else ""))
    texts = [texts_of(data[slice(*place)], separator, encoding) for place in (title, rate)]
    name, stated = ((text[0] if text else "") for text in texts)
    return _Part(start, rows, stop, separator, name or "section", stated, labels, groups)


def _read(data: bytes, part: _Part) -> _Read:
    """The rows of a section, with the frame of each and how many rows a frame has."""
    n = part.n_columns
    cells = [[FRAME_NUMBER], [n], *([k] for k in range(n))]
    table = read_table(data[: part.stop], part.rows, n + 1, cells, part.separator, numbers_at=n)
    if any(text.column == n for text in table.texts):
        raise SourceError(
            f"section {part.title[:40]!r}: a sub frame is no number", line=line_of(data, part.rows)
        )
    part = _drop_text_columns(part, [text.column for text in table.texts])
    n = table.rows.start.shape[1] - 1
    rows = move_zeros_to_gaps(data, table.rows, (range(part.n_columns),))
    numbers = rows.numbers if rows.numbers is not None else np.arange(1, rows.n_rows + 1)
    steps = np.flatnonzero(np.diff(numbers))
    n_each = int(steps[0]) + 1 if len(steps) else rows.n_rows
    counted = rows.n_rows % n_each == 0 and all(
        np.array_equal(numbers[k::n_each], numbers[::n_each]) for k in range(n_each)
    )
    if not counted:
        raise SourceError(
            f"section {part.title[:40]!r}: its {rows.n_rows} rows are not the same number in "
            "every frame",
            line=line_of(data, part.rows),
        )
    rows = number_frames(rows, n_each)
    numbers = rows.numbers if rows.numbers is not None else np.arange(rows.n_rows) // n_each + 1
    tokens = scan(data, rows.start[:, n], rows.stop[:, n])
    texts = [b"%d" % k for k in range(n_each)]
    in_order = tokens.texts().tolist() == texts * (rows.n_rows // n_each)
    return _Read(part, table, rows, numbers, n_each, not in_order)


def _drop_text_columns(part: _Part, texts: Sequence[int]) -> _Part:
    """``part`` without the columns that are text, and with their names."""
    groups: list[tuple[str, list[tuple[str, str]]]] = []
    labels = []
    at = 0
    for name, columns in part.groups:
        rest = []
        for axis, unit in columns:
            if at in texts:
                labels.append(f"{name}.{axis}")
            else:
                rest.append((axis, unit))
            at += 1
        groups += [(name, rest)] if rest else []
    labels += ["Sub Frame"] if at in texts else []
    return replace(part, groups=groups, texts=tuple(labels))


def _motion_of(parts: Sequence[_Read]) -> int | None:
    """The section of the motion: trajectories, objects, segments, else one of a row a frame."""
    able = [k for k, one in enumerate(parts) if one.n_each == 1]
    for title in MOTIONS:
        for k in able:
            if parts[k].part.title.lower() == title:
                return k
    return next(iter(able), None)


def _check_frames(data: bytes, one: _Read, numbers: Ints) -> None:
    own = one.numbers[:: one.n_each]
    if not np.array_equal(own, numbers):
        raise SourceError(
            f"section {one.part.title[:40]!r} has {len(own)} frames from {own[0]} on, but "
            f"another has {len(numbers)} from {numbers[0]} on",
            line=line_of(data, one.part.rows),
        )


def _signals(
    data: bytes, parts: Sequence[_Read], first: int | None, n_frames: int
) -> tuple[tuple[Signal, ...], list[list[int]]]:
    """The motion and the signals of all other sections; which signals are those of each section."""
    motion = Signal(np.zeros((n_frames, 0)), ())
    if first is not None:
        motion = read_columns(data, parts[first].rows, range(parts[first].part.n_columns))
    signals, numbers = [motion], []
    for k, one in enumerate(parts):
        part, mine = one.part, []
        n = part.n_columns
        more = []
        if k == first:
            mine = [0]
        elif n:
            channels = tuple(
                Channel("", f"{name}.{axis}", unit)
                for name, columns in part.groups
                for axis, unit in columns
            )
            more.append(_signal(data, one, range(n), part.title, channels))
        text = read_text(data, one.rows, one.table.texts, part.texts, (n, one.n_each))
        more += [t if k == first else replace(t, name=f"{part.title} {TEXT}") for t in text]
        if one.spare or not (mine or more):
            channel = Channel("", "Sub Frame")
            last = one.rows.start.shape[1] - 1
            more.append(_signal(data, one, [last], f"{part.title} sub frames", (channel,)))
        mine += range(len(signals), len(signals) + len(more))
        signals += more
        numbers.append(mine)
    return tuple(signals), numbers


def _signal(
    data: bytes, one: _Read, columns: Sequence[int], name: str, channels: tuple[Channel, ...]
) -> Signal:
    signal = read_columns(data, one.rows, columns, one.n_each)
    return replace(signal, name=name, channels=channels)


def _joints(part: _Part) -> tuple[Joint, ...]:
    return tuple(
        Joint(
            _OBJECT.sub("", name, 1) if part.title.lower() == "objects" else name,
            channels=tuple(
                Channel(kinds[axis.lower()]) if axis.lower() in kinds else Channel("", axis, unit)
                for axis, unit in columns
            ),
        )
        for name, columns in part.groups
        for kinds in (_kinds(part, name, columns),)
    )


def _unit_cm(part: _Part) -> float | None:
    """The unit of the positions in cm, None if there are none, or of several units."""
    units = _units(part, "t")
    return UNIT_CM.get(units.pop()) if len(units) == 1 else None


def _angle_unit(part: _Part) -> str:
    """The unit of the rotation vectors, "" if there are none, or of several units."""
    units = _units(part, "v")
    return (units & {"rad", "deg"}).pop() if len(units) == 1 and units & {"rad", "deg"} else ""


def _units(part: _Part, kind: str) -> set[str]:
    """The units of all channels whose kind begins with ``kind``."""
    return {
        unit.lower()
        for name, columns in part.groups
        for axis, unit in columns
        if _kinds(part, name, columns).get(axis.lower(), "").startswith(kind)
    }


def _kinds(part: _Part, name: str, columns: Sequence[tuple[str, str]]) -> dict[str, str]:
    """The kind of the channel of each axis; of others, no file says what they are.

    The angles of segments, for one: about which axes, in which order.
    """
    title = part.title.lower()
    if title == "trajectories":
        return {"x": "tx", "y": "ty", "z": "tz"}
    if title not in MOTIONS:
        return {}
    if {axis.lower() for axis, _ in columns} >= set(QUATERNION):
        return POSITIONS | QUATERNION
    turned = _OBJECT.match(name) if title == "objects" else None
    is_helical = turned is not None and (turned[1] or "helical").lower() == "helical"
    return POSITIONS | HELICAL if is_helical else POSITIONS


def _section(data: bytes, one: _Read, names: Sequence[str], signals: Sequence[int]) -> Section:
    part = one.part
    start, stop = part.labels
    whole = data[part.start : part.rows]
    marked = data[part.start : start] + names_in(data[start:stop], names) + data[stop : part.rows]
    return section_of((marked, whole), (one.table.missing, None), one.rows, names, signals)
