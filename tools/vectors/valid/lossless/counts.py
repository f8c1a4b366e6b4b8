"""Streams of lossless: counts, the laws that make numbers of them, and rests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mcz.coding.ordinals.counts import Law
from mcz.numbers import Grid
from tools.vectors.build.lossless_clips import (
    COUNTS,
    DOUBLE,
    SINGLE,
    Coded,
    Constant,
    Copy,
    Streams,
)
from tools.vectors.build.motions import HUNDREDTHS, column, panel, wave

MOST, FAR = 2**44 - 1, 2.0**80
NEAR = (0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0)
WIDE = (2**31 + 1, -(2**33) - 3, 2**40 + 7, MOST, -MOST - 1, 0, 1, -1)
VOLT = 10 / 65535  # of a converter of 16 bits
ONE = 1 + 2.0**-24  # in the middle of two binary32
NEARLY = 2.0**-24 + 2.0**-60  # what makes 1 a little more than that, but not in binary64


def add(shelf: Streams) -> None:
    _laws(shelf)
    _rests(shelf)


def _laws(shelf: Streams) -> None:
    cases: dict[str, tuple[str, Law, Sequence[int]]] = {
        "alone": ("No sum is made", Law(0.1), NEAR),
        "offset": ("An offset", Law(VOLT, 0.3), NEAR),
        "shift": ("A shift alone: the product is rounded before", Law(VOLT, None, -1.7), NEAR),
        "both": ("Offset and shift, as of a mean that was taken off", Law(VOLT, 6.0, -6.01), NEAR),
        "ties": (
            "First sums in the middle: to even",
            Law(ONE, 2.0**-24, 0.0),
            NEAR,
        ),
        "ties-last": ("Second sums in the middle: to even", Law(1.0, 0.0, 2.0**-24), NEAR),
        "twice": ("First sums rounded to binary64, then to a tie", Law(1.0, NEARLY), NEAR),
        "twice-last": ("Second sums rounded so", Law(1.0, None, NEARLY), NEAR),
        "order": ("Products are rounded before they are added to", Law(0.1, -1.0), (10, 30, 7, 0)),
        "zeros": ("Rounded to -0, with nothing added then", Law(2.0**-200, -0.0), NEAR),
        "zeros-plus": ("Rounded to -0, then 0 is added: +0", Law(2.0**-200, None, 0.0), NEAR),
        "zeros-minus": ("A shift of -0", Law(2.0**-200, None, -0.0), NEAR),
        "cancel": ("What is left of numbers that cancel each other", Law(0.25, 1.0, -1.0), NEAR),
        "subnormal": ("Subnormals", Law(1.5 * 2.0**-149, 2.0**-149, -(2.0**-147)), NEAR),
        "least": ("The least unit, beside a shift", Law(2.0**-200, None, 1.5), NEAR),
        "greatest": ("The greatest of all", Law(FAR, FAR, FAR), WIDE),
        "greatest-minus": ("The same with a minus", Law(FAR, -FAR, -FAR), WIDE),
    }
    for name, (purpose, law, counts) in cases.items():
        _column(shelf, name, purpose, law, counts)
    counts = [row * row - 40 for row in range(12)]
    _column(shelf, "taps", "Counts that are predicted", Law(VOLT, 0.3), counts, taps=(41, -9))


def _rests(shelf: Streams) -> None:
    near, far = (0, 0, 1, 0, -1, 0, 0, 2, 0, 0, -40, 0), (0, 2**30, -(2**30), 77, 2**24, 0, -1, 3)
    law, purpose = Law(VOLT, 0.3), "Rests on a BINARY64 grid, as far as they go"
    _column(shelf, "rests", "Rests of some rows", law, NEAR, near)
    _column(shelf, "rests-alone", "Rests of a law without sums", Law(0.1), NEAR, near)
    _column(shelf, "rests-far", "Rests to far numbers", law, range(8), far)
    _column(shelf, "rests-zero", "Rests all of which are 0", law, NEAR, (0,) * 12)
    ends = (MOST, -MOST - 1, 0, 5, MOST, MOST, -1, 0)
    _column(shelf, "rests-most", purpose, Law(VOLT, 6.0, -6.0), range(8), ends, grid=DOUBLE)
    counts = [row * row - 40 for row in range(12)]
    first, second, third = (
        Coded(form=COUNTS, law=Law(VOLT, 0.3), multiples=tuple(counts), rests=near, taps=(32,)),
        Coded(form=COUNTS, law=Law(0.25), multiples=NEAR),
        Coded(form=COUNTS, law=Law(0.1), multiples=NEAR, rests=near[::-1]),
    )
    made = [values_of(head, SINGLE) for head in (first, second, third)]
    columns = [made[0], wave(12), made[1], [2.5] * 12, made[2], made[0]]
    heads = [first, Coded(), second, Constant(), third, Copy(0, 0)]
    grids = (SINGLE, HUNDREDTHS, SINGLE, SINGLE, SINGLE, SINGLE)
    purpose = "Rests of two channels follow the coded ones of their group; a copy has both."
    motion = panel(columns, grids, (5, 1))
    shelf.code("counts-among-others", purpose, motion, heads, version=1)


def _column(
    shelf: Streams,
    name: str,
    purpose: str,
    law: Law,
    counts: Sequence[int],
    rests: Sequence[int] = (),
    grid: Grid = SINGLE,
    **rest: Any,
) -> None:
    head = Coded(form=COUNTS, law=law, multiples=tuple(counts), rests=tuple(rests), **rest)
    motion = column(values_of(head, grid), grid)
    shelf.code(f"counts-{name}", f"{purpose}.", motion, [head], version=1)


def values_of(head: Any, grid: Grid) -> list[float]:
    """What a head's counts and rests say on a grid."""
    assert head.law is not None
    ordinals = head.law.ordinals(np.array(head.multiples, np.int64))
    values: list[float] = grid.values(ordinals + np.array(head.rests or 0, np.int64)).tolist()
    return values
