"""Presets ``mdtt`` and ``pca-rdo``: bounds, ranks, mean and courses, odd clips."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import mcz
from mcz.codecs.basis_models import Basis, parse_bases
from mcz.codecs.space import COURSES
from mcz.codecs.spatial.windows import WindowsHeader
from mcz.files.reading.sizes import clip_sizes
from mcz.kinematics.points import point_names
from mcz.model.motion import Signal
from mcz.model.schema import parse
from tests.codecs.lossy import (
    Direct,
    amc,
    bytes_of,
    encode_and_decode,
    encode_file,
    markers,
    random_walks,
)

NAMES = ["mdtt", "pca-rdo"]
CODERS = st.sampled_from(["mixed", "prefix"])
KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx", "length"]), min_size=1, max_size=5)
ALL = {"rank": 2048, "frequencies": 2048}  # nothing is cut
BOUND = 0.8  # of a step: the threshold, and what rounding the bases may add


def root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# Bounds


@given(
    st.sampled_from(NAMES),
    st.integers(1, 130),
    st.integers(1, 6),
    st.floats(-3, 6),
    CODERS,
    st.integers(1, 40),
)
@example("pca-rdo", 1, 1, 0.0, "prefix", 1)
@example("mdtt", 2, 1, 0.0, "mixed", 1)
def test_without_cuts_a_coefficient_loses_at_most_the_threshold(
    codec, n_frames, n_markers, power, coder, window
) -> None:
    """Bases are nearly orthogonal: an error of all frames is that of the coefficients."""
    motion = markers(n_frames, n_markers)
    step = 2.0**power
    decoded = encode_and_decode(codec, motion, step=step, coder=coder, window=window, **ALL)
    assert root_mean_square(decoded - motion.values) <= BOUND * step + 1e-9


@given(st.sampled_from(NAMES), st.integers(1, 200), st.integers(1, 6), st.floats(-3, 6))
def test_what_is_cut_costs_no_more_than_it_saves(codec, n_frames, n_markers, power) -> None:
    """Cutting coefficients increases the error less than it decreases the size."""
    motion = markers(n_frames, n_markers)
    step = 2.0**power
    cut, whole = (Direct(codec, motion, step=step, window=24, **p) for p in ({}, ALL))
    errors = [float(np.sum((c.read() - motion.values) ** 2)) / step**2 for c in (cut, whole)]
    sizes = [c.n_bytes + sum(len(m.data) for m in c.models[0]) for c in (cut, whole)]
    assert errors[0] + 8 * 0.2 * sizes[0] <= 1.2 * (errors[1] + 8 * 0.2 * sizes[1]) + 16


@pytest.mark.parametrize("codec", NAMES)
def test_a_higher_rank_errs_less(codec) -> None:
    motion = markers(300, 6)
    for name, settings in (
        ("rank", (1, 2, 3, 6)),
        ("frequencies", (1, 4, 16, 60)),
    ):
        errors = [
            root_mean_square(
                encode_and_decode(codec, motion, step=0.02, window=60, **(ALL | {name: n}))
                - motion.values
            )
            for n in settings
        ]
        assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0] / 4


def bases_of(coded: Direct) -> tuple[Basis, ...]:
    return parse_bases(coded.models[0][0].data)


def moving_markers(courses: np.ndarray, n_markers: int = 20, seed: int = 3) -> mcz.Motion:
    """Markers that all move as ``courses`` (n_frames, n_courses) say, along random directions."""
    directions = np.random.default_rng(seed).normal(size=(courses.shape[1], 3 * n_markers))
    values = courses @ directions + 30 * np.arange(3.0 * n_markers)
    return replace(markers(len(courses), n_markers), signals=(Signal(values),))


@pytest.mark.parametrize("codec", NAMES)
def test_ranks_are_those_of_the_motion(codec: str) -> None:
    """Markers that move along few directions have as many vectors."""
    random = np.random.default_rng(3)
    motion = moving_markers(np.cumsum(np.cumsum(random.normal(size=(600, 2)), axis=0), axis=0))
    coded = Direct(codec, motion, step=0.01)
    bases = bases_of(coded)
    assert root_mean_square(coded.read() - motion.values) < 0.02
    if codec == "mdtt":
        assert [len(basis.entries) for basis in bases] == [3, 3, 3]  # and one of what rests
        return
    spatial, courses, mean = bases
    assert spatial.entries.shape == (2, 60) and mean.entries.shape == (1, 60)
    np.testing.assert_allclose(mean.vectors[0], motion.values.mean(axis=0), atol=0.01)
    assert len(courses.entries) <= courses.entries.shape[1] <= 120


# Mean and courses of pca-rdo


def test_courses_are_as_many_as_shapes_in_time() -> None:
    """Every window of 60 frames is a mixture of three waves, none of them a cosine."""
    random = np.random.default_rng(4)
    shapes = 20 * np.sign(np.sin(np.outer([0.21, 0.55, 0.9], np.arange(60)) + 0.3))
    motion = moving_markers(
        (random.normal(size=(40, 2, 3)) @ shapes).swapaxes(1, 2).reshape(2400, 2)
    )
    coded = Direct("pca-rdo", motion, step=0.1, window=60)
    _, courses, _ = bases_of(coded)
    assert len(courses.entries) <= 5  # rounding may add one or two
    assert root_mean_square(coded.read() - motion.values) < 0.15
    plain = Direct("mdtt", motion, step=0.1, window=60)
    assert coded.n_bytes < 0.7 * plain.n_bytes


def test_a_short_window_has_cosines() -> None:
    """It is as good as the others."""
    motion = markers(240 + 37, 6)
    error = np.abs(encode_and_decode("pca-rdo", motion, step=0.05, window=120) - motion.values)
    assert error[240:].mean() < 1.5 * error[:240].mean()


@pytest.mark.parametrize("window", [1024, 1025])
def test_long_windows_have_all_courses_or_none(window) -> None:
    motion = markers(window + 3, 1)
    coded = Direct("pca-rdo", motion, step=0.01, window=window)
    flags = parse(WindowsHeader, coded.header, "header").space.flags
    assert bool(flags & COURSES) == (window <= 1024)
    assert root_mean_square(coded.read() - motion.values) < 0.01


def test_places_far_away() -> None:
    """A mean that no integer has is left to coefficients."""
    motion = markers(50, 3)
    for away in (1e6, 1e9, 1e13):
        values = motion.values + away
        step = max(0.1, away * 1e-8)
        decoded = encode_and_decode(
            "pca-rdo", replace(motion, signals=(Signal(values),)), step=step
        )
        assert np.abs(decoded - values).max() < 3 * step
    values = motion.values + 1e6
    decoded = encode_and_decode("pca-rdo", replace(motion, signals=(Signal(values),)), step=1e-6)
    assert np.abs(decoded - values).max() < 1e-5


# Clips


@pytest.mark.parametrize("codec", NAMES)
def test_a_clip_of_channels_becomes_places(codec) -> None:
    motion = random_walks(60, ["tx", "ty", "tz", "rx", "ry", "rz"])
    with mcz.open(encode_file(codec, motion, step=0.001, virtual_markers=True)) as file:
        clip = file.only_clip()
        n_points = len(point_names(motion.skeleton))
        assert len(clip.skeleton.joints) == n_points + 3 * len(motion.skeleton.joints)
        decoded = mcz.positions(clip.motion())[:, :n_points]
    np.testing.assert_allclose(decoded, mcz.positions(motion), atol=0.01)


@pytest.mark.parametrize("codec", NAMES)
def test_too_many_channels(codec) -> None:
    with pytest.raises(mcz.MotionError, match="exceed the 2048 of a matrix"):
        encode_file(codec, markers(2, 2100))


# Real clips


@pytest.mark.real
@pytest.mark.parametrize(("name", "most"), [("17_10", 21_600), ("49_02", 11_400)])
def test_bytes_of_real_clips(data: Path, name: str, most: int) -> None:
    """Models counted; lsdt-clip, whose bases are well known, has to write none."""
    with mcz.open(encode_file("mdtt", amc(data, name), mean_error_cm=0.2)) as file:
        sizes = clip_sizes(file.container, file.only_clip())
        reached = float(file.only_clip().quality["mean_position_error_cm"])
    assert 0.19 <= reached <= 0.2
    assert sizes.models > 1000 and sizes.payload + sizes.overhead + sizes.models < most


@pytest.mark.real
def test_positions_are_the_better_domain(data: Path) -> None:
    """At the same mean position error they take less than channels do."""
    sizes = {}
    for domain in ("positions", "channels"):
        held = encode_file("pca-rdo", amc(data, "49_02"), mean_error_cm=0.2, domain=domain)
        with mcz.open(held) as file:
            found = clip_sizes(file.container, file.only_clip())
        sizes[domain] = found.payload + found.overhead + found.models
        assert found.models > 1000 and bytes_of(held) < sizes[domain]
    assert sizes["positions"] < 0.8 * sizes["channels"]
