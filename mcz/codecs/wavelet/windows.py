"""The signal as the wavelet codecs transform it: unwrapped, without gaps, a window at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import SignalSource
from mcz.codecs.gaps import FrameReader
from mcz.codecs.transforms import dwt
from mcz.codecs.transforms.wavelets import Wavelet

Floats = NDArray[np.float64]


class Frames:
    """The signal as it is transformed, unwrapped and without gaps, a window at a time."""

    def __init__(self, name: str, source: SignalSource, wavelet: Wavelet, levels: int) -> None:
        self.reader, self.wavelet, self.levels = FrameReader(name, source), wavelet, levels
        layout = source.layout
        self.history = np.zeros((0, layout.n_channels))  # frames before the segment
        self.block = np.zeros((0, layout.n_channels))  # from the segment's first frame on
        self.lengths = wavelet.lengths(layout.n_frames, levels)

    def coefficients(self, first: int, stop: int) -> list[Floats]:
        """The bands of the segment first <= frame < stop, the coarsest first."""
        unit, mirrored = 1 << self.levels, self.wavelet.mirrored(self.levels)
        end = min(max(stop, -(-mirrored // unit) * unit), self.lengths[0])
        if end > self.reader.at:
            self.block = np.concatenate([self.block, self.reader.next(end)])
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
