"""Readers of a signal for lossy codecs: rotations unwrapped, gaps interpolated."""

from __future__ import annotations

from copy import copy

import numpy as np

from mcz.codecs.contract import Layout, SignalSource
from mcz.codecs.segments import skeleton_of
from mcz.errors import MotionError
from mcz.kinematics.angles import Unwrapper
from mcz.model.types import Bools, Floats


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
