"""The stream of a group: heads of its channels, then the bits of those that are coded.

SPEC.md, "Codec 128: lossless", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.coding.forms.lattice import Lattice, form_of, form_of_grid, max_top
from mcz.coding.forms.units import find_units
from mcz.coding.ordinals.choices import choose_predictor, fixed_point, lattice
from mcz.coding.ordinals.heads import (
    CODED,
    CONSTANT,
    COPY,
    MAX_SCALE,
    OWN_FORM,
    make_plan,
    read_heads,
    scale_of,
)
from mcz.coding.start import start_states
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import varint

Ints = NDArray[np.int64]

PLAIN = Grid(GridKind.INTEGER)
REST = make_plan(Lattice(0, 0), 0, 0, ())  # of what a law is off


Own = tuple[Grid, Grid]  # the grid in force and that of the clip
Seen = dict[bytes, tuple[int, int]]  # the ordinals of a channel -> its group and place


def build_stream(
    ordinals: Ints, grids: Sequence[Own], group: int, seen: Seen | None, version: int = 0
) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels); grids in force and of the clip.

    ``seen``: where a channel was coded that a later one may repeat; None: there shall be no copies.
    ``version``: of lossless, which says what forms there are.
    """
    heads, plans, coded = plan_stream(ordinals, grids, group, seen, version)
    return heads + (code(coded, plans) if plans else b"")


def plan_stream(
    ordinals: Ints,
    grids: Sequence[Own],
    group: int,
    seen: Seen | None,
    version: int = 0,
    *,
    fitted: bool = True,
) -> tuple[bytes, list[Ints], Ints]:
    """The heads of a stream, the plans of its coded channels and what is coded of them.

    ``fitted``: predictors may have taps that are fitted to the channel.
    """
    heads, plans, coded, rests = [], [], [], []
    for channel, column in enumerate(ordinals.T):
        column = np.ascontiguousarray(column)
        key = column.tobytes()
        if (column == column[0]).all():
            heads.append(constant_head(int(column[0])))
        elif seen is not None and key in seen:
            heads.append(bytes((COPY,)) + b"".join(map(varint, seen[key])))
        else:
            if seen is not None:
                seen[key] = group, channel
            head, plan, numbers, rest = _coded_head(column, *grids[channel], version, fitted=fitted)
            heads.append(head)
            plans.append(plan)
            coded.append(numbers)
            rests += [] if rest is None else [rest]
    coded, plans = coded + rests, plans + [REST] * len(rests)
    columns = np.stack(coded, axis=1) if coded else np.empty((len(ordinals), 0), np.int64)
    return b"".join(heads), plans, columns


def constant_head(ordinal: int) -> bytes:
    folded = 2 * ordinal if ordinal >= 0 else -2 * ordinal - 1
    size = (folded.bit_length() + 7) // 8
    return bytes((CONSTANT | size << 2,)) + folded.to_bytes(size, "little")


def _coded_head(
    column: Ints, grid: Grid, clip_grid: Grid, version: int, *, fitted: bool
) -> tuple[bytes, Ints, Ints, Ints | None]:
    """The head of a coded channel, its plan for the compiled loop, the integers to code, rests."""
    units = find_units(column, grid, every=version >= 1 and grid == clip_grid)
    if units is not None:
        column = units.integers
    shape = lattice(grid if units is None else PLAIN, column)
    if shape.base and shape.top > max_top(shape):
        shape = lattice(PLAIN, column)
    from_last, taps, error = choose_predictor(fixed_point(column, shape), fitted=fitted)
    scale = next((q for q in range(MAX_SCALE) if scale_of(q) >= error), MAX_SCALE)
    form = form_of(shape) if units is None else units.form
    own_form = shape.drop > 0 or form != form_of_grid(clip_grid)
    kind = CODED | from_last << 2 | len(taps) << 3 | OWN_FORM * own_form
    head = [bytes((kind,)), bytes((form, shape.drop)) if own_form else b""]
    head += [] if units is None else [units.fields]
    head += [varint(shape.top)] if shape.base else []
    head += [bytes((scale,)), *(varint(2 * t if t >= 0 else -2 * t - 1) for t in taps)]
    return (
        b"".join(head),
        make_plan(shape, scale, from_last, taps),
        column,
        None if units is None else units.rests,
    )


