"""Inverse kinematics: points come back to where they were, and what shows in them does, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, MotionError, OptionError, Signal, Skeleton
from mcz.kinematics.inverse import solve_ik
from mcz.kinematics.points import points_and_markers_of, positions_of, reach, virtual_marker_names
from mcz.kinematics.targets import Targets, unsolved_channels
from mcz.sources.sample import acclaim_walk, bvh_walk
from tests.skeletons import skeletons, values_for
from tools.papers.hou2016.ways_back import angle_errors

WALKS = {"amc": acclaim_walk(), "bvh": bvh_walk()}
POSITION = tuple(map(Channel, ("tx", "ty", "tz")))
HIPS = ((0.5, -1.0, 0.2), (-0.5, -1.0, 0.2))
DOFS = ("", "x", "y", "z", "xy", "zx", "yz", "xyz", "zxy", "yxz", "zyx")


def with_unit(skeleton: Skeleton) -> Skeleton:
    return replace(skeleton, unit_cm=skeleton.unit_cm or 2.5)


def farthest(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).sum(axis=2)).max(initial=0.0))


@st.composite
def limbs(draw: st.DrawFn, *, free: bool = False) -> Skeleton:
    """A tree of bones of one length unit or more, each with some of its rotations.

    With ``free`` one root, a pelvis: it turns any way, its own place is a point, and two bones are
    fast to it.
    """
    number = draw(st.integers(1, 6))
    joints: list[Joint] = []
    if free:
        channels = POSITION + tuple(Channel(f"r{letter}") for letter in "xyz")
        joints.append(Joint("pelvis", channels=channels))
        joints += [Joint(f"hip {k}", 0, tails=(tail,)) for k, tail in enumerate(HIPS)]
    bone = st.sampled_from([(0.0, 1.0, 0.0), (0.6, 0.8, 0.0), (0.0, -1.2, 0.5), (1.5, 0.0, 0.2)])
    for index in range(len(joints), len(joints) + number):
        parent = draw(st.integers(1 if free else -1, index - 1)) if index else -1
        kinds = draw(st.sampled_from(DOFS))
        channels = tuple(Channel(f"r{letter}") for letter in kinds)
        offset = joints[parent].tails[0] if parent >= 0 else (0.0, 0.0, 0.0)
        if parent < 0:
            channels = POSITION + channels
        axis = draw(st.sampled_from([(0.0, 0.0, 0.0), (10.0, -70.0, 35.0)]))
        joints.append(Joint(f"bone {index}", parent, offset, (draw(bone),), axis, "XYZ", channels))
    return Skeleton(
        tuple(joints),
        unit_cm=2.5,
        angle_unit=draw(st.sampled_from(["deg", "rad"])),
        intrinsic=draw(st.booleans()),
    )


def swings(skeleton: Skeleton, n_frames: int = 9, most: float = 60.0) -> np.ndarray:
    """Smooth values: angles up to ``most`` degrees, places up to 20."""
    frames = np.arange(n_frames)[:, None]
    numbers = np.arange(skeleton.n_channels)
    values = np.sin(0.07 * frames * (1 + 0.13 * numbers) + 2.1 * numbers)
    turn = most if skeleton.angle_unit == "deg" else np.deg2rad(most)
    sizes = [20.0 if c.kind in ("tx", "ty", "tz") else turn for c in skeleton.channels]
    return values * np.array(sizes)


@given(skeletons())
def test_the_jacobian_is_that_of_the_places(skeleton: Skeleton) -> None:
    targets = Targets(skeleton, markers=True)
    columns = np.ascontiguousarray(values_for(skeleton).T)
    pose = targets.chain.pose(columns)
    places = targets.positions(columns, pose)
    points, markers = points_and_markers_of(skeleton, columns.T)
    there = np.concatenate([points, markers], axis=1)
    assert np.allclose(np.moveaxis(places, 2, 0), there, rtol=1e-12, atol=1e-9)
    slopes = targets.jacobian(columns, pose, places)
    for column, unit in enumerate(targets.units):
        step = 1e-6 * (unit or 1.0)
        slope = np.zeros(places.shape)
        for steps, share in ((1, 8), (-1, -8), (2, -1), (-2, 1)):  # of fourth order
            moved = columns.copy()
            moved[column] += steps * step
            slope += share * targets.positions(moved, targets.chain.pose(moved)) / 12e-6
        assert np.abs(slope - slopes[column]).max() < 1e-5 * max(1.0, np.abs(slope).max())


@given(limbs())
def test_points_and_markers_give_the_motion_back(skeleton: Skeleton) -> None:
    values = swings(skeleton)
    points, markers = points_and_markers_of(skeleton, values)
    solved = solve_ik(skeleton, points, markers)
    assert solved.shape == values.shape
    assert farthest(positions_of(skeleton, solved), points) < 1e-4
    assert np.abs(angle_errors(skeleton, values, solved)).max(initial=0.0) < 0.01


@given(limbs(free=True))
def test_points_alone_are_met(skeleton: Skeleton) -> None:
    points = positions_of(skeleton, swings(skeleton))
    solved = solve_ik(skeleton, points)
    distances = np.sqrt(((positions_of(skeleton, solved) - points) ** 2).sum(axis=2))
    assert np.median(distances, axis=0).max(initial=0.0) < 1e-3


@settings(max_examples=10)
@given(skeletons())
def test_any_skeleton_has_an_answer(skeleton: Skeleton) -> None:
    """Scales, lengths, quaternions, several of a kind: never worse than rest, and finite."""
    values = values_for(skeleton)
    points, markers = points_and_markers_of(skeleton, values)
    for given_markers in (None, markers):
        solved = solve_ik(skeleton, points, given_markers)
        assert np.isfinite(solved).all()
        unsolved = unsolved_channels(skeleton)
        columns = [
            column for column, unit in enumerate(Targets(skeleton, markers=False).units) if not unit
        ]
        assert len(columns) == len(unsolved)
        assert not solved[:, columns].any()


def test_scales_lengths_and_quaternions_are_found() -> None:
    turn = tuple(Channel(kind) for kind in ("qw", "qx", "qy", "qz"))
    root = Joint("root", channels=POSITION + turn, tails=((0.0, 1.0, 0.0),))
    long = Joint("long", 0, (0.0, 1.0, 0.0), ((2.0, 0.0, 0.0),), channels=(Channel("length"),))
    wide = Joint("wide", 1, (2.0, 0.0, 0.0), ((1.0, 1.0, 0.0),), channels=(Channel("sx"),))
    skeleton = Skeleton((root, long, wide), unit_cm=2.0)
    values = np.array([[1.0, 2.0, 3.0, 0.8, 0.0, 0.6, 0.0, 0.5, 1.5]] * 3)
    points, markers = points_and_markers_of(skeleton, values)
    for markers_or_none in (None, markers):
        solved = solve_ik(skeleton, points, markers_or_none)
        assert farthest(positions_of(skeleton, solved), points) < 1e-4
    assert np.abs(solved[:, :3] - values[:, :3]).max() < 1e-4
    assert np.abs(solved[:, 7:] - values[:, 7:]).max() < 1e-4


@pytest.mark.parametrize("kind", WALKS)
def test_a_walk_comes_back(kind: str) -> None:
    walk = WALKS[kind]
    skeleton, values = with_unit(walk.skeleton), walk.values
    points, markers = points_and_markers_of(skeleton, values)
    size = reach(skeleton)
    solved = solve_ik(skeleton, points)
    assert farthest(positions_of(skeleton, solved), points) < 1e-3 * size
    solved = solve_ik(skeleton, points, markers)
    assert farthest(positions_of(skeleton, solved), points) < 1e-6 * size
    assert np.sqrt((angle_errors(skeleton, values, solved) ** 2).mean()) < 0.01


def test_angles_are_continuous() -> None:
    """A root that turns around and around, over the pole as well."""
    channels = POSITION + tuple(Channel(f"r{letter}") for letter in "zxy")
    skeleton = Skeleton((Joint("root", -1, tails=((0.0, 1.0, 0.0),), channels=channels),), "", 2.0)
    values = np.zeros((200, 6))
    values[:, 5] = np.linspace(0, 1500, 200)
    values[:, 4] = 70 * np.sin(np.linspace(0, 5, 200))
    points, markers = points_and_markers_of(skeleton, values)
    solved = solve_ik(skeleton, points, markers)
    assert np.abs(np.diff(solved[:, 3:], axis=0)).max() < 30
    assert np.abs(solved[:, 3:]).mean() < 800
    assert np.abs(angle_errors(skeleton, values, solved)).max() < 0.01


def test_missing_places_are_filled_from_the_frames_around() -> None:
    walk = WALKS["amc"]
    skeleton, values = walk.skeleton, walk.values[:60]
    points = positions_of(skeleton, values)
    whole = solve_ik(skeleton, points)
    seen = points.copy()
    seen[20:23, 5:9] = np.nan
    seen[30] = np.nan
    seen[40, 3, 1] = np.nan
    solved = solve_ik(skeleton, seen)
    assert np.isfinite(solved).all()
    positions = positions_of(skeleton, solved)
    known = np.isfinite(seen).all(axis=2)
    assert np.sqrt(((positions - points) ** 2).sum(axis=2))[known].max() < 0.01
    assert farthest(positions[30:31], points[30:31]) < 1.0
    assert np.abs(solved[30] - whole[30]).max() < 30


def test_nothing_is_known() -> None:
    skeleton = WALKS["amc"].skeleton
    seen = np.full((3, 31, 3), np.nan)
    assert not solve_ik(skeleton, seen).any()
    seen[:, 0] = [1.0, 2.0, 3.0]
    assert np.allclose(positions_of(skeleton, solve_ik(skeleton, seen))[:, 0], seen[:, 0])


def test_a_point_that_is_never_seen() -> None:
    walk = WALKS["amc"]
    points = positions_of(walk.skeleton, walk.values[:20])
    points[:, 4] = np.nan
    positions = positions_of(walk.skeleton, solve_ik(walk.skeleton, points))
    known = np.isfinite(points).all(axis=2)
    assert np.sqrt(((positions - points) ** 2).sum(axis=2))[known].max() < 0.01


def test_no_frames_and_no_joints() -> None:
    skeleton = WALKS["amc"].skeleton
    assert solve_ik(skeleton, np.zeros((0, 31, 3))).shape == (0, skeleton.n_channels)
    assert solve_ik(Skeleton(()), np.zeros((4, 0, 3))).shape == (4, 0)
    fixed = Skeleton((Joint("fixed", tails=((1.0, 0.0, 0.0),)),))
    assert solve_ik(fixed, np.zeros((4, 2, 3))).shape == (4, 0)
    one = Skeleton((Joint("only", channels=POSITION),), intrinsic=False)
    assert solve_ik(one, np.array([[[1.0, 2.0, 3.0]]])).tolist() == [[1.0, 2.0, 3.0]]


def test_a_single_hinge() -> None:
    hinge = Joint("hinge", tails=((0.0, 1.0, 0.0),), channels=(Channel("rz"),))
    skeleton = Skeleton((hinge,), intrinsic=False)
    values = np.linspace(-170, 170, 30)[:, None]
    solved = solve_ik(skeleton, positions_of(skeleton, values))
    assert np.abs(solved - values).max() < 1e-4


def test_blocks_of_frames_hardly_show(monkeypatch: pytest.MonkeyPatch) -> None:
    skeleton, values = WALKS["amc"].skeleton, WALKS["amc"].values[:40]
    points, markers = points_and_markers_of(skeleton, values)
    whole = solve_ik(skeleton, points, markers)
    monkeypatch.setattr("mcz.kinematics.inverse.BLOCK_NUMBERS", 1)
    monkeypatch.setattr("mcz.kinematics.inverse.GUESS_BLOCK", 7)
    assert np.abs(solve_ik(skeleton, points, markers) - whole).max() < 1e-3


def test_noise_is_not_followed_by_what_it_hardly_shows() -> None:
    walk = WALKS["amc"]
    seen = mcz.in_positions(walk, virtual_markers=True)
    spread = 0.5 / (walk.skeleton.unit_cm or 1.0) / np.sqrt(3)  # 0.5 cm rms a place
    noise = np.random.default_rng(0).normal(0.0, spread, seen.values.shape)
    noisy = replace(seen, signals=(Signal(seen.values + noise),))
    solved, _ = mcz.from_positions(noisy, walk.skeleton)
    assert mcz.compare(walk, solved).mean_position_error_cm < 0.5
    assert np.abs(angle_errors(walk.skeleton, walk.values, solved.values)).mean() < 5


def test_what_does_not_fit() -> None:
    walk = WALKS["amc"]
    skeleton, points = walk.skeleton, positions_of(walk.skeleton, walk.values[:2])
    with pytest.raises(MotionError, match=r"has 31 points, so positions must have shape"):
        solve_ik(skeleton, points[:, 1:])
    with pytest.raises(MotionError, match="has 93 virtual markers"):
        solve_ik(skeleton, points, points)
    markers = points_and_markers_of(skeleton, walk.values[:2])[1]
    with pytest.raises(MotionError, match="2 frames of points, but 1 of virtual markers"):
        solve_ik(skeleton, points, markers[:1])
    with pytest.raises(OptionError, match="length unit .*is unknown"):
        solve_ik(replace(skeleton, unit_cm=None), points, markers)
    with pytest.raises(MotionError, match="angle unit .*is unknown"):
        solve_ik(replace(skeleton, angle_unit=""), points)


def test_names_of_virtual_markers() -> None:
    two = Skeleton((Joint("a"), Joint("a", 0)))
    assert virtual_marker_names(two) == ["a+x", "a+y", "a+z", "a#1+x", "a#1+y", "a#1+z"]


@pytest.mark.real
@pytest.mark.parametrize("name", ["amc/17_10.amc", "bvh/06_06.bvh"])
def test_real_clips_come_back(data: Path, name: str) -> None:
    motion = mcz.read(data / "cmu" / name)
    signal = motion.signals[0].cut(0, min(motion.n_frames, 200))
    motion = replace(motion, skeleton=with_unit(motion.skeleton), signals=(signal,), source=None)
    for marked in (False, True):
        seen = mcz.in_positions(motion, virtual_markers=marked)
        solved, _ = mcz.from_positions(seen, motion.skeleton)
        assert mcz.compare(motion, solved).mean_position_error_cm < 1e-4
    errors = angle_errors(motion.skeleton, motion.values, solved.values)
    assert np.sqrt((errors**2).mean()) < 0.01


def test_places_beyond_all_bounds_are_refused() -> None:
    base = WALKS["bvh"].skeleton
    motion = mcz.in_positions(WALKS["bvh"])
    motion.signals[0].values[1, 4] = -1e301
    with pytest.raises(MotionError, match=r"301 is too far away for inverse kinematics"):
        mcz.from_positions(motion, base)
