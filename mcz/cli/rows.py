"""Rows of numbers on standard input, each read when it is asked for: CSV, or binary32."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.cli.common import literal
from mcz.errors import OptionError, SourceError
from mcz.model.motion import Skeleton
from mcz.model.text_format import cell_text
from mcz.model.types import JsonObject

MOST_LINE = 2**24  # bytes of a line
SET = b"# set "
NUMBER, TIME, STATE = "frame", "time", "state"  # columns beside the values, as decoders print them
COORDINATES = ("x", "y", "z", "tx", "ty", "tz")

Row = NDArray[np.float64] | JsonObject


class Rows:
    """Iterates over rows, (n_channels,), NaN where a value is missing.

    ``names`` are those of the first line; None where ``n_channels`` says that there is none.
    A line ``# set name=value ...`` gives a dict, other lines that begin with # are left out.
    Raises SourceError, with the number of the line or row, for what is no such row, and for a last
    line without a line end, which may have been cut.
    """

    def __init__(self, stream: BinaryIO, *, binary: bool, n_channels: int | None = None) -> None:
        self._stream, self._binary, self._at = stream, binary, 0
        self.names: list[str] | None = None
        self._drop_first, self._drop_last = 0, False
        if n_channels is None:
            self.names = self._read_names()
        self._width = n_channels

    def _read_names(self) -> list[str]:
        line = self._line()
        if line is None:
            raise SourceError("it is empty; the first line should be names")
        try:
            (names,) = csv.reader([line.decode("utf-8-sig")], strict=True)
        except (UnicodeDecodeError, ValueError, csv.Error) as error:
            raise SourceError(f"line {self._at}: not a line of names: {error}") from None
        names = [cell_text(name.strip()) for name in names]
        lead = next((n for n in ([NUMBER, TIME], [NUMBER]) if names[: len(n)] == n), [])
        if lead and _are_coordinates(names[len(lead) : len(lead) + 2]):
            self._drop_first = len(lead)
        self._drop_last = names[-1:] == [STATE] and _are_coordinates(names[-3:-1])
        return names[self._drop_first : len(names) - self._drop_last]

    def expect(self, n_channels: int) -> None:
        """Say how many values make a row."""
        self._width = n_channels

    def __iter__(self) -> Iterator[Row]:
        return self._binary_rows() if self._binary else self._text_rows()

    def _line(self) -> bytes | None:
        """The next line without its end; None where there is none."""
        line = self._stream.readline(MOST_LINE + 1)
        if not line:
            return None
        self._at += 1
        if len(line) > MOST_LINE:
            raise SourceError(f"line {self._at}: longer than {MOST_LINE} bytes")
        if not line.endswith(b"\n") and line.strip():
            raise SourceError(f"line {self._at} has no line end: the source was cut off")
        return line.removesuffix(b"\n").removesuffix(b"\r")

    def _text_rows(self) -> Iterator[Row]:
        while (line := self._line()) is not None:
            if line.startswith(SET):
                yield self._changes(line[len(SET) :])
            elif line.strip() and not line.startswith(b"#"):
                cells = line.split(b",")
                yield self._row(cells[self._drop_first : len(cells) - self._drop_last])

    def _row(self, cells: Sequence[bytes]) -> NDArray[np.float64]:
        if len(cells) != self._width:
            raise SourceError(f"line {self._at}: {len(cells)} values of {self._width}")
        try:
            if any(b"_" in cell for cell in cells):  # which Python takes for a digit's neighbor
                raise ValueError(f"a value with _ in it, among {len(cells)}")
            return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError as error:
            raise SourceError(f"line {self._at}: {error}") from None

    def _changes(self, text: bytes) -> JsonObject:
        words = tuple(text.decode("utf-8", "replace").split())
        if not words or not all("=" in word for word in words):
            raise SourceError(f"line {self._at}: not '# set name=value ...'")
        pairs = (word.partition("=") for word in words)
        return {name: literal(value) for name, _, value in pairs}

    def _binary_rows(self) -> Iterator[Row]:
        assert self._width is not None
        size, row = 4 * self._width, 0
        while data := self._stream.read(size):
            if len(data) != size:
                raise SourceError(f"row {row} ends after {len(data)} of {size} bytes")
            yield np.frombuffer(data, "<f4").astype(np.float64)
            row += 1


def _are_coordinates(names: Sequence[str]) -> bool:
    """Return whether the names are coordinates; a joint may be named like one of our columns."""
    return bool(names) and all(name.rpartition(".")[2] in COORDINATES for name in names)


def skeleton_in(path: str) -> Skeleton:
    """The skeleton in a .bvh, .asf or .mcz file, without its source; raises as its reader does."""
    from dataclasses import replace

    import mcz

    lower = path.lower()
    if lower.endswith(".asf"):
        found = mcz.read_skeleton(path)
    elif lower.endswith(".mcz"):
        with mcz.open(path) as file:
            if not file.clips and len(file.skeletons) == 1:
                found = file.skeletons[0][1]
            else:
                found = file.only_clip(None).skeleton
    elif lower.endswith(".bvh"):
        found = mcz.read(path).skeleton
    else:
        raise OptionError("a skeleton is in a .bvh, .asf or .mcz file", path=path)
    return replace(found, source=None, base=None)
