"""Codec 1, ``lossless``: every grid, every kind of channel, hostile streams."""

from __future__ import annotations

import io
import struct
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs.contract import Layout, Request, Span
from mcz.codecs.lossless import lossless
from mcz.coding.logistic import NODES, squash_table, stretch_table
from mcz.coding.ordinals import heads, streams
from mcz.coding.ordinals.degrees import DEGREE, codes_of, find_degrees, multiples_of, of_products
from mcz.coding.ordinals.units import find_unit, of_multiples
from mcz.errors import FormatError
from mcz.formats import FORMATS
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind
from tests.motions import motions, smooth

GRIDS = (
    Grid(GridKind.FIXED, 4),
    Grid(GridKind.TRIMMED, 6),
    Grid(GridKind.GENERAL, 1),
    Grid(GridKind.GENERAL, 6),
    Grid(GridKind.GENERAL, 15),
    Grid(GridKind.TEXT64),
    Grid(GridKind.TEXT64, 64 + 20),
    Grid(GridKind.TEXT32),
    Grid(GridKind.INTEGER),
    Grid(GridKind.SCALED, scale=0.01),
    Grid(GridKind.BINARY32),
    Grid(GridKind.BINARY64),
    Grid(GridKind.VAX_F),
)


def coded(columns: np.ndarray, grid: Grid, clip_grid: Grid | None = None) -> bytes:
    own = [(grid, clip_grid or grid)] * columns.shape[1]
    return streams.build_stream(columns, own, 0, {})


def decoded(stream: bytes, n_rows: int, n_channels: int, grid: Grid) -> np.ndarray:
    layout = Layout(n_rows, (tuple(range(n_channels)),), grids=(grid,) * n_channels)
    request = Request(0, n_rows, (0,))
    return lossless.decode(b"", layout, [Span(0, n_rows)], request, lambda s, r, g: stream)


@st.composite
def columns(draw: st.DrawFn, grid: Grid) -> np.ndarray:
    """Ordinals of the grid: walks, noise, jumps to the ends, constants."""
    low = -1 - grid.limit if grid.signed_magnitude else -grid.limit
    rows = draw(st.integers(1, 40))
    made = []
    for _ in range(draw(st.integers(1, 4))):
        step = draw(st.sampled_from([0, 1, 7, 1000, 10**6, 10**12, grid.limit]))
        start = draw(st.integers(low, grid.limit))
        steps = draw(st.lists(st.integers(-step, step), min_size=rows, max_size=rows))
        at, column = start, []
        for change in steps:
            at = min(max(at + change, low), grid.limit)
            column.append(at)
        made.append(column)
    return np.array(made, np.int64).T.copy()


@pytest.mark.parametrize("grid", GRIDS, ids=lambda g: f"{g.kind.name}-{g.digits}")
@given(data=st.data())
def test_any_ordinals_come_back(grid: Grid, data: st.DataObject) -> None:
    wanted = data.draw(columns(grid))
    stream = coded(wanted, grid)
    np.testing.assert_array_equal(decoded(stream, *wanted.shape, grid), wanted)


@given(data=st.data())
def test_a_grid_other_than_the_clips(data: st.DataObject) -> None:
    wanted = data.draw(columns(GRIDS[3]))
    stream = coded(wanted, GRIDS[3], clip_grid=GRIDS[0])
    np.testing.assert_array_equal(decoded(stream, *wanted.shape, GRIDS[0]), wanted)


@pytest.mark.parametrize("extreme", [-(2**63), 2**63 - 1, 0, -1])
def test_extreme_ordinals_of_any_form(extreme: int) -> None:
    wanted = np.array([[extreme], [5], [extreme], [-9]], np.int64)
    for grid in GRIDS:
        np.testing.assert_array_equal(decoded(coded(wanted, grid), 4, 1, grid), wanted)


