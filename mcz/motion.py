"""The data model: Signal, Source and Motion, and what they are of, checked on creation.

Nothing here reads or writes files. SPEC.md, "CLIP", has the stored form.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz import brief
from mcz.clock import (
    START,
    Counting,
    Timeline,
    column_of,
    has_times,
    known_timeline,
    numbered,
    numbers_or_rows,
    time_signal,
    timeline_of,
)
from mcz.displays import html_of
from mcz.errors import MotionError, OutOfRangeError
from mcz.indexing import row_numbers
from mcz.numbers import Grid, GridKind, ordinals_of
from mcz.numbers.blocks import grid_blocks as grid_blocks
from mcz.numbers.exceptions import Exceptions as Exceptions
from mcz.numbers.scaling import Scaling
from mcz.skeleton import ANGLE_KINDS as ANGLE_KINDS
from mcz.skeleton import CHANNEL_KINDS as CHANNEL_KINDS
from mcz.skeleton import ORIGIN as ORIGIN
from mcz.skeleton import POSITION_KINDS as POSITION_KINDS
from mcz.skeleton import QUATERNION_KINDS as QUATERNION_KINDS
from mcz.skeleton import ROTATION_KINDS as ROTATION_KINDS
from mcz.skeleton import TURNING_KINDS as TURNING_KINDS
from mcz.skeleton import VECTOR_KINDS as VECTOR_KINDS
from mcz.skeleton import Channel as Channel
from mcz.skeleton import Joint as Joint
from mcz.skeleton import Skeleton as Skeleton
from mcz.skeleton import Vector as Vector
from mcz.skeleton import joint_columns as joint_columns
from mcz.source import FrameNotes as FrameNotes
from mcz.source import Source as Source


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """Values of some channels over time.

    ``values`` has shape (n_frames * samples_per_frame, n_channels): binary64 in source units, or
    int64 where every grid is INTEGER. ``grids`` has one grid a channel; ``grid_changes`` lists
    (row, channel, grid) from that row on. ``mask`` (bool, same shape) is True where the value is
    valid; None means valid everywhere. Stored coordinates are kept beneath an invalid mark.

    Where the file stores other numbers than it means (words of a converter), ``scaling`` says what
    they mean, ``values`` are binary64 in units, and ``stored`` are the numbers of the file, which
    grids, grid changes, exceptions and ordinals speak of. Elsewhere ``stored`` are the values.
    """

    values: NDArray[Any]
    grids: tuple[Grid, ...] = ()
    name: str = "motion"
    samples_per_frame: int = 1
    mask: NDArray[np.bool_] | None = None
    exceptions: Exceptions = field(default_factory=Exceptions)
    grid_changes: tuple[tuple[int, int, Grid], ...] = ()
    channels: tuple[Channel, ...] | None = None  # None: those of the skeleton
    ordinals: NDArray[np.int64] | None = None  # on their grids; see ``to_ordinals``
    scaling: Scaling | None = None
    stored: NDArray[Any] = None  # type: ignore[assignment]  # set below where it is not given

    __repr__ = brief.signal_text

    def __post_init__(self) -> None:
        if self.values.ndim != 2:
            raise MotionError(f"signal {self.name!r}: values of shape {self.values.shape}, not 2-D")
        if self.scaling is None or self.stored is None:
            object.__setattr__(self, "stored", self.values)
        if self.stored.shape != self.values.shape:
            raise MotionError(f"signal {self.name!r}: stored numbers do not match the values")
        if self.values.dtype not in (np.float64, np.int64):
            raise MotionError(f"signal {self.name!r}: values of type {self.values.dtype}")
        if not self.grids:
            kind = GridKind.BINARY64 if self.stored.dtype == np.float64 else GridKind.INTEGER
            object.__setattr__(self, "grids", (Grid(kind),) * self.n_channels)
        if len(self.grids) != self.n_channels:
            raise MotionError(
                f"signal {self.name!r}: {len(self.grids)} grids, {self.n_channels} channels"
            )
        integers = self.n_channels > 0 and all(g.kind == GridKind.INTEGER for g in self.grids)
        if integers != (self.stored.dtype == np.int64):
            raise MotionError(
                f"signal {self.name!r}: {self.stored.dtype} values on {self.grids[:1]}"
            )
        if self.samples_per_frame < 1 or len(self.values) % self.samples_per_frame:
            raise MotionError(
                f"signal {self.name!r}: {len(self.values)} rows at {self.samples_per_frame} a frame"
            )
        self._check_order()
        if self.ordinals is not None and self.ordinals.shape != self.values.shape:
            raise MotionError(f"signal {self.name!r}: ordinals do not match the values")
        if self.mask is not None and (
            self.mask.shape != self.values.shape or self.mask.dtype != np.bool_
        ):
            raise MotionError(f"signal {self.name!r}: mask does not match the values")

    def _check_order(self) -> None:
        """Exceptions and grid changes lie in the signal, exceptions in order."""
        rows, channels = self.exceptions.rows, self.exceptions.channels
        cells = rows * max(1, self.n_channels) + channels
        inside = (rows >= 0) & (rows < self.n_rows) & (channels >= 0) & (channels < self.n_channels)
        if not inside.all() or (np.diff(cells) <= 0).any():
            raise MotionError(f"signal {self.name!r}: exceptions outside of it or out of order")
        for row, channel, _ in self.grid_changes:
            whole = row >= 0 and row % self.samples_per_frame == 0
            if not (whole and 0 <= channel < self.n_channels):
                raise MotionError(f"signal {self.name!r}: grid change at {row}, {channel}")

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
        """Frames start <= f < stop alone, with the grids that are in force there."""
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
        """These columns alone, in the order given, each once, with their grids and their masks."""
        chosen = np.array(columns, np.int64)
        at = np.full(self.n_channels, -1, np.int64)
        at[chosen] = np.arange(len(chosen))
        given = self.channels
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
            exceptions=self.exceptions.moved(at),
            grid_changes=tuple(
                (row, int(at[column]), grid)
                for row, column, grid in self.grid_changes
                if at[column] >= 0
            ),
            channels=None if given is None else tuple(given[column] for column in chosen),
            ordinals=None if self.ordinals is None else self.ordinals[:, chosen],
            scaling=scaling,
            stored=np.ascontiguousarray(self.stored[:, chosen]),
        )

    def in_units(self, scaling: Scaling | None) -> Signal:
        """The same with ``values`` that mean what ``scaling`` says of the stored numbers."""
        if scaling is None:
            return self
        values = scaling.values(self.stored)
        return replace(self, values=values, stored=self.stored, scaling=scaling)

    def as_stored(self) -> Signal:
        """The same with the stored numbers as its values: what codecs and formats want."""
        if self.scaling is None:
            return self
        stored = self.scaling.stored(self.values, self.stored)
        return replace(self, values=stored, stored=stored, scaling=None)

    def to_ordinals(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The ordinal of every value, and whether it gives exactly this value back.

        A binary grid has many NaNs, of which ``values`` shows only that they are NaN: where
        ``ordinals`` are given and still mean the value that is there, they are taken.
        """
        if self.scaling is not None:
            return self.as_stored().to_ordinals()
        if self.ordinals is None and not self.grid_changes:
            return ordinals_of(self.values, self.grids)
        ordinals = np.empty(self.values.shape, np.int64)
        exact = np.empty(self.values.shape, np.bool_)
        for rows, columns, grid in self.grid_blocks():
            block = np.ascontiguousarray(self.values[rows][:, columns])
            found, on_grid = grid.ordinals(block)
            if self.ordinals is not None:
                given = np.ascontiguousarray(self.ordinals[rows][:, columns])
                meant = grid.values(given)
                same = (meant.view(np.int64) == block.view(np.int64)) | (
                    np.isnan(meant) & np.isnan(block)
                )
                found, on_grid = np.where(same, given, found), on_grid | same
            ordinals[rows, columns], exact[rows, columns] = found, on_grid
        return ordinals, exact

    def masked(self) -> NDArray[np.float64]:
        """The values with NaN where the mask says invalid."""
        if self.mask is None:
            return self.values
        return np.where(self.mask, self.values, np.nan)


