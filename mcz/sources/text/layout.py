"""Frame layout of a text file: patterns of gaps and columns, and the frames that deviate.

The text of a frame follows a *pattern*: runs of columns, each token after the run's gap, and a
tail. AMC and BVH share this; SPEC.md, "Source reconstruction", is normative and has the tables of
Template, Detail and Notes.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, LimitError
from mcz.kernels import SPARE
from mcz.model.schema import (
    SIZED,
    SVARINT,
    UVARINT,
    Checked,
    Record,
    bounded,
    build,
    counted,
    field,
    parse,
)
from mcz.sources.text import Items

FRAME_NUMBER = -1  # the column of the frame number
MAX_PATTERNS = 1024
MAX_GAPS = 2**20  # of a template, and of a detail (SRC-07)
MAX_RUNS = 2**18  # of a template, and of a detail
MAX_WIDTH = 255  # SRC-12
MAX_ROW_GAPS = 2**20  # bytes of the gaps and the tail of one frame


# SRC-12
_WIDTH = Checked(SVARINT, lambda width: -MAX_WIDTH <= width <= MAX_WIDTH and width != -1)
BIT = bounded(UVARINT, 0, 1)  # SRC-13


class RunFields(Record):
    """Tokens of a frame after equal gaps, in PATTERN."""

    gap: int = field(UVARINT, "number of the gap that precedes every token of the run")
    column: int = field(UVARINT, "first column: 0 the frame number, c + 1 channel c")
    n_columns: int = field(UVARINT, "columns of the run, at least 1; 1 if column is 0")
    width: int = field(
        _WIDTH, "padding: 0 none, 1 blank for no sign, w > 1 right, w < -1 left justified"
    )


class PatternFields(Record):
    """Layout of a frame's text."""

    runs: list[RunFields] = field(
        counted(RunFields, kind="runs"), "the tokens of a frame, in order"
    )
    tail: int = field(UVARINT, "number of the gap that ends the frame")


class Template(Record):
    """Template of AMC and BVH."""

    header: list[bytes] = field(
        counted(SIZED, 2), "text before the frames; the frame count stands between 2 parts"
    )  # SRC-03
    gaps: list[bytes] = field(counted(SIZED, MAX_GAPS), "gaps, numbered from 0")
    patterns: list[PatternFields] = field(
        counted(PatternFields, MAX_PATTERNS), "none, or the most common pattern, which is number 0"
    )


class Detail(Record):
    """Detail of AMC and BVH, and of a section of a table."""

    count: bytes = field(SIZED, "frame count as printed; empty: the number of rows in decimal")
    rows: int = field(UVARINT, "number of rows for which count holds; 0 if count is empty")
    gaps: list[bytes] = field(
        counted(SIZED, MAX_GAPS), "further gaps, numbered on from the template's"
    )
    patterns: list[PatternFields] = field(
        counted(PatternFields, MAX_PATTERNS), "further patterns, numbered on from the template's"
    )
    ends: int = field(BIT, "1: ending stands in place of the last row's tail; 0: the tail does")
    ending: bytes = field(SIZED, "text after the last token; empty if ends is 0")


@dataclass(frozen=True, slots=True)
class Run:
    """``n_columns`` columns from ``column`` on; tokens follow ``gap``, padded to ``width``."""

    gap: bytes
    column: int
    n_columns: int = 1
    width: int = 0


