"""Templates, details and notes: round trips, and what hostile bytes can do."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz import (
    Channel,
    Exceptions,
    FormatError,
    Joint,
    MczError,
    Motion,
    MotionError,
    Signal,
    Skeleton,
    Source,
)
from mcz.formats import bvh
from mcz.formats.layout import (
    FRAME_NUMBER,
    Layout,
    Pattern,
    Run,
    parse_layout,
    runs_of,
)
from mcz.formats.notes import RowNotes, join_notes
from mcz.formats.restore import restore
from mcz.numbers import Grid, GridKind

GAPS = st.sampled_from([b"", b" ", b"\n", b"\r\n", b"\nname ", b"\0\xff"])


@st.composite
def patterns(draw: st.DrawFn) -> Pattern:
    columns = draw(st.lists(st.integers(FRAME_NUMBER, 9), unique=True, max_size=8))
    widths = st.sampled_from([0, 0, 1, 12, -12])
    return Pattern(runs_of([(draw(GAPS), c, draw(widths)) for c in columns]), draw(GAPS))


@given(
    st.lists(st.binary(max_size=4), min_size=1, max_size=2),
    st.lists(patterns(), max_size=4),
    st.sampled_from([(b"", 0), (b"007", 5), (b"7", 0)]),
    st.one_of(st.none(), st.binary(max_size=3)),
)
def test_a_layout_comes_back(
    header: list[bytes],
    some: list[Pattern],
    count: tuple[bytes, int],
    ending: bytes | None,
) -> None:
    layout = Layout(tuple(header), tuple(some), *count, ending)
    assert parse_layout(*layout.build(), 10) == layout


@given(st.lists(st.integers(0, 3), max_size=30), st.data())
def test_notes_come_back_from_their_parts(rows: list[int], data: st.DataObject) -> None:
    texts = {r: b"%03d" % r for r in data.draw(st.sets(st.integers(0, 29))) if r < len(rows)}
    notes = RowNotes(np.array(rows, dtype=np.int64), tuple(sorted(texts.items())))
    edges = sorted({0, len(rows), *data.draw(st.sets(st.integers(0, max(len(rows), 1) - 1)))})
    parts = [(a, b, notes.cut(a, b)) for a, b in itertools.pairwise(edges)]
    again = join_notes(parts)
    assert np.array_equal(again.patterns, notes.patterns) and again.texts == notes.texts


def _clip(template: bytes, detail: bytes, notes: RowNotes | None = None) -> Motion:
    skeleton = Skeleton((Joint("a", channels=(Channel("rx"), Channel("ry"))),))
    source = Source("bvh", template, detail, notes)
    return Motion(skeleton, (Signal(np.zeros((3, 2))),), source=source)


GOOD = Layout(
    (b"h", b"i"),
    (Pattern((Run(b" ", 0, 2),), b"\n"), Pattern((Run(b"", 1),), b"")),
    b"007",
    3,
    b"!",
)


@pytest.mark.parametrize(
    "exceptions",
    [
        Exceptions(np.array([3]), np.array([0]), (b"1",)),
        Exceptions(np.array([0]), np.array([2]), (b"1",)),
        Exceptions(np.array([0]), np.array([-1]), (b"1",)),
        Exceptions(np.array([1, 0]), np.array([0, 0]), (b"1", b"1")),
        Exceptions(np.array([1, 1]), np.array([0, 0]), (b"1", b"1")),
    ],
)
def test_exceptions_out_of_place_are_refused(exceptions: Exceptions) -> None:
    with pytest.raises(MotionError):
        Signal(np.zeros((3, 2)), exceptions=exceptions)


@pytest.mark.parametrize(
    "exceptions",
    [
        Exceptions(np.array([0]), np.array([0]), (b"x",)),
        Exceptions(np.array([0]), np.array([0]), (b"",)),
    ],
)
def test_bad_exceptions_are_refused(exceptions: Exceptions) -> None:
    template, detail = GOOD.build()
    motion = _clip(template, detail)
    signal = Signal(np.zeros((3, 2)), (Grid(GridKind.FIXED, 1),) * 2, exceptions=exceptions)
    with pytest.raises(FormatError):
        restore(Motion(motion.skeleton, (signal,)), Source("bvh", template, detail))


def test_a_new_layout_in_every_row_stays_linear() -> None:
    """3,000 layouts are refused after 1,024 of them; 40,000 rows that alternate are read."""
    head = b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 2 Xrotation Yrotation\n}\nMOTION\n"
    head += b"Frames: 1\nFrame Time: 1\n"
    rows = b"".join(b"1 " + b"\t" * k + b"2\n" for k in range(3000))
    with pytest.raises(MczError, match="too irregular"):
        bvh.read(head + rows)
    data = head + b"1 2\n1  2\n" * 20_000
    assert bvh.write(bvh.read(data)) == data
