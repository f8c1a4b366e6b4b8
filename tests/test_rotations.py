"""Conversions of rotations against SciPy: at random, and where one form or another is singular."""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from mcz.kinematics.poses.conversions import FORMS, from_matrices, slerp

RANDOM = np.random.default_rng(7)
AXES = np.concatenate([RANDOM.normal(size=(30, 3)), np.eye(3), -np.eye(3), np.eye(3) - 1])
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)
QUARTERS = list(product([0, 90, 180, -90], repeat=3))
TURNS: dict[str, Rotation] = {
    "random": Rotation.random(1000, random_state=1),
    "identity": Rotation.identity(2),
    "half turns": Rotation.from_rotvec(AXES * np.pi),
    "near half turns": Rotation.from_rotvec(
        np.concatenate([AXES * (np.pi - off) for off in (1e-3, 1e-8, 1e-12)])
    ),
    "tiny": Rotation.from_rotvec(np.concatenate([AXES * size for size in (1e-3, 1e-9, 1e-17)])),
    "quarter turns": Rotation.from_euler("xyz", QUARTERS, degrees=True),
}
AXES_APART = ["".join(p) for p in product("xyz", repeat=3) if p[0] != p[1] != p[2]]
ORDERS = [order for letters in AXES_APART for order in (letters, letters.upper())]


def euler_angles(matrices: NDArray[np.float64], order: str) -> NDArray[np.float64]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # SciPy warns in gimbal lock
        return np.asarray(Rotation.from_matrix(matrices).as_euler(order))


def apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """The greatest difference of angles; -pi is pi."""
    return float(np.abs(np.angle(np.exp(1j * (one - other)))).max())


def matrices_of(
    rotations: NDArray[np.float64], form: str, order: str = "XYZ"
) -> NDArray[np.float64]:
    """SciPy's matrices, (..., 3, 3), of rotations in a form, (..., *FORMS[form])."""
    flat = rotations.reshape(-1, *FORMS[form])
    if form == "6d":
        columns = flat[:, :3], flat[:, 3:], np.cross(flat[:, :3], flat[:, 3:])
        matrices = np.stack(columns, axis=2)
    elif form == "matrix":
        matrices = flat
    elif form == "quat":
        matrices = Rotation.from_quat(flat, scalar_first=True).as_matrix()
    elif form == "rotvec":
        matrices = Rotation.from_rotvec(flat).as_matrix()
    else:
        matrices = Rotation.from_euler(order, flat).as_matrix()
    return matrices.reshape(*rotations.shape[: -len(FORMS[form])], 3, 3)


@pytest.mark.parametrize("name", TURNS)
def test_quaternions_and_vectors_are_those_of_scipy(name: str) -> None:
    turns, matrices = TURNS[name], TURNS[name].as_matrix()
    vectors = from_matrices(matrices[None], "rotvec")[0]
    np.testing.assert_allclose(vectors, turns.as_rotvec(), rtol=1e-14, atol=2e-15)
    theirs = turns.as_quat(scalar_first=True)
    ours = np.concatenate([from_matrices(each[None, None], "quat")[0] for each in matrices])
    assert (ours[:, 0] >= 0).all()
    signs = np.where((ours * theirs).sum(axis=1, keepdims=True) < 0, -1, 1)
    np.testing.assert_allclose(ours * signs, theirs, atol=1e-15)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_are_those_of_scipy(order: str) -> None:
    for turns in TURNS.values():
        matrices = turns.as_matrix()
        angles = from_matrices(matrices[None], "euler", order)[0]
        assert apart(angles, euler_angles(matrices, order)) < 2e-14
        again = Rotation.from_euler(order, angles).as_matrix()
        np.testing.assert_allclose(again, matrices, atol=1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_in_gimbal_lock_the_third_angle_is_zero(order: str) -> None:
    locks = [0.0, np.pi] if order[0] == order[2] else [-np.pi / 2, np.pi / 2]
    for lock in locks:
        ends = RANDOM.uniform(-3, 3, (50, 2))
        angles = np.stack([ends[:, 0], np.full(50, lock), ends[:, 1]], axis=1)
        matrices = Rotation.from_euler(order, angles).as_matrix()
        found = from_matrices(matrices[None], "euler", order)[0]
        assert (found[:, 2] == 0).all()
        assert apart(found, euler_angles(matrices, order)) < 2e-15
        again = Rotation.from_euler(order, found).as_matrix()
        np.testing.assert_allclose(again, matrices, atol=2e-15)


def test_the_way_between_two_rotations_is_that_of_scipy() -> None:
    first, last = (Rotation.random(200, random_state=seed) for seed in (3, 4))
    share = RANDOM.uniform(size=200)
    ways = zip(first, last, share, strict=True)
    theirs = [Slerp([0, 1], Rotation.concatenate([a, b]))(at).as_matrix() for a, b, at in ways]
    ours = slerp(first.as_matrix(), last.as_matrix(), share)
    np.testing.assert_allclose(ours, theirs, atol=4e-15)