@dataclass(frozen=True, slots=True)
class Pattern:
    runs: tuple[Run, ...]
    tail: bytes

    @property
    def gap_size(self) -> int:
        """Bytes of all gaps and the tail."""
        return sum(run.n_columns * len(run.gap) for run in self.runs) + len(self.tail)

    def arrays(self) -> Items:
        """The pattern as compiled loops have it."""
        gaps = [run.gap for run in self.runs]
        repeats = [run.n_columns for run in self.runs]
        sizes = np.array([*map(len, gaps), len(self.tail)], dtype=np.int64)
        stops = np.cumsum(sizes)
        per_item = np.repeat(np.arange(len(sizes)), [*repeats, 1])
        ranges = [np.arange(run.column, run.column + run.n_columns) for run in self.runs]
        return Items(
            np.frombuffer(b"".join((*gaps, self.tail, bytes(SPARE))), np.uint8),
            (stops - sizes)[per_item],
            stops[per_item],
            np.concatenate([np.empty(0, np.int64), *ranges]),
            np.repeat(np.array([run.width for run in self.runs], dtype=np.int64), repeats),
        )


def runs_of(items: Iterable[tuple[bytes, int, int]]) -> tuple[Run, ...]:
    """The runs of items (gap, column, width)."""
    runs: list[Run] = []
    for gap, column, width in items:
        last = runs[-1] if runs else None
        if last and column > 0 and (gap, column, width) == (
            last.gap, last.column + last.n_columns, last.width,
        ):  # fmt: skip
            runs[-1] = Run(gap, last.column, last.n_columns + 1, width)
        else:
            runs.append(Run(gap, column, 1, width))
    return tuple(runs)


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """A template and a detail, parsed: see Template and Detail; ``ending`` None: the usual tail."""

    header: tuple[bytes, ...]
    patterns: tuple[Pattern, ...] = ()
    count: bytes = b""
    rows: int = 0
    ending: bytes | None = None

    def build(self) -> tuple[bytes, bytes]:
        """The bytes of the template and of the detail; LimitError for too many runs."""
        shared, own = number_patterns(self.patterns)
        template = Template(header=list(self.header), gaps=shared.gaps, patterns=shared.patterns)
        return build(template, "source template"), build(self.detail(own), "source detail")

    def detail(self, own: PatternTable) -> Detail:
        """The detail, whose gaps and patterns are ``own``."""
        return Detail(
            count=self.count,
            rows=self.rows,
            gaps=own.gaps,
            patterns=own.patterns,
            ends=int(self.ending is not None),
            ending=self.ending or b"",
        )


class PatternTable(NamedTuple):
    """The gaps and patterns of a template or a detail."""

    gaps: list[bytes]
    patterns: list[PatternFields]


def number_patterns(patterns: Sequence[Pattern]) -> tuple[PatternTable, PatternTable]:
    """Gaps and patterns of a template and of a detail; LimitError for too many runs."""
    if sum(len(pattern.runs) for pattern in patterns) > MAX_RUNS:
        raise LimitError(f"the frames have more than {MAX_RUNS} runs of columns")
    gaps: dict[bytes, int] = {}
    fields = []
    n_shared = 0
    for pattern in patterns:
        fields.append(_pattern_fields(pattern, gaps))
        n_shared = n_shared or len(gaps)
    numbered = list(gaps)
    return PatternTable(numbered[:n_shared], fields[:1]), PatternTable(
        numbered[n_shared:], fields[1:]
    )


def _pattern_fields(pattern: Pattern, gaps: dict[bytes, int]) -> PatternFields:
    """The fields of a pattern; numbers its gaps in ``gaps``."""
    runs = [
        RunFields(
            gap=gaps.setdefault(run.gap, len(gaps)),
            column=run.column + 1,
            n_columns=run.n_columns,
            width=run.width,
        )
        for run in pattern.runs
    ]
    return PatternFields(runs=runs, tail=gaps.setdefault(pattern.tail, len(gaps)))


def parse_layout(template: bytes, detail: bytes, n_channels: int) -> FrameLayout:
    """The layout of a clip of ``n_channels`` channels; raises FormatError on bad bytes."""
    shared = parse(Template, template, "source template", {"runs": MAX_RUNS})
    own = parse(Detail, detail, "source detail", {"runs": MAX_RUNS})
    if len(shared.header) not in (1, 2):  # SRC-03
        raise FormatError(f"source template: a header has 1 or 2 parts, not {len(shared.header)}")
    return parse_patterns(tuple(shared.header), shared, own, n_channels)


