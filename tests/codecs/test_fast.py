"""Codec fast: numbers with a unit behind floats, integers of all sizes, one number changed."""

from __future__ import annotations

import io
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs.coding.forms.counts import Law
from mcz.codecs.coding.forms.units import DEGREE, of_multiples, of_products
from mcz.container.caches import DecodedCache
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.sources import FORMATS
from tests.codecs.lossy import encode_file

BINARY32, SIX = Grid(GridKind.BINARY32), Grid(GridKind.GENERAL, 6)
VOLT = 10 / 65535  # of a converter of 16 bits
FORCE = Skeleton((Joint("plate", channels=(Channel("", "force", "V"),)),))


def hidden() -> dict[str, tuple[Grid, np.ndarray, int]]:
    """Columns that are small integers in disguise: grid, ordinals, bytes that best takes."""
    random = np.random.default_rng(3)
    walk = 32768 + random.integers(-40, 41, 500).cumsum()
    few, some = random.integers(-2000, 2000, 500), random.integers(-500, 500, 500)
    near = walk - 32768
    moved = Law(VOLT, -0.31).ordinals(walk)
    off = moved.copy()
    off[::7] += 1
    off[100] = 0
    noise = np.cumsum(random.normal(size=500)).astype(np.float32).astype(float)
    return {
        "counts": (BINARY32, Law(VOLT).ordinals(walk), 475),
        "moved counts": (BINARY32, moved, 465),
        # Once rounded between 4 and 8, once more near 0.
        "twice moved": (BINARY32, Law(VOLT, 0.0, -5.0087).ordinals(walk), 475),
        # Between counts, near 0: a law without an offset is tried before, and does not fit.
        "beside zero": (BINARY32, Law(VOLT, 2.9925230965, -2.9923552871).ordinals(near), 475),
        "shifted": (BINARY32, Law(7.6296273e-08, None, -0.0024).ordinals(walk), 475),
        "thirds": (BINARY32, Law(1 / 3, 1e4).ordinals(walk), 465),
        "off by a little": (BINARY32, off, 585),
        "multiples": (BINARY32, of_multiples(few, 0.0833333358168602), 810),
        "too large": (BINARY32, of_multiples(np.resize([0, 1, 3, 5, 2], 500), 2.0**81), 315),
        "degrees": (SIX, of_products(some, DEGREE * 2.0**-60, 4, SIX), 685),
        "noise": (BINARY32, BINARY32.ordinals(noise)[0], 1500),
    }


HIDDEN = hidden()


@pytest.mark.parametrize("name", HIDDEN)
def test_what_a_column_hides_is_coded(name: str) -> None:
    grid, ordinals, most = HIDDEN[name]
    values = grid.values(ordinals)
    motion = Motion(FORCE, (Signal(values[:, None], (grid,)),))
    for codec in ("fast", "best"):
        data = encode_file(codec, motion)
        with mcz.open(data) as file:
            clip = file.only_clip()
            plainly = 1.11 if codec == "fast" else 1.02  # codes take a bit at least; heads
            assert sum(row.size for row in clip.signals[0].rows) < most * plainly
            assert clip.read()[:, 0].tobytes() == values.tobytes()


def test_frames_are_the_same_without_those_behind_them() -> None:
    """A part of a segment is decoded up to its end where whole segments do not stay in a cache."""
    columns = {n: grid.values(o) for n, (grid, o, _) in HIDDEN.items() if grid == BINARY32}
    columns["steps"] = np.repeat([0.0, 2.5, -1e30, 7.0], 125)
    columns["constant"] = np.full(500, 0.125)
    columns["copy"] = columns["counts"]
    spike = columns["counts"].copy()
    spike[[0, 100, 101, 400]] = 1e30, -0.0, 3e-40, 2.0
    columns["spike"] = spike
    channels = tuple(Channel("", name.replace(" ", "_"), "V") for name in columns)
    values = np.stack(list(columns.values()), axis=1).astype(np.float32).astype(float)
    motion = Motion(
        Skeleton((Joint("plate", channels=channels),)),
        (Signal(values, (BINARY32,) * len(columns)),),
    )
    with mcz.open(encode_file("fast", motion, segment_frames=200)) as file:
        file.container.runs = cache = DecodedCache(0)
        clip = file.only_clip()
        for start in [*range(0, 500, 41), *range(0, 500, 7)]:
            for stop in (start + 1, min(start + 64, 500), 500):
                assert clip.read((start, stop)).tobytes() == values[start:stop].tobytes()
        assert cache._share < 0.5


def test_integers_beyond_any_float() -> None:
    values = np.array([[2**53], [-(2**53)], [0]], np.int64)
    with mcz.open(encode_file("fast", Motion(FORCE, (Signal(values),)))) as file:
        np.testing.assert_array_equal(file.only_clip().read(), values)


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
    mcz.write(motion.with_values(values), out, codec="fast")
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
