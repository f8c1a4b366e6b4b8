"""Invalid, one fault each: what restores source files. All are asked for sources."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from mcz.codecs import lossless
from mcz.container import payloads
from mcz.container.segments import FRAME_NOTES
from mcz.files.encoding import write_skeleton
from mcz.formats import amc, asf
from mcz.formats.layout import DETAIL, TEMPLATE
from mcz.formats.notes import NOTES
from mcz.motion import Motion
from mcz.schema import build, deflate, inflate, parse, varint
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished
from tools.vectors.edits import Edit, Made, plus, put, span, stream
from tools.vectors.sources import AMC, ASF, ODD, PLAIN, called, take

MANY = b"\x80\x08" + b"\0\0" * 1024  # PATTERNs without a run
NUMBERS = b"\0\0\2\0"  # a RUN of two columns of the frame number
HEADING = "Source reconstruction"
NOTES_SPEC = "Frame notes of AMC and BVH; Frame notes"


class Unrestorable(Broken):
    """A Shelf of files whose sources must be refused."""

    def add(self, name: str, spec: str, purpose: str, data: bytes, **rest: Any) -> None:
        super().add(name, spec, purpose, data, modes=("sources",), **rest)


def vectors() -> Iterable[Vector]:
    shelf = Unrestorable("invalid/sources")
    _clip(shelf)
    _template(shelf)
    _detail(shelf)
    _notes(shelf)
    _number_texts(shelf)
    _limits(shelf)
    _acclaim(shelf)
    return shelf.vectors


def _clip(shelf: Broken) -> None:
    cases: list[tuple[str, str, str, str, bytes]] = [
        ("hash", "CEND", "Another hash.", "source_sha256", b"\1" + b"s" * 32),
        ("hash-missing", "CEND", "No hash.", "source_sha256", b"\0"),
        ("size", "CLIP", "Another size.", "source.0.size", varint(len(PLAIN) + 1)),
        ("format-differs", "CLIP", "Another format than SRCE.", "source.0.format", b"\2"),
    ]
    paths = {"up": "../a.bvh", "absolute": "/a.bvh", "empty-part": "a//b.bvh", "drive": "c:/a.bvh"}
    for name, text in paths.items():
        path = varint(len(text)) + text.encode()
        cases.append((f"path-{name}", "CLIP", f"The path {text!r}.", "source.0.path", path))
    for name, kind, purpose, path, new in cases:
        edit = put(getattr(payloads, kind), path, new)
        data = file_of(take(PLAIN, "plain"), **{kind: edit})
        shelf.add(name, f"{kind}; {HEADING}", f"A source: {purpose}", data)
    edits = {
        "SRCE": put(payloads.SRCE, "format", b"\1"),
        "CLIP": put(payloads.CLIP, "source.0.format", b"\1"),
    }
    purpose = "A clip whose source is an ASF file, which is one of a skeleton."
    data = file_of(take(PLAIN, "plain"), **edits)
    shelf.add("format-of-skeletons", f"CLIP; {HEADING}", purpose, data)


def _srce(edit: Edit, *, deflated: bool = False) -> Edit:
    """Edit the template inside a SRCE, which becomes a stored one, or a deflated one."""

    def edit_payload(payload: bytes) -> bytes:
        fields = parse(payloads.SRCE, payload, "SRCE")
        text = fields.data
        if fields.encoding:
            text = inflate(fields.data, fields.size, "SRCE")
        text = edit(text)
        packed = deflate(text) if deflated else text
        fields.update({"encoding": int(deflated), "size": len(text), "data": packed})
        return build(payloads.SRCE, fields, "SRCE")

    return edit_payload


def _template(shelf: Broken) -> None:
    plain = take(PLAIN, "plain")

    def field(path: str, new: bytes) -> Edit:
        return put(TEMPLATE, path, new)

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
        data = file_of(plain, SRCE=_srce(edit))
        shelf.add(f"template-{name}", f"Templates and details; {HEADING}", f"{purpose}.", data)


def _second_pattern(template: bytes) -> bytes:
    start, stop = span(TEMPLATE, template, "patterns.0")
    pattern = template[start:stop]
    return put(TEMPLATE, "patterns", b"\2" + pattern * 2)(template)


def _shorter(motion: Motion) -> bytes:
    """The two parts of the header, the second without its last byte."""
    assert motion.source is not None
    fields = parse(TEMPLATE, motion.source.template, "template")
    first, second = fields.header
    return b"\2" + varint(len(first)) + first + varint(len(second) - 1) + second[:-1]


def _detail(shelf: Broken) -> None:
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
        detail = put(DETAIL, path, new)(motion.source.detail)
        data = file_of(replace(motion, source=replace(motion.source, detail=detail)))
        spec = f"Templates and details; {HEADING}"
        shelf.add(f"detail-{name}", spec, f"A detail: {purpose}.", data)


def _notes(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("pattern", "a pattern beyond the last", put(NOTES, "patterns.0.pattern", b"\x09")),
        ("rows", "a run behind the last row", put(NOTES, "patterns.0.n_rows", b"\x09")),
        ("no-rows", "a run of no rows", put(NOTES, "patterns.0.n_rows", b"\0")),
        ("tail", "a byte behind them, which are closed", plus(b"\0")),
    )
    for name, purpose, edit in cases:
        data = file_of(take(ODD, "odd"), segments=stream(0, edit))
        shelf.add(f"notes-{name}", NOTES_SPEC, f"Frame notes: {purpose}.", data)

    def unwanted(made: Made) -> Made:
        ((header, streams),) = made
        return [(replace(header, flags=header.flags | FRAME_NOTES), [b"\0\1\0\1x", *streams])]

    data = file_of(take(PLAIN, "plain"), segments=unwanted)
    shelf.add(
        "notes-text", NOTES_SPEC, "Frame notes: the number of a frame that is no number.", data
    )


def _number_texts(shelf: Broken) -> None:
    """Frame numbers as they were printed, of the third row of five."""
    cases = {
        "empty": ("is nothing", b""),
        "sign": ("is a sign alone", b"-"),
        "two-signs": ("has two signs", b"+-9"),
        "blank": ("begins with a blank", b" 9"),
        "point": ("has a point", b"9."),
        "33-digits": ("has 33 digits", b"9" * 33),
        "other-digits": ("has a digit of another script", "\u0663".encode()),
    }
    for name, (what, text) in cases.items():
        notes = b"\0\1\2" + varint(len(text)) + text
        purpose = f"Frame notes: the number of a frame {what}."
        shelf.add(f"notes-text-{name}", NOTES_SPEC, purpose, _noted(notes))
    rows = {
        "row-beyond": ("lies behind the last", b"\0\1\4\0019"),
        "row-twice": ("comes twice", b"\0\2\2\0019\0\0018"),
        "row-sum": ("lies behind the last, by two steps", b"\0\2\2\0019\2\0018"),
    }
    for name, (what, notes) in rows.items():
        purpose = f"Frame notes: a row with a number {what}."
        shelf.add(f"notes-{name}", NOTES_SPEC, purpose, _noted(notes))


def _noted(notes: bytes) -> bytes:
    """The plain file, its first segment with these notes."""

    def edit(made: Made) -> Made:
        ((header, streams),) = made
        return [(replace(header, flags=header.flags | FRAME_NOTES), [notes, *streams])]

    return file_of(take(PLAIN, "plain"), segments=edit)


def _limits(shelf: Broken) -> None:
    """Templates that print more than there may be."""
    plain = take(PLAIN, "plain")
    spec = f"Templates and details; {HEADING}"

    data = file_of(plain, SRCE=_srce(_many_gaps, deflated=True))
    shelf.add("template-gaps-many", spec, "A template: 2^20 + 1 gaps.", data)
    purpose = "A template: more than 2^20 bytes of gaps in a row."
    shelf.add("template-gap-size", spec, purpose, _wide(2, b"\n" + b" " * 2**20))
    no_patterns = put(TEMPLATE, "patterns", b"\0")
    assert plain.source is not None
    own = put(DETAIL, "patterns", b"\1\0\0")(plain.source.detail)
    source = replace(plain.source, detail=own)
    data = file_of(replace(plain, source=source), SRCE=_srce(no_patterns))
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
    start, stop = span(TEMPLATE, template, "gaps")
    old = template[start:stop]
    n = old[0]
    return template[:start] + varint(2**20 + 1) + old[1:] + bytes(2**20 + 1 - n) + template[stop:]


def _wide(n_rows: int, tail: bytes) -> bytes:
    """A file whose rows end in ``tail``; its size and hash are right."""
    head = PLAIN.partition(b"Frames: ")[0] + f"Frames: {n_rows}\nFrame Time: 0.01\n".encode()
    row = b"1 2 3 4 5 6 7 8 9"
    motion = take(head + (row + b"\n") * n_rows, "bomb")
    assert motion.source is not None
    fields = parse(TEMPLATE, motion.source.template, "template")
    place = fields.patterns[0].tail
    assert fields.gaps[place] == b"\n"
    fields.gaps[place] = tail
    whole = head + (row + tail) * n_rows
    digest = hashlib.sha256(whole).digest()
    template = build(TEMPLATE, fields, "template")
    source = replace(motion.source, template=template, size=len(whole), sha256=digest)
    return file_of(replace(motion, source=source), codec=lossless.CODEC)


def _acclaim(shelf: Broken) -> None:
    skeleton = asf.read(ASF, "mannequin")
    for name, field, new in (
        ("hash", "sha256", b"s" * 32),
        ("size", "size", b"\1"),
        ("template-missing", "template", b"t" * 16),
    ):
        crafter = Crafter(SKEL=put(payloads.SKEL, f"source.0.{field}", new))
        crafter.alias("small.asf", payloads.OF_SKELETON, write_skeleton(crafter, skeleton))
        purpose = f"The source of a skeleton: another {field}."
        shelf.add(f"ASF-{name}", f"SKEL; {HEADING}", purpose, finished(crafter))
    motion = called(amc.read(AMC, "take", skeleton), "take.amc")
    data = file_of(replace(motion, frame_numbers=None))
    purpose = "Frame numbers with a gap, which the clip does not state."
    shelf.add("AMC-frame-numbers", f"{HEADING}; Registry", purpose, data)
