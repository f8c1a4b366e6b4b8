"""MVNX (the XML of Xsens MVN): bytes -> Motion, and back.

SPEC.md, "The text of tables", is normative for the way back: a frame is a row, its tags are gaps.
Segments have positions and orientations along the axes of the world, so each is a joint without a
parent; its bones are tails. Every other element of numbers is a signal. Frames of calibration
before the motion belong to the header.

Expat reads the header and refuses a declaration of types where it begins: no entity is declared,
so none is expanded, and nothing else is loaded.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from xml.parsers import expat

import numpy as np

from mcz.errors import MotionError, SourceError
from mcz.model.clock import TIMES
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.skeleton import ORIGIN, Vector
from mcz.sources.tables.mvnx_frames import (
    END,
    TIME,
    FrameColumns,
    channels_of,
    first_frame,
    read_frames,
    unit_of,
)
from mcz.sources.tables.restore import restore_table
from mcz.sources.tables.rows import append_rest
from mcz.sources.tables.signals import (
    read_columns,
    read_signal,
    read_text,
    select_columns,
    table_metadata,
)
from mcz.sources.tables.text_columns import TextColumn, odd_cells, split_text
from mcz.sources.tables.times import TableTimes, read_times, stated_rate
from mcz.sources.text.rows import TokenRows, line_of, number_frames
from mcz.sources.text.source import (
    MOST_JOINTS,
    check_count,
    check_text,
    names_in,
    section_of,
    table_source,
    text_encoding,
)

MOST_BYTES = 2**24  # of a header, without the frames of calibration
MOST_DEPTH = 32  # of nested elements
DECIMALS = 9  # of sums of points
ROOT = "mvnx"
LISTS = (  # elements whose children have labels
    "segments",
    "sensors",
    "joints",
    "ergonomicJointAngles",
    "footContactDefinition",
    "fingerTrackingSegmentsLeft",
    "fingerTrackingSegmentsRight",
    "fingerTrackingJointsLeft",
    "fingerTrackingJointsRight",
)
TEXTS = ("pos_b", "pos_s", "connector1", "connector2", "comment")
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")

Place = tuple[str, str]  # a segment and a point of it

_ROOT = re.compile(rb"<mvnx[\s>]")
_DATE = re.compile(  # Tue Nov 13 05:17:11.827 2018
    rf"(?:\S+ )?({'|'.join(MONTHS)}) +(\d{{1,2}}) (\d\d:\d\d:\d\d(?:\.\d{{1,6}})?) (\d{{4}})", re.I
)
_DECIMAL = re.compile(r"[-+]?[0-9]{1,9}\.?[0-9]{0,15}")


@dataclass(slots=True)
class MvnxHeader:
    """The names in a header; ``frames`` is the offset of that element.

    ``labels``: those of each of ``LISTS``, in order. ``points``: those of each segment by name, in
    meters along its axes. ``connectors``: for each joint the two points that it connects.
    """

    frames: int = 0
    system: Mapping[str, str] = field(default_factory=dict)
    subject: Mapping[str, str] = field(default_factory=dict)
    comment: str = ""
    labels: dict[str, list[str]] = field(default_factory=dict)
    points: dict[Place, Vector] = field(default_factory=dict)
    connectors: list[tuple[Place, Place]] = field(default_factory=list)

    def tails(self) -> dict[str, list[Vector]]:
        """The points of each segment where other segments are attached."""
        tails: dict[str, list[Vector]] = {}
        for place in dict.fromkeys(near for near, _ in self.connectors):
            if place in self.points:
                tails.setdefault(place[0], []).append(self.points[place])
        return tails

    def origins(self) -> dict[str, Vector]:
        """The origins of segments whose axes are those of the world, the first one at zero."""
        origins = {labels[0]: ORIGIN} if (labels := self.labels.get("segments")) else {}
        for near, far in self.connectors:
            if near[0] in origins and near in self.points and far in self.points:
                parts = zip(origins[near[0]], self.points[near], self.points[far], strict=True)
                x, y, z = (round(origin + a - b, DECIMALS) + 0.0 for origin, a, b in parts)
                origins.setdefault(far[0], (x, y, z))
        return origins

    def metadata(self) -> dict[str, str]:
        """Facts about the recording, by keys of the registry."""
        version = self.system.get("version", "")
        facts = {
            "subject": self.subject.get("label", ""),
            "system": f"Xsens MVN {version}" if version else "",
            "description": self.comment,
            **_date(self.subject.get("recDate", "")),
        }
        return {key: value.strip() for key, value in facts.items() if value.strip()}


def is_mvnx(head: bytes) -> bool:
    """Return True if a file that begins with ``head`` seems to be MVNX."""
    return b"<mvnx" in head and _ROOT.search(head) is not None


def read_header(data: bytes) -> MvnxHeader:
    """Read the header of an MVNX file; raises SourceError, with its line, if there is none.

    It is read as UTF-8, or else as Latin-1, regardless of its declaration.
    """
    start = data[:MOST_BYTES]
    try:
        return _HeaderParser(start).read("utf-8")
    except expat.ExpatError as error:
        if error.code != _INVALID:
            raise _xml_error(error) from None
    try:
        return _HeaderParser(start).read("iso-8859-1")
    except expat.ExpatError as error:
        raise _xml_error(error) from None


_INVALID = expat.errors.codes[expat.errors.XML_ERROR_INVALID_TOKEN]


def _xml_error(error: expat.ExpatError) -> SourceError:
    return SourceError(f"not XML: {expat.ErrorString(error.code)}", line=error.lineno)


class _FramesReached(Exception):
    """The element ``frames`` begins."""


class _HeaderParser:
    """The events of expat -> a Header."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._header = MvnxHeader()
        self._path: list[str] = []
        self._names: list[str] = []  # labels of the elements of ``_path``
        self._text: list[str] = []
        self._near: Place = ("", "")

    def read(self, encoding: str) -> MvnxHeader:
        parser = expat.ParserCreate(encoding)
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        parser.StartDoctypeDeclHandler = self._refuse_types
        self._parser = parser
        try:
            parser.Parse(self._data, False)
        except _FramesReached:
            return self._header
        more = f" in {len(self._data)} bytes" if len(self._data) == MOST_BYTES else ""
        line = line_of(self._data, len(self._data))
        raise SourceError(f"no element 'frames'{more}; not an MVNX file, or truncated", line=line)

    def _refuse_types(self, *_: object) -> None:
        line = self._parser.CurrentLineNumber
        raise SourceError("it declares types (DOCTYPE), which is not supported", line=line)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        header, path = self._header, self._path
        if not path and name != ROOT:
            raise SourceError(f"element {name[:40]!r}, expected {ROOT!r}; not an MVNX file", line=1)
        if len(path) == MOST_DEPTH:
            line = self._parser.CurrentLineNumber
            raise SourceError(f"elements are nested more than {MOST_DEPTH} deep", line=line)
        label = attributes.get("label", "")
        if name == "frames":
            header.frames = self._parser.CurrentByteIndex
            raise _FramesReached
        if path and path[-1] in LISTS:
            labels = header.labels.setdefault(path[-1], [])
            labels.append(_printable(label))
            check_count(path[-1], len(labels), MOST_JOINTS)
        elif name == "subject":
            header.subject = attributes
        elif name == "mvn":
            header.system = attributes
        path.append(name)
        self._names.append(_printable(label))
        self._text.clear()

    def _characters(self, text: str) -> None:
        if self._path and self._path[-1] in TEXTS:
            self._text.append(text)

    def _end(self, name: str) -> None:
        text = "".join(self._text)
        self._text.clear()
        self._path.pop()
        self._names.pop()
        if name in ("pos_b", "pos_s") and len(self._names) >= 3:
            words = text.split()
            if len(words) == 3 and all(map(_DECIMAL.fullmatch, words)):
                x, y, z = map(float, words)
                self._header.points[self._names[-3], self._names[-1]] = x, y, z
        elif name in ("connector1", "connector2"):
            segment, _, point = _printable(text).strip().partition("/")
            self._near, near = (segment, point), self._near
            if name == "connector2" and self._path[-2:-1] == ["joints"]:
                self._header.connectors.append((near, (segment, point)))
        elif name == "comment":
            self._header.comment = self._header.comment or text


