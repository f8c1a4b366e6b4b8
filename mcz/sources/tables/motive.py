"""CSV files of Motive (OptiTrack), format version 1.2x: bytes -> Motion.

SPEC.md, "The text of tables", is normative for the way back. Every rigid body, bone and marker is a
joint, with its rotation, position and quality.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mcz.errors import SourceError
from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.sources.tables.csv_text import count_columns, is_blank, texts_of, whole_cells
from mcz.sources.tables.rows import begins_with_number, lines_from, move_zeros_to_gaps, read_table
from mcz.sources.tables.signals import read_columns, read_text, table_metadata, text_note
from mcz.sources.tables.times import TableTimes, read_times, stated_rate
from mcz.sources.text.layout import FRAME_NUMBER
from mcz.sources.text.rows import line_of, number_frames
from mcz.sources.text.source import (
    BOM,
    named_count,
    names_in,
    section_of,
    table_source,
    text_encoding,
)

UNITS = {
    "meters": 100.0,
    "centimeters": 1.0,
    "millimeters": 0.1,
    "inches": 2.54,
    "feet": 30.48,
}
LOCAL = ("local", "parent")  # coordinate spaces relative to the parent of a bone
QUATERNION = {"qx", "qy", "qz", "qw"}
MAX_HEAD = 32  # lines above the rows

HEAD = re.compile(rb'(?:sep=[,;\t]\r?\n)?[ \t]*"?Format Version"?([,;\t])')
_AXIS = re.compile(rb'[ \t]*"?Frame"?[ \t]*[,;\t][ \t]*"?Time')
_TIME = re.compile(r"(?i)time(?![a-z])")
_ORDER = re.compile(r"(?i)(?=.*x)(?=.*y)(?=.*z)[xyz]{3}")
_COUNT = re.compile(rb'(?i)[,;\t]"?Total Exported Frames"?[,;\t]"?([0-9]+)')


@dataclass(frozen=True, slots=True)
class _Head:
    """The text above the rows. ``columns``: of each what is said of it, one row a line.

    ``time``: the column of the times, which ``columns`` are without.
    """

    said: dict[str, str]
    columns: list[tuple[str, ...]]  # type, name, id, parent, kind, axis
    labels: tuple[int, int]
    rows: int
    separator: bytes
    time: int

    def label(self, column: int | None) -> str:
        """The name of a column of text; None: that of the times."""
        if column is None:
            return "Time"
        _, name, _, _, quantity, axis = self.columns[column]
        return " ".join(filter(None, (name, quantity, axis))) or f"column {column + 3}"


@dataclass(slots=True)
class _Object:
    name: str
    id: str
    parent: str
    columns: list[int]
    channels: list[Channel]


def read_motive(data: bytes, name: str = "motion") -> Motion:
    """The motion in a CSV file of Motive; ``name`` becomes its name; the up axis is unknown.

    Raises SourceError, with the number of the line.
    """
    encoding = text_encoding(data)
    head = _head(data, encoding)
    objects = _objects(head)
    order = [column for motion in objects for column in motion.columns]
    place = {column: k for k, column in enumerate(order)}
    n = len(order)
    cells = [[FRAME_NUMBER], *([place[column]] for column in range(n))]
    cells.insert(head.time, [n])
    table = read_table(data, head.rows, n + 1, cells, head.separator, numbers_at=n)
    texts = [order[text.column] if text.column < n else None for text in table.texts]
    objects = _drop_columns(objects, texts)
    n_values = sum(len(motion.columns) for motion in objects)
    time = n_values + sum(text.n_numbers for text in table.texts)
    rows = move_zeros_to_gaps(
        data, number_frames(table.rows), (range(time, table.rows.start.shape[1]), range(n_values))
    )
    stated = [
        rate
        for key in ("export frame rate", "capture frame rate")
        if (rate := stated_rate(head.said.get(key, "")))
    ]
    times = TableTimes(None, (), None, True)
    if None in texts:
        stated = []
    else:
        times = read_times(data, rows, time, stated)
    labels = [head.label(column) for column in texts]
    text_signal = read_text(data, rows, table.texts, labels, (n_values, 1))
    more = (*text_signal, *times.signals)
    names = [motion.name for motion in objects]
    text = _mark_header(data, head, names, rows.n_rows), data[: head.rows]
    signals = range(1 + len(more))
    section = section_of(text, (table.missing, times.clock), rows, names, signals)
    motion = Motion(
        _skeleton(head, objects),
        (read_columns(data, rows, range(n_values)), *more),
        times.rate,
        times.exact,
        name,
        table_metadata(
            encoding,
            [text_note(labels), *_notes(head.said, rows.n_rows, times, bool(stated)), times.note],
        ),
        table_source("motive", data, [(section, rows, 1)]),
        rows.numbers,
    )
    return motion if times.printed is None else motion.at_times(times.printed)


def _mark_header(data: bytes, head: _Head, names: Sequence[str], n_rows: int) -> bytes:
    """Lines above the rows, with marks for the first of each name and the number of rows."""
    start, stop = head.labels
    match = _COUNT.search(data, 0, start)
    count = match.span(1) if match else (0, 0)
    labels = names_in(data[start:stop], names)
    return named_count(data, 0, start, count, n_rows) + labels + data[stop : head.rows]


def _head(data: bytes, encoding: str) -> _Head:
    lines = whole_cells(lines_from(data, 0)[:MAX_HEAD])
    lines = [entry for entry in lines if not is_blank(entry[1])]
    match = HEAD.match(data.removeprefix(BOM))
    separator = match[1] if match else b","
    if lines and lines[0][1].removeprefix(BOM).startswith(b"sep="):
        lines.pop(0)  # of a spreadsheet
    axis = next((k for k, (_, line) in enumerate(lines) if _AXIS.match(line)), None)
    if axis is None or axis < 3:
        raise SourceError("no line Frame,Time below names; not a Motive file", line=len(lines))
    if axis + 1 == len(lines) or not begins_with_number(lines[axis + 1][1]):
        at = lines[axis][0]
        raise SourceError("no row of numbers after Frame,Time", line=line_of(data, at) + 1)
    first = texts_of(lines[0][1], separator, encoding)
    settings = {key.lower(): value for key, value in zip(first[::2], first[1::2], strict=False)}
    rows = [texts_of(line, separator, encoding) for _, line in lines[1 : axis + 1]]
    width = max(2, count_columns(rows, data[lines[axis + 1][0] :], separator))
    numbers = _numbers(rows)
    time = next((k for k, cell in enumerate(rows[-1]) if _TIME.match(cell)), 1)
    columns = [
        tuple(rows[n][k] if n is not None and k < len(rows[n]) else "" for n in numbers)
        for k in range(1, width)
        if k != time
    ]
    at, line = lines[1 + (numbers[1] or 0)]
    return _Head(settings, columns, (at, at + len(line)), lines[axis + 1][0], separator, time)


def _numbers(rows: Sequence[Sequence[str]]) -> tuple[int | None, ...]:
    """Row numbers of type, name, id, parent, kind and axis; None if missing."""
    last = len(rows) - 1
    called = {row[1].lower(): k for k, row in enumerate(rows[:-1]) if len(row) > 1 and row[1]}
    if "name" in called:
        return *(called.get(key) for key in ("type", "name", "id", "parent")), last - 1, last
    plain: tuple[int | None, ...] = (0, 1, 2 if last > 3 else None, 3 if last > 4 else None)
    return *plain, last - 1, last


def _objects(head: _Head) -> list[_Object]:
    """The joints, each of neighboring columns of one type, name and id."""
    order = head.said.get("rotation type", "").upper()
    objects: list[_Object] = []
    before: tuple[str, ...] | None = None
    for column, (kind, name, id_, parent, quantity, axis) in enumerate(head.columns):
        channel = _channel(quantity, axis, euler=_ORDER.fullmatch(order) is not None)
        mine = kind, name, id_
        if mine != before or channel in objects[-1].channels:
            objects.append(_Object(name or f"column {column + 3}", id_, parent, [], []))
        before = mine
        objects[-1].columns.append(column)
        objects[-1].channels.append(channel)
    for one in objects:
        if _ORDER.fullmatch(order):
            _sort_rotations(one, order.lower())
        elif not {channel.kind for channel in one.channels} >= QUATERNION:
            one.channels = [_without_kind(channel) for channel in one.channels]
    return objects


def _without_kind(channel: Channel) -> Channel:
    """A part of a rotation whose other parts are missing, or angles in no order, says nothing."""
    if channel.kind not in QUATERNION:
        return channel
    return Channel("", f"Rotation {channel.kind[1].upper()}")


def _drop_columns(objects: Sequence[_Object], columns: Sequence[int | None]) -> list[_Object]:
    """The objects without these columns, and without those that have no other."""
    rest = []
    for one in objects:
        positions = [k for k, column in enumerate(one.columns) if column not in columns]
        one.columns = [one.columns[k] for k in positions]
        one.channels = [one.channels[k] for k in positions]
        rest += [one] if positions else []
    return rest


def _channel(quantity: str, axis: str, *, euler: bool) -> Channel:
    kind, letter = quantity.lower(), axis.lower()
    if kind == "position" and letter in ("x", "y", "z"):
        return Channel(f"t{letter}")
    if kind == "rotation" and letter in ("x", "y", "z", "w") and not (euler and letter == "w"):
        return Channel(f"{'r' if euler else 'q'}{letter}")
    return Channel("", " ".join(filter(None, (quantity, axis))) or "value")


def _sort_rotations(one: _Object, order: str) -> None:
    """Sort Euler angles by the order of their rotations."""
    places = [k for k, channel in enumerate(one.channels) if channel.kind[:1] == "r"]
    turned = sorted(places, key=lambda k: order.index(one.channels[k].kind[1]))
    columns, channels = one.columns.copy(), one.channels.copy()
    for place, source in zip(places, turned, strict=True):
        one.columns[place], one.channels[place] = columns[source], channels[source]


def _skeleton(head: _Head, objects: Sequence[_Object]) -> Skeleton:
    """Joints without a parent if all is seen from one origin."""
    is_local = head.said.get("coordinate space", "").lower() in LOCAL
    by_id: dict[str, int] = {}
    joints = []
    for number, one in enumerate(objects):
        parent = by_id.get(one.parent, -1) if is_local and one.parent else -1
        joints.append(Joint(one.name, parent, channels=tuple(one.channels)))
        by_id.setdefault(one.id, number)
    return Skeleton(tuple(joints), unit_cm=UNITS.get(head.said.get("length units", "").lower()))


def _notes(settings: dict[str, str], n_rows: int, times: TableTimes, is_stated: bool) -> list[str]:
    notes = []
    declared = settings.get("total exported frames", "")
    if declared and declared != str(n_rows):
        notes.append(f"{declared[:40]} frames are declared, {n_rows} are there")
    if is_stated and times.rate is None:
        notes.append("the times are not uniform")
    return [*notes, times.note]
