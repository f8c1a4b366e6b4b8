"""Compiled: survey the channels of a segment: constants, copies, steps, and forms of the others.

Nothing here is normative: any plan decodes. Imported on first use only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.coding.fast import decode_kernels as head
from mcz.codecs.coding.fast.decode_kernels import PLAN_SIZE as READ_SIZE
from mcz.codecs.coding.fast.residual_kernels import POWERS
from mcz.kernels import bit_length, kernel, trailing_zeros
from mcz.kernels.types import Ints, Ints2, Words2

# Columns of plans behind those of head_kernels. MOST: the greatest magnitude; CHANGES: the rows
# that differ from the one before; LIMIT: the least magnitude of exceptions, or -1. FIELDS and
# FIELDS_END: where the fields of a unit are among all of these; SCALE: the byte of a scale.
MOST, CHANGES, LIMIT, FIELDS_END, PREDICTOR = range(READ_SIZE, READ_SIZE + 5)
PLAN_SIZE = READ_SIZE + 5

LEAD_BITS = 31  # of a lead without its sign
FEW = 64  # one row in 64 may be an exception
PLAIN_MARGIN = 8  # bits that an exception has more than others, at least
SEEN_ROWS = 64  # that tell copies apart at first
HASH_BITS = 42
HEAD_BITS = 80  # of a coded channel, about
FALL = 0.415  # bits that a code shrinks by in each row after a jump


class Channels(NamedTuple):
    """The channels of a segment, one group after the other.

    ``columns``: what is coded of each; ``plans``: their heads, as head_kernels has them.
    """

    ordinals: Ints2  # (rows, channels of the signal)
    numbers: Ints  # of the channels in the signal
    firsts: Ints  # the first channel of each group, and the number of all
    groups: Ints  # of each channel
    forms: Ints  # of the grids in force
    clip_forms: Ints
    columns: Ints2  # (channels, rows)
    plans: Ints2


class CodedLanes(NamedTuple):
    """The coded channels of a segment, an item or a row each."""

    numbers: Ints  # of the channels
    starts: Ints  # the first lane of each group, and the number of all
    lattices: Ints2
    leads: Words2
    residuals: Words2  # that of the first row is undefined
    costs: Ints  # about the bits of some residuals
    scales: Ints  # in sixteenths


def take_column(channels: Channels, n: int) -> int:
    """Fill column ``n``, note its magnitudes and changes; returns the bits that magnitudes have."""
    ordinals, number, column = channels.ordinals, channels.numbers[n], channels.columns[n]
    before = ordinals[0, number]
    most = n_changes = used = 0
    for row in range(len(ordinals)):
        ordinal = ordinals[row, number]
        column[row] = ordinal
        magnitude = ordinal ^ (ordinal >> 63)
        most = max(most, magnitude)
        used |= magnitude
        n_changes += 1 if ordinal != before else 0
        before = ordinal
    channels.plans[n, MOST], channels.plans[n, CHANGES] = most, n_changes
    return used


def hash_column(column: Ints) -> int:
    """A number that tells apart most columns that are not the same."""
    hash_value = 0
    for place in range(SEEN_ROWS):
        ordinal = column[place * len(column) // SEEN_ROWS]
        hash_value = (hash_value * 1000003 ^ ordinal ^ ordinal >> 32) & (1 << HASH_BITS) - 1
    return hash_value


def are_equal(one: Ints, other: Ints) -> bool:
    for row in range(len(one)):
        if one[row] != other[row]:
            return False
    return True


def find_source(columns: Ints2, n: int, table: Ints) -> int:
    """An earlier channel that has the same column, or -1; ``table`` has those that were there."""
    slot = hash_column(columns[n]) & len(table) - 1
    while table[slot] >= 0:
        if are_equal(columns[table[slot]], columns[n]):
            return int(table[slot])
        slot = (slot + 1) & len(table) - 1
    table[slot] = n
    return -1


def per_class(plan: Ints) -> int:
    """The numbers of a class."""
    digits = int(plan[head.DIGITS])
    return 9 * POWERS[digits - 1] if plan[head.BASE] == 10 else 1 << (digits - 1)


def class_of(magnitude: int, plan: Ints) -> int:
    """The class of a magnitude, that of the least ones 0; without a base its bits."""
    if plan[head.BASE] == 0:
        return bit_length(magnitude)
    first = 1 if plan[head.BASE] == 10 else 0
    return int(max((magnitude >> plan[head.DROP]) - first, 0) // per_class(plan))


def least_of(number: int, plan: Ints) -> int:
    """The least magnitude of class ``number`` > 0."""
    if plan[head.BASE] == 0:
        return 1 << (number - 1)
    first = 1 if plan[head.BASE] == 10 else 0
    return int(number * per_class(plan) + first << plan[head.DROP])


def count_from(column: Ints, least: int) -> int:
    """The rows whose magnitudes are at least ``least``."""
    count = 0
    for row in range(len(column)):
        count += 1 if column[row] ^ (column[row] >> 63) >= least else 0
    return count


def set_limit(column: Ints, plan: Ints, margin: int) -> None:
    """Set the limit: few rows may exceed the classes of all others by more than ``margin``."""
    plan[LIMIT] = -1
    few = len(column) // FEW
    high = class_of(plan[MOST], plan)
    if few == 0 or high <= margin or count_from(column, least_of(high - margin, plan)) > few:
        return
    low = 0  # more rows than few reach this class, few the one that is ``high``
    while high - low > 1:
        middle = (low + high) >> 1
        if count_from(column, least_of(middle, plan)) > few:
            low = middle
        else:
            high = middle
    plan[LIMIT] = least_of(low + margin + 1, plan)


def most_within(column: Ints, plan: Ints) -> int:
    """The greatest magnitude, exceptions aside."""
    if plan[LIMIT] < 0:
        return int(plan[MOST])
    most = 0
    for row in range(len(column)):
        magnitude = column[row] ^ (column[row] >> 63)
        if magnitude < plan[LIMIT]:
            most = max(most, magnitude)
    return most


def choose_form(column: Ints, form: int, used: int, plan: Ints) -> None:
    """Set form, greatest class and limit for a column whose magnitudes have the bits ``used``."""
    plan[head.REST], plan[head.TOP] = -1, 0
    head.set_form(plan, form, 0)
    if plan[head.BASE] == 2 and used:
        head.set_form(plan, form, min(trailing_zeros(used), plan[head.DIGITS] - 2))
    if plan[head.BASE]:
        set_limit(column, plan, min(plan[head.DIGITS], 9 if plan[head.BASE] == 10 else 30) >> 1)
        plan[head.TOP] = class_of(most_within(column, plan), plan)
        if plan[head.TOP] <= head.most_classes(form):
            return
        head.set_form(plan, 0, 0)
        plan[head.TOP] = 0
    set_limit(column, plan, PLAIN_MARGIN)
    plan[head.DROP] = max(0, bit_length(most_within(column, plan)) - LEAD_BITS)


def repeat_before(column: Ints, limit: int) -> None:
    """Replace exceptions by the row before, leading ones by the first row that is none."""
    before = 0
    for row in range(len(column)):
        if column[row] ^ (column[row] >> 63) < limit:
            before = column[row]
            break
    for row in range(len(column)):
        if column[row] ^ (column[row] >> 63) < limit:
            before = column[row]
        column[row] = before


@kernel
def survey(channels: Channels) -> None:
    """Fill columns and plans but for units, steps, predictors and parents."""
    plans, columns = channels.plans, channels.columns
    n_slots = 2
    while n_slots < 2 * len(columns):
        n_slots *= 2
    table = np.zeros(n_slots, np.int64)
    for slot in range(n_slots):
        table[slot] = -1
    for n in range(len(plans)):
        used = take_column(channels, n)
        plans[n, head.KIND], plans[n, head.LINK], plans[n, LIMIT] = head.CODED, -1, -1
        if plans[n, CHANGES] == 0:
            plans[n, head.KIND] = head.CONSTANT
            continue
        plans[n, head.LINK] = find_source(columns, n, table)
        if plans[n, head.LINK] >= 0:
            plans[n, head.KIND] = head.COPY
        else:
            choose_form(columns[n], channels.forms[n], used, plans[n])
    for n in range(len(plans)):  # not before, as copies are of all rows
        if plans[n, head.KIND] == head.CODED and plans[n, LIMIT] >= 0:
            repeat_before(columns[n], plans[n, LIMIT])


def size_of(value: int) -> int:
    """The bytes of a varint."""
    return max(bit_length(value) + 6, 7) // 7


def short_size(ordinal: int) -> int:
    """The bytes of a short ordinal."""
    return (bit_length(ordinal ^ (ordinal >> 63)) + 8) >> 3 if ordinal else 0


def are_steps(channels: Channels, n: int) -> bool:
    """A channel takes fewer bytes as runs than as codes."""
    ordinals, number, column = channels.ordinals, channels.numbers[n], channels.columns[n]
    n_rows, n_changes = len(ordinals), channels.plans[n, CHANGES]
    if 2 * n_changes > n_rows:
        return False
    size = 1 + size_of(n_changes + 1)
    coded = float(HEAD_BITS + n_rows)
    start, jump = 0, 0.0
    for row in range(1, n_rows + 1):
        if row < n_rows and ordinals[row, number] == ordinals[row - 1, number]:
            continue
        size += size_of(row - start) + 1 + short_size(ordinals[start, number])
        if start:
            rows = float(row - start)
            coded += min(jump * jump / (2.0 * FALL), jump * rows)
        if row < n_rows:
            jump = np.log2(1.0 + abs(float(column[row]) - float(column[row - 1])))
        start = row
    return 8.0 * size < coded


@kernel
def choose_steps(channels: Channels) -> None:
    """Mark the coded channels that are steps, after units were found."""
    for n in range(len(channels.plans)):
        if channels.plans[n, head.KIND] == head.CODED and are_steps(channels, n):
            channels.plans[n, head.KIND] = head.STEPS
