"""Streams of fast: heads, forms, predictors, ranks, symbols, ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.degrees import of_products
from mcz.coding.ordinals.heads import MAX_SCALE
from mcz.numbers import Grid, GridKind
from mcz.numbers.rules import BASE_64
from tools.vectors.build.fast_clips import HEADING, Coded, Head, Streams
from tools.vectors.build.files import partial
from tools.vectors.build.lossless_clips import (
    BINARY32,
    BINARY64,
    COUNTS,
    DOUBLE,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    WHOLE,
    Constant,
    Copy,
)
from tools.vectors.build.motions import HUNDREDTHS, column, grid_cases, panel, wave
from tools.vectors.valid.lossless.counts import values_of

NO_MINUS = (GridKind.INTEGER, GridKind.SCALED, GridKind.VAX_F)  # grids without -0
# Cases of ``grid_cases`` whose ordinals exceed 2^44 on a plain grid, and those of too many classes.
LONG = {"fixed", "fixed-integers", "fixed-22-digits", "integer", "printed", "scaled"}
FIFTEEN = Grid(GridKind.GENERAL, 15)


def add(shelf: Streams) -> None:
    _grids(shelf)
    _predictors(shelf)
    _constants(shelf)
    _copies(shelf)
    _forms(shelf)
    _multiples(shelf)
    _products(shelf)
    _counts(shelf)
    _ranks(shelf)
    _symbols(shelf)


def _grids(shelf: Streams) -> None:
    for name, (grid, values) in grid_cases().items():
        turned = [v if np.isnan(v) or (v == 0 and grid.kind in NO_MINUS) else -v for v in values]
        motion = column([*values, *turned, *values], grid)
        head = Coded(form=PLAIN, drop=10) if name in LONG else Coded()
        if grid.kind in (GridKind.TEXT64, GridKind.BINARY64) or grid.digits == BASE_64:
            head = Coded(form=PLAIN, drop=19)
        purpose = f"Ordinals of a {grid.kind.name} grid, jumping about: {name}."
        shelf.code(f"grid-{name}", purpose, motion, [head], f"{HEADING}; Number grids")


def _predictors(shelf: Streams) -> None:
    cases: dict[str, tuple[str, Coded]] = {
        "order-0": ("No prediction but 0", Coded(from_last=0)),
        "order-1": ("The value before", Coded()),
        "order-2": ("The value and the difference before", Coded(taps=(32,))),
        "order-3": ("Two differences", Coded(taps=(64, -32))),
        "fitted": ("Four taps of mixed signs", Coded(taps=(41, -13, 5, -1))),
        "zero-taps": ("Four taps of zero", Coded(taps=(0,) * 4)),
        "taps-alone": ("Taps without the value before", Coded(from_last=0, taps=(511, -480))),
    }
    for name, (purpose, head) in cases.items():
        motion = column(wave(40), HUNDREDTHS)
        shelf.code(f"predict-{name}", f"{purpose}.", motion, [head])
        motion = column([float(f"{v:.2f}") for v in wave(40, 2)], SIX)
        shelf.code(f"predict-{name}-classes", f"{purpose}; classes.", motion, [head])
    most = 2**44 - 1
    swings = [most, -most - 1, most, most, 0, -most, 5, most, most - 7, -1, -most - 1, 3]
    for name, sign in (("clamped", 1), ("clamped-below", -1)):
        head = Coded(taps=(sign * 511, -sign * 511, sign * 511, -sign * 511), scale=0)
        purpose = f"Differences and predictions at their limits, taps of {sign * 511} and so on."
        shelf.code(f"predict-{name}", purpose, column(swings * 2, WHOLE), [head])
        values = [9.99999e307, -9.99999e307, 1e307, 1e-307, -0.0, 5.0, 9e300, 9e303] * 2
        purpose = f"The same of numbers in classes, taps of {sign * 511} and so on."
        shelf.code(f"predict-{name}-classes", purpose, column(values, SIX), [head])


def _constants(shelf: Streams) -> None:
    sizes = [0, -1, 200, -40_000, 2**24 + 1, -(2**37), 2**46, 2**54 + 9, 2**62, -(2**63)]
    ordinals = np.array([sizes] * 3, np.int64)
    values = DOUBLE.values(ordinals.ravel()).reshape(ordinals.shape)
    motion = panel(values.T.tolist(), (DOUBLE,) * len(sizes), ordinals=ordinals)
    purpose = "Constants of 0 to 8 bytes, the greatest and the least ordinal among them."
    shelf.code("constants", purpose, motion, [Constant()] * len(sizes))
    motion = panel([[0.07] * 5, wave(5), [-0.0] * 5, wave(5, 3)], (HUNDREDTHS,) * 4)
    purpose = "Constants between coded channels."
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
    }
    for name, (where, chosen) in cases.items():
        parts = (partial(across, (2, 7), (1,)), partial(across, (0, 9), (2, 0)))
        purpose = f"Copies of channels of groups {where}; reading one joint needs them."
        shelf.code(f"copy-{name}", purpose, across, chosen, parts=parts)
    counted = [7, 3, 250, 0, 96]
    columns: list[Any] = [[n / 100 for n in counted], counted]
    motion = panel(columns, (HUNDREDTHS, WHOLE))
    purpose = "A copy on another grid: it is the ordinals that are repeated."
    shelf.code("copy-across-grids", purpose, motion, [Coded(), Copy(0, 0)])
    motion = panel([[1.5] * 4, [1.5] * 4], (HUNDREDTHS,) * 2)
    purpose = "A copy of a constant."
    shelf.code("copy-of-constant", purpose, motion, [Copy(0, 1), Constant()])


def _forms(shelf: Streams) -> None:
    half = [v * 0.5 for v in range(-9, 10)]
    coarse = [1.0, -1.5, 2.0**99, 3.0, 0.0, -96.0]
    small = [abs(v) for v in wave(20, 5)]
    floats = [float(np.float32(v)) for v in wave(20, 6)]
    near = [1.0, -1.5, 1.25, 1.0 + 2.0**-52, 0.0, 3.9, -0.0, 7.0]
    fine = [9.99999999999999, 10.0, 9.99999999999998, 123.456789012345, 1e-3, -7.5]
    cases: dict[str, tuple[str, Grid, list[float], Coded]] = {
        "again": ("The grid's own form, said again", SIX, half, Coded(form=6)),
        "plain-drop": ("Plain, 3 low bits apart", HUNDREDTHS, wave(20), Coded(form=0, drop=3)),
        "plain-drop-19": ("Plain, 19 bits apart", DOUBLE, half, Coded(form=PLAIN, drop=19)),
        "plain-of-general": ("GENERAL as plain integers", SIX, half, Coded(form=PLAIN)),
        "decimal-of-fixed": ("FIXED in classes of 3 digits", HUNDREDTHS, small, Coded(form=3)),
        "decimal-1": ("Classes of one digit", HUNDREDTHS, small, Coded(form=1)),
        "decimal-15": ("Classes of 15 digits", FIFTEEN, fine, Coded()),
        "binary32-drop": ("16 low bits of 0", SINGLE, half, Coded(form=BINARY32, drop=16)),
        "binary32-drop-22": ("2 bits of 24", SINGLE, [1, 1.5, -2, 3, 0, 96.0], Coded(88, 22)),
        "binary64-drop": ("45 low bits of 0", DOUBLE, half, Coded(form=BINARY64, drop=45)),
        "binary64-drop-51": ("2 bits of 53", DOUBLE, coarse, Coded(117, 51)),
        "binary64": ("Mantissas of 53 bits", DOUBLE, near, Coded()),
        "binary64-of-binary32": ("53 bits where 24 do", SINGLE, floats, Coded(form=BINARY64)),
        "binary32-of-fixed": ("Plain numbers as binary32", HUNDREDTHS, small, Coded(form=BINARY32)),
    }
    for name, (purpose, grid, values, head) in cases.items():
        shelf.code(f"form-{name}", f"{purpose}.", column(values, grid), [head])
    wide = {"general": (SIX, 614), "binary32": (SINGLE, 255), "binary64": (DOUBLE, 2047)}
    for name, (grid, top) in wide.items():
        depth = {"general": 614, "binary32": 255, "binary64": 255}[name]
        values = [2.0**900, 2.0**899, 2.0**890] if name == "binary64" else half
        purpose = f"A greatest class that no number reaches, and all {depth} below: {name}."
        if name == "binary64":
            purpose = "As many classes of 53 digits as there may be: binary64."
        head = Coded(top=top, depth=depth)
        shelf.code(f"top-{name}", purpose, column(values, grid), [head])


def _multiples(shelf: Streams) -> None:
    near, most = [0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0], 2**44 - 1
    wide = [2**31 + 1, -(2**33) - 3, 2**40 + 7, 123_456_789_012, most, -most - 1, 0, 1]
    cases: dict[str, tuple[str, float, list[int]]] = {
        "ties": ("Products in the middle of two binary32: to even", 1 + 2.0**-24, near),
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


def _products(shelf: Streams) -> None:
    near, most = [0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0], 2**44 - 1
    wide = [2**31 + 1, -(2**33) - 3, most, -most - 1, 0, 1, 63, -64]
    degree = 180 / np.pi
    cases: dict[str, tuple[str, Grid, float, int, list[int]]] = {
        "degrees": ("Angles of a few units in the last place", SIX, degree * 2.0**-60, 12, near),
        "greatest": ("The greatest unit, integers and shifts", SIX, 2.0**80, 63, wide),
        "digits-15": ("Fifteen digits", FIFTEEN, degree * 2.0**-50, 4, near),
    }
    for name, (purpose, grid, unit, shifts, codes) in cases.items():
        ordinals = of_products(np.array(codes, np.int64), unit, shifts, grid)
        head = Coded(form=PRODUCTS, unit=unit, shifts=shifts, multiples=tuple(codes), taps=(32,))
        motion = column(grid.values(ordinals).tolist(), grid)
        shelf.code(f"products-{name}", f"{purpose}.", motion, [head])


def _counts(shelf: Streams) -> None:
    near = (0, 1, -1, 2, 3, -5, 7, 1000, -999, 2**20, 5, 0)
    some, far = (0, 0, 1, 0, -1, 0, 0, 2, 0, 0, -40, 0), (0, 2**30, -(2**30), 77, 2**24, 0, -1, 3)
    most, volt, far_off = 2**44 - 1, 10 / 65535, 2.0**80
    wide = (2**31 + 1, -(2**33) - 3, most, -most - 1, 0, 1, -1)
    ends = (most, -most - 1, 0, 5, most, most, -1, 0)
    cases: dict[str, tuple[str, Law, tuple[int, ...], tuple[int, ...], Grid]] = {
        "alone": ("No sum is made", Law(0.1), near, (), SINGLE),
        "both": ("Offset and shift", Law(volt, 6.0, -6.01), near, (), SINGLE),
        "shift": ("A shift alone", Law(volt, None, -1.7), near, (), SINGLE),
        "greatest": ("The greatest of all", Law(far_off, far_off, far_off), wide, (), SINGLE),
        "rests": ("Rests of some rows", Law(volt, 0.3), near, some, SINGLE),
        "rests-far": ("Rests to far numbers", Law(volt, 0.3), near[:8], far, SINGLE),
        "rests-most": ("Rests as far as they go", Law(volt, 6.0, -6.0), near[:8], ends, DOUBLE),
    }
    for name, (purpose, law, counts, rests, grid) in cases.items():
        head = Coded(form=COUNTS, law=law, multiples=counts, rests=rests, taps=(32,))
        motion = column(values_of(head, grid), grid)
        shelf.code(f"counts-{name}", f"{purpose}.", motion, [head])
    first = Coded(form=COUNTS, law=Law(volt, 0.3), multiples=near, rests=some, taps=(32,))
    second = Coded(form=COUNTS, law=Law(0.1), multiples=near, rests=some[::-1])
    made = [values_of(head, SINGLE) for head in (first, second)]
    columns = [made[0], wave(12), [2.5] * 12, made[1], made[0]]
    grids = (SINGLE, HUNDREDTHS, SINGLE, SINGLE, SINGLE)
    purpose = "Rests of two channels lie behind the coded ones of their group; a copy has both."
    heads = [first, Coded(), Constant(), second, Copy(0, 0)]
    shelf.code("counts-among-others", purpose, panel(columns, grids, (4, 1)), heads)


def _ranks(shelf: Streams) -> None:
    near = [1.5, -1.5, 0.0, -0.0, 0.25, 0.0, -0.25, -2.0, 2.0, -0.0, -0.0, 0.0, 1.5, 99.0, 100.0]
    far = [1e-30, 1e30, -1e-30, 0.0, 1e30, -0.0, -1e30, 1.0, 9.99999, 10.0, 1e37, 1e-37]
    smooth = [float(f"{(row - 20) ** 3 / 1000:.5g}") for row in range(41)]
    creep = [float(f"{1.25**row:.4g}") for row in range(-60, 60)]
    edge = [float(f"{10 + (-1) ** row * row / 5000:.6g}") for row in range(40)]
    cases: dict[str, tuple[str, list[float], Coded]] = {
        "signs": ("Changes of sign, zeros and -0", near, Coded()),
        "far": ("Jumps over seventy classes", far, Coded(scale=40)),
        "through-zero": ("A curve through zero", smooth, Coded(taps=(64, -32))),
        "creep": ("Class after class", creep, Coded(taps=(40,))),
        "edge": ("About the edge of two classes", edge, Coded(taps=(16, 8, 4, 2))),
        "zeros": ("Nothing but zeros and -0", [0.0, -0.0, -0.0, 0.0, 0.0] * 3, Coded()),
    }
    for grid in (SIX, SINGLE, DOUBLE, Grid(GridKind.TEXT64)):
        for name, (purpose, values, head) in cases.items():
            if grid == SINGLE:
                values = [float(np.float32(v)) for v in values]
            kind = grid.kind.name.lower()
            told = f"{purpose}: {grid.kind.name}."
            shelf.code(f"rank-{name}-{kind}", told, column(values, grid), [head])
    bits = [0.0, 5e-324, -5e-324, 1e-323, 0.0]
    purpose = "The least numbers of binary64, which are all of one class."
    shelf.code("rank-least", purpose, column(bits, DOUBLE), [Coded()])
    bits = [1.7976931348623157e308, float("nan"), -float("inf"), 1e308, 9e307]
    purpose = "The last classes of binary64, infinity and NaN."
    shelf.code("rank-greatest", purpose, column(bits, DOUBLE), [Coded()])
    deep = [1e12, 1e-10, 3.5e-9, 1e12, -2e-8, 1.0]
    purpose = "Classes whose numbers are 0 in fixed point beside ones whose are not."
    shelf.code("rank-vanishing", purpose, column(deep, SIX), [Coded(taps=(32,))])


def _symbols(shelf: Streams) -> None:
    """Misses of all lengths, all scales."""
    lengths = [*range(44), *range(43, -1, -1), *[43, 0, 43, 1, 30, 2, 20, 10, 0, 0, 0, 43] * 2]
    values = [(2**n * 2 // 3 + n % 3) * (-1) ** (n // 2) if n else 0 for n in lengths]
    for name, scale in (("small", 0), ("middle", 80), ("large", MAX_SCALE)):
        purpose = f"Misses of all lengths to 44 bits, up, down and in leaps; scale {scale}."
        head = Coded(scale=scale, from_last=0)
        shelf.code(f"misses-{name}", purpose, column(values, WHOLE), [head])
    for quarters in range(4):
        head = Coded(scale=40 + quarters)
        purpose = f"A first scale of 40 + {quarters} quarters of an octave that is far too large."
        shelf.code(f"scale-{quarters}", purpose, column([0, 3, -1, 900, 17, 17], WHOLE), [head])
    step, every = 0, []
    for size in range(400):  # each symbol of many a context
        step += (size * size // 7 % 97) * (-1) ** size
        every.append(step)
    shelf.code("symbols", "Most of the symbols.", column(every, WHOLE), [Coded(scale=12)])
    for n in range(8):
        purpose = f"A last byte of bits with {n} bits that no number has."
        counts = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512][: 2 + n]
        shelf.code(f"bits-{n}", purpose, column(counts, WHOLE), [Coded(scale=20 + n)])
    shelf.code("one-zero", "A coded 0 alone: a state and six bits.", column([0], WHOLE), [Coded()])
