"""Frame notes at fault."""

from __future__ import annotations

from dataclasses import replace

from mcz.container.segments import FRAME_NOTES
from mcz.formats.notes import Notes
from mcz.schema import varint
from tools.vectors.build.edits import Edit, Made, plus, put, span, stream
from tools.vectors.build.files import Broken, Unrestorable, file_of
from tools.vectors.build.source_files import ODD, PLAIN, take

NOTES_SPEC = "Frame notes of AMC and BVH; Frame notes"


def add(shelf: Unrestorable) -> None:
    _notes(shelf)
    _number_texts(shelf)
    _without_effect(shelf)


def _notes(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("pattern", "a pattern beyond the last", put(Notes, "patterns.0.pattern", b"\x09")),
        ("rows", "a run behind the last row", put(Notes, "patterns.0.n_rows", b"\x09")),
        ("no-rows", "a run of no rows", put(Notes, "patterns.0.n_rows", b"\0")),
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


def _without_effect(shelf: Unrestorable) -> None:
    """Notes that change nothing in the text."""

    def parted(notes: bytes) -> bytes:
        start, _ = span(Notes, notes, "patterns.0")
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
