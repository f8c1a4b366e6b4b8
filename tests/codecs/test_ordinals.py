"""What the codecs of ordinals keep to, on every grid: any numbers come back, any bytes end."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import by_name
from mcz.codecs.contract import Layout, Request, Span
from mcz.coding.ordinals import heads
from mcz.errors import FormatError
from mcz.numbers import Grid
from tests.codecs.coders import CODERS, GRIDS, Coder, columns
from tests.motions import motions, smooth

EVERY = pytest.mark.parametrize("coder", CODERS, ids=lambda coder: coder.name)
GRID = pytest.mark.parametrize("grid", GRIDS, ids=lambda g: f"{g.kind.name}-{g.digits}")


@EVERY
@GRID
@settings(max_examples=25)
@given(data=st.data())
def test_any_ordinals_come_back(coder: Coder, grid: Grid, data: st.DataObject) -> None:
    wanted = data.draw(columns(grid))
    assert coder.outcome(coder.coded(wanted, grid), *wanted.shape, grid) == wanted.tolist()


@EVERY
@given(data=st.data())
def test_a_grid_other_than_the_clips(coder: Coder, data: st.DataObject) -> None:
    wanted = data.draw(columns(GRIDS[3]))
    stream = coder.coded(wanted, GRIDS[3], clip_grid=GRIDS[0])
    np.testing.assert_array_equal(coder.decoded(stream, *wanted.shape, GRIDS[0]), wanted)


@EVERY
@pytest.mark.parametrize("extreme", [-(2**63), 2**63 - 1, 0, -1])
def test_extreme_ordinals_of_any_form(coder: Coder, extreme: int) -> None:
    wanted = np.array([[extreme], [5], [extreme], [-9]], np.int64)
    for grid in GRIDS:
        assert coder.outcome(coder.coded(wanted, grid), 4, 1, grid) == wanted.tolist()


@pytest.mark.parametrize("codec", ["raw", "lossless", "fast", "best"])
@given(motion=motions())
def test_any_motion_comes_back(codec: str, motion: mcz.Motion) -> None:
    out = io.BytesIO()
    mcz.write(motion, out, codec=codec, segment_frames=5)
    with mcz.open(out.getvalue()) as file:
        back = file.clips[motion.name].motion()
    for one, other in zip(motion.signals, back.signals, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


@EVERY
def test_constants_and_copies_cost_almost_nothing(coder: Coder) -> None:
    noise = np.random.default_rng(1).integers(-(10**6), 10**6, (500, 1))
    once = coder.coded(noise, GRIDS[0])
    wanted = np.hstack([noise, np.full((500, 1), 7), noise, np.zeros((500, 1), int)])
    stream = coder.coded(wanted, GRIDS[0])
    assert len(stream) <= len(once) + 8
    np.testing.assert_array_equal(coder.decoded(stream, 500, 4, GRIDS[0]), wanted)


@pytest.mark.parametrize("codec", ["lossless", "fast"])
def test_a_joint_whose_channels_copy_those_of_another(codec: str) -> None:
    motion, out = smooth(60), io.BytesIO()
    values = motion.values.copy()
    values[:, 9] = values[:, 7]  # the knee repeats a channel of the spine
    mcz.write(motion.with_values(values), out, codec=codec)
    with mcz.open(out.getvalue()) as file:
        found = file.clips["smooth"].read((10, 20), ["knee"])
    np.testing.assert_array_equal(found, values[10:20, 9:])


@pytest.mark.parametrize("codec", ["lossless", "fast"])
@pytest.mark.parametrize(
    "streams",
    [
        (bytes((heads.COPY, 1, 0)), bytes((heads.COPY, 0, 0))),  # a copy of a copy
        (bytes((heads.COPY, 5, 0)), bytes((heads.CONSTANT,))),
        (bytes((heads.COPY, 0, 9)), bytes((heads.CONSTANT,))),
        (bytes((heads.COPY, 0, 0)), bytes((heads.CONSTANT,))),
    ],
)
def test_bad_copies_are_refused(codec: str, streams: tuple[bytes, bytes]) -> None:
    layout = Layout(3, ((0,), (1,)), grids=(GRIDS[0],) * 2)
    for groups in ((0,), (0, 1)):
        request = Request(0, 3, groups)
        with pytest.raises(FormatError, match="copy"):
            by_name(codec).decode(b"", layout, [Span(0, 3)], request, lambda s, r, g: streams[g])


@EVERY
@given(stream=st.binary(max_size=60), grid=st.sampled_from(GRIDS))
def test_any_bytes_decode_or_are_refused(coder: Coder, stream: bytes, grid: Grid) -> None:
    if coder.name == "best" and stream:
        stream = bytes((stream[0] % 3,)) + stream[1:]  # a method that there is
    found = coder.outcome(stream, 30, 2, grid)
    assert found is FormatError or np.shape(found) == (30, 2)


@EVERY
@given(data=st.data())
def test_flipped_bits_and_prefixes_decode_or_are_refused(coder: Coder, data: st.DataObject) -> None:
    grid = data.draw(st.sampled_from(GRIDS))
    wanted = data.draw(columns(grid))
    stream = bytearray(coder.coded(wanted, grid))
    if data.draw(st.booleans()):
        bit = data.draw(st.integers(0, 8 * len(stream) - 1))
        stream[bit // 8] ^= 1 << bit % 8
    else:
        del stream[data.draw(st.integers(0, len(stream) - 1)) :]
    found = coder.outcome(bytes(stream), *wanted.shape, grid)
    assert found is FormatError or np.shape(found) == wanted.shape


@EVERY
def test_bytes_that_no_value_takes_are_refused(coder: Coder) -> None:
    wanted = np.arange(40).reshape(20, 2) ** 2
    stream = coder.coded(wanted, GRIDS[0])
    for more in (b"\0", b"\1", bytes(5)):
        with pytest.raises(FormatError):
            coder.decoded(stream + more, 20, 2, GRIDS[0])
    with pytest.raises(FormatError):
        coder.decoded(bytes((heads.CONSTANT,)) + b"\0", 3, 1, GRIDS[0])


def test_each_is_smaller_than_the_one_before() -> None:
    sizes = []
    for codec in ("raw", "fast", "lossless", "best"):
        out = io.BytesIO()
        mcz.write(smooth(600), out, codec=codec)
        sizes.append(len(out.getvalue()))
    assert sizes[1] < 0.65 * sizes[0]
    assert sizes[2] < sizes[1]
    assert sizes[3] < 0.97 * sizes[2]
