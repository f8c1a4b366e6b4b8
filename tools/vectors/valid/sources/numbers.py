"""BVH files whose numbers are printed in every style that a grid can tell, with its ends."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.formats import bvh
from mcz.motion import Exceptions, Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.source_files import (
    BOTH,
    HEADING,
    blank,
    hierarchy,
    path_of,
    restored,
    take,
    unhashed,
)

TOP = """\
HIERARCHY
ROOT Prop
{
\tOFFSET 0 0 0
\tCHANNELS 3 Xposition Yposition Zposition
\tEnd Site
\t{
\t\tOFFSET 0 1 0
\t}
}
MOTION
Frames: %d
Frame Time: 0.01
"""
F = GridFlag
# Twelve or fifteen tokens each, written out by hand or by the rules of another language.
STYLES: dict[str, tuple[Grid, str]] = {
    "text32": (
        Grid(GridKind.TEXT32),
        (
            "0.1 16777216 3.4028235e+38 1e-45 -0 1.1754944e-38 0.33333334 -123456.79 5e-05 "
            "1.2621775e-29 1e+16 0.0001"
        ),
    ),
    "python": (
        Grid(GridKind.TEXT64, 0, F.POINT_ZERO),
        (
            "0.1 1.0 -0.0 1e-07 1e+16 0.30000000000000004 123456789012345.67 9007199254740992.0 "
            "5e-324 1.7976931348623157e+308 0.0001 -2.5e-05"
        ),
    ),
    "shortest": (
        Grid(GridKind.TEXT64),
        (
            "0.1 1 -0 1e-07 1e+16 0.30000000000000004 123456789012345.67 9007199254740992 5e-324 "
            "1.7976931348623157e+308 0.0001 -2.5e-05"
        ),
    ),
    "javascript": (
        Grid(GridKind.TEXT64, 1, F.EXPONENT1),
        (
            "0.1 1 0 1e-7 1e+21 0.30000000000000004 123456789012345680000 100000000000000000000 "
            "5e-324 1.7976931348623157e+308 0.000001 -2.5e-7"
        ),
    ),
    "17g": (
        Grid(GridKind.TEXT64, 17),
        (
            "0.10000000000000001 1 -0 9.9999999999999995e-08 1e+17 0.30000000000000004 "
            "12345678901234568 -2.5 4.9406564584124654e-324 1.7976931348623157e+308 "
            "0.0001 1.0000000000000001e-05"
        ),
    ),
    "16g": (
        Grid(GridKind.TEXT64, 16),
        (
            "0.1 1 -0 1e-07 1e+16 0.3 0.3333333333333333 -2.5 4.940656458412465e-324 "
            "1.797693134862316e+307 1234567890123457 6.02214076e+23"
        ),
    ),
    "20f": (
        Grid(GridKind.TEXT64, 84),
        (
            "0.10000000000000000555 1.00000000000000000000 -0.00000000000000000000 "
            "0.00000010000000000000 -2.50000000000000000000 0.33333333333333331483 "
            "100000000000000000000.00000000000000000000 123456789.12345679104328155518 "
            "0.00000000000000000001 0.29999999999999998890 -7.00000000000000000000 "
            "0.30000000000000004441"
        ),
    ),
    "upper": (
        Grid(GridKind.GENERAL, 6, F.UPPER),
        "1.5E-07 1E+10 0.25 -3.125E+20 0 -0 123456 1E+06 1.5E-300 9.99999E+307 0.0001 1E-05",
    ),
    "exponent1": (
        Grid(GridKind.GENERAL, 6, F.EXPONENT1),
        "1.5e-7 1e+9 0.25 -3.125e+20 0 -0 123456 1e+6 1.5e-300 9.99999e+307 0.0001 1e-5",
    ),
    "exponent3-upper": (
        Grid(GridKind.GENERAL, 6, F.EXPONENT3 | F.UPPER),
        "1.5E-007 1E+009 0.25 -3.125E+020 0 -0 123456 1E+006 1.5E-300 9.99999E+307 0.0001 1E-005",
    ),
    "plus": (
        Grid(GridKind.FIXED, 2, F.PLUS),
        "+1.50 -0.25 +0.00 -0.00 +100.00 +0.01 -99.99 +3.14 +2.72 -1.00 +7.00 +0.10",
    ),
    "point": (Grid(GridKind.FIXED, 0, F.POINT), "12. -3. 0. -0. 7. 8. 90. 100. -5. 6. 1. 2."),
    "trimmed-point": (
        Grid(GridKind.TRIMMED, 3, F.POINT),
        "1. 0.25 -3.5 0. -0. 100. 0.125 7. -8. 9.5 1.001 20.",
    ),
    "point-zero": (
        Grid(GridKind.TRIMMED, 3, F.POINT_ZERO),
        "1.0 0.25 -3.5 0.0 -0.0 100.0 0.125 7.0 -8.0 9.5 1.001 20.0",
    ),
    "no-zero": (
        Grid(GridKind.FIXED, 2, F.NO_ZERO),
        ".50 -.25 12.00 .00 -.00 1.05 -7.25 .01 -.99 100.00 .10 -1.00",
    ),
    "trimmed-no-zero": (
        Grid(GridKind.TRIMMED, 3, F.NO_ZERO),
        ".5 -.25 12 0 -0 1.05 -7.25 .001 -.999 100 .1 -1",
    ),
    "18e": (
        Grid(GridKind.PRINTED, 64, style=210),
        (
            "9.669363727051634438e-03 0.000000000000000000e+00 -5.000000000000000104e-04 "
            "1.000000000000000021e-03 -0.000000000000000000e+00 1.797693134862315708e+308 "
            "4.940656458412465442e-324 2.500000000000000000e+00 -1.000000000000000000e+22 "
            "3.333333333333333148e-01 1.234567890123456717e+09 -7.000000000000000000e+00"
        ),
    ),
    "18e-decimals": (
        Grid(GridKind.PRINTED, 4, style=210),
        (
            "5.000000000000000104e-04 0.000000000000000000e+00 -1.000000000000000048e-04 "
            "1.000000000000000021e-03 -0.000000000000000000e+00 1.234567890999999945e+05 "
            "1.234566999999999979e+02 -2.500000000000000000e+00 9.999899999999999636e+03 "
            "3.330000000000000182e-01 1.000000000000000000e+00 -7.000000000000000000e+00"
        ),
    ),
    "2e-upper": (
        Grid(GridKind.PRINTED, 131, F.UPPER, style=194),
        (
            "-2.73E-01 7.46E-02 -1.57E+00 0.00E+00 -0.00E+00 9.99E+307 1.00E-307 5.50E+10 "
            "-1.00E+100 3.00E+00 1.23E-05 4.56E+06"
        ),
    ),
    "20f-of-17-digits": (
        Grid(GridKind.PRINTED, 64, style=84),
        (
            "0.50170000000000003000 0.00000000000000000000 12.81530059000000000000 "
            "0.24999969999999250000 0.00000410605182992599 10.72562839040902800000 "
            "-0.00000000000000000000 123456789012345680.00000000000000000000 "
            "100000000000000000000.00000000000000000000 0.00000000000000000001 "
            "-0.99999999999999989000 1.00000000000000000000"
        ),
    ),
    "16g-of-binary32": (
        Grid(GridKind.PRINTED, 32, style=144),
        (
            "3538.87939453125 665.2630615234375 1547.538452148438 0 -0 -2.275110006332397 "
            "0.1000000014901161 3.402823466385289e+38 1.401298464324817e-45 16777216 "
            "9.999999747378752e-06 0.25"
        ),
    ),
    "8f-of-binary32": (
        Grid(GridKind.PRINTED, 32, style=8),
        (
            "2.27511001 -0.88972002 -14.20642757 918.59997559 611.09497070 0.00000000 -0.00000000 "
            "0.00000001 16777216.00000000 -1.18654180 850.02319336 0.10000000"
        ),
    ),
    "every-flag": (
        Grid(GridKind.GENERAL, 6, F.PLUS | F.NO_ZERO | F.UPPER | F.EXPONENT1 | F.POINT_ZERO),
        "+.5 -.25 +12.0 +0.0 -0.0 +1.5E+7 -1E-7 +.0001 -.125 +100.0 +1E+6 -3.0",
    ),
}
NONE = F(0)
WHOLES = (NONE, F.POINT_ZERO, F.POINT)
EXPONENTS = (NONE, F.EXPONENT3, F.EXPONENT1)
MOST = 2**51 - 1  # magnitude of FIXED and TRIMMED
TEXT64_BITS = (
    0x0000000000000001,  # 5e-324
    0x7FEFFFFFFFFFFFFF,
    0x3FF0000000000000,  # 1
    0x3FB999999999999A,  # 0.1
    0x3FE0000000000000,
    0x405EC00000000000,  # 123
    0x4340000000000000,  # 2^53
    0x4341C37937E08000,  # 1e16
    0x430C6BF526340000,  # 1e15
    0x3F1A36E2EB1C432D,  # 1e-4
    0x3EE4F8B588E368F1,  # 1e-5
    0x3EB0C6F7A0B5ED8D,  # 1e-6
    0x3E7AD7F29ABCAF48,  # 1e-7
    0x444B1AE4D6E2EF50,  # 1e21
    0x4415AF1D78B58C40,  # 1e20
    0x5570000000000000,
)


def add(shelf: Whole) -> None:
    _styles(shelf)
    for name, grids, magnitudes in _tables():
        _printed(shelf, name, grids, magnitudes)
    _printed_ties(shelf)


def _styles(shelf: Whole) -> None:
    for name, (grid, words) in STYLES.items():
        source = text_of(words.split())
        motion = on_grid(take(source, f"style-{name}"), grid)
        assert bvh.write(motion) == source, name
        data = file_of(motion, codec=codec_of())
        purpose = f"Numbers printed in one style: {grid.kind.name}, {name}."
        spec = f"{HEADING}; Ordinal to text"
        sources = ((f"style-{name}.bvh", source),)
        shelf.hold(f"bvh-style-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def text_of(words: list[str]) -> bytes:
    """A BVH file of three columns."""
    rows = [" ".join(words[start : start + 3]) for start in range(0, len(words), 3)]
    return (TOP % len(rows) + "\n".join(rows) + "\n").encode()


def on_grid(motion: Motion, grid: Grid) -> Motion:
    """``motion`` with all tokens on ``grid``, whichever grids its reader has chosen."""
    old = motion.signals[0]
    grids = (grid,) * old.n_channels
    signal = replace(old, grids=grids, exceptions=Exceptions(), grid_changes=())
    _, exact = signal.to_ordinals()
    assert exact.all(), (grid, np.nonzero(~exact))
    return replace(motion, signals=(signal,))


def _flags(*choices: Sequence[GridFlag]) -> list[GridFlag]:
    """One of each, in every combination."""
    found = []
    for chosen in product(*choices):
        flags = NONE
        for flag in chosen:
            flags |= flag
        found.append(flags)
    return found


def _tables() -> Iterable[tuple[str, list[Grid], Sequence[Sequence[int]]]]:
    """Names, grids, and the magnitudes of each grid."""
    zero, plus = (NONE, F.NO_ZERO), (NONE, F.PLUS)
    fixed = [Grid(GridKind.FIXED, 0, flags) for flags in _flags((NONE, F.POINT), plus)]
    for digits in (1, 3, 15, 22):
        fixed += [Grid(GridKind.FIXED, digits, flags) for flags in _flags(zero, plus)]
    yield "fixed", fixed, [_decimals(grid.digits) for grid in fixed]
    trimmed = [
        Grid(GridKind.TRIMMED, digits, flags)
        for digits in (1, 3, 22)
        for flags in _flags(WHOLES, zero, plus)
    ]
    yield "trimmed", trimmed, [_decimals(grid.digits) for grid in trimmed]
    every = _flags(WHOLES, zero, plus, EXPONENTS, (NONE, F.UPPER))
    general = [Grid(GridKind.GENERAL, 6, flags) for flags in every]
    general += [Grid(GridKind.GENERAL, digits) for digits in range(1, 16)]
    yield "general", general, [_general(grid.digits) for grid in general]
    for digits in (0, 1, 16, 17):
        grids = [Grid(GridKind.TEXT64, digits, flags) for flags in every]
        yield f"text64-{digits}", grids, [TEXT64_BITS] * len(grids)
    places = [Grid(GridKind.TEXT64, 64 + places) for places in range(10, 41)]
    short = [0x444B1AE4D6E2EF4F, *(b for b in TEXT64_BITS if b < 0x444B1AE4D6E2EF4F)]
    yield "text64-places", places, [short[:12]] * len(places)
    yield "printed", *_printed_grids(every)
    words = [0, 1, 0x7F7FFFFF, 0x3F800000, 0x3DCCCCCD, 0x42F60000, 0x4B800000, 0x5A0E1BCA]
    words += [0x38D1B717, 0x3727C5AC, 0x0F800000, 0x007FFFFF]
    text32 = [Grid(GridKind.TEXT32, 0, flags) for flags in every]
    yield "text32", text32, [words] * len(text32)


def _printed_grids(every: Sequence[GridFlag]) -> tuple[list[Grid], list[Sequence[int]]]:
    """PRINTED grids of all sorts, and magnitudes of each."""
    styles = [0, 3, 40, 64, 80, 104, 129, 144, 145, 192, 208, 232]
    grids = [
        Grid(GridKind.PRINTED, digits, style=s) for digits in (0, 4, 22, 32, 64) for s in styles
    ]
    grids += [Grid(GridKind.PRINTED, 64, flags, style=145) for flags in every]
    exponents = _flags((NONE, F.PLUS), EXPONENTS, (NONE, F.UPPER))
    grids += [Grid(GridKind.PRINTED, 131, flags, style=194) for flags in exponents]
    grids += [Grid(GridKind.PRINTED, 128 + n, style=191 + n) for n in (1, 15)]
    found: list[Sequence[int]] = []
    for grid in grids:
        if grid.digits > 128:
            found.append(_general(grid.digits - 128))
        elif grid.digits < 32:
            found.append(_decimals(grid.digits))
        else:
            words = (0x3F800000, 0x3DCCCCCD, 0x42F60000, 0x5A0E1BCA, 0x38D1B717, 0x3A83126F)
            bits = [b for b in TEXT64_BITS if b <= grid.limit] if grid.digits == 64 else [*words]
            found.append([0, 1, grid.limit, *bits, *[0] * 9][:12])
    return grids, found


def _decimals(digits: int) -> list[int]:
    unit = 10 ** min(digits, 13)
    found = [0, 1, MOST, unit, 7 * unit // 10, unit - 1, 12 * unit + 5, 30 * unit]
    return [*found, 100 * unit, unit // 2 + 1, MOST - 1, 9]


def _general(digits: int) -> list[int]:
    """Both ends, and where exponents begin and end."""
    block, most = 9 * 10 ** (digits - 1), 5535 * 10 ** (digits - 1)

    def number(first: int, exponent: int) -> int:
        """The magnitude of ``first`` times 10^exponent, one digit."""
        return 1 + (exponent + 307) * block + (first - 1) * 10 ** (digits - 1)

    found = [0, 1, most, number(1, 0), number(5, -1), number(1, -4), number(2, -5)]
    found += [number(3, digits - 1), number(3, digits), number(7, -100), number(9, 99)]
    return [*found, number(1, 1) - 1]


def _printed(
    shelf: Whole, name: str, grids: Sequence[Grid], magnitudes: Sequence[Sequence[int]]
) -> None:
    """A BVH file with a column a grid, its magnitudes with a plus and a minus in turn."""
    n_columns = -(-len(grids) // 6) * 6
    every = [*grids, *[grids[-1]] * (n_columns - len(grids))]
    columns = []
    for place in range(n_columns):
        own = magnitudes[min(place, len(grids) - 1)]
        signed = [-1 - m if (row + place) % 2 else m for row, m in enumerate([*own, *own[:1]])]
        columns.append(_read_back(every[place], np.array(signed, np.int64)))
    texts = [grid.texts(o).tolist() for grid, o in zip(every, columns, strict=True)]
    n_rows = len(columns[0])
    words = [b" ".join(row) for row in zip(*texts, strict=True)]
    head = hierarchy(n_columns // 6) + f"MOTION\nFrames: {n_rows}\nFrame Time: 0.01\n"
    source = head.encode() + b"\n".join([*words, b""])
    values = np.array([g.values(o) for g, o in zip(every, columns, strict=True)]).T
    motion = take(source, f"flags-{name}")
    assert np.array_equal(motion.signals[0].values, values), name
    motion = replace(motion, signals=(Signal(values, tuple(every)),))
    assert bvh.write(motion) == source, name
    purpose = f"Numbers at both ends and between, in every style of their grid: {name}."
    data = file_of(motion, grouping="all")
    spec = f"{HEADING}; Ordinal to text"
    sources = ((f"flags-{name}.bvh", source),)
    shelf.hold(f"bvh-flags-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _read_back(grid: Grid, ordinals: NDArray[np.int64]) -> NDArray[np.int64]:
    """``ordinals``, 0 in place of those whose text has lost digits: a writer has none such."""
    read = np.array([float(text) for text in grid.texts(ordinals).tolist()])
    lost = read != grid.values(ordinals)
    return np.where(lost, 0, ordinals)


def _printed_ties(shelf: Whole) -> None:
    """Numbers that lie halfway between two texts: the even one is printed."""
    halves = [k / 16 for k in range(197_530_862_419_753, 197_530_862_419_793, 2)]
    sixteen = [k / 16 for k in range(19_753_086_241_975, 19_753_086_242_015, 2)]
    small = [(2 * k + 1) / 2.0**24 for k in (0, 1, 2, 7, 100, 101, 12345, 999_999)]
    columns = {17: halves, 16: sixteen}
    for digits, values in columns.items():
        grids = [Grid(GridKind.TEXT64, digits)] * 6
        table = np.array([*values, *small]).reshape(-1, 1).repeat(6, axis=1)
        table[:, 1::2] *= -1
        purpose = f"Numbers whose exact value lies halfway between two of {digits} digits."
        _print(shelf, f"ties-{digits}-digits", purpose, grids, table)
    grids = [Grid(GridKind.TEXT64, 64 + places) for places in range(10, 41)]
    grids += [grids[-1]] * (-len(grids) % 6)
    table = np.array([[c / 2.0 ** (g.digits - 63) for g in grids] for c in (1, 3, 5, 7, 2**12 + 1)])
    purpose = "Numbers whose exact value lies halfway between two of 10 to 40 decimals."
    _print(shelf, "ties-decimals", purpose, grids, table)
    words = [0x39800000, *range(0x3F808000, 0x3F808000 + 8 * 0x10000, 0x10000), 0x3F818000]
    values = Grid(GridKind.TEXT32).values(np.array(words))
    table = np.array(values).reshape(-1, 1).repeat(6, axis=1)
    purpose = "Words of binary32 with two shortest decimals equally near, of which the even counts."
    _print(shelf, "ties-text32", purpose, [Grid(GridKind.TEXT32)] * 6, table)
    doubles = np.array([(513 + 2 * k) / 2.0**20 for k in range(8)])
    table = doubles.reshape(-1, 1).repeat(6, axis=1)
    grids = [Grid(GridKind.TEXT64, 0), Grid(GridKind.TEXT64, 1)] * 3
    purpose = "Words of binary64 with two shortest decimals equally near, of which the even counts."
    _print(shelf, "ties-text64", purpose, grids, table)
    small = [10 / 2.0**24, *(k / 2.0**24 for k in range(1, 4000) if _is_tie(k / 2.0**24))][:12]
    table = np.array(small).reshape(-1, 1).repeat(6, axis=1)
    purpose = "The same below 10^-6; 5.9604644775390625e-7 is the first."
    _print(shelf, "ties-text64-small", purpose, grids, table)


def _is_tie(value: float) -> bool:
    """Whether the shortest text that means ``value`` has another that is as near and as short."""
    digits = repr(value).partition("e")[0].replace(".", "").lstrip("0")
    exact = Decimal(value).as_tuple().digits
    return len(exact) == len(digits) + 1 and exact[-1] == 5 and len(digits) >= 16


def _print(shelf: Whole, name: str, purpose: str, grids: Sequence[Grid], table: Any) -> None:
    """A lossless clip of these values on these grids, one a column."""
    motion = unhashed(blank(len(table), grids, name))
    motion = replace(motion, signals=(Signal(np.array(table), tuple(grids)),))
    data = file_of(motion, grouping="all")
    spec = f"Decimal and binary64; Ordinal to text; {HEADING}"
    sources = ((path_of(motion), restored(motion)),)
    shelf.hold(f"bvh-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)