def parse_patterns(
    header: tuple[bytes, ...], shared: Any, own: Any, n_channels: int
) -> FrameLayout:
    """The layout of the fields of a template and of a detail; raises FormatError."""
    if len(shared.patterns) > 1:  # SRC-04
        raise FormatError(
            f"source template: 0 or 1 patterns are allowed, not {len(shared.patterns)}"
        )
    if len(own.patterns) >= MAX_PATTERNS:  # SRC-06
        raise LimitError(f"source detail: {len(own.patterns)} patterns, limit {MAX_PATTERNS - 1}")
    if own.patterns and not shared.patterns:  # SRC-05
        raise FormatError("source detail: it has patterns, but the template has none")
    if (own.rows and not own.count) or (own.ending and not own.ends):  # SRC-14, SRC-15
        raise FormatError("source detail: rows have no count, or end although ends is 0")
    gaps = [*shared.gaps, *own.gaps]
    patterns = [
        _pattern(fields, gaps, n_channels, f"pattern {number}")
        for number, fields in enumerate([*shared.patterns, *own.patterns])
    ]
    ending = own.ending if own.ends else None
    return FrameLayout(header, tuple(patterns), own.count, own.rows, ending)


def _pattern(fields: Any, gaps: Sequence[bytes], n_channels: int, where: str) -> Pattern:
    """PATTERN with its gaps in place, checked: no column twice, none beyond the channels."""
    if any(run.gap >= len(gaps) for run in fields.runs) or fields.tail >= len(gaps):  # SRC-08
        raise FormatError(f"{where}: a gap exceeds the last, {len(gaps) - 1}")
    spans = sorted((run.column, run.n_columns) for run in fields.runs)
    free = 0
    for column, n_columns in spans:
        if column < free or n_columns < 1 or (column == 0 and n_columns > 1):  # SRC-09, SRC-10
            raise FormatError(f"{where}: {n_columns} columns begin at {column}, before {free}")
        free = column + n_columns
    if free > n_channels + 1:  # SRC-11
        raise FormatError(f"{where}: no channel {free - 2} among {n_channels}")
    runs = [Run(gaps[r.gap], r.column - 1, r.n_columns, r.width) for r in fields.runs]
    pattern = Pattern(tuple(runs), gaps[fields.tail])
    if pattern.gap_size > MAX_ROW_GAPS:  # SRC-16
        raise LimitError(f"{where}: {pattern.gap_size} bytes of gaps a row, limit {MAX_ROW_GAPS}")
    return pattern


Ints = NDArray[np.int64]

FRAME_NUMBER_TEXT = re.compile(rb"[-+]?[0-9]{1,32}")


class PatternRun(Record):
    """Rows with one pattern, in NOTES."""

    n_rows: int = field(UVARINT, "rows one after the other, at least 1")
    pattern: int = field(UVARINT, "number of their pattern")


class NumberText(Record):
    """A frame number that is printed oddly, in NOTES."""

    row: int = field(UVARINT, "rows after the text before, or after the segment's first row")
    text: bytes = field(SIZED, "the frame number as printed")


class Notes(Record):
    """Frame notes of AMC and BVH."""

    patterns: list[PatternRun] = field(
        counted(PatternRun), "patterns of the rows; all rows after them have pattern 0"
    )
    texts: list[NumberText] = field(
        counted(NumberText), "frame numbers that are not printed as the frame's, in plain decimal"
    )


