"""Source texts in odd layouts, and of frames that have got other numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.formats import amc, layout
from mcz.formats.layout import Template
from mcz.formats.notes import RowNotes
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from mcz.schema import parse
from tools.records import built
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.source_files import (
    AMC,
    BOTH,
    TEXT_SPEC,
    blank,
    called,
    path_of,
    restored,
    unhashed,
)

F = GridFlag


def add(shelf: Whole) -> None:
    _layouts(shelf)
    _number_texts(shelf)


def _layouts(shelf: Whole) -> None:
    grids = [Grid(GridKind.FIXED, 1, F.PLUS), Grid(GridKind.FIXED, 1)] * 3
    table = np.array([[1.5, 1.5, -1.5, -1.5, -0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 10.0, -10.0]])
    motion = unhashed(blank(2, grids, "signs"))
    motion = replace(motion, signals=(Signal(table, tuple(grids)),))
    motion = _with_template(motion, lambda fields: fields.patterns[0].runs.__setitem__(
        slice(None), [replace(run, width=1) for run in fields.patterns[0].runs]
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
        fields.patterns[0].runs[:] = [
            layout.RunFields(**dict(zip(names, run, strict=True))) for run in listed
        ]

    return edit


def _with_template(motion: Motion, edit: Callable[[Any], Any]) -> Motion:
    assert motion.source is not None
    fields = parse(Template, motion.source.template, "template")
    edit(fields)
    template = built(Template, fields, "template")
    return replace(motion, source=replace(motion.source, template=template))


def _hold_text(shelf: Whole, name: str, purpose: str, motion: Motion) -> None:
    spec = f"Templates and details; {TEXT_SPEC}"
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
        ("other", [7, 9, 11, 12], "Texts of frame numbers, of which one is that of its frame."),
        (
            "same",
            [7, 8, 9, 10],
            "Texts of frame numbers, one of them -0, all those of their frames.",
        ),
    ):
        edited = unhashed(replace(motion, frame_numbers=np.array(numbers)))
        text = restored(edited)
        assert b"\r\n007\r" in text and b"\r\n+8\r" in text and b"\r\n-0\r" in text
        shelf.hold(
            f"amc-number-texts-{name}",
            f"Frame notes of AMC and BVH; {TEXT_SPEC}; Time",
            purpose,
            file_of(edited),
            edited,
            sources=(("take.amc", text),),
            modes=BOTH,
        )
