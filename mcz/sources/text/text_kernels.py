"""Compiled loops of ``rows`` and ``restore``; imported on first use.

Blanks are the bytes up to 0x20.
"""

from __future__ import annotations

from mcz.kernels import eight_bytes, kernel, put_eight_bytes, trailing_zeros
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2
from mcz.model.numbers.decimal_kernels import length, put
from mcz.model.numbers.token_kernels import put_value
from mcz.sources.text import BLANKS, FREE, MARKUP, WORDS, Items

BLANK, QUOTE, COMMA, SEMICOLON, LESS = 0x20, 0x22, 0x2C, 0x3B, 0x3C
MINUS, PLUS, HASH, ZERO, NINE, LF = 0x2D, 0x2B, 0x23, 0x30, 0x39, 0x0A


def _is_at(text: Bytes, at: int, gaps: Bytes, start: int, stop: int) -> bool:
    """Return True if gaps[start:stop] is at ``at``."""
    if at + stop - start > len(text):
        return False
    for k in range(start, stop):
        if text[at + k - start] != gaps[k]:
            return False
    return True


def _token_end(text: Bytes, at: int, cells: int) -> int:
    if cells == WORDS:
        while at + 8 <= len(text):
            word = eight_bytes(text, at)
            others = word ^ -1
            blanks = word - 0x0021212121212121 & others & 0x0080808080808080  # seven bytes at once
            if blanks:
                return at + (trailing_zeros(blanks) >> 3)
            at += 7
        while at < len(text) and text[at] > BLANK:
            at += 1
        return at
    if cells == MARKUP:
        while at < len(text) and text[at] > BLANK and text[at] != QUOTE and text[at] != LESS:
            at += 1
        return at
    while at < len(text):
        byte = text[at]
        if byte <= BLANK or byte == COMMA or byte == SEMICOLON or byte == QUOTE:
            break
        at += 1
    return at


def _blanks(text: Bytes, at: int) -> int:
    """Count the 0x20 bytes at ``at``."""
    start = at
    while at < len(text) and text[at] == BLANK:
        at += 1
    return at - start


def _number(text: Bytes, start: int, stop: int) -> int:
    """The plain decimal integer text[start:stop]; -1 for other text."""
    if stop == start or stop - start > 15 or (text[start] == ZERO and stop > start + 1):
        return -1
    value = 0
    for k in range(start, stop):
        if text[k] < ZERO or text[k] > NINE:
            return -1
        value = value * 10 + (int(text[k]) - ZERO)
    return value


def _begins_frame(text: Bytes, at: int) -> bool:
    """Return True if a line with one integer, or the end, follows at ``at``."""
    while at < len(text) and text[at] <= BLANK:
        at += 1
    if at == len(text):
        return True
    digits = at
    while at < len(text) and ZERO <= text[at] <= NINE:
        at += 1
    if at == digits:
        return False
    while at < len(text) and text[at] <= BLANK and text[at] != LF:
        at += 1
    return at == len(text) or text[at] == LF


def _match_token(text: Bytes, at: int, width: int, cells: int) -> tuple[int, int, int]:
    """Start and stop of the token at ``at`` and the offset after its padding; start -1: none.

    A cell may be empty.
    """
    fail = (-1, -1, -1)
    blanks = 0
    if width > 0:
        blanks = _blanks(text, at)
        at += blanks
    stop = _token_end(text, at, cells)
    if cells == WORDS and (stop == at or text[at] == HASH):
        return fail
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


def _match_row(
    text: Bytes, at: int, items: Items, start: Ints, stop: Ints, cells: int
) -> tuple[int, int]:
    """The offset after a row of the pattern at ``at`` and its frame number; offset -1: no match.

    Fills ``start`` and ``stop`` (n_columns,) of its tokens.
    """
    gaps, gap_start, gap_stop, columns, widths = items
    number = 0
    for k in range(len(columns)):
        if not _is_at(text, at, gaps, gap_start[k], gap_stop[k]):
            return -1, 0
        first, last, at = _match_token(text, at + gap_stop[k] - gap_start[k], widths[k], cells)
        if first < 0 or (first == last and cells < (FREE if k == 0 else BLANKS)):
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
def match_rows(
    text: Bytes,
    at: int,
    items: Items,
    row: int,
    start: Ints2,
    stop: Ints2,
    numbers: Ints,
    cells: int,
) -> tuple[int, int]:
    """Match as many rows of one pattern as possible from offset ``at`` and row ``row`` on.

    ``cells`` defines tokens. ``WORDS``: a token ends at a blank. ``MARKUP``: also at a quote or
    tag. Both are never empty. Tables: a token ends at a blank, separator or quote; ``FULL``: none
    is empty, ``BLANKS``: all but the first may be, ``FREE``: all may be. Fills ``start`` and
    ``stop`` (n_rows, n_columns) and ``numbers`` (n_rows,). Returns the row and the offset of the
    first row that does not match, or for which there is no room.
    """
    columns = items.columns
    numbered = cells == WORDS and len(columns) > 0 and columns[0] == -1
    while row < len(numbers):
        end, number = _match_row(text, at, items, start[row], stop[row], cells)
        if end <= at or (numbered and not _begins_frame(text, end)):
            break
        numbers[row] = number
        at = end
        row += 1
    return row, at