@cache
def loops() -> tuple[ModuleType, ModuleType]:
    from mcz.coding import mixing
    from mcz.coding.ordinals import kernels

    return kernels, mixing


@cache
def powers() -> Ints:
    """Powers of 2, then of 10, up to where they stand for "too large", (2, 64)."""
    twos = [min(2**k, 2**62) for k in range(64)]
    return np.array([twos, [min(10**k, 10**18) for k in range(64)]], np.int64)


def code(ordinals: Ints, plans: Sequence[Ints]) -> bytes:
    """The bits of the coded channels, at least one."""
    own, coding = loops()
    rows = np.ascontiguousarray(ordinals)
    size = 4 * rows.size + 1024
    while True:
        data = np.zeros(size, np.uint8)
        state = start_states("lossless")[0].copy()
        coding.start(state, data, 1)
        fault = own.code_rows(state, data, rows.copy(), np.stack(plans), powers())
        used = coding.finish(state, data)
        if fault >= 0:
            raise AssertionError(f"lossless: row {fault} has no code")
        if used <= size:
            return data[:used].tobytes()
        size = used + 1024


Uncode = Callable[[bytes, Sequence[Ints], int], Ints]  # bits, plans, rows -> what is coded


def parse_stream(
    stream: bytes,
    grids: Sequence[Grid],
    n_rows: int,
    uncode: Uncode | None = None,
    *,
    version: int = 0,
) -> tuple[Ints, dict[int, tuple[int, int]]]:
    """The ordinals of a group, (n_rows, channels), and which channels are copies of which.

    ``uncode``: how what follows the heads is decoded, if not as lossless does.
    """
    columns = np.zeros((n_rows, len(grids)), np.int64)
    heads, end = read_heads(stream, grids, version)
    coded = [channel for channel, (kind, _, _) in enumerate(heads) if kind == CODED]
    plans = [heads[channel][1][0] for channel in coded]
    resting = [channel for channel in coded if heads[channel][1][2]]  # LOSS-38
    numbers = (uncode or _uncode)(stream[end:], plans + [REST] * len(resting), n_rows)
    columns[:, coded] = numbers[:, : len(coded)]
    copies = {}
    for channel, (kind, found, _) in enumerate(heads):
        if kind == COPY:
            copies[channel] = found
        elif kind == CONSTANT:
            columns[:, channel] = found  # LOSS-08
        elif found[1] is not None:
            columns[:, channel] = found[1](columns[:, channel])
    columns[:, resting] += numbers[:, len(coded) :]
    return columns, copies


def _uncode(data: bytes, plans: Sequence[Ints], n_rows: int) -> Ints:
    """The ordinals of the coded channels, (n_rows, len(plans))."""
    if not plans:
        if data:  # LOSS-21
            raise FormatError(f"lossless: {len(data)} bytes follow the last channel")
        return np.empty((n_rows, 0), np.int64)
    own, coding = loops()
    bits = np.frombuffer(data, np.uint8).copy()  # one kind of array, one compiled loop
    state = start_states("lossless")[0].copy()  # LOSS-22
    rows = np.zeros((n_rows, len(plans)), np.int64)
    coding.start(state, bits, 0)
    fault = own.code_rows(state, bits, rows, np.stack(plans), powers())
    if fault >= 0:
        raise FormatError(f"lossless: row {fault} cannot be decoded")
    if coding.coded_size(state) != len(bits):  # LOSS-23, RANGE-04
        raise FormatError(
            f"lossless: {len(bits)} bytes, of which {coding.coded_size(state)} belong"
        )
    return rows
