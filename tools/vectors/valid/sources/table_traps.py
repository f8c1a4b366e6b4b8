"""Tables that two readings of the text would restore differently: names, masks, notes, grids."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.motion import Motion, Skeleton
from mcz.numbers import Grid, GridKind
from tools.records import update
from tools.vectors.build.cuts import cut
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.source_files import BOTH, path_of, restored, unhashed
from tools.vectors.build.table_files import MARKERS, ODD_SECTIONS, SPEC, TIMES, VICON
from tools.vectors.valid.sources.tables import odd_sections, take_table, with_fields


def add(shelf: Whole) -> None:
    _hold(shelf, "sections-names", "Names that repeat, anew in each header; bytes above.", _names())
    odd = odd_sections("numbers.csv")
    other = unhashed(replace(odd, frame_numbers=np.array([1, 3, 5])))
    _hold(shelf, "sections-numbers", "Frames have got other numbers than were printed.", other)
    times = take_table(TIMES, "hidden.trc")
    mask = np.array([[True], [True], [True], [False]])
    hidden = replace(times.signals[1], mask=mask, role="")
    assert len(hidden.exceptions) == 1
    hidden_times = unhashed(replace(times, signals=(times.signals[0], hidden)))
    _hold(shelf, "missing-exception", "A token beneath a mask is not printed.", hidden_times)
    _hold(shelf, "no-text", "Numbers on a grid without text, and what are none.", _binary())
    _cut(shelf, odd)


def _hold(shelf: Whole, name: str, purpose: str, motion: Motion) -> None:
    sources = ((path_of(motion), restored(motion)),)
    shelf.hold(f"table-{name}", SPEC, purpose, file_of(motion), motion, sources=sources, modes=BOTH)


def _names() -> Motion:
    plain = take_table(VICON, "names.csv")
    joints = tuple(replace(joint, name="Ann\u00e9") for joint in plain.skeleton.joints)
    assert len(joints) == 2
    headers = (b"\1\0\2|\x7f\xe9\1\0\n", b"\2\0\n", b"")

    def edit(fields: Any) -> None:
        for section, header in zip(fields.sections, headers, strict=True):
            update(section, {"header": header, "marks": int(header != b"")})
        update(fields.sections[2], {"header": b"\0\0\0", "marks": 0})  # text: three of two joints

    return with_fields(replace(plain, skeleton=Skeleton(joints)), edit)


def _binary() -> Motion:
    plain = take_table(MARKERS, "binary.trc")
    signal = plain.signals[0]
    values = np.array(signal.values)
    values.flat[:9] = np.nan, np.inf, -np.inf, -0.0, 24, 1e16, -1e-5, 0.1, 5e-324
    grids = (Grid(GridKind.BINARY64),) * signal.n_channels
    values[:, 5] = np.arange(len(values))
    grids = (*grids[:5], Grid(GridKind.INTEGER))
    shown = replace(signal, values=values, grids=grids, ordinals=None, mask=None)
    return unhashed(replace(plain, signals=(shown,)))


def _cut(shelf: Whole, odd: Motion) -> None:
    """Frames 1 and 2 of 3 in one segment, of which the first is stored and not shown."""
    data = cut(file_of(odd, segment_frames=3), frames=(1, 3))
    signals = tuple(signal.cut(1, 3) for signal in odd.signals)
    motion = replace(odd, signals=signals, frame_numbers=np.array([2, 3]))
    lines = ODD_SECTIONS.splitlines(keepends=True)
    text = b"".join(line for line in lines if not line.startswith((b"1,0,", b"1,1,", b"1,2,")))
    sources = ((path_of(odd), text),)
    purpose = "Notes of sections in a cut clip: rows are counted from a frame that is not shown."
    shelf.hold("table-sections-cut", SPEC, purpose, data, motion, sources=sources, modes=BOTH)
