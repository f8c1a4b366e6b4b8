"""Streams of ``fast``, to order: heads that its encoder would never choose.

Nothing here is fitted or estimated, so the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.heads import OWN_FORM, form_of_grid, scale_of
from mcz.coding.ordinals.streams import constant_head
from mcz.coding.quick import streams as quick
from mcz.numbers import Grid
from mcz.schema import varint
from tools.vectors.build.lossless_clips import (
    COUNTS,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    Constant,
    Copy,
    law_fields,
)

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Coded:
    """A coded channel. ``form`` None: that of the grid, without bit 7 of kind; ``top``, ``depth``
    None: as the ordinals need. Nothing is checked, so that what is forbidden can be written.
    ``multiples``: coded in place of the ordinals, with ``unit`` and ``shifts``: forms 32, 33; or
    with a ``law`` and ``rests``: form 34. ``parts``: what form 34 says in their place."""

    form: int | None = None
    drop: int = 0
    top: int | None = None
    depth: int | None = None
    scale: int = 8
    from_last: int = 1
    taps: tuple[int, ...] = ()
    unit: float | None = None
    shifts: int | None = None
    multiples: tuple[int, ...] = ()
    law: Law | None = None
    rests: tuple[int, ...] = ()
    parts: int | None = None


Head = Coded | Constant | Copy
USUAL = Coded()
REST = Coded(PLAIN, scale=0, from_last=0)


def streams_of(layout: Any, ordinals: Ints, heads: Sequence[Head]) -> tuple[bytes, ...]:
    every = [*heads, *[USUAL] * (layout.n_channels - len(heads))]
    return tuple(
        build_stream(
            ordinals[:, list(group)],
            [layout.grids[channel] for channel in group],
            [every[channel] for channel in group],
        )
        for group in layout.groups
    )


def build_stream(ordinals: Any, grids: Sequence[Grid], heads: Sequence[Head]) -> bytes:
    """The stream of a group: ``ordinals`` (rows, channels), the grids of the clip, the heads."""
    table = np.array(ordinals, np.int64)
    data, plans, columns, rests = b"", [], [], []
    for place, head in enumerate(heads):
        column = table[:, place]
        if isinstance(head, Copy):
            data += b"\2" + varint(head.group) + varint(head.channel)
        elif isinstance(head, Constant):
            data += constant_head(int(column[0]))
        else:
            plan = _plan(head, grids[place], column.tolist())
            data += _head(head, plan)
            plans.append(plan)
            columns.append(head.multiples or column.tolist())
            rests += [head.rests] if head.rests else []
    plans += [_plan(REST, grids[0], ())] * len(rests)
    columns += rests
    return data + (values_of(np.array(columns, np.int64), np.stack(plans)) if plans else b"")


def values_of(columns: Ints, plans: Ints) -> bytes:
    """State, words and bits of coded channels, (channels, rows)."""
    _, _, choice, record = quick.loops()
    records = np.zeros((columns.size, record.RECORD_SIZE), np.int64)
    choice.record_columns(columns, plans, quick.tables().powers, records)
    (data,) = quick.write(records, np.array([len(records)], np.int64))
    return data


def _plan(head: Coded, grid: Grid, column: Sequence[int]) -> Ints:
    own = quick.loops()[0]
    form = form_of_grid(grid) if head.form is None else head.form
    plan: Ints = np.zeros(own.PLAN_SIZE, np.int64)
    if form not in (PLAIN, MULTIPLES, PRODUCTS, COUNTS):
        base, digits = (10, form) if form < 64 else (2, form - 64 - head.drop)
        sizes = sorted({(o if o >= 0 else -1 - o) >> head.drop for o in column} - {0} or {1})
        per_class = (base - 1) * base ** (digits - 1)
        least, greatest = ((size - (base == 10)) // per_class for size in (sizes[0], sizes[-1]))
        plan[[own.BASE, own.DIGITS]] = base, digits
        plan[own.TOP] = greatest if head.top is None else head.top
        plan[own.DEPTH] = plan[own.TOP] - least if head.depth is None else head.depth
    plan[own.DROP] = head.drop
    plan[own.SCALE] = scale_of(head.scale)
    plan[own.FROM_LAST] = head.from_last
    taps = head.taps[: own.MAX_TAPS]
    plan[own.TAPS : own.TAPS + len(taps)] = taps
    return plan


def _head(head: Coded, plan: Ints) -> bytes:
    own = quick.loops()[0]
    kind = head.from_last << 2 | len(head.taps) << 3 | OWN_FORM * (head.form is not None)
    data = bytes((kind, *((head.form, head.drop) if head.form is not None else ())))
    data += struct.pack("<d", head.unit) if head.unit is not None else b""
    data += bytes((head.shifts,)) if head.shifts is not None else b""
    data += law_fields(head, head.law) if head.law is not None else b""
    if plan[own.BASE]:
        data += varint(int(plan[own.TOP])) + varint(int(plan[own.DEPTH]))
    folded = (2 * tap if tap >= 0 else -2 * tap - 1 for tap in head.taps)
    return data + bytes((head.scale,)) + b"".join(map(varint, folded))
