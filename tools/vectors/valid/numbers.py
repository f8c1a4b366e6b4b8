"""Valid: number grids."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.build.edits import Made, raw_stream
from tools.vectors.build.files import Vector, Whole, file_of, partial, rehash
from tools.vectors.build.motions import (
    HUNDREDTHS,
    NOT_A_NUMBER,
    column,
    dance,
    grid_cases,
    numbers,
)


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/numbers")
    _grids(shelf)
    _crafted(shelf)
    _mixed(shelf)
    _quotients(shelf)
    return shelf.vectors


def _grids(shelf: Whole) -> None:
    for name, (grid, values) in grid_cases().items():
        motion = column(values, grid)
        purpose = f"Ordinals of a {grid.kind.name} grid to values: {name}."
        shelf.hold(name, "Ordinal to value; Number grids", purpose, file_of(motion), motion)


def _crafted(shelf: Whole) -> None:
    """Ordinals that no writer of ours finds for a value."""
    vax, double = Grid(GridKind.VAX_F), Grid(GridKind.BINARY64)
    payloads = [0x7FF0000000000001, -1 - 0x7FFFFFFFFFFFFFFF, 0x3FF0000000000000]
    cases: tuple[tuple[str, str, Grid, list[int], list[float]], ...] = (
        (
            "vax-f-reserved",
            "The reserved operand is NaN, a zero with a fraction is 0.",
            vax,
            [-1, 5, 0x40800000],
            [NOT_A_NUMBER, 0.0, 1.0],
        ),
        (
            "binary64-nan-payloads",
            "Every NaN is 0x7FF8000000000000, whatever its sign and payload.",
            double,
            payloads,
            [NOT_A_NUMBER, NOT_A_NUMBER, 1.0],
        ),
    )
    for name, purpose, grid, ordinals, values in cases:
        motion = column(values, grid)
        data = with_ordinals(column([0.0] * len(values), grid), ordinals, motion)
        shelf.hold(name, "Ordinal to value; CEND", purpose, data, motion)


def with_ordinals(stored: Motion, ordinals: list[int], decoded: Motion) -> bytes:
    """The file of ``stored``, its only channel replaced by ``ordinals``."""

    def edit(made: Made) -> Made:
        ((header, _),) = made
        return [(header, [raw_stream([ordinals], [8])])]

    return file_of(stored, segments=edit, CEND=rehash(decoded.signals[0].values))


def _mixed(shelf: Whole) -> None:
    grids = (HUNDREDTHS,) * 4 + (Grid(GridKind.INTEGER),) * 2
    values = numbers(4, 6)
    values[:, 4:] = np.round(values[:, 4:] * 10)
    values[values == 0] = 0.0  # integers have no -0
    motion = dance(signals=(Signal(values, grids),))
    shelf.hold(
        "integers-among-others",
        "CEND; Ordinal to value",
        "INTEGER channels beside others are binary64, also when read alone.",
        file_of(motion),
        motion,
        parts=(partial(motion, (1, 3), (1,)),),
    )


def _quotients(shelf: Whole) -> None:
    """Values that a product with an inexact power of ten would miss."""
    for digits in (4, 17):
        grid = Grid(GridKind.FIXED, digits)
        found = [k for k in range(1, 4000) if k * 10.0**-digits != k / 10.0**digits][:40]
        values = [k / 10.0**digits for k in found]
        motion = column(values, grid)
        purpose = f"Numbers of {digits} digits that k times 1e-{digits} misses by a last place."
        spec = "Decimal and binary64; Ordinal to value"
        shelf.hold(f"fixed-{digits}-quotients", spec, purpose, file_of(motion), motion)
