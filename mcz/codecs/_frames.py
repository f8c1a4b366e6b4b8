"""A signal frame by frame, as the codecs of channels want it: unwrapped and without gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.angles import Unwrapper
from mcz.codecs._lossy import skeleton_of
from mcz.codecs.base import SignalSource
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


def fill_gaps(values: Floats, valid: NDArray[np.bool_], before: Floats) -> Floats:
    """``values`` (n_rows, n_channels) with what is not ``valid`` put on straight lines.

    A gap that reaches the end holds the last value; one at the start begins at ``before``.
    """
    out = values.copy()
    rows = np.arange(len(values))
    for column in np.flatnonzero(~valid.all(axis=0)):
        known = np.flatnonzero(valid[:, column])
        places, heights = [*known.tolist()], [*values[known, column].tolist()]
        if not np.isnan(before[column]):
            places, heights = [-1, *places], [float(before[column]), *heights]
        out[:, column] = np.interp(rows, places, heights) if places else 0.0
    return out
