"""Templates of tables at fault."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from mcz.formats.layout import Detail, PatternFields
from mcz.formats.table_layout import ClockFields, SectionFields, TableDetail, TableTemplate
from mcz.formats.table_notes import TableNotesFields
from mcz.motion import Motion
from mcz.numbers import GRID, Grid, GridKind
from mcz.schema import parse, varint
from tools.records import built
from tools.vectors.build.edits import Edit, plus, put
from tools.vectors.build.files import Unrestorable, file_of
from tools.vectors.build.source_files import restored, unhashed, with_source, with_template
from tools.vectors.build.table_files import MARKERS, SPEC, TIMES, VICON
from tools.vectors.valid.sources.tables import take_table


def add(shelf: Unrestorable) -> None:
    plain = take_table(MARKERS, "plain.trc")
    times = take_table(TIMES, "times.trc")
    _fields(shelf, plain, times)
    _clocks(shelf, plain)
    _headers(shelf, plain)
    _sections(shelf)


def _field(path: str, new: bytes) -> Edit:
    return put(TableTemplate, f"sections.0.{path}", new)


def _fields(shelf: Unrestorable, plain: Motion, times: Motion) -> None:
    cases: tuple[tuple[str, str, Motion, Edit], ...] = (
        ("tail", "a byte behind it, which is closed", plain, plus(b"\0")),
        ("cut", "it ends early", plain, lambda data: data[:-1]),
        ("marks", "marks is 2", plain, _field("marks", b"\2")),
        ("two-clocks", "two clocks", plain, _two_clocks),
        ("column", "a column behind the last", plain, _column(b"\x09")),
        ("no-clock", "a column behind the last, without a clock", times, _column(b"\6")),
        ("gap", "a gap beyond the last", plain, _field("patterns.0.tail", b"\x63")),
        ("width", "a width of -1", plain, _field("patterns.0.runs.1.width", b"\1")),
    )  # fmt: skip
    for name, purpose, motion, edit in cases:
        data = file_of(motion, SRCE=with_template(edit))
        shelf.add(f"table-{name}", SPEC, f"A template of a table: {purpose}.", data)
    assert plain.source is not None
    detail = put(TableDetail, "details.0.ends", b"\2")(plain.source.detail)
    data = file_of(replace(plain, source=replace(plain.source, detail=detail)))
    shelf.add("table-ends", SPEC, "A detail of a table: ends is 2.", data)


def _column(number: bytes) -> Edit:
    return _field("patterns.0.runs.1.column", number)


def _two_clocks(template: bytes) -> bytes:
    clock = {"grid": Grid(GridKind.FIXED, 3), "numerator": 1, "denominator": 1, "offset": 0}
    return _field("clock", b"\2" + built(ClockFields, clock, "clock") * 2)(template)


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
    return bytes(GRID.build(grid))


def _headers(shelf: Unrestorable, plain: Motion) -> None:
    assert plain.source is not None
    header = parse(TableTemplate, plain.source.template, "template").sections[0].header
    edit = _field("header", varint(len(header) + 1) + header + b"\0")
    data = file_of(with_source(plain, MARKERS), SRCE=with_template(edit))
    shelf.add("table-names", SPEC, "A template of a table: three names of two joints.", data)


def _sections(shelf: Unrestorable) -> None:
    """Sections, their signals and their notes at fault."""
    plain = take_table(VICON, "sections.csv")
    assert plain.source is not None

    def add(name: str, purpose: str, motion: Motion, text: bytes = VICON) -> None:
        data = file_of(with_source(motion, text))
        shelf.add(f"table-{name}", SPEC, f"Sections of a table: {purpose}.", data)

    sections = parse(TableTemplate, plain.source.template, "template").sections
    details = parse(TableDetail, plain.source.detail, "detail").details

    def with_sections(chosen: Any, own: Any) -> Motion:
        template = built(TableTemplate, {"sections": chosen}, "template")
        detail = built(TableDetail, {"details": own}, "detail")
        return replace(plain, source=replace(plain.source, template=template, detail=detail))

    parts = VICON.split(b"\n\n")
    parts[1:] = [b"\n" + part for part in parts[1:]]
    parts[0] += b"\n"
    parts[1] += b"\n"
    add("sections-none", "there are none", with_sections([], []), b"")
    blank = replace(sections[0], header=b"", patterns=[], gaps=[])
    more = [replace(blank, signals=[k]) for k in range(3, 65)]
    add("sections-65", "there are 65", _many(plain, more))
    fewer = with_sections(sections, details[:-1])
    add("sections-details", "a detail is missing", fewer, parts[0] + parts[1])
    for name, purpose, numbers in (
        ("none", "one has no signals", []),
        ("beyond", "a signal that there is not", [1, 3]),
    ):
        odd = [replace(sections[0], signals=numbers), *sections[1:]]
        add(f"signals-{name}", purpose, with_sections(odd, details))
    again = with_sections([*sections, sections[-1]], [*details, details[-1]])
    add("signals-twice", "a signal that another has", again, VICON + parts[-1])
    add("rows", "signals that differ in their rows a frame", *_mixed(plain))
    _notes(shelf, plain)
    _details(shelf, plain)


def _notes(shelf: Unrestorable, plain: Motion) -> None:
    for name, purpose, rows in (
        ("rows", "of other rows a frame", [1]),
        ("more", "of 4", [2, 1, 1, 1]),
    ):
        each = [{"rows_per_frame": n, "patterns": [], "texts": []} for n in rows]
        _noted(shelf, plain, name, f"notes {purpose}", each)
    cases: tuple[tuple[str, str, Any, Any], ...] = (
        ("no-rows", "a run of no rows", [(0, 0)], []),
        ("rows-beyond", "runs of more rows than there are", [(7, 0)], []),
        ("pattern", "a pattern that there is not", [(1, 9)], []),
        ("row-beyond", "the text of a row that there is not", [], [(6, b"9")]),
        ("row-twice", "two texts of a row", [], [(2, b"8"), (0, b"8")]),
        ("text", "a frame number that is none", [], [(2, b"8.")]),
    )
    for name, purpose, patterns, texts in cases:
        first = {
            "rows_per_frame": 2,
            "patterns": [{"n_rows": n, "pattern": pattern} for n, pattern in patterns],
            "texts": [{"row": row, "text": text} for row, text in texts],
        }
        _noted(shelf, plain, name, f"notes with {purpose}", [first])


def _noted(shelf: Unrestorable, plain: Motion, name: str, purpose: str, each: Any) -> None:
    notes = _Notes(built(TableNotesFields, {"sections": each}, "notes"))
    assert plain.source is not None
    noted = replace(plain, source=replace(plain.source, notes=notes))
    data = file_of(with_source(noted, VICON))
    shelf.add(f"table-notes-{name}", SPEC, f"Sections of a table: {purpose}.", data)


def _details(shelf: Unrestorable, plain: Motion) -> None:
    """What is said of patterns and details holds for the second section, too."""
    assert plain.source is not None
    patterns = parse(TableTemplate, plain.source.template, "template").sections[1].patterns
    pattern = built(PatternFields, patterns[0], "pattern")
    own = "sections.1.patterns"
    template_cases: tuple[tuple[str, str, Edit], ...] = (
        ("two-patterns", "two patterns", put(TableTemplate, own, b"\2" + pattern * 2)),
        ("run-of-none", "no columns", put(TableTemplate, f"{own}.0.runs.1.n_columns", b"\0")),
        ("column-twice", "a column twice", put(TableTemplate, f"{own}.0.runs.1.column", b"\0")),
    )
    for name, purpose, edit in template_cases:
        data = file_of(with_source(plain, VICON), SRCE=with_template(edit))
        shelf.add(f"table-{name}", SPEC, f"The second section of a table: {purpose}.", data)
    detail_cases: tuple[tuple[str, str, str, bytes], ...] = (
        ("rows-of-nothing", "rows of a count that is not", "rows", b"\3"),
        ("ending", "an ending that is none", "ending", b"\1x"),
        ("gap-beyond", "a pattern with a gap that is not", "patterns", b"\1\0\x7f"),
    )
    for name, purpose, field, new in detail_cases:
        edit = put(TableDetail, f"details.1.{field}", new)
        data = file_of(with_source(plain, VICON, detail=edit))
        shelf.add(f"table-{name}", SPEC, f"The second section of a table: {purpose}.", data)


@dataclass(frozen=True)
class _Notes:
    """The same bytes for every segment."""

    data: bytes

    def cut(self, start: int, stop: int) -> bytes:
        return self.data


def _many(plain: Motion, more: Any) -> Motion:
    """As many sections of signals that say nothing."""
    assert plain.source is not None
    fields = parse(TableTemplate, plain.source.template, "template")
    own = parse(TableDetail, plain.source.detail, "detail")
    signals = [replace(plain.signals[2], name=str(k)) for k in range(len(more))]
    usual = {"count": b"", "rows": 0, "gaps": [], "patterns": [], "ends": 0, "ending": b""}
    count = varint(3 + len(more))
    template = count + b"".join(
        built(SectionFields, s, "section") for s in [*fields.sections, *more]
    )
    detail = count + b"".join(
        built(Detail, d, "detail") for d in [*own.details, *[usual] * len(more)]
    )
    source = replace(plain.source, template=template, detail=detail)
    return replace(plain, signals=(*plain.signals, *signals), source=source)


def _mixed(plain: Motion) -> tuple[Motion, bytes]:
    """Signals of other rows a frame in a section, of no frames; and the text of the headers."""
    signals = tuple(signal.cut(0, 0) for signal in plain.signals)
    empty = unhashed(replace(plain, signals=signals, frame_numbers=None))
    assert empty.source is not None
    fields = parse(TableTemplate, empty.source.template, "template")
    first, other, last = fields.sections
    details = parse(TableDetail, empty.source.detail, "detail").details
    detail = built(TableDetail, {"details": [details[0], details[2]]}, "detail")

    def made() -> Motion:
        template = built(TableTemplate, {"sections": [first, last]}, "template")
        source = replace(plain.source, template=template, detail=detail, size=0, sha256=b"")
        return replace(empty, source=source)

    text = restored(made())
    first.signals = [*first.signals, *other.signals]
    return made(), text
