"""Frames of an MVNX file: offsets of numbers, their columns, and the channels of columns.

A frame is a tag with attributes and elements of text, without comments, nested elements and CDATA.
Tags and blanks between the numbers are gaps of a row.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from mcz.errors import SourceError
from mcz.model.motion import Channel
from mcz.model.skeleton import POSITION_KINDS, QUATERNION_KINDS
from mcz.model.text_format import quote
from mcz.sources.tables.csv_files import MAX_COLUMNS
from mcz.sources.text import MARKUP
from mcz.sources.text.layout import FRAME_NUMBER, FRAME_NUMBER_TEXT
from mcz.sources.text.rows import DENSE, Token, TokenRows, line_of, read_rows

POSITION, ORIENTATION = "position", "orientation"
INDEX, TIME, TYPE = "@index", "@time", "@type"  # @: an attribute of frames
NORMAL = (b"normal", b"")  # types of motion frames
END = b"</frame>"
MOST_PARTS = 64  # most elements and attributes of a frame
XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")
OWNERS = (  # pattern of elements, list of the header with the names of their parts, axes of a part
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
MASS = (  # of centerOfMass; older files have the first three
    *(Channel("", axis, "m") for axis in XYZ),
    *(Channel("", f"velocity.{axis}", "m/s") for axis in XYZ),
    *(Channel("", f"acceleration.{axis}", "m/s^2") for axis in XYZ),
)

_NAME = rb"[A-Za-z_][\w.-]*"
_VALUE = rb"\s*=\s*(?:\"(?P<double>[^\"<]*)\"|'(?P<single>[^'<]*)')"
_ATTRIBUTE = re.compile(rb"\s+(?P<name>" + _NAME + rb")" + _VALUE)
_FRAME = re.compile(rb"<frame((?:\s+" + _NAME + rb"\s*=\s*(?:\"[^\"<]*\"|'[^'<]*'))*)\s*>")
_FRAMES = re.compile(rb"<frames(?:\s[^<>]*)?>\s*")
_ELEMENT = re.compile(rb"\s*<(" + _NAME + rb")(?:\s[^<>]*)?(?:/>|>([^<]*)</\1\s*>)")
_CONTENT = re.compile(rb"<(" + _NAME + rb")(?:\s[^<>]*)?>([^<]*)</")
_CLOSED = re.compile(rb"\s*</frame>\s*")
_BLANKS = re.compile(rb"\s*")
_WORDS = re.compile(rb"\S+")
_NUMBERS = re.compile(rb"(?i)\s*[-+]?(?:\.?[0-9]|nan|inf)")

Part = tuple[str, list[tuple[int, int]]]  # an element or attribute, and where its tokens are


class _WiderError(Exception):
    """A frame has other elements than the first, or more numbers in one."""


@dataclass(frozen=True, slots=True)
class FrameColumns:
    """The columns of each part of a frame: of the motion, other elements, attributes, the time.

    ``kinds``: channel kinds of a segment; all of ``n_segments`` have the same.
    """

    columns: Mapping[str, Sequence[int]]
    kinds: tuple[str, ...]
    n_segments: int
    n_columns: int

    @property
    def n_motion(self) -> int:
        """Columns of the motion, which are the first ones."""
        return self.n_segments * len(self.kinds)

    @property
    def elements(self) -> list[str]:
        """The elements that are no part of the motion."""
        return [name for name in self.columns if name[0] != "@" and name not in _KINDS]

    @property
    def attributes(self) -> list[str]:
        """The attributes except the time and the frame number."""
        names = [name for name in self.columns if name[0] == "@" and name != TIME]
        return [name for name in names if self.column(name) != FRAME_NUMBER]

    @property
    def first_attribute(self) -> int:
        """The column of the first attribute."""
        return self.n_motion + sum(len(self.columns[name]) for name in self.elements)

    def column(self, name: str) -> int:
        """The column of an attribute."""
        return self.columns[name][0]


_KINDS = {POSITION: POSITION_KINDS, ORIENTATION: QUATERNION_KINDS}


def first_frame(data: bytes, at: int) -> int:
    """The offset of the first frame of motion, after those of calibration; SourceError for none.

    ``at``: the offset of the element ``frames``.
    """
    opened = _FRAMES.match(data, at)
    if opened is None:
        raise SourceError("no plain tag of the element 'frames'", line=line_of(data, at))
    at = opened.end()
    while True:
        frame = _FRAME.match(data, at)
        if frame is None:
            raise SourceError(
                f"expected a frame of motion, not {quote(data[at : at + 40])}",
                line=line_of(data, at),
            )
        span = _attributes(data, *frame.span(1)).get(TYPE, (0, 0))
        if data[slice(*span)] in NORMAL:
            return at
        end = data.find(END, at)
        if end < 0:
            raise SourceError(
                "the file is truncated in a calibration frame", line=line_of(data, at)
            )
        at = _BLANKS.match(data, end + len(END)).end()  # type: ignore[union-attr]  # matches always


def read_frames(data: bytes, at: int) -> tuple[TokenRows, FrameColumns]:
    """Read all frames from offset ``at`` on; raises SourceError for other content."""
    first, _ = _parts(data, at)
    sizes = {name: len(tokens) for name, tokens in first if tokens}
    numbered = any(
        name == INDEX and FRAME_NUMBER_TEXT.fullmatch(data, *tokens[0]) for name, tokens in first
    )
    try:
        return _read(data, at, columns_of(sizes, numbered))
    except _WiderError:
        sizes = _all_sizes(data, at)
        return _read(data, at, columns_of(sizes, numbered))


def _read(data: bytes, at: int, columns: FrameColumns) -> tuple[TokenRows, FrameColumns]:
    return read_rows(
        data, at, columns.n_columns, _frames(data, columns), MARKUP, room=DENSE
    ), columns


def _frames(data: bytes, columns: FrameColumns) -> Callable[[int], tuple[list[Token], int] | None]:
    """Return a function that reads a frame's tokens; see ``rows.Frames``."""

    def read_frame(at: int) -> tuple[list[Token], int] | None:
        if at >= len(data):
            return None
        parts, end = _parts(data, at)
        tokens: list[Token] = []
        for name, spans in parts:
            places = columns.columns.get(name, ())
            if len(places) < len(spans):
                raise _WiderError
            if places and not spans:
                raise SourceError(f"{name!r} contains words, not numbers", line=line_of(data, at))
            tokens += [(*span, place) for span, place in zip(spans, places, strict=False)]
        return tokens, end

    return read_frame


