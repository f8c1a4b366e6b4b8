"""Invalid, one fault each: number grids."""

from __future__ import annotations

import struct
from collections.abc import Iterable

import numpy as np

from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from tools.vectors.build.edits import Made, put, raw_stream
from tools.vectors.build.files import Broken, Vector, file_of, rehash
from tools.vectors.build.motions import column


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/numbers")
    _grids(shelf)
    _more_grids(shelf)
    _ordinals(shelf)
    return shelf.vectors


def _scale(value: float) -> bytes:
    return b"\7\0\0" + struct.pack("<d", value)


def _grids(shelf: Broken) -> None:
    cases = {
        "kind-0": ("A grid of kind 0.", b"\0\0\0"),
        "kind-12": ("A grid of kind 12.", b"\x0c\0\0"),
        "printed-23-digits": ("A PRINTED grid of 23 digits.", b"\x0b\x17\0\x90"),
        "printed-33-digits": ("A PRINTED grid of 33 digits.", b"\x0b\x21\0\x90"),
        "printed-128-digits": ("A PRINTED grid of 128 digits.", b"\x0b\x80\0\xbf"),
        "printed-144-digits": ("A PRINTED grid of 144 digits.", b"\x0b\x90\0\xcf"),
        "printed-style-41": ("A PRINTED grid of style 41.", b"\x0b\2\0\x29"),
        "printed-style-105": ("A PRINTED grid of style 105.", b"\x0b\2\0\x69"),
        "printed-style-128": ("A PRINTED grid of style 128.", b"\x0b\2\0\x80"),
        "printed-style-146": ("A PRINTED grid of style 146.", b"\x0b\2\0\x92"),
        "printed-style-233": ("A PRINTED grid of style 233.", b"\x0b\2\0\xe9"),
        "printed-style-of-131": ("Digits 131 and style 195.", b"\x0b\x83\0\xc3"),
        "printed-fixed-flags": ("A PRINTED grid of style 20 with PLUS.", b"\x0b\2\x08\x14"),
        "printed-zeros-flags": ("A PRINTED grid of style 84 with PLUS.", b"\x0b\2\x08\x54"),
        "printed-exponent-flags": ("A PRINTED grid of %.3e, NO_ZERO.", b"\x0b\2\x04\xc3"),
        "printed-no-style": ("A PRINTED grid without a style.", b"\x0b\2\0"),
        "fixed-23-digits": ("A FIXED grid of 23 digits.", b"\1\x17\0"),
        "trimmed-0-digits": ("A TRIMMED grid of no digits.", b"\2\0\0"),
        "general-0-digits": ("A GENERAL grid of no digits.", b"\3\0\0"),
        "general-16-digits": ("A GENERAL grid of 16 digits.", b"\3\x10\0"),
        "text64-2-digits": ("A TEXT64 grid of 2 digits.", b"\4\2\0"),
        "text64-73-digits": ("A TEXT64 grid of 73 digits.", b"\4\x49\0"),
        "text64-fixed-flags": ("A TEXT64 grid of 84 digits with flags.", b"\4\x54\1"),
        "text32-digits": ("A TEXT32 grid with digits.", b"\5\1\0"),
        "integer-digits": ("An INTEGER grid with digits.", b"\6\1\0"),
        "binary-flags": ("A BINARY64 grid with flags.", b"\x09\0\1"),
        "flag-128": ("A grid with flag 128.", b"\3\6\x80"),
        "point-twice": ("A grid with POINT_ZERO and POINT.", b"\3\6\3"),
        "exponent-twice": ("A grid with EXPONENT3 and EXPONENT1.", b"\3\6\x30"),
        "fixed-exponent": ("A FIXED grid with EXPONENT3.", b"\1\4\x10"),
        "fixed-point": ("A FIXED grid of 2 digits with POINT.", b"\1\2\2"),
        "fixed-no-zero": ("A FIXED grid of no digits with NO_ZERO.", b"\1\0\4"),
        "scale-0": ("A scale of 0.", _scale(0.0)),
        "scale-negative": ("A negative scale.", _scale(-0.5)),
        "scale-NaN": ("A scale that is not a number.", _scale(float("nan"))),
        "scale-infinite": ("An infinite scale.", _scale(float("inf"))),
        "scale-huge": ("A scale of 2^201.", _scale(2.0**201)),
        "scale-tiny": ("A scale of 2^-201.", _scale(2.0**-201)),
    }
    motion = column([0.0, 0.0], Grid(GridKind.FIXED, 2))
    for name, (purpose, grid) in cases.items():
        edit = put(payloads.Clip, "signals.0.grids", b"\1\1" + grid)
        shelf.add(name, "The grid structure", purpose, file_of(motion, CLIP=edit))


