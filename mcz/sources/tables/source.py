"""The Source of a table that was read, its header with marks where these give the same bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from mcz.errors import FormatError, LimitError
from mcz.model.motion import Source
from mcz.sources.tables.layout import (
    COUNT,
    NAME,
    Clock,
    Section,
    any_mark,
    build_table,
    fill,
    with_phrases,
)
from mcz.sources.tables.notes import table_notes
from mcz.sources.text.layout import Layout
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

    ``header``: with marks, and as it is; the second is taken where the first does not give it.
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
