"""Preset ``awt``: the allocation that annealing finds, and the published figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.codecs.contract import SignalSource
from mcz.codecs.wavelet import awt as choice
from mcz.codecs.wavelet.awt import CODEC
from mcz.codecs.wavelet.wavelet import transform_of
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tests.codecs.lossy import encode_file, random_walks
from tests.motions import smooth

KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx"]), min_size=1, max_size=5)
NEAR = 1.001  # of the least distortion there is: where annealing ends


def source_of(motion: Motion) -> SignalSource:
    return MemorySource(motion, 0, CODEC, 2**26)


def choose_coefficients(
    motion: Motion, average: float, **changes: Any
) -> tuple[choice.Choice, list]:
    source = source_of(motion)
    bands = choice.coefficients_of(source, transform_of(source.layout, "db2", 3))
    given_ = {"whole_approximation": False, "iterations": None, "seed": 0} | changes
    weights = given_.pop("weights", np.ones(source.layout.n_channels))
    return choice.choose(bands, weights, average, **given_), bands


def least_distortion(bands: list, kept: int) -> float:
    """Distortion of the global largest coefficients, relative as in ``Choice``."""
    sizes = np.abs(np.concatenate(bands))
    energies = np.sort((sizes / (sizes.max() or 1.0)).ravel() ** 2)
    return float(energies[: max(0, sizes.size - kept)].sum())


# The allocation


@given(st.integers(1, 150), KINDS, st.floats(0.5, 200), st.booleans(), st.integers(0, 2**31 - 1))
def test_annealing_ends_near_the_optimum(n_frames, kinds, average, whole, seed) -> None:
    motion = random_walks(n_frames, kinds)
    found, bands = choose_coefficients(motion, average, whole_approximation=whole, seed=seed)
    assert found.after <= found.before + 1e-12
    assert found.after <= NEAR * least_distortion(bands, int(found.counts.sum())) + 1e-9
    n_each = sum(map(len, bands))
    assert abs(int(found.counts.sum()) - min(average, n_each) * len(kinds)) <= 1
    kept, sizes = np.concatenate(found.kept), np.abs(np.concatenate(bands))
    free = slice(len(bands[0]) if whole else 0, None)
    assert kept[: free.start].all()
    if not whole:
        np.testing.assert_array_equal(kept.sum(axis=0), found.counts)
    for column in range(len(kinds)):  # the largest are kept
        mask, own = kept[free, column], sizes[free, column]
        assert own[mask].min(initial=np.inf) >= own[~mask].max(initial=0.0)


def test_annealing_is_deterministic_and_needs_its_seed() -> None:
    motion = random_walks(400, ["tx", "rx", "ry", "rz"] * 8)
    first, _ = choose_coefficients(motion, 30, seed=7, iterations=3000)
    again, _ = choose_coefficients(motion, 30, seed=7, iterations=3000)
    other, _ = choose_coefficients(motion, 30, seed=8, iterations=3000)
    np.testing.assert_array_equal(first.counts, again.counts)
    assert (first.counts != other.counts).any()
    assert encode_file("awt", motion, seed=3) == encode_file("awt", motion, seed=3)


# What is coded


def test_positions_are_better_for_it() -> None:
    motion = smooth(400)
    errors = []
    for distortion in ("positions", "channels"):
        with mcz.open(encode_file("awt", motion, a_w=40, distortion=distortion)) as file:
            quality = file.only_clip().quality
        errors.append(float(quality["mean_position_error_cm"]))
    assert errors[0] < errors[1]
