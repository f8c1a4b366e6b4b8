"""Invalid, one fault each: streams of ``raw``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.edits import Edit, flip, plus, raw_stream, stream
from tools.vectors.build.files import Broken, Vector, file_of
from tools.vectors.build.motions import HUNDREDTHS, column
from tools.vectors.invalid.common import every_codec


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/raw")
    _streams(shelf)
    _zeros(shelf)
    every_codec.add(shelf, "raw")
    return shelf.vectors


def _streams(shelf: Broken) -> None:
    def wide(data: bytes) -> bytes:
        """The first channel, of 4 rows and width 1, in offsets of 9 bytes."""
        return data[:8] + b"\x09" + data[9:13] + b"\0" * 32 + data[13:]

    cases: tuple[tuple[str, str, str, Edit], ...] = (
        ("width-9", "Codec 0: raw", "Offsets of 9 bytes.", wide),
        ("too-short", "Codec 0: raw", "The offsets end early.", lambda data: data[:-1]),
        ("too-long", "Codec 0: raw", "A byte behind the last channel.", plus(b"\0")),
        ("head-cut", "Codec 0: raw", "The head of a channel ends early.", lambda data: data[:18]),
        ("absent", "Codec 0: raw", "A group with rows, an empty stream.", lambda data: b""),
        ("channel-missing", "Codec 0: raw", "One channel of two.", lambda data: data[:13]),
        ("another-value", "CEND", "A value that is not the hashed one.", flip(10)),
    )
    for name, spec, purpose, edit in cases:
        shelf.edited(name, spec, purpose, segments=stream(1, edit))


def _zeros(shelf: Broken) -> None:
    """Streams that a reader gets the right values from if it overlooks the fault."""
    motion, wide = column([3.0, 5.0, 9.0, 3.0], HUNDREDTHS), [[300, 500, 900, 300]]
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("width-9-zeros", "Offsets of 9 bytes, the highest of each 0.", _with(wide, 9)),
        ("zero-missing", "The last byte is missing, which is 0.", lambda data: data[:-1]),
    )
    for name, purpose, edit in cases:
        data = file_of(motion, segments=stream(0, edit))
        shelf.add(name, "Codec 0: raw", purpose, data)


def _with(ordinals: list[list[int]], width: int) -> Edit:
    return lambda _: raw_stream(ordinals, (width,))
