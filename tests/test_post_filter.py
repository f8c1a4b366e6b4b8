"""The post filter: as SPEC.md writes it, at once, row by row, of motions."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import mcz
from mcz.codecs.transforms.post_filter import CUTOFFS, DELAY, SCALE, PostFilter, filter_rows
from mcz.codecs.transforms.post_filter import filter_taps as taps_of
from mcz.errors import MotionError, OptionError
from mcz.files.reading.post_filtering import FilteredClip
from mcz.model.motion import Channel, Motion, Signal
from mcz.sources.sample import acclaim_walk, marker_walk
from tests.motions import write_bytes
from tests.plain_post_filter import plain_rows, plain_taps

ROOT = Path(__file__).parents[1]
SECTION = (ROOT / "SPEC.md").read_text("utf-8").split("\n## Post filter\n")[1].split("\n## ")[0]
ANNEX = ROOT / "conformance/annex/post_filter.json"

SETTINGS = st.tuples(
    st.sampled_from([120.0, 30.0, 30000 / 1001, 240.0, 7.0, 1e-3, 1e9]),
    st.sampled_from([0.1, 1.0, 2.54, 1e-6, 1e6]),
)
NUMBERS = st.one_of(
    st.floats(-1e3, 1e3),
    st.integers(-50, 50).map(float),
    st.floats(allow_nan=False),
    st.just(np.nan),
)


@st.composite
def tables(draw: st.DrawFn) -> np.ndarray:
    """Rows of places: any numbers, or steps of a coarse quantizer with runs of unknown ones."""
    shape = draw(st.integers(0, 70)), draw(st.integers(0, 4))
    if draw(st.booleans()):
        return draw(arrays(np.float64, shape, elements=NUMBERS))
    noise = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    step = draw(st.sampled_from([0.01, 1.0, 30.0]))
    rows = np.rint(np.cumsum(noise.normal(size=shape), axis=0) / step) * step
    for _ in range(draw(st.integers(0, 3)) if rows.size else 0):
        start, column = draw(st.integers(0, shape[0] - 1)), draw(st.integers(0, shape[1] - 1))
        rows[start : start + draw(st.integers(1, 20)), column] = np.nan
    return rows


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """True if the bits are the same, with all NaNs equal."""
    one, other = np.asarray(one), np.asarray(other)
    bits = np.where(np.isnan(one), 0, one.view(np.int64))
    return bool(
        one.shape == other.shape
        and np.array_equal(np.isnan(one), np.isnan(other))
        and np.array_equal(bits, np.where(np.isnan(other), 0, other.view(np.int64)))
    )


def filter_stream(stream: PostFilter, rows: np.ndarray) -> np.ndarray:
    out = [stream.push(row) for row in rows]
    assert [row is None for row in out] == [n < DELAY for n in range(len(rows))]
    return np.concatenate([*(row[None] for row in out if row is not None), stream.finish()])


@given(tables(), SETTINGS)
def test_the_text_says_what_is_computed(rows: np.ndarray, settings: tuple[float, float]) -> None:
    assert same(filter_rows(rows, *settings), plain_rows(rows, *settings))


@given(tables(), tables(), SETTINGS)
@example(np.full((5, 2), 3.0), np.zeros((0, 2)), (120.0, 1.0))
def test_row_by_row_is_the_same(
    rows: np.ndarray, more: np.ndarray, settings: tuple[float, float]
) -> None:
    stream = PostFilter(rows.shape[1], *settings)
    assert same(filter_stream(stream, rows), filter_rows(rows, *settings))
    more = np.resize(more, (len(more), rows.shape[1])) if more.size else rows[:3]
    assert same(filter_stream(stream, more), filter_rows(more, *settings))  # it is as new


def test_each_filter_is_used() -> None:
    """Errors of prediction up to the first threshold, up to the second, and above it."""
    for jump, cutoff in ((1.0, 0), (50.0, 1), (500.0, 2)):  # mm
        rows = np.zeros((30, 1))
        rows[1] = jump
        side = taps_of(120.0)[cutoff] / SCALE
        first = taps_of(120.0)[0, 1] / SCALE * jump  # row 0 goes through the first filter
        assert filter_rows(rows, 120.0, 0.1)[0, 0] == first
        meant = plain_rows(rows, 120.0, 0.1)[1, 0]
        assert meant == pytest.approx(jump * (1 - 2 * side[1:].sum()), rel=1e-12)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_bad_settings(rate: float) -> None:
    with pytest.raises(OptionError, match="not a valid rate"):
        taps_of(rate)
    with pytest.raises(OptionError, match="length unit"):
        filter_rows(np.zeros((3, 3)), 120.0, rate)
    with pytest.raises(MotionError, match="row has shape"):
        PostFilter(3, 120.0, 1.0).push(np.zeros(4))


def test_the_annex_has_the_taps() -> None:
    annex = json.loads(ANNEX.read_text("utf-8"))
    assert len(annex) == int(re.search(r"(\d+)\s+frame rates", SECTION)[1])
    for text, filters in annex.items():
        rate = Fraction(text)
        taps = taps_of(rate.numerator / rate.denominator).tolist()
        assert filters == {f"{c:g}": row for c, row in zip(CUTOFFS, taps, strict=True)}
        assert all(row[0] + 2 * sum(row[1:]) == SCALE for row in taps)
        plain = [plain_taps(cutoff, rate.numerator / rate.denominator) for cutoff in CUTOFFS]
        assert [[tap / SCALE for tap in row] for row in taps] == plain


def test_taps_are_those_of_the_window_method() -> None:
    k = np.arange(-DELAY, DELAY + 1)
    for row, cutoff in zip(taps_of(120.0), CUTOFFS, strict=True):
        f = cutoff / 120
        meant = 2 * f * np.sinc(2 * f * k) * (0.54 + 0.46 * np.cos(2 * np.pi * k / 25))
        found = np.concatenate((row[:0:-1], row)) / SCALE
        np.testing.assert_allclose(found, meant / meant.sum(), rtol=0, atol=20 / SCALE)


# Motions


def walk(**changes) -> Motion:
    """Markers with some gaps, roughly quantized."""
    motion = marker_walk()
    first = motion.signals[0]
    assert first.mask is not None
    mask = first.mask.copy()
    mask[10:14, :3] = False
    signal = Signal(np.rint(first.values / 30) * 30, mask=mask)
    return replace(motion, signals=(signal, *motion.signals[1:]), source=None, **changes)


def test_motions() -> None:
    motion = walk()
    made = mcz.post_filter(motion)
    signal, first = made.signals[0], motion.signals[0]
    meant = plain_rows(first.masked(), 120.0, motion.skeleton.unit_cm)
    assert motion.frame_rate == 120
    assert same(signal.masked(), meant)
    assert np.array_equal(signal.values[10:14, :3], first.values[10:14, :3])  # beneath the mask
    assert signal.mask is first.mask
    assert made.signals[1:] == motion.signals[1:]
    assert made.metadata["source-note"].endswith("post-filtered")
    assert made.source is None
    assert not np.array_equal(signal.values, first.values)
    again = mcz.post_filter(made)
    assert again.metadata["source-note"].count("post-filtered") == 2


def test_what_cannot_be_filtered() -> None:
    motion = walk()
    with pytest.raises(MotionError, match="mcz.in_positions"):
        mcz.post_filter(acclaim_walk())
    own = tuple(Channel("", str(c)) for c in range(motion.signals[0].n_channels))
    named = replace(motion.signals[0], channels=own)
    with pytest.raises(MotionError, match="works on markers"):
        mcz.post_filter(replace(motion, signals=(named, *motion.signals[1:])))
    with pytest.raises(OptionError, match="frame rate is unknown.*set the frame rate"):
        mcz.post_filter(replace(motion, frame_rate=None))
    with pytest.raises(OptionError, match="length unit is unknown.*set the unit"):
        mcz.post_filter(replace(motion, skeleton=replace(motion.skeleton, unit_cm=None)))
    given = mcz.post_filter(replace(motion, frame_rate=None), rate=120)
    assert same(given.values, mcz.post_filter(motion).values)
    assert given.frame_rate == 120


def test_parts_are_cut_out_of_the_whole() -> None:
    motion = walk()
    whole = mcz.post_filter(motion)
    rows = whole.signals[0].values
    with mcz.open(write_bytes(motion)) as file:
        clip = FilteredClip(next(iter(file.clips.values())))
        values, mask = clip.read_masked((9, 30), [2, 0])
        columns = [6, 7, 8, 0, 1, 2]
        assert same(values, rows[9:30, columns])
        assert np.array_equal(mask, motion.signals[0].mask[9:30, columns])
        made = clip.motion((9, 30))
        assert same(made.signals[0].values, rows[9:30])
        assert made.metadata == whole.metadata
        with pytest.raises(OptionError, match="frames, not 9:"):
            clip.read_masked((9, 10**6))
        with pytest.raises(MotionError, match="no joint"):
            clip.read_masked(None, ["nobody"])


def test_resolutions_are_filtered_before_they_are_thinned() -> None:
    motion = walk()
    values = motion.signals[0].values[:, 3:12]
    bones = replace(motion.skeleton, joints=motion.skeleton.joints[1:4])
    plain = replace(motion, skeleton=bones, signals=(Signal(values),), frame_numbers=None)
    with mcz.open(write_bytes(plain, codec="mrdwt", T_g=1.0)) as file:
        clip = next(iter(file.clips.values()))
        meant = mcz.post_filter(replace(clip.motion(resolution=2), source=None))
        made = FilteredClip(clip).motion((4, 40), 2, decimate=True)
        assert same(made.values, meant.values[4:40:4])
        assert made.frame_rate == 30
