"""The signal as the wavelet codecs transform it: unwrapped, without gaps, a window at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.angles import Unwrapper
from mcz.codecs.base import SignalSource
from mcz.errors import MotionError
from mcz.transforms import dwt
from mcz.transforms.wavelets import Wavelet

Floats = NDArray[np.float64]


class Frames:
    """The signal as it is transformed, unwrapped and without gaps, a window at a time."""

    def __init__(self, name: str, source: SignalSource, wavelet: Wavelet, levels: int) -> None:
        self.name, self.source, self.wavelet, self.levels = name, source, wavelet, levels
        layout = source.layout
        assert layout.skeleton is not None
        self.unwrapper = Unwrapper(layout.skeleton)
        self.history = np.zeros((0, layout.n_channels))  # frames before the segment
        self.block = np.zeros((0, layout.n_channels))  # from the segment's first frame on
        self.read = 0  # frames that were read and unwrapped so far
        self.lengths = wavelet.lengths(layout.n_frames, levels)

    def coefficients(self, first: int, stop: int) -> list[Floats]:
        """The bands of the segment first <= frame < stop, the coarsest first."""
        unit, mirrored = 1 << self.levels, self.wavelet.mirrored(self.levels)
        end = min(max(stop, -(-mirrored // unit) * unit), self.lengths[0])
        if end > self.read:
            self.block = np.concatenate([self.block, self._next(self.read, end)])
            self.read = end
        window = np.concatenate([self.history, self.block[: end - first]])
        at = first - len(self.history)
        return dwt.analyze(window, at, first, stop, self.lengths, self.wavelet)

    def keep(self, first: int, stop: int) -> None:
        """Go on to the segment that begins at ``stop``."""
        unit = 1 << self.levels
        n_kept = -(-self.wavelet.lead(self.levels) // unit) * unit
        all_ = np.concatenate([self.history, self.block[: stop - first]])
        self.history = all_[max(0, len(all_) - n_kept) :]
        self.block = self.block[stop - first :]

    def _next(self, start: int, stop: int) -> Floats:
        values = np.asarray(self.source.values(start, stop), np.float64)
        valid = self.source.valid(start, stop)
        whole = values if valid is None else values[valid]
        if not np.isfinite(whole).all():
            raise MotionError(f"{self.name}: frames {start}:{stop} hold a value that is not finite")
        if valid is None:
            return self.unwrapper(values)
        out = self.unwrapper(np.where(valid, values, np.nan))
        behind = np.concatenate([self.history, self.block])[-1:]
        before = behind[0] if len(behind) else np.full(out.shape[1], np.nan)
        return fill_gaps(out, valid, before)


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


def sample(source: SignalSource, most: int) -> Floats:
    """At most so many frames of a signal, evenly spread; what is invalid is NaN."""
    layout = source.layout
    rows = [np.zeros((0, layout.n_channels))]
    for frame in range(0, layout.n_frames, max(1, -(-layout.n_frames // most))):
        values = np.asarray(source.values(frame, frame + 1), np.float64)
        valid = source.valid(frame, frame + 1)
        rows.append(values if valid is None else np.where(valid, values, np.nan))
    return np.concatenate(rows)
