"""A signal: values of some channels over time, their grids, marks, exceptions and scaling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Protocol

import numpy as np

from mcz.errors import MotionError
from mcz.model import text_format
from mcz.model.checks import (
    DATA_ITEMS,
    INTEGER,
    NAME,
    Rule,
    array_of,
    check_fields,
    of_type,
    one_of,
    optional,
    several,
)
from mcz.model.numbers import Grid, GridKind, ordinals_of
from mcz.model.numbers.grid import grid_blocks
from mcz.model.skeleton import CHANNELS, Channel
from mcz.model.types import Bools, Floats, Ints, Values

MAX_INTEGER = 2.0**53  # binary64 holds all integers up to this exactly


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
        """Stored numbers of ``values``: ``numbers``, replaced if a value differs.

        The replacement is the number of the value or, among integers, the nearest one; NaN or 0
        if no number has this value.
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
        """A copy with column ``columns[k]`` for channel k, without channels with -1."""
        if not len(self):
            return self
        channels = columns[self.channels]
        order = np.lexsort((channels, self.rows))
        order = order[channels[order] >= 0]
        texts = tuple(self.texts[k] for k in order.tolist())
        return Exceptions(self.rows[order], channels[order], texts)


ROLES = (
    "",
    "motion",
    "times",
    "residuals",
    "analog",
    "outputs",
    "rotations",
    "confidence",
)  # by id


class Sampled(Protocol):
    """The facts of a signal, in memory or in a file, that decide whether its rows are poses."""

    @property
    def channels(self) -> tuple[Channel, ...] | None: ...
    @property
    def samples_per_frame(self) -> int: ...
    @property
    def has_poses(self) -> bool: ...


def check_poses(name: str, signal: Sampled) -> None:
    """Raise MotionError if the rows of the first signal of ``name`` are not poses of frames."""
    if not signal.has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=name
        )
    if signal.samples_per_frame != 1:
        raise MotionError(
            f"one pose a frame is needed, but the signal has {signal.samples_per_frame} "
            "samples a frame",
            clip=name,
        )


def _grid_change(value: Any) -> tuple[int, int, Grid]:
    row, channel, grid = value
    return INTEGER.form(row), INTEGER.form(channel), GRID.form(grid)


