"""The head of each channel of a stream of the codec ``lossless``, and what it says.

SPEC.md, "Codec 128: lossless", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.coding.forms.lattice import COUNTS, MULTIPLES, PRODUCTS, Lattice, form_of_grid, max_top
from mcz.coding.forms.units import Mapping, parse_mapping
from mcz.coding.ordinals.choices import MAX_TAP
from mcz.errors import FormatError
from mcz.numbers import Grid
from mcz.schema import read_varint

Ints = NDArray[np.int64]

CODED, CONSTANT, COPY = range(3)  # bits 0 and 1 of a channel's first byte
MAX_DROP = 19
MAX_SCALE = 172  # 2^43
MAX_TAPS = 8
OWN_FORM = 128  # in kind: form and drop are in the stream


def read_heads(
    stream: bytes, grids: Sequence[Grid], version: int = 0
) -> tuple[list[tuple[int, Any, bytes]], int]:
    """Of each channel its kind; its plan, map and rests, ordinal or what it copies; its head.

    Also the offset after the heads. The map (None: none) turns coded integers into ordinals.
    Rests: whether further integers are coded, which are added to these.
    ``version``: that of lossless; streams within other codecs are of 0.
    """
    heads: list[tuple[int, Any, bytes]] = []
    at = 0
    for channel, grid in enumerate(grids):
        found: object
        start = at
        kind, at = _byte(stream, at)
        if kind & 3 == CODED:
            plan, mapping, rests, at = _parse_coded(stream, at, kind, grid, version)
            found = plan, mapping, rests
        elif kind & 3 == CONSTANT:  # LOSS-02
            found, at = _parse_constant(stream, at, kind)
        elif kind == COPY:  # LOSS-03
            group, at = read_varint(stream, at)
            column, at = read_varint(stream, at)
            found = group, column
        else:
            raise FormatError(f"lossless: channel {channel} is of kind {kind:#04x}")
        heads.append((kind & 3, found, stream[start:at]))
    return heads, at


def _byte(stream: bytes, at: int) -> tuple[int, int]:
    if at >= len(stream):
        raise FormatError(f"lossless: the stream ends at {at}, in the head of a channel")
    return stream[at], at + 1


def _parse_constant(stream: bytes, at: int, kind: int) -> tuple[int, int]:
    size = kind >> 2
    if size > 8 or at + size > len(stream):  # LOSS-04, LOSS-06
        raise FormatError(f"lossless: a constant of {size} bytes at {at}")
    folded = int.from_bytes(stream[at : at + size], "little")
    if size and stream[at + size - 1] == 0:  # LOSS-07
        raise FormatError(f"lossless: a constant of {size} bytes, the last of which is 0")
    return (folded >> 1) ^ -(folded & 1), at + size


def _parse_coded(
    stream: bytes, at: int, kind: int, grid: Grid, version: int
) -> tuple[Ints, Mapping | None, bool, int]:
    """The plan of a coded channel, its map if any, whether it has rests; the offset after it."""
    form, drop = form_of_grid(grid), 0  # LOSS-15
    if kind & OWN_FORM:
        form, at = _byte(stream, at)
        drop, at = _byte(stream, at)
    shape = _shape(form, drop, version)
    mapping, rests, at = parse_mapping(stream, at, form, grid)
    top = 0
    if shape.base:
        top, at = read_varint(stream, at)
    scale, at = _byte(stream, at)
    taps = []
    for _ in range(kind >> 3 & 15):
        folded, at = read_varint(stream, at)
        taps.append((folded >> 1) ^ -(folded & 1))
    if (
        (shape.base and top > max_top(shape))  # LOSS-18
        or len(taps) > MAX_TAPS  # LOSS-05
        or any(abs(t) > MAX_TAP for t in taps)  # LOSS-19
    ):
        raise FormatError(f"lossless: greatest class {top}, taps {taps}")
    if scale > MAX_SCALE:  # LOSS-20
        raise FormatError(f"lossless: scale {scale}")
    shape = Lattice(shape.base, shape.digits, drop, top)
    return make_plan(shape, scale, kind >> 2 & 1, taps), mapping, rests, at


def _shape(form: int, drop: int, version: int) -> Lattice:
    if (form == 0 and drop <= MAX_DROP) or (form == MULTIPLES and drop == 0):  # LOSS-17
        return Lattice(0, 0, drop)
    if form in (PRODUCTS, COUNTS) and drop == 0 and version >= 1:  # LOSS-17, LOSS-31
        return Lattice(0, 0, drop)
    if 1 <= form <= 15 and drop == 0:  # LOSS-16, LOSS-17
        return Lattice(10, form)
    if form in (64 + 24, 64 + 53) and drop <= form - 64 - 2:  # LOSS-16, LOSS-17
        return Lattice(2, form - 64 - drop, drop)
    raise FormatError(f"lossless: form {form}, drop {drop}")  # LOSS-16


def scale_of(quarters: int) -> int:
    """The scale that a byte stands for: about 2^(q / 4)."""
    return 4 + (quarters & 3) << (quarters >> 2) >> 2


def make_plan(shape: Lattice, scale: int, from_last: int, taps: Sequence[int]) -> Ints:
    plan = np.zeros(7 + MAX_TAPS, np.int64)
    fields = (shape.base, shape.digits, shape.drop, shape.top, scale_of(scale) << 4)
    plan[:7] = *fields, from_last, len(taps)
    plan[7 : 7 + len(taps)] = taps
    return plan
