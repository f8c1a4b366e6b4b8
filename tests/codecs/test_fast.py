"""Codec 14, ``fast``: every grid, every kind of channel, hostile streams."""

from __future__ import annotations

import io
from contextlib import ExitStack
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.codecs.contract import Layout, Request, Span
from mcz.codecs.lossless import fast
from mcz.coding.ordinals import degrees, heads
from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.degrees import DEGREE, of_products
from mcz.coding.quick import kernels, streams, tables
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from tests.codecs.test_lossless import GRIDS, columns
from tests.motions import motions, smooth

SINGLE = Grid(GridKind.BINARY32)


def coded(wanted: np.ndarray, grid: Grid, clip_grid: Grid | None = None) -> bytes:
    n = wanted.shape[1]
    own = [(grid, clip_grid or grid)] * n
    (stream,) = streams.build_streams(wanted, own, [range(n)], [0], True)
    return stream


def decoded(stream: bytes, n_rows: int, n_channels: int, grid: Grid) -> np.ndarray:
    layout = Layout(n_rows, (tuple(range(n_channels)),), grids=(grid,) * n_channels)
    request = Request(0, n_rows, (0,))
    return fast.decode(b"", layout, [Span(0, n_rows)], request, lambda s, r, g: stream)


@pytest.mark.parametrize("grid", GRIDS, ids=lambda g: f"{g.kind.name}-{g.digits}")
@given(data=st.data())
def test_any_ordinals_come_back(grid: Grid, data: st.DataObject) -> None:
    wanted = data.draw(columns(grid))
    stream = coded(wanted, grid)
    assert outcomes(stream, *wanted.shape, grid) == [wanted.tolist()] * 2


@given(data=st.data())
def test_a_grid_other_than_the_clips(data: st.DataObject) -> None:
    wanted = data.draw(columns(GRIDS[3]))
    stream = coded(wanted, GRIDS[3], clip_grid=GRIDS[0])
    np.testing.assert_array_equal(decoded(stream, *wanted.shape, GRIDS[0]), wanted)


@pytest.mark.parametrize("extreme", [-(2**63), 2**63 - 1, 0, -1])
def test_extreme_ordinals_of_any_form(extreme: int) -> None:
    wanted = np.array([[extreme], [5], [extreme], [-9]], np.int64)
    for grid in GRIDS:
        assert outcomes(coded(wanted, grid), 4, 1, grid) == [wanted.tolist()] * 2


def outcomes(stream: bytes, n_rows: int, n_channels: int, grid: Grid) -> list[object]:
    """What is decoded with compiled kernels and without: rows, or that it is refused."""
    found: list[object] = []
    for lacking in (False, True):
        with ExitStack() as stack:
            for module in (degrees, streams):
                name = f"{module.__name__}.lacks_compiled_kernels"
                stack.enter_context(mock.patch(name, return_value=lacking))
            try:
                found.append(decoded(stream, n_rows, n_channels, grid).tolist())
            except FormatError:
                found.append(FormatError)
    return found


