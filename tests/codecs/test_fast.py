"""Codec lossless, ``fast``: forms of its streams, tables, sizes."""

from __future__ import annotations

import numpy as np

from mcz.coding.quick import kernels, tables
from mcz.numbers import Grid, GridKind
from tests.codecs.coders import FAST, GRIDS

SINGLE = Grid(GridKind.BINARY32)


def test_each_context_has_a_distribution() -> None:
    known = tables.tables()
    counts = (known.frequencies >> kernels.TABLE_BITS).reshape(kernels.N_CONTEXTS, -1)
    counts = counts[:, : kernels.N_SYMBOLS]
    assert (counts > 0).all()
    assert (counts.sum(axis=1) == kernels.TABLE).all()


def test_a_smooth_curve_needs_fewer_bits_than_a_rough_one() -> None:
    t = np.arange(400)
    smooth_curve = np.round(10**5 * np.sin(t / 40)).astype(np.int64)[:, None]
    rough = np.random.default_rng(0).permutation(smooth_curve)
    assert len(FAST.coded(smooth_curve, GRIDS[0])) < 0.5 * len(FAST.coded(rough, GRIDS[0]))
