"""Streams of ``lossless``, to order: heads that its encoder would never choose.

Nothing here is fitted or estimated, so the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.coding.forms.counts import Law
from mcz.coding.forms.lattice import Lattice, form_of_grid
from mcz.coding.ordinals import heads as lossless_heads
from mcz.coding.ordinals import streams as ordinal_streams
from mcz.coding.start import start_states
from mcz.numbers import Grid
from mcz.schema import varint
from tools.vectors.build.fast_clips import (
    COUNTS,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    Constant,
    Copy,
    law_fields,
)

Ints = NDArray[np.int64]
UNEXAMINED = 2**16  # bytes, more than any crafted stream has


@dataclass(frozen=True, slots=True)
class Coded:
    """A coded channel. ``form`` None: that of the grid, without bit 7 of kind; ``top`` None: as
    great as the ordinals need. Nothing is checked, so that what is forbidden can be written.
    ``multiples``: coded in place of the ordinals, with ``unit`` and ``shifts``: forms 32, 33; or
    with a ``law`` and ``rests``: form 34. ``parts``: what form 34 says in their place."""

    form: int | None = None
    drop: int = 0
    top: int | None = None
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


def _streams(layout: Any, ordinals: Ints, heads: Sequence[Head]) -> tuple[bytes, ...]:
    every = [*heads, *[USUAL] * (layout.n_channels - len(heads))]
    return tuple(
        build_stream(
            ordinals[:, list(group)],
            [layout.grids[channel] for channel in group],
            [every[channel] for channel in group],
        )
        for group in layout.groups
    )


def build_stream(
    ordinals: Any, grids: Sequence[Grid], heads: Sequence[Head], *, faulty: bool = False
) -> bytes:
    """The stream of a group: ``ordinals`` (rows, channels), the grids of the clip, the heads.

    ``faulty``: an ordinal has no code, and the bits end with the fault.
    """
    code = _code_to_the_fault if faulty else ordinal_streams.code
    data, plans, coded = heads_of(ordinals, grids, heads)
    return data + code(coded, plans) if plans else data


def heads_of(
    ordinals: Any, grids: Sequence[Grid], heads: Sequence[Head]
) -> tuple[bytes, list[Ints], Ints]:
    """The heads of a stream, the plans of its coded channels and what is coded of them."""
    table = np.array(ordinals, np.int64)
    data, plans, coded, rests = b"", [], [], []
    for place, head in enumerate(heads):
        column = table[:, place]
        if isinstance(head, Copy):
            data += b"\2" + varint(head.group) + varint(head.channel)
        elif isinstance(head, Constant):
            data += ordinal_streams.constant_head(int(column[0]))
        else:
            shape = _shape(head, grids[place], column.tolist())
            data += _coded_head(head, shape)
            plans.append(
                lossless_heads.make_plan(
                    shape, head.scale, head.from_last, head.taps[: lossless_heads.MAX_TAPS]
                )
            )
            coded.append(head.multiples or column.tolist())
            rests += [head.rests] if head.rests else []
    plans += [ordinal_streams.REST] * len(rests)
    return data, plans, np.array(coded + rests, np.int64).T


def _shape(head: Coded, grid: Grid, column: Sequence[int]) -> Lattice:
    form = form_of_grid(grid) if head.form is None else head.form
    if form in (PLAIN, MULTIPLES, PRODUCTS, COUNTS):
        return Lattice(0, 0, head.drop)
    base, digits = (10, form) if form < 64 else (2, form - 64 - head.drop)
    greatest = max(o if o >= 0 else -1 - o for o in column) >> head.drop
    per_class = (base - 1) * base ** (digits - 1)
    top = max(0, (greatest - (base == 10)) // per_class) if head.top is None else head.top
    return Lattice(base, digits, head.drop, top)


def _coded_head(head: Coded, shape: Lattice) -> bytes:
    own = head.form is not None
    kind = head.from_last << 2 | len(head.taps) << 3 | lossless_heads.OWN_FORM * own
    data = bytes((kind, *((head.form, head.drop) if head.form is not None else ())))
    data += struct.pack("<d", head.unit) if head.unit is not None else b""
    data += bytes((head.shifts,)) if head.shifts is not None else b""
    data += law_fields(head, head.law) if head.law is not None else b""
    data += varint(shape.top) if shape.base else b""
    folded = (2 * tap if tap >= 0 else -2 * tap - 1 for tap in head.taps)
    return data + bytes((head.scale,)) + b"".join(map(varint, folded))


def _code_to_the_fault(ordinals: Ints, plans: Sequence[Ints]) -> bytes:
    """The bits up to what cannot be coded."""
    loops, coding = ordinal_streams.loops()
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("lossless")[0].copy()
    coding.start(state, data, 1)
    rows = np.ascontiguousarray(ordinals).copy()
    fault = loops.code_rows(state, data, rows, np.stack(plans), ordinal_streams.powers())
    assert fault >= 0
    return data[: coding.finish(state, data)].tobytes()
