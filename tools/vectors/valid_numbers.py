"""Valid: number grids."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from tools.vectors.craft import Vector, Whole, file_of, partial, rehash
from tools.vectors.edits import Made, raw_stream
from tools.vectors.motions import HUNDREDTHS, column, dance, numbers

INFINITE, NOT_A_NUMBER = float("inf"), float("nan")


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/numbers")
    _grids(shelf)
    _crafted(shelf)
    _mixed(shelf)
    return shelf.vectors


def grid_cases() -> dict[str, tuple[Grid, list[float]]]:
    """Grids of every kind, each with values at its ends and between them."""
    flag = GridFlag
    bits = [0.0, -0.0, 1.5, -INFINITE, INFINITE, NOT_A_NUMBER]
    tiny = [5e-324, -1.7976931348623157e308]
    return {
        "fixed": (Grid(GridKind.FIXED, 4), [9.3722, -0.0, 0.0, -7.5, 225179981368.5247]),
        "fixed-integers": (Grid(GridKind.FIXED, 0), [7.0, -7.0, 2251799813685247.0]),
        "fixed-22-digits": (Grid(GridKind.FIXED, 22), [1e-22, -3e-22, 2.251799813685247e-7]),
        "trimmed": (Grid(GridKind.TRIMMED, 4, flag.POINT_ZERO), [12.313, -27.0, -0.0, 0.0001]),
        "general": (Grid(GridKind.GENERAL, 6), [0.0, -0.0, 1e-14, 123456.0, -1.5e300, 1e-307]),
        "general-exponent3": (
            Grid(GridKind.GENERAL, 6, flag.EXPONENT3),
            [3.18055e-15, 0.0001, -99.9999, 100000.0, 1234560.0],
        ),
        "general-point-zero": (Grid(GridKind.GENERAL, 6, flag.POINT_ZERO), [24.0, 7e-9, -0.0]),
        "general-15-digits": (
            Grid(GridKind.GENERAL, 15),
            [0.123456789012345, -9.99999999999999e307, 8.88888888888888e-300, 1e22, 1e23],
        ),
        "text64": (Grid(GridKind.TEXT64, 0), [0.1, -0.0, 1e300, 0.30000000000000004, *tiny]),
        "text64-17-digits": (Grid(GridKind.TEXT64, 17), [0.1, -2.0, 1e22, *tiny]),
        "text64-fixed": (Grid(GridKind.TEXT64, 84), [0.1, -1e20, 3.5]),
        "text32": (Grid(GridKind.TEXT32), [0.1, -0.0, 3.4028235e38, 1e-45, 16777216.0]),
        "integer": (Grid(GridKind.INTEGER), [0, -1, 2**53, -(2**53), 127]),
        "scaled": (Grid(GridKind.SCALED, scale=0.1), [3 * 0.1, -7 * 0.1, 0.0, 10**15 * 0.1]),
        "binary32": (Grid(GridKind.BINARY32), [*bits, 2.0**-149, -3.4028234663852886e38]),
        "binary64": (Grid(GridKind.BINARY64), [*bits, *tiny]),
        "vax-f": (Grid(GridKind.VAX_F), [0.0, 1.0, -0.5, 1.7014117331926443e38, 2.0**-128]),
    }


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