@dataclass(frozen=True, slots=True, eq=False)
class RowNotes:
    """Deviations row by row: pattern numbers (n_rows,), and odd texts of the frame number.

    ``texts`` are (row, text), sorted.
    """

    patterns: Ints
    texts: tuple[tuple[int, bytes], ...] = ()

    def cut(self, start: int, stop: int) -> bytes:
        """NOTES of rows start <= r < stop; b"" if all of them are usual."""
        patterns = self.patterns[start:stop]
        low, high = bisect_left(self.texts, (start,)), bisect_left(self.texts, (stop,))
        texts = [(row - start, text) for row, text in self.texts[low:high]]
        if not (patterns.any() or texts):
            return b""
        runs = [(b - a, int(patterns[a])) for a, b in _runs(patterns)]
        if runs[-1][1] == 0:
            runs.pop()
        patterns_of_rows = [PatternRun(n_rows=n, pattern=pattern) for n, pattern in runs]
        return build(Notes(patterns=patterns_of_rows, texts=_space_texts(texts)), "source notes")

    def part(self, start: int, stop: int) -> RowNotes:
        """The notes of rows start <= r < stop alone, numbered from 0."""
        return join_notes([(0, stop - start, self.cut(start, stop))])


def _runs(values: Ints) -> list[tuple[int, int]]:
    """Start and stop of each run of equal values."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return list(pairwise(edges))


def _space_texts(texts: Sequence[tuple[int, bytes]]) -> list[NumberText]:
    """Texts with the distance of each row to the previous one."""
    fields = []
    before = 0
    for row, text in texts:
        fields.append(NumberText(row=row - before, text=text))
        before = row
    return fields


def join_notes(parts: Sequence[tuple[int, int, bytes]]) -> RowNotes:
    """The notes of (start, stop, Notes) parts, the inverse of ``cut``; rows between are usual.

    Raises FormatError if a part is not Notes of ``stop - start`` rows.
    """
    n_rows = max((stop for _, stop, _ in parts), default=0)
    patterns = np.zeros(n_rows, np.int64)
    texts: list[tuple[int, bytes]] = []
    for start, stop, data in sorted(parts):
        if not data:
            continue
        where = f"source notes of rows {start} to {stop}"
        fields = parse(Notes, data, where)
        for first, last, pattern in parse_runs(fields.patterns, stop - start, where):
            patterns[start + first : start + last] = pattern
        odd_texts = parse_texts(fields.texts, stop - start, where)
        texts += [(start + row, text) for row, text in odd_texts]
    return RowNotes(patterns, tuple(texts))


def parse_runs(runs: Sequence[PatternRun], n_rows: int, where: str) -> list[tuple[int, int, int]]:
    """(start, stop, pattern) of PATTERN_RUNs of ``n_rows`` rows; raises FormatError."""
    checked, row = [], 0
    for run in runs:
        # AMC-01, AMC-02
        if run.n_rows < 1 or run.n_rows > n_rows - row or run.pattern >= MAX_PATTERNS:
            raise FormatError(
                f"pattern {run.pattern} cannot have {run.n_rows} rows from {row} on", where=where
            )
        checked.append((row, row + run.n_rows, run.pattern))
        row += run.n_rows
    return checked


def parse_texts(texts: Sequence[NumberText], n_rows: int, where: str) -> list[tuple[int, bytes]]:
    """(row, text) of NUMBER_TEXTs of ``n_rows`` rows; raises FormatError."""
    rows = _rows([entry.row for entry in texts], n_rows, where)
    wrong = [entry.text for entry in texts if not FRAME_NUMBER_TEXT.fullmatch(entry.text)]
    if wrong:  # AMC-05
        raise FormatError(f"{wrong[0][:40]!r} is not a frame number", where=where)
    return [(row, entry.text) for row, entry in zip(rows, texts, strict=True)]


def _rows(distances: Sequence[int], n_rows: int, where: str) -> list[int]:
    """Ascending rows below ``n_rows`` from their distances; raises FormatError."""
    if 0 in distances[1:] or (distances and sum(distances) >= n_rows):  # AMC-04
        raise FormatError(
            f"rows at distances {distances[:8]} repeat, or exceed the {n_rows} rows", where=where
        )
    return list(accumulate(distances))