def _parts(data: bytes, at: int) -> tuple[list[Part], int]:
    """The parts that are not blank of the frame at an offset, and its end.

    An element of words has an empty list of tokens.
    """
    opened = _FRAME.match(data, at)
    if opened is None:
        raise SourceError(
            f"expected a frame, not {quote(data[at : at + 40])}", line=line_of(data, at)
        )
    parts: list[Part] = [
        (name, [span])
        for name, span in _attributes(data, *opened.span(1)).items()
        if name != TYPE and span[0] < span[1]
    ]
    at = opened.end()
    while (element := _ELEMENT.match(data, at)) is not None:
        span = element.span(2)
        if _NUMBERS.match(data, *span):
            words = islice(_WORDS.finditer(data, *span), MAX_COLUMNS + 1)
            parts.append((element[1].decode(), [word.span() for word in words]))
        elif span[0] < span[1] and not data[slice(*span)].isspace():
            parts.append((element[1].decode(), []))
        if len(parts) > MOST_PARTS:
            raise SourceError(
                f"a frame has more than {MOST_PARTS} elements and attributes",
                line=line_of(data, at),
            )
        at = element.end()
    closed = _CLOSED.match(data, at)
    if closed is None:
        excerpt = quote(data[at : at + 40].lstrip())
        raise SourceError(
            f"a frame must consist of elements with text, not {excerpt}", line=line_of(data, at)
        )
    if len({name for name, _ in parts}) < len(parts):
        raise SourceError("a frame has two elements of the same name", line=line_of(data, at))
    return parts, closed.end()


