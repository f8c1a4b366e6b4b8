"""Layout of tables of numbers: sections with header, patterns, and missing cells.

TRC, MOT, STO and CSV files share this; SPEC.md, "The text of tables", is normative.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log10

from mcz.errors import FormatError, LimitError
from mcz.model.numbers import GRID, Grid, GridKind
from mcz.model.schema import (
    POSITIVE,
    SIZED,
    SVARINT,
    UVARINT,
    Record,
    build,
    counted,
    field,
    optional,
    parse,
)
from mcz.sources.text.layout import (
    BIT,
    MAX_GAPS,
    MAX_PATTERNS,
    MAX_RUNS,
    Detail,
    FrameLayout,
    PatternFields,
    number_patterns,
    parse_patterns,
)

NAME, NEXT, SAME, COUNT = b"\0", b"\1", b"\2", b"\3"  # marks of a header
PHRASES = {  # marks of phrases that are common in headers
    4: b"PathFileType\t4\t(X/Y/Z)\t",
    5: b"DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t"
    b"OrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
    6: b"Frame#\tTime",
    7: b"version=",
    8: b"nRows=",
    11: b"nColumns=",
    12: b"inDegrees=",
    14: b"endheader",
    15: b"DataType=",
    16: b"OpenSimVersion=",
    17: b"DataRate=",
    18: b"Units are S.I. units (second, meters, Newtons, ...)",
    19: b"Angles are in degrees.",
    20: b"datacolumns ",
    21: b"datarows ",
    22: b"range ",
    23: b"Coordinates",
    24: b"Quaternion",
    25: b"Format Version,1.2",
    26: b",Take Name,",
    27: b",Capture Frame Rate,",
    28: b",Export Frame Rate,",
    29: b",Capture Start Time,",
    30: b",Total Frames in Take,",
    31: b",Total Exported Frames,",
}
UNIT_CM = {"mm": 0.1, "cm": 1.0, "m": 100.0, "in": 2.54, "ft": 30.48}  # as headers name units
MOST_ORDINAL = 2**62  # bound of ordinals, which then fit int64
MAX_HEADER = 2**26  # bytes of a header with its marks filled
MAX_SECTIONS = 64  # TABLE-07
DECIMALS = (GridKind.FIXED, GridKind.TRIMMED)  # of times that follow from frame numbers
_MARKS = re.compile(rb"[\0-\x08\x0b\x0c\x0e-\x1f]")
_PHRASES = re.compile(b"|".join(map(re.escape, sorted(PHRASES.values(), key=len, reverse=True))))
_MARK_OF = {phrase: bytes((mark,)) for mark, phrase in PHRASES.items()}
_POSITIVE = POSITIVE  # TABLE-03


class ClockFields(Record):
    """Times that follow from frame numbers, in SECTION."""

    grid: Grid = field(GRID, "grid that prints the times, FIXED or TRIMMED")
    numerator: int = field(UVARINT, "factor of the frame number")
    denominator: int = field(_POSITIVE, "divisor of the sum, at least 1")
    offset: int = field(SVARINT, "added to the product before division")


class SectionFields(Record):
    """A section of a table."""

    signals: list[int] = field(
        counted(UVARINT), "numbers of the signals that its columns come from, at least 1"
    )
    header: bytes = field(SIZED, "text before the rows")
    marks: int = field(BIT, "1: control codes of the header are marks; 0: they are text")
    missing: bytes = field(SIZED, "text in place of an invalid value")
    clock: ClockFields | None = field(
        optional(ClockFields), "0 or 1: times that follow from the frame numbers"
    )
    gaps: list[bytes] = field(counted(SIZED, MAX_GAPS), "gaps, numbered from 0")
    patterns: list[PatternFields] = field(
        counted(PatternFields, MAX_PATTERNS), "none, or the most common pattern, which is number 0"
    )


class TableTemplate(Record):
    """Template of tables."""

    sections: list[SectionFields] = field(
        counted(SectionFields, MAX_SECTIONS), "the sections in the order of the file, 1 to 64"
    )


class TableDetail(Record):
    """Detail of tables."""

    details: list[Detail] = field(counted(Detail, MAX_SECTIONS), "a detail for each section")


@dataclass(frozen=True, slots=True)
class Clock:
    """Times that follow from frame numbers: ordinals of a grid that has text."""

    grid: Grid
    numerator: int
    denominator: int
    offset: int

    def fields(self) -> ClockFields:
        """The clock as a template has it."""
        return ClockFields(
            grid=self.grid,
            numerator=self.numerator,
            denominator=self.denominator,
            offset=self.offset,
        )

    def ordinals(self, numbers: Sequence[int]) -> list[int]:
        """The ordinal of every time; FormatError for one far beyond every grid."""
        ordinals = [(n * self.numerator + self.offset) // self.denominator for n in numbers]
        if any(abs(ordinal) > MOST_ORDINAL for ordinal in ordinals):
            raise FormatError("source template: a time is no number of its grid")
        return ordinals

    def numbers_per_second(self, rate: Fraction | None) -> Fraction | None:
        """Frame numbers per second of this clock; None if its times do not change."""
        if not self.numerator:
            return None
        unit = Fraction(10**self.grid.digits) * int(self._units_per_second(rate))
        return unit * self.denominator / self.numerator

    def _units_per_second(self, rate: Fraction | None) -> float:
        """The power of 1000, up to 10^9, nearest to the printed units of a second.

        1 for an unknown rate, and for times that do not change.
        """
        if rate is None or not self.numerator:
            return 1.0
        a_frame = self.numerator / (self.denominator * 10**self.grid.digits) * float(rate)
        return float(10 ** (3 * min(3, max(0, round(log10(a_frame) / 3)))))


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a table. ``signals`` are numbers of signals, whose channels are its columns.

    ``rows`` has the patterns and the ending.
    """

    signals: tuple[int, ...]
    header: bytes
    marked: bool
    missing: bytes
    clock: Clock | None
    rows: FrameLayout


