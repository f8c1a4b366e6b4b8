"""Plain CSV files: columns of numbers, with or without rows of names and units.

SPEC.md, "The text of tables", is normative for the way back. Every column is a joint without a
parent that has one plain scalar.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from mcz.errors import SourceError
from mcz.formats.csv_text import first_row, has_decimal_commas, texts_of
from mcz.formats.layout import FRAME_NUMBER
from mcz.formats.table_rows import TableRows, lines_from, read_table, without_zeros
from mcz.formats.table_signals import read_columns
from mcz.formats.table_source import names_in, section_of, table_source
from mcz.formats.table_times import Times, read_times
from mcz.formats.text_source import check_text, text_encoding, text_start
from mcz.motion import Channel, Joint, Motion, Skeleton

MAX_COLUMNS = 2**18  # of a table; no skeleton is stored with more joints

_TIME = re.compile(
    r"(?i)(?:time|t|timestamps?|times|seconds?|secs?|zeit)"
    r"[ _]?[\[(]?(s|sec|secs|seconds?|ms|msec|milliseconds?|us|µs|ns)?[\])]?"
)
_FRAME = re.compile(r"(?i)|#|frames?[ _]?(?:#|no\.?|numbers?|index|id)?|index|unnamed: 0")
_UNIT = re.compile(
    r"[\[(]?(?:|[munkµ]?(?:m|s|V|N|Pa|A|W|g|Hz)|cm|in|ft|kg|deg|degrees?|°|rad|radians?|%|-|1"
    r"|BW|sec|Nmm|N\.?m+|N\.mm|(?:deg|rad|m{1,2}|cm)/s(?:\^?2|²)?|g)[\])]?"
)
_SECONDS = {"m": Fraction(1, 1000), "u": Fraction(1, 10**6), "n": Fraction(1, 10**9)}


@dataclass(frozen=True, slots=True)
class _Head:
    """Where rows begin and what the lines above say; ``labels`` is where the line of names lies."""

    rows: int
    separator: bytes | None
    names: list[str]
    units: list[str]
    labels: tuple[int, int]


def read_columns_of(data: bytes, name: str = "motion") -> Motion:
    """The motion in a plain CSV file; ``name`` becomes its name.

    A frame rate is stated where there is a column of uniform times. Raises SourceError, with the
    number of the line.
    """
    check_text(data)
    encoding = text_encoding(data)
    head = _head(data, encoding)
    called = (k for k, n in enumerate(head.names[:8]) if _TIME.fullmatch(n.strip()))
    time = next(called, None) if len(head.names) > 1 else None
    table, cells = _rows(data, head, time)
    n_values = sum(cell >= 0 for cell in cells) - (time is not None)
    values = range(n_values)
    groups: list[Sequence[int]] = [values] if time is None else [values, [n_values]]
    rows = without_zeros(data, table.rows, groups)
    times = Times(None, (), None, True)
    if time is not None:
        label = head.names[time].strip()
        times = read_times(data, rows, n_values, unit=_seconds(label, head.units[time]), name=label)
    signal = read_columns(data, rows, values)
    chosen = [k for k, cell in enumerate(cells) if 0 <= cell < n_values]
    joints = tuple(
        Joint(head.names[k], channels=(Channel("", "value", head.units[k]),)) for k in chosen
    )
    names = [joint.name for joint in joints]
    start, stop = head.labels
    marked = data[:start] + names_in(data[start:stop], names) + data[stop : head.rows]
    signals, said = range(1 + len(times.signals)), (table.missing, times.clock)
    section = section_of((marked, data[: head.rows]), said, rows, names, signals)
    return Motion(
        Skeleton(joints, angle_unit=""),
        (signal, *times.signals),
        times.rate,
        times.exact,
        name,
        {"name-encoding": encoding} if encoding != "utf-8" else {},
        table_source("csv", data, [(section, rows, 1)]),
        rows.numbers,
    )


def _rows(data: bytes, head: _Head, time: int | None) -> tuple[TableRows, list[int]]:
    """The rows, and the column of each cell; that of the times is the last one."""
    numbered = _FRAME.fullmatch(head.names[0].strip()) is not None and len(head.names) > 1
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
            return read_table(data, head.rows, at, columns, head.separator, free=True), cells
        except SourceError:
            if first != FRAME_NUMBER:
                raise
    raise SourceError("line 1: no column of numbers beside the times")


def _head(data: bytes, encoding: str) -> _Head:
    lines = lines_from(data, 0)
    found = first_row(lines)
    if found is None:
        if has_decimal_commas(lines):
            raise SourceError(
                "line 1: the first numbers have decimal commas, which no grid prints; "
                "save the table with points"
            )
        hint = "no row of numbers in the first lines; no table" if lines else "an empty file"
        raise SourceError(f"line 1: {hint}")
    number, separator, n_cells = found
    above = [(at, line) for at, line in lines[:number] if line.strip()]
    texts = [texts_of(line, separator, encoding) for _, line in above]
    while texts and len(texts[-1]) == n_cells + 1 and not texts[-1][-1]:
        texts[-1].pop()
    units, labels = [""] * n_cells, (0, 0)
    if len(texts) > 1 and len(texts[-2]) == len(texts[-1]) >= n_cells and _are_units(texts[-1]):
        units = [unit.strip("[]()") for unit in texts.pop()]
        above.pop()
    names: list[str] = []
    if texts and len(texts[-1]) >= n_cells:
        at, line = above[-1]
        names, labels = texts[-1], (at, at + len(line))
        names[0] = names[0].removeprefix("# ") or names[0]
    n_cells = max(n_cells, len(names))
    if n_cells > MAX_COLUMNS:
        raise SourceError(f"line {number + 1}: {n_cells} columns, limit {MAX_COLUMNS}")
    names = names or [f"column {k + 1}" for k in range(n_cells)]
    names = [_printable(label) for label in names]
    units += [""] * (n_cells - len(units))
    rows = lines[number][0] or text_start(data)
    return _Head(rows, separator, names, [_printable(u) for u in units], labels)


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line has units, at least one."""
    return any(cells) and all(_UNIT.fullmatch(cell) for cell in cells)


def _printable(text: str) -> str:
    return "".join(character if ord(character) >= 32 else " " for character in text)


def _seconds(label: str, unit: str) -> Fraction:
    """What a unit of the times is in seconds."""
    match = _TIME.fullmatch(label)
    stated = (match[1] if match else None) or unit or "s"
    return _SECONDS.get(stated[0].lower().replace("µ", "u"), Fraction(1))