def _pad(first: int, size: int, width: int) -> int:
    """Blanks beside a token of ``size`` bytes that begins with ``first``."""
    if width == 1:
        return 0 if first == MINUS or first == PLUS else 1  # AMC-06
    return max(0, abs(width) - size)


@kernel
def measure_rows(items: Items, gap_size: int, texts: Bytes, start: Ints2, size: Ints2) -> int:
    """Bytes of rows of one pattern whose gaps and tail take ``gap_size``; see ``fill_rows``."""
    columns, widths = items.columns, items.widths
    total = gap_size * len(start)
    for row in range(start.shape[0]):
        for k in range(len(columns)):
            column = columns[k] if columns[k] >= 0 else start.shape[1] - 1
            total += int(size[row, column])
            if widths[k]:
                total += int(_pad(texts[start[row, column]], size[row, column], widths[k]))
    return total


def _copy(source: Bytes, first: int, count: int, out: Bytes, at: int) -> int:
    """Copy bytes, up to seven more than are counted, and return where they end."""
    for k in range(0, count, 8):
        put_eight_bytes(out, at + k, eight_bytes(source, first + k))
    return at + count


@kernel
def fill_rows(out: Bytes, at: int, items: Items, texts: Bytes, start: Ints2, size: Ints2) -> int:
    """Write rows of one pattern to ``out`` from ``at`` on; returns the offset after them.

    The token of ``row`` and ``column`` is texts[start[row, column]:][:size[row, column]]; column -1
    stands for the last one, which holds the frame numbers. Texts, gaps and ``out`` have
    ``SPARE`` bytes more than are read or written.
    """
    gaps, gap_start, gap_stop, columns, widths = items
    n_items = len(columns)
    for row in range(start.shape[0]):
        for k in range(n_items + 1):
            at = _copy(gaps, gap_start[k], gap_stop[k] - gap_start[k], out, at)
            if k == n_items:
                break
            column = columns[k] if columns[k] >= 0 else start.shape[1] - 1
            first, count, width = start[row, column], size[row, column], widths[k]
            pad = _pad(texts[first], count, width) if width else 0
            if width > 0:  # AMC-06
                out[at : at + pad] = BLANK
                at += pad
            at = _copy(texts, first, count, out, at)
            if width < 0:  # AMC-06
                out[at : at + pad] = BLANK
                at += pad
    return at


@kernel
def print_rows(
    values: Floats2,
    numbers: Ints,
    rules: Ints2,
    tens: Floats,
    powers: Floats,
    items: Items,
    out: Bytes,
) -> tuple[int, int]:
    """Write rows of one pattern without padded columns to ``out``; returns rows and bytes written.

    ``rules``, ``tens`` and ``powers`` are those of ``token_kernels.print_rows``; ``numbers`` are
    the frame numbers. Stops at a row with a value that ``print_rows`` skips. Gaps and ``out`` have
    ``SPARE`` bytes more than are read or written.
    """
    gaps, gap_start, gap_stop, columns, _ = items
    at = 0
    for row in range(len(values)):
        first = at
        for k in range(len(columns)):
            at = _copy(gaps, gap_start[k], gap_stop[k] - gap_start[k], out, at)
            if columns[k] < 0:
                number = abs(numbers[row])
                at = put(numbers[row] < 0, number, length(number), 0, (0, -99, 99, 0), out, at)
                continue
            end = put_value(values[row, columns[k]], rules[columns[k]], tens, powers, out, at)
            if end < 0:
                return row, first
            at = end
        tail = len(columns)
        at = _copy(gaps, gap_start[tail], gap_stop[tail] - gap_start[tail], out, at)
    return len(values), at
