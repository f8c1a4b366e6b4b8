"""Preset ``pca-rdo``: mean, components and courses. See test_mdtt.py for what both share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.codecs import basis_models
from mcz.codecs.space import COURSES
from mcz.codecs.spatial.windows import WindowsHeader
from mcz.motion import Signal
from mcz.reading.sizes import clip_sizes
from mcz.schema import parse
from tests.codecs.lossy import Direct, amc, bytes_of, decoded, markers, saved

NAME = "pca-rdo"


def bases_of(coded: Direct) -> tuple[basis_models.Basis, ...]:
    return basis_models.parse_bases(coded.models[0][0].data)


def moving(courses: np.ndarray, n_markers: int = 20, seed: int = 3) -> mcz.Motion:
    """Markers that all move as ``courses`` (n_frames, n_courses) say, along random directions."""
    directions = np.random.default_rng(seed).normal(size=(courses.shape[1], 3 * n_markers))
    values = courses @ directions + 30 * np.arange(3.0 * n_markers)
    return replace(markers(len(courses), n_markers), signals=(Signal(values),))


def test_components_are_as_many_as_directions() -> None:
    random = np.random.default_rng(3)
    motion = moving(np.cumsum(np.cumsum(random.normal(size=(600, 2)), axis=0), axis=0))
    coded = Direct(NAME, motion, step=0.01)
    spatial, courses, mean = bases_of(coded)
    assert spatial.entries.shape == (2, 60) and mean.entries.shape == (1, 60)
    np.testing.assert_allclose(mean.vectors[0], motion.values.mean(axis=0), atol=0.01)
    assert len(courses.entries) <= courses.entries.shape[1] <= 120
    assert np.sqrt(np.mean((coded.read() - motion.values) ** 2)) < 0.02


def test_courses_are_as_many_as_shapes_in_time() -> None:
    """Every window of 60 frames is a mixture of three waves, none of them a cosine."""
    random = np.random.default_rng(4)
    shapes = 20 * np.sign(np.sin(np.outer([0.21, 0.55, 0.9], np.arange(60)) + 0.3))
    motion = moving((random.normal(size=(40, 2, 3)) @ shapes).swapaxes(1, 2).reshape(2400, 2))
    coded = Direct(NAME, motion, step=0.1, window=60)
    _, courses, _ = bases_of(coded)
    assert len(courses.entries) <= 5  # rounding may add one or two
    assert np.sqrt(np.mean((coded.read() - motion.values) ** 2)) < 0.15
    plain = Direct("mdtt", motion, step=0.1, window=60)
    assert coded.n_bytes < 0.7 * plain.n_bytes


def test_a_short_window_has_cosines() -> None:
    """It is as good as the others."""
    motion = markers(240 + 37, 6)
    error = np.abs(decoded(NAME, motion, step=0.05, window=120) - motion.values)
    assert error[240:].mean() < 1.5 * error[:240].mean()


@pytest.mark.parametrize("window", [1024, 1025])
def test_long_windows_have_all_courses_or_none(window) -> None:
    motion = markers(window + 3, 1)
    coded = Direct(NAME, motion, step=0.01, window=window)
    flags = parse(WindowsHeader, coded.header, "header").space.flags
    assert bool(flags & COURSES) == (window <= 1024)
    assert np.sqrt(np.mean((coded.read() - motion.values) ** 2)) < 0.01


def test_places_far_away() -> None:
    """A mean that no integer has is left to coefficients."""
    motion = markers(50, 3)
    for away in (1e6, 1e9, 1e13):
        values = motion.values + away
        step = max(0.1, away * 1e-8)
        found = decoded(NAME, replace(motion, signals=(Signal(values),)), step=step)
        assert np.abs(found - values).max() < 3 * step
    values = motion.values + 1e6
    found = decoded(NAME, replace(motion, signals=(Signal(values),)), step=1e-6)
    assert np.abs(found - values).max() < 1e-5


@pytest.mark.real
def test_positions_are_the_better_domain(data: Path) -> None:
    """At the same mean position error they take less than channels do."""
    sizes = {}
    for domain in ("positions", "channels"):
        held = saved(NAME, amc(data, "49_02"), mean_error_cm=0.2, domain=domain)
        with mcz.open(held) as file:
            found = clip_sizes(file.container, file.only_clip())
        sizes[domain] = found.payload + found.overhead + found.models
        assert found.models > 1000 and bytes_of(held) < sizes[domain]
    assert sizes["positions"] < 0.8 * sizes["channels"]
