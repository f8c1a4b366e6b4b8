"""Counts of a converter, printed as decimals: forms with a unit on GENERAL grids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.codecs.coding.fast.decoder import Shape, read_alone
from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.codecs.coding.forms import BINARY32, COUNTS, MULTIPLES
from mcz.codecs.coding.forms.count_search import VANISHING, find_counts
from mcz.codecs.coding.forms.counts import Law, bounds
from mcz.codecs.coding.forms.units import find_units
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from tests.codecs.lossy import encode_file
from tests.commands import run

SIX = Grid(GridKind.GENERAL, 6)
PLATES = Skeleton((Joint("plate", channels=(Channel("", "force", "V"),)),))
SCALES = st.floats(1e-4, 10.0) | st.sampled_from([0.1, 0.1221, 10 / 65535, 2.0**-12])


@st.composite
def count_series(draw: st.DrawFn) -> np.ndarray:
    """Noise, walks, or few values that change often."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    reach = draw(st.sampled_from([1, 2, 20, 500]))
    noise = random.integers(-reach, reach + 1, draw(st.integers(150, 700)))
    return noise if draw(st.booleans()) else noise.cumsum() // 7


@given(count_series(), SCALES, st.integers(5, 15), st.data())
def test_printed_counts_are_found(
    counts: np.ndarray, scale: float, digits: int, data: st.DataObject
) -> None:
    offset = data.draw(st.sampled_from([None, VANISHING, 0.31 * scale, -17.25 * scale]))
    grid = Grid(GridKind.GENERAL, digits)
    ordinals = Law(scale, offset).ordinals(counts, grid)
    values = grid.values(ordinals)
    data_bytes = encode_file("fast", Motion(PLATES, (Signal(values[:, None], (grid,)),)))
    with mcz.open(data_bytes) as file:
        assert file.only_clip().read()[:, 0].tobytes() == values.tobytes()


@pytest.mark.parametrize("seed", [385, 2847])
@pytest.mark.parametrize("codec", ["fast", "best"])
def test_zeros_that_a_law_misses(codec: str, seed: int) -> None:
    """Next to nothing in the place of 0 is off by an ordinal that no rest can have."""
    random = np.random.default_rng(seed)
    grid = Grid(GridKind.GENERAL, int(random.integers(6, 16)))
    counts = np.round(random.normal(0, 1, 1200) * 500)
    numbers = (counts * random.uniform(1e-4, 10)).astype(np.float32).astype(np.float64)
    values = grid.values(grid.ordinals(numbers)[0])[:, None]
    with mcz.open(encode_file(codec, Motion(PLATES, (Signal(values, (grid,)),)))) as file:
        assert file.only_clip().read().tobytes() == values.tobytes()


@pytest.mark.parametrize("digits", range(5, 10))
@pytest.mark.parametrize("offset", [None, VANISHING, 0.0375])
def test_laws_are_exact(digits: int, offset: float | None) -> None:
    """No rest is left, whatever the digits; without an offset there are multiples."""
    counts = np.random.default_rng(digits).integers(-400, 401, 600)
    grid = Grid(GridKind.GENERAL, digits)
    counts[0] = 0
    column = Law(0.1221, offset).ordinals(counts, grid)
    units = find_units(column, grid)
    assert units is not None
    assert units.rests is None
    assert units.form == (MULTIPLES if offset is None else COUNTS)
    assert len(np.unique(units.integers)) == len(np.unique(counts))


@pytest.mark.parametrize("values", [[0.1, 0.3, 0.4], [-0.5, 0.0, 1.5], [2.25, 3.5]])
def test_few_values_show_a_law(values: list[float]) -> None:
    column = SIX.ordinals(np.resize(values, 200))[0]
    found = find_counts(column, SIX)
    assert found is not None
    assert not found.rests.any()


def test_numbers_beyond_binary32_are_no_counts() -> None:
    column = SIX.ordinals(np.resize([1e300, -1e300, 0, 2e300], 200))[0]
    assert find_counts(column, SIX) is None


@pytest.mark.parametrize("grids", [(SIX, BINARY32), (BINARY32, SIX), (SIX, SIX)])
def test_the_grid_in_the_clip_counts(grids: tuple[Grid, Grid]) -> None:
    """Ordinals of another grid in force come back, too."""
    counts = np.random.default_rng(1).integers(-400, 401, 600)
    in_clip, in_force = grids
    ordinals = Law(0.1221).ordinals(counts, in_force)[:, None]
    streams = StreamBuilder([in_clip], [[0]]).build(ordinals, (in_force,))
    shape = Shape([in_clip], [[0]])
    np.testing.assert_array_equal(read_alone(shape, streams[0], len(counts)), ordinals)


@given(st.floats(1e-30, 1e30), st.integers(5, 9))
def test_bounds_are_those_of_rounding(x: float, digits: int) -> None:
    grid = Grid(GridKind.GENERAL, digits)
    size = grid.values(grid.ordinals(np.array([float(np.float32(x))]))[0])
    low, high = bounds(size, grid)
    assert low[0] <= x <= high[0]
    within, beyond = (high - low) * 1e-9, (high - low) * 1e-3
    for number, is_same in [
        (low + within, True),
        (high - within, True),
        (low - beyond, False),
        (high + beyond, False),
    ]:
        rounded = number.astype(np.float32).astype(float)
        assert (grid.values(grid.ordinals(rounded)[0]) == size).all() == is_same


def test_a_file_of_vicon_is_small_and_comes_back(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    scales = np.array([0.12210012, 0.0012210012, 0.00048840049])
    noise = random.integers(-300, 301, (1500, 3)) * np.array([0.03, 1, 1])
    table = (np.rint(noise) * -scales).astype(np.float32)
    lines = ["Devices", "1000", ",,Force - F1,Volt - V1,Volt - V2"]
    lines += ["Frame,Sub Frame,F1,V1,V2", ",,N,V,V"]
    for k, row in enumerate(table.tolist()):
        lines.append(f"{1 + k // 10},{k % 10}," + ",".join(f"{x:g}" for x in row))
    lines += ["", "Trajectories", "100", ",,S:A,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm"]
    lines += [f"{k},0,{k / 7:.5g},2.5,{9 - k / 3:.5g}" for k in range(1, 151)]
    text = ("\n".join(lines) + "\n").encode()
    source, packed, back = (tmp_path / name for name in ("a.csv", "a.mcz", "b.csv"))
    source.write_bytes(text)
    assert b",-0," in text
    assert run("encode", source, "-o", packed, "--codec", "fast") == 0
    assert packed.stat().st_size < 6000  # 5 and twice 10 bits a row
    assert run("decode", packed, "-o", back) == 0
    assert back.read_bytes() == text
