"""Compiled: vectors of few coefficients that are not zero, by two prefix codes.

SPEC.md, "Sparse lists", is normative and has the steps below in the same order. One function
serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding.huffman import DIRECT, MAX_LENGTH
from mcz.codecs.coding.residuals import bits
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2

MAX_INDEX = 1 << 40
AT, WRITING = 0, 1  # of a coder
FAULT = -1

# Rows of a table: of each symbol its code and length; of each length its first code, how many
# there are, and where its symbols begin among all in order.
CODES, LENGTHS, SYMBOLS, FIRSTS, COUNTS, ENTRIES, TABLE_ROWS = range(7)


@kernel
def code_vectors(
    coder: Ints, data: Bytes, rows: Ints2, starts: Ints, gaps: Ints2, values: Ints2
) -> int:
    """Code ``rows`` (n_rows, n) in place; return the row of a fault, or -1.

    Each row has a vector from each of ``starts`` to the next, the last of which is n.
    """
    for r in range(len(rows)):
        for m in range(len(starts) - 1):
            if _code_vector(coder, data, rows[r, starts[m] : starts[m + 1]], gaps, values):
                return r
    return -1


def _code_vector(coder: Ints, data: Bytes, row: Ints, gaps: Ints2, values: Ints2) -> int:
    n, count = len(row), 0
    for value in row:
        count += 1 if value != 0 else 0
    count = _code_bits(coder, data, count, bits(n))  # SPARSE-01
    at = 0
    for _ in range(count):
        gap = 0
        while at + gap < n and row[at + gap] == 0:
            gap += 1
        gap = _code_integer(coder, data, gap, gaps)
        if gap < 0 or gap >= n - at:  # SPARSE-02
            return 1
        at += gap
        size = _code_integer(coder, data, max(abs(row[at]) - 1, 0), values) + 1
        if size < 1 or size > MAX_INDEX:  # SPARSE-03
            return 1
        negative = _code_bits(coder, data, 1 if row[at] < 0 else 0, 1)
        row[at] = -size if negative else size  # SPARSE-01
        at += 1  # SPARSE-01
    return 0


def _code_integer(coder: Ints, data: Bytes, value: int, table: Ints2) -> int:
    """Code the class of an integer, then the bits that the class leaves open; FAULT if none."""
    symbol = value
    if value >= DIRECT:
        n = bits(value)
        symbol = DIRECT + 2 * (n - 5) + (value >> (n - 2) & 1)
    symbol = _code_symbol(coder, data, symbol, table)
    if symbol < DIRECT:
        return symbol
    more = (symbol - DIRECT) // 2 + 3  # PREFIX-01
    return (2 | symbol & 1) << more | _code_bits(coder, data, value, more)  # PREFIX-01


def _code_symbol(coder: Ints, data: Bytes, symbol: int, table: Ints2) -> int:
    if coder[WRITING]:
        _code_bits(coder, data, table[CODES, symbol], table[LENGTHS, symbol])
        return symbol
    code = 0
    for length in range(1, MAX_LENGTH + 1):
        code = code << 1 | _code_bits(coder, data, 0, 1)
        number = code - table[FIRSTS, length]
        if 0 <= number < table[COUNTS, length]:
            return int(table[SYMBOLS, table[ENTRIES, length] + number])  # PREFIX-02
    return FAULT  # PREFIX-03


def _code_bits(coder: Ints, data: Bytes, value: int, n_bits: int) -> int:
    """Code the low ``n_bits`` of ``value``, the highest first.

    SPEC.md, "Bits", is normative. A coder is an array of two, the position in bits and whether it
    encodes. Bits after the end of ``data`` are counted, and read as 0: the caller compares sizes.
    """
    at = coder[AT]
    coder[AT] = at + n_bits
    out = 0
    for shift in range(n_bits - 1, -1, -1):
        index = at >> 3
        mask = 128 >> (at & 7)  # BITS-01
        at += 1
        bit = 0
        if coder[WRITING]:
            bit = value >> shift & 1
            if bit and index < len(data):
                data[index] |= mask
        elif index < len(data) and data[index] & mask:
            bit = 1
        out = out << 1 | bit  # BITS-01
    return out
