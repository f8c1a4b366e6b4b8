"""Rotation vectors and quaternions: those that turn alike, along time and in metrics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.exchange.conversion import converted_files
from mcz.kinematics.angles import Unwrapper, unwrap
from mcz.kinematics.metrics.diff_document import joint_errors
from mcz.kinematics.rotations import (
    continuous,
    matrices_of_vectors,
    spins_of_vectors,
    vectors_of_quaternions,
)
from mcz.sources.sample import acclaim_walk
from tests.bodies import turned_by

SIZES = st.sampled_from(
    [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 0.01, 0.09, 0.11, 1.0, 3.0, 6.2, 40.0]
)
SEEDS = st.integers(0, 2**32)


def vectors(seed: int, size: float, n: int = 5) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(3, n))
    return found / np.sqrt((found**2).sum(axis=0)) * size


@given(SEEDS, SIZES)
def test_the_exponential_map_is_scipys(seed: int, size: float) -> None:
    v = vectors(seed, size)
    expected = np.moveaxis(Rotation.from_rotvec(v.T).as_matrix(), 0, 2)
    np.testing.assert_allclose(matrices_of_vectors(v), expected, atol=3e-15 * max(1, size))


@given(SEEDS, SIZES, st.integers(0, 2))
def test_spins_are_slopes(seed: int, size: float, component: int) -> None:
    """Rate of exp(v + h e) exp(v)^-1, (w x) to the first order."""
    v, step = vectors(seed, size), np.zeros((3, 1))
    step[component] = 1e-6
    ends = [Rotation.from_rotvec((v + sign * step).T) for sign in (1, -1)]
    slope = (ends[0] * ends[1].inv()).as_rotvec().T / 2e-6
    np.testing.assert_allclose(spins_of_vectors(v)[:, component], slope, atol=1e-8)


@given(SEEDS, st.floats(0, 3.14159))
def test_the_way_back(seed: int, size: float) -> None:
    v = vectors(seed, size)
    quaternions = Rotation.from_rotvec(v.T).as_quat(scalar_first=True).T
    for sign in (1, -1):
        np.testing.assert_allclose(vectors_of_quaternions(sign * quaternions), v, atol=1e-14)


def spinning_vector(n: int = 200) -> np.ndarray:
    """A vector that goes through two turns about a swaying axis, (3, n)."""
    time = np.linspace(0, 4 * np.pi, n)
    return np.stack([0.1 * np.sin(time / 3), time, 0.2 * np.cos(time / 5)]) + 0.3


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("ends", [[], [1], [7, 8, 90], range(1, 200)])
def test_vectors_follow_each_other(unit: str, ends: list[int]) -> None:
    one = 180 / np.pi if unit == "deg" else 1.0
    smooth = spinning_vector().T
    wrapped = Rotation.from_rotvec(smooth).as_rotvec()
    assert np.abs(np.diff(wrapped, axis=0)).max() > 3
    kinds = ("tx", "vy", "vx", "vz", "vx")
    joints = (Joint("hips", channels=tuple(map(Channel, kinds))),)
    skeleton = Skeleton(joints, angle_unit=unit)
    rows = np.stack([wrapped[:, 0], *wrapped[:, [1, 0, 2]].T * one, wrapped[:, 0]], axis=1)
    follow = Unwrapper(skeleton)
    parts = [follow(part) for part in np.split(rows, list(ends))]
    found = np.concatenate(parts)
    np.testing.assert_allclose(found[:, [2, 1, 3]] / one, smooth, atol=1e-12)
    np.testing.assert_array_equal(found[:, [0, 4]], rows[:, [0, 4]])
    np.testing.assert_allclose(continuous(wrapped.T), smooth.T, atol=1e-12)
    gap = rows.copy()
    gap[50:60, 1] = np.nan
    np.testing.assert_allclose(unwrap(gap, skeleton)[60:, 2] / one, smooth[60:, 0], atol=1e-12)
    unknown = Skeleton(joints, angle_unit="")
    np.testing.assert_array_equal(unwrap(rows, unknown), rows)
    own = [Channel("", str(k)) for k in range(5)]
    np.testing.assert_array_equal(unwrap(rows, skeleton, own), rows)


def test_quaternions_keep_their_sign() -> None:
    smooth = Rotation.from_rotvec(spinning_vector().T).as_quat(scalar_first=True)
    signs = np.where(np.random.default_rng(5).random(200) < 0.5, -1.0, 1.0)
    signs[0] = 1
    skeleton = Skeleton((Joint("hips", channels=tuple(map(Channel, ("qw", "qx", "qy", "qz")))),))
    one = unwrap(smooth, skeleton)
    np.testing.assert_array_equal(unwrap(smooth * signs[:, None], skeleton), one)
    assert (np.abs(np.diff(one, axis=0)) < 0.1).all()


@pytest.mark.parametrize("form", ["rotvec", "quat"])
def test_what_turns_alike_is_no_error(form: str) -> None:
    motion = turned_by(acclaim_walk(), form)
    skeleton, values = motion.skeleton, motion.values.copy()
    for index, joint in enumerate(skeleton.joints):
        columns = [
            column
            for channel, column in zip(joint.channels, skeleton.columns(index), strict=True)
            if channel.kind[:1] in "qv"
        ]
        if columns and form == "quat":
            values[::3, columns] *= -1
        elif columns:
            own = values[::3, columns]
            size = np.sqrt((own**2).sum(axis=1, keepdims=True))
            values[::3, columns] = own * (1 - 2 * np.pi / np.where(size == 0, np.inf, size))
    other = Motion(skeleton, (Signal(values),), motion.frame_rate)
    comparison = mcz.compare(motion, other)
    assert comparison.mse is not None and comparison.mse < 1e-28 and comparison.mse_raw > 0.1
    assert comparison.max_position_error is not None and comparison.max_position_error < 1e-12
    off = Motion(skeleton, (Signal(values + 1e-3),), motion.frame_rate)
    assert mcz.compare(other, off).mse == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.parametrize("radians", [True, False])
def test_the_same_points_whatever_turns(radians: bool) -> None:
    """SPEC.md, "Kinematics": 1e-9 of the size."""
    walk = acclaim_walk()
    places = mcz.positions(walk)
    for form in ("rotvec", "quat"):
        other = turned_by(walk, form, radians=radians)
        assert np.abs(mcz.positions(other) - places).max() < 1e-9 * 18
        np.testing.assert_allclose(
            mcz.rotations(other, "matrix"), mcz.rotations(walk, "matrix"), atol=1e-12
        )


@pytest.mark.parametrize("form", ["rotvec", "quat"])
def test_angles_of_bvh_and_amc(form: str, tmp_path: Path) -> None:
    import pybvh

    motion = turned_by(acclaim_walk(), form)
    for to in ("bvh", "amc"):
        converted = joint_errors(motion, mcz.convert(motion, to))
        assert converted.greatest is not None and converted.greatest < 1e-9 * 18
        assert len(converted.joints) >= motion.skeleton.n_joints - (to == "amc")
    path = tmp_path / "walk.bvh"
    path.write_bytes(converted_files(motion, "bvh")["bvh"])
    other = pybvh.read_bvh_file(path, world_up="+y", warn_on_world_up_disagreement=False)
    ours = mcz.positions(mcz.convert(motion, "bvh"))
    assert np.abs(other.node_positions() - ours).max() < 1e-5  # printed with six decimals
