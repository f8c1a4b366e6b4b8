"""Codec mrdwt, ``best``: links, echoes, degenerate channels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcz.codecs.lossless import best_streams
from mcz.codecs.lossless.best_streams import ECHOED, MAX_SEEN, Link
from mcz.codecs.lossless.echoes import Echo, build_echoes, find_echoes
from mcz.coding.ordinals.streams import plan_stream
from mcz.numbers import Grid
from tests.codecs.coders import BEST, GRIDS, columns, linked
from tests.motions import smooth

FIXED, SIX = GRIDS[0], GRIDS[3]


@st.composite
def some_links(draw: st.DrawFn) -> list[Link]:
    """Of four channels."""
    made = []
    for channel in range(4):
        unit = draw(st.integers(0, best_streams.MAX_UNIT))
        seen = st.lists(st.integers(0, max(0, channel - 1)), max_size=MAX_SEEN * (channel > 0))
        made.append(Link(unit, unit + draw(st.integers(0, 15)), tuple(draw(seen))))
    return made


@given(st.sampled_from(GRIDS), some_links(), st.data())
@settings(max_examples=100)
def test_any_links(grid: Grid, links: list[Link], data: st.DataObject) -> None:
    wanted = data.draw(columns(grid))
    stream = linked(wanted, [(grid, grid)] * wanted.shape[1], links)
    np.testing.assert_array_equal(BEST.decoded(stream, *wanted.shape, grid), wanted)


def test_channels_that_say_the_same() -> None:
    """Sums of products of which most are singular, and what jumps far out of them."""
    rng = np.random.default_rng(3)
    walk = rng.integers(-50, 50, 300).cumsum()
    wanted = np.stack([walk, walk + 1, walk * 2, -walk, walk // 3 + walk], axis=1)
    wanted[150:152, 2] += 2**40
    stream = BEST.coded(wanted, FIXED)
    np.testing.assert_array_equal(BEST.decoded(stream, 300, 5, FIXED), wanted)
    alone = [Link(0, 4, ())] * 5
    assert len(stream) < 0.8 * len(linked(wanted, [(FIXED, FIXED)] * 5, alone))


@pytest.mark.parametrize("size", [1e-9, 1e-3, 9.5, 9.99999e5, 1e30])
def test_numbers_that_cross_their_classes(size: float) -> None:
    """The unit is that of the class or of the one above, also where signs and zeros are mixed."""
    rng = np.random.default_rng(7)
    values = size * (1 + 0.4 * np.sin(np.arange(400) / 9) + 0.01 * rng.normal(size=400))
    values[200:300] -= size
    values[250:255] = 0
    wanted = SIX.ordinals(np.array([float(f"{v:.6g}") for v in values]))[0][:, None]
    wanted[253] = -1  # -0
    np.testing.assert_array_equal(BEST.decoded(BEST.coded(wanted, SIX), 400, 1, SIX), wanted)


@st.composite
def some_echoes(draw: st.DrawFn, n_rows: int, n_channels: int) -> list[Echo]:
    found, left = [], n_rows * n_channels
    for _ in range(draw(st.integers(1, 5))):
        row = draw(st.integers(1, n_rows - 1))
        height = draw(st.integers(1, n_rows - row))
        width = draw(st.integers(1, n_channels))
        first, source = (draw(st.integers(0, n_channels - width)) for _ in range(2))
        left -= height * width
        if left >= 0:
            lag = draw(st.integers(1, row))
            found.append(Echo(row, height, first, width, lag, source, draw(st.booleans())))
    return found


@given(st.data())
@settings(max_examples=60)
def test_echoes_are_what_was_there_before(data: st.DataObject) -> None:
    n_rows, n_channels = 12, 4
    values = data.draw(st.lists(st.integers(-(10**6), 10**6), min_size=48, max_size=48))
    wanted = np.array(values, np.int64).reshape(n_rows, n_channels)
    wanted[0] = range(n_channels)  # no copies
    wanted[1] = 5
    echoes = data.draw(some_echoes(n_rows, n_channels))
    for row in range(n_rows):
        for echo in echoes:
            if echo.row <= row < echo.row + echo.n_rows:
                source = wanted[row - echo.lag, echo.source : echo.source + echo.n_channels].copy()
                block = slice(echo.channel, echo.channel + echo.n_channels)
                wanted[row, block] = -1 - source if echo.minus else source
    heads, plans, coded = plan_stream(wanted, [(FIXED, FIXED)] * n_channels, 0, {})
    if len(plans) < n_channels:
        return
    links = [Link(4, 9, ())] * n_channels
    bits = best_streams.code(coded, plans, links, echoes)
    linked = b"".join(link.head() for link in links)
    stream = bytes((ECHOED,)) + heads + build_echoes(echoes) + linked + bits
    if echoes:
        np.testing.assert_array_equal(BEST.decoded(stream, n_rows, n_channels, FIXED), wanted)


def test_what_is_played_twice_is_coded_once() -> None:
    rng = np.random.default_rng(5)
    once = rng.integers(-(10**9), 10**9, (40, 6))
    mirrored = np.concatenate([once, -1 - once[:, [1, 0, 3, 2, 4, 5]]])
    for twice in (np.concatenate([once, once]), mirrored):
        own = [(FIXED, FIXED)] * 6
        stream = best_streams.build_stream(twice, own, 0, {})
        assert stream[0] == ECHOED
        assert len(stream) < 1.1 * len(best_streams.build_stream(once, own, 0, {}))
        np.testing.assert_array_equal(BEST.decoded(stream, 80, 6, FIXED), twice)


def test_smooth_motion_has_no_echoes() -> None:
    ordinals = FIXED.ordinals(smooth(600).values)[0]
    assert find_echoes(ordinals, [True] * ordinals.shape[1]) == []
