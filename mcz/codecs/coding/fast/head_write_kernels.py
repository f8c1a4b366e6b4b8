"""Compiled: write the heads of channels.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding.fast.head_kernels import (
    BASE,
    CODED,
    CONSTANT,
    COPY,
    DROP,
    EXCEPTIONS_BIT,
    FIELDS,
    FIRST,
    FITTED,
    FORM,
    KIND,
    LINK,
    N_TAPS,
    OWN_FORM,
    PARENT_BIT,
    SCALE,
    STEPS,
    TAPS,
    TINY,
    TINY_BIT,
    TOP,
    WEIGHT,
)
from mcz.codecs.coding.fast.survey_kernels import (
    CHANGES,
    FIELDS_END,
    LIMIT,
    PREDICTOR,
    Channels,
    short_size,
)
from mcz.kernels.types import Bytes, Ints


def put_varint(out: Bytes, at: int, value: int) -> int:
    """Write a varint; returns the offset behind it, as all of these do."""
    while value >= 128:
        out[at] = value & 127 | 128
        value >>= 7
        at += 1
    out[at] = value
    return at + 1


def put_zigzag(out: Bytes, at: int, value: int) -> int:
    return put_varint(out, at, value << 1 ^ value >> 63)


def put_short(out: Bytes, at: int, ordinal: int) -> int:
    """Write a short ordinal, without its size."""
    folded = ordinal << 1 ^ ordinal >> 63
    size = short_size(ordinal)
    for place in range(size):
        out[at + place] = folded >> 8 * place & 255
    return at + size


def put_sized(out: Bytes, at: int, ordinal: int) -> int:
    """Write the size of a short ordinal, and the ordinal."""
    out[at] = short_size(ordinal)
    return put_short(out, at + 1, ordinal)


def put_steps(channels: Channels, n: int, out: Bytes, at: int) -> int:
    """Write the runs of steps."""
    ordinals, number = channels.ordinals, channels.numbers[n]
    at = put_varint(out, at, channels.plans[n, CHANGES] + 1)
    start = 0
    for row in range(1, len(ordinals) + 1):
        if row == len(ordinals) or ordinals[row, number] != ordinals[row - 1, number]:
            at = put_varint(out, at, row - start)
            at = put_sized(out, at, ordinals[start, number])
            start = row
    return at


def put_exceptions(channels: Channels, n: int, out: Bytes, at: int) -> int:
    """Write the rows whose magnitudes reach the limit."""
    ordinals, number, limit = channels.ordinals, channels.numbers[n], channels.plans[n, LIMIT]
    count = 0
    for row in range(len(ordinals)):
        count += 1 if ordinals[row, number] ^ (ordinals[row, number] >> 63) >= limit else 0
    at = put_varint(out, at, count)
    before = -1
    for row in range(len(ordinals)):
        ordinal = ordinals[row, number]
        if ordinal ^ (ordinal >> 63) >= limit:
            at = put_varint(out, at, row - before - 1)
            at = put_sized(out, at, ordinal)
            before = row
    return at


def put_form(plan: Ints, is_own: bool, fields: Bytes, out: Bytes, at: int) -> int:
    """Write form, the fields of a unit, and the greatest class."""
    if is_own:
        out[at], out[at + 1] = plan[FORM], plan[DROP]
        at += 2
    for place in range(plan[FIELDS], plan[FIELDS_END]):
        out[at] = fields[place]
        at += 1
    return put_varint(out, at, plan[TOP]) if plan[BASE] else at


def put_coded(channels: Channels, n: int, fields: Bytes, out: Bytes, at: int) -> int:
    """Write the head of a coded channel."""
    plan = channels.plans[n]
    is_own = plan[DROP] > 0 or plan[FORM] != channels.clip_forms[n]
    kind = CODED | plan[PREDICTOR] << 2 | (OWN_FORM if is_own else 0)
    kind |= (TINY_BIT if plan[TINY] else 0) | (PARENT_BIT if plan[LINK] >= 0 else 0)
    out[at] = kind | (EXCEPTIONS_BIT if plan[LIMIT] >= 0 else 0)
    at = put_form(plan, is_own, fields, out, at + 1)
    at = put_zigzag(out, at, plan[FIRST])
    out[at] = plan[SCALE]
    at += 1
    if plan[PREDICTOR] == FITTED:
        for tap in range(N_TAPS):
            out[at + tap] = plan[TAPS + tap] & 255
        at += N_TAPS
    if plan[LINK] >= 0:
        at = put_link(channels, plan[LINK], out, at)
        at = put_zigzag(out, at, plan[WEIGHT])
    return put_exceptions(channels, n, out, at) if plan[LIMIT] >= 0 else at


def put_link(channels: Channels, linked: int, out: Bytes, at: int) -> int:
    """Write the group and the place of a channel."""
    group = channels.groups[linked]
    at = put_varint(out, at, group)
    return put_varint(out, at, linked - channels.firsts[group])


def put_head(channels: Channels, n: int, fields: Bytes, out: Bytes, at: int) -> int:
    """Write the head of a channel; ``fields``: those of all units."""
    plan = channels.plans[n]
    if plan[KIND] == CODED:
        return put_coded(channels, n, fields, out, at)
    out[at] = plan[KIND]
    if plan[KIND] == COPY:
        return put_link(channels, plan[LINK], out, at + 1)
    if plan[KIND] == STEPS:
        return put_steps(channels, n, out, at + 1)
    ordinal = channels.ordinals[0, channels.numbers[n]]
    out[at] = CONSTANT | short_size(ordinal) << 2
    return put_short(out, at + 1, ordinal)
