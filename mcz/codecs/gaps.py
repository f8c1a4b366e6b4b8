"""A signal frame by frame, as the codecs of channels want it: unwrapped and without gaps."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from mcz.angles import Unwrapper
from mcz.codecs.contract import Layout, SignalSource
from mcz.codecs.segments import skeleton_of
from mcz.errors import MotionError

Floats = NDArray[np.float64]


class FrameReader:
    """Reads a signal from its beginning on; ``name`` is the codec's, for messages."""

    def __init__(self, name: str, source: SignalSource) -> None:
        self.name, self.source = name, source
        layout = source.layout
        self._unwrapper = Unwrapper(skeleton_of(name, layout))
        self._last = np.full(layout.n_channels, np.nan)  # the values before
        self.at = 0

    def next(self, stop: int) -> Floats:
        """The frames up to ``stop``, (frames, channels); raises MotionError where one is NaN."""
        start, self.at = self.at, stop
        values = np.asarray(self.source.values(start, stop), np.float64)
        valid = self.source.valid(start, stop)
        whole = values if valid is None else values[valid]
        if not np.isfinite(whole).all():
            raise MotionError(f"{self.name}: frames {start}:{stop} hold a value that is not finite")
        if valid is None:
            out = self._unwrapper(values)
        else:
            out = self._unwrapper(np.where(valid, values, np.nan))
            out = fill_gaps(out, valid, self._last)
        if len(out):
            self._last = out[-1].copy()
        return out


class SegmentReader:
    """Reads the frames of one segment after the other, which may end sooner than was asked before.

    ``scales`` (n_channels,) divide them.
    """

    def __init__(self, name: str, source: SignalSource, scales: Floats | None = None) -> None:
        self._reader, self._scales = FrameReader(name, source), scales
        self._ahead = np.zeros((0, source.layout.n_channels))  # from frame ``_first`` on
        self._first = 0

    def __call__(self, first: int, stop: int) -> Floats:
        """Frames first <= f < stop, (frames, channels); nobody asks for earlier ones again."""
        self._ahead = self._ahead[first - self._first :]
        self._first = first
        if stop > self._reader.at:
            new = self._reader.next(stop)
            new = new if self._scales is None else new / self._scales
            self._ahead = np.concatenate([self._ahead, new])
        return self._ahead[: stop - first]


class LiveRows:
    """Frames that come one by one, as ``FrameReader`` gives them, but that a gap holds the last.

    A row counts as the last, for gaps and turns, once it is ``kept``: one that is refused leaves no
    trace.
    """

    def __init__(self, name: str, layout: Layout) -> None:
        self.name = name
        self._unwrapper = Unwrapper(skeleton_of(name, layout))
        self._last = np.full(layout.n_channels, np.nan)
        self._next = self._unwrapper, self._last

    def row(self, values: Floats, valid: NDArray[np.bool_] | None, at: int) -> Floats:
        """Frame ``at``, (1, n_channels); raises MotionError where a valid value is not finite."""
        row = np.asarray(values, np.float64)[None]
        known = np.ones(row.shape, np.bool_) if valid is None else valid[None]
        if not np.isfinite(row[known]).all():
            raise MotionError(f"{self.name}: frame {at} holds a value that is not finite")
        unwrapper = copy(self._unwrapper)
        row = fill_gaps(unwrapper(np.where(known, row, np.nan)), known, self._last)
        self._next = unwrapper, row[0]
        return row

    def keep(self) -> None:
        """The row that was given last was coded."""
        self._unwrapper, self._last = self._next


def fill_gaps(values: Floats, valid: NDArray[np.bool_], before: Floats) -> Floats:
    """``values`` (n_rows, n_channels) with what is not ``valid`` put on straight lines.

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
