"""Train the distributions of codec 14: how often each symbol comes in each context.

    python tools/train_fast.py OUT.json FILE...

Predictors are chosen by what they cost, so the files are coded a few times, each time with the
distributions that the time before gave.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np

import mcz
from mcz.coding.quick import kernels, record_kernels, streams, tables

ROUNDS = 3
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
    counts = rounded(untrained())
    for number in range(ROUNDS):
        known = tables.tables_of(counts)
        tables.tables = lambda known=known: known
        seen = np.zeros(counts.shape)
        write = streams.write

        def note(records: np.ndarray, seen: np.ndarray = seen) -> bytes:
            later = records[records[:, record_kernels.CONTEXT] >= 0]
            symbols = np.minimum(later[:, record_kernels.SYMBOL], kernels.FAR)
            np.add.at(seen, (later[:, record_kernels.CONTEXT], symbols), 1)
            return write(records)

        streams.write = note
        before = after = 0
        for path in paths:
            out = io.BytesIO()
            mcz.write(mcz.read(path), out, codec="fast")
            before, after = before + path.stat().st_size, after + len(out.getvalue())
        streams.write = write
        print(f"round {number}: {before / after:.3f}", file=sys.stderr)
        shares = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1)
        near = shares.sum(axis=0) / len(shares)
        counts = rounded(seen + SMOOTH * near + 0.01)
    return counts


if __name__ == "__main__":
    found = train([Path(name) for name in sys.argv[2:]])
    Path(sys.argv[1]).write_text(json.dumps({"counts": found.tolist()}, indent=1) + "\n")
