"""Codec ``best``: degenerate channels, what is played twice."""

from __future__ import annotations

import numpy as np
import pytest

from mcz.codecs.contract import Layout
from mcz.codecs.lossless.best import ECHOED, build_stream
from mcz.codecs.lossless.echoes import find_echoes
from tests.codecs.coders import BEST, GRIDS, encode_predicted
from tests.motions import smooth

FIXED, SIX = GRIDS[0], GRIDS[3]


def test_channels_that_say_the_same() -> None:
    """Sums of products of which most are singular, and what jumps far out of them."""
    rng = np.random.default_rng(3)
    walk = rng.integers(-50, 50, 300).cumsum()
    wanted = np.stack([walk, walk + 1, walk * 2, -walk, walk // 3 + walk], axis=1)
    wanted[150:152, 2] += 2**30
    stream = BEST.encode_columns(wanted, FIXED)
    np.testing.assert_array_equal(BEST.decode_stream(stream, 300, 5, FIXED), wanted)
    alone: list[list[int]] = [[]] * 5
    assert len(stream) < 0.8 * len(encode_predicted(wanted, [(FIXED, FIXED)] * 5, alone))


@pytest.mark.parametrize("size", [1e-9, 1e-3, 9.5, 9.99999e5, 1e30])
def test_numbers_that_cross_their_classes(size: float) -> None:
    """Leads and tails change their lengths, also where signs and zeros are mixed."""
    rng = np.random.default_rng(7)
    values = size * (1 + 0.4 * np.sin(np.arange(400) / 9) + 0.01 * rng.normal(size=400))
    values[200:300] -= size
    values[250:255] = 0
    wanted = SIX.ordinals(np.array([float(f"{v:.6g}") for v in values]))[0][:, None]
    wanted[253] = -1  # -0
    np.testing.assert_array_equal(
        BEST.decode_stream(BEST.encode_columns(wanted, SIX), 400, 1, SIX), wanted
    )


def test_what_is_played_twice_is_coded_once() -> None:
    rng = np.random.default_rng(5)
    once = rng.integers(-(10**9), 10**9, (40, 6))
    mirrored = np.concatenate([once, -1 - once[:, [1, 0, 3, 2, 4, 5]]])
    for twice in (np.concatenate([once, once]), mirrored):
        grids = (FIXED,) * 6
        layout = Layout(len(twice), (tuple(range(6)),), grids=grids)
        stream = build_stream(twice, grids, layout)
        assert stream[0] == ECHOED
        assert len(stream) < 1.1 * len(build_stream(once, grids, layout))
        np.testing.assert_array_equal(BEST.decode_stream(stream, 80, 6, FIXED), twice)


def test_smooth_motion_has_no_echoes() -> None:
    ordinals = FIXED.ordinals(smooth(600).values)[0]
    usable = np.arange(ordinals.shape[1])
    assert find_echoes(ordinals, ordinals.astype(np.int32), usable) == []
