"""Prefix codes of a clip's sparse lists: in its header, and around the compiled loop.

SPEC.md, "Sparse lists", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from construct import If, Int8ul, this

from mcz.codecs.coding.huffman import DIRECT, MAX_LENGTH, N_CLASSES, code_lengths, codes_of
from mcz.codecs.spatial import prefix_kernels
from mcz.errors import FormatError
from mcz.model.schema import Checked, Record, counted, field, one_of
from mcz.model.types import Ints

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
    table = np.zeros((prefix_kernels.TABLE_ROWS, max(N_CLASSES, MAX_LENGTH + 1)), np.int64)
    n = len(lengths)
    table[prefix_kernels.CODES, :n], table[prefix_kernels.LENGTHS, :n] = (
        codes_of(lengths, where),
        lengths,
    )
    own = table[prefix_kernels.LENGTHS, :n]
    symbols = np.lexsort((np.arange(n), own))[np.count_nonzero(own == 0) :]
    table[prefix_kernels.SYMBOLS, : len(symbols)] = symbols
    first = 0
    for length in range(1, MAX_LENGTH + 1):
        members = np.flatnonzero(own == length)
        table[prefix_kernels.ENTRIES, length], table[prefix_kernels.COUNTS, length] = (
            first,
            len(members),
        )
        if len(members):
            table[prefix_kernels.FIRSTS, length] = table[prefix_kernels.CODES, members[0]]
        first += len(members)
    return table


def build_vectors(rows: Ints, starts: Ints, codes: Codes) -> bytes:
    """The bytes of ``rows`` (n_rows, n), whose classes all have a code.

    Each row has a vector from each of ``starts`` to the next, the last of which is n.
    """
    size = rows.size + 64
    while True:
        data, coder = np.zeros(size, np.uint8), np.array([0, 1])
        prefix_kernels.code_vectors(coder, data, rows.copy(), starts, codes.gaps, codes.values)
        used = -(-int(coder[0]) // 8)
        if used <= size:
            return data[:used].tobytes()
        size = used


def parse_vectors(
    data: bytes, rows: Ints, starts: Ints, codes: Codes, where: str, *, whole: bool
) -> None:
    """Fill ``rows`` (n_rows, n), zero before, from ``data``; ``starts`` as in ``build_vectors``.

    ``whole``: all bits of ``data`` must be needed. Raises FormatError on bad bytes.
    """
    stream, coder = np.frombuffer(data, np.uint8).copy(), np.array([0, 0])
    fault = prefix_kernels.code_vectors(coder, stream, rows, starts, codes.gaps, codes.values)
    used = int(coder[0])
    if fault >= 0 or used > 8 * len(data):  # BITS-02
        raise FormatError(f"{where} is not a valid code, or is out of range")
    # BITS-02, BITS-03
    if whole and (-(-used // 8) != len(data) or (used % 8 and data[-1] << used % 8 & 255)):
        raise FormatError(f"{len(data)} bytes do not match the {used} bits used", where=where)
