"""HumanML3D's features against a plain implementation of the published definition, and back."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

import mcz
from mcz.exchange.datasets.humanml import JOINTS

# Chains of joints from the root, the bones of which have a direction each in the rest pose.
CHAINS = [
    ([0, 2, 5, 8, 11], [(-1, 0, 0), (0, -1, 0), (0, -1, 0), (0, 0, 1)]),
    ([0, 1, 4, 7, 10], [(1, 0, 0), (0, -1, 0), (0, -1, 0), (0, 0, 1)]),
    ([0, 3, 6, 9, 12, 15], [(0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 0, 1)]),
    ([9, 14, 17, 19, 21], [(-1, 0, 0), (0, -1, 0), (0, -1, 0), (0, -1, 0)]),
    ([9, 13, 16, 18, 20], [(1, 0, 0), (0, -1, 0), (0, -1, 0), (0, -1, 0)]),
]
FEET = [7, 10, 8, 11]


def walk(n_frames: int = 90, turn: float = 0.02, seed: int = 0) -> np.ndarray:
    """Joints that follow a root on a curve, each along a wave of its own."""
    random = np.random.default_rng(seed)
    places = np.zeros((n_frames, 22, 3))
    frames = np.arange(n_frames)
    for chain, bones in CHAINS:
        for (above, joint), bone in zip(pairwise(chain), bones, strict=True):
            sway = np.sin(frames[:, None] * random.uniform(0.05, 0.2, 3) + random.uniform(0, 6, 3))
            direction = np.array(bone) + 0.4 * sway
            direction /= np.linalg.norm(direction, axis=1)[:, None]
            places[:, joint] = places[:, above] + random.uniform(0.1, 0.4) * direction
    places = np.stack([Rotation.from_rotvec([0, turn * f, 0]).apply(places[f]) for f in frames])
    root = [np.cumsum(0.03 * np.cos(turn * frames)), 0.9 + 0.02 * np.sin(frames), frames * 0.01]
    return places + np.stack(root, axis=1)[:, None]


def between(start: np.ndarray, end: np.ndarray) -> Rotation:
    """The shortest rotation from one direction to another."""
    cross, dot = np.cross(start, end), float(np.dot(start, end))
    return Rotation.from_quat([*cross, 1.0 + dot])


def facing(across: np.ndarray) -> np.ndarray:
    return np.cross([0.0, 1.0, 0.0], across / np.linalg.norm(across))


def published(places: np.ndarray, threshold: float = 0.002) -> np.ndarray:
    """The features, a frame and a joint at a time, as the published program has them."""
    places = places.copy()
    places[:, :, 1] -= places[:, :, 1].min()
    places -= places[0, 0] * [1, 0, 1]
    first = places[0]
    start = facing(first[2] - first[1] + first[17] - first[16])
    turned = between(start / np.linalg.norm(start), np.array([0.0, 0.0, 1.0]))
    places = np.stack([turned.apply(frame) for frame in places])

    forward = [facing(frame[1] - frame[2] + frame[17] - frame[16]) for frame in places]
    smooth = gaussian_filter1d(np.array(forward), 20, axis=0, mode="nearest")
    smooth /= np.linalg.norm(smooth, axis=1)[:, None]
    roots = [between(direction, np.array([0.0, 0.0, 1.0])) for direction in smooth]
    roots[0] = Rotation.identity()

    rows = []
    for t in range(len(places) - 1):
        now, then = places[t], places[t + 1]
        local = {}
        for chain, bones in CHAINS:
            above = roots[t]
            for (parent, joint), bone in zip(pairwise(chain), bones, strict=True):
                direction = now[joint] - now[parent]
                world = between(np.array(bone, float), direction / np.linalg.norm(direction))
                local[joint] = (above.inv() * world).as_matrix()
                above = world
        half = (roots[t + 1] * roots[t].inv()).as_quat()[1]
        centered = now - now[0] * [1, 0, 1]
        moves = then - now
        rows.append(
            np.concatenate(
                [
                    [np.arcsin(half)],
                    roots[t + 1].apply(moves[0])[[0, 2]],
                    [now[0, 1]],
                    roots[t].apply(centered[1:]).ravel(),
                    *([*local[joint][:, 0], *local[joint][:, 1]] for joint in range(1, 22)),
                    roots[t].apply(moves).ravel(),
                    [float((moves[foot] ** 2).sum() < threshold) for foot in FEET],
                ]
            )
        )
    return np.array(rows)


@pytest.mark.parametrize("seed", range(3))
def test_features_are_the_published_ones(seed: int) -> None:
    places = walk(seed=seed, turn=0.01 * seed)
    features = mcz.humanml3d(places)
    assert features.shape == (89, 263)
    np.testing.assert_allclose(features, published(places), atol=1e-9)
    assert 0 < features[:, 259:].mean() < 1


def test_facts_of_the_definition() -> None:
    """A body that stands and faces x: it is turned to z, and put on the floor at the origin."""
    rest = np.zeros((22, 3))
    for chain, bones in CHAINS:
        for (above, joint), bone in zip(pairwise(chain), bones, strict=True):
            rest[joint] = rest[above] + (0.2 + 0.01 * joint) * np.array(bone)
    turned = Rotation.from_rotvec([0, np.pi / 2, 0]).apply(rest) + np.array([5, 3, -2])
    features = mcz.humanml3d(np.tile(turned, (3, 1, 1)))
    row = features[0]
    np.testing.assert_allclose(features, [row, row], atol=1e-12)
    standing = rest - np.array([0, rest[:, 1].min(), 0])
    np.testing.assert_allclose(row[:4], [0, 0, 0, standing[0, 1]], atol=1e-12)
    np.testing.assert_allclose(row[4:67].reshape(21, 3), standing[1:], atol=1e-12)
    np.testing.assert_allclose(row[193:259], 0, atol=1e-12)
    np.testing.assert_array_equal(row[259:], 1)


@pytest.mark.parametrize("turn", [0.0, 0.02, -0.015])
def test_positions_come_back(turn: float) -> None:
    places = walk(turn=turn)
    back = mcz.humanml3d_positions(mcz.humanml3d(places))
    again = mcz.humanml3d_positions(mcz.humanml3d(back))
    np.testing.assert_allclose(again[:60], back[:60], atol=1e-3)  # of the smoothing at the end
    apart = np.linalg.norm(places[:89, 1:] - places[:89, :1], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(back[:, 1:] - back[:, :1], axis=-1), apart)
    steps = np.linalg.norm(np.diff(places[:89, 0], axis=0), axis=-1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(back[:, 0], axis=0), axis=-1), steps)


def test_bones_get_lengths() -> None:
    places, lengths = walk(), np.linspace(0.1, 0.5, 22)
    leg = np.linalg.norm(places[0, 5] - places[0, 2]) + np.linalg.norm(places[0, 8] - places[0, 5])
    other = places * (lengths[5] + lengths[8]) / leg
    for chain, _ in CHAINS:
        for above, joint in pairwise(chain):
            bones = places[:, joint] - places[:, above]
            bones /= np.linalg.norm(bones, axis=1)[:, None]
            other[:, joint] = other[:, above] + lengths[joint] * bones
    features = mcz.humanml3d(places, bone_lengths=lengths)
    np.testing.assert_allclose(features, published(other), atol=1e-9)


def test_an_opposite_bone_has_a_rotation() -> None:
    places = walk(4, turn=0.0)
    places[:, 15] = places[:, 12] - [0, 0, 0.2]  # the head points back
    matrix = mcz.humanml3d(places)[0, 67:193].reshape(21, 6)[14]
    assert np.isfinite(matrix).all() and abs(matrix[:3] @ matrix[3:]) < 1e-12


def test_wrong_arguments() -> None:
    for places in (np.zeros((5, 21, 3)), np.zeros((1, 22, 3)), np.zeros((22, 3))):
        with pytest.raises(mcz.MotionError, match="22 joints, 3"):
            mcz.humanml3d(places)
    with pytest.raises(
        mcz.OptionError,
        match="bone_lengths must be 22 lengths, all above 0 except that of the root",
    ):
        mcz.humanml3d(walk(3), bone_lengths=np.zeros(22))
    with pytest.raises(mcz.MotionError, match="263 numbers"):
        mcz.humanml3d_positions(np.zeros((5, 262)))


def body(places: np.ndarray, up_axis: str) -> mcz.Motion:
    """A motion whose joints are these, each without a parent, in cm."""
    axes = mcz.Channel("tx"), mcz.Channel("ty"), mcz.Channel("tz")
    joints = tuple(mcz.Joint(name, -1, channels=axes) for name in JOINTS)
    skeleton = mcz.Skeleton(joints, unit_cm=1.0, up_axis=up_axis)
    values = 100 * places.reshape(len(places), -1)
    return mcz.Motion(skeleton, (mcz.Signal(values),), frame_rate=20, name="body")


def test_features_are_a_field(tmp_path: Path) -> None:
    places = walk()
    expected = mcz.humanml3d(places)
    for number, up_axis in enumerate("xyz"):
        turned = np.roll(places, number - 1, axis=-1)
        mcz.write(body(turned, up_axis), tmp_path / f"{up_axis}.mcz")
        file = tmp_path / f"{up_axis}.mcz"
        data = mcz.dataset(file, "humanml3d", window=30, stride=15, dtype="float64")
        for index in range(len(data)):
            rows = expected[15 * index : 15 * index + 30]
            np.testing.assert_allclose(data[index]["humanml3d"][: len(rows)], rows, atol=1e-9)
        last = data[len(data) - 1]["humanml3d"]
        np.testing.assert_array_equal(last[-1], last[-2])