def _printable(text: str) -> str:
    return "".join(character if ord(character) >= 32 else " " for character in text)


def _date(text: str) -> dict[str, str]:
    """The date and time of a recording; empty unless the text is one in English words."""
    match = _DATE.fullmatch(text.strip())
    if match is None:
        return {}
    month = MONTHS.index(match[1].title()) + 1
    date = f"{match[4]}-{month:02d}-{int(match[2]):02d}"
    return {"date": date, "time": f"{date}T{match[3]}"}


def numbered_names(labels: Sequence[str], count: int, noun: str) -> list[str]:
    """The first ``count`` labels, then numbered ones."""
    return [*labels[:count], *(f"{noun} {k + 1}" for k in range(len(labels), count))]


FORMAT = "mvnx"
METERS_CM = 100.0
MILLISECOND = Fraction(1, 1000)  # the unit of times
_ENDED = re.compile(rb"\s*</frames\s*>")


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in an MVNX file; ``name`` becomes its name.

    Raises SourceError, with the number of the line, for what is no XML, has a DOCTYPE, or has
    frames that are more than elements of text.
    """
    check_text(data)
    header = read_header(data)
    at, stop = first_frame(data, header.frames), data.rfind(END) + len(END)
    if stop < at:
        raise SourceError("the file is truncated in its first frame", line=line_of(data, at))
    body, rest = data[:stop], data[stop:]
    rows, columns = read_frames(body, at)
    rows = number_frames(append_rest(rows, rest))
    rows, texts = _split_text(data, rows, columns)
    joints, odd = _joints(header, columns)
    more = [*_elements(data, rows, header, columns), *_attributes(data, rows, columns, texts)]
    first = columns.n_motion + sum(signal.n_channels for signal in more)
    labels = [name[1:] for name in columns.attributes if columns.column(name) in texts]
    more += read_text(data, rows, list(texts.values()), labels, (first, 1))
    times = _times(data, rows, header, columns)
    if not _ENDED.match(rest):
        is_cut = b"<frame" in rest
        odd.append("cut off in a frame, which is kept as text" if is_cut else "no end of 'frames'")
    encoding, notes = text_encoding(data), [*odd, times.note]
    names = [joint.name for joint in joints]
    section = section_of(
        (names_in(data[:at], names), data[:at]),
        (b"", times.clock),
        rows,
        names,
        range(1 + len(more) + len(times.signals)),
    )
    motion = Motion(
        Skeleton(joints, "", METERS_CM, "", up_axis="z", forward_axis="x", handedness="right"),
        (_signal(data, rows, range(columns.n_motion)), *more, *times.signals),
        times.rate,
        times.exact,
        name,
        header.metadata() | table_metadata(encoding, notes),
        table_source(FORMAT, data, [(section, rows, 1)]),
        rows.numbers,
    )
    return motion if times.printed is None else motion.at_times(times.printed)


def write(motion: Motion) -> bytes:
    """The MVNX file that ``motion`` was read from, with its values; MotionError for any other."""
    if motion.source is None or motion.source.format != FORMAT:
        raise MotionError(
            f"motion {motion.name!r} was not read from an MVNX file, and cannot be written as one"
        )
    return restore_table(motion)


def _signal(data: bytes, rows: TokenRows, columns: Sequence[int]) -> Signal:
    return read_signal(data, select_columns(rows, columns))


def _joints(header: MvnxHeader, columns: FrameColumns) -> tuple[tuple[Joint, ...], list[str]]:
    """The joint of each segment, and oddities of their names."""
    labels, n_segments = header.labels.get("segments", []), columns.n_segments
    odd = []
    if len(labels) != n_segments:
        odd = [f"{len(labels)} segments are named, {n_segments} are in the frames"]
    channels = tuple(Channel(kind) for kind in columns.kinds)
    origins, tails = header.origins(), header.tails()
    joints = tuple(
        Joint(
            name,
            offset=origins.get(name, ORIGIN),
            tails=tuple(tails.get(name, ())),
            channels=channels,
            adds_to_offset=False,
        )
        for name in numbered_names(labels, n_segments, "segment")
    )
    return joints, odd


def _elements(
    data: bytes, rows: TokenRows, header: MvnxHeader, columns: FrameColumns
) -> Iterator[Signal]:
    """Signals of the elements that do not belong to the motion."""
    for name in columns.elements:
        signal = _signal(data, rows, columns.columns[name])
        channels = channels_of(name, signal.n_channels, header.labels)
        yield replace(signal, name=name, channels=channels)


def _attributes(
    data: bytes, rows: TokenRows, columns: FrameColumns, texts: Mapping[int, TextColumn]
) -> Iterator[Signal]:
    """A signal for each attribute of numbers."""
    at = columns.first_attribute
    for name in columns.attributes:
        if columns.column(name) not in texts:
            label = name[1:]
            signal = read_columns(data, rows, [at])
            yield replace(signal, name=label, channels=(Channel("", label, unit_of(label)),))
            at += 1


def _split_text(
    data: bytes, rows: TokenRows, columns: FrameColumns
) -> tuple[TokenRows, dict[int, TextColumn]]:
    """``rows`` with numbers in place of attributes that are text, and these by their column."""
    places = [columns.column(name) for name in columns.attributes]
    text_cells = odd_cells(data, select_columns(rows, places)).text_columns() if places else []
    chosen = [places[k] for k in text_cells]
    if not chosen:
        return rows, {}
    time = columns.n_columns - (TIME in columns.columns)
    rows, texts = split_text(data, rows, {c: c for c in chosen}, time)
    return rows, dict(zip(chosen, texts, strict=True))


def _times(data: bytes, rows: TokenRows, header: MvnxHeader, columns: FrameColumns) -> TableTimes:
    """The times of the frames in milliseconds, and the rate, which the header states."""
    rate = stated_rate(header.subject.get("frameRate", ""))
    stated = [] if rate is None else [rate]
    if TIME not in columns.columns:
        return TableTimes(None, (), rate, True)
    times = read_times(data, rows, rows.start.shape[1] - 1, stated, MILLISECOND)
    near = times.rate is None and rate is not None and _are_near(times, rows, rate)
    return replace(times, rate=rate) if near else times


def _are_near(times: TableTimes, rows: TokenRows, rate: Fraction) -> bool:
    """Return True if times that were measured are those of a rate to less than a frame."""
    if not times.signals or times.signals[0].role != TIMES:
        return False
    measured = np.asarray(times.signals[0].values[:, 0], np.float64) * float(MILLISECOND)
    numbers = np.arange(rows.n_rows) if rows.numbers is None else rows.numbers
    return bool(np.ptp(measured - numbers / float(rate)) * float(rate) < 1)
