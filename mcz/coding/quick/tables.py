"""The distributions of symbols with which ``fast``, codes: an annex of SPEC.md."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.annexes import annex_bytes
from mcz.coding.quick.kernels import N_CONTEXTS, N_SYMBOLS, SYMBOL_BITS, TABLE, TABLE_BITS, Tables

Ints = NDArray[np.int64]
LAST_POWER = 63
MAX_SCALES = 512


@cache
def tables() -> Tables:
    """Those of the annex ``fast_counts.json``; nobody writes to them."""
    return tables_of(np.array(json.loads(annex_bytes("fast_counts.json"))["counts"], np.int64))


def tables_of(counts: Ints) -> Tables:
    """``counts`` (N_CONTEXTS, N_SYMBOLS) of at least 1; each row has the sum TABLE."""
    assert counts.shape == (N_CONTEXTS, N_SYMBOLS)
    assert (counts >= 1).all() and (counts.sum(axis=1) == TABLE).all()
    starts = np.cumsum(counts, axis=1) - counts
    symbols = np.repeat(np.tile(np.arange(N_SYMBOLS, dtype=np.uint8), N_CONTEXTS), counts.ravel())
    twos = [min(2**k, 2**62) for k in range(LAST_POWER + 1)]
    tens = [min(10**k, 10**18) for k in range(LAST_POWER + 1)]
    powers = np.array([twos, tens], np.int64)
    frequencies = np.zeros((N_CONTEXTS, 1 << SYMBOL_BITS), np.int64)
    frequencies[:, :N_SYMBOLS] = counts << TABLE_BITS | starts
    scales = np.array([_context(scale) for scale in range(MAX_SCALES)], np.int64)
    return Tables(symbols, frequencies.ravel(), scales, powers)


def _context(scale: int) -> int:
    """The context of a scale, in quarters of octaves, << 8 | bits that are raw: FAST-11."""
    context = scale if scale < N_CONTEXTS - 4 else N_CONTEXTS - 4 + scale % 4
    return context << 8 | min(max(scale // 4 - 7, 0), 44)
