"""Valid: ``best``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.codecs.lossless.best_streams import AS_CODEC_1, LINKED, Link
from mcz.codecs.lossless.echoes import Echo
from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.degrees import of_products
from mcz.motion import Motion
from mcz.numbers import Grid, GridKind
from tools.vectors.build.best_clips import HEADING, Streams
from tools.vectors.build.files import Vector, partial
from tools.vectors.build.lossless_clips import (
    BINARY64,
    COUNTS,
    DOUBLE,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    WHOLE,
    Coded,
    Constant,
    Copy,
)
from tools.vectors.build.motions import (
    HUNDREDTHS,
    column,
    dance,
    grid_cases,
    numbers,
    panel,
    wave,
)
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.lossless.counts import values_of

NO_MINUS = (GridKind.INTEGER, GridKind.SCALED, GridKind.VAX_F)  # grids without -0
LONG = {"fixed", "fixed-integers", "fixed-22-digits", "integer", "printed", "scaled"}  # from 2^44


def vectors() -> Iterable[Vector]:
    shelf = Streams("valid/best")
    _grids(shelf)
    _counts(shelf)
    _methods(shelf)
    _links(shelf)
    _echoes(shelf)
    _odd_echoes(shelf)
    _degenerate(shelf)
    _classes(shelf)
    _rows(shelf)
    every_codec.no_channels(shelf, "best")
    every_codec.add(shelf, "best")
    return shelf.vectors


def _grids(shelf: Streams) -> None:
    for name, (grid, values) in grid_cases().items():
        head = Coded(form=PLAIN, drop=10) if name in LONG else Coded()
        turned = [v if np.isnan(v) or (v == 0 and grid.kind in NO_MINUS) else -v for v in values]
        purpose = f"Ordinals of a {grid.kind.name} grid, jumping about: {name}."
        spec = f"{HEADING}; Number grids"
        motion = column([*values, *turned, *values], grid)
        shelf.code(f"grid-{name}", purpose, motion, [head], spec=spec)
    counts = tuple(round(50 * v) for v in wave(40))
    motion = column([0.25 * count for count in counts], SINGLE)
    head = Coded(MULTIPLES, unit=0.25, multiples=counts)
    shelf.code("multiples", "Multiples of a unit, form 32.", motion, [head])
    values = SIX.values(of_products(np.array(counts), 0.25, 3, SIX)).tolist()
    head = Coded(PRODUCTS, unit=0.25, shifts=3, multiples=counts)
    shelf.code("products", "Products, form 33.", column(values, SIX), [head])


def _counts(shelf: Streams) -> None:
    counts = tuple(round(50 * v) for v in wave(40))
    rests = tuple((row % 7 == 3) - 40 * (row == 11) for row in range(40))
    law = Law(10 / 65535, 6.0, -6.01)
    first = Coded(COUNTS, law=law, multiples=counts)
    shelf.code("counts", "Counts, form 34.", column(values_of(first, SINGLE), SINGLE), [first])
    last = Coded(COUNTS, law=Law(0.1), multiples=counts[::-1], rests=rests[::-1])
    heads = [replace(first, rests=rests), Coded(), last]
    columns = [values_of(heads[0], SINGLE), wave(40, 3), values_of(last, SINGLE)]
    motion = panel(columns, (SINGLE, HUNDREDTHS, SINGLE))
    links = [
        Link(4, 9, ()),
        Link(4, 9, (0,)),
        Link(4, 9, (0, 1)),
        Link(0, 2, (0, 2)),
        Link(1, 1, (3,)),
    ]
    purpose = (
        "Rests of two channels are numbered behind the coded ones, and look at any before them."
    )
    shelf.code("counts-rests", purpose, motion, heads, links)
    purpose = "The same, coded as lossless does."
    shelf.code("counts-as-codec-1", purpose, motion, heads, methods=(AS_CODEC_1,))


def _panel(n_rows: int, n: int) -> Motion:
    """Waves of which each is somewhat the sum of those before, on two grids."""
    columns = [wave(n_rows, seed) for seed in range(n)]
    for place in range(2, n):
        mixed = [a / 2 + b / 4 for a, b in zip(columns[place - 1], columns[place - 2], strict=True)]
        columns[place] = [round(v, 2) for v in mixed]
    grids = tuple(HUNDREDTHS if place % 2 else SIX for place in range(n))
    columns = [[float(f"{v:.2f}") for v in values] for values in columns]
    return panel(columns, grids, (n,))


def _methods(shelf: Streams) -> None:
    motion = dance(9)
    parts = (partial(motion, (1, 3), (1,)), partial(motion, (8, 9), (1, 0)))
    for grouping in ("joint", "all", "channel"):
        purpose = f"Groups by {grouping}: each has a coder of its own."
        shelf.code(f"groups-{grouping}", purpose, motion, grouping=grouping, parts=parts)
    values = [wave(12, 1), wave(12, 2), wave(12, 1), wave(12, 2)]
    motion = panel(values, (HUNDREDTHS,) * 4, (2, 2))
    heads = [Coded(), Coded(taps=(32,)), Copy(0, 0), Coded(from_last=0)]
    for name, methods in (("0-1", (AS_CODEC_1, LINKED)), ("1-0", (LINKED, AS_CODEC_1))):
        given = {"grouping": "joint", "methods": methods}
        purpose = f"Methods {name}: one stream as of lossless, one with links, and copies between."
        shelf.code(f"methods-{name}", purpose, motion, heads, **given)
    motion = panel([[0.5] * 9, wave(9), [0.25] * 9, wave(9)], (HUNDREDTHS,) * 4, (4,))
    heads = [Constant(), Coded(), Constant(), Copy(0, 1)]
    shelf.code("constants-between", "Constants and copies have no links.", motion, heads)
    columns = [[0.5] * 120, wave(120, 1), wave(120, 1), wave(120, 2), wave(120, 3)]
    motion = panel(columns, (HUNDREDTHS,) * 5, (5,))
    heads = [Constant(), Coded(), Copy(0, 1), Coded(), Coded()]
    purpose = "Coded channels are counted without constants and copies: when weights are solved."
    shelf.code("constants-before", purpose, motion, heads)
    purpose = "Constants alone, in a stream of lossless."
    shelf.code("constants", purpose, panel([[0.5] * 4], (HUNDREDTHS,)), [Constant()])


def _links(shelf: Streams) -> None:
    motion = _panel(80, 10)
    parts = (partial(motion, (70, 75)),)
    purpose = "Ten channels, the last of which look at the eight before them."
    shelf.code("links-8", purpose, motion, parts=parts)
    for n in (0, 1, 6, 7):
        links = [Link(5, 8, tuple(range(c))[:n]) for c in range(10)]
        purpose = f"Channels that look at {n} others at most."
        shelf.code(f"links-{n}", purpose, motion, links=links)
    links = [Link(3, 7, (0,) * min(8, 8 * c)) for c in range(10)]
    purpose = "Eight times the same other: sums of which nearly all are singular."
    shelf.code("links-twice", purpose, motion, links=links)
    links = [Link(3, 7, tuple(reversed(range(c)))[:8]) for c in range(10)]
    shelf.code("links-backward", "Others in falling order.", motion, links=links)
    cases = {"unit-0": (0, 0), "unit-44": (44, 44), "reach-0": (6, 6), "reach-15": (0, 15)}
    for name, (unit, reach) in {**cases, "reach-59": (44, 59)}.items():
        links = [Link(unit, reach, tuple(range(c))[:8]) for c in range(10)]
        purpose = f"Steps in 2^{unit}, levels in 2^{reach}."
        shelf.code(name, purpose, motion, links=links)
    purpose = "Taps beside regressions: fitted ones, none of the last, most and least."
    taps = ((41, -13, 5, -1), (511, -480), (-511,), (64, -32), ())
    heads = [Coded(from_last=place % 2, taps=t) for place, t in enumerate(taps)]
    shelf.code("taps", purpose, motion, heads)


def _echoes(shelf: Streams) -> None:
    """Numbers that were there before; what is coded around them has learned nothing of them."""
    once = [wave(20), wave(20, 1), wave(20, 2)]
    loop = [[*one, *one, 9.5, *one[:5]] for one in once]
    twice = Echo(20, 20, 0, 3, 20, 0, False), Echo(41, 5, 0, 3, 21, 0, False)
    grids = (HUNDREDTHS,) * 3
    cases = {
        "loop": ("A loop that is played twice, and begun again.", loop, twice),
        "halves": (
            "A gait whose second half is the first of the other side, one channel mirrored.",
            [once[0] + once[1], once[1] + once[0], once[2] + [-v for v in once[2]]],
            (
                Echo(20, 20, 0, 1, 20, 1, False),
                Echo(20, 20, 1, 1, 20, 0, False),
                Echo(20, 20, 2, 1, 20, 2, True),
            ),
        ),
        "middle": (
            "Echoes in the middle of channels, which others look at.",
            [once[0], [*once[1][:8], *once[0][3:9], *once[1][14:]], once[2]],
            (Echo(8, 6, 1, 1, 5, 0, False),),
        ),
        "last-counts": (
            "Two echoes of the same numbers: the last one counts.",
            loop,
            (Echo(30, 3, 1, 1, 7, 2, True), *twice),
        ),
        "one-row": (
            "An echo of the row before, which is an echo of the one before, with the other sign.",
            [[0.5, -0.5, 0.5, 1.25], [0.5, 0.5, 2.5, 1.25], [1.0, 2.0, 2.5, 0.0]],
            (Echo(1, 2, 0, 1, 1, 0, True), Echo(1, 1, 1, 1, 1, 0, False)),
        ),
    }
    for name, (purpose, columns, echoes) in cases.items():
        motion = panel(columns, grids, (3,))
        shelf.code(f"echo-{name}", purpose, motion, [Coded()] * 3, echoes=echoes)
    classes = [Coded(form=6), Coded(), Coded(form=PLAIN, drop=3)]
    whole = [[8.0 * round(40 * v) for v in one] for one in once]
    motion = panel([one + one for one in whole], (SIX, SIX, WHOLE), (3,))
    every = (Echo(20, 20, 0, 3, 20, 0, False),)
    shelf.code(
        "echo-forms",
        "Echoes of numbers in classes, and with a drop.",
        motion,
        classes,
        echoes=every,
    )
    zeros = panel([[0.0, 1.5, -0.0, -1.5]], (SIX,), (1,))
    shelf.code(
        "echo-zero",
        "The other sign of zero.",
        zeros,
        [Coded()],
        echoes=(Echo(2, 2, 0, 1, 2, 0, True),),
    )
    counts = tuple(round(50 * v) for v in wave(20)) * 2
    motion = panel([[0.25 * count for count in counts], loop[0][:40]], (SINGLE, HUNDREDTHS), (2,))
    heads = [Coded(MULTIPLES, unit=0.25, multiples=counts), Coded()]
    purpose = "An echo beside a channel of multiples, which can have none."
    shelf.code(
        "echo-beside-multiples", purpose, motion, heads, echoes=(Echo(20, 20, 1, 1, 20, 1, False),)
    )


def _odd_echoes(shelf: Streams) -> None:
    """Echoes of other grids and forms, in several groups, beside rests, before and amid much."""
    shelf.code(
        "echo-other-grids",
        "Echoes of another channel's ordinals, whatever the two grids and forms are.",
        *_across(),
        echoes=(
            Echo(2, 4, 1, 1, 2, 0, False),
            Echo(7, 2, 0, 1, 3, 1, True),
            Echo(3, 3, 2, 1, 2, 1, True),
        ),
    )
    n, column = 100, wave(100)
    bent = wave(n, 1)
    columns = [
        [*column[:3], *column[:3], *column[6:]],
        [*bent[:30], *[-v for v in column[26:56]], *bent[60:]],
        wave(n, 2),
    ]
    heads = [Coded(taps=(41, -13, 5)), Coded(from_last=0, taps=(64, -32)), Coded()]
    echoes = (Echo(3, 3, 0, 1, 3, 0, False), Echo(30, 30, 1, 1, 4, 0, True))
    purpose = "Echoes among the first rows and amid many: rows are counted with them."
    motion = panel(columns, (HUNDREDTHS,) * 3, (3,))
    shelf.code("echo-long", purpose, motion, heads, echoes=echoes)
    loops = [wave(9, seed) * 2 for seed in range(2)]
    motion = panel(loops, (HUNDREDTHS,) * 2, (1, 1))
    purpose = "Echoes in both of two groups, whose channels count from 0 each."
    every = (Echo(9, 9, 0, 1, 9, 0, False),)
    shelf.code("echo-groups", purpose, motion, [Coded()] * 2, grouping="joint", echoes=every)
    counts = tuple(round(50 * v) for v in wave(40))
    rests = tuple(row % 3 - 1 for row in range(40))
    first = Coded(COUNTS, law=Law(0.1), multiples=counts, rests=rests)
    motion = panel([values_of(first, SINGLE), wave(20, 3) * 2], (SINGLE, HUNDREDTHS), (2,))
    purpose = "Echoes of 100 numbers in 40 rows of two channels and rests, which count, too."
    again = (Echo(20, 20, 1, 1, 20, 1, False),) * 5
    shelf.code("echo-beside-rests", purpose, motion, [first, Coded()], echoes=again)

    values = [1.5, 2.5, 0.1, 0.2, 4.5], [0.1, 0.2, 0.3, 0.7, 1.1]
    heads = [Coded(form=BINARY64, drop=40), Coded()]
    purpose = "Echoes of magnitudes with low bits in a channel that drops them."
    fine = (Echo(2, 2, 0, 1, 2, 1, False),)
    shelf.code("echo-drop", purpose, panel(values, (DOUBLE,) * 2, (2,)), heads, echoes=fine)


def _across() -> tuple[Motion, list[Coded]]:
    """GENERAL 6, FIXED 2 with a drop and INTEGER; each repeats ordinals of the others."""
    ordinals = np.zeros((9, 3), np.int64)
    ordinals[:, 0] = SIX.ordinals(np.array([1.5, 2.25, -1.125, 3, 4.5, 7, 8, 9, 10.5]))[0]
    ordinals[:, 1] = np.arange(9) * 8
    ordinals[:, 2] = np.arange(9) ** 2
    ordinals[2:6, 1] = ordinals[0:4, 0]
    ordinals[7:9, 0] = -1 - ordinals[4:6, 1]
    ordinals[3:6, 2] = -1 - ordinals[1:4, 1]
    grids = (SIX, HUNDREDTHS, WHOLE)
    columns = [
        grid.values(ordinals[:, place]).astype(float).tolist() for place, grid in enumerate(grids)
    ]
    return panel(columns, grids, (3,)), [Coded(), Coded(form=PLAIN, drop=3), Coded()]


def _degenerate(shelf: Streams) -> None:
    n = 90
    base = wave(n)
    twins = [base, base, [-v for v in base], [v + 1 for v in base], [2 * v for v in base]]
    twins = [[round(v, 2) for v in values] for values in twins]
    purpose = "Channels that are each other, but for sign and a constant: pivots at their floor."
    shelf.code("twins", purpose, panel(twins, (HUNDREDTHS,) * 5, (5,)))
    still = [[0.5] * n, [0.5] * 60 + [0.75] * 30, base]
    purpose = "Channels that do not move, or once: sums of zeros."
    shelf.code("still", purpose, panel(still, (HUNDREDTHS,) * 3, (3,)), [Coded()] * 3)
    spikes = [[v + (10_000 if row in (5, 30, 31, 70) else 0) for row, v in enumerate(base)]]
    spikes += [[round(v + s / 2, 2) for v, s in zip(wave(n, 1), spikes[0], strict=True)]]
    shelf.code("spikes", "Jumps far out of waves.", panel(spikes, (HUNDREDTHS,) * 2, (2,)))
    most = 2**44 - 1
    swings = [most, -most - 1, most, most, 0, -most, 5, most, most - 7, -1, -most - 1, 3] * 3
    links = [Link(0, 0, ()), Link(0, 0, (0,))]
    purpose = "Steps beyond 2^20 units are cut, estimates that large are none."
    motion = panel([swings, swings[::-1]], (WHOLE,) * 2, (2,))
    shelf.code("beyond", purpose, motion, [Coded(taps=(511, -511)), Coded()], links)
    eight = [numbers(160, 8)[:, c].tolist() for c in range(8)]
    motion = panel(eight, (Grid(GridKind.FIXED, 2),) * 8, (8,))
    heads = [Coded(taps=(32,) * (c % 3), scale=10 * c) for c in range(8)]
    shelf.code("noise", "Eight channels of noise: weights reach far.", motion, heads)


def _classes(shelf: Streams) -> None:
    around = [9.98, 9.995, 10.01, 10.02, 9.9999, 9.99998, 10.0, 99.9999, 100.0, 9.99999, 0.001]
    creep = [float(f"{v * 10.0**e:.6g}") for e in (0, -3, 4) for v in around]
    purpose = "Numbers of six digits about powers of ten: units of their class and of others."
    shelf.code("class-creep", purpose, column(creep, SIX), [Coded(scale=60)])
    tiny = [5.0, 0.0, -0.0, 1e-7, -3e-9, 0.0, 4e-300, -2.5e-5, -0.0, 5.25, 1e-307, 9.99999e307]
    purpose = "Numbers below the unit, zeros and minus zeros among large ones."
    shelf.code("class-small", purpose, column(tiny * 3, SIX), [Coded(scale=90)])
    purpose = "The same on a binary grid."
    double = Grid(GridKind.BINARY64)
    shelf.code("class-small-binary64", purpose, column(tiny * 3, double), [Coded(scale=90)])
    single = [float(np.float32(v)) for v in tiny if abs(v) < 1e38]
    purpose = "The same on a grid of 24 binary digits."
    shelf.code("class-small-binary32", purpose, column(single * 3, SINGLE), [Coded(scale=90)])
    for name, grid, drop in (("32", SINGLE, 5), ("64", Grid(GridKind.BINARY64), 40)):
        even = [float(round(64 * v)) / 64 for v in wave(80)]
        purpose = f"A grid of binary{name}, whose numbers end in {drop} zeros at least."
        heads = [Coded(form=88 if name == "32" else 117, drop=drop)]
        shelf.code(f"class-drop-binary{name}", purpose, column(even, grid), heads)
    jumps = [1.0, 123456.0, 1.5, 999999.0, -1.25, 1e9, 2.0, -1e12, 1.0]
    purpose = "Numbers of far more units than were expected: multiples of powers of ten."
    shelf.code("class-jumps", purpose, column(jumps, SIX), [Coded(scale=0, from_last=0)])


def _rows(shelf: Streams) -> None:
    for n_frames in (0, 1, 2, 8, 9):
        shelf.code(f"frames-{n_frames}", f"A clip of {n_frames} frames.", dance(n_frames))
    motion = _panel(150, 5)
    parts = (partial(motion, (63, 67)), partial(motion, (149, 150)))
    purpose = "150 rows: errors are followed slower from row 20 on, weights are solved less often."
    shelf.code("rows-150", purpose, motion, parts=parts)
    purpose = "Segments of 40 rows: all that was learned is forgotten."
    shelf.code("segments", purpose, motion, segment_frames=40, parts=parts)
