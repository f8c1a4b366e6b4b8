"""Signals, template, detail and notes -> the text of a table.

SPEC.md, "The text of tables", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcz.errors import FormatError
from mcz.formats.restore import numbers_of, printed_count, rows_text
from mcz.formats.table_layout import Clock, fill, parse_table
from mcz.motion import Exceptions, Motion, Signal


def restore_table(motion: Motion) -> bytes:
    """The text that the source and all signals of ``motion`` make.

    Raises FormatError where the source does not belong to such a motion, and LimitError for a text
    beyond the limits of ``restore``.
    """
    source = motion.source
    assert source is not None
    if any(signal.samples_per_frame != 1 for signal in motion.signals):  # TABLE-06
        raise FormatError("source template: a table has one row a frame in every signal")
    signal = beside(motion.signals)
    layout = parse_table(source.template, source.detail, signal.n_channels)
    if layout.clock is not None:
        signal = _with_clock(signal, layout.clock, numbers_of(motion, motion.n_frames).tolist())
    rows = rows_text(motion, source, signal, layout.rows, layout.missing)
    header = layout.header
    if layout.marked:
        names = [joint.name for joint in motion.skeleton.joints]
        header = fill(header, names, printed_count(layout.rows, signal.n_rows))
    return header + rows


def beside(signals: Sequence[Signal]) -> Signal:
    """One signal that has the channels of all, one signal behind the other."""
    if len(signals) == 1:
        return signals[0]
    starts = np.cumsum([0, *(signal.n_channels for signal in signals)])[:-1].tolist()
    placed = list(zip(starts, signals, strict=True))
    masks = [np.ones(s.values.shape, np.bool_) if s.mask is None else s.mask for s in signals]
    mask = np.hstack(masks)
    return Signal(
        np.hstack([signal.values.astype(np.float64, copy=False) for signal in signals]),
        tuple(grid for signal in signals for grid in signal.grids),
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


def _with_clock(signal: Signal, clock: Clock, numbers: Sequence[int]) -> Signal:
    """``signal`` with the times of the clock as its last column."""
    ordinals = np.array(clock.ordinals(numbers), np.int64).reshape(-1, 1)
    mask = signal.mask
    if mask is not None:
        mask = np.hstack([mask, np.ones((len(mask), 1), np.bool_)])
    return Signal(
        np.hstack([signal.values, clock.grid.values(ordinals)]),
        (*signal.grids, clock.grid),
        mask=mask,
        exceptions=signal.exceptions,
        grid_changes=signal.grid_changes,
    )
