"""Templates of tables at fault."""

from __future__ import annotations

from dataclasses import replace

from mcz.formats.layout import DETAIL
from mcz.formats.table_layout import CLOCK, TABLE_TEMPLATE
from mcz.motion import Motion
from mcz.numbers import GRID, Grid, GridKind
from mcz.schema import build, parse, varint
from tools.vectors.build.edits import Edit, plus, put
from tools.vectors.build.files import Unrestorable, file_of
from tools.vectors.build.source_files import restored, unhashed, with_source, with_template
from tools.vectors.build.table_files import MARKERS, QUATERNIONS, SPEC, TIMES
from tools.vectors.valid.sources.tables import take_table


def add(shelf: Unrestorable) -> None:
    plain = take_table(MARKERS, "plain.trc")
    times = take_table(TIMES, "times.trc")
    _fields(shelf, plain, times)
    _clocks(shelf, plain)
    _headers(shelf, plain)
    sto = take_table(QUATERNIONS, "plain.sto")
    rows = replace(sto, signals=(replace(sto.signals[0], samples_per_frame=3),))
    shelf.add("table-rows", SPEC, "A table of three rows a frame.", file_of(rows))


def _field(path: str, new: bytes) -> Edit:
    return put(TABLE_TEMPLATE, path, new)


def _fields(shelf: Unrestorable, plain: Motion, times: Motion) -> None:
    cases: tuple[tuple[str, str, Motion, Edit], ...] = (
        ("tail", "a byte behind it, which is closed", plain, plus(b"\0")),
        ("cut", "it ends early", plain, lambda data: data[:-1]),
        ("marks", "marks is 2", plain, _field("marks", b"\2")),
        ("two-clocks", "two clocks", plain, _two_clocks),
        ("column", "a column behind that of the clock", plain, _column(b"\x08")),
        ("no-clock", "the column of a clock that there is not", times, _column(b"\5")),
        ("gap", "a gap beyond the last", plain, _field("patterns.0.tail", b"\x63")),
        ("width", "a width of -1", plain, _field("patterns.0.runs.1.width", b"\1")),
    )  # fmt: skip
    for name, purpose, motion, edit in cases:
        data = file_of(motion, SRCE=with_template(edit))
        shelf.add(f"table-{name}", SPEC, f"A template of a table: {purpose}.", data)
    assert plain.source is not None
    detail = put(DETAIL, "ends", b"\2")(plain.source.detail)
    data = file_of(replace(plain, source=replace(plain.source, detail=detail)))
    shelf.add("table-ends", SPEC, "A detail of a table: ends is 2.", data)


def _column(number: bytes) -> Edit:
    return _field("patterns.0.runs.1.column", number)


def _two_clocks(template: bytes) -> bytes:
    clock = {"grid": Grid(GridKind.FIXED, 3), "numerator": 1, "denominator": 1, "offset": 0}
    return _field("clock", b"\2" + build(CLOCK, clock, "clock") * 2)(template)


def _clocks(shelf: Unrestorable, plain: Motion) -> None:
    """What a reader that overlooks the fault restores has the size and hash that are stated."""
    three = build_grid(Grid(GridKind.PRINTED, 3, style=3))  # prints as FIXED 3 does
    empty = replace(plain, signals=(plain.signals[0].cut(0, 0),), frame_numbers=None)
    none = restored(unhashed(empty))
    late = MARKERS
    for time in (b"3.067", b"3.083", b"3.100", b"3.117", b"3.133"):
        late = late.replace(time, b"2251799813685.247")
    cases: tuple[tuple[str, str, Motion, bytes, Edit], ...] = (
        ("grid", "a clock on a PRINTED grid", plain, MARKERS, _field("clock.0.grid", three)),
        (
            "denominator",
            "a clock with the denominator 0, and no time",
            empty,
            none,
            _field("clock.0.denominator", b"\0"),
        ),
        (
            "time",
            "times beyond their grid",
            plain,
            late,
            _both(
                _field("clock.0.offset", varint(2**53 - 2)), _field("clock.0.denominator", b"\1")
            ),
        ),
        (
            "time-below",
            "times below their grid",
            plain,
            MARKERS,
            _both(
                _field("clock.0.offset", varint(2**53 - 1)), _field("clock.0.denominator", b"\1")
            ),
        ),
    )
    for name, purpose, motion, text, edit in cases:
        data = file_of(with_source(motion, text), SRCE=with_template(edit))
        shelf.add(f"table-clock-{name}", SPEC, f"A template of a table: {purpose}.", data)


def _both(first: Edit, then: Edit) -> Edit:
    return lambda data: then(first(data))


def build_grid(grid: Grid) -> bytes:
    return build(GRID, grid, "grid")


def _headers(shelf: Unrestorable, plain: Motion) -> None:
    assert plain.source is not None
    header = parse(TABLE_TEMPLATE, plain.source.template, "template").header
    edit = _field("header", varint(len(header) + 1) + header + b"\0")
    data = file_of(with_source(plain, MARKERS), SRCE=with_template(edit))
    shelf.add("table-names", SPEC, "A template of a table: three names of two joints.", data)
