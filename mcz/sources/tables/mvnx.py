"""MVNX (the XML of Xsens MVN): bytes -> Motion, and back.

SPEC.md, "The text of tables", is normative for the way back: a frame is a row, its tags are gaps.
Segments have positions and orientations along the axes of the world, so each is a joint without a
parent; its bones are tails. Every other element of numbers is a signal. Frames of calibration
before the motion belong to the header.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from mcz.errors import MotionError, SourceError
from mcz.model.clock import TIMES
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.skeleton import ORIGIN
from mcz.sources.tables.mvnx_frames import END, TIME, FrameColumns, first_frame, read_frames
from mcz.sources.tables.mvnx_header import Header, numbered_names, read_header
from mcz.sources.tables.restore import restore_table
from mcz.sources.tables.rows import followed_by
from mcz.sources.tables.signals import of_columns, read_columns, read_text, table_metadata
from mcz.sources.tables.source import names_in, section_of, table_source
from mcz.sources.tables.text_columns import TextColumn, odd_cells, split_text
from mcz.sources.tables.times import Times, read_times, stated_rate
from mcz.sources.tables.token_signal import read_signal
from mcz.sources.text.rows import Rows, counted_up, line_of
from mcz.sources.text.source import check_text, text_encoding

FORMAT = "mvnx"
METERS_CM = 100.0
MILLISECOND = Fraction(1, 1000)  # the unit of times
XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")
OWNERS = (  # of an element: the list in the header that names its parts, and a part's numbers
    (r"velocity|acceleration|angular(?:Velocity|Acceleration)", "segments", XYZ),
    (r"sensor(?:(?:Free)?Acceleration|AngularVelocity|MagneticField)", "sensors", XYZ),
    (r"sensorOrientation", "sensors", WXYZ),
    (r"jointAngle(?:XZY)?", "joints", XYZ),
    (r"jointAngleErgo(?:XZY)?", "ergonomicJointAngles", XYZ),
    (r"footContacts", "footContactDefinition", ("",)),
    (r"positionFingers(Left|Right)", "fingerTrackingSegments", XYZ),
    (r"orientationFingers(Left|Right)", "fingerTrackingSegments", WXYZ),
    (r"jointAngleFingers(Left|Right)(?:XZY)?", "fingerTrackingJoints", XYZ),
)
UNITS = (
    (r"jointAngle.*", "deg"),
    (r"velocity", "m/s"),
    (r"acceleration|sensor(?:Free)?Acceleration", "m/s^2"),
    (r"angularVelocity|sensorAngularVelocity", "rad/s"),
    (r"angularAcceleration", "rad/s^2"),
    (r"centerOfMass|position.*", "m"),
    (r"ms", "ms"),
)
MASS = (  # centerOfMass, of which older files have the first three
    *(Channel("", axis, "m") for axis in XYZ),
    *(Channel("", f"velocity.{axis}", "m/s") for axis in XYZ),
    *(Channel("", f"acceleration.{axis}", "m/s^2") for axis in XYZ),
)

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
    rows = counted_up(followed_by(rows, rest))
    rows, texts = _split_text(data, rows, columns)
    joints, odd = _joints(header, columns)
    more = [*_elements(data, rows, header, columns), *_attributes(data, rows, columns, texts)]
    first = columns.n_motion + sum(signal.n_channels for signal in more)
    labels = [name[1:] for name in columns.attributes if columns.column(name) in texts]
    more += read_text(data, rows, list(texts.values()), labels, (first, 1))
    times = _times(data, rows, header, columns, texts)
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


def _signal(data: bytes, rows: Rows, columns: Sequence[int]) -> Signal:
    return read_signal(data, of_columns(rows, columns))


def _joints(header: Header, columns: FrameColumns) -> tuple[tuple[Joint, ...], list[str]]:
    """A joint for each segment, and what is odd about their names."""
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


def _elements(data: bytes, rows: Rows, header: Header, columns: FrameColumns) -> Iterator[Signal]:
    """A signal for each element that is no part of the motion."""
    for name in columns.elements:
        signal = _signal(data, rows, columns.columns[name])
        yield replace(signal, name=name, channels=_channels(name, signal.n_channels, header))


def _channels(element: str, size: int, header: Header) -> tuple[Channel, ...]:
    """The channels of an element, called as its parts where these have so many numbers."""
    if element == "centerOfMass" and size <= len(MASS):
        return MASS[:size]
    unit = next((unit for pattern, unit in UNITS if re.fullmatch(pattern, element)), "")
    for pattern, owner, axes in OWNERS:
        match = re.fullmatch(pattern, element)
        if match is None:
            continue
        labels = header.labels.get(owner + "".join(match.groups()), [])
        if len(labels) * len(axes) == size:
            ends = [f".{axis}" if axis else "" for axis in axes]
            return tuple(Channel("", label + end, unit) for label in labels for end in ends)
    return tuple(Channel("", str(k + 1), unit) for k in range(size))


def _attributes(
    data: bytes, rows: Rows, columns: FrameColumns, texts: Mapping[int, TextColumn]
) -> Iterator[Signal]:
    """A signal for each attribute of numbers."""
    at = columns.first_attribute
    for name in columns.attributes:
        if columns.column(name) not in texts:
            label = name[1:]
            unit = next((unit for pattern, unit in UNITS if re.fullmatch(pattern, label)), "")
            signal = read_columns(data, rows, [at])
            yield replace(signal, name=label, channels=(Channel("", label, unit),))
            at += 1


def _split_text(
    data: bytes, rows: Rows, columns: FrameColumns
) -> tuple[Rows, dict[int, TextColumn]]:
    """``rows`` with numbers in place of attributes that are text, and these by their column."""
    places = [columns.column(name) for name in columns.attributes]
    found = odd_cells(data, of_columns(rows, places)).text_columns() if places else []
    chosen = [places[k] for k in found]
    if not chosen:
        return rows, {}
    time = columns.n_columns - (TIME in columns.columns)
    rows, texts = split_text(data, rows, {c: c for c in chosen}, time)
    return rows, dict(zip(chosen, texts, strict=True))


def _times(
    data: bytes,
    rows: Rows,
    header: Header,
    columns: FrameColumns,
    texts: Mapping[int, TextColumn],
) -> Times:
    """The times of the frames in milliseconds, and the rate, which the header states."""
    rate = stated_rate(header.subject.get("frameRate", ""))
    stated = [] if rate is None else [rate]
    if TIME not in columns.columns:
        return Times(None, (), rate, True)
    times = read_times(data, rows, rows.start.shape[1] - 1, stated, MILLISECOND)
    near = times.rate is None and rate is not None and _are_near(times, rows, rate)
    return replace(times, rate=rate) if near else times


def _are_near(times: Times, rows: Rows, rate: Fraction) -> bool:
    """Return True if times that were measured are those of a rate to less than a frame."""
    if not times.signals or times.signals[0].role != TIMES:
        return False
    measured = np.asarray(times.signals[0].values[:, 0], np.float64) * float(MILLISECOND)
    numbers = np.arange(rows.n_rows) if rows.numbers is None else rows.numbers
    return bool(np.ptp(measured - numbers / float(rate)) * float(rate) < 1)
