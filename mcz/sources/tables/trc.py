"""TRC (marker trajectories): bytes -> Motion, and back.

SPEC.md, "The text of tables", is normative for the way back. Every marker is a joint without a
parent. The numbers of frames are those of the file; times follow from them, or are a signal.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mcz.errors import SourceError
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Skeleton
from mcz.sources.tables.layout import NEXT, SAME, UNIT_CM
from mcz.sources.tables.restore import plain_trc, restore_table
from mcz.sources.tables.rows import begins_with_number, lines_from, read_table, without_zeros
from mcz.sources.tables.signals import read_columns, table_metadata
from mcz.sources.tables.source import named_count, names_in, section_of, table_source
from mcz.sources.tables.times import Times, read_times, stated_rate
from mcz.sources.text.layout import FRAME_NUMBER
from mcz.sources.text.rows import Rows, counted_up
from mcz.sources.text.source import check_text, text_encoding

POSITION = tuple(Channel(kind) for kind in POSITION_KINDS)

_LABELS = re.compile(rb"(?i)[ \t]*frame#?[ \t]")
_AXES = re.compile(rb"([Xx])([0-9]+)|([YyZz])([0-9]+)")
_KEYS = re.compile(rb"(?i)[ \t]*datarate\b")


@dataclass(frozen=True, slots=True)
class _Header:
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
    header = _header(data)
    labels = _labels(data[slice(*header.labels)], encoding)
    n_markers = max(len(labels), _widest(data, header.rows))
    names = (*labels, *(f"marker {k + 1}" for k in range(len(labels), n_markers)))
    time = 3 * n_markers
    columns = [[FRAME_NUMBER], [time], *([c] for c in range(time))]
    separator = b"\t" if b"\t" in data[header.rows :].partition(b"\n")[0] else None
    table = read_table(data, header.rows, time + 1, columns, separator)
    rows = without_zeros(data, counted_up(table.rows), ([time], range(time)))
    markers = read_columns(data, rows, range(time))
    joints = tuple(Joint(marker, channels=POSITION) for marker in names)
    unit_cm = UNIT_CM.get(header.values.get("units", "").lower())
    skeleton = Skeleton(joints, unit_cm=unit_cm, angle_unit="")
    times, note = _times(data, rows, time, header.values)
    text = _mark_header(data, header, rows.n_rows, names[: len(labels)])
    signals = range(1 + len(times.signals))
    section = section_of(text, (table.missing, times.clock), rows, names, signals)
    motion = Motion(
        skeleton,
        (markers, *times.signals),
        times.rate,
        times.exact,
        name,
        table_metadata(encoding, [*note, *_notes(header.values, len(labels), rows.n_rows)]),
        table_source("trc", data, [(section, rows, 1)]),
        rows.numbers,
    )
    return motion if times.printed is None else motion.at_times(times.printed)


def _header(data: bytes) -> _Header:
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
            return _Header(values, count, (start, start + len(lines[labels][1])), at)
    raise SourceError("no row of numbers follows the marker names", line=labels + 2)


def _labels(line: bytes, encoding: str) -> list[str]:
    """The names of the markers: what stands behind Frame# and Time."""
    separator = b"\t" if b"\t" in line else None
    cells = [cell.strip() for cell in line.split(separator)]
    return [cell.decode(encoding) for cell in cells[2:] if cell]


def _widest(data: bytes, at: int) -> int:
    """Number of markers of the longest row."""
    cells = max((line.rstrip().count(b"\t") for line in data[at:].split(b"\n")), default=1)
    return max(0, -(-(cells - 1) // 3))


def _times(data: bytes, rows: Rows, column: int, values: dict[str, str]) -> tuple[Times, list[str]]:
    """The times, and what is odd about them."""
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
    data: bytes, header: _Header, n_rows: int, names: Sequence[str]
) -> tuple[bytes, bytes]:
    """The header with marks for names, their numbers and the number of rows; and as it is."""
    start, stop = header.labels
    parts = (
        named_count(data, 0, start, header.count, n_rows),
        names_in(data[start:stop], names),
        _AXES.sub(lambda m: m[1] + NEXT if m[1] else m[3] + SAME, data[stop : header.rows]),
    )
    return b"".join(parts), data[: header.rows]


def _notes(values: dict[str, str], n_labels: int, n_rows: int) -> list[str]:
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
