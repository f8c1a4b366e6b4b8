"""Properties of the codecs of ordinals, on every grid: any numbers come back."""

from __future__ import annotations

import io
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import codec_by_name
from mcz.codecs.coding.fast import lanes
from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.codecs.contract import Layout, Request, Span
from mcz.model.numbers import Grid
from tests.codecs.coders import CODERS, GRIDS, Coder, columns
from tests.motions import smooth

EVERY = pytest.mark.parametrize("coder", CODERS, ids=lambda coder: coder.name)
GRID = pytest.mark.parametrize("grid", GRIDS, ids=lambda g: f"{g.kind.name}-{g.digits}")


@EVERY
@GRID
@settings(max_examples=25)
@given(data=st.data())
def test_any_ordinals_come_back(coder: Coder, grid: Grid, data: st.DataObject) -> None:
    wanted = data.draw(columns(grid))
    assert coder.rows(coder.encode_columns(wanted, grid), *wanted.shape, grid) == wanted.tolist()


@EVERY
@given(data=st.data())
def test_a_grid_other_than_the_clips(coder: Coder, data: st.DataObject) -> None:
    wanted = data.draw(columns(GRIDS[3]))
    stream = coder.encode_columns(wanted, GRIDS[3], clip_grid=GRIDS[0])
    np.testing.assert_array_equal(coder.decode_stream(stream, *wanted.shape, GRIDS[0]), wanted)


@EVERY
@pytest.mark.parametrize("extreme", [-(2**63), 2**63 - 1, 0, -1])
def test_extreme_ordinals_of_any_form(coder: Coder, extreme: int) -> None:
    wanted = np.array([[extreme], [5], [extreme], [-9]], np.int64)
    for grid in GRIDS:
        assert coder.rows(coder.encode_columns(wanted, grid), 4, 1, grid) == wanted.tolist()


@pytest.mark.parametrize("grid", [GRIDS[0], GRIDS[3], GRIDS[8], GRIDS[11]], ids=repr)
def test_segments_of_several_lengths_at_once(grid: Grid) -> None:
    """Both decoders of fast; those of numpy take all segments row by row."""
    rng = np.random.default_rng(2)
    lengths = 7, 30, 30, 1, 19, 30
    tables = [rng.integers(-(10**7), 10**7, (n, 5)).cumsum(axis=0) for n in lengths]
    groups = (0, 1), (2,), (3, 4)
    builder = StreamBuilder([grid] * 5, groups)
    streams = [builder.build(table, (grid,) * 5) for table in tables]
    ends = np.cumsum(lengths).tolist()
    spans = [Span(end - n, n) for end, n in zip(ends, lengths, strict=True)]
    layout, request = Layout(ends[-1], groups, grids=(grid,) * 5), Request(3, ends[-1], (0, 1, 2))
    for lacking in (False, True):
        with mock.patch.object(lanes, "lacks_compiled_kernels", return_value=lacking):
            found = codec_by_name("fast").decode(
                b"", layout, spans, request, lambda s, r, g: streams[s][g]
            )
        np.testing.assert_array_equal(found, np.concatenate(tables)[3:])


@EVERY
def test_constants_and_copies_cost_almost_nothing(coder: Coder) -> None:
    noise = np.random.default_rng(1).integers(-(10**6), 10**6, (500, 1))
    once = coder.encode_columns(noise, GRIDS[0])
    wanted = np.hstack([noise, np.full((500, 1), 7), noise, np.zeros((500, 1), int)])
    stream = coder.encode_columns(wanted, GRIDS[0])
    assert len(stream) <= len(once) + 8
    np.testing.assert_array_equal(coder.decode_stream(stream, 500, 4, GRIDS[0]), wanted)


def test_each_is_smaller_than_the_one_before() -> None:
    sizes = []
    for codec in ("raw", "fast", "best"):
        out = io.BytesIO()
        mcz.write(smooth(600), out, codec=codec)
        sizes.append(len(out.getvalue()))
    assert sizes[1] < 0.65 * sizes[0]
    assert sizes[2] < 0.97 * sizes[1]
