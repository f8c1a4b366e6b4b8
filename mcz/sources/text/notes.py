"""Frame-by-frame deviations from a text layout: the notes of AMC and BVH sources.

SPEC.md, "Source reconstruction", is normative and has the table of Notes.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.model.schema import SIZED, UVARINT, Record, build, counted, field, parse
from mcz.sources.text.layout import MAX_PATTERNS

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
        """NOTES of rows start <= r < stop; b"" where all of them are usual."""
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
    """Texts with the distance of each row to the one before."""
    fields = []
    before = 0
    for row, text in texts:
        fields.append(NumberText(row=row - before, text=text))
        before = row
    return fields


def join_notes(parts: Sequence[tuple[int, int, bytes]]) -> RowNotes:
    """The notes of (start, stop, Notes) parts, the inverse of ``cut``; rows between are usual.

    Raises FormatError where a part is not Notes of ``stop - start`` rows.
    """
    n_rows = max((stop for _, stop, _ in parts), default=0)
    patterns = np.zeros(n_rows, np.int64)
    texts: list[tuple[int, bytes]] = []
    for start, stop, data in sorted(parts):
        if not data:
            continue
        where = f"source notes of rows {start} to {stop}"
        fields = parse(Notes, data, where)
        for first, last, pattern in checked_runs(fields.patterns, stop - start, where):
            patterns[start + first : start + last] = pattern
        odd_texts = checked_texts(fields.texts, stop - start, where)
        texts += [(start + row, text) for row, text in odd_texts]
    return RowNotes(patterns, tuple(texts))


def checked_runs(runs: Sequence[PatternRun], n_rows: int, where: str) -> list[tuple[int, int, int]]:
    """(start, stop, pattern) of PATTERN_RUNs of ``n_rows`` rows; raises FormatError."""
    found, row = [], 0
    for run in runs:
        # AMC-01, AMC-02
        if run.n_rows < 1 or run.n_rows > n_rows - row or run.pattern >= MAX_PATTERNS:
            raise FormatError(
                f"pattern {run.pattern} for {run.n_rows} rows from {row} on", where=where
            )
        found.append((row, row + run.n_rows, run.pattern))
        row += run.n_rows
    return found


def checked_texts(texts: Sequence[NumberText], n_rows: int, where: str) -> list[tuple[int, bytes]]:
    """(row, text) of NUMBER_TEXTs of ``n_rows`` rows; raises FormatError."""
    rows = _rows([entry.row for entry in texts], n_rows, where)
    wrong = [entry.text for entry in texts if not FRAME_NUMBER_TEXT.fullmatch(entry.text)]
    if wrong:  # AMC-05
        raise FormatError(f"{wrong[0][:40]!r} is not a frame number", where=where)
    return [(row, entry.text) for row, entry in zip(rows, texts, strict=True)]


def _rows(distances: Sequence[int], n_rows: int, where: str) -> list[int]:
    """The rows from their distances, checked: each later than the one before, and below n_rows."""
    if 0 in distances[1:] or (distances and sum(distances) >= n_rows):  # AMC-04
        raise FormatError(f"rows {distances[:8]} of {n_rows}", where=where)
    return list(accumulate(distances))
