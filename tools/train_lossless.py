"""Train the start table of codec 1: the state in which its coder begins every stream.

    python tools/train_lossless.py OUT.json FILE...

The files are coded with one state that is never reset; the mean of what it knows after each file of
the second round, counts cut to ``MAX_COUNT`` so that a stream soon outweighs it, is the table.
Changing the table changes the format: it is run once, and its result is an annex of SPEC.md.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np

import mcz
from mcz.codecs import lossless
from mcz.coding import kernels

MAX_COUNT = 20
PER_LINE = 48


class Kept(np.ndarray):
    """A state whose copies are itself, so that streams go on where the last one ended."""

    def copy(self, order: str = "C") -> np.ndarray:
        return self.view(np.ndarray)


def train(paths: list[Path]) -> np.ndarray:
    """The mean state after the files of the second round."""
    state = lossless._start_state().copy()
    state[kernels.WEIGHTS : kernels.MODELS] = 26214
    state[kernels.MODELS :: 2] = 32768
    state[kernels.MODELS + 1 :: 2] = 0
    lossless._start_state = lambda: state.view(Kept)  # type: ignore[assignment]
    total = np.zeros_like(state)
    for number, path in enumerate([*paths, *paths]):
        out = io.BytesIO()
        mcz.write(mcz.read(path), out, codec="lossless", archive=True)
        print(f"{path.name}: {path.stat().st_size / len(out.getvalue()):.3f}", file=sys.stderr)
        if number >= len(paths):
            total += state
    return total // len(paths)


def table(state: np.ndarray) -> dict[str, object]:
    probabilities = np.clip(state[kernels.MODELS :: 2] >> 8, 0, 255)
    counts = np.minimum(state[kernels.MODELS + 1 :: 2], MAX_COUNT)
    lossless_loops, _ = lossless._kernels()
    n_weights = 3 * lossless_loops.N_MIXERS
    return {
        "weights": state[kernels.WEIGHTS : kernels.WEIGHTS + n_weights].tolist(),
        "probabilities": _lines(probabilities),
        "counts": _lines(counts),
    }


def _lines(values: np.ndarray) -> list[str]:
    digits = values.astype(np.uint8).tobytes().hex()
    return [digits[at : at + 2 * PER_LINE] for at in range(0, len(digits), 2 * PER_LINE)]


if __name__ == "__main__":
    result = table(train([Path(name) for name in sys.argv[2:]]))
    Path(sys.argv[1]).write_text(json.dumps(result, indent=1) + "\n")
