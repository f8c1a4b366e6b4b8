"""Invalid, one fault each: group notes and masks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.container.segments import GROUP_NOTES
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.edits import Edit, Made, at, both, plus, put, raw_stream, stream
from tools.vectors.build.files import Broken, Vector, file_of, rehash
from tools.vectors.build.motions import (
    HUNDREDTHS,
    column,
    dance,
    numbers,
    with_exceptions,
    with_grid_changes,
)


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/notes")
    _exceptions(shelf)
    _spellings(shelf)
    _grid_changes(shelf)
    _without_text(shelf)
    _masks(shelf)
    _group_notes(shelf)
    return shelf.vectors


def _exception(path: str, new: bytes) -> Edit:
    return put(payloads.GroupNotes, f"exceptions.{path}", new)


def _exceptions(shelf: Broken) -> None:
    descending = both(_exception("2.channel", b"\0"), _exception("1.channel", b"\1"))

    def far_ordinal(codec_stream: bytes) -> bytes:
        """The first ordinal of the first channel, an exception's, becomes 2^51."""
        width = codec_stream[8]
        return raw_stream([[2**51, 0, 0, 0]], [8]) + codec_stream[9 + 4 * width :]

    cases: tuple[tuple[str, str, int, Edit], ...] = (
        ("row", "An exception behind the last row.", 0, _exception("4.row", b"\2")),
        ("channel", "An exception beyond the group.", 0, _exception("0.channel", b"\4")),
        ("order", "Exceptions of one row with descending channels.", 0, descending),
        ("twice", "Two exceptions at one place.", 0, _exception("2.channel", b"\0")),
        ("ordinal", "The ordinal at an exception is beyond the grid.", 2, far_ordinal),
        ("trailing-byte", "A byte behind group notes, which are closed.", 0, plus(b"\0")),
        ("cut", "Group notes that end within an exception.", 0, lambda data: data[:-1]),
    )
    for name, purpose, index, edit in cases:
        data = file_of(with_exceptions(), segments=stream(index, edit))
        shelf.add(f"exception-{name}", "Group notes", purpose, data)


def _spellings(shelf: Broken) -> None:
    """Texts that some library or other takes for a number, most for 1000, which is hashed."""
    cases = {
        "word": b"abc",
        "empty": b"",
        "blank": b" 1000",
        "blank-behind": b"1000 ",
        "hexadecimal": b"0x3e8",
        "underscore": b"1_000",
        "exponent": b"1000e",
        "exponent-sign": b"1000e+",
        "point": b".",
        "two-points": b"1000.0.0",
        "comma": b"1000,0",
        "two-signs": b"--1000",
        "NUL": b"1000\0",
        "other-digits": "١٠٠٠".encode(),
    }
    for name, text in cases.items():
        edit = _exception("0.text", varint(len(text)) + text)
        data = file_of(with_exceptions(), segments=stream(0, edit))
        purpose = f"An exception {text.decode()!r}, which is no number."
        shelf.add(f"spelling-{name}", "Group notes; Number grids", purpose, data)


def _grid_changes(shelf: Broken) -> None:
    twice = put(payloads.GroupNotes, "grid_changes", b"\2" + b"\1\4\0\0" * 2)
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("channel", "beyond the group", put(payloads.GroupNotes, "grid_changes.0.channel", b"\4")),
        ("twice", "twice the same", twice),
        (
            "kind",
            "to a grid that does not exist",
            put(payloads.GroupNotes, "grid_changes.0.grid", b"\x0b\0\0"),
        ),
    )
    for name, purpose, edit in cases:

        def second(made: Made, edit: Edit = edit) -> Made:
            header, streams = made[1]
            return [made[0], (header, [edit(streams[0]), *streams[1:]]), *made[2:]]

        data = file_of(with_grid_changes(), segments=second)
        shelf.add(f"change-{name}", "Group notes", f"A change of grid: {purpose}.", data)


def _without_text(shelf: Broken) -> None:
    def noted(**fields: Any) -> Callable[[Made], Made]:
        data = built(payloads.GroupNotes, {"grid_changes": [], "exceptions": []} | fields, "notes")

        def edit(made: Made) -> Made:
            ((header, streams),) = made
            return [(replace(header, flags=header.flags | GROUP_NOTES), [data, *streams])]

        return edit

    change = noted(grid_changes=[{"channel": 0, "grid": HUNDREDTHS}])
    nine = noted(exceptions=[{"row": 0, "channel": 0, "text": b"9"}])
    purpose = "A change to another grid in a signal of integers."
    integers, floats = (column([5, 6, 7], Grid(k)) for k in (GridKind.INTEGER, GridKind.BINARY32))
    data = file_of(integers, segments=change)
    shelf.add("change-of-integers", "Group notes; CEND", purpose, data)
    for name, motion in (("integers", integers), ("binary", floats)):
        values = motion.signals[0].values.copy()
        values[0] = 9
        data = file_of(motion, segments=nine, CEND=rehash(values))
        purpose = f"An exception on a grid without text: {name}."
        shelf.add(f"exception-of-{name}", "Group notes; Number grids", purpose, data)


