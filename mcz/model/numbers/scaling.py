"""Scaling of a signal's stored numbers to its unit, and tokens that its grids do not print."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mcz.errors import MotionError
from mcz.model import text_format
from mcz.model.checks import DATA_ITEMS, Rule, array_of, check_fields
from mcz.model.types import Floats, Ints, Values

MAX_INTEGER = 2.0**53  # greatest integer up to which a binary64 holds all exactly


_FLOATS = array_of("f8", 1, "float64 of one dimension")
SCALING = {"offsets": _FLOATS, "scales": _FLOATS, "general": Rule("a number", float)}


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """``(number - offset) * scale * general``, in this order, in binary64.

    ``offsets`` and ``scales`` have shape (n_channels,). Offsets are in stored numbers; scale and
    general scale together are in units a stored number.
    """

    offsets: Floats
    scales: Floats
    general: float = 1.0

    def check(self, n_channels: int) -> None:
        """Raise MotionError unless this is a scaling of so many channels."""
        check_fields(self, SCALING)
        shapes = {self.offsets.shape, self.scales.shape}
        if shapes != {(n_channels,)}:
            raise MotionError(f"scaling: offsets and scales do not match {n_channels} channels")

    def equals(self, other: Scaling | None) -> bool:
        """Return True if both scale alike."""
        if other is None:
            return False
        pairs = (
            (self.offsets, other.offsets),
            (self.scales, other.scales),
            ([self.general], [other.general]),
        )
        return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)

    def values(self, stored: Values, channels: slice | list[int] = slice(None)) -> Floats:
        """Stored numbers, (n_rows, n_channels), in units; ``channels`` indexes the columns."""
        with np.errstate(over="ignore", invalid="ignore"):  # files may have any numbers
            moved = stored.astype(np.float64) - self.offsets[channels]
            scaled: Floats = moved * self.scales[channels] * self.general
        return scaled

    def stored(self, values: Values, numbers: Values) -> Values:
        """Stored numbers of ``values``: ``numbers``, replaced where a value differs.

        The replacement is the number of the value or, among integers, the nearest one; NaN or 0
        where no number has this value.
        """
        current = self.values(numbers)
        is_unchanged = (current == values) | (np.isnan(current) & np.isnan(values))
        if is_unchanged.all():
            return numbers
        with np.errstate(all="ignore"):
            new = np.asarray(values, np.float64) / (self.scales * self.general) + self.offsets
        if numbers.dtype == np.int64:
            new = np.clip(np.rint(np.nan_to_num(new)), -MAX_INTEGER, MAX_INTEGER)
        return np.where(is_unchanged, numbers, new.astype(numbers.dtype))


_NUMBERS = array_of("i8", 1, "int64 of one dimension")
EXCEPTIONS = {"rows": _NUMBERS, "channels": _NUMBERS, "texts": DATA_ITEMS}


@dataclass(frozen=True, slots=True, eq=False)
class Exceptions:
    """Tokens of a text source that their grid does not print, sorted by row, then channel."""

    rows: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    channels: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    texts: tuple[bytes, ...] = ()

    __repr__ = text_format.exceptions_text

    def __post_init__(self) -> None:
        check_fields(self, EXCEPTIONS)
        if not len(self.rows) == len(self.channels) == len(self.texts):
            raise MotionError("exceptions: rows, channels and texts differ in number")

    def __len__(self) -> int:
        return len(self.texts)

    def moved(self, columns: Ints) -> Exceptions:
        """The same with column ``columns[k]`` for channel k; channels with -1 are left out."""
        if not len(self):
            return self
        channels = columns[self.channels]
        order = np.lexsort((channels, self.rows))
        order = order[channels[order] >= 0]
        texts = tuple(self.texts[k] for k in order.tolist())
        return Exceptions(self.rows[order], channels[order], texts)
