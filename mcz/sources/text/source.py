"""Sources of text files and tables: their encoding, and the Source that restores them.

The header of a table is stored with marks if these give the same bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, LimitError, SourceError
from mcz.model.motion import Skeleton, Source
from mcz.model.numbers import values_of_texts
from mcz.model.schema import POSITIVE, Record, build, counted, parse
from mcz.model.schema import field as record_field
from mcz.model.text_format import quote
from mcz.sources.tables.layout import (
    COUNT,
    MAX_SECTIONS,
    NAME,
    Clock,
    Section,
    build_table,
    fill_marks,
    has_mark,
    mark_phrases,
)
from mcz.sources.text.layout import (
    FrameLayout,
    NumberText,
    PatternRun,
    RowNotes,
    parse_runs,
    parse_texts,
)
from mcz.sources.text.rows import TokenRows

BOM = b"\xef\xbb\xbf"  # U+FEFF in UTF-8: it may stand at the start of a file, and says nothing
OTHERS = {  # how files of other encodings begin, longer marks first
    b"\xff\xfe\0\0": "UTF-32",
    b"\0\0\xfe\xff": "UTF-32",
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
}
LOOKED_AT = 64  # bytes in which every other one of UTF-16 is zero


def text_encoding(data: bytes) -> str:
    """ "utf-8" if all of ``data`` is, otherwise "latin-1", which every byte string is."""
    if data.isascii():
        return "utf-8"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _wide_encoding(data: bytes) -> str | None:
    for mark, name in OTHERS.items():
        if data.startswith(mark):
            return name
    start = data[:LOOKED_AT]
    for low, high in ((start[::2], start[1::2]), (start[1::2], start[::2])):
        if len(high) > 7 and not any(high) and 0 not in low:
            return "UTF-16 without a byte order mark"
    return None


def text_start(data: bytes) -> int:
    """Offset of the text, after a UTF-8 byte order mark if there is one."""
    return len(BOM) if data.startswith(BOM) else 0


def check_text(data: bytes) -> None:
    """Raise SourceError for UTF-16 and UTF-32, whose bytes no template restores."""
    wide = _wide_encoding(data)
    if wide is not None:
        raise SourceError(f"the text is {wide}; save it as UTF-8 or ASCII", line=1)


def check_first_line(data: bytes, ignored: tuple[bytes, ...]) -> None:
    """Raise SourceError if a byte order mark hides a line that means something.

    ``ignored``: how lines begin that do not. In an ASF or AMC the mark belongs to the first word,
    for every reader, as the skeleton of a file is compared with what its ASF describes.
    """
    line = data[len(BOM) :].split(b"\n", 1)[0].strip().lower()
    if data.startswith(BOM) and line and not line.startswith(ignored):
        raise SourceError(
            f"a UTF-8 byte order mark precedes {quote(line)}; save the file without it", line=1
        )


def source_of(
    format_name: str, data: bytes, header: tuple[bytes, ...], rows: TokenRows, count: bytes = b""
) -> Source:
    """The source of a file that was read as ``header`` and ``rows``; ``count``: as printed."""
    usual = count in (b"", b"%d" % rows.n_rows)
    layout = FrameLayout(
        header, rows.patterns, b"" if usual else count, 0 if usual else rows.n_rows, rows.ending
    )
    template, detail = layout.build()
    digest = hashlib.sha256(data).digest()
    return Source(format_name, template, detail, rows.notes, size=len(data), sha256=digest)


MOST_JOINTS = 2**18
MOST_CHANNELS = 2**20
MOST_DEPTH = 4096


def check_count(noun: str, number: int, most: int) -> None:
    """Raise SourceError if a skeleton has more than it may have of ``noun``."""
    if number > most:
        raise SourceError(f"more than {most:,} {noun}, the limit of a stored skeleton")


Floats = NDArray[np.float64]
Frame = tuple[int | None, Floats]  # its number, None if the text has none, and (n_channels,)


@dataclass(frozen=True, slots=True)
class Arriving:
    """The header of a motion, read up to its first frame, and all of its frames in order.

    Values are NaN if the text has none. ``declared`` is how many frames the header says there
    are, None if it says nothing that is a number. ``frames`` raises SourceError, with the number
    of the line, at text that is none of the format.
    """

    skeleton: Skeleton
    frames: Iterator[Frame]
    frame_rate: Fraction | None = None
    frame_rate_exact: bool = True
    metadata: Mapping[str, str] = field(default_factory=dict)
    first_number: int = 1
    declared: int | None = None


class Lines:
    """Lines as they are read, and the number of the last."""

    def __init__(self, lines: Iterator[bytes]) -> None:
        self._lines = lines
        self.number = 0

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        line = next(self._lines)
        self.number += 1
        return line

    def error(self, message: str) -> SourceError:
        return SourceError(message, line=max(1, self.number))

    def numbers(self, texts: Sequence[bytes]) -> Floats:
        """The values of the words of the last line, or of those that end with it."""
        values, bad = values_of_texts(texts)
        if bad.any():
            raise self.error(f"{quote(texts[int(np.argmax(bad))])} is not a number")
        return values


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
    rows: TokenRows,
    names: Sequence[str],
    signals: Sequence[int],
) -> Section:
    """A section of a table whose columns are those of ``signals``.

    ``header``: with marks, and as it is; the second is taken if the first does not give it.
    ``beside``: what stands for a missing value, and the clock.
    """
    marked, whole = mark_phrases(header[0]), header[1]
    fits = not has_mark(whole) and _fills(marked, names, b"%d" % rows.n_rows, whole)
    return Section(
        tuple(signals),
        marked if fits else whole,
        fits,
        *beside,
        FrameLayout((), rows.patterns, ending=rows.ending),
    )


def table_source(
    format_name: str, data: bytes, sections: Sequence[tuple[Section, TokenRows, int]]
) -> Source:
    """The source of a table of sections, each with its rows, so many a frame."""
    template, detail = build_table([section for section, _, _ in sections])
    digest = hashlib.sha256(data).digest()
    notes = table_notes([(n_each, rows.notes) for _, rows, n_each in sections])
    return Source(format_name, template, detail, notes, size=len(data), sha256=digest)


def _fills(header: bytes, names: Sequence[str], count: bytes, whole: bytes) -> bool:
    try:
        return fill_marks(header, names, count) == whole
    except (FormatError, LimitError):
        return False


_POSITIVE = POSITIVE  # TABLE-09


class SectionNotesFields(Record):
    """Frame notes of a section."""

    rows_per_frame: int = record_field(_POSITIVE, "rows a frame of the section, at least 1")
    patterns: list[PatternRun] = record_field(
        counted(PatternRun), "patterns of the rows; all rows after them have pattern 0"
    )
    texts: list[NumberText] = record_field(
        counted(NumberText), "frame numbers that are not printed as the frame's, in plain decimal"
    )


class TableNotesFields(Record):
    """Frame notes of tables."""

    sections: list[SectionNotesFields] = record_field(
        counted(SectionNotesFields, MAX_SECTIONS), "notes of the first sections, in order"
    )


@dataclass(slots=True)
class SectionNotes:
    """Runs (start, stop, pattern) of rows that have another pattern than 0, and (row, text).

    Both are sorted. Nothing here is as long as there are rows: these may be as many as a hostile
    file says.
    """

    n_each: int
    runs: list[tuple[int, int, int]] = field(default_factory=list)
    texts: list[tuple[int, bytes]] = field(default_factory=list)

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
            runs = parse_runs(fields.patterns, n_rows, where)
            mine.runs += [(first + a, first + b, p) for a, b, p in runs if p]
            mine.texts += [(first + r, t) for r, t in parse_texts(fields.texts, n_rows, where)]
    return TableNotes(tuple(joined))
