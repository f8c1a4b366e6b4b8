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
    LimitError,
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
    Detail,
    Layout,
    Pattern,
    Run,
    Template,
    parse_layout,
    runs_of,
)
from mcz.formats.notes import RowNotes, join_notes
from mcz.formats.restore import restore
from mcz.numbers import Grid, GridKind
from tools.records import built

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


def test_usual_rows_need_no_notes() -> None:
    assert RowNotes(np.zeros(5, np.int64)).cut(1, 4) == b""


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


@given(st.integers(0, 1), st.data())
def test_hostile_structures_are_refused_or_printed(which: int, data: st.DataObject) -> None:
    parts = [bytearray(part) for part in GOOD.build()]
    part = parts[which]
    at = data.draw(st.integers(0, len(part) - 1))
    part[at] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        del part[at:]
    try:
        text = restore(_clip(*map(bytes, parts)), Source("bvh", *map(bytes, parts)))
    except FormatError:
        return
    assert len(text) < 10_000


@given(st.binary(max_size=12))
def test_hostile_notes_are_refused_or_used(data: bytes) -> None:
    template, detail = GOOD.build()
    try:
        notes = join_notes([(0, 3, data)])
        restore(_clip(template, detail), Source("bvh", template, detail, notes))
    except FormatError:
        return


@pytest.mark.parametrize(
    "pattern",
    [
        {"runs": [{"gap": 1, "column": 1, "n_columns": 1, "width": 0}], "tail": 0},
        {"runs": [], "tail": 1},
        {"runs": [{"gap": 0, "column": 0, "n_columns": 2, "width": 0}], "tail": 0},
        {"runs": [{"gap": 0, "column": 1, "n_columns": 0, "width": 0}], "tail": 0},
        {"runs": [{"gap": 0, "column": 1, "n_columns": 3, "width": 0}], "tail": 0},
        {"runs": [{"gap": 0, "column": 2, "n_columns": 1, "width": 0}] * 2, "tail": 0},
    ],
)
def test_a_bad_pattern_is_refused(pattern: dict[str, object]) -> None:
    template = built(Template, {"header": [b""], "gaps": [b" "], "patterns": [pattern]}, "test")
    _, detail = Layout((b"",)).build()
    with pytest.raises(FormatError):
        parse_layout(template, detail, 2)


def test_sizes_are_known_before_anything_is_allocated() -> None:
    huge = {"gap": 0, "column": 1, "n_columns": 2, "width": 0}
    fields = {"header": [b""], "gaps": [b" " * 2**19], "patterns": [{"runs": [huge], "tail": 0}]}
    _, detail = Layout((b"",)).build()
    with pytest.raises(LimitError, match="bytes of gaps a row"):
        parse_layout(built(Template, fields, "test"), detail, 2)
    fields["gaps"] = [b" " * 2**18]
    template = built(Template, fields, "test")
    skeleton = Skeleton((Joint("a", channels=(Channel("rx"), Channel("ry"))),))
    motion = Motion(skeleton, (Signal(np.zeros((1000, 2))),))
    with pytest.raises(LimitError, match="a text of 78"):
        restore(motion, Source("bvh", template, detail))


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


def test_frame_numbers_of_several_rows_each_are_refused() -> None:
    template, detail = Layout(
        (b"",), (Pattern((Run(b"", FRAME_NUMBER), Run(b" ", 0)), b"\n"),)
    ).build()
    skeleton = Skeleton((Joint("a", channels=(Channel("rx"),)),))
    signal = Signal(np.zeros((4, 1)), (Grid(GridKind.FIXED, 1),), samples_per_frame=2)
    motion = Motion(skeleton, (signal,), frame_numbers=np.array([7, 8]))
    with pytest.raises(FormatError, match="frame numbers of 2 rows each"):
        restore(motion, Source("amc", template, detail))


def test_a_new_layout_in_every_row_stays_linear() -> None:
    """3,000 layouts are refused after 1,024 of them; 40,000 rows that alternate are read."""
    head = b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 2 Xrotation Yrotation\n}\nMOTION\n"
    head += b"Frames: 1\nFrame Time: 1\n"
    rows = b"".join(b"1 " + b"\t" * k + b"2\n" for k in range(3000))
    with pytest.raises(MczError, match="too irregular"):
        bvh.read(head + rows)
    data = head + b"1 2\n1  2\n" * 20_000
    assert bvh.write(bvh.read(data)) == data


def test_a_detail_of_many_patterns_is_refused() -> None:
    _, _detail = Layout((b"",)).build()
    pattern = {"runs": [], "tail": 0}
    template = built(Template, {"header": [b""], "gaps": [b" "], "patterns": [pattern]}, "test")
    fields = {
        "count": b"",
        "rows": 0,
        "gaps": [],
        "patterns": [pattern] * 1024,
        "ends": 0,
        "ending": b"",
    }
    with pytest.raises(LimitError):
        parse_layout(template, built(Detail, fields, "test"), 0)
