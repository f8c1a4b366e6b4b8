"""Templates and details of text at fault."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mcz.codecs.lossless import lossless
from mcz.formats.layout import Detail, Template
from mcz.motion import Motion
from mcz.schema import parse, varint
from tools.records import built
from tools.vectors.build.edits import Edit, plus, put, span
from tools.vectors.build.files import Broken, Unrestorable, file_of
from tools.vectors.build.source_files import (
    HEADING,
    ODD,
    PLAIN,
    padded,
    take,
    with_source,
    with_template,
)

MANY = b"\x80\x08" + b"\0\0" * 1024  # PATTERNs without a run
NUMBERS = b"\0\0\2\0"  # a RUN of two columns of the frame number
TEMPLATE_SPEC = "Templates and details; Source reconstruction"


def add(shelf: Unrestorable) -> None:
    _template(shelf)
    _details(shelf)
    _limits(shelf)
    _same_text(shelf)
    _patterns(shelf)


def _template(shelf: Broken) -> None:
    plain = take(PLAIN, "plain")

    def field(path: str, new: bytes) -> Edit:
        return put(Template, path, new)

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("tail", "a byte behind it, which is closed", plus(b"\0")),
        ("cut", "it ends early", lambda data: data[:-1]),
        ("header", "three parts of a header", field("header", b"\3\0\0\0")),
        ("no-header", "no header", field("header", b"\0")),
        ("text", "the header lacks a byte", field("header", _shorter(plain))),
        ("gap", "a gap beyond the last", field("patterns.0.tail", b"\x63")),
        ("two-patterns", "a second pattern", _second_pattern),
        ("number-twice", "a frame number in two columns", field("patterns.0.runs.0", NUMBERS)),
        ("wide", "a width of 256", field("patterns.0.runs.1.width", b"\x80\4")),
        ("no-pattern", "rows without a pattern", field("patterns", b"\0")),
        ("column", "a channel beyond the last", field("patterns.0.runs.1.n_columns", b"\x63")),
        ("no-columns", "a run of no columns", field("patterns.0.runs.1.n_columns", b"\0")),
        ("column-twice", "a channel twice", field("patterns.0.runs.1.column", b"\1")),
        ("width", "a width of -1", field("patterns.0.runs.1.width", b"\1")),
    )
    for name, purpose, edit in cases:
        data = file_of(plain, SRCE=with_template(edit))
        shelf.add(f"template-{name}", f"Templates and details; {HEADING}", f"{purpose}.", data)


def _second_pattern(template: bytes) -> bytes:
    start, stop = span(Template, template, "patterns.0")
    pattern = template[start:stop]
    return put(Template, "patterns", b"\2" + pattern * 2)(template)


def _shorter(motion: Motion) -> bytes:
    """The two parts of the header, the second without its last byte."""
    assert motion.source is not None
    fields = parse(Template, motion.source.template, "template")
    first, second = fields.header
    return b"\2" + varint(len(first)) + first + varint(len(second) - 1) + second[:-1]


def _details(shelf: Broken) -> None:
    plain, odd = take(PLAIN, "plain"), take(ODD, "odd")
    cases = (
        ("ends", "ends is 2", odd, "ends", b"\2"),
        ("rows", "a count as printed for another number of rows", odd, "rows", b"\1"),
        ("rows-of-nothing", "rows without a count", plain, "rows", b"\4"),
        ("patterns", "1,024 further patterns", odd, "patterns", MANY),
        ("gap", "a further pattern with a gap beyond the last", odd, "patterns.0.tail", b"\x63"),
        ("ending", "an ending though ends is 0", plain, "ending", b"\1\n"),
        ("tail", "a byte behind it, which is closed", plain, "ending", b"\0\0"),
        ("cut", "it ends early", plain, "ending", b""),
    )
    for name, purpose, motion, path, new in cases:
        assert motion.source is not None
        detail = put(Detail, path, new)(motion.source.detail)
        data = file_of(replace(motion, source=replace(motion.source, detail=detail)))
        spec = f"Templates and details; {HEADING}"
        shelf.add(f"detail-{name}", spec, f"A detail: {purpose}.", data)


def _limits(shelf: Broken) -> None:
    """Templates that print more than there may be."""
    plain = take(PLAIN, "plain")
    spec = f"Templates and details; {HEADING}"

    data = file_of(plain, SRCE=with_template(_many_gaps, deflated=True))
    shelf.add("template-gaps-many", spec, "A template: 2^20 + 1 gaps.", data)
    purpose = "A template: more than 2^20 bytes of gaps in a row."
    shelf.add("template-gap-size", spec, purpose, _wide(2, b"\n" + b" " * 2**20))
    no_patterns = put(Template, "patterns", b"\0")
    assert plain.source is not None
    own = put(Detail, "patterns", b"\1\0\0")(plain.source.detail)
    source = replace(plain.source, detail=own)
    data = file_of(replace(plain, source=source), SRCE=with_template(no_patterns))
    purpose = "A pattern of the detail, but none of the template."
    shelf.add("detail-patterns-alone", spec, purpose, data)
    purpose = "96 rows of a megabyte of blanks each, of a few bytes."
    shelf.add(
        "text-bomb",
        f"{spec}; Limits and profiles",
        purpose,
        _wide(96, b"\n" + b" " * (2**20 - 100)),
    )


def _many_gaps(template: bytes) -> bytes:
    start, stop = span(Template, template, "gaps")
    old = template[start:stop]
    n = old[0]
    return template[:start] + varint(2**20 + 1) + old[1:] + bytes(2**20 + 1 - n) + template[stop:]


def _wide(n_rows: int, tail: bytes) -> bytes:
    """A file whose rows end in ``tail``; its size and hash are right."""
    head = PLAIN.partition(b"Frames: ")[0] + f"Frames: {n_rows}\nFrame Time: 0.01\n".encode()
    row = b"1 2 3 4 5 6 7 8 9"
    motion = take(head + (row + b"\n") * n_rows, "bomb")
    assert motion.source is not None
    fields = parse(Template, motion.source.template, "template")
    place = fields.patterns[0].tail
    assert fields.gaps[place] == b"\n"
    fields.gaps[place] = tail
    whole = head + (row + tail) * n_rows
    digest = hashlib.sha256(whole).digest()
    template = built(Template, fields, "template")
    source = replace(motion.source, template=template, size=len(whole), sha256=digest)
    return file_of(replace(motion, source=source), codec=lossless.CODEC)


def _same_text(shelf: Unrestorable) -> None:
    plain = take(PLAIN, "plain")

    def third_part(template: bytes) -> bytes:
        fields = parse(Template, template, "template")
        parts = [*fields.header, b""]
        listed = varint(3) + b"".join(varint(len(part)) + part for part in parts)
        return put(Template, "header", listed)(template)

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("header-empty-part", "a third part of the header, which is empty", third_part),
        ("run-of-none", "a run of no columns behind one of some", _run_of_none),
        (
            "run-gap",
            "a run with a gap beyond the last",
            put(Template, "patterns.0.runs.1.gap", b"c"),
        ),
    )
    for name, purpose, edit in cases:
        data = file_of(plain, SRCE=with_template(edit))
        shelf.add(f"template-{name}", TEMPLATE_SPEC, f"A template: {purpose}.", data)
    numbers = plain.signals[0].values.tolist()
    again = _rows([[*row, row[0]] for row in numbers])
    data = file_of(with_source(plain, again), SRCE=with_template(_first_again))
    shelf.add(
        "template-column-again", TEMPLATE_SPEC, "A template: a channel is printed twice.", data
    )
    counted = _rows([[*row] for row in numbers], numbered=True)
    data = file_of(with_source(plain, counted), SRCE=with_template(_with_number))
    purpose = "A template: a run of the frame number and all channels."
    shelf.add("template-number-and-more", TEMPLATE_SPEC, purpose, data)
    motion = take(padded("255.2f"), "wide")
    whole = padded("256.2f")
    data = file_of(with_source(motion, whole), SRCE=with_template(_wider))
    purpose = "A template: widths of 256, which the stated size and hash have, too."
    shelf.add("template-width-256", TEMPLATE_SPEC, purpose, data)


def _rows(rows: list[list[float]], *, numbered: bool = False) -> bytes:
    """The plain file with other columns, a frame number before them."""
    head, _, _ = PLAIN.rpartition(b"0.0083333\n")
    lines = [" ".join(f"{value:.2f}" for value in row) for row in rows]
    if numbered:
        lines = [f" {number + 1} {line}" for number, line in enumerate(lines)]
    return head + b"0.0083333\n" + "".join(line + "\n" for line in lines).encode()


def _edit_runs(template: bytes, edit: Callable[[list[dict[str, int]]], object]) -> bytes:
    fields = parse(Template, template, "template")
    edit(fields.patterns[0].runs)
    return built(Template, fields, "template")


def _run_of_none(template: bytes) -> bytes:
    run = {"gap": 0, "column": 10, "n_columns": 0, "width": 0}
    return _edit_runs(template, lambda runs: runs.append(run))


def _first_again(template: bytes) -> bytes:
    run = {"gap": 1, "column": 1, "n_columns": 1, "width": 0}

    def edit(runs: list[Any]) -> None:
        run["gap"] = runs[-1].gap
        runs.append(run)

    return _edit_runs(template, edit)


def _with_number(template: bytes) -> bytes:
    """One run of ten columns behind a blank each, from the frame number on."""

    def edit(runs: list[Any]) -> None:
        runs[:] = [{"gap": runs[-1].gap, "column": 0, "n_columns": 10, "width": 0}]

    return _edit_runs(template, edit)


def _wider(template: bytes) -> bytes:
    """Zigzag 510, a width of 255, becomes 512."""
    assert template.count(b"\xfe\3") >= 1
    return template.replace(b"\xfe\3", b"\x80\4")


def _patterns(shelf: Unrestorable) -> None:
    """Patterns that no row needs, or that the template should have."""
    plain = take(PLAIN, "plain")
    many = varint(1024) + b"\0\0" * 1024
    data = file_of(with_source(plain, PLAIN, put(Detail, "patterns", many)))
    purpose = "A detail: 1,024 further patterns that no row has."
    shelf.add("detail-patterns-unused", TEMPLATE_SPEC, purpose, data)
    assert plain.source is not None
    start, stop = span(Template, plain.source.template, "patterns.0")
    pattern = plain.source.template[start:stop]
    motion = with_source(plain, PLAIN, put(Detail, "patterns", b"\1" + pattern))
    data = file_of(motion, SRCE=with_template(put(Template, "patterns", b"\0")))
    purpose = "A detail: the pattern of all rows, which the template should have."
    shelf.add("detail-pattern-of-all", TEMPLATE_SPEC, purpose, data)
