"""Values, number grids, template, detail and notes -> the text of AMC, BVH or a table.

SPEC.md, "Source reconstruction", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, LimitError
from mcz.kernels import SPARE
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Motion, Signal, Source
from mcz.sources.tables.cells import Cells
from mcz.sources.text.layout import FRAME_NUMBER, Layout, Pattern, parse_layout
from mcz.sources.text.notes import RowNotes

Ints = NDArray[np.int64]

TEXT_LIMIT = 2**26  # a text may always be that large,
TEXT_PER_CELL = 512  # or that large for each row and channel, plus one,
TEXT_PER_SIZE = 4  # but then only so many times the stated size of the source file


def restore(motion: Motion, source: Source) -> bytes:
    """The text that ``source`` and the values of ``motion`` make.

    Rows beyond the notes are laid out as usual. A value that its grid does not have is printed as
    the nearest number of the grid.

    Raises FormatError where the source does not belong to such a motion, and LimitError for a text
    that is larger than the limits above.
    """
    signal = motion.signals[0]
    layout = parse_layout(source.template, source.detail, signal.n_channels)
    limit = text_limit(source, [(signal.n_rows, signal.n_channels)])
    notes = source.notes if isinstance(source.notes, RowNotes) else None
    runs = pattern_runs(layout, notes, signal.n_rows)
    if any_numbers(runs) and signal.samples_per_frame != 1:  # AMC-08
        raise FormatError(f"source template: frame numbers of {signal.samples_per_frame} rows each")
    rows = rows_text(
        signal, layout, notes, numbers_or_rows(motion.frame_numbers, signal.n_rows), limit
    )
    header = layout.header[0]
    if len(layout.header) > 1:
        header = printed_count(layout, signal.n_rows).join(layout.header)
    return b"".join((header, rows))


def printed_count(layout: Layout, n_rows: int) -> bytes:
    """The number of rows as a header prints it."""
    return layout.count if layout.count and layout.rows == n_rows else b"%d" % n_rows  # AMC-06


def text_limit(source: Source, shapes: Sequence[tuple[int, int]]) -> int:
    """Limit in bytes of the rows of tables of these (rows, channels)."""
    limit = max(TEXT_LIMIT, TEXT_PER_CELL * sum(rows * (columns + 1) for rows, columns in shapes))
    return min(limit, max(TEXT_LIMIT, TEXT_PER_SIZE * source.size)) if source.size else limit


def rows_text(
    signal: Signal,
    layout: Layout,
    notes: RowNotes | None,
    numbers: Ints,
    limit: int,
    missing: bytes | None = None,
) -> memoryview:
    """All rows and what follows them; ``signal`` has the columns of the patterns.

    ``numbers`` are the frame numbers of the rows. ``missing``: what stands where the signal is
    invalid, None where that does not matter. Raises as ``restore`` does.
    """
    runs = pattern_runs(layout, notes, signal.n_rows)
    numbered = any_numbers(runs)
    cells = Cells(signal, numbers if numbered else None)
    if numbered and notes is not None:
        texts = [entry for entry in notes.texts if entry[0] < signal.n_rows]  # AMC-06
        rows = np.array([row for row, _ in texts], dtype=np.int64)
        cells.set(rows, np.full_like(rows, -1), [text for _, text in texts])
    if missing is not None and signal.mask is not None:
        cells.set_same(~signal.mask, missing)  # TABLE-04
    return _body(cells, runs, limit, layout.ending)


def any_numbers(runs: Sequence[tuple[Pattern, int, int]]) -> bool:
    """Return True if rows print their frame number."""
    return any(run.column == FRAME_NUMBER for pattern, _, _ in runs for run in pattern.runs)


def pattern_runs(
    layout: Layout, notes: RowNotes | None, n_rows: int
) -> list[tuple[Pattern, int, int]]:
    """(pattern, start, stop) of each run of rows."""
    numbers = np.zeros(n_rows, np.int64)
    if notes is not None:
        numbers[: len(notes.patterns)] = notes.patterns[:n_rows]
    if not n_rows:
        return []
    if numbers.max() >= len(layout.patterns):  # AMC-03
        raise FormatError(f"source notes: pattern {numbers.max()} of {len(layout.patterns)}")
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), n_rows]
    return [(layout.patterns[numbers[a]], a, b) for a, b in pairwise(edges)]


def _body(
    cells: Cells, runs: list[tuple[Pattern, int, int]], limit: int, ending: bytes | None
) -> memoryview:
    """The text of all rows; its size is known before any of it is written.

    ``ending`` stands in place of the last tail, unless it is None.
    """
    from mcz.sources.text import text_kernels

    texts = cells.texts()
    arrays = {id(pattern): pattern.arrays() for pattern, _, _ in runs}
    size = 0
    for pattern, a, b in runs:
        size += text_kernels.measure_rows(
            arrays[id(pattern)], pattern.gap_size, texts, cells.start[a:b], cells.size[a:b]
        )
    if size > limit:  # AMC-07, LIMIT-12
        raise LimitError(f"source template: a text of {size} bytes, limit {limit}")
    out = np.empty(size + len(ending or b"") + SPARE, np.uint8)
    at = 0
    for pattern, a, b in runs:
        at = text_kernels.fill_rows(
            out, at, arrays[id(pattern)], texts, cells.start[a:b], cells.size[a:b]
        )
    text = out.data
    if ending is None:
        return text[:size]
    at -= len(runs[-1][0].tail) if runs else 0
    text[at : at + len(ending)] = ending  # AMC-06
    return text[: at + len(ending)]
