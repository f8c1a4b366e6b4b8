"""Signals, template, detail and notes -> the text of a table.

SPEC.md, "The text of tables", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Exceptions, Motion, Signal
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Ints
from mcz.sources.restore import printed_count, text_limit, write_rows
from mcz.sources.tables.layout import Section, fill, parse_sections
from mcz.sources.tables.source import TableNotes

INTEGERS = Grid(GridKind.FIXED)


def restore_table(motion: Motion) -> bytes:
    """The text that the source and all signals of ``motion`` make.

    Raises FormatError where the source does not belong to such a motion, and LimitError for a text
    beyond the limits of ``restore``.
    """
    source, signals = motion.source, motion.signals
    assert source is not None
    sizes = [signal.n_channels for signal in signals]
    sections = parse_sections(source.template, source.detail, sizes)
    notes = source.notes if isinstance(source.notes, TableNotes) else TableNotes(())
    if len(notes.sections) > len(sections):  # TABLE-09
        raise FormatError(
            f"source notes for {len(notes.sections)} sections, the template has {len(sections)}"
        )
    tables = [_section_table(motion, section) for section in sections]
    limit = text_limit(source, [table.values.shape for table, _ in tables])
    names = [joint.name for joint in motion.skeleton.joints]
    out = BytesIO()
    for k, (section, (table, numbers)) in enumerate(zip(sections, tables, strict=True)):
        mine = notes.of(k, table.samples_per_frame, table.n_rows)
        header = section.header
        if section.marked:
            header = fill(header, names, printed_count(section.rows, table.n_rows))
        out.write(header)
        begin = out.tell()
        write_rows(out, table, section.rows, mine, numbers, limit, section.missing)
        limit -= out.tell() - begin
    return out.getvalue()


def _section_table(motion: Motion, section: Section) -> tuple[Signal, Ints]:
    """The columns of a section, and the number of the frame of each row."""
    signals = [motion.signals[number] for number in section.signals]
    n_each = signals[0].samples_per_frame
    if any(signal.samples_per_frame != n_each for signal in signals):  # TABLE-06
        raise FormatError("source template: signals of a section differ in their rows a frame")
    signal = join_signals(signals)
    frame, within = np.divmod(np.arange(signal.n_rows), n_each)
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)[frame]
    more, grids = [], []
    if section.clock is not None:
        counted = [n * n_each + k for n, k in zip(numbers.tolist(), within.tolist(), strict=True)]
        ordinals = np.array(section.clock.ordinals(counted), np.int64)
        more.append(section.clock.grid.values(ordinals))
        grids.append(section.clock.grid)
    last = signal.n_channels + len(more)
    runs = (run for pattern in section.rows.patterns for run in pattern.runs)
    if any(run.column + run.n_columns > last for run in runs):
        more.append(within.astype(np.float64))
        grids.append(INTEGERS)
    return _with_columns(signal, more, grids), numbers


def join_signals(signals: Sequence[Signal]) -> Signal:
    """One signal with the channels of all, in order."""
    if len(signals) == 1:
        return signals[0]
    starts = np.cumsum([0, *(signal.n_channels for signal in signals)])[:-1].tolist()
    placed = list(zip(starts, signals, strict=True))
    masks = [np.ones(s.values.shape, np.bool_) if s.mask is None else s.mask for s in signals]
    mask = np.hstack(masks)
    return Signal(
        np.hstack([signal.values.astype(np.float64, copy=False) for signal in signals]),
        tuple(grid for signal in signals for grid in signal.grids),
        samples_per_frame=signals[0].samples_per_frame,
        mask=None if mask.all() else mask,
        exceptions=_exceptions(placed),
        grid_changes=tuple(
            (row, at + channel, grid)
            for at, signal in placed
            for row, channel, grid in signal.grid_changes
        ),
    )


def _exceptions(placed: Sequence[tuple[int, Signal]]) -> Exceptions:
    rows = np.concatenate([signal.exceptions.rows for _, signal in placed])
    channels = np.concatenate([signal.exceptions.channels + at for at, signal in placed])
    texts = [text for _, signal in placed for text in signal.exceptions.texts]
    order = np.lexsort((channels, rows))
    return Exceptions(rows[order], channels[order], tuple(texts[k] for k in order.tolist()))


def _with_columns(
    signal: Signal, more: Sequence[NDArray[np.float64]], grids: Sequence[Grid]
) -> Signal:
    """``signal`` with more columns after its own."""
    if not more:
        return signal
    mask = signal.mask
    if mask is not None:
        mask = np.hstack([mask, np.ones((len(mask), len(more)), np.bool_)])
    return Signal(
        np.column_stack([signal.values, *more]),
        (*signal.grids, *grids),
        samples_per_frame=signal.samples_per_frame,
        mask=mask,
        exceptions=signal.exceptions,
        grid_changes=signal.grid_changes,
    )