GRID = of_type(Grid, "a Grid")
MASK = array_of("b1", 2, "a bool for each value")
VALUES = array_of("f8 i8", 2, "float64 or int64 of two dimensions (2-D)")
SIGNAL = {
    "name": NAME,
    "values": VALUES,
    "grids": several(GRID, "Grids"),
    "samples_per_frame": INTEGER,
    "mask": optional(MASK),
    "exceptions": of_type(Exceptions, "Exceptions"),
    "grid_changes": several(Rule("", _grid_change), "rows, channels and Grids"),
    "channels": optional(CHANNELS),
    "ordinals": optional(array_of("i8", 2, "int64 of two dimensions")),
    "scaling": optional(of_type(Scaling, "a Scaling")),
    "stored": optional(VALUES),
    "role": optional(one_of(ROLES)),
    "of": optional(INTEGER),
}


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """Values of some channels over time.

    ``values`` has shape (n_frames * samples_per_frame, n_channels): binary64 in source units, or
    int64 if every grid is INTEGER. ``grids`` has one grid a channel; ``grid_changes`` lists
    (row, channel, grid) from that row on. ``mask`` (bool, same shape) is True if the value is
    valid; None means valid everywhere. Stored coordinates of invalid values are kept.

    If the file stores words of a converter, ``scaling`` converts them: ``values`` are binary64
    in units, and ``stored`` are the numbers of the file; grids, grid changes, exceptions and
    ordinals refer to these. Elsewhere ``stored`` are the values.

    ``role`` is one of ``ROLES``, names of the registry in the order of their ids; None until the
    signal is in a Motion, whose first signal then is its "motion" and any other has none, "".
    ``of`` is the index of the signal whose "residuals" these are.
    """

    values: Values
    grids: tuple[Grid, ...] = ()
    name: str = "motion"
    samples_per_frame: int = 1
    mask: Bools | None = None
    exceptions: Exceptions = field(default_factory=Exceptions)
    grid_changes: tuple[tuple[int, int, Grid], ...] = ()
    channels: tuple[Channel, ...] | None = None  # None: those of the skeleton
    ordinals: Ints | None = None  # on their grids; see ``to_ordinals``
    scaling: Scaling | None = None
    stored: Values = None  # type: ignore[assignment]  # set below if not given
    role: str | None = None
    of: int | None = None

    __repr__ = text_format.signal_text

    def __post_init__(self) -> None:
        if type(self.values) is not np.ndarray and isinstance(self.values, np.ma.MaskedArray):
            self._take_mask(self.values)
        check_fields(self, SIGNAL)
        if self.scaling is None or self.stored is None:
            object.__setattr__(self, "stored", self.values)
        if self.stored.shape != self.values.shape:
            raise MotionError(f"signal {self.name!r}: stored numbers do not match the values")
        if not self.grids:
            kind = GridKind.BINARY64 if self.stored.dtype == np.float64 else GridKind.INTEGER
            object.__setattr__(self, "grids", (Grid(kind),) * self.n_channels)
        if len(self.grids) != self.n_channels:
            raise MotionError(
                f"signal {self.name!r}: {len(self.grids)} grids do not match "
                f"{self.n_channels} channels"
            )
        integers = self.n_channels > 0 and all(g.kind == GridKind.INTEGER for g in self.grids)
        if integers != (self.stored.dtype == np.int64):
            raise MotionError(
                f"signal {self.name!r}: {self.stored.dtype} values do not fit grid {self.grids[:1]}"
            )
        if self.samples_per_frame < 1 or len(self.values) % self.samples_per_frame:
            raise MotionError(
                f"signal {self.name!r}: {len(self.values)} rows are not a multiple of "
                f"{self.samples_per_frame} a frame"
            )
        self._check_order()
        for name, array in (("ordinals", self.ordinals), ("mask", self.mask)):
            if array is not None and array.shape != self.values.shape:
                raise MotionError(f"signal {self.name!r}: {name} does not match the values")
        if self.channels is not None and len(self.channels) != self.n_channels:
            raise MotionError(
                f"signal {self.name!r}: {len(self.channels)} channels, but {self.n_channels} "
                "columns"
            )
        if self.scaling is not None:
            self.scaling.check(self.n_channels)

    def _take_mask(self, values: np.ma.MaskedArray[Any, Any]) -> None:
        """Mark masked numbers of a masked array as invalid; the numbers are kept."""
        valid = ~np.ma.getmaskarray(values)
        object.__setattr__(self, "values", values.data)
        if self.mask is not None:
            valid = valid & MASK.form(self.mask)
        object.__setattr__(self, "mask", valid)

    def _check_order(self) -> None:
        """Check that exceptions and grid changes lie in the signal, exceptions in order."""
        rows, channels = self.exceptions.rows, self.exceptions.channels
        cells = rows * max(1, self.n_channels) + channels
        is_within = (
            (rows >= 0) & (rows < self.n_rows) & (channels >= 0) & (channels < self.n_channels)
        )
        if not is_within.all() or (np.diff(cells) <= 0).any():
            raise MotionError(f"signal {self.name!r}: exceptions are out of range or out of order")
        for row, channel, grid in self.grid_changes:
            whole = row >= 0 and row % self.samples_per_frame == 0
            if not (whole and 0 <= channel < self.n_channels):
                raise MotionError(
                    f"signal {self.name!r}: the grid change at row {row}, channel {channel} "
                    "is out of range or out of order"
                )
            if (grid.kind == GridKind.INTEGER) != (self.stored.dtype == np.int64):
                raise MotionError(
                    f"signal {self.name!r}: {self.stored.dtype} values do not fit grid {grid}"
                )
        changes = sorted(self.grid_changes, key=itemgetter(0))
        if len(rows) and not all(g.is_text for g in (*self.grids, *(c[2] for c in changes))):
            is_text = np.array([grid.is_text for grid in self.grids])[channels]
            for row, channel, grid in changes:
                is_text[(channels == channel) & (rows >= row)] = grid.is_text
            if not is_text.all():
                raise MotionError(f"signal {self.name!r}: exceptions need a text grid")

    @property
    def has_poses(self) -> bool:
        """True of a motion with the channels of its skeleton."""
        return self.role == "motion" and self.channels is None

    @property
    def n_rows(self) -> int:
        return int(self.values.shape[0])

    @property
    def n_channels(self) -> int:
        return int(self.values.shape[1])

    @property
    def n_frames(self) -> int:
        return self.n_rows // self.samples_per_frame

    def grid_blocks(self) -> Iterator[tuple[slice, list[int], Grid]]:
        """Blocks (rows, columns, grid) that cover the signal, each of one grid."""
        return grid_blocks(self.n_rows, self.grids, self.grid_changes)

    def cut(self, start: int, stop: int) -> Signal:
        """Keep frames start <= f < stop, with the grids in force there."""
        first, last = start * self.samples_per_frame, stop * self.samples_per_frame
        grids, changes = list(self.grids), []
        for row, channel, grid in sorted(self.grid_changes, key=itemgetter(0)):
            if row <= first:
                grids[channel] = grid
            elif row < last:
                changes.append((row - first, channel, grid))
        low, high = np.searchsorted(self.exceptions.rows, (first, last)).tolist()
        return replace(
            self,
            values=self.values[first:last],
            grids=tuple(grids),
            mask=None if self.mask is None else self.mask[first:last],
            exceptions=Exceptions(
                self.exceptions.rows[low:high] - first,
                self.exceptions.channels[low:high],
                self.exceptions.texts[low:high],
            ),
            grid_changes=tuple(changes),
            ordinals=None if self.ordinals is None else self.ordinals[first:last],
            stored=self.stored[first:last],
        )

    def of_columns(self, columns: Sequence[int]) -> Signal:
        """Keep these columns, in the order given, each once, with their grids and masks."""
        chosen = np.array(columns, np.int64)
        new_columns = np.full(self.n_channels, -1, np.int64)
        new_columns[chosen] = np.arange(len(chosen))
        channels = self.channels
        scaling = self.scaling
        if scaling is not None:
            scaling = replace(
                scaling, offsets=scaling.offsets[chosen], scales=scaling.scales[chosen]
            )
        return replace(
            self,
            values=np.ascontiguousarray(self.values[:, chosen]),
            grids=tuple(self.grids[column] for column in chosen),
            mask=None if self.mask is None else np.ascontiguousarray(self.mask[:, chosen]),
            exceptions=self.exceptions.moved(new_columns),
            grid_changes=tuple(
                (row, int(new_columns[column]), grid)
                for row, column, grid in self.grid_changes
                if new_columns[column] >= 0
            ),
            channels=None if channels is None else tuple(channels[column] for column in chosen),
            ordinals=None if self.ordinals is None else self.ordinals[:, chosen],
            scaling=scaling,
            stored=np.ascontiguousarray(self.stored[:, chosen]),
        )

    def in_units(self, scaling: Scaling | None) -> Signal:
        """A copy with ``values`` in units, scaled from the stored numbers."""
        if scaling is None:
            return self
        values = scaling.values(self.stored)
        return replace(self, values=values, stored=self.stored, scaling=scaling)

    def as_stored(self) -> Signal:
        """A copy with the stored numbers as its values, for codecs and formats."""
        if self.scaling is None:
            return self
        stored = self.scaling.stored(self.values, self.stored)
        return replace(self, values=stored, stored=stored, scaling=None)

    def to_ordinals(self) -> tuple[Ints, Bools]:
        """The ordinal of every value, and whether it restores exactly this value.

        A binary grid has many NaNs, which ``values`` does not distinguish: given ``ordinals`` are
        used if they still have the present value.
        """
        if self.scaling is not None:
            return self.as_stored().to_ordinals()
        if self.ordinals is None and not self.grid_changes:
            return ordinals_of(self.values, self.grids)
        ordinals = np.empty(self.values.shape, np.int64)
        exact = np.empty(self.values.shape, np.bool_)
        for rows, columns, grid in self.grid_blocks():
            block = np.ascontiguousarray(self.values[rows][:, columns])
            coded, on_grid = grid.ordinals(block)
            if self.ordinals is not None:
                stored = np.ascontiguousarray(self.ordinals[rows][:, columns])
                meaning = grid.values(stored)
                equal = (meaning.view(np.int64) == block.view(np.int64)) | (
                    np.isnan(meaning) & np.isnan(block)
                )
                coded, on_grid = (np.where(equal, stored, coded), on_grid | equal)
            ordinals[rows, columns], exact[rows, columns] = coded, on_grid
        return ordinals, exact

    def masked(self) -> Values:
        """The values, NaN if the mask is False."""
        if self.mask is None:
            return self.values
        return np.where(self.mask, self.values, np.nan)
