"""Streams of lossless: heads, forms, predictors, copies, residuals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.coding.ordinals.degrees import of_products
from mcz.coding.ordinals.heads import MAX_SCALE
from mcz.coding.ordinals.streams import parse_stream
from mcz.numbers import Grid, GridKind
from tools.vectors.build.edits import Made, stream
from tools.vectors.build.files import file_of, partial
from tools.vectors.build.lossless_clips import (
    BINARY32,
    BINARY64,
    DOUBLE,
    HEADING,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    WHOLE,
    Coded,
    Constant,
    Copy,
    Head,
    Streams,
    build_stream,
    codec_of,
)
from tools.vectors.build.motions import HUNDREDTHS, column, grid_cases, panel, wave

NO_MINUS = (GridKind.INTEGER, GridKind.SCALED, GridKind.VAX_F)  # grids without -0
# Cases of ``grid_cases`` whose ordinals exceed 2^44 on a plain grid.
LONG = {"fixed", "fixed-integers", "fixed-22-digits", "integer", "printed", "scaled"}


def add(shelf: Streams) -> None:
    _grids(shelf)
    _predictors(shelf)
    _constants(shelf)
    _copies(shelf)
    _forms(shelf)
    _multiples(shelf)
    _products(shelf)
    _classes(shelf)
    _residuals(shelf)
    _ends(shelf)


def _grids(shelf: Streams) -> None:
    for name, (grid, values) in grid_cases().items():
        head = Coded(form=PLAIN, drop=10) if name in LONG else Coded()
        turned = [v if np.isnan(v) or (v == 0 and grid.kind in NO_MINUS) else -v for v in values]
        purpose = f"Ordinals of a {grid.kind.name} grid, jumping about: {name}."
        spec = f"{HEADING}; Number grids"
        shelf.code(f"grid-{name}", purpose, column([*values, *turned, *values], grid), [head], spec)


def _predictors(shelf: Streams) -> None:
    cases: dict[str, tuple[str, Coded]] = {
        "order-0": ("No prediction but 0", Coded(from_last=0)),
        "order-1": ("The value before", Coded()),
        "order-2": ("The value and the difference before", Coded(taps=(32,))),
        "order-3": ("Two differences", Coded(taps=(64, -32))),
        "fitted": ("Four taps of mixed signs", Coded(taps=(41, -13, 5, -1))),
        "eight-taps": ("As many taps as there may be", Coded(taps=(30, 5, -3, 2, -1, 1, -1, 1))),
        "zero-taps": ("Eight taps of zero", Coded(taps=(0,) * 8)),
        "taps-alone": ("Taps without the value before", Coded(from_last=0, taps=(511, -480))),
    }
    for name, (purpose, head) in cases.items():
        motion = column(wave(40), HUNDREDTHS)
        shelf.code(f"predict-{name}", f"{purpose}.", motion, [head])
        motion = column([float(f"{v:.2f}") for v in wave(40, 2)], SIX)
        shelf.code(f"predict-{name}-classes", f"{purpose}; classes.", motion, [head])
    most = 2**44 - 1
    swings = [most, -most - 1, most, most, 0, -most, 5, most, most - 7, -1, -most - 1, 3]
    taps = (511, -511, 511, -511, 511, -511, 511, -511)
    for name, sign in (("clamped", 1), ("clamped-below", -1)):
        head = Coded(taps=tuple(sign * tap for tap in taps), scale=0)
        purpose = f"Differences and predictions at their limits, taps of {sign * 511} and so on."
        shelf.code(f"predict-{name}", purpose, column(swings * 2, WHOLE), [head])
        values = [9.99999e307, -9.99999e307, 1e307, 1e-307, -0.0, 5.0, 9e300, 9e303] * 2
        purpose = f"The same of numbers in classes, taps of {sign * 511} and so on."
        shelf.code(f"predict-{name}-classes", purpose, column(values, SIX), [head])


def _constants(shelf: Streams) -> None:
    """Constants of 0 to 8 bytes, the last ones NaN whose payloads no value tells."""
    sizes = [0, -1, 200, -40_000, 2**24 + 1, -(2**37), 2**46, 2**54 + 9, 2**62, -(2**63)]
    grid = DOUBLE
    ordinals = np.array([sizes] * 3, np.int64)
    values = grid.values(ordinals.ravel()).reshape(ordinals.shape)
    motion = panel(values.T.tolist(), (grid,) * len(sizes), ordinals=ordinals)
    purpose = "Constants of 0 to 8 bytes, the greatest and the least ordinal among them."
    shelf.code("constants", purpose, motion, [Constant()] * len(sizes))
    motion = panel([[0.07] * 5, wave(5), [-0.0] * 5, wave(5, 3)], (HUNDREDTHS,) * 4)
    purpose = "Constants between coded channels; other is the side of the coded one before."
    shelf.code("constants-between", purpose, motion, [Constant(), Coded(), Constant(), Coded()])
    purpose = "A coded channel that never changes."
    shelf.code("coded-constant", purpose, column([12.5] * 300, HUNDREDTHS), [Coded()])


def _copies(shelf: Streams) -> None:
    a, b = wave(9), wave(9, 4)
    inside = panel([a, b, a, b], (HUNDREDTHS,) * 4)
    heads: list[Head] = [Copy(0, 2), Coded(), Coded(), Copy(0, 1)]
    purpose = "Copies within a group, of a channel before and of one behind."
    shelf.code("copy-in-group", purpose, inside, heads)
    across = panel([a, b, b, a, a], (HUNDREDTHS,) * 5, (2, 1, 2))
    cases: dict[str, tuple[str, list[Head]]] = {
        "earlier": ("before", [Coded(), Coded(), Copy(0, 1), Copy(0, 0), Copy(0, 0)]),
        "later": ("behind", [Copy(2, 1), Copy(1, 0), Coded(), Copy(2, 1), Coded()]),
        "both": ("before and behind", [Coded(), Copy(1, 0), Coded(), Copy(0, 0), Copy(0, 0)]),
    }
    for name, (where, chosen) in cases.items():
        parts = (partial(across, (2, 7), (1,)), partial(across, (0, 9), (2, 0)))
        purpose = f"Copies of channels of groups {where}; reading one joint needs them."
        shelf.code(f"copy-{name}", purpose, across, chosen, parts=parts)
    fine = Grid(GridKind.FIXED, 4)
    counted = [7, 3, 250, 0, 96]
    columns: list[Any] = [[n / 100 for n in counted], [n / 10_000 for n in counted], counted]
    motion = panel(columns, (HUNDREDTHS, fine, WHOLE))
    purpose = "Copies on other grids: it is the ordinals that are repeated."
    shelf.code("copy-across-grids", purpose, motion, [Coded(), Copy(0, 0), Copy(0, 0)])
    motion = panel([[1.5] * 4, [1.5] * 4], (HUNDREDTHS,) * 2)
    purpose = "A copy of a constant."
    shelf.code("copy-of-constant", purpose, motion, [Copy(0, 1), Constant()])


def _forms(shelf: Streams) -> None:
    half = [v * 0.5 for v in range(-9, 10)]
    coarse = [1.0, -1.5, 2.0**99, 3.0, 0.0, -96.0]
    small = [abs(v) for v in wave(20, 5)]
    floats = [float(np.float32(v)) for v in wave(20, 6)]
    cases: dict[str, tuple[str, Grid, list[float], Coded]] = {
        "again": ("The grid's own form, said again", SIX, half, Coded(form=6)),
        "plain-drop": ("Plain, 3 low bits apart", HUNDREDTHS, wave(20), Coded(form=0, drop=3)),
        "plain-drop-19": ("Plain, 19 bits apart", DOUBLE, half, Coded(form=PLAIN, drop=19)),
        "plain-of-general": ("GENERAL as plain integers", SIX, half, Coded(form=PLAIN)),
        "decimal-of-fixed": ("FIXED in classes of 3 digits", HUNDREDTHS, small, Coded(form=3)),
        "decimal-1": ("Classes of one digit", HUNDREDTHS, small, Coded(form=1)),
        "decimal-15": ("Classes of 15 digits", SIX, half, Coded(form=15)),
        "binary32-drop": ("16 low bits of 0", SINGLE, half, Coded(form=BINARY32, drop=16)),
        "binary32-drop-22": (
            "Mantissas of 2 bits",
            SINGLE,
            [1, 1.5, -2, 3, 0, 96.0],
            Coded(88, 22),
        ),
        "binary64-drop": ("45 low bits of 0", DOUBLE, half, Coded(form=BINARY64, drop=45)),
        "binary64-drop-51": ("2 bits of 53", DOUBLE, coarse, Coded(117, 51)),
        "binary64-of-binary32": ("53 bits where 24 do", SINGLE, floats, Coded(form=BINARY64)),
        "binary32-of-fixed": ("Plain numbers as binary32", HUNDREDTHS, small, Coded(form=BINARY32)),
    }
    for name, (purpose, grid, values, head) in cases.items():
        shelf.code(f"form-{name}", f"{purpose}.", column(values, grid), [head])
    wide = {"general": (SIX, 614), "binary32": (SINGLE, 255), "binary64": (DOUBLE, 2047)}
    for name, (grid, top) in wide.items():
        purpose = f"A greatest class that no number reaches: {name}."
        shelf.code(f"top-{name}", purpose, column(half, grid), [Coded(top=top)])


def _products(shelf: Streams) -> None:
    near, most = [0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0], 2**44 - 1
    wide = [2**31 + 1, -(2**33) - 3, 2**40 + 7, most, -most - 1, 0, 1, 63, -64]
    halves, nines = [500_001, 500_002, -500_003, 0], [1, 11, -101, 3]
    one, fifteen = Grid(GridKind.GENERAL, 1), Grid(GridKind.GENERAL, 15)
    degree = 180 / np.pi
    cases: dict[str, tuple[str, Grid, float, int, list[int]]] = {
        "degrees": ("Angles of a few units in the last place", SIX, degree * 2.0**-60, 12, near),
        "ties": ("Products in the middle of two decimals: to even", SIX, 0.5, 1, halves),
        "nines": ("Products that round up to a power of ten", SIX, 0.0999999999, 2, nines),
        "least": ("The least unit", SIX, 2.0**-200, 3, near),
        "greatest": ("The greatest unit, integers and shifts", SIX, 2.0**80, 63, wide),
        "digits-1": ("One digit", one, degree * 2.0**-50, 5, near),
        "digits-15": ("Fifteen digits", fifteen, degree * 2.0**-50, 4, near),
    }
    for name, (purpose, grid, unit, shifts, codes) in cases.items():
        ordinals = of_products(np.array(codes, np.int64), unit, shifts, grid)
        values = grid.values(ordinals).tolist()
        head = Coded(form=PRODUCTS, unit=unit, shifts=shifts, multiples=tuple(codes))
        shelf.code(f"products-{name}", f"{purpose}.", column(values, grid), [head], version=1)
    motion = column([0.07, 0.08, 0.07], HUNDREDTHS)
    shelf.code("version-1", "Version 1 without its form.", motion, [Coded()], version=1)


def _multiples(shelf: Streams) -> None:
    near, most = [0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0], 2**44 - 1
    wide = [2**31 + 1, -(2**33) - 3, 2**40 + 7, 123_456_789_012, most, -most - 1, 0, 1]
    cases: dict[str, tuple[str, float, list[int]]] = {
        "float": ("A unit that is a binary32", float(np.float32(1 / 12)), near),
        "double": ("A unit that is no binary32", 0.1, near),
        "ties": ("Products in the middle of two binary32: to even", 1 + 2.0**-24, near),
        "twice": ("Products rounded to binary64, then to binary32", 0.1 + 2.0**-50, wide),
        "subnormal": ("Subnormals, some of them in the middle", 1.5 * 2.0**-149, near),
        "vanish": ("The least unit: all multiples vanish, negative ones to -0", 2.0**-200, near),
        "greatest": ("The greatest unit and the greatest multiples", 2.0**80, wide),
    }
    for name, (purpose, unit, counts) in cases.items():
        values = [float(np.float32(count * unit)) for count in counts]
        head = Coded(form=MULTIPLES, unit=unit, multiples=tuple(counts))
        shelf.code(f"multiples-{name}", f"{purpose}.", column(values, SINGLE), [head])
    counts = [row * row - 40 for row in range(12)]
    values = [count * 0.25 for count in counts]
    head = Coded(form=MULTIPLES, unit=0.25, multiples=tuple(counts), taps=(32,))
    motion = panel([values, values, wave(12)], (SINGLE, SINGLE, HUNDREDTHS), (1, 2))
    purpose = "A copy of multiples has the ordinals that they make."
    shelf.code("multiples-copied", purpose, motion, [Copy(1, 0), head, Coded()])
    head = replace(head, multiples=tuple(abs(count) for count in counts))
    purpose = "Multiples on an INTEGER grid: its ordinals are the bits of the binary32."
    bits = SINGLE.ordinals(abs(np.array(values)))[0]
    shelf.code("multiples-of-integer", purpose, column(bits.tolist(), WHOLE), [head])


def _classes(shelf: Streams) -> None:
    near = [1.5, -1.5, 0.0, -0.0, 0.25, 0.0, -0.25, -2.0, 2.0, -0.0, -0.0, 0.0, 1.5, 99.0, 100.0]
    far = [1e-300, 1e300, -1e-300, 0.0, 1e300, -0.0, -1e300, 1.0, 9.99999, 10.0, 1e307, 1e-307]
    smooth = [float(f"{(row - 20) ** 3 / 1000:.5g}") for row in range(41)]
    creep = [float(f"{1.25**row:.4g}") for row in range(-60, 60)]
    cases: dict[str, tuple[str, list[float], Coded]] = {
        "signs": ("Changes of sign, zeros and -0", near, Coded()),
        "far": ("Jumps between the ends of the grid", far, Coded(scale=40)),
        "through-zero": ("A curve through zero", smooth, Coded(taps=(64, -32))),
        "creep": ("Class after class", creep, Coded(taps=(40,))),
        "zeros": ("Nothing but zeros and -0", [0.0, -0.0, -0.0, 0.0, 0.0] * 3, Coded()),
    }
    for grid in (SIX, SINGLE, DOUBLE, Grid(GridKind.TEXT64)):
        for name, (purpose, values, head) in cases.items():
            if grid == SINGLE:
                values = [float(np.float32(min(max(v, -1e38), 1e38))) for v in values]
            kind = grid.kind.name.lower()
            told = f"{purpose}: {grid.kind.name}."
            shelf.code(f"class-{name}-{kind}", told, column(values, grid), [head])
    bits = [0.0, 5e-324, -5e-324, 1.7976931348623157e308, float("nan"), -float("inf"), 1.0]
    purpose = "The first and the last classes of binary64."
    shelf.code("class-ends", purpose, column([*bits, *bits[::-1]], DOUBLE), [Coded()])


def _residuals(shelf: Streams) -> None:
    lengths = [*range(45), *range(43, -1, -1), *[44, 0, 43, 1, 30, 2, 20, 10, 0, 0, 0, 44] * 2]
    values = [(2**n * 2 // 3 + n % 3) * (-1) ** (n // 2) if n else 0 for n in lengths]
    for name, scale in (("small", 0), ("middle", 80), ("large", MAX_SCALE)):
        purpose = f"Residuals of all lengths to 44 bits, up, down and in leaps; scale {scale}."
        head = Coded(scale=scale, from_last=0)
        shelf.code(f"residuals-{name}", purpose, column(values, WHOLE), [head])
    for quarters in range(4):
        head = Coded(scale=40 + quarters)
        purpose = f"A first scale of 40 + {quarters} quarters of an octave that is far too large."
        shelf.code(f"scale-{quarters}", purpose, column([0, 3, -1, 900, 17, 17], WHOLE), [head])
    ends = [1.0, 2 - 2.0**-52, -1.0, -2 + 2.0**-52, 1.0 + 2.0**-52, 1.5, 1.9999, 4.0, 7.99] * 3
    purpose = "Residuals of mantissas of 53 bits, to 52 bits long."
    shelf.code("residuals-mantissas", purpose, column(ends, DOUBLE), [Coded(scale=0)])
    rows = 24
    columns = [[v * 1000 for v in wave(rows)], wave(rows, 1), [v / 10 for v in wave(rows, 2)]]
    columns = [[float(f"{v:.2f}") for v in column] for column in columns]
    motion = panel(columns, (HUNDREDTHS,) * 3)
    heads = [Coded(scale=60), Coded(scale=20), Coded(scale=4)]
    purpose = "Three channels of unlike size: what surprised in a row tells of the next channel."
    shelf.code("surprises", purpose, motion, heads)


def _ends(shelf: Streams) -> None:
    motion = column([0], WHOLE)
    head = Coded(scale=28)
    assert len(build_stream([[0]], (WHOLE,), [head])) == 2
    purpose = "Bits that are all probable enough to need not one byte: a head alone."
    shelf.code("no-bits", purpose, motion, [head], f"{HEADING}; Entropy coding")
    motion = column(wave(12), HUNDREDTHS)
    data = file_of(motion, codec=codec_of(), segments=_another_end)
    purpose = "Another last byte than an encoder takes, which decides the same bits."
    shelf.hold("another-end", "Entropy coding", purpose, data, motion)


def _another_end(made: Made) -> Made:
    """The first stream with another last byte that decodes to the same."""
    ((_, (data,)),) = made
    rows = parse_stream(data, (HUNDREDTHS,), 12)[0]
    other = data[:-1] + bytes((data[-1] + 1,))
    assert np.array_equal(parse_stream(other, (HUNDREDTHS,), 12)[0], rows), "other motion!"
    return list(stream(0, lambda _: other)(made))
