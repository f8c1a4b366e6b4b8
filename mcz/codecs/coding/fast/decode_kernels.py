"""Compiled: read the heads of channels, link their parents and sources, and fill what is not coded.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding.fast.residual_kernels import Predictors
from mcz.kernels import kernel, wrapped
from mcz.kernels.types import Bytes, Ints, Ints2

# Columns of plans, one row a channel. REST: the scale of rests, or -1. GROUP and PLACE: those of a
# parent or of a source, or -1; LINK: its number. FIELDS: the offset of a unit, of the ordinal of a
# constant or of runs. EXCEPTIONS: their offset, or -1.
KIND, FORM, BASE, DIGITS, DROP, TOP, TINY, REST, SCALE, FIRST, TAPS = range(11)
GROUP, PLACE, WEIGHT, FIELDS, EXCEPTIONS, LINK = range(TAPS + 4, TAPS + 10)
PLAN_SIZE = TAPS + 10
CODED, CONSTANT, COPY, STEPS = range(4)
TINY_BIT, PARENT_BIT, EXCEPTIONS_BIT, OWN_FORM = 16, 32, 64, 128
FITTED = 3  # the predictor whose taps stand in the head
N_TAPS, TAP_UNIT, LEAST_TAP, MOST_TAP = 4, 32, -128, 127

MULTIPLES, PRODUCTS, COUNTS = 32, 33, 34
UNIT_SIZE, WITH_RESTS, MOST_PARTS = 8, 4, 7
MOST_DROP, MOST_SCALE, MOST_WEIGHT = 32, 120, 32768
MOST_TOP_10, MOST_TOP_24, MOST_TOP_53 = 614, 255, 2047

# Faults: indices of ``FAULTS`` in decoder.py.
ENDS, BAD_KIND, BAD_ORDINAL, BAD_RUNS, BAD_FORM, BAD_TOP, BAD_FIRST, BAD_SCALE = range(8)
BAD_WEIGHT, BAD_EXCEPTION, BEHIND_HEADS, BAD_LINK, BAD_PARENT, BAD_SOURCE = range(8, 14)
FAR_PARENTS = 14


def scale_of(quarters: int) -> int:
    """The scale, in sixteenths, that a byte of a head means."""
    return (4 + (quarters & 3) << (quarters >> 2)) >> 2


def varint(data: Bytes, at: int, end: int) -> tuple[int, int]:
    """A varint and the offset after it; -1 if there is none."""
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


def zigzag(data: Bytes, at: int, end: int) -> tuple[int, int]:
    """A signed varint and the offset after it; -1 if there is none."""
    folded, at = varint(data, at, end)
    return folded >> 1 ^ -(folded & 1), at


def skip_ordinal(data: Bytes, at: int, end: int, size: int) -> int:
    """The offset after a short ordinal of this many bytes; -1 if there is none."""
    if size > 8 or at + size > end or (size and data[at + size - 1] == 0):  # FAST-21
        return -1
    return at + size


def skip_runs(data: Bytes, at: int, end: int, n_rows: int) -> tuple[int, int]:
    """Skip the runs of steps; return the offset after them, or -1, and the fault."""
    n_runs, at = varint(data, at, end)
    left = n_rows
    while n_runs > 0 and at >= 0:
        n_runs -= 1
        rows, at = varint(data, at, end)
        if at < 0 or at >= end:
            return -1, ENDS
        if rows < 1 or rows > left:  # FAST-25
            return -1, BAD_RUNS
        left -= rows
        at = skip_ordinal(data, at + 1, end, int(data[at]))
        if at < 0:
            return -1, BAD_ORDINAL
    return (-1 if left else at), BAD_RUNS  # FAST-25


def skip_exceptions(data: Bytes, at: int, end: int, n_rows: int) -> tuple[int, int]:
    """Skip exceptions; return the offset after them, or -1, and the fault."""
    n_exceptions, at = varint(data, at, end)
    row = -1
    while n_exceptions > 0 and at >= 0:
        n_exceptions -= 1
        gap, at = varint(data, at, end)
        if at < 0 or at >= end:
            return -1, ENDS
        row += gap + 1
        if row >= n_rows:  # FAST-37
            return -1, BAD_EXCEPTION
        at = skip_ordinal(data, at + 1, end, int(data[at]))
        if at < 0:
            return -1, BAD_ORDINAL
    return at, ENDS


def set_form(plan: Ints, form: int, drop: int) -> bool:
    """Set base and digits of a form; return False for an unknown form."""
    plan[FORM], plan[DROP] = form, drop
    if (form == 0 and drop <= MOST_DROP) or (MULTIPLES <= form <= COUNTS and drop == 0):
        plan[BASE] = plan[DIGITS] = 0
    elif 1 <= form <= 15 and drop == 0:
        plan[BASE], plan[DIGITS] = 10, form
    elif (form == 88 or form == 117) and drop <= form - 66:  # FAST-29, FAST-30
        plan[BASE], plan[DIGITS] = 2, form - 64 - drop
    else:
        return False
    return True


def most_classes(form: int) -> int:
    """Greatest class of a form with digits."""
    return MOST_TOP_10 if form < 16 else MOST_TOP_24 if form == 88 else MOST_TOP_53


def set_scale(plan: Ints, column: int, byte: int) -> bool:
    """Set the scale that a byte means; return False for one that is too large."""
    if byte > MOST_SCALE:  # FAST-33
        return False
    plan[column] = scale_of(byte)
    return True


def read_form(data: Bytes, at: int, end: int, kind: int, form: int, plan: Ints) -> tuple[int, int]:
    """Read the form of a coded channel; return the offset after it, or -1, and the fault."""
    drop = 0
    if kind & OWN_FORM:
        if at + 2 > end:
            return -1, ENDS
        form, drop = int(data[at]), int(data[at + 1])
        at += 2
    if not set_form(plan, form, drop):
        return -1, BAD_FORM
    plan[FIELDS], plan[REST] = at, -1
    if plan[BASE] == 0 and form:
        at += UNIT_SIZE + (1 if form > MULTIPLES else 0)
        if at > end:
            return -1, ENDS
        parts = int(data[at - 1])
        if form == COUNTS:
            if parts > MOST_PARTS:  # FAST-52
                return -1, BAD_FORM
            at += UNIT_SIZE * ((parts & 1) + (parts >> 1 & 1))
            if parts & WITH_RESTS:
                if at >= end:
                    return -1, ENDS
                if not set_scale(plan, REST, int(data[at])):
                    return -1, BAD_SCALE
                at += 1
    plan[TOP], plan[TINY] = 0, kind >> 4 & 1
    if plan[BASE]:
        plan[TOP], at = varint(data, at, end)
        if at < 0:
            return -1, ENDS
        if plan[TOP] > most_classes(form):  # FAST-31
            return -1, BAD_TOP
    elif plan[TINY]:  # FAST-22
        return -1, BAD_KIND
    return (at, 0) if at <= end else (-1, ENDS)


def read_predictor(data: Bytes, at: int, end: int, kind: int, plan: Ints) -> tuple[int, int]:
    """Read first lead, scale and taps; return the offset after them, or -1, and the fault."""
    plan[FIRST], at = zigzag(data, at, end)
    if at < 0 or at >= end:
        return -1, ENDS
    if plan[FIRST] >> 31 != plan[FIRST] >> 63:  # FAST-32
        return -1, BAD_FIRST
    if not set_scale(plan, SCALE, int(data[at])):
        return -1, BAD_SCALE
    at += 1
    predictor = kind >> 2 & 3
    for tap in range(N_TAPS):
        plan[TAPS + tap] = 0
    if predictor == FITTED:
        if at + N_TAPS > end:
            return -1, ENDS
        for tap in range(N_TAPS):
            plan[TAPS + tap] = (int(data[at + tap]) ^ 128) + LEAST_TAP
        at += N_TAPS
    elif predictor:
        plan[TAPS] = predictor * TAP_UNIT
        plan[TAPS + 1] = -TAP_UNIT * (predictor - 1)
    return at, 0


def read_coded(
    data: Bytes, at: int, end: int, kind: int, n_rows: int, form: int, plan: Ints
) -> tuple[int, int]:
    """Read the head of a coded channel; return the offset after it, or -1, and the fault."""
    at, fault = read_form(data, at, end, kind, form, plan)
    if at >= 0:
        at, fault = read_predictor(data, at, end, kind, plan)
    if at >= 0 and kind & PARENT_BIT:
        fault = ENDS
        plan[GROUP], at = varint(data, at, end)
        if at >= 0:
            plan[PLACE], at = varint(data, at, end)
        if at >= 0:
            plan[WEIGHT], at = zigzag(data, at, end)
        if at >= 0 and not -MOST_WEIGHT <= plan[WEIGHT] < MOST_WEIGHT:  # FAST-35
            return -1, BAD_WEIGHT
    if at >= 0 and kind & EXCEPTIONS_BIT:
        plan[EXCEPTIONS] = at
        at, fault = skip_exceptions(data, at, end, n_rows)
    return at, fault


def read_head(
    data: Bytes, at: int, end: int, n_rows: int, form: int, plan: Ints
) -> tuple[int, int]:
    """Read the head of a channel; return the offset after it, or -1, and the fault."""
    if at >= end:
        return -1, ENDS
    kind = int(data[at])
    at += 1
    plan[KIND], plan[FIELDS], plan[GROUP], plan[EXCEPTIONS] = kind & 3, at, -1, -1
    if kind & 3 == CODED:
        return read_coded(data, at, end, kind, n_rows, form, plan)
    if kind & 3 == CONSTANT:
        return skip_ordinal(data, at, end, kind >> 2), BAD_ORDINAL
    if kind >> 2:  # FAST-22
        return -1, BAD_KIND
    if kind == STEPS:
        return skip_runs(data, at, end, n_rows)
    plan[GROUP], at = varint(data, at, end)
    if at >= 0:
        plan[PLACE], at = varint(data, at, end)
    return at, ENDS


@kernel
def read_heads(
    data: Bytes, bounds: Ints, firsts: Ints, n_rows: int, forms: Ints, plans: Ints2, parts: Ints2
) -> tuple[int, int]:
    """Read the heads of streams into ``plans``, offsets of residuals and tails into ``parts``.

    ``bounds``: where streams begin in ``data``, and the end of the last; ``firsts``: the first
    channel of each, and the number of all. Returns a channel and its fault, or -1.
    """
    for group in range(len(bounds) - 1):
        at, end = bounds[group], bounds[group + 1]
        n_coded = 0
        for n in range(firsts[group], firsts[group + 1]):
            at, fault = read_head(data, at, end, n_rows, forms[n], plans[n])
            if at < 0:
                return n, fault
            n_coded += 1 if plans[n, KIND] == CODED else 0
        size = 0
        if n_coded:
            size, at = varint(data, at, end)
            if at < 0 or size > end - at:
                return firsts[group + 1] - 1, ENDS
        elif at < end:  # FAST-19
            return firsts[group + 1] - 1, BEHIND_HEADS
        parts[group, 0], parts[group, 1] = at, at + size
    return -1, 0


def link_channel(plans: Ints2, firsts: Ints, n: int, at: int) -> int:
    """Set the parent or the source of channel ``n``, in group ``at``; return the fault, or -1."""
    place = plans[n, PLACE]
    if at < 0 or place >= firsts[at + 1] - firsts[at]:
        return BAD_LINK
    linked = firsts[at] + place
    plans[n, LINK] = linked
    if plans[n, KIND] == COPY:
        return BAD_SOURCE if plans[linked, KIND] == COPY else -1  # FAST-27
    return BAD_PARENT if linked == n or plans[linked, KIND] != CODED else -1  # FAST-34


@kernel
def link(
    plans: Ints2, firsts: Ints, groups: Ints, places: Ints, n_wanted: int, n_whole: int
) -> tuple[int, int]:
    """Set parents and sources; return a channel and its fault, or -1.

    ``groups``: those whose heads were read; ``places``: where each group of the signal is among
    them, or -1. Sources matter in the first ``n_wanted``, parents in the first ``n_whole``.
    """
    for n_group in range(len(groups)):
        first_foreign = second_foreign = -1
        for n in range(firsts[n_group], firsts[n_group + 1]):
            plans[n, LINK] = -1
            group = plans[n, GROUP]
            if group < 0:
                continue
            if plans[n, KIND] == CODED and group != groups[n_group]:
                if first_foreign < 0 or first_foreign == group:
                    first_foreign = group
                elif second_foreign < 0 or second_foreign == group:
                    second_foreign = group
                else:  # FAST-36
                    return n, FAR_PARENTS
            if group >= len(places):  # FAST-27, FAST-34
                return n, BAD_LINK
            if n_group < (n_wanted if plans[n, KIND] == COPY else n_whole):
                fault = link_channel(plans, firsts, n, places[group])
                if fault >= 0:
                    return n, fault
    return -1, 0


@kernel
def fill_lanes(
    plans: Ints2, firsts: Ints, starts: Ints, lanes: Predictors, lattices: Ints2, columns: Ints
) -> None:
    """Number the coded channels, ``columns``, and fill lanes from their plans.

    ``starts``: the first lane of each group, and the number of all.
    """
    lane_of = np.zeros(len(plans), np.int64)
    n_lanes = 0
    for group in range(len(firsts) - 1):
        starts[group] = n_lanes
        for n in range(firsts[group], firsts[group + 1]):
            if plans[n, KIND] == CODED:
                columns[n_lanes] = n
                lane_of[n] = n_lanes
                n_lanes += 1
    starts[len(firsts) - 1] = n_lanes
    for lane in range(n_lanes):
        plan = plans[columns[lane]]
        lanes.first[lane] = wrapped(plan[FIRST])
        lanes.scales[lane] = wrapped(plan[SCALE])
        lanes.weights[lane] = wrapped(plan[WEIGHT])
        lanes.parents[lane] = lane_of[plan[LINK]] if plan[LINK] >= 0 else -1
        lanes.behind[0, lane] = wrapped(plan[TAPS])
        lanes.behind[4, lane] = wrapped(-plan[TAPS + 3])
        for tap in range(1, 4):
            lanes.behind[tap, lane] = wrapped(plan[TAPS + tap] - plan[TAPS + tap - 1])
        for field in range(6):
            lattices[lane, field] = plan[BASE + field]


SIGN = 1 << 63


def short_ordinal(data: Bytes, at: int, size: int) -> int:
    """The ordinal in ``size`` bytes at ``at``, lowest first, its sign in the lowest bit."""
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
        end = min(row + n_rows, len(rows))
        fill_rows(rows, n, row, end, short_ordinal(data, at + 1, size))  # FAST-24
        row += n_rows
        at += 1 + size


def put_exceptions(data: Bytes, at: int, rows: Ints2, n: int) -> None:
    """Write the exceptions at ``at`` into channel ``n``."""
    n_exceptions, at = varint(data, at, len(data))
    row = -1
    for _ in range(n_exceptions):
        gap, at = varint(data, at, len(data))
        row += gap + 1
        size = int(data[at])
        if row < len(rows):
            rows[row, n] = short_ordinal(data, at + 1, size)  # FAST-38
        at += 1 + size


@kernel
def fill_columns(data: Bytes, plans: Ints2, n_wanted: int, rows: Ints2) -> None:
    """Fill ``rows`` (rows, channels) except coded ones, copies only in the first ``n_wanted``.

    ``rows`` may be only the first ones of the segment. The heads were checked.
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