def build_table(sections: Sequence[Section]) -> tuple[bytes, bytes]:
    """Build the template and the detail; raises LimitError for too many runs."""
    templates, details = [], []
    for section in sections:
        shared, own = number_patterns(section.rows.patterns)
        templates.append(
            SectionFields(
                signals=list(section.signals),
                header=section.header,
                marks=int(section.marked),
                missing=section.missing,
                clock=section.clock.fields() if section.clock else None,
                gaps=shared.gaps,
                patterns=shared.patterns,
            )
        )
        details.append(section.rows.detail(own))
    template = build(TableTemplate(sections=templates), "source template")
    return template, build(TableDetail(details=details), "source detail")


def parse_sections(template: bytes, detail: bytes, sizes: Sequence[int]) -> list[Section]:
    """The sections of a table of signals that have ``sizes`` channels; FormatError on bad bytes."""
    shared = parse(TableTemplate, template, "source template", {"runs": MAX_RUNS}).sections
    own = parse(TableDetail, detail, "source detail", {"runs": MAX_RUNS}).details
    if not shared or len(shared) != len(own):  # TABLE-07
        raise FormatError(f"source template: {len(shared)} sections, but {len(own)} details")
    numbers = [number for fields in shared for number in fields.signals]
    if max(numbers, default=0) >= len(sizes) or len(set(numbers)) < len(numbers):  # TABLE-08
        raise FormatError(f"source template: signals {numbers[:8]} of {len(sizes)}")
    return [_section(*fields, sizes) for fields in zip(shared, own, strict=True)]


def _section(shared: SectionFields, detail: Detail, sizes: Sequence[int]) -> Section:
    if not shared.signals:  # TABLE-08
        raise FormatError("source template: a section has no signals")
    clock = parse_clock(shared)
    n_columns = sum(sizes[number] for number in shared.signals) + 1 + bool(shared.clock)  # TABLE-01
    rows = parse_patterns((shared.header,), shared, detail, n_columns)
    signals = tuple(shared.signals)
    return Section(signals, shared.header, bool(shared.marks), shared.missing, clock, rows)


def parse_clock(shared: SectionFields) -> Clock | None:
    """The clock of a section, None without one; FormatError for a grid without decimals."""
    fields = shared.clock
    if fields is None:
        return None
    if fields.grid.kind not in DECIMALS:  # TABLE-02
        raise FormatError(f"source template: times cannot have grid {fields.grid.kind.name}")
    return Clock(fields.grid, fields.numerator, fields.denominator, fields.offset)


def fill_marks(header: bytes, names: Sequence[str], count: bytes) -> bytes:
    """``header`` with its marks replaced; FormatError for more name marks than names."""
    out, at, size = [], 0, len(header)
    joint = number = 0
    for match in _MARKS.finditer(header):
        mark = match[0]
        if mark == NAME:
            joint += 1
            if joint > len(names):  # TABLE-05
                raise FormatError(f"source template: no joint {joint} among {len(names)}")
            text = names[joint - 1].encode()
        elif mark == COUNT:
            text = count
        elif mark in (NEXT, SAME):
            number += mark == NEXT
            text = b"%d" % number
        else:
            text = PHRASES[mark[0]]
        size += len(text) - 1
        if size > MAX_HEADER:
            raise LimitError(f"source template: a header of {size} bytes, limit {MAX_HEADER}")
        out += [header[at : match.start()], text]
        at = match.end()
    return b"".join((*out, header[at:]))


def mark_phrases(header: bytes) -> bytes:
    """``header`` with a mark for each phrase."""
    return _PHRASES.sub(lambda match: _MARK_OF[match[0]], header)


def has_mark(header: bytes) -> bool:
    """Return True if ``header`` has a byte that readers take for a mark."""
    return _MARKS.search(header) is not None
