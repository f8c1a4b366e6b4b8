"""Encoder choice among the four predictors for integers in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.streams import halves_of

MAX_SCALE = 62  # in half octaves


def choose_predictor(band: NDArray[np.int64]) -> tuple[int, int]:
    """The predictor with the smallest errors, and their mean in half octaves."""
    steps = np.diff(band, prepend=band[:1])
    before = np.concatenate([[0], steps[:-1]])
    earlier = np.concatenate([[0, 0], steps[:-2]])
    guesses = (0 * before, before >> 1, before, (3 * before - 2 * earlier) >> 2)
    errors = [np.abs(steps - guess)[1:] for guess in guesses]
    costs = [float(np.log2(e + 1 + e.mean() / 4).sum()) for e in errors]
    best = int(np.argmin(costs))
    return best, halves_of(float(errors[best].mean()), MAX_SCALE)
