"""Preset ``mdtt``, and what it shares with pca-rdo: bounds, ranks, odd clips, hostile bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import mcz
from mcz.codecs import basis_models
from mcz.kinematics import point_names
from mcz.motion import Signal
from mcz.reading.sizes import clip_sizes
from tests.codecs.lossy import (
    Direct,
    amc,
    decoded,
    markers,
    saved,
    wandering,
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
    found = decoded(codec, motion, step=step, coder=coder, window=window, **ALL)
    assert root_mean_square(found - motion.values) <= BOUND * step + 1e-9


@given(st.sampled_from(NAMES), st.integers(1, 200), st.integers(1, 6), st.floats(-3, 6))
def test_what_is_cut_costs_no_more_than_it_saves(codec, n_frames, n_markers, power) -> None:
    """What does not pay is left out: errors grow by no more than bytes shrink."""
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
                decoded(codec, motion, step=0.02, window=60, **(ALL | {name: n})) - motion.values
            )
            for n in settings
        ]
        assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0] / 4


def test_ranks_are_those_of_the_motion() -> None:
    """Markers that move along few directions have as many vectors."""
    random = np.random.default_rng(3)
    courses = np.cumsum(np.cumsum(random.normal(size=(600, 2)), axis=0), axis=0)
    values = np.einsum("fk,kpd->fpd", courses, random.normal(size=(2, 20, 3)))
    motion = markers(600, 20)
    motion = replace(motion, signals=(Signal(values.reshape(600, 60)),))
    coded = Direct("mdtt", motion, step=0.01)
    bases = basis_models.parse_bases(coded.models[0][0].data)
    assert [len(basis.entries) for basis in bases] == [2, 2, 2]
    assert root_mean_square(coded.read() - values.reshape(600, 60)) < 0.02


# Clips


@pytest.mark.parametrize("codec", NAMES)
def test_a_clip_of_channels_becomes_places(codec) -> None:
    motion = wandering(60, ["tx", "ty", "tz", "rx", "ry", "rz"])
    with mcz.open(saved(codec, motion, step=0.001, virtual_markers=True)) as file:
        clip = file.only_clip()
        n_points = len(point_names(motion.skeleton))
        assert len(clip.skeleton.joints) == n_points + 3 * len(motion.skeleton.joints)
        found = mcz.positions(clip.motion())[:, :n_points]
    np.testing.assert_allclose(found, mcz.positions(motion), atol=0.01)


@pytest.mark.parametrize("codec", NAMES)
def test_too_many_channels(codec) -> None:
    with pytest.raises(mcz.MotionError, match="at most 2048"):
        saved(codec, markers(2, 2100))


# Real clips


@pytest.mark.real
@pytest.mark.parametrize(("name", "most"), [("17_10", 21_600), ("49_02", 11_400)])
def test_bytes_of_real_clips(data: Path, name: str, most: int) -> None:
    """Models counted; lsdt-clip, whose bases are well known, has to write none."""
    with mcz.open(saved("mdtt", amc(data, name), mean_error_cm=0.2)) as file:
        sizes = clip_sizes(file.container, file.only_clip())
        reached = float(file.only_clip().quality["mean_position_error_cm"])
    assert 0.19 <= reached <= 0.2
    assert sizes.models > 1000 and sizes.payload + sizes.overhead + sizes.models < most