def _ordinals(shelf: Broken) -> None:
    half = Grid(GridKind.SCALED, scale=0.5)
    infinite = float("inf")
    # The value is what a decoder gets that does not look at the limit, where there is one.
    cases: dict[str, tuple[Grid, int, float | int]] = {
        "fixed": (Grid(GridKind.FIXED, 2), 2**51, 2**51 / 100),
        "fixed-minus": (Grid(GridKind.FIXED, 2), -1 - 2**51, -(2**51) / 100),
        "trimmed": (Grid(GridKind.TRIMMED, 2), 2**51, 2**51 / 100),
        "general": (Grid(GridKind.GENERAL, 3), 553501, 1e308),
        "general-minus": (Grid(GridKind.GENERAL, 3), -553502, -1e308),
        "text64": (Grid(GridKind.TEXT64), 0x7FF0000000000000, infinite),
        "text64-fixed": (Grid(GridKind.TEXT64, 84), 0x444B1AE4D6E2EF50, 1e21),
        "text32": (Grid(GridKind.TEXT32), 0x7F800000, infinite),
        "printed": (Grid(GridKind.PRINTED, 2, style=210), 2**51, 2**51 / 100),
        "printed-32": (Grid(GridKind.PRINTED, 32, style=144), 0x7F800000, infinite),
        "printed-32-fixed": (Grid(GridKind.PRINTED, 32, style=3), 0x6258D727, 1e21),
        "printed-64": (Grid(GridKind.PRINTED, 64, style=210), 0x7FF0000000000000, infinite),
        "printed-64-fixed": (Grid(GridKind.PRINTED, 64, style=84), 0x444B1AE4D6E2EF50, 1e21),
        "printed-131": (Grid(GridKind.PRINTED, 131, style=194), 553501, 1e308),
        "scaled": (half, 2**51, 2.0**50),
        "scaled-minus": (half, -(2**51), -(2.0**50)),
        "binary32": (Grid(GridKind.BINARY32), 2**31, 0.0),
        "vax-f": (Grid(GridKind.VAX_F), 2**31, 0.0),
        "integer": (Grid(GridKind.INTEGER), 2**53 + 1, 2**53 + 1),
        "integer-minus": (Grid(GridKind.INTEGER), -(2**53) - 1, -(2**53) - 1),
    }
    for name, (grid, ordinal, value) in cases.items():

        def edit(made: Made, ordinal: int = ordinal) -> Made:
            return [(made[0][0], [raw_stream([[ordinal, ordinal]], [0])])]

        zeros = column([0, 0], grid)
        values = np.array([[value], [value]], zeros.signals[0].values.dtype)
        purpose = f"The ordinal {ordinal}, beyond a {grid.kind.name} grid."
        data = file_of(zeros, segments=edit, CEND=rehash(values))
        shelf.add(f"ordinal-of-{name}", "The grid structure", purpose, data)


def _more_grids(shelf: Broken) -> None:
    motion = column([0.0, 0.0], Grid(GridKind.FIXED, 2))
    cases = {
        "trimmed-23-digits": ("A TRIMMED grid of 23 digits.", b"\2\x17\0"),
        "text64-63-digits": ("A TEXT64 grid of 63 digits.", b"\4\x3f\0"),
        "text64-105-digits": ("A TEXT64 grid of 105 digits.", b"\4\x69\0"),
        "text64-18-digits": ("A TEXT64 grid of 18 digits.", b"\4\x12\0"),
        "fixed-upper": ("A FIXED grid with UPPER.", b"\1\2\x40"),
        "trimmed-exponent": ("A TRIMMED grid with EXPONENT1.", b"\2\2\x20"),
        "integer-flags": ("An INTEGER grid with flags.", b"\6\0\x08"),
        "vax-digits": ("A VAX_F grid with digits.", b"\x0a\1\0"),
    }
    for name, (purpose, grid) in cases.items():
        edit = put(payloads.Clip, "signals.0.grids", b"\1\1" + grid)
        shelf.add(name, "The grid structure", purpose, file_of(motion, CLIP=edit))
