"""Shared parts of the training tools: coders that continue across streams, and their tables.

A start table is the mean of what a coder knows after each file, counts cut to ``max_count`` so that
a stream soon outweighs it. Changing a table changes the format: tables are annexes of SPEC.md.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding import mixing

PER_LINE = 48


class Kept(np.ndarray):
    """A state whose copies are itself, so that streams go on where the last one ended."""

    def copy(self, order: str = "C") -> np.ndarray:
        return self.view(np.ndarray)


def reset_state(state: np.ndarray) -> np.ndarray:
    """``state`` without knowledge: even weights, even probabilities, counts of 0."""
    state = state.copy()
    state[mixing.WEIGHTS : mixing.MODELS] = 26214
    state[mixing.MODELS :: 2] = 32768
    state[mixing.MODELS + 1 :: 2] = 0
    return state


def table(state: np.ndarray, n_mixers: int, max_count: int) -> dict[str, object]:
    """The fields that ``mcz.codecs.coding.streams.start_state`` reads."""
    probabilities = np.clip(state[mixing.MODELS :: 2] >> 8, 0, 255)
    counts = np.minimum(state[mixing.MODELS + 1 :: 2], max_count)
    return {
        "weights": state[mixing.WEIGHTS : mixing.WEIGHTS + 3 * n_mixers].tolist(),
        "probabilities": _lines(probabilities),
        "counts": _lines(counts),
    }


def _lines(values: np.ndarray) -> list[str]:
    digits = values.astype(np.uint8).tobytes().hex()
    return [digits[at : at + 2 * PER_LINE] for at in range(0, len(digits), 2 * PER_LINE)]