def _attributes(data: bytes, start: int, stop: int) -> dict[str, tuple[int, int]]:
    """The attributes of a frame, as ``@name``, and the place of each value."""
    spans: dict[str, tuple[int, int]] = {}
    for match in _ATTRIBUTE.finditer(data, start, stop):
        name = "@" + match["name"].decode()
        if name in spans:
            raise SourceError("a frame has the same attribute twice", line=line_of(data, start))
        spans[name] = match.span("single" if match["double"] is None else "double")
    return spans


def _all_sizes(data: bytes, at: int) -> dict[str, int]:
    """Greatest count of numbers of each part, over all frames from offset ``at`` on."""
    sizes: dict[str, int] = {}
    for name, text in _all_parts(data, at):
        sizes[name] = max(sizes.get(name, 0), len(text.split()) if name[0] != "@" else 1)
        if len(sizes) > MOST_PARTS:
            raise SourceError(f"frames have more than {MOST_PARTS} elements and attributes")
    return sizes


def _all_parts(data: bytes, at: int) -> Iterable[tuple[str, bytes]]:
    for frame in _FRAME.finditer(data, at):
        for name, span in _attributes(data, *frame.span(1)).items():
            if name != TYPE and span[0] < span[1]:
                yield name, b""
    for element in _CONTENT.finditer(data, at):
        if _NUMBERS.match(element[2]):
            yield element[1].decode(), element[2]


def columns_of(sizes: Mapping[str, int], numbered: bool) -> FrameColumns:
    """The columns of parts of such sizes; ``numbered``: the index is the number of the frame."""
    present = [name for name in _KINDS if name in sizes]
    counts = {sizes[name] / len(_KINDS[name]) for name in present}
    if len(counts) != 1 or (n_segments := counts.pop()) % 1:
        parts = ", ".join(f"{sizes[name]} numbers of {name}" for name in present) or "neither"
        raise SourceError(f"expected positions and orientations of segments, but found {parts}")
    kinds = tuple(kind for name in present for kind in _KINDS[name])
    columns: dict[str, Sequence[int]] = {}
    first = 0
    for name in present:
        own = range(first, first + len(_KINDS[name]))
        columns[name] = [s * len(kinds) + k for s in range(int(n_segments)) for k in own]
        first = own.stop
    at = int(n_segments) * len(kinds)
    elements = [name for name in sizes if name[0] != "@" and name not in _KINDS]
    attributes = [name for name in sizes if name[0] == "@" and name != TIME]
    for name in (*elements, *attributes, *([TIME] if TIME in sizes else [])):
        if name == INDEX and numbered:
            columns[name] = [FRAME_NUMBER]
            continue
        columns[name] = range(at, at + sizes[name])
        at += sizes[name]
    if at > MAX_COLUMNS:
        raise SourceError(f"{at} numbers a frame exceed the limit of {MAX_COLUMNS}")
    return FrameColumns(columns, kinds, int(n_segments), at)


def unit_of(name: str) -> str:
    """The unit of an element or attribute, "" if it has none or is not known."""
    return next((unit for pattern, unit in UNITS if re.fullmatch(pattern, name)), "")


def channels_of(
    element: str, size: int, labels_of: Mapping[str, Sequence[str]]
) -> tuple[Channel, ...]:
    """Channels of an element with ``size`` numbers, named after its parts if their sizes fit.

    ``labels_of``: names of parts by the list in the header.
    """
    if element == "centerOfMass" and size <= len(MASS):
        return MASS[:size]
    unit = unit_of(element)
    for pattern, owner, axes in OWNERS:
        match = re.fullmatch(pattern, element)
        if match is None:
            continue
        labels = labels_of.get(owner + "".join(match.groups()), [])
        if len(labels) * len(axes) == size:
            ends = [f".{axis}" if axis else "" for axis in axes]
            return tuple(Channel("", label + end, unit) for label in labels for end in ends)
    return tuple(Channel("", str(k + 1), unit) for k in range(size))
