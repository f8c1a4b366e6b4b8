"""The Source of a table that was read, its header with marks if these give the same bytes."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcz.errors import FormatError, LimitError
from mcz.model.motion import Source
from mcz.model.schema import POSITIVE, Record, build, counted, field, parse
from mcz.sources.tables.layout import (
    COUNT,
    MAX_SECTIONS,
    NAME,
    Clock,
    Section,
    any_mark,
    build_table,
    fill,
    with_phrases,
)
from mcz.sources.text.layout import (
    Layout,
    NumberText,
    PatternRun,
    RowNotes,
    checked_runs,
    checked_texts,
)
from mcz.sources.text.rows import Rows

BEFORE = {b"", *(bytes([c]) for c in b'\t ,;"')}  # of a label in a line, b"" at the line's end
AFTER = {*BEFORE, b"\r", b"\n"}


def names_in(line: bytes, names: Sequence[str]) -> bytes:
    """A line of labels with a mark for each name, as far as the names come in order."""
    out, at = [], 0
    for name in names:
        label = name.encode()
        start = _label_at(line, label, at)
        if start < 0:
            break
        out += [line[at:start], NAME]
        at = start + len(label)
    return b"".join((*out, line[at:]))


def _label_at(line: bytes, label: bytes, at: int) -> int:
    """Offset of ``label`` between separators in ``line`` from ``at`` on, or -1."""
    while (at := line.find(label, at)) >= 0:
        stop = at + len(label)
        if line[max(at - 1, 0) : at] in BEFORE and line[stop : stop + 1] in AFTER:
            return at
        at += 1
    return -1


def named_count(data: bytes, at: int, stop: int, count: tuple[int, int], n_rows: int) -> bytes:
    """The text data[at:stop] with a mark in place of the number of rows at ``count``."""
    if not at < count[0] < count[1] <= stop or data[slice(*count)] != b"%d" % n_rows:
        return data[at:stop]
    return data[at : count[0]] + COUNT + data[count[1] : stop]


def section_of(
    header: tuple[bytes, bytes],
    beside: tuple[bytes, Clock | None],
    rows: Rows,
    names: Sequence[str],
    signals: Sequence[int],
) -> Section:
    """A section of a table whose columns are those of ``signals``.

    ``header``: with marks, and as it is; the second is taken if the first does not give it.
    ``beside``: what stands for a missing value, and the clock.
    """
    marked, whole = with_phrases(header[0]), header[1]
    fits = not any_mark(whole) and _fills(marked, names, b"%d" % rows.n_rows, whole)
    return Section(
        tuple(signals),
        marked if fits else whole,
        fits,
        *beside,
        Layout((), rows.patterns, ending=rows.ending),
    )


def table_source(
    format_name: str, data: bytes, sections: Sequence[tuple[Section, Rows, int]]
) -> Source:
    """The source of a table of sections, each with its rows, so many a frame."""
    template, detail = build_table([section for section, _, _ in sections])
    digest = hashlib.sha256(data).digest()
    notes = table_notes([(n_each, rows.notes) for _, rows, n_each in sections])
    return Source(format_name, template, detail, notes, size=len(data), sha256=digest)


def _fills(header: bytes, names: Sequence[str], count: bytes, whole: bytes) -> bool:
    try:
        return fill(header, names, count) == whole
    except (FormatError, LimitError):
        return False


_POSITIVE = POSITIVE  # TABLE-09


class SectionNotesFields(Record):
    """Frame notes of a section."""

    rows_per_frame: int = field(_POSITIVE, "rows a frame of the section, at least 1")
    patterns: list[PatternRun] = field(
        counted(PatternRun), "patterns of the rows; all rows after them have pattern 0"
    )
    texts: list[NumberText] = field(
        counted(NumberText), "frame numbers that are not printed as the frame's, in plain decimal"
    )


class TableNotesFields(Record):
    """Frame notes of tables."""

    sections: list[SectionNotesFields] = field(
        counted(SectionNotesFields, MAX_SECTIONS), "notes of the first sections, in order"
    )


@dataclass(slots=True)
class SectionNotes:
    """Runs (start, stop, pattern) of rows that have another pattern than 0, and (row, text).

    Both are sorted. Nothing here is as long as there are rows: these may be as many as a hostile
    file says.
    """

    n_each: int
    runs: list[tuple[int, int, int]] = dataclasses.field(default_factory=list)
    texts: list[tuple[int, bytes]] = dataclasses.field(default_factory=list)

    def cut(self, start: int, stop: int) -> SectionNotesFields:
        """The notes of the frames start <= f < stop."""
        first, last = start * self.n_each, stop * self.n_each
        patterns, at = [], first
        for a, b, pattern in self.runs:
            a, b = max(a, first), min(b, last)
            if a < b:
                patterns += [PatternRun(n_rows=a - at, pattern=0)] if a > at else []
                patterns.append(PatternRun(n_rows=b - a, pattern=pattern))
                at = b
        texts, before = [], first
        for row, text in self.texts:
            if first <= row < last:
                texts.append(NumberText(row=row - before, text=text))
                before = row
        return SectionNotesFields(rows_per_frame=self.n_each, patterns=patterns, texts=texts)


@dataclass(frozen=True, slots=True, eq=False)
class TableNotes:
    """The notes of the first sections of a table; all rows of the others are usual."""

    sections: tuple[SectionNotes, ...]

    def cut(self, start: int, stop: int) -> bytes:
        """TABLE_NOTES of the frames start <= f < stop; b"" if all of them are usual."""
        fields = [section.cut(start, stop) for section in self.sections]
        while fields and not (fields[-1].patterns or fields[-1].texts):
            fields.pop()
        return build(TableNotesFields(sections=fields), "source notes") if fields else b""

    def part(self, start: int, stop: int) -> TableNotes:
        """The notes of the frames start <= f < stop alone, numbered from 0."""
        return join_table_notes([(0, stop - start, self.cut(start, stop))])

    def of(self, number: int, n_each: int, n_rows: int) -> RowNotes | None:
        """The notes of a section; FormatError if it has another number of rows a frame."""
        if number >= len(self.sections):
            return None
        section = self.sections[number]
        if section.n_each != n_each:  # TABLE-09
            raise FormatError(
                f"source notes: {section.n_each} rows a frame in section {number} of {n_each}"
            )
        patterns = np.zeros(n_rows, np.int64)
        for start, stop, pattern in section.runs:
            patterns[start:stop] = pattern
        return RowNotes(patterns, tuple(section.texts))


def table_notes(sections: Sequence[tuple[int, RowNotes | None]]) -> TableNotes | None:
    """The notes of sections that have so many rows a frame; None if all is usual."""
    notes_by_section = [_sparse(n_each, notes) for n_each, notes in sections]
    return (
        TableNotes(tuple(notes_by_section))
        if any(s.runs or s.texts for s in notes_by_section)
        else None
    )


def _sparse(n_each: int, notes: RowNotes | None) -> SectionNotes:
    if notes is None:
        return SectionNotes(n_each)
    patterns = notes.patterns
    edges = [0, *(np.flatnonzero(np.diff(patterns)) + 1).tolist(), len(patterns)]
    runs = [(a, b, int(patterns[a])) for a, b in zip(edges, edges[1:], strict=False) if a < b]
    return SectionNotes(n_each, [run for run in runs if run[2]], list(notes.texts))


def join_table_notes(parts: Sequence[tuple[int, int, bytes]]) -> TableNotes:
    """The notes of (start, stop, TABLE_NOTES) parts, the inverse of ``cut``; the rest is usual.

    Raises FormatError if a part is not a TableNotesFields of ``stop - start`` frames.
    """
    joined: list[SectionNotes] = []
    for start, stop, data in sorted(parts):
        if not data:
            continue
        where = f"source notes of frames {start} to {stop}"
        for number, fields in enumerate(parse(TableNotesFields, data, where).sections):
            if number == len(joined):
                joined.append(SectionNotes(fields.rows_per_frame))
            mine = joined[number]
            if mine.n_each != fields.rows_per_frame:  # TABLE-09
                raise FormatError(
                    f"{fields.rows_per_frame} rows a frame, once {mine.n_each}", where=where
                )
            first, n_rows = start * mine.n_each, (stop - start) * mine.n_each
            runs = checked_runs(fields.patterns, n_rows, where)
            mine.runs += [(first + a, first + b, p) for a, b, p in runs if p]
            mine.texts += [(first + r, t) for r, t in checked_texts(fields.texts, n_rows, where)]
    return TableNotes(tuple(joined))
