"""The header of an MVNX file: XML up to the element ``frames``, and the names in it.

Expat reads it, a declaration of types is refused where it begins: no entity is declared, so none is
expanded, and nothing else is loaded.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

from mcz.errors import SourceError
from mcz.model.skeleton import ORIGIN, Vector
from mcz.sources.text.rows import line_of
from mcz.sources.text.source import MOST_JOINTS, check

MOST_BYTES = 2**24  # of a header, without the frames of calibration
MOST_DEPTH = 32  # of elements in each other
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
class Header:
    """The names in a header; ``frames`` is the offset of that element.

    ``labels``: of each of ``LISTS``, in order. ``points``: of each segment, by name, in meters
    along its axes. ``connectors``: the points of two segments that each joint of a body connects.
    """

    frames: int = 0
    system: Mapping[str, str] = field(default_factory=dict)
    subject: Mapping[str, str] = field(default_factory=dict)
    comment: str = ""
    labels: dict[str, list[str]] = field(default_factory=dict)
    points: dict[Place, Vector] = field(default_factory=dict)
    connectors: list[tuple[Place, Place]] = field(default_factory=list)

    def tails(self) -> dict[str, list[Vector]]:
        """The points of each segment that other segments hang on."""
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
        said = {
            "subject": self.subject.get("label", ""),
            "system": f"Xsens MVN {version}" if version else "",
            "description": self.comment,
            **_date(self.subject.get("recDate", "")),
        }
        return {key: value.strip() for key, value in said.items() if value.strip()}


def is_mvnx(head: bytes) -> bool:
    """Return True if a file that begins with ``head`` seems to be MVNX."""
    return b"<mvnx" in head and _ROOT.search(head) is not None


def read_header(data: bytes) -> Header:
    """The header of an MVNX file; SourceError, with the number of the line, where it has none.

    It is read as UTF-8, or else as Latin-1, whatever it declares.
    """
    start = data[:MOST_BYTES]
    try:
        return _Reader(start).read("utf-8")
    except expat.ExpatError as error:
        if error.code != _INVALID:
            raise _refused(error) from None
    try:
        return _Reader(start).read("iso-8859-1")
    except expat.ExpatError as error:
        raise _refused(error) from None


_INVALID = expat.errors.codes[expat.errors.XML_ERROR_INVALID_TOKEN]


def _refused(error: expat.ExpatError) -> SourceError:
    return SourceError(f"not XML: {expat.ErrorString(error.code)}", line=error.lineno)


class _Reached(Exception):
    """The element ``frames`` begins."""


class _Reader:
    """The events of expat -> a Header."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._header = Header()
        self._path: list[str] = []
        self._names: list[str] = []  # labels of the elements of ``_path``
        self._text: list[str] = []
        self._near: Place = ("", "")

    def read(self, encoding: str) -> Header:
        parser = expat.ParserCreate(encoding)
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        parser.StartDoctypeDeclHandler = self._refuse_types
        self._parser = parser
        try:
            parser.Parse(self._data, False)
        except _Reached:
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
            raise _Reached
        if path and path[-1] in LISTS:
            labels = header.labels.setdefault(path[-1], [])
            labels.append(_printable(label))
            check(path[-1], len(labels), MOST_JOINTS)
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
    """The date and time of a recording; empty where the text is none in English words."""
    match = _DATE.fullmatch(text.strip())
    if match is None:
        return {}
    month = MONTHS.index(match[1].title()) + 1
    date = f"{match[4]}-{month:02d}-{int(match[2]):02d}"
    return {"date": date, "time": f"{date}T{match[3]}"}


def numbered_names(labels: Sequence[str], count: int, what: str) -> list[str]:
    """The first ``count`` labels, and numbered ones where there are fewer."""
    return [*labels[:count], *(f"{what} {k + 1}" for k in range(len(labels), count))]
