"""Readers of a signal for lossy codecs: rotations unwrapped, gaps interpolated, groups selected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Layout, SignalSource
from mcz.codecs.segments import skeleton_of
from mcz.errors import MotionError
from mcz.kinematics.angles import Unwrapper
from mcz.model.motion import Joint, Skeleton
from mcz.model.numbers import Grid
from mcz.model.types import Bools, Floats, Ints


class FrameReader:
    """Reads a signal from its beginning; ``name``: the codec, for messages."""

    def __init__(self, name: str, source: SignalSource) -> None:
        self.name, self.source = name, source
        layout = source.layout
        self._unwrapper = Unwrapper(skeleton_of(name, layout))
        self._last = np.full(layout.n_channels, np.nan)  # the values before
        self.at = 0

    def next(self, stop: int) -> Floats:
        """Read the frames up to ``stop``, (frames, channels); raises MotionError for NaN."""
        start, self.at = self.at, stop
        values = np.asarray(self.source.values(start, stop), np.float64)
        valid = self.source.valid(start, stop)
        whole = values if valid is None else values[valid]
        if not np.isfinite(whole).all():
            raise MotionError(f"{self.name}: a value in frames {start}:{stop} is not finite")
        if valid is None:
            out = self._unwrapper(values)
        else:
            out = self._unwrapper(np.where(valid, values, np.nan))
            out = fill_gaps(out, valid, self._last)
        if len(out):
            self._last = out[-1].copy()
        return out


class SegmentReader:
    """Reads one segment after the other; a segment may be read again with an earlier end.

    Values are divided by ``scales`` (n_channels,).
    """

    def __init__(self, name: str, source: SignalSource, scales: Floats | None = None) -> None:
        self._reader, self._scales = FrameReader(name, source), scales
        self._ahead = np.zeros((0, source.layout.n_channels))  # from frame ``_first`` on
        self._first = 0

    def __call__(self, first: int, stop: int) -> Floats:
        """Read frames first <= f < stop, (frames, channels); earlier frames are dropped."""
        self._ahead = self._ahead[first - self._first :]
        self._first = first
        if stop > self._reader.at:
            new = self._reader.next(stop)
            new = new if self._scales is None else new / self._scales
            self._ahead = np.concatenate([self._ahead, new])
        return self._ahead[: stop - first]


class LiveRows:
    """Unwraps frames that arrive one by one; an invalid value repeats the last one.

    ``keep`` commits a row as the last one; a refused row changes no state.
    """

    def __init__(self, name: str, layout: Layout) -> None:
        self.name = name
        self._unwrapper = Unwrapper(skeleton_of(name, layout))
        self._last = np.full(layout.n_channels, np.nan)
        self._next = self._unwrapper, self._last

    def row(self, values: Floats, valid: Bools | None, at: int) -> Floats:
        """Unwrap frame ``at``, (1, n_channels); raises MotionError for a value not finite."""
        row = np.asarray(values, np.float64)[None]
        known = np.ones(row.shape, np.bool_) if valid is None else valid[None]
        if not np.isfinite(row[known]).all():
            raise MotionError(f"{self.name}: a value of frame {at} is not finite")
        unwrapper = copy(self._unwrapper)
        row = fill_gaps(unwrapper(np.where(known, row, np.nan)), known, self._last)
        self._next = unwrapper, row[0]
        return row

    def keep(self) -> None:
        """Commit the last row as encoded."""
        self._unwrapper, self._last = self._next


def fill_gaps(values: Floats, valid: Bools, before: Floats) -> Floats:
    """Interpolate ``values`` (n_rows, n_channels) linearly where they are not ``valid``.

    A gap that reaches the end holds the last value; one at the start begins at ``before``.
    """
    out = values.copy()
    rows = np.arange(len(values))
    for column in np.flatnonzero(~valid.all(axis=0)):
        known = np.flatnonzero(valid[:, column])
        known_rows, heights = [*known.tolist()], [*values[known, column].tolist()]
        if not np.isnan(before[column]):
            known_rows, heights = [-1, *known_rows], [float(before[column]), *heights]
        out[:, column] = np.interp(rows, known_rows, heights) if known_rows else 0.0
    return out


Item = TypeVar("Item", bound=np.generic)
Read = Callable[[int, int], NDArray[Item]]  # frames first <= f < stop


class SubsetSource:
    """A SignalSource of some groups of ``source``, numbered from 0, their channels side by side.

    The skeleton keeps only their channels. If ``n_frames`` exceeds the frames of ``source``, as in
    a clip that was cut, the last frame is repeated.
    """

    def __init__(self, source: SignalSource, groups: Sequence[int], n_frames: int) -> None:
        layout = source.layout
        self._source, self._n_read = source, layout.n_frames
        self._columns = [column for group in groups for column in layout.groups[group]]
        ends = accumulate((len(layout.groups[group]) for group in groups), initial=0)
        skeleton = layout.skeleton
        self.layout = replace(
            layout,
            n_frames=n_frames,
            groups=tuple(tuple(range(start, stop)) for start, stop in pairwise(ends)),
            skeleton=None if skeleton is None else _cut(skeleton, set(self._columns)),
            grids=tuple(layout.grids[column] for column in self._columns),
        )
        self.breaks = source.breaks

    def ordinals(self, start: int, stop: int) -> Ints:
        return self._read_columns(self._source.ordinals, start, stop)

    def grids(self, frame: int) -> tuple[Grid, ...]:
        grids = self._source.grids(frame)
        return tuple(grids[column] for column in self._columns)

    def values(self, start: int, stop: int) -> Floats:
        return self._read_columns(self._source.values, start, stop)

    def valid(self, start: int, stop: int) -> Bools | None:
        if self._source.valid(0, 0) is None:
            return None
        return self._read_columns(cast("Read[np.bool_]", self._source.valid), start, stop)

    def _read_columns(self, read: Read[Item], start: int, stop: int) -> NDArray[Item]:
        """Read these columns; past the end, repeat the last frame."""
        end = self._n_read
        rows = read(min(start, end), min(stop, end))[:, self._columns]
        missing = stop - max(start, end)
        if missing <= 0:
            return rows
        last = read(end - 1, end)[:, self._columns]
        return np.concatenate([rows, *([last] * missing)])


def _cut(skeleton: Skeleton, columns: set[int]) -> Skeleton:
    """Return ``skeleton`` with only these channels."""

    def keep_channels(index: int, joint: Joint) -> Joint:
        pairs = zip(skeleton.columns(index), joint.channels, strict=True)
        return replace(joint, channels=tuple(c for column, c in pairs if column in columns))

    return replace(
        skeleton, joints=tuple(keep_channels(i, joint) for i, joint in enumerate(skeleton.joints))
    )
