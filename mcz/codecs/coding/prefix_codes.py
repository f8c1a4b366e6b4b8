"""Canonical prefix codes after Huffman, integers in classes with such codes, and sparse lists.

SPEC.md, "Prefix codes" and "Sparse lists", is normative; names of fields are its own. Sparse lists
are vectors of few coefficients that are not zero, by two prefix codes in the header of a clip; one
compiled function encodes and decodes them. Source: D. A. Huffman, A method for the construction
of minimum-redundancy codes, 1952; lengths limited by package-merge (Larmore and Hirschberg, 1990).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from construct import If, Int8ul, this

from mcz.codecs.coding.residuals import bits
from mcz.errors import FormatError
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2
from mcz.model.schema import Checked, Record, counted, field, one_of

MAX_LENGTH = 15  # SPACE-13
DIRECT = 16  # integers below it are classes of their own
N_CLASSES = 90  # up to 2^41 (SPACE-14)


def class_of(value: int) -> tuple[int, int]:
    """The class of an integer from 0 to 2^41 - 1, and how many of its low bits follow it.

    >>> class_of(3), class_of(16), class_of(24), class_of(2**41 - 1)
    ((3, 0), (16, 3), (17, 3), (89, 39))
    """
    if value < DIRECT:
        return value, 0
    n = value.bit_length()
    return DIRECT + 2 * (n - 5) + (value >> (n - 2) & 1), n - 2


def code_lengths(counts: Sequence[int]) -> list[int]:
    """The length of each symbol's code, 0 if its count is 0, at most ``MAX_LENGTH``.

    The code is the shortest one of such lengths. If one symbol occurs alone, its length is 1.

    >>> code_lengths([5, 0, 1, 1])
    [1, 0, 2, 2]
    """
    used = [symbol for symbol, count in enumerate(counts) if count]
    lengths = [0] * len(counts)
    if len(used) == 1:
        lengths[used[0]] = 1
        return lengths
    # A package is its weight and how often each symbol is in it.
    single = sorted((counts[symbol], (symbol,)) for symbol in used)
    packages: list[tuple[int, tuple[int, ...]]] = []
    for _ in range(MAX_LENGTH):
        merged = sorted(single + packages)
        pairs = zip(merged[::2], merged[1::2], strict=False)
        packages = [(a[0] + b[0], a[1] + b[1]) for a, b in pairs]
    for _, symbols in packages[: max(0, len(used) - 1)]:
        for symbol in symbols:
            lengths[symbol] += 1
    return lengths


def codes_of(lengths: Sequence[int], where: str) -> Ints:
    """Canonical code of each symbol: shorter codes first, equal lengths in symbol order.

    Raises FormatError unless the lengths make a complete code: every string of bits begins with
    one. A single symbol of length 1 is a code as well.
    """
    used = [length for length in lengths if length]
    if any(length > MAX_LENGTH for length in used):
        raise FormatError(f"{where}: a code has {max(used)} bits; at most {MAX_LENGTH} are allowed")
    room = sum(1 << (MAX_LENGTH - length) for length in used)
    if used not in ([], [1]) and room != 1 << MAX_LENGTH:  # PREFIX-04, PREFIX-05
        raise FormatError(f"{where}: the code lengths make no complete prefix code")
    codes = np.zeros(len(lengths), np.int64)
    code = 0
    for length in range(1, MAX_LENGTH + 1):
        for symbol, own in enumerate(lengths):
            if own == length:
                codes[symbol] = code
                code += 1
        code <<= 1
    return codes


MAX_INDEX = 1 << 40
AT, WRITING = 0, 1  # of a coder
FAULT = -1

# Rows of a table: the code and length of each symbol; for each length its first code, how many
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


ADAPTIVE, PREFIX = 0, 1  # coder
_LENGTHS = counted(Checked(Int8ul, lambda n: n <= MAX_LENGTH), N_CLASSES)


class CodeFields(Record):
    """Prefix codes of sparse lists, in headers."""

    coder: int = field(one_of(Int8ul, (ADAPTIVE, PREFIX)), "0 mixed, 1 prefix codes")
    gap_lengths: list[int] | None = field(
        If(this.coder == PREFIX, _LENGTHS),
        "lengths of the codes of a gap's classes, 0 to 15; only where coder is 1",
    )
    value_lengths: list[int] | None = field(
        If(this.coder == PREFIX, _LENGTHS), "the same of the classes of a value"
    )


NO_CODES = CodeFields(coder=ADAPTIVE, gap_lengths=None, value_lengths=None)


@dataclass(frozen=True, slots=True)
class Codes:
    """The two codes of a clip for the compiled loop."""

    gaps: Ints
    values: Ints


def fields_of(blocks: Iterable[Ints]) -> CodeFields:
    """The fields of CODE with the best codes for these vectors, (n_vectors, n) each."""
    gaps, values = np.zeros(N_CLASSES, np.int64), np.zeros(N_CLASSES, np.int64)
    for rows in blocks:
        vectors, columns = np.nonzero(rows)
        before = np.concatenate([[-1], columns[:-1]])
        before[np.concatenate([[True], np.diff(vectors) > 0])[: len(before)]] = -1
        skipped = columns - before[: len(columns)] - 1
        gaps += np.bincount(_classes(skipped), minlength=N_CLASSES)
        values += np.bincount(_classes(np.abs(rows[vectors, columns]) - 1), minlength=N_CLASSES)
    lengths = [list(np.trim_zeros(code_lengths(c.tolist()), "b")) for c in (gaps, values)]
    return CodeFields(coder=PREFIX, gap_lengths=lengths[0], value_lengths=lengths[1])


def _classes(numbers: Ints) -> Ints:
    n = np.frexp(numbers.astype(np.float64))[1].astype(np.int64)  # of 0 to 2^41, exact
    wide = DIRECT + 2 * (n - 5) + (numbers >> np.maximum(n - 2, 0) & 1)
    return np.where(numbers < DIRECT, numbers, wide)


def codes_from(fields: CodeFields, where: str) -> Codes | None:
    """The codes in the fields of CODE, None if absent; raises FormatError."""
    if fields.coder == ADAPTIVE:
        return None
    return Codes(_table(fields.gap_lengths or (), where), _table(fields.value_lengths or (), where))


def _table(lengths: Sequence[int], where: str) -> Ints:
    table = np.zeros((TABLE_ROWS, max(N_CLASSES, MAX_LENGTH + 1)), np.int64)
    n = len(lengths)
    table[CODES, :n], table[LENGTHS, :n] = (
        codes_of(lengths, where),
        lengths,
    )
    own = table[LENGTHS, :n]
    symbols = np.lexsort((np.arange(n), own))[np.count_nonzero(own == 0) :]
    table[SYMBOLS, : len(symbols)] = symbols
    first = 0
    for length in range(1, MAX_LENGTH + 1):
        members = np.flatnonzero(own == length)
        table[ENTRIES, length], table[COUNTS, length] = (
            first,
            len(members),
        )
        if len(members):
            table[FIRSTS, length] = table[CODES, members[0]]
        first += len(members)
    return table


def build_vectors(rows: Ints, starts: Ints, codes: Codes) -> bytes:
    """The bytes of ``rows`` (n_rows, n), whose classes all have a code.

    Each row has a vector from each of ``starts`` to the next, the last of which is n.
    """
    size = rows.size + 64
    while True:
        data, coder = np.zeros(size, np.uint8), np.array([0, 1])
        code_vectors(coder, data, rows.copy(), starts, codes.gaps, codes.values)
        n_bytes = -(-int(coder[0]) // 8)
        if n_bytes <= size:
            return data[:n_bytes].tobytes()
        size = n_bytes


def parse_vectors(
    data: bytes, rows: Ints, starts: Ints, codes: Codes, where: str, *, whole: bool
) -> None:
    """Fill ``rows`` (n_rows, n), zero before, from ``data``; ``starts`` as in ``build_vectors``.

    ``whole``: all bits of ``data`` must be needed. Raises FormatError on bad bytes.
    """
    stream, coder = np.frombuffer(data, np.uint8).copy(), np.array([0, 0])
    fault = code_vectors(coder, stream, rows, starts, codes.gaps, codes.values)
    used = int(coder[0])
    if fault >= 0 or used > 8 * len(data):  # BITS-02
        raise FormatError(f"{where} is not a valid code, or is out of range")
    # BITS-02, BITS-03
    if whole and (-(-used // 8) != len(data) or (used % 8 and data[-1] << used % 8 & 255)):
        raise FormatError(f"{len(data)} bytes do not match the {used} bits used", where=where)
