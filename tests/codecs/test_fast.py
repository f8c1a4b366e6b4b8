"""Codec 14, ``fast``: forms of its streams, tables, sizes."""

from __future__ import annotations

import numpy as np
import pytest

from mcz.coding.ordinals import heads
from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.degrees import DEGREE, of_products
from mcz.coding.quick import kernels, tables
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from tests.codecs.coders import FAST, GRIDS

SINGLE = Grid(GridKind.BINARY32)


def test_rounding_noise_is_coded_as_products() -> None:
    grid, codes = GRIDS[3], np.random.default_rng(2).integers(-500, 500, 300)
    wanted = of_products(codes, DEGREE * 2.0**-60, 4, grid)[:, None]
    stream = FAST.coded(wanted, grid)
    assert stream[1] == heads.PRODUCTS
    assert len(stream) < 300 * 12 / 8
    assert FAST.outcome(stream, 300, 1, grid) == wanted.tolist()
    with pytest.raises(FormatError, match="products on the grid FIXED"):
        FAST.decoded(stream, 300, 1, GRIDS[0])


@pytest.mark.parametrize("spread", [0, 2])
def test_what_a_converter_counted(spread: int) -> None:
    rng = np.random.default_rng(3)
    counts = rng.integers(-3000, 3000, (400, 2))
    off = np.rint(rng.normal(0, 0.2 * spread, counts.shape)).astype(np.int64)
    law = Law(10 / 65535, 0.7, -0.2)
    wanted = np.stack([law.ordinals(column) for column in counts.T], axis=1) + off
    stream = FAST.coded(wanted, SINGLE)
    assert stream[1] == heads.COUNTS
    assert len(stream) < 2 * 400 * (16 + spread) / 8
    assert FAST.outcome(stream, 400, 2, SINGLE) == wanted.tolist()


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
