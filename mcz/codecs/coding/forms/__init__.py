"""The forms of channels: ordinals as coded integers, and back; their ids.

SPEC.md, "Codec 1: fast", is normative.
"""

from __future__ import annotations

from mcz.model.numbers import Grid, GridKind, printed_base

MULTIPLES = 32  # integers that are multiplied by a unit
PRODUCTS = 33  # odd numbers, shifts and a unit, to a decimal grid
COUNTS = 34  # integers that a law makes numbers, and rests
WITH_UNIT = MULTIPLES, PRODUCTS, COUNTS
BINARY32 = Grid(GridKind.BINARY32)
BINARY_24, BINARY_53 = 88, 117  # classes of 24 and 53 binary digits


def form_of_grid(grid: Grid) -> int:
    """The form of a channel whose head does not state it."""
    if grid.kind == GridKind.PRINTED:
        return form_of_grid(printed_base(grid))
    if grid.kind == GridKind.GENERAL:
        return grid.digits
    if grid.kind in (GridKind.TEXT64, GridKind.BINARY64):
        return BINARY_53
    if grid.kind in (GridKind.TEXT32, GridKind.BINARY32, GridKind.VAX_F):
        return BINARY_24
    return 0


def unit_grid(clip_grid: Grid) -> Grid:
    """The grid of ordinals from forms 32 and 34, by the channel's grid in CLIP."""
    return clip_grid if clip_grid.kind == GridKind.GENERAL else BINARY32


def has_binary32(grid: Grid) -> bool:
    """Return whether ordinals equal those of BINARY32; those of VAX_F do, for a quarter of it."""
    return grid.kind in (GridKind.BINARY32, GridKind.VAX_F) or (
        grid.kind == GridKind.PRINTED and printed_base(grid).kind == GridKind.TEXT32
    )
