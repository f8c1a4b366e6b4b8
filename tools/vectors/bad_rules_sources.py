"""Invalid, one fault each: rules of source files that no other vector shows by itself.

What a reader that breaks the rule restores has the size and the hash that are stated.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.container.segments import FRAME_NOTES
from mcz.files.encoding import write_skeleton
from mcz.formats import amc, asf
from mcz.formats.c3d_layout import C3D_DETAIL, C3D_TEMPLATE
from mcz.formats.layout import DETAIL, TEMPLATE
from mcz.formats.notes import NOTES
from mcz.motion import Channel, Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.schema import build, parse, varint
from tools.vectors.bad_sources import NOTES_SPEC, Unrestorable, _noted, _srce
from tools.vectors.craft import Crafter, Vector, file_of, finished
from tools.vectors.edits import Edit, put, span, stream
from tools.vectors.sources import ASF, EXAMPLE, ODD, PLAIN, called, take
from tools.vectors.sources_c3d import SPEC as C3D_SPEC
from tools.vectors.sources_c3d import made
from tools.vectors.sources_c3d import take as take_c3d
from tools.vectors.valid_rules import padded

SPEC = "Templates and details; Source reconstruction"


def vectors() -> Iterable[Vector]:
    shelf = Unrestorable("invalid/sources")
    _skeletons(shelf)
    _templates(shelf)
    _patterns(shelf)
    _notes(shelf)
    _numbered(shelf)
    _c3d_fields(shelf)
    _c3d_parts(shelf)
    return shelf.vectors


def _skeletons(shelf: Unrestorable) -> None:
    """The own source of a skeleton, of another format than it may have."""
    skeleton = asf.read(ASF, "mannequin")
    cases = (
        ("ASF-format", "BVH, which is one of clips", {"SRCE": b"\3", "SKEL": b"\3"}),
        ("ASF-format-differs", "ASF, where its SRCE says AMC", {"SRCE": b"\2"}),
    )
    for name, what, formats in cases:
        edits: dict[str, Edit] = {}
        for kind, new in formats.items():
            path = "format" if kind == "SRCE" else "source.0.format"
            edits[kind] = put(getattr(payloads, kind), path, new)
        crafter = Crafter(**edits)
        crafter.alias("small.asf", payloads.OF_SKELETON, write_skeleton(crafter, skeleton))
        purpose = f"The source of a skeleton: its format is {what}."
        shelf.add(name, "SKEL; Source reconstruction", purpose, finished(crafter))


def with_source(motion: Motion, text: bytes, detail: Edit | None = None) -> Motion:
    """``motion`` with the size and the hash of ``text``, and its detail edited."""
    source = motion.source
    assert source is not None
    digest = hashlib.sha256(text).digest()
    own = detail(source.detail) if detail else source.detail
    return replace(motion, source=replace(source, size=len(text), sha256=digest, detail=own))


def _templates(shelf: Unrestorable) -> None:
    plain = take(PLAIN, "plain")

    def third_part(template: bytes) -> bytes:
        fields = parse(TEMPLATE, template, "template")
        parts = [*fields.header, b""]
        listed = varint(3) + b"".join(varint(len(part)) + part for part in parts)
        return put(TEMPLATE, "header", listed)(template)

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("header-empty-part", "a third part of the header, which is empty", third_part),
        ("run-of-none", "a run of no columns behind one of some", _run_of_none),
        (
            "run-gap",
            "a run with a gap beyond the last",
            put(TEMPLATE, "patterns.0.runs.1.gap", b"c"),
        ),
    )
    for name, purpose, edit in cases:
        data = file_of(plain, SRCE=_srce(edit))
        shelf.add(f"template-{name}", SPEC, f"A template: {purpose}.", data)
    numbers = plain.signals[0].values.tolist()
    again = _rows([[*row, row[0]] for row in numbers])
    data = file_of(with_source(plain, again), SRCE=_srce(_first_again))
    shelf.add("template-column-again", SPEC, "A template: a channel is printed twice.", data)
    counted = _rows([[*row] for row in numbers], numbered=True)
    data = file_of(with_source(plain, counted), SRCE=_srce(_with_number))
    purpose = "A template: a run of the frame number and all channels."
    shelf.add("template-number-and-more", SPEC, purpose, data)
    motion = take(padded("255.2f"), "wide")
    whole = padded("256.2f")
    data = file_of(with_source(motion, whole), SRCE=_srce(_wider))
    purpose = "A template: widths of 256, which the stated size and hash have, too."
    shelf.add("template-width-256", SPEC, purpose, data)


def _rows(rows: list[list[float]], *, numbered: bool = False) -> bytes:
    """The plain file with other columns, a frame number before them."""
    head, _, _ = PLAIN.rpartition(b"0.0083333\n")
    lines = [" ".join(f"{value:.2f}" for value in row) for row in rows]
    if numbered:
        lines = [f" {number + 1} {line}" for number, line in enumerate(lines)]
    return head + b"0.0083333\n" + "".join(line + "\n" for line in lines).encode()


def _edit_runs(template: bytes, edit: Callable[[list[dict[str, int]]], object]) -> bytes:
    fields = parse(TEMPLATE, template, "template")
    edit(fields.patterns[0].runs)
    return build(TEMPLATE, fields, "template")


def _run_of_none(template: bytes) -> bytes:
    run = {"gap": 0, "column": 10, "n_columns": 0, "width": 0}
    return _edit_runs(template, lambda runs: runs.append(run))


def _first_again(template: bytes) -> bytes:
    run = {"gap": 1, "column": 1, "n_columns": 1, "width": 0}

    def edit(runs: list[dict[str, int]]) -> None:
        run["gap"] = runs[-1]["gap"]
        runs.append(run)

    return _edit_runs(template, edit)


def _with_number(template: bytes) -> bytes:
    """One run of ten columns behind a blank each, from the frame number on."""

    def edit(runs: list[dict[str, int]]) -> None:
        runs[:] = [{"gap": runs[-1]["gap"], "column": 0, "n_columns": 10, "width": 0}]

    return _edit_runs(template, edit)


def _wider(template: bytes) -> bytes:
    """Zigzag 510, a width of 255, becomes 512."""
    assert template.count(b"\xfe\3") >= 1
    return template.replace(b"\xfe\3", b"\x80\4")


def _patterns(shelf: Unrestorable) -> None:
    """Patterns that no row needs, or that the template should have."""
    plain = take(PLAIN, "plain")
    many = varint(1024) + b"\0\0" * 1024
    data = file_of(with_source(plain, PLAIN, put(DETAIL, "patterns", many)))
    purpose = "A detail: 1,024 further patterns that no row has."
    shelf.add("detail-patterns-unused", SPEC, purpose, data)
    assert plain.source is not None
    start, stop = span(TEMPLATE, plain.source.template, "patterns.0")
    pattern = plain.source.template[start:stop]
    motion = with_source(plain, PLAIN, put(DETAIL, "patterns", b"\1" + pattern))
    data = file_of(motion, SRCE=_srce(put(TEMPLATE, "patterns", b"\0")))
    purpose = "A detail: the pattern of all rows, which the template should have."
    shelf.add("detail-pattern-of-all", SPEC, purpose, data)


def _notes(shelf: Unrestorable) -> None:
    """Notes that change nothing in the text."""

    def parted(notes: bytes) -> bytes:
        start, _ = span(NOTES, notes, "patterns.0")
        assert notes[0] < 127
        return bytes((notes[0] + 1,)) + notes[1:start] + b"\0\0" + notes[start:]

    data = file_of(take(ODD, "odd"), segments=stream(0, parted))
    purpose = "Frame notes: a run of no rows before others."
    shelf.add("notes-run-of-none", NOTES_SPEC, purpose, data)
    purpose = "Frame notes: five rows of pattern 0, of four."
    shelf.add("notes-rows-usual", NOTES_SPEC, purpose, _noted(b"\1\5\0\0"))
    purpose = "Frame notes: pattern 1,024 for no row that is restored."
    assert FRAME_NOTES == 2
    shelf.add("notes-pattern-1024", NOTES_SPEC, purpose, _noted(b"\1\1\x80\x08\0"))


def _numbered(shelf: Unrestorable) -> None:
    """Two rows that have one frame number."""
    motion = called(amc.read(EXAMPLE, "example"), "example.amc")
    signal = replace(motion.signals[0], samples_per_frame=2)
    motion = replace(motion, signals=(signal,), frame_numbers=None)
    purpose = "An AMC file of a clip with two rows a frame, which would come back."
    shelf.add("AMC-rows", "The text of AMC and BVH", purpose, file_of(motion))


def _c3d_fields(shelf: Unrestorable) -> None:
    """Fields out of order, or with more bytes than they take."""
    text = made(first=3).build()
    motion = take_c3d(text, "prop")
    assert motion.source is not None
    detail = parse(C3D_DETAIL, motion.source.detail, "detail")
    values = detail["values"]
    longer = put(C3D_DETAIL, "values", varint(len(values) + 1) + values + b"\0")
    purpose = "A detail of C3D: a byte behind the values of all fields."
    shelf.add(
        "c3d-detail-values-and-byte", C3D_SPEC, purpose, file_of(with_source(motion, text, longer))
    )
    swapped = values[2:4] + values[:2] + values[4:]
    edit = put(C3D_DETAIL, "values", varint(len(values)) + swapped)
    data = file_of(with_source(motion, text, edit), SRCE=_srce(_descending))
    purpose = "A template of C3D: its first two fields, with their values, in another order."
    shelf.add("c3d-template-field-descending", C3D_SPEC, purpose, data)
    edit = put(C3D_DETAIL, "values", varint(len(values) + 2) + values + b"\0\0")
    data = file_of(with_source(motion, text, edit), SRCE=_srce(_behind))
    purpose = "A template of C3D: a field more, the last byte of which is not in head."
    shelf.add("c3d-template-field-half", C3D_SPEC, purpose, data)


def _descending(template: bytes) -> bytes:
    fields = parse(C3D_TEMPLATE, template, "template")
    fields.fields[0], fields.fields[1] = fields.fields[1], fields.fields[0]
    return build(C3D_TEMPLATE, fields, "template")


def _behind(template: bytes) -> bytes:
    fields = parse(C3D_TEMPLATE, template, "template")
    fields.fields.append({"at": len(fields.head) - 1, "kind": 0})
    return build(C3D_TEMPLATE, fields, "template")


def _c3d_parts(shelf: Unrestorable) -> None:
    """Parts of a file, and signals, that do not fit and could be restored."""
    text = made(first=3, tail=b"behind" + bytes(506)).build()
    motion = take_c3d(text, "prop")
    assert motion.source is not None
    detail = parse(C3D_DETAIL, motion.source.detail, "detail")
    tail = detail.tail
    moved = put(C3D_DETAIL, "tail", varint(len(tail) - 1) + tail[1:])
    gap = put(C3D_TEMPLATE, "gap", b"\1" + tail[:1])
    data = file_of(with_source(motion, text, moved), SRCE=_srce(gap))
    purpose = "A template of C3D: the first byte of the tail as a gap before no rotations."
    shelf.add("c3d-template-gap-moved", C3D_SPEC, purpose, data)
    integers = take_c3d(made(size=2).build(), "prop")
    rotations = Signal(
        np.arange(4 * 17).reshape(4, 17),
        (Grid(GridKind.INTEGER),) * 17,
        "rotations",
        channels=tuple(Channel("", f"turn {c}") for c in range(17)),
    )
    whole = made(size=2).build() + rotations.values.astype("<i2").tobytes()
    motion = replace(integers, signals=(*integers.signals, rotations))
    edit = put(C3D_TEMPLATE, "rotations", b"\1")
    data = file_of(with_source(motion, whole), SRCE=_srce(edit))
    purpose = "A template of C3D: rotations of integers, which the clip has."
    shelf.add("c3d-template-rotations-there", C3D_SPEC, purpose, data)
    residuals = integers.signals[1]
    grids = (Grid(GridKind.BINARY64),) * residuals.n_channels
    floats = replace(residuals, values=residuals.values.astype(np.float64), grids=grids)
    motion = replace(integers, signals=(integers.signals[0], floats, *integers.signals[2:]))
    purpose = "Residuals of integers on a grid of binary64."
    shelf.add("c3d-signals-grid-of-residuals", C3D_SPEC, purpose, file_of(motion))
