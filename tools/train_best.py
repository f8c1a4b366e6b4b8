"""Train the start table of best: the state in which its coder begins every stream.

    python tools/train_best.py OUT.json FILE...

The files are coded twice with one state that is never reset; see ``tools/start_tables.py``. The
first time there is no table yet, so that none of the old one is learned from.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import mcz
from mcz.codecs.coding import mixing, residuals
from mcz.codecs.coding.streams import start_states
from mcz.codecs.lossless import best
from mcz.codecs.lossless.best import CODEC
from mcz.files.writing.signal_source import MemorySource
from tools.start_tables import Kept, reset_state, table

MAX_COUNT = 20
FRAMES = 600  # a segment


def train(paths: list[Path]) -> np.ndarray:
    """The mean state after the files of the second round."""
    state = np.zeros(mixing.MODELS + 2 * residuals.N_CONTEXTS, np.int64)
    state[: mixing.WEIGHTS] = start_states("best")[0][: mixing.WEIGHTS]
    state = reset_state(state)
    best.start_states = lambda _: (state.view(Kept),)  # type: ignore[assignment]
    total = np.zeros_like(state)
    for number, path in enumerate([*paths, *paths]):
        motion, size = mcz.read(path), 0
        for index in range(len(motion.signals)):
            source = MemorySource(motion, index, CODEC, 2**31)
            segments = CODEC.encode(source, CODEC.options({"segment_frames": FRAMES})).segments
            size += sum(len(stream) for segment in segments for stream in segment.streams)
        print(f"{path.name}: {path.stat().st_size / size:.3f}", file=sys.stderr)
        if number >= len(paths):
            total += state
    return total // len(paths)


if __name__ == "__main__":
    result = table(train([Path(name) for name in sys.argv[2:]]), residuals.N_MIXERS, MAX_COUNT)
    Path(sys.argv[1]).write_text(json.dumps(result, indent=1) + "\n")