def _masks(shelf: Broken) -> None:
    """The mask of the first group has the runs 1 1 2 1 2 1 2 1 1."""

    def longer(data: bytes) -> bytes:
        return data[:-1] + bytes((data[-1] + 1,))

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("too-short", "A mask that ends a value early.", lambda data: data[:-1]),
        ("too-long", "A mask whose last run is too long.", longer),
        ("run-too-many", "A run behind the last value.", plus(b"\1")),
        ("empty-run", "A run of no values that is not the first.", at(2, b"\0\0\2\1")),
        ("varint", "A run not in its shortest form.", lambda data: b"\x81\0" + data[1:]),
        ("cut", "A mask that ends within a varint.", at(-1, b"\x81")),
        ("not-that-hashed", "Another mask than the hashed one.", at(1, b"\2\1")),
    )
    for name, purpose, edit in cases:
        shelf.add(f"mask-{name}", "Masks", purpose, file_of(_masked(), segments=stream(0, edit)))


def _masked() -> Motion:
    """Three frames, the middle one invalid."""
    mask = np.ones((3, 6), np.bool_)
    mask[1] = False
    return dance(signals=(Signal(numbers(3, 6), (HUNDREDTHS,) * 6, mask=mask),))


def _group_notes(shelf: Broken) -> None:
    """Group notes of a segment that is crafted whole."""

    def noted(**fields: Any) -> Callable[[Made], Made]:
        data = built(payloads.GroupNotes, {"grid_changes": [], "exceptions": []} | fields, "notes")

        def edit(made: Made) -> Made:
            ((header, streams),) = made
            notes = [data, *(b"" for _ in streams[1:])]
            return [(replace(header, flags=header.flags | GROUP_NOTES), [*notes, *streams])]

        return edit

    later = [{"channel": 1, "grid": HUNDREDTHS}, {"channel": 0, "grid": HUNDREDTHS}]
    purpose = "Changes of grid, to what they are, with descending channels."
    edit = noted(grid_changes=later)
    shelf.edited("change-order", "Group notes", purpose, segments=edit)
    floats = column([5.0, 6.0, 7.0], Grid(GridKind.FIXED, 0))
    change = [{"channel": 0, "grid": Grid(GridKind.BINARY64)}]
    nine = [{"row": 0, "channel": 0, "text": b"9"}]

    def stored(made: Made) -> Made:
        header, _ = made[0]
        words = np.array([9.0, 6.0, 7.0]).view(np.int64).tolist()
        return noted(grid_changes=change, exceptions=nine)([(header, [raw_stream([words], [8])])])

    data = file_of(floats, segments=stored, CEND=rehash(np.array([[9.0], [6.0], [7.0]])))
    purpose = "An exception on a grid that has text in CLIP and none in this segment."
    shelf.add("exception-of-changed", "Group notes; Number grids", purpose, data)
    values = dance().signals[0].values.copy()
    values[0, :2] = 8, 9
    two = [(1, b"9"), (0, b"8")]
    again = [(0, b"8"), (1, b"9"), (1, b"9")]
    for name, purpose, places in (
        ("descending", "Exceptions with descending channels, whose values are hashed.", two),
        ("again", "The same exception twice, whose value is hashed.", again),
    ):
        listed = [{"row": 0, "channel": c, "text": text} for c, text in places]
        edit = noted(exceptions=listed)
        shelf.edited(
            f"exception-{name}", "Group notes", purpose, segments=edit, CEND=rehash(values)
        )
    values = dance().signals[0].values.copy()
    values[0, 0] = 8
    edit = noted(exceptions=[{"row": 0, "channel": 0, "text": b"8.0"}])
    cut = both(edit, stream(0, lambda data: data[:-1]))
    purpose = "Group notes that end before the last zero of an exception."
    shelf.edited("exception-zero-cut", "Group notes", purpose, segments=cut, CEND=rehash(values))
    shelf.edited(
        "exception-far-ordinal",
        "Group notes",
        "The ordinal at an exception is beyond the grid; all values are those hashed.",
        segments=both(stream(0, _far), noted(exceptions=[{"row": 0, "channel": 0, "text": b"8"}])),
        CEND=rehash(values),
    )
    edit = noted(exceptions=[{"row": 4, "channel": 0, "text": b"9"}])
    purpose = "An exception behind the last row, which no value shows."
    shelf.edited("exception-behind", "Group notes", purpose, segments=edit)
    purpose = "A run of no invalid values between two of valid ones."
    data = file_of(_masked(), segments=stream(0, _parted))
    shelf.add("mask-empty-run-between", "Masks", purpose, data)


def _far(data: bytes) -> bytes:
    """The first ordinal of the first channel, of 4 rows and width 1, becomes 2^51."""
    assert data[8] == 1
    least = int.from_bytes(data[:8], "little", signed=True)
    others = [least + offset for offset in data[10:13]]
    return raw_stream([[2**51, *others]], [8]) + data[13:]


def _parted(data: bytes) -> bytes:
    """The third run, of two values, as two of one with nothing between."""
    assert data[:3] == b"\1\1\2"
    return data[:2] + b"\1\0\1" + data[3:]
