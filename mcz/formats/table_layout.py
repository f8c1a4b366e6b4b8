"""How a table of numbers is laid out: its header, its patterns, what stands for a missing value.

TRC, MOT and STO share this; SPEC.md, "The text of tables", is normative.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mcz.errors import FormatError, LimitError
from mcz.formats.layout import (
    BIT,
    DETAIL,
    MAX_GAPS,
    MAX_PATTERNS,
    MAX_RUNS,
    PATTERN,
    Layout,
    numbered_patterns,
    parsed_patterns,
)
from mcz.numbers import GRID, Grid, GridKind
from mcz.schema import (
    SIZED,
    SVARINT,
    UVARINT,
    ExprValidator,
    Struct,
    build,
    counted,
    optional,
    parse,
)

NAME, NEXT, SAME, COUNT = b"\0", b"\1", b"\2", b"\3"  # marks of a header
PHRASES = {  # and others: what stands in many headers
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
MOST = 2**62  # of ordinals, so that they fit an int64
MAX_HEADER = 2**26  # bytes of a header with its marks filled
DECIMALS = (GridKind.FIXED, GridKind.TRIMMED)  # of times that follow from frame numbers
_MARKS = re.compile(rb"[\0-\x08\x0b\x0c\x0e-\x1f]")
_PHRASES = re.compile(b"|".join(map(re.escape, sorted(PHRASES.values(), key=len, reverse=True))))
_MARK_OF = {phrase: bytes((mark,)) for mark, phrase in PHRASES.items()}
_POSITIVE = ExprValidator(UVARINT, lambda obj, ctx: obj >= 1)  # TABLE-03

CLOCK = Struct(
    "grid" / GRID * "grid that prints the times, FIXED or TRIMMED",
    "numerator" / UVARINT * "what a frame number counts",
    "denominator" / _POSITIVE * "what that is divided by, at least 1",
    "offset" / SVARINT * "what is added before",
)
TABLE_TEMPLATE = Struct(
    "header" / SIZED * "text before the rows",
    "marks" / BIT * "1: control codes of the header are marks; 0: they are text",
    "missing" / SIZED * "what stands where a value is invalid",
    "clock" / optional(CLOCK) * "0 or 1: times that follow from the frame numbers",
    "gaps" / counted(SIZED, MAX_GAPS) * "gaps, numbered from 0",
    "patterns"
    / counted(PATTERN, MAX_PATTERNS)
    * "none, or the most common pattern, which is number 0",
)


@dataclass(frozen=True, slots=True)
class Clock:
    """Times that follow from frame numbers: ordinals of a grid that has text."""

    grid: Grid
    numerator: int
    denominator: int
    offset: int

    def ordinals(self, numbers: Sequence[int]) -> list[int]:
        """The ordinal of every time; FormatError for one far beyond every grid."""
        found = [(n * self.numerator + self.offset) // self.denominator for n in numbers]
        if any(abs(ordinal) > MOST for ordinal in found):
            raise FormatError("source template: a time is no number of its grid")
        return found


@dataclass(frozen=True, slots=True)
class TableLayout:
    """A template and a detail of a table, parsed. ``rows`` has the patterns and the ending."""

    header: bytes
    marked: bool
    missing: bytes
    clock: Clock | None
    rows: Layout

    def build(self) -> tuple[bytes, bytes]:
        """The bytes of the template and of the detail; LimitError for too many runs."""
        shared, own = numbered_patterns(self.rows.patterns)
        names = ("grid", "numerator", "denominator", "offset")
        clock = [{name: getattr(self.clock, name) for name in names}] if self.clock else []
        template = {
            "header": self.header,
            "marks": int(self.marked),
            "missing": self.missing,
            "clock": clock,
            **shared,
        }
        return build(TABLE_TEMPLATE, template, "source template"), build(
            DETAIL, self.rows.detail_fields(own), "source detail"
        )


def parse_table(template: bytes, detail: bytes, n_columns: int) -> TableLayout:
    """The layout of a table of ``n_columns`` columns, that of a clock among them where it has one.

    Raises FormatError on bad bytes.
    """
    shared = parse(TABLE_TEMPLATE, template, "source template", {"runs": MAX_RUNS})
    own = parse(DETAIL, detail, "source detail", {"runs": MAX_RUNS})
    clock = None
    if shared.clock:
        fields = shared.clock[0]
        if fields.grid.kind not in DECIMALS:  # TABLE-02
            raise FormatError(f"source template: times on a grid {fields.grid.kind.name}")
        clock = Clock(fields.grid, fields.numerator, fields.denominator, fields.offset)
    n_columns += clock is not None  # TABLE-01
    rows = parsed_patterns((shared.header,), shared, own, n_columns)
    return TableLayout(shared.header, bool(shared.marks), shared.missing, clock, rows)


def fill(header: bytes, names: Sequence[str], count: bytes) -> bytes:
    """``header`` with its marks replaced; FormatError where there are more than joints."""
    out, at, size = [], 0, len(header)
    joint = number = 0
    for match in _MARKS.finditer(header):
        mark = match[0]
        if mark == NAME:
            joint += 1
            if joint > len(names):  # TABLE-05
                raise FormatError(f"source template: a name of joint {joint} of {len(names)}")
            text = "".join(names[joint - 1 : joint]).encode()
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


def with_phrases(header: bytes) -> bytes:
    """``header`` with a mark for each phrase."""
    return _PHRASES.sub(lambda match: _MARK_OF[match[0]], header)


def any_mark(header: bytes) -> bool:
    """Whether ``header`` has a byte that would be taken for a mark."""
    return _MARKS.search(header) is not None
