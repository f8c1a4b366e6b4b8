"""The compiled loop that matches rows of a table; imported on first use.

It differs from that of ``text_kernels`` in what a token is: it ends at a separator too, and may be
empty, which a blank cell is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.formats.layout import Items
from mcz.formats.text_kernels import MINUS, PLUS, _blanks, _is_at, _number
from mcz.jit import kernel

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

BLANK, QUOTE, COMMA, SEMICOLON = 0x20, 0x22, 0x2C, 0x3B


@kernel
def _cell_end(text: Bytes, at: int) -> int:
    while at < len(text):
        byte = text[at]
        if byte <= BLANK or byte == COMMA or byte == SEMICOLON or byte == QUOTE:
            break
        at += 1
    return at


@kernel
def _match_cell(text: Bytes, at: int, width: int) -> tuple[int, int, int]:
    """Start and stop of the cell at ``at`` and the offset after its padding; start -1: none."""
    fail = (-1, -1, -1)
    blanks = 0
    if width > 0:
        blanks = _blanks(text, at)
        at += blanks
    stop = _cell_end(text, at)
    if width == 0:
        return at, stop, stop
    size = stop - at
    if width == 1:
        signed = size > 0 and (text[at] == MINUS or text[at] == PLUS)
        return (at, stop, stop) if blanks == (0 if signed else 1) else fail
    if width > 1:
        return (at, stop, stop) if blanks == max(0, width - size) else fail
    pad = max(0, -width - size)
    return (at, stop, stop + pad) if _blanks(text, stop) >= pad else fail


@kernel
def _match_row(
    text: Bytes, at: int, items: Items, start: Ints, stop: Ints, blanks: int
) -> tuple[int, int]:
    """The offset after a row of the pattern at ``at`` and its frame number; offset -1: no match.

    Fills ``start`` and ``stop`` (n_columns,) of its tokens. Where ``blanks`` is 0 no cell is empty,
    where it is 1 the first is not.
    """
    gaps, gap_start, gap_stop, columns, widths = items
    number = 0
    for k in range(len(columns)):
        if not _is_at(text, at, gaps, gap_start[k], gap_stop[k]):
            return -1, 0
        first, last, at = _match_cell(text, at + gap_stop[k] - gap_start[k], widths[k])
        if first < 0 or (first == last and blanks < (2 if k == 0 else 1)):
            return -1, 0
        if columns[k] >= 0:
            start[columns[k]] = first
            stop[columns[k]] = last
        else:
            number = _number(text, first, last)
            if number < 0:
                return -1, 0
    tail = len(columns)
    if not _is_at(text, at, gaps, gap_start[tail], gap_stop[tail]):
        return -1, 0
    return at + gap_stop[tail] - gap_start[tail], number


@kernel
def match_cells(
    text: Bytes,
    at: int,
    items: Items,
    row: int,
    start: Ints,
    stop: Ints,
    numbers: Ints,
    blanks: int,
) -> tuple[int, int]:
    """As ``text_kernels.match_rows``, of a table.

    ``blanks``: 1 where cells may be empty, 2 where the first may, too.
    """
    while row < len(numbers):
        end, number = _match_row(text, at, items, start[row], stop[row], blanks)
        if end <= at:
            break
        numbers[row] = number
        at = end
        row += 1
    return row, at
