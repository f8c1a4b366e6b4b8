"""Codec 1, ``lossless``: its tables, multiples of a unit, products of degrees."""

from __future__ import annotations

import io
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.coding.logistic import NODES, squash_table, stretch_table
from mcz.coding.ordinals.degrees import DEGREE, codes_of, find_degrees, multiples_of, of_products
from mcz.coding.ordinals.units import find_unit, of_multiples
from mcz.formats import FORMATS
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind
from tests.codecs.coders import LOSSLESS


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
    stream = LOSSLESS.coded(ordinals[:, None], Grid(GridKind.BINARY32))
    out = LOSSLESS.decoded(stream, len(counts), 1, Grid(GridKind.BINARY32))
    np.testing.assert_array_equal(out[:, 0], ordinals)


def test_a_unit_beyond_all_that_a_head_may_have_is_none() -> None:
    ordinals = of_multiples(np.array([0, 1, 3, 5, 2]), 2.0**81)
    assert find_unit(ordinals) is None
    stream = LOSSLESS.coded(ordinals[:, None], Grid(GridKind.BINARY32))
    out = LOSSLESS.decoded(stream, 5, 1, Grid(GridKind.BINARY32))
    np.testing.assert_array_equal(out[:, 0], ordinals)


def test_scaled_integers_are_found_among_floats() -> None:
    counts = np.random.default_rng(5).integers(-2000, 2000, 800)
    ordinals = of_multiples(counts, 0.0833333358168602)
    as_integers = LOSSLESS.coded(counts[:, None], Grid(GridKind.INTEGER))
    as_floats = LOSSLESS.coded(ordinals[:, None], Grid(GridKind.BINARY32))
    assert len(as_floats) <= len(as_integers) + 12


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
