"""Train the start table of lossless: the state in which its coder begins every stream.

    python tools/train_lossless.py OUT.json FILE...

The files are coded twice with one state that is never reset; see ``tools/start_tables.py``.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np

import mcz
from mcz.coding.ordinals import streams
from tools.start_tables import Kept, table, untrained

MAX_COUNT = 20


def train(paths: list[Path]) -> np.ndarray:
    """The mean state after the files of the second round."""
    state = untrained(streams.start_states("lossless")[0])
    streams.start_states = lambda _: (state.view(Kept),)  # type: ignore[assignment]
    total = np.zeros_like(state)
    for number, path in enumerate([*paths, *paths]):
        out = io.BytesIO()
        mcz.write(mcz.read(path), out, codec="lossless", profile="large")
        print(f"{path.name}: {path.stat().st_size / len(out.getvalue()):.3f}", file=sys.stderr)
        if number >= len(paths):
            total += state
    return total // len(paths)


if __name__ == "__main__":
    loops, _ = streams.loops()
    result = table(train([Path(name) for name in sys.argv[2:]]), loops.N_MIXERS, MAX_COUNT)
    Path(sys.argv[1]).write_text(json.dumps(result, indent=1) + "\n")
