"""Motion whose text comes line by line: what its header says, and its frames as they come.

No line is read before the frame that the lines before it made is used. What a number, a hierarchy
or a bone is, the modules of the formats say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.motion import Skeleton
from mcz.model.numbers import values_of_texts

Floats = NDArray[np.float64]
Frame = tuple[int | None, Floats]  # its number, None where the text has none, and (n_channels,)


@dataclass(frozen=True, slots=True)
class Arriving:
    """The header of a motion, read up to its first frame, and all of its frames in order.

    Values are NaN where the text has none. ``declared`` is how many frames the header says there
    are, None where it says nothing that is a number. ``frames`` raises SourceError, with the number
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
            raise self.error(f"{texts[int(np.argmax(bad))][:40]!r} is not a number")
        return values
