"""Train the start table of best: the state in which its coder begins every stream.

    python tools/train_best.py OUT.json FILE...

The files are coded twice with one state that is never reset; see ``tools/start_tables.py``. The
first time there is no table yet, so that none of the old one is learned from.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np

import mcz
from mcz.codecs.lossless import best_numbers, best_streams
from mcz.coding import mixing
from mcz.coding.start import start_states
from tools.start_tables import Kept, table, untrained

MAX_COUNT = 20


def train(paths: list[Path]) -> np.ndarray:
    """The mean state after the files of the second round."""
    state = np.zeros(mixing.MODELS + 2 * best_numbers.N_CONTEXTS, np.int64)
    state[: mixing.WEIGHTS] = start_states("lossless")[0][: mixing.WEIGHTS]
    state = untrained(state)
    best_streams.start_states = lambda _: (state.view(Kept),)  # type: ignore[assignment]
    total = np.zeros_like(state)
    for number, path in enumerate([*paths, *paths]):
        out = io.BytesIO()
        mcz.write(mcz.read(path), out, codec="best", profile="large")
        print(f"{path.name}: {path.stat().st_size / len(out.getvalue()):.3f}", file=sys.stderr)
        if number >= len(paths):
            total += state
    return total // len(paths)


if __name__ == "__main__":
    result = table(train([Path(name) for name in sys.argv[2:]]), best_numbers.N_MIXERS, MAX_COUNT)
    Path(sys.argv[1]).write_text(json.dumps(result, indent=1) + "\n")
