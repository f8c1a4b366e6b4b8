"""The Source of a text file that was read, and its encoding."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.motion import Skeleton, Source
from mcz.model.numbers import values_of_texts
from mcz.model.text_format import quote
from mcz.sources.text.layout import Layout
from mcz.sources.text.rows import Rows

BOM = b"\xef\xbb\xbf"  # U+FEFF in UTF-8: it may stand at the start of a file, and says nothing
OTHERS = {  # how files of other encodings begin, longer marks first
    b"\xff\xfe\0\0": "UTF-32",
    b"\0\0\xfe\xff": "UTF-32",
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
}
LOOKED_AT = 64  # bytes in which every other one of UTF-16 is zero


def text_encoding(data: bytes) -> str:
    """ "utf-8" if all of ``data`` is, otherwise "latin-1", which every byte string is."""
    if data.isascii():
        return "utf-8"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _wide_encoding(data: bytes) -> str | None:
    for mark, name in OTHERS.items():
        if data.startswith(mark):
            return name
    start = data[:LOOKED_AT]
    for low, high in ((start[::2], start[1::2]), (start[1::2], start[::2])):
        if len(high) > 7 and not any(high) and 0 not in low:
            return "UTF-16 without a byte order mark"
    return None


def text_start(data: bytes) -> int:
    """Offset of the text, after a UTF-8 byte order mark if there is one."""
    return len(BOM) if data.startswith(BOM) else 0


def check_text(data: bytes) -> None:
    """Raise SourceError for UTF-16 and UTF-32, whose bytes no template restores."""
    wide = _wide_encoding(data)
    if wide is not None:
        raise SourceError(f"the text is {wide}; save it as UTF-8 or ASCII", line=1)


def check_first_line(data: bytes, ignored: tuple[bytes, ...]) -> None:
    """Raise SourceError if a byte order mark hides a line that means something.

    ``ignored``: how lines begin that do not. In an ASF or AMC the mark belongs to the first word,
    for every reader, as the skeleton of a file is compared with what its ASF describes.
    """
    line = data[len(BOM) :].split(b"\n", 1)[0].strip().lower()
    if data.startswith(BOM) and line and not line.startswith(ignored):
        raise SourceError(
            f"a UTF-8 byte order mark precedes {quote(line)}; save the file without it", line=1
        )


def source_of(
    format_name: str, data: bytes, header: tuple[bytes, ...], rows: Rows, count: bytes = b""
) -> Source:
    """The source of a file that was read as ``header`` and ``rows``; ``count``: as printed."""
    usual = count in (b"", b"%d" % rows.n_rows)
    layout = Layout(
        header, rows.patterns, b"" if usual else count, 0 if usual else rows.n_rows, rows.ending
    )
    template, detail = layout.build()
    digest = hashlib.sha256(data).digest()
    return Source(format_name, template, detail, rows.notes, size=len(data), sha256=digest)


MOST_JOINTS = 2**18
MOST_CHANNELS = 2**20
MOST_DEPTH = 4096


def check(what: str, number: int, most: int) -> None:
    """Raise SourceError if a skeleton has more than it may have of ``what``."""
    if number > most:
        raise SourceError(f"more than {most:,} {what}, the limit of a stored skeleton")


Floats = NDArray[np.float64]
Frame = tuple[int | None, Floats]  # its number, None if the text has none, and (n_channels,)


@dataclass(frozen=True, slots=True)
class Arriving:
    """The header of a motion, read up to its first frame, and all of its frames in order.

    Values are NaN if the text has none. ``declared`` is how many frames the header says there
    are, None if it says nothing that is a number. ``frames`` raises SourceError, with the number
    of the line, at text that is none of the format.
    """

    skeleton: Skeleton
    frames: Iterator[Frame]
    frame_rate: Fraction | None = None
    frame_rate_exact: bool = True
    metadata: Mapping[str, str] = field(default_factory=dict)
    first_number: int = 1
    declared: int | None = None


class Lines:
    """Lines as they are read, and the number of the last."""

    def __init__(self, lines: Iterator[bytes]) -> None:
        self._lines = lines
        self.number = 0

    def __iter__(self) -> Iterator[bytes]:
        return self

    def __next__(self) -> bytes:
        line = next(self._lines)
        self.number += 1
        return line

    def error(self, message: str) -> SourceError:
        return SourceError(message, line=max(1, self.number))

    def numbers(self, texts: Sequence[bytes]) -> Floats:
        """The values of the words of the last line, or of those that end with it."""
        values, bad = values_of_texts(texts)
        if bad.any():
            raise self.error(f"{quote(texts[int(np.argmax(bad))])} is not a number")
        return values