@given(motions())
def test_any_motion_comes_back(motion: mcz.Motion) -> None:
    out = io.BytesIO()
    mcz.write(motion, out, codec="fast", segment_frames=5)
    with mcz.open(out.getvalue()) as file:
        back = file.clips[motion.name].motion()
    for one, other in zip(motion.signals, back.signals, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


def test_rounding_noise_is_coded_as_products() -> None:
    grid, codes = GRIDS[3], np.random.default_rng(2).integers(-500, 500, 300)
    wanted = of_products(codes, DEGREE * 2.0**-60, 4, grid)[:, None]
    stream = coded(wanted, grid)
    assert stream[1] == heads.PRODUCTS
    assert len(stream) < 300 * 12 / 8
    assert outcomes(stream, 300, 1, grid) == [wanted.tolist()] * 2
    with pytest.raises(FormatError, match="products on the grid FIXED"):
        decoded(stream, 300, 1, GRIDS[0])


@pytest.mark.parametrize("spread", [0, 2])
def test_what_a_converter_counted(spread: int) -> None:
    rng = np.random.default_rng(3)
    counts = rng.integers(-3000, 3000, (400, 2))
    off = np.rint(rng.normal(0, 0.2 * spread, counts.shape)).astype(np.int64)
    law = Law(10 / 65535, 0.7, -0.2)
    wanted = np.stack([law.ordinals(column) for column in counts.T], axis=1) + off
    stream = coded(wanted, SINGLE)
    assert stream[1] == heads.COUNTS
    assert len(stream) < 2 * 400 * (16 + spread) / 8
    assert outcomes(stream, 400, 2, SINGLE) == [wanted.tolist()] * 2


def test_constants_and_copies_cost_almost_nothing() -> None:
    noise = np.random.default_rng(1).integers(-(10**6), 10**6, (500, 1))
    once = coded(noise, GRIDS[0])
    wanted = np.hstack([noise, np.full((500, 1), 7), noise, np.zeros((500, 1), int)])
    stream = coded(wanted, GRIDS[0])
    assert len(stream) <= len(once) + 8
    np.testing.assert_array_equal(decoded(stream, 500, 4, GRIDS[0]), wanted)


def test_a_joint_whose_channels_copy_those_of_another() -> None:
    motion = smooth(60)
    values = motion.values.copy()
    values[:, 9] = values[:, 7]  # the knee repeats a channel of the spine
    out = io.BytesIO()
    mcz.write(motion.with_values(values), out, codec="fast")
    with mcz.open(out.getvalue()) as file:
        found = file.clips["smooth"].read((10, 20), ["knee"])
    np.testing.assert_array_equal(found, values[10:20, 9:])


@pytest.mark.parametrize(
    "streams",
    [
        (bytes((heads.COPY, 1, 0)), bytes((heads.COPY, 0, 0))),
        (bytes((heads.COPY, 5, 0)), bytes((heads.CONSTANT,))),
        (bytes((heads.COPY, 0, 9)), bytes((heads.CONSTANT,))),
        (bytes((heads.COPY, 0, 0)), bytes((heads.CONSTANT,))),
    ],
)
def test_bad_copies_are_refused(streams: tuple[bytes, bytes]) -> None:
    layout = Layout(3, ((0,), (1,)), grids=(GRIDS[0],) * 2)
    for groups in ((0,), (0, 1)):
        with pytest.raises(FormatError, match="copy"):
            fast.decode(
                b"", layout, [Span(0, 3)], Request(0, 3, groups), lambda s, r, g: streams[g]
            )


@given(st.binary(max_size=60), st.sampled_from(GRIDS))
def test_any_bytes_decode_or_are_refused(stream: bytes, grid: Grid) -> None:
    compiled, plain = outcomes(stream, 30, 2, grid)
    assert compiled == plain


@given(st.data())
def test_flipped_bits_and_prefixes_decode_or_are_refused(data: st.DataObject) -> None:
    grid = data.draw(st.sampled_from(GRIDS))
    wanted = data.draw(columns(grid))
    stream = bytearray(coded(wanted, grid))
    if data.draw(st.booleans()):
        bit = data.draw(st.integers(0, 8 * len(stream) - 1))
        stream[bit // 8] ^= 1 << bit % 8
    else:
        del stream[data.draw(st.integers(0, len(stream) - 1)) :]
    compiled, plain = outcomes(bytes(stream), *wanted.shape, grid)
    assert compiled == plain


def test_bytes_that_no_value_takes_are_refused() -> None:
    wanted = np.arange(40).reshape(20, 2) ** 2
    stream = coded(wanted, GRIDS[0])
    for more in (b"\0", b"\1", bytes(5)):
        with pytest.raises(FormatError):
            decoded(stream + more, 20, 2, GRIDS[0])
    with pytest.raises(FormatError):
        decoded(bytes((heads.CONSTANT,)) + b"\0", 3, 1, GRIDS[0])


def test_rows_of_a_cut_equal_those_of_the_whole() -> None:
    motion = smooth(200)
    out = io.BytesIO()
    mcz.write(motion, out, codec="fast", segment_frames=32)
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["smooth"]
        for frames in [(0, 1), (31, 33), (64, 96), (199, 200), (5, 190)]:
            np.testing.assert_array_equal(clip.read(frames), motion.values[slice(*frames)])


def test_smaller_than_raw() -> None:
    sizes = {}
    for codec in ("raw", "fast"):
        out = io.BytesIO()
        mcz.write(smooth(2000), out, codec=codec)
        sizes[codec] = len(out.getvalue())
    assert sizes["fast"] < 0.6 * sizes["raw"]


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
    assert len(coded(smooth_curve, GRIDS[0])) < 0.5 * len(coded(rough, GRIDS[0]))