def frame_rate_of(rate: Any, name: str) -> Fraction:
    """A frame rate as a Fraction, the nearest one to a number of another kind; MotionError."""
    with suppress(TypeError, ValueError, OverflowError):  # no number, NaN, infinite
        exact = isinstance(rate, Fraction)
        value: Fraction = rate if exact else Fraction(float(rate)).limit_denominator(2**52)
        if value > 0:
            return value
    raise MotionError(f"motion {name!r}: frame rate {rate!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A skeleton in motion: the motion signal first, then any others (analog, ...).

    ``frame_rate`` in frames a second, None while unknown; ``frame_rate_exact`` is False where the
    source gave a rounded frame time. ``frame_numbers`` (int64) is None for 1, 2, 3, ...; they count
    ``number_step`` from a frame to the next, more than 1 where frames were left out evenly.
    ``metadata`` maps keys of SPEC.md's registry, or private ``x-`` keys, to text. All of them, a
    signal of times and the source say when each frame was: ``times``.
    """

    skeleton: Skeleton
    signals: tuple[Signal, ...]
    frame_rate: Fraction | None = None
    frame_rate_exact: bool = True
    name: str = "motion"
    metadata: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None
    frame_numbers: NDArray[np.int64] | None = None
    number_step: int = 1

    __repr__ = brief.motion_text
    _repr_html_ = html_of

    def __post_init__(self) -> None:
        if not self.signals:
            raise MotionError(f"motion {self.name!r} has no signal")
        if self.signals[0].channels is None and (
            self.signals[0].n_channels != self.skeleton.n_channels
        ):
            raise MotionError(
                f"motion {self.name!r}: {self.signals[0].n_channels} columns, "
                f"but the skeleton has {self.skeleton.n_channels} channels"
            )
        counts = {signal.n_frames for signal in self.signals}
        if len(counts) > 1:
            raise MotionError(f"motion {self.name!r}: signals of {sorted(counts)} frames")
        if self.frame_rate is not None:
            object.__setattr__(self, "frame_rate", frame_rate_of(self.frame_rate, self.name))
        if self.frame_numbers is not None and len(self.frame_numbers) != self.n_frames:
            raise MotionError(f"motion {self.name!r}: {len(self.frame_numbers)} frame numbers")

    @property
    def values(self) -> NDArray[np.float64]:
        """The motion signal, (n_frames, n_channels), NaN where invalid."""
        return self.signals[0].masked()

    @property
    def n_frames(self) -> int:
        return self.signals[0].n_frames

    @property
    def shape(self) -> tuple[int, int]:
        """(n_frames, n_channels) of the motion signal."""
        return self.n_frames, self.signals[0].n_channels

    def __len__(self) -> int:
        """The number of frames."""
        return self.n_frames

    def __bool__(self) -> bool:
        """True: a motion without frames is a motion, too."""
        return True

    __iter__ = None  # no sequence: a part of it is a motion

    def __getitem__(self, frames: slice) -> Motion:
        """``motion[10:20]``: frames 10 to 19 of all signals, with their numbers, as a Motion.

        Its source, if any, then describes no file. Raises OutOfRangeError for all but a slice of
        step 1.
        """
        if not isinstance(frames, slice):
            raise OutOfRangeError(f"a motion is cut by a slice such as [10:20], not by {frames!r}")
        chosen = row_numbers(frames, self.n_frames, "frame")
        if not isinstance(chosen, range) or chosen.step != 1:
            raise OutOfRangeError(f"{frames} has a step; mcz.resample gives other frame rates")
        return self.cut(chosen.start, max(chosen.start, chosen.stop))

    def cut(self, start: int, stop: int) -> Motion:
        """Frames start <= f < stop alone, with their numbers and times."""
        if (start, stop) == (0, self.n_frames):
            return self
        numbers = self.frame_numbers
        if numbers is None and start:
            numbers = np.arange(1, self.n_frames + 1, dtype=np.int64)
        made = replace(
            self,
            signals=tuple(signal.cut(start, stop) for signal in self.signals),
            frame_numbers=None if numbers is None else numbers[start:stop],
            source=self.source and self.source.cut(start, stop),
        )
        if START not in self.metadata:
            return made
        return made.at_times(self.timeline and self.timeline.cut(slice(start, stop)))

    def with_values(self, values: NDArray[np.float64]) -> Motion:
        """The same motion with other values of its motion signal, same shape."""
        signal = replace(self.signals[0], values=np.asarray(values, dtype=np.float64))
        source = self.source and self.source.of_no_file()
        return replace(self, signals=(signal, *self.signals[1:]), source=source)

    @property
    def timeline(self) -> Timeline | None:
        """When every frame was, None where neither times nor a rate are known."""
        column = None
        index = time_signal(self.signals)
        first = self.signals[0]
        if first.channels is None and has_times(self.skeleton) and first.samples_per_frame == 1:
            index = 0
        if index is not None:
            signal = self.signals[index]
            channels = self.skeleton.channels if index == 0 else signal.channels or ()
            column = column_of(signal.masked()[:, 0], signal.grids[0], channels[0].unit)
        numbers = numbers_or_rows(self.frame_numbers, self.n_frames)
        clock = self.source.clock if self.source is not None else None
        counting = Counting(numbers, self.frame_rate, self.number_step)
        return timeline_of(counting, self.metadata, clock, column)

    @property
    def times(self) -> NDArray[np.float64]:
        """The time of every frame in seconds, (n_frames,): see ``mcz.times``; OptionError."""
        return known_timeline(self.name, self.timeline).times

    def without_source(self) -> Motion:
        """The same motion without its source, at the same times."""
        return replace(self, source=None).at_times(self.timeline)

    def counted_by_ones(self) -> Motion:
        """The same motion at the same times with a ``number_step`` of 1, as files have it.

        Where its source prints the frame numbers, they are kept, and it gets a signal ``time``.
        """
        if self.number_step == 1:
            return self
        motion, timeline = replace(self, number_step=1), self.timeline
        if self.source is None or timeline is None:
            return motion.at_times(timeline)
        return motion._with_time_signal(timeline)

    def at_times(self, timeline: Timeline | None) -> Motion:
        """This motion at these times, which its source does not tell; None: at unknown ones.

        Frame numbers are kept where they give such times; else they are others, or the motion gets
        a signal ``time``.
        """
        metadata = {key: text for key, text in self.metadata.items() if key != START}
        motion = replace(self, metadata=metadata)
        own = motion.timeline
        if timeline is None or not self.n_frames or (own and own.is_near(timeline)):
            return motion
        numbers = numbers_or_rows(self.frame_numbers, self.n_frames)
        found = numbered(timeline, numbers)
        if found is not None:
            metadata |= {START: found.start} if found.start else {}
            return replace(motion, frame_numbers=found.numbers, metadata=metadata, number_step=1)
        return motion._with_time_signal(timeline)

    def _with_time_signal(self, timeline: Timeline) -> Motion:
        channels = (Channel("", "time", "s"),)
        signal = Signal(timeline.times[:, None].copy(), name="time", channels=channels)
        return replace(self, signals=(*self.signals, signal))
