"""Compiled: split ordinals into leads and tails, and write the streams of groups.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding.fast import decode_kernels as head
from mcz.codecs.coding.fast.plan_kernels import update_scale
from mcz.codecs.coding.fast.residual_kernels import (
    BASE,
    DIGITS,
    DROP,
    FAR_DIGITS,
    FEWEST_BITS,
    FIRST,
    FIRST_LONG,
    LEADING,
    LONGER,
    LOW,
    NEAR,
    PER_CLASS,
    PLAIN,
    POWERS,
    REST,
    TINY,
    TOP,
    derive_fields,
)
from mcz.codecs.coding.fast.survey_kernels import (
    CHANGES,
    FIELDS_END,
    LIMIT,
    PREDICTOR,
    Channels,
    CodedLanes,
    short_size,
)
from mcz.kernels import bit_length, kernel, put_eight_bytes, truncated, wrapped
from mcz.kernels.types import Bytes, Bytes2, Ints, Ints2, Words

SIZE_BITS = 6  # of a packed tail


def pack(code: int, n_bits: int) -> int:
    """A tail as one number."""
    return code << SIZE_BITS | n_bits


def pack_decimal_9(value: int, n: int) -> int:
    n_bits = FEWEST_BITS[n]
    is_long = 1 if value >= FIRST_LONG[n] else 0  # no branch: it is unpredictable
    high = value >> n_bits  # 1 or 0
    return pack(value - high * LONGER[n] | high << n_bits, n_bits + is_long)


def pack_decimal(value: int, n: int) -> int:
    """The code of a number below 10^n, n < 16."""
    if n <= 9:
        return pack_decimal_9(value, n)
    high = pack_decimal_9(value // POWERS[9], n - 9)
    low = pack_decimal_9(value % POWERS[9], 9)
    n_high = high & (1 << SIZE_BITS) - 1
    code = high >> SIZE_BITS | low >> SIZE_BITS << n_high
    return pack(code, n_high + (low & (1 << SIZE_BITS) - 1))


def split_plain(column: Ints, drop: int, leads: Words) -> None:
    for row in range(len(column)):
        leads[row] = wrapped(column[row] >> drop)
        column[row] = pack(column[row] & (1 << drop) - 1, drop)


def split_mantissa(mantissa: int, n: int, base: int) -> tuple[int, int]:
    """A lead and its tail of ``n`` digits, packed."""
    if n == 0:
        return mantissa, 0
    if base == 2:
        return mantissa >> n, pack(mantissa & (1 << n) - 1, n)
    lead = truncated(float(mantissa) / POWERS[n])  # exact below 2^53
    return lead, pack_decimal(mantissa - lead * POWERS[n], n)


def split_classes(column: Ints, lattice: Ints, leads: Words) -> None:
    """Split a column of classes; what leads have no digit of stays, and is noted as tiny."""
    base, digits, drop = lattice[BASE], lattice[DIGITS], lattice[DROP]
    first, low, per_class = lattice[FIRST], lattice[LOW], lattice[PER_CLASS]
    n = -1  # digits of the tail
    start = 0  # the first magnitude of a class
    for row in range(len(column)):
        minus = column[row] >> 63
        magnitude = (column[row] ^ minus) >> drop
        lead = tail = 0
        if magnitude:
            if n < 0 or not start <= magnitude < start + per_class:  # not that of the row before
                number = (magnitude - first) // per_class
                start = first + number * per_class
                n = lattice[TOP] - number + digits - lattice[LEADING]
            if n < digits:
                lead, tail = split_mantissa(magnitude - start + low, n, base)
            else:
                lattice[TINY], tail = 1, column[row]
        leads[row], column[row] = wrapped(lead ^ minus), tail


@kernel
def find_leads(lanes: CodedLanes, columns: Ints2) -> None:
    """Split the columns of lanes into leads and tails, which are packed and take their place.

    Note in lattices which lanes have tiny values.
    """
    for lane in range(len(lanes.numbers)):
        column, lattice = columns[lanes.numbers[lane]], lanes.lattices[lane]
        derive_fields(lanes.lattices, lane)
        if lattice[BASE]:
            split_classes(column, lattice, lanes.leads[lane])
        else:
            split_plain(column, lattice[DROP], lanes.leads[lane])


def put(out: Bytes, bit: int, code: int, n: int) -> int:
    """Write ``n`` bits, at most 56, the lowest first; returns the bit after them."""
    at = bit >> 3
    put_eight_bytes(out, at, code << (bit & 7) | int(out[at]))
    return bit + n


def put_packed(out: Bytes, bit: int, tail: int) -> int:
    return put(out, bit, tail >> SIZE_BITS, tail & (1 << SIZE_BITS) - 1)


def put_code(out: Bytes, bit: int, residual: int, scale: int) -> int:
    """Write a residual; returns the bit after its code."""
    k = bit_length(scale >> 4)
    folded = residual << 1 ^ residual >> 63
    high = folded >> k
    if high <= PLAIN:
        return put(out, bit, 1 << high | (folded & (1 << k) - 1) << (high + 1), high + 1 + k)
    more = bit_length((high - 6) >> 1)
    bit = put(out, bit, 1 << (PLAIN + more), PLAIN + more + 1)
    return put(out, bit, folded - (6 + (1 << more) << k), k + more)


def put_tiny(out: Bytes, bit: int, ordinal: int, lattice: Ints) -> int:
    """Write the tail of a lead without digits; returns the bit after it."""
    magnitude = (ordinal ^ ordinal >> 63) >> lattice[DROP]
    if magnitude == 0:
        return put_packed(out, bit, pack_decimal_9(0, 1))
    number = (magnitude - lattice[FIRST]) // lattice[PER_CLASS]
    within = magnitude - lattice[FIRST] - number * lattice[PER_CLASS]
    below = lattice[TOP] - number - lattice[LEADING] + 1
    bit = put_packed(out, bit, pack_decimal_9(min(below, NEAR), 1))
    if below >= NEAR:
        bit = put_packed(out, bit, pack_decimal_9(below - NEAR, FAR_DIGITS))
    if lattice[BASE] == 10:
        return put_packed(out, bit, pack_decimal(within + lattice[LOW], lattice[DIGITS]))
    return put(out, bit, within, lattice[DIGITS] - 1)


def put_tail(out: Bytes, bit: int, tail: int, lead: int, lattices: Ints2, lane: int) -> int:
    """Write a tail as a column has it; returns the bit after it."""
    rest_scale = lattices[lane, REST]
    if rest_scale >= 0:
        lattices[lane, REST] = update_scale(rest_scale, tail)
        return put_code(out, bit, tail, rest_scale)
    if lattices[lane, TINY] and -1 <= lead <= 0:
        return put_tiny(out, bit, tail, lattices[lane])
    return put_packed(out, bit, tail)


def write_parts(
    lanes: CodedLanes, columns: Ints2, start: int, stop: int, residuals: Bytes, tails: Bytes
) -> tuple[int, int]:
    """Write residuals and tails of lanes start <= l < stop; returns their bytes. Scales go along.

    Both at a time: a processor need not wait for the one to write the other.
    """
    numbers, lattices, leads = lanes.numbers, lanes.lattices, lanes.leads
    left, scales = lanes.residuals, lanes.scales
    residuals[0] = tails[0] = 0
    bit = tail_bit = 0
    for row in range(columns.shape[1]):
        for lane in range(start, stop):
            if row:
                residual = int(left[lane, row])
                bit = put_code(residuals, bit, residual, scales[lane])
                scales[lane] = update_scale(scales[lane], residual)
            tail, lead = columns[numbers[lane], row], int(leads[lane, row])
            tail_bit = put_tail(tails, tail_bit, tail, lead, lattices, lane)
    return (bit + 7) >> 3, (tail_bit + 7) >> 3


def append(out: Bytes, at: int, part: Bytes, size: int) -> int:
    """Copy the first bytes of ``part``; returns the offset after them."""
    out[at : at + size] = part[:size]
    return at + size


def put_heads(channels: Channels, group: int, fields: Bytes, out: Bytes, at: int) -> int:
    """Write the heads of a group; returns the offset after them."""
    for n in range(channels.firsts[group], channels.firsts[group + 1]):
        at = put_head(channels, n, fields, out, at)
    return at


@kernel
def write_heads(channels: Channels, group: int, fields: Bytes, out: Bytes) -> int:
    """Write the heads of a group; returns their bytes."""
    return put_heads(channels, group, fields, out, 0)


@kernel
def write_streams(
    channels: Channels, lanes: CodedLanes, fields: Bytes, rooms: Bytes2, ends: Ints
) -> None:
    """Write the streams of groups one after the other, and note where they end.

    ``fields``: those of units, one after the other. The first of three ``rooms`` is filled, the
    others are for the parts of a group.
    """
    out, residuals, tails = rooms[0], rooms[1], rooms[2]
    at = 0
    for group in range(len(ends)):
        at = put_heads(channels, group, fields, out, at)
        start, stop = lanes.starts[group], lanes.starts[group + 1]
        if start < stop:
            sizes = write_parts(lanes, channels.columns, start, stop, residuals, tails)
            at = put_varint(out, at, sizes[0])
            at = append(out, at, residuals, sizes[0])
            at = append(out, at, tails, sizes[1])
        ends[group] = at


def put_varint(out: Bytes, at: int, value: int) -> int:
    """Write a varint; returns the offset after it, as all of these do."""
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
        out[at], out[at + 1] = plan[head.FORM], plan[head.DROP]
        at += 2
    for place in range(plan[head.FIELDS], plan[FIELDS_END]):
        out[at] = fields[place]
        at += 1
    return put_varint(out, at, plan[head.TOP]) if plan[head.BASE] else at


def put_coded(channels: Channels, n: int, fields: Bytes, out: Bytes, at: int) -> int:
    """Write the head of a coded channel."""
    plan = channels.plans[n]
    is_own = plan[head.DROP] > 0 or plan[head.FORM] != channels.clip_forms[n]
    kind = head.CODED | plan[PREDICTOR] << 2 | (head.OWN_FORM if is_own else 0)
    kind |= (head.TINY_BIT if plan[head.TINY] else 0) | (
        head.PARENT_BIT if plan[head.LINK] >= 0 else 0
    )
    out[at] = kind | (head.EXCEPTIONS_BIT if plan[LIMIT] >= 0 else 0)
    at = put_form(plan, is_own, fields, out, at + 1)
    at = put_zigzag(out, at, plan[head.FIRST])
    out[at] = plan[head.SCALE]
    at += 1
    if plan[PREDICTOR] == head.FITTED:
        for tap in range(head.N_TAPS):
            out[at + tap] = plan[head.TAPS + tap] & 255
        at += head.N_TAPS
    if plan[head.LINK] >= 0:
        at = put_link(channels, plan[head.LINK], out, at)
        at = put_zigzag(out, at, plan[head.WEIGHT])
    return put_exceptions(channels, n, out, at) if plan[LIMIT] >= 0 else at


def put_link(channels: Channels, linked: int, out: Bytes, at: int) -> int:
    """Write the group and the place of a channel."""
    group = channels.groups[linked]
    at = put_varint(out, at, group)
    return put_varint(out, at, linked - channels.firsts[group])


def put_head(channels: Channels, n: int, fields: Bytes, out: Bytes, at: int) -> int:
    """Write the head of a channel; ``fields``: those of all units."""
    plan = channels.plans[n]
    if plan[head.KIND] == head.CODED:
        return put_coded(channels, n, fields, out, at)
    out[at] = plan[head.KIND]
    if plan[head.KIND] == head.COPY:
        return put_link(channels, plan[head.LINK], out, at + 1)
    if plan[head.KIND] == head.STEPS:
        return put_steps(channels, n, out, at + 1)
    ordinal = channels.ordinals[0, channels.numbers[n]]
    out[at] = head.CONSTANT | short_size(ordinal) << 2
    return put_short(out, at + 1, ordinal)
