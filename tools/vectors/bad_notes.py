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
from mcz.schema import build, varint
from tools.vectors.craft import Broken, Vector, file_of, rehash
from tools.vectors.edits import Edit, Made, at, both, plus, put, raw_stream, stream
from tools.vectors.motions import HUNDREDTHS, column, dance, numbers
from tools.vectors.valid_notes import with_exceptions, with_grid_changes


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/notes")
    _exceptions(shelf)
    _spellings(shelf)
    _grid_changes(shelf)
    _without_text(shelf)
    _masks(shelf)
    return shelf.vectors


def _exception(path: str, new: bytes) -> Edit:
    return put(payloads.GROUP_NOTES, f"exceptions.{path}", new)


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
    twice = put(payloads.GROUP_NOTES, "grid_changes", b"\2" + b"\1\4\0\0" * 2)
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("channel", "beyond the group", put(payloads.GROUP_NOTES, "grid_changes.0.channel", b"\4")),
        ("twice", "twice the same", twice),
        (
            "kind",
            "to a grid that does not exist",
            put(payloads.GROUP_NOTES, "grid_changes.0.grid", b"\x0b\0\0"),
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
        data = build(payloads.GROUP_NOTES, {"grid_changes": [], "exceptions": []} | fields, "notes")

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
