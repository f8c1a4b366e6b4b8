"""The distributions of symbols with which codec 14, ``fast``, codes: an annex of SPEC.md."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.annexes import annex_bytes
from mcz.coding.quick.kernels import N_CONTEXTS, N_SYMBOLS, TABLE, TABLE_BITS, Tables

Ints = NDArray[np.int64]
LAST_POWER = 63


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
    return Tables(symbols.reshape(N_CONTEXTS, TABLE), counts << TABLE_BITS | starts, powers)


@cache
def costs() -> Ints:
    """What each symbol costs in each context, in 256ths of a bit."""
    return costs_of(tables().frequencies >> TABLE_BITS)


def costs_of(counts: Ints) -> Ints:
    return np.rint(256 * (TABLE_BITS - np.log2(counts))).astype(np.int64)
