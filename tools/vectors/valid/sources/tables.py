"""TRC, MOT, STO and CSV: files, and what their templates can say beside."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.formats import FORMATS, layout
from mcz.formats.table_layout import PHRASES, TableDetail, TableTemplate
from mcz.motion import Motion
from mcz.numbers import Grid, GridKind
from mcz.schema import parse
from tools.records import built, update
from tools.vectors.build.edits import put
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.source_files import BOTH, called, path_of, restored, unhashed
from tools.vectors.build.table_files import (
    COLUMNS,
    DEVICES,
    EULER,
    FORCES,
    MARKERS,
    MOTIVE,
    ODD_SECTIONS,
    QUATERNIONS,
    SPEC,
    TIMES,
    VICON,
)

KINDS = {"trc": MARKERS, "mot": FORCES, "sto": QUATERNIONS}
CSV = {
    "motive": (MOTIVE, "Motive: a bone, a marker that is lost, names with commas."),
    "motive-euler": (EULER, "Motive: angles in another order than their columns."),
    "vicon": (VICON, "Vicon: sections of one and two rows a frame, in segments of two frames."),
    "vicon-devices": (DEVICES, "Vicon: devices alone; the motion has no channel."),
    "csv": (COLUMNS, "Columns of numbers with names and units, no line end at the end."),
}


def add(shelf: Whole) -> None:
    for suffix, text in KINDS.items():
        purpose = f"A {suffix.upper()} file: its header names the joints, a segment is two frames."
        _hold(shelf, suffix, purpose, take_table(text, f"plain.{suffix}"), segment_frames=2)
    times = take_table(TIMES, "times.trc")
    assert len(times.signals) == 2
    _hold(shelf, "trc-times", "Times that follow from nothing are a signal.", times)
    _hold(shelf, "trc-times-segments", "The same, in segments.", times, segment_frames=1)
    for name, (text, purpose) in CSV.items():
        _hold(shelf, name, purpose, take_table(text, f"{name}.csv"), segment_frames=2)
    purpose = "Vicon: sub frames that do not count, layouts of single rows."
    _hold(shelf, "vicon-odd", purpose, odd_sections("vicon-odd.csv"), segment_frames=2)
    _clocks(shelf)
    _sections(shelf)
    _headers(shelf)
    _missing(shelf)
    _patterns(shelf)


def take_table(text: bytes, path: str) -> Motion:
    name, _, suffix = path.partition(".")
    motion = called(FORMATS[suffix].read(text, name), path)
    assert FORMATS[suffix].write(motion) == text, path
    return motion


def _hold(shelf: Whole, name: str, purpose: str, motion: Motion, **made: Any) -> None:
    sources = ((path_of(motion), restored(motion)),)
    data = file_of(motion, **made)
    shelf.hold(f"table-{name}", SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def with_fields(motion: Motion, edit: Callable[[Any], Any]) -> Motion:
    """``motion`` with its template edited, without the size and hash of its file."""
    motion = unhashed(motion)
    assert motion.source is not None
    fields = parse(TableTemplate, motion.source.template, "template")
    edit(fields)
    template = built(TableTemplate, fields, "template")
    return replace(motion, source=replace(motion.source, template=template))


def _first(fields: Any) -> Any:
    """The first section."""
    return fields.sections[0]


def _sections(shelf: Whole) -> None:
    """Signals of sections in another order, clocks of rows within frames, sections without text."""
    plain = take_table(VICON, "sections.csv")
    assert len(plain.signals) == 3
    twice = with_fields(plain, lambda fields: fields.sections.reverse())
    _hold(shelf, "sections-order", "The sections in another order.", twice)
    _hold(shelf, "sections-signals", "Two sections with each other's signals.", _turned(plain))
    clock = {"grid": Grid(GridKind.FIXED, 3), "numerator": 5, "denominator": 1, "offset": 0}

    def timed(fields: Any) -> None:
        section = fields.sections[0]
        update(section, {"clock": clock})
        runs = section.patterns[0].runs  # what was the number within the frame is the time now
        last = max(run.column + run.n_columns for run in runs)
        runs.append(replace(runs[-1], column=last, n_columns=1))

    purpose = "A clock of two rows a frame, and the numbers within frames behind."
    _hold(shelf, "sections-clock", purpose, with_fields(plain, timed))


def _turned(plain: Motion) -> Motion:
    def edit(fields: Any) -> None:
        one, other = fields.sections[1:3]
        one.signals, other.signals = list(other.signals), list(one.signals)
        for section, count in ((one, 6), (other, 3)):
            runs = section.patterns[0].runs
            gap = runs[-1].gap
            kept = [run for run in runs if run.column == 0]
            runs[:] = [*kept, {"gap": gap, "column": 1, "n_columns": count, "width": 0}]

    return with_fields(plain, edit)


def odd_sections(name: str) -> Motion:
    """The motion of ODD_SECTIONS with the channel without any value that its last comma makes."""
    motion = take_table(ODD_SECTIONS.replace(b"118.56,\n", b"118.56,0\n"), name)
    markers = motion.signals[0]
    assert markers.mask is not None
    mask = markers.mask.copy()
    mask[0, -1] = False  # a reader leaves out a column that is empty throughout
    motion = replace(motion, signals=(replace(markers, mask=mask), *motion.signals[1:]))
    assert restored(unhashed(motion)) == ODD_SECTIONS
    assert motion.source is not None
    sha256 = hashlib.sha256(ODD_SECTIONS).digest()
    return replace(motion, source=replace(motion.source, size=len(ODD_SECTIONS), sha256=sha256))


def _clocks(shelf: Whole) -> None:
    """Times of frames that have other numbers, and of other clocks."""
    plain = take_table(MARKERS, "clock.trc")
    numbers = unhashed(replace(plain, frame_numbers=np.array([-3, 0, 1, 7, 10**12])))
    purpose = "Frames that have got other numbers, one of them below 0: their times follow."
    signals = tuple(replace(s, values=np.abs(s.values)) for s in numbers.signals)
    _hold(shelf, "clock-numbers", purpose, replace(numbers, signals=signals))
    for name, offset, numerator, denominator, rate in (
        ("down", -1, 1, 3, 3000),
        ("still", 7, 0, 1, 60),
        ("large", 2**50, 2**30 + 1, 2**31, 2000),
    ):

        def edit(
            fields: Any, given: tuple[int, int, int] = (offset, numerator, denominator)
        ) -> None:
            names = ("offset", "numerator", "denominator")
            update(fields.sections[0].clock, dict(zip(names, given, strict=True)))

        purpose = f"A clock that is {name}: its quotients are rounded down."
        at_rate = replace(plain, frame_rate=Fraction(rate))  # of the clock: it stays
        _hold(shelf, f"clock-{name}", purpose, with_fields(at_rate, edit))


def _headers(shelf: Whole) -> None:
    plain = take_table(MARKERS, "marks.trc")
    every = b"".join(bytes((mark,)) + b"|" for mark in (*range(4), *PHRASES, 2, 1, 3, 0))
    marked = with_fields(
        plain, lambda fields: update(_first(fields), {"header": every, "marks": 1})
    )
    _hold(shelf, "odd-marks", "Every mark of a header.", marked)
    text = with_fields(plain, lambda fields: update(_first(fields), {"header": every, "marks": 0}))
    _hold(shelf, "odd-no-marks", "The same bytes, which are text.", text)
    empty = with_fields(plain, lambda fields: update(_first(fields), {"header": b"", "marks": 1}))
    _hold(shelf, "odd-no-header", "No header at all.", empty)
    for rows, what in ((plain.n_frames, "these"), (plain.n_frames + 1, "other")):
        assert marked.source is not None
        fields = parse(TableDetail, marked.source.detail, "detail")
        update(fields.details[0], {"count": b"0x5", "rows": rows})
        source = replace(marked.source, detail=built(TableDetail, fields, "detail"))
        purpose = f"A count as printed for {what} rows."
        _hold(shelf, f"odd-count-{what}", purpose, replace(marked, source=source))


def _missing(shelf: Whole) -> None:
    """What stands where a value is invalid: also padded, and where that is nothing."""
    forces = take_table(FORCES, "missing.mot")
    assert forces.signals[0].mask is not None
    for name, word in (("long", b"a word that is longer than its column"), ("empty", b"")):
        motion = with_fields(
            forces, lambda fields, word=word: update(_first(fields), {"missing": word})
        )
        _hold(shelf, f"missing-{name}", f"Padded columns, {name} where invalid.", motion)

    def signs(fields: Any) -> None:
        for run in _first(fields).patterns[0].runs:
            run.width = 1
        _first(fields).missing = b""

    purpose = "A blank where the sign would be, also of nothing."
    _hold(shelf, "missing-sign", purpose, with_fields(forces, signs))


def _patterns(shelf: Whole) -> None:
    """Columns of both signals, the frame number and no clock, in another order."""
    times = take_table(TIMES, "order.trc")
    n = sum(signal.n_channels for signal in times.signals)

    def edit(fields: Any) -> None:
        runs = [(n, 1, 8), (0, 1, -4), (2, n - 2, 0)]
        names = ("gap", "column", "n_columns", "width")
        _first(fields).patterns[0].runs[:] = [
            layout.RunFields(**dict(zip(names, (1, column, count, width), strict=True)))
            for column, count, width in runs
        ]

    motion = with_fields(times, edit)
    assert motion.source is not None
    detail = put(TableDetail, "details.0.ends", b"\1")(motion.source.detail)
    motion = replace(motion, source=replace(motion.source, detail=detail))
    _hold(shelf, "odd-order", "Channels of two signals in another order; one is left out.", motion)
