"""The levels of a ``posewave`` segment: their rows, times and weights.

SPEC.md, "Codec 3: posewave", is normative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.transforms import lifting

Ints = NDArray[np.int64]

ROOT_2 = 1.4142135623730951
N_KINDS = 6  # of levels


class Pyramid:
    """Wavelet levels of a segment: level 0 are approximations, then details, finest last."""

    def __init__(self, n_frames: int, levels: int, borrowing: int) -> None:
        self.lengths = lifting.lengths(n_frames, levels)
        self.n_details = len(self.lengths) - 1
        self.borrowing = min(borrowing, max(self.n_details - 1, 0))

    def depth(self, level: int) -> int:
        """Number of halvings of a level: 1 for the finest details."""
        return self.n_details if level == 0 else self.n_details + 1 - level

    def kind(self, level: int) -> int:
        """Kind of a level in the row model: 0 approximations, 5 the finest details."""
        return 0 if level == 0 else max(1, N_KINDS - self.depth(level))

    def rows(self, level: int) -> int:
        lengths, depth = self.lengths, self.depth(level)
        return lengths[-1] if level == 0 else lengths[depth - 1] // 2

    def root(self, level: int) -> float:
        """Root of the number of frames a coefficient affects, which weights all levels equally."""
        octaves = self.depth(level) - (level > 0)
        return float(2 ** (octaves // 2)) * (ROOT_2 if octaves % 2 else 1.0)

    def exponents(self, level: int, refinement: Ints) -> Ints:
        """The exponent of each row: the greatest that ``refinement`` asks of frames it bears on.

        ``refinement`` (n_frames,).
        """
        reach = 1 << self.depth(level)
        first = reach >> 1 if level else 0
        padded = np.pad(refinement, reach)
        greatest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
        exponents: Ints = greatest[first::reach][: self.rows(level)]
        return exponents
