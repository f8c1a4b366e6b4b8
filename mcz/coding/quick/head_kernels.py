"""Compiled: the heads of channels.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.coding.quick.kernels import (
    BASE,
    CODED,
    COLUMN,
    CONSTANT,
    COPY,
    DEPTH,
    DIGITS,
    DROP,
    FROM_LAST,
    GROUP,
    KIND,
    MAX_TAPS,
    ORDINAL,
    PARTS,
    SCALE,
    SHIFTS,
    TAPS,
    TOP,
    UNIT,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2

OWN_FORM = 128  # in kind: form and drop are in the stream
MULTIPLES, PRODUCTS, COUNTS = 32, 33, 34  # forms: integers that are multiplied by a unit
MAX_PARTS = 7
MAX_DROP, MAX_TAP, MAX_SCALE, MAX_SHIFTS = 19, 511, 172, 63
MAX_TOP_10, MAX_TOP_24, MAX_TOP_53 = 614, 255, 2047
MAX_RANK = 1 << 60
UNIT_SIZE = 8
MOST = 0x7FFFFFFFFFFFFFFF

# What is wrong: the place in ``FAULTS`` of streams.py.
ENDS, BAD_KIND, BAD_CONSTANT, BAD_FORM, BAD_TOP, BAD_TAPS, BAD_SCALE, BAD_BITS = range(8)


def varint(data: Bytes, at: int, end: int) -> tuple[int, int]:
    """A varint below 2^53 and the offset behind it; -1 where there is none."""
    value = shift = 0
    while at < end and shift < 56:
        byte = int(data[at])
        at += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            if (byte == 0 and shift > 7) or value >> 53:
                return 0, -1
            return value, at
    return 0, -1


def set_form(head: Ints, form: int, drop: int) -> bool:
    """Note base and digits of a form; False for one that there is not."""
    head[DROP] = drop
    if (form == 0 and drop <= MAX_DROP) or (MULTIPLES <= form <= COUNTS and drop == 0):
        head[BASE] = head[DIGITS] = 0
    elif 1 <= form <= 15 and drop == 0:
        head[BASE], head[DIGITS] = 10, form
    elif (form == 88 or form == 117) and drop <= form - 66:
        head[BASE], head[DIGITS] = 2, form - 64 - drop
    else:
        return False
    return True


def read_constant(data: Bytes, at: int, end: int, size: int, head: Ints) -> int:
    """Note a constant of so many bytes; the offset behind it, -1 where there is none."""
    if size > 8 or at + size > end or (size and data[at + size - 1] == 0):
        return -1
    folded = 0
    for n in range(size):
        folded |= int(data[at + n]) << (8 * n)
    half = (folded >> 1) & MOST
    head[ORDINAL] = -1 - half if folded & 1 else half
    return at + size


def most_classes(form: int) -> int:
    return MAX_TOP_10 if form < 16 else MAX_TOP_24 if form == 88 else MAX_TOP_53


def read_coded(
    data: Bytes, at: int, end: int, kind: int, form: int, head: Ints, powers: Ints2
) -> tuple[int, int]:
    """Note the head of a coded channel: the offset behind it, or a fault below 0; and what."""
    drop = 0
    if kind & OWN_FORM:
        if at + 2 > end:
            return -1, ENDS
        form, drop = int(data[at]), int(data[at + 1])
        at += 2
    if not set_form(head, form, drop):
        return -1, BAD_FORM
    head[UNIT], head[SHIFTS], head[PARTS] = -1, 0, 0
    if MULTIPLES <= form <= COUNTS:
        head[UNIT] = at
        at += UNIT_SIZE
    if form == COUNTS:
        parts = int(data[at])
        at += 1 + UNIT_SIZE * ((parts & 1) + (parts >> 1 & 1))
        if parts > MAX_PARTS:  # FAST-02, LOSS-35
            return -1, BAD_FORM
        head[PARTS] = MAX_PARTS + 1 + parts
    if form == PRODUCTS:
        head[SHIFTS] = data[at]
        at += 1
        if head[SHIFTS] < 1 or head[SHIFTS] > MAX_SHIFTS:  # FAST-02, LOSS-34
            return -1, BAD_FORM
    head[TOP] = head[DEPTH] = 0
    if head[BASE]:
        head[TOP], at = varint(data, at, end)
        if at < 0:
            return -1, ENDS
        head[DEPTH], at = varint(data, at, end)
        if at < 0:
            return -1, ENDS
        if head[TOP] > most_classes(form):  # FAST-02, LOSS-18
            return -1, BAD_TOP
        if head[DEPTH] > head[TOP]:  # FAST-03
            return -1, BAD_TOP
        row = 1 if head[BASE] == 10 else 0
        if (head[DEPTH] + 1) * (head[BASE] - 1) > MAX_RANK // powers[
            row, head[DIGITS] - 1
        ]:  # FAST-04
            return -1, BAD_TOP
    if at >= end:
        return -1, ENDS
    scale = int(data[at])
    at += 1
    if scale > MAX_SCALE:
        return -1, BAD_SCALE
    head[SCALE] = (4 + (scale & 3) << (scale >> 2)) >> 2
    n_taps = kind >> 3 & 15
    if n_taps > MAX_TAPS:  # FAST-05
        return -1, BAD_TAPS
    for tap in range(MAX_TAPS):
        head[TAPS + tap] = 0
    for tap in range(n_taps):
        folded, at = varint(data, at, end)
        if at < 0:
            return -1, ENDS
        found = -1 - (folded >> 1) if folded & 1 else folded >> 1
        if abs(found) > MAX_TAP:
            return -1, BAD_TAPS
        head[TAPS + tap] = found
    head[FROM_LAST] = kind >> 2 & 1
    return at, 0


def read_head(
    data: Bytes, at: int, end: int, form: int, head: Ints, powers: Ints2
) -> tuple[int, int]:
    """Note the head of a channel: the offset behind it, or -1; and what is wrong."""
    if at >= end:
        return -1, ENDS
    kind = int(data[at])
    at += 1
    head[KIND] = kind & 3
    if kind & 3 == CODED:
        return read_coded(data, at, end, kind, form, head, powers)
    if kind & 3 == CONSTANT:
        return read_constant(data, at, end, kind >> 2, head), BAD_CONSTANT
    if kind != COPY:
        return -1, BAD_KIND
    head[GROUP], at = varint(data, at, end)
    if at >= 0:
        head[COLUMN], at = varint(data, at, end)
    return at, ENDS


@kernel
def read_ends(
    data: Bytes, at: int, end: int, forms: Ints, heads: Ints2, ends: Ints, powers: Ints2
) -> int:
    """Note the heads of a stream and where each ends. Returns a fault or -1."""
    for n in range(len(heads)):
        at, fault = read_head(data, at, end, forms[n], heads[n], powers)
        if at < 0:
            return fault
        ends[n] = at
    return -1
