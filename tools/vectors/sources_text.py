"""Valid: BVH files whose numbers are printed in every style that a grid can tell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.formats import bvh
from mcz.motion import Exceptions, Motion
from mcz.numbers import Grid, GridFlag, GridKind
from tools.vectors.coded import codec_of
from tools.vectors.craft import Vector, Whole, file_of
from tools.vectors.sources import BOTH, HEADING, take

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
    "every-flag": (
        Grid(GridKind.GENERAL, 6, F.PLUS | F.NO_ZERO | F.UPPER | F.EXPONENT1 | F.POINT_ZERO),
        "+.5 -.25 +12.0 +0.0 -0.0 +1.5E+7 -1E-7 +.0001 -.125 +100.0 +1E+6 -3.0",
    ),
}


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    for name, (grid, words) in STYLES.items():
        source = text_of(words.split())
        motion = on_grid(take(source, f"style-{name}"), grid)
        assert bvh.write(motion) == source, name
        data = file_of(motion, codec=codec_of())
        purpose = f"Numbers printed in one style: {grid.kind.name}, {name}."
        spec = f"{HEADING}; Ordinal to text"
        sources = ((f"style-{name}.bvh", source),)
        shelf.hold(f"bvh-style-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)
    return shelf.vectors


def text_of(words: list[str]) -> bytes:
    """A BVH file of three columns."""
    rows = [" ".join(words[start : start + 3]) for start in range(0, len(words), 3)]
    return (TOP % len(rows) + "\n".join(rows) + "\n").encode()


def on_grid(motion: Motion, grid: Grid) -> Motion:
    """``motion`` with all tokens on ``grid``, whichever grids its reader has chosen."""
    old = motion.signals[0]
    grids = (grid,) * old.n_channels
    signal = replace(old, grids=grids, exceptions=Exceptions(), grid_changes=())
    _, exact = signal.place()
    assert exact.all(), (grid, np.nonzero(~exact))
    return replace(motion, signals=(signal,))
