"""How the ordinals of a channel are split: by its form, which a grid has by its kind.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from dataclasses import dataclass

from mcz.numbers import Grid, GridKind, printed_base

MULTIPLES = 32  # form: integers that are multiplied by a unit, to binary32
PRODUCTS = 33  # form: odd numbers, shifts and a unit, to a decimal grid
COUNTS = 34  # form: integers that a law makes binary32 numbers, and rests
WITH_UNIT = MULTIPLES, PRODUCTS, COUNTS


@dataclass(frozen=True, slots=True)
class Lattice:
    """How ordinals of a channel are split: base 0 plain, else classes of mantissas."""

    base: int
    digits: int
    drop: int = 0
    top: int = 0


def max_top(shape: Lattice) -> int:
    """The greatest class that numbers of this form have."""
    if shape.base == 10:
        return 614
    return 255 if shape.digits + shape.drop == 24 else 2047


def base_and_digits(grid: Grid) -> tuple[int, int]:
    """Base and mantissa digits that a grid has by its kind; (0, 0) for a plain one."""
    if grid.kind == GridKind.PRINTED:
        return base_and_digits(printed_base(grid))
    if grid.kind == GridKind.GENERAL:
        return 10, grid.digits
    if grid.kind in (GridKind.TEXT64, GridKind.BINARY64):
        return 2, 53
    if grid.kind in (GridKind.TEXT32, GridKind.BINARY32, GridKind.VAX_F):
        return 2, 24
    return 0, 0


def has_binary32(grid: Grid) -> bool:
    """Whether ordinals of the grid are those of BINARY32, which forms 32 and 34 give."""
    return grid.kind == GridKind.BINARY32 or (
        grid.kind == GridKind.PRINTED and printed_base(grid).kind == GridKind.TEXT32
    )


def form_of(shape: Lattice) -> int:
    """The byte ``form``: 0 plain, digits of base 10, or 64 + digits of base 2, drop included."""
    return {0: 0, 10: shape.digits, 2: 64 + shape.digits + shape.drop}[shape.base]


def form_of_grid(grid: Grid) -> int:
    base, digits = base_and_digits(grid)
    return form_of(Lattice(base, digits))
