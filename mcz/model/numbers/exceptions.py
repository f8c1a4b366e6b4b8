"""Tokens of a text source that no number grid prints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.model import text_format
from mcz.model.checks import DATA_ITEMS, array_of, check_fields

_NUMBERS = array_of("i8", 1, "int64 of one dimension")
EXCEPTIONS = {"rows": _NUMBERS, "channels": _NUMBERS, "texts": DATA_ITEMS}


@dataclass(frozen=True, slots=True, eq=False)
class Exceptions:
    """Tokens of a text source that their grid does not print, sorted by row, then channel."""

    rows: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    channels: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    texts: tuple[bytes, ...] = ()

    __repr__ = text_format.exceptions_text

    def __post_init__(self) -> None:
        check_fields(self, EXCEPTIONS)
        if not len(self.rows) == len(self.channels) == len(self.texts):
            raise MotionError("exceptions: rows, channels and texts differ in number")

    def __len__(self) -> int:
        return len(self.texts)

    def moved(self, columns: NDArray[np.int64]) -> Exceptions:
        """The same where channel k has become ``columns[k]``; those of -1 are left out."""
        if not len(self):
            return self
        channels = columns[self.channels]
        order = np.lexsort((channels, self.rows))
        order = order[channels[order] >= 0]
        texts = tuple(self.texts[k] for k in order.tolist())
        return Exceptions(self.rows[order], channels[order], texts)
