"""Compiled: what the heads of channels say of rows: constants, steps, exceptions, copies.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding.fast.head_kernels import (
    CONSTANT,
    COPY,
    EXCEPTIONS,
    FIELDS,
    KIND,
    LINK,
    STEPS,
    varint,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints2

SIGN = 1 << 63


def short_ordinal(data: Bytes, at: int, size: int) -> int:
    folded = 0
    for place in range(size):
        folded |= int(data[at + place]) << 8 * place
    return (folded >> 1 & SIGN - 1) ^ -(folded & 1)


def fill_rows(rows: Ints2, n: int, start: int, stop: int, ordinal: int) -> None:
    for row in range(start, stop):
        rows[row, n] = ordinal


def fill_steps(data: Bytes, at: int, rows: Ints2, n: int) -> None:
    """Fill a channel with the ordinals of runs."""
    n_runs, at = varint(data, at, len(data))
    row = 0
    for _ in range(n_runs):
        n_rows, at = varint(data, at, len(data))
        size = int(data[at])
        fill_rows(rows, n, row, row + n_rows, short_ordinal(data, at + 1, size))  # FAST-24
        row += n_rows
        at += 1 + size


def put_exceptions(data: Bytes, at: int, rows: Ints2, n: int) -> None:
    n_exceptions, at = varint(data, at, len(data))
    row = -1
    for _ in range(n_exceptions):
        gap, at = varint(data, at, len(data))
        row += gap + 1
        size = int(data[at])
        rows[row, n] = short_ordinal(data, at + 1, size)  # FAST-38
        at += 1 + size


@kernel
def fill_columns(data: Bytes, plans: Ints2, n_wanted: int, rows: Ints2) -> None:
    """Fill ``rows`` (rows, channels) but for what is coded; copies in the first ``n_wanted``.

    What the heads say was checked.
    """
    n_rows, n_channels = rows.shape
    for n in range(n_channels):
        at = plans[n, FIELDS]
        if plans[n, KIND] == CONSTANT:
            size = int(data[at - 1]) >> 2
            fill_rows(rows, n, 0, n_rows, short_ordinal(data, at, size))  # FAST-23
        elif plans[n, KIND] == STEPS:
            fill_steps(data, at, rows, n)
        elif plans[n, EXCEPTIONS] >= 0:
            put_exceptions(data, plans[n, EXCEPTIONS], rows, n)
    for n in range(n_wanted):
        if plans[n, KIND] == COPY:
            for row in range(n_rows):
                rows[row, n] = rows[row, plans[n, LINK]]  # FAST-26
