"""Train the distributions of fast: how often each symbol comes in each context.

    python tools/train_fast.py OUT.json FILE...

The annex ``fast_counts.json`` was trained on these clips of CMU: AMC 02_01 05_01 05_11 09_06 135_02
13_29 14_09 16_02 16_15 16_58 49_02 49_18; BVH 05_01 01_03 14_08 06_06; Daz 02_05 14_08 09_01; 3ds
Max 131_02; iClone 005_01; Blender 02_01. A second round sees segments of other lengths, no more.
"""

from __future__ import annotations

import io
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import mcz
from mcz.coding.quick import kernels, record_kernels, streams, tables

ROUNDS = 2
SMOOTH = 64.0  # of the distribution of the neighboring contexts, in symbols


def untrained() -> np.ndarray:
    """Sizes that fall by half every few, the same in each context."""
    sizes = np.exp2(-np.arange(kernels.N_SYMBOLS) / 6)
    return np.tile(sizes, (kernels.N_CONTEXTS, 1))


def rounded(weights: np.ndarray) -> np.ndarray:
    """Counts of at least 1, each row of the sum that tables have."""
    free = kernels.TABLE - kernels.N_SYMBOLS
    shares = weights / weights.sum(axis=1, keepdims=True) * free
    counts = np.floor(shares).astype(np.int64)
    for row, share in zip(counts, shares, strict=True):
        most = np.argsort(row - share)[: free - row.sum()]
        row[most] += 1
    return counts + 1


def train(paths: list[Path]) -> np.ndarray:
    counts, write = rounded(untrained()), streams.write
    for number in range(ROUNDS):
        known, seen = tables.tables_of(counts), np.zeros(counts.shape)
        streams.tables = partial(lambda known: known, known)
        streams.write = partial(note, seen, write)
        before = after = 0
        for path in paths:
            out = io.BytesIO()
            mcz.write(mcz.read(path), out, codec="fast")
            before, after = before + path.stat().st_size, after + len(out.getvalue())
        print(f"round {number}: {before / after:.3f}", file=sys.stderr)
        shares = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1)
        counts = rounded(seen + SMOOTH * shares.mean(axis=0) + 0.01)
    return counts


def note(seen: np.ndarray, write: Any, records: np.ndarray, ends: np.ndarray) -> list[bytes]:
    """Count the symbols of ``records``, then write them."""
    later = records[records[:, record_kernels.CONTEXT] >= 0]
    symbols = np.minimum(later[:, record_kernels.SYMBOL], kernels.FAR)
    np.add.at(seen, (later[:, record_kernels.CONTEXT], symbols), 1)
    found: list[bytes] = write(records, ends)
    return found


if __name__ == "__main__":
    found = train([Path(name) for name in sys.argv[2:]])
    Path(sys.argv[1]).write_text(json.dumps({"counts": found.tolist()}, indent=1) + "\n")
