"""Compiled: the post filter of rows that lie between 12 others on each side.

SPEC.md, "Post filter", is normative: binary64, one operation at a time, in the order below. The
loops inside run over channels. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Floats, Floats2, Ints

SIDE = 12  # rows on each side
FAR = 2.0**40  # a number that is not nearer to 0 is taken for unknown (FILT-05)


@kernel
def filter_middle(
    rows: Floats2, past: Floats2, bank: Floats2, low: float, high: float, out: Floats2
) -> None:
    """Fill ``out``, (n, n_channels), with the filtered rows 12 to n + 11 of ``rows``.

    ``rows`` (n + 24, n_channels); ``past`` (3, n_channels), the filtered rows before, latest first,
    is carried on; ``bank`` (13, 3) has a column a filter; ``low`` and ``high`` are the thresholds.
    """
    n_channels = rows.shape[1]
    choice, total = np.empty(n_channels, np.int64), np.empty(n_channels)
    patched = np.empty((2 * SIDE + 1, n_channels))
    last_gap = -1  # the last row in which a number is unknown
    for row in range(2 * SIDE):
        if _has_gap(rows[row]):
            last_gap = row
    for n in range(len(out)):
        if _has_gap(rows[n + 2 * SIDE]):
            last_gap = n + 2 * SIDE
        window = rows[n : n + 2 * SIDE + 1]
        _choose(window, past, low, high, choice)
        if last_gap >= n:
            _patch(window, patched)
            _sum(patched, bank, choice, total)
        else:
            _sum(window, bank, choice, total)
        for c in range(n_channels):
            middle = window[SIDE, c]
            filtered = middle + total[c]
            out[n, c] = filtered if abs(middle) < FAR else middle  # FILT-05
            past[2, c] = past[1, c]
            past[1, c] = past[0, c]
            past[0, c] = filtered


def _has_gap(row: Floats) -> bool:
    n_unknown = 0
    for c in range(len(row)):
        n_unknown += not abs(row[c]) < FAR
    return n_unknown > 0


def _choose(window: Floats2, past: Floats2, low: float, high: float, choice: Ints) -> None:
    """Choose the filter of each channel; fill ``past`` at the start of a run."""
    for c in range(window.shape[1]):
        here, before = window[SIDE, c], window[SIDE - 1, c]
        if not abs(before) < FAR:
            before = past[0, c] = past[1, c] = past[2, c] = here
        speed = past[0, c] - past[1, c]
        gain = speed - (past[1, c] - past[2, c])  # FILT-08
        error = abs(((before + speed) + gain / 2.0) - here)  # FILT-08
        choice[c] = 0 if error <= low else (1 if error <= high else 2)  # FILT-08


def _patch(window: Floats2, patched: Floats2) -> None:
    """``window`` with the first and the last number of the run of its middle repeated outwards."""
    n_channels = window.shape[1]
    inside = np.empty(n_channels)
    patched[SIDE] = window[SIDE]
    for step in (-1, 1):
        inside[:] = 1.0
        for k in range(1, SIDE + 1):
            row, nearer = SIDE + step * k, SIDE + step * (k - 1)
            for c in range(n_channels):
                inside[c] = inside[c] if abs(window[row, c]) < FAR else 0.0
                patched[row, c] = window[row, c] if inside[c] else patched[nearer, c]  # FILT-06


def _sum(window: Floats2, bank: Floats2, choice: Ints, total: Floats) -> None:
    """Compute the correction of each channel's filter to the middle of ``window``."""
    total[:] = 0.0
    middle = window[SIDE]
    for k in range(1, SIDE + 1):  # FILT-02
        before, after = window[SIDE - k], window[SIDE + k]
        first, second, third = bank[k, 0], bank[k, 1], bank[k, 2]
        for c in range(len(total)):
            tap = first if choice[c] == 0 else (second if choice[c] == 1 else third)
            total[c] += tap * ((before[c] - middle[c]) + (after[c] - middle[c]))  # FILT-02
