"""Valid: source texts on exact ties, in odd layouts, of frames with other numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.formats import FORMATS, amc
from mcz.formats.layout import TEMPLATE
from mcz.formats.notes import RowNotes
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from mcz.schema import build, parse
from tools.vectors.craft import Vector, Whole, file_of
from tools.vectors.sources import AMC, BOTH, HEADING, called, take
from tools.vectors.sources_styles import _skeleton

SPEC = f"{HEADING}; The text of AMC and BVH"
F = GridFlag


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    _printed_ties(shelf)
    _layouts(shelf)
    _number_texts(shelf)
    return shelf.vectors


def restored(motion: Motion) -> bytes:
    """What the source of ``motion`` makes of it."""
    assert motion.source is not None
    return FORMATS[motion.source.format].write(motion)


def unhashed(motion: Motion) -> Motion:
    """``motion`` without size and hash of its source, which a writer then finds."""
    assert motion.source is not None
    return replace(motion, source=replace(motion.source, size=0, sha256=b""))


def blank(n_rows: int, grids: Sequence[Grid], name: str) -> Motion:
    """Zeros and their source, a BVH file of plain numbers: as many joints as ``grids`` need.

    Columns behind the grids are on the last one.
    """
    every = [*grids, *[grids[-1]] * (-len(grids) % 6)]
    rows = [" ".join(["0"] * len(every))] * n_rows
    head = _skeleton(len(every) // 6) + f"MOTION\nFrames: {n_rows}\nFrame Time: 0.01\n"
    motion = take((head + "\n".join([*rows, ""])).encode(), name)
    return replace(motion, signals=(Signal(np.zeros((n_rows, len(every))), tuple(every)),))


def path_of(motion: Motion) -> str:
    assert motion.source is not None
    return motion.source.path


# Exact ties of printing


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


def _print(shelf: Whole, name: str, purpose: str, grids: Sequence[Grid], table: Any) -> None:
    """A lossless clip of these values on these grids, one a column."""
    motion = unhashed(blank(len(table), grids, name))
    motion = replace(motion, signals=(Signal(np.array(table), tuple(grids)),))
    data = file_of(motion, grouping="all")
    spec = f"Decimal and binary64; Ordinal to text; {HEADING}"
    sources = ((path_of(motion), restored(motion)),)
    shelf.hold(f"bvh-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


# Layouts


def _layouts(shelf: Whole) -> None:
    grids = [Grid(GridKind.FIXED, 1, F.PLUS), Grid(GridKind.FIXED, 1)] * 3
    table = np.array([[1.5, 1.5, -1.5, -1.5, -0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 10.0, -10.0]])
    motion = unhashed(blank(2, grids, "signs"))
    motion = replace(motion, signals=(Signal(table, tuple(grids)),))
    motion = _with_template(motion, lambda fields: fields.patterns[0].runs.__setitem__(
        slice(None), [run | {"width": 1} for run in fields.patterns[0].runs]
    ))  # fmt: skip
    _hold_text(shelf, "signs", "Width 1: a blank where no sign is, of either sort.", motion)
    for name, runs in (
        ("left-out", [(0, 6, 1, 0), (1, 3, 2, 4), (1, 1, 1, -5)]),
        ("no-columns", []),
    ):
        motion = unhashed(blank(3, grids, name))
        motion = _with_template(motion, _runs(runs))
        purpose = "Columns in another order, of which some are left out, of three widths."
        if not runs:
            purpose = "Rows of a pattern without a column: its tail alone."
        _hold_text(shelf, name, purpose, motion)
    motion = unhashed(blank(1, grids, "long"))
    motion = _with_template(motion, lambda fields: fields.header.__setitem__(0, _long_text()))
    _hold_text(shelf, "long-header", "A template of 100,000 bytes.", motion)


def _long_text() -> bytes:
    return b"".join(b"# line %d\n" % (k % 100) for k in range(11_000))[:100_000]


def _runs(listed: Sequence[tuple[int, int, int, int]]) -> Callable[[Any], None]:
    """An edit: the only pattern has these runs of gap, column, n_columns and width."""
    names = "gap", "column", "n_columns", "width"

    def edit(fields: Any) -> None:
        fields.patterns[0].runs[:] = [dict(zip(names, run, strict=True)) for run in listed]

    return edit


def _with_template(motion: Motion, edit: Callable[[Any], Any]) -> Motion:
    assert motion.source is not None
    fields = parse(TEMPLATE, motion.source.template, "template")
    edit(fields)
    template = build(TEMPLATE, fields, "template")
    return replace(motion, source=replace(motion.source, template=template))


def _hold_text(shelf: Whole, name: str, purpose: str, motion: Motion) -> None:
    spec = f"Templates and details; {SPEC}"
    sources = ((path_of(motion), restored(motion)),)
    data = file_of(motion, grouping="all")
    shelf.hold(f"bvh-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _number_texts(shelf: Whole) -> None:
    """Frame numbers as they were printed, of frames that have got other numbers."""
    source = AMC.replace(b"\r\n5\r", b"\r\n007\r").replace(b"\r\n6\r", b"\r\n+8\r")
    motion = called(amc.read(source.replace(b"\r\n9\r", b"\r\n-0\r"), "take"), "take.amc")
    notes = motion.source.notes if motion.source else None
    assert isinstance(notes, RowNotes) and [text for _, text in notes.texts] == [
        b"007",
        b"+8",
        b"-0",
    ]
    for name, numbers, purpose in (
        ("other", [7, 9, 1, 2], "Texts of frame numbers, of which one is that of its frame."),
        (
            "same",
            [7, 8, 0, 10],
            "Texts of frame numbers, one of them -0, all those of their frames.",
        ),
    ):
        edited = unhashed(replace(motion, frame_numbers=np.array(numbers)))
        text = restored(edited)
        assert (b"\r\n007\r" in text, b"\r\n+8\r" in text) == (True, name == "same")
        shelf.hold(
            f"amc-number-texts-{name}", f"Frame notes of AMC and BVH; {SPEC}; Registry", purpose,
            file_of(edited), edited, sources=(("take.amc", text),), modes=BOTH,
        )  # fmt: skip