@given(motions())
def test_any_motion_comes_back(motion: mcz.Motion) -> None:
    out = io.BytesIO()
    mcz.write(motion, out, codec="lossless", segment_frames=5)
    with mcz.open(out.getvalue()) as file:
        back = file.clips[motion.name].motion()
    for one, other in zip(motion.signals, back.signals, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


def test_constants_and_copies_cost_almost_nothing() -> None:
    rng = np.random.default_rng(1)
    noise = rng.integers(-(10**6), 10**6, (500, 1))
    once = coded(noise, GRIDS[0])
    wanted = np.hstack([noise, np.full((500, 1), 7), noise, np.zeros((500, 1), int)])
    stream = coded(wanted, GRIDS[0])
    assert len(stream) <= len(once) + 8
    np.testing.assert_array_equal(decoded(stream, 500, 4, GRIDS[0]), wanted)


def test_copies_of_another_group() -> None:
    motion = smooth(60)
    values = motion.values.copy()
    values[:, 9] = values[:, 7]  # the knee repeats a channel of the spine
    out = io.BytesIO()
    mcz.write(motion.with_values(values), out, codec="lossless")
    with mcz.open(out.getvalue()) as file:
        np.testing.assert_array_equal(
            file.clips["smooth"].read((10, 20), ["knee"]), values[10:20, 9:]
        )


def test_copy_of_a_copy_is_refused() -> None:
    layout = Layout(3, ((0,), (1,)), grids=(GRIDS[0],) * 2)
    streams = {0: bytes((heads.COPY, 1, 0)), 1: bytes((heads.COPY, 0, 0))}
    with pytest.raises(FormatError, match="copy of a copy"):
        lossless.decode(b"", layout, [Span(0, 3)], Request(0, 3, (0,)), lambda s, r, g: streams[g])


@pytest.mark.parametrize("copy", [(5, 0), (0, 9), (1, 1)])
def test_copy_of_nothing_is_refused(copy: tuple[int, int]) -> None:
    layout = Layout(3, ((0,), (1,)), grids=(GRIDS[0],) * 2)
    stream = bytes((heads.COPY, *copy))
    with pytest.raises(FormatError):
        lossless.decode(b"", layout, [Span(0, 3)], Request(0, 3, (0,)), lambda s, r, g: stream)


@given(st.binary(max_size=60), st.sampled_from(GRIDS))
def test_any_bytes_decode_or_are_refused(stream: bytes, grid: Grid) -> None:
    try:
        out = decoded(stream, 30, 2, grid)
    except FormatError:
        return
    assert out.shape == (30, 2)


@given(st.data())
def test_flipped_bits_decode_or_are_refused(data: st.DataObject) -> None:
    grid = data.draw(st.sampled_from(GRIDS))
    wanted = data.draw(columns(grid))
    stream = bytearray(coded(wanted, grid))
    bit = data.draw(st.integers(0, 8 * len(stream) - 1))
    stream[bit // 8] ^= 1 << bit % 8
    try:
        out = decoded(bytes(stream), *wanted.shape, grid)
    except FormatError:
        return
    assert out.shape == wanted.shape


def test_bytes_after_the_end_are_refused() -> None:
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
    mcz.write(motion, out, codec="lossless", segment_frames=32)
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["smooth"]
        for frames in [(0, 1), (31, 33), (64, 96), (199, 200), (5, 190)]:
            np.testing.assert_array_equal(clip.read(frames), motion.values[slice(*frames)])


def test_smaller_than_raw() -> None:
    sizes = {}
    for codec in ("raw", "lossless"):
        out = io.BytesIO()
        mcz.write(smooth(2000), out, codec=codec)
        sizes[codec] = len(out.getvalue())
    assert sizes["lossless"] < 0.6 * sizes["raw"]


def test_logistic_tables() -> None:
    nodes = [65536 / (1 + np.exp(-k / 2)) for k in range(-16, 17)]
    assert list(NODES[:17]) == [round(n) for n in nodes[:17]]
    assert list(NODES[17:]) == [65536 - n for n in NODES[15::-1]]
    squash, stretch = squash_table(), stretch_table()
    assert (np.diff(squash) >= 0).all()
    assert (np.diff(stretch) >= 0).all()
    assert (stretch.min(), stretch.max()) == (-2047, 2047)
    middle = squash[stretch[64:4032] + 2048]
    assert (np.abs(middle - (16 * np.arange(64, 4032) + 8)) < 200).all()


@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc"])
@given(data=st.data())
@settings(max_examples=25)  # a whole clip each
def test_one_ordinal_changes_exactly_one_number(
    name: str, samples: Path, data: st.DataObject
) -> None:
    motion = _read_once(samples / name)
    signal = motion.signals[0]
    row = data.draw(st.integers(0, signal.n_rows - 1))
    channel = data.draw(st.integers(0, signal.n_channels - 1))
    grid, step = signal.grids[channel], data.draw(st.sampled_from([-1, 1]))
    values = signal.values.copy()
    ordinal = grid.ordinals(values[row : row + 1, channel])[0] + step
    values[row, channel] = grid.values(ordinal)[0]
    out = io.BytesIO()
    mcz.write(motion.with_values(values), out, codec="lossless")
    with mcz.open(out.getvalue()) as file:
        after = plain_write(file.only_clip().motion()).split()
    before = (samples / name).read_bytes().split()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert [b for _, b in changed] == grid.texts(ordinal).tolist()


@cache
def _read_once(path: Path) -> mcz.Motion:
    return mcz.read(path)


def plain_write(motion: mcz.Motion) -> bytes:
    """The source file with the values that the motion has now."""
    assert motion.source is not None
    return FORMATS[motion.source.format].write(motion)


def test_integers_beyond_any_float() -> None:
    values = np.array([[2**53], [-(2**53)], [0]], np.int64)
    bones = mcz.Skeleton((mcz.Joint("m", channels=(mcz.Channel("", "count"),)),))
    out = io.BytesIO()
    mcz.write(mcz.Motion(bones, (Signal(values),)), out, codec="lossless")
    with mcz.open(out.getvalue()) as file:
        np.testing.assert_array_equal(file.clips["motion"].read(), values)


@given(
    st.floats(2.0**-20, 2.0**20),
    st.lists(st.integers(-(2**18), 2**18), min_size=3, max_size=60),
)
def test_multiples_of_a_unit(unit: float, counts: list[int]) -> None:
    multiples = np.array(counts, np.int64)
    ordinals = of_multiples(multiples, unit)
    if len(set(counts) - {0}) < 2:
        return
    found = find_unit(ordinals)
    if found is not None:
        np.testing.assert_array_equal(of_multiples(found[1], found[0]), ordinals)
    stream = coded(ordinals[:, None], Grid(GridKind.BINARY32))
    out = decoded(stream, len(counts), 1, Grid(GridKind.BINARY32))
    np.testing.assert_array_equal(out[:, 0], ordinals)


def test_a_unit_beyond_all_that_a_head_may_have_is_none() -> None:
    ordinals = of_multiples(np.array([0, 1, 3, 5, 2]), 2.0**81)
    assert find_unit(ordinals) is None
    stream = coded(ordinals[:, None], Grid(GridKind.BINARY32))
    out = decoded(stream, 5, 1, Grid(GridKind.BINARY32))
    np.testing.assert_array_equal(out[:, 0], ordinals)


def test_scaled_integers_are_found_among_floats() -> None:
    counts = np.random.default_rng(5).integers(-2000, 2000, 800)
    ordinals = of_multiples(counts, 0.0833333358168602)
    as_integers = coded(counts[:, None], Grid(GridKind.INTEGER))
    as_floats = coded(ordinals[:, None], Grid(GridKind.BINARY32))
    assert len(as_floats) <= len(as_integers) + 12


@pytest.mark.parametrize("unit", [0.0, -1.0, float("nan"), float("inf"), 2.0**-201])
def test_bad_units_are_refused(unit: float) -> None:
    ordinals = of_multiples(np.arange(1, 50) ** 2, 0.25)
    stream = coded(ordinals[:, None], Grid(GridKind.BINARY32))
    broken = stream.replace(struct.pack("<d", 0.25), struct.pack("<d", unit))
    assert broken != stream
    with pytest.raises(FormatError, match="unit"):
        decoded(broken, 49, 1, Grid(GridKind.BINARY32))


@given(
    st.integers(1, 15),
    st.floats(2.0**-200, 2.0**80),
    st.integers(1, 63),
    st.lists(st.integers(-(2**44), 2**44 - 1) | st.integers(-9, 9), min_size=1),
)
def test_products_are_numbers_of_their_grid(
    digits: int, unit: float, shifts: int, some: list[int]
) -> None:
    grid, codes = Grid(GridKind.GENERAL, digits), np.array(some, np.int64)
    products = multiples_of(codes, shifts) * unit
    expected = grid.ordinals(products)[0]
    assert of_products(codes, unit, shifts, grid).tolist() == expected.tolist()
    last = [float(f"1e{f'{product:.16e}'.split('e')[1]}") for product in products.tolist()]
    half = 0.5 * np.array(last) * 10.0 ** (1 - digits)  # a unit of the last digit
    assert (abs(grid.values(expected) - products) <= half + abs(products) * 2.0**-51).all()


@given(st.lists(st.integers(-(2**44), 2**44), min_size=1))
def test_codes_say_multiples(some: list[int]) -> None:
    codes, shifts = codes_of(np.array(some, np.int64))
    assert multiples_of(codes, shifts).tolist() == some


def test_rounding_noise_is_coded_as_products() -> None:
    counts = np.array([0, 1, -1, 500, -77, 3, 1234], np.int64)
    grid = Grid(GridKind.GENERAL, 6)
    ordinals = of_products(counts, DEGREE * 2.0**-60, 3, grid)
    found = find_degrees(ordinals, grid)
    assert found is not None
    assert (of_products(found[2], found[0], found[1], grid) == ordinals).all()
    assert find_degrees(grid.ordinals(np.array([1e-14, 0.5]))[0], grid) is None
    assert find_degrees(np.array([-1, 5]), grid) is None  # -0 is no product


@given(st.lists(st.integers(-3, 3) | st.just(-1), min_size=1), st.integers(1, 15))
def test_what_products_say_comes_back(some: list[int], digits: int) -> None:
    grid = Grid(GridKind.GENERAL, digits)
    ordinals = np.array(some, np.int64)  # zeros of both signs, and the least numbers
    found = find_degrees(ordinals, grid)
    if found is not None:
        unit, shifts, codes = found
        assert of_products(codes, unit, shifts, grid).tolist() == some
    assert found is None or -1 not in some


def test_products_need_version_1_and_a_decimal_grid() -> None:
    grid = Grid(GridKind.GENERAL, 6)
    column = of_products(np.array([[0, 1, -1, 500, -77, 3]]).T[:, 0], DEGREE * 2.0**-60, 4, grid)
    stream = streams.build_stream(column[:, None], [(grid, grid)], 0, None, 1)
    assert stream[1] == heads.PRODUCTS
    assert (streams.parse_stream(stream, [grid], 6, version=1)[0][:, 0] == column).all()
    with pytest.raises(FormatError, match="form 33"):
        streams.parse_stream(stream, [grid], 6, version=0)
    with pytest.raises(FormatError, match="form 33"):
        streams.parse_stream(stream, [Grid(GridKind.FIXED, 4)], 6, version=1)
