"""Kinematics against other parties: SciPy's rotations, pybvh, finite differences, Khan's table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, MotionError, OptionError, Signal, Skeleton
from mcz.codecs.channel_weights import sensitivities
from mcz.kinematics import chain
from mcz.kinematics.frames import FramePositions
from mcz.kinematics.points import (
    depths,
    places_of,
    point_names,
    point_set,
    positions,
    positions_of,
    reach,
)
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.skeletons import reference_points, skeletons, values_for

# Khan 2016, Table 1: the normalized depth of CMU's joints, to three decimals.
KHAN_DEPTHS = {
    0.0: "root",
    0.111: "lhipjoint rhipjoint lowerback",
    0.222: "lfemur rfemur upperback",
    0.333: "ltibia rtibia thorax",
    0.444: "lfoot rfoot lowerneck lclavicle rclavicle",
    0.556: "ltoes rtoes upperneck lhumerus rhumerus",
    0.667: "head lradius rradius",
    0.778: "lwrist rwrist",
    0.889: "lhand rhand lthumb rthumb",
    1.0: "lfingers rfingers",
}
MARKER = tuple(map(Channel, ("tx", "ty", "tz")))


def agree(found: np.ndarray, expected: np.ndarray, size: float, tolerance: float = 1e-9) -> None:
    """SPEC.md, "Kinematics": 1e-9 of the size, and 1e-12 of the coordinates."""
    assert found.shape == expected.shape
    limit = tolerance * size + 1e-3 * tolerance * np.abs(expected).max(initial=0.0)
    assert np.abs(found - expected).max(initial=0.0) <= limit


@given(skeletons(), st.integers(0, 2**32))
def test_positions_of_any_skeleton(skeleton: Skeleton, seed: int) -> None:
    values = values_for(skeleton, seed=seed)
    agree(positions_of(skeleton, values), reference_points(skeleton, values), reach(skeleton))


@given(skeletons(), st.integers(0, 2**32))
def test_sensitivities_of_any_skeleton(skeleton: Skeleton, seed: int) -> None:
    """Against central differences, which see every point by itself."""
    values = values_for(skeleton, n_frames=3, seed=seed)
    found = sensitivities(skeleton, values)
    step = 1e-4 if skeleton.angle_unit == "deg" else 1e-5
    for column in range(skeleton.n_channels):
        by = np.zeros_like(values)
        by[:, column] = step
        ahead, behind = (positions_of(skeleton, values + sign * by) for sign in (1, -1))
        slopes = (ahead - behind) / (2 * step)
        expected = np.sqrt((slopes**2).sum(axis=2).mean())
        assert found[column] == pytest.approx(expected, rel=1e-4, abs=1e-7)


WALKS = {"acclaim": acclaim_walk(), "bvh": bvh_walk(), "markers": marker_walk()}


@pytest.mark.parametrize("name", WALKS)
def test_the_walk_against_scipy(name: str) -> None:
    motion = WALKS[name]
    assert point_set(motion.skeleton) == name
    found = positions(motion)
    assert found.shape[1] == {"acclaim": 31, "bvh": 38, "markers": 34}[name]
    values = np.nan_to_num(motion.values)
    expected = reference_points(motion.skeleton, values)
    agree(positions_of(motion.skeleton, values), expected, reach(motion.skeleton))
    known = ~np.isnan(found)
    assert known.all() == (name != "markers")
    assert (found[known] == positions_of(motion.skeleton, values)[known]).all()


def test_the_walk_in_two_formats_is_one_walk() -> None:
    acclaim, bvh = positions(WALKS["acclaim"]), positions(WALKS["bvh"])
    names = point_names(WALKS["acclaim"].skeleton), point_names(WALKS["bvh"].skeleton)
    unit_cm = WALKS["acclaim"].skeleton.unit_cm
    for bone, joint in (("ltibia", "LeftFoot"), ("ltoes", "LeftToes end"), ("head", "Head end")):
        a, b = acclaim[:, names[0].index(bone)], bvh[:, names[1].index(joint)]
        assert np.abs(a * unit_cm - b).max() < 1e-3  # of a cm; angles have 4 decimals


def pybvh_agrees(path: Path) -> None:
    import pybvh

    other = pybvh.read_bvh_file(path, world_up="+y", warn_on_world_up_disagreement=False)
    motion = mcz.read(path)
    root = motion.skeleton.joints[0]
    # To pybvh every root's positions replace its offset.
    added = np.array(root.offset) if root.adds_to_offset else np.zeros(3)
    agree(positions(motion), other.node_positions() + added, reach(motion.skeleton))


@pytest.mark.real
@pytest.mark.parametrize(
    "name",
    [
        "cmu/bvh/01_01.bvh",
        "cmu/bvh/05_01.bvh",
        "cmu/bvh-3dsmax/131_01.bvh",  # two orders of rotation
        "cmu/bvh-daz/01_01.bvh",
        "cmu/bvh-iclone/001_01.bvh",
        "other/acrnn-cmu-daz/salsa_01.bvh",
        "other/mae-openni/ang_hammer5.bvh",
        "other/makehuman/walk1.bvh",
        "other/pybvh/bvh_test1.bvh",  # several orders
        "other/pybvh/rotation_first_root.bvh",
        "other/pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh",
    ],
)
def test_pybvh_on_real_files(data: Path, name: str) -> None:
    pybvh_agrees(data / name)


@pytest.mark.real
@pytest.mark.parametrize(
    "name",
    [
        "cmu/amc/17_10.amc",
        "cmu/amc/01_01.amc",
        "cmu/amc-variants/16_11-96dof-reexport.amc",
        "other/endorphin/walking.amc",
        "other/bandai-namco/dataset-2_run_normal_016.bvh",  # positions on every joint
        "other/makehuman/benchmark.bvh",
        "other/mocap-bvh-kevinxie4c/sample_del_1.bvh",  # joints of two channels
        "other/tiny/noroot.bvh",
    ],
)
@pytest.mark.filterwarnings("ignore::mcz.SkeletonWarning")  # two have no ASF of their name
def test_scipy_on_real_files(data: Path, name: str) -> None:
    motion = mcz.read(data / name)
    values, skeleton = motion.values[:500], motion.skeleton
    agree(positions_of(skeleton, values), reference_points(skeleton, values), reach(skeleton))


@pytest.mark.real
def test_an_acclaim_clip_is_its_bvh_conversion(data: Path) -> None:
    """The legs of 01_01, to what 4 decimals of an angle leave; a T-pose comes first in the BVH."""
    acclaim, bvh = mcz.read(data / "cmu/amc/01_01.amc"), mcz.read(data / "cmu/bvh/01_01.bvh")
    a, b = positions(acclaim), positions(bvh)[1:]
    names = point_names(acclaim.skeleton), point_names(bvh.skeleton)
    legs = {"lfemur": "LeftLeg", "ltibia": "LeftFoot", "rfoot": "RightToeBase"}
    for bone, joint in (legs | {"root": "Hips", "ltoes": "LeftToeBase end"}).items():
        difference = a[:, names[0].index(bone)] - b[:, names[1].index(joint)]
        assert np.abs(difference).max() < 2e-4


@pytest.mark.real
def test_khans_depths_on_the_real_skeleton(data: Path) -> None:
    has_khans_depths(mcz.read_skeleton(data / "cmu/asf/17.asf"))


def test_khans_depths() -> None:
    """The sample has the joints of CMU's skeletons."""
    has_khans_depths(WALKS["acclaim"].skeleton)


def has_khans_depths(skeleton: Skeleton) -> None:
    found = dict(zip(skeleton.addresses(), depths(skeleton).round(3).tolist(), strict=True))
    assert found == {name: depth for depth, names in KHAN_DEPTHS.items() for name in names.split()}


def test_depths_of_flat_skeletons_are_zero() -> None:
    assert depths(WALKS["markers"].skeleton).tolist() == [0.0] * 34
    assert depths(Skeleton(())).shape == (0,)


def test_virtual_markers() -> None:
    """Three a joint, 3 cm off its point, at right angles, turned with the joint."""
    skeleton, values = WALKS["acclaim"].skeleton, WALKS["acclaim"].values
    markers = places_of(skeleton, values, markers=True).markers.reshape(len(values), 31, 3, 3)
    arms = (markers - positions_of(skeleton, values)[:, :, None]) * skeleton.unit_cm
    assert np.abs(arms @ arms.transpose(0, 1, 3, 2) - 9 * np.eye(3)).max() < 1e-9
    hand = skeleton.find("lhand")  # axes: 90 about y, then 90 about z; see mcz/sources/sample.py
    at_rest = places_of(skeleton, np.zeros((1, skeleton.n_channels)), markers=True).markers
    end = positions_of(skeleton, np.zeros((1, skeleton.n_channels)))[0, hand]
    axes = (at_rest.reshape(31, 3, 3)[hand] - end) * skeleton.unit_cm / 3
    assert np.abs(axes - [[0, 0, -1], [-1, 0, 0], [0, 1, 0]]).max() < 1e-9


def test_virtual_markers_see_a_roll_that_points_do_not() -> None:
    skeleton = Skeleton(
        (
            Joint("hip", channels=MARKER),
            Joint("knee", 0, tails=((0.0, 2.0, 0.0),), channels=(Channel("ry"),)),
        ),
        unit_cm=1.0,
    )
    values = np.array([[0.0, 0, 0, 0], [0, 0, 0, 90]])
    assert np.ptp(positions_of(skeleton, values), axis=0).max() == 0
    moved = np.ptp(places_of(skeleton, values, markers=True).markers, axis=0).max(axis=1)
    assert np.round(moved, 9).tolist() == [0, 0, 0, 3, 0, 3]


def test_virtual_markers_need_a_unit() -> None:
    with pytest.raises(OptionError, match="unit .*is unknown"):
        places_of(WALKS["bvh"].skeleton, WALKS["bvh"].values, markers=True)


def test_invalid_values_make_nan_points() -> None:
    skeleton = WALKS["acclaim"].skeleton
    values = WALKS["acclaim"].values[:3].copy()
    knee = skeleton.find("ltibia")
    values[1, skeleton.columns(knee)[0]] = np.nan
    lost = np.isnan(positions_of(skeleton, values)).any(axis=2)
    assert not lost[[0, 2]].any()
    names = np.array(point_names(skeleton))
    assert names[lost[1]].tolist() == ["ltibia", "lfoot", "ltoes"]
    assert np.isfinite(sensitivities(skeleton, values)).all()
    values[:] = np.inf
    assert np.isnan(positions_of(skeleton, values)).all()


def test_sensitivities_of_the_walk() -> None:
    skeleton, values = WALKS["acclaim"].skeleton, WALKS["acclaim"].values
    found = sensitivities(skeleton, values)
    assert found[:3].tolist() == [1.0, 1.0, 1.0]  # every point moves by as much as the root
    few = sensitivities(skeleton, values, max_frames=40)
    assert np.abs(few / found - 1).max() < 0.1
    with pytest.raises(OptionError, match="max_frames is 0"):
        sensitivities(skeleton, values, max_frames=0)
    assert sensitivities(skeleton, values[:0]).tolist() == [0.0] * 62


def test_blocks_of_frames_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    skeleton, values = WALKS["bvh"].skeleton, WALKS["bvh"].values
    whole = positions_of(skeleton, values)
    monkeypatch.setattr(chain, "BLOCK_JOINTS", 1)
    assert (positions_of(skeleton, values) == whole).all()


def test_point_names() -> None:
    tails = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    two = (Joint("a", channels=MARKER), Joint("a", 0, tails=tails))
    assert point_names(Skeleton(two)) == ("a", "a#1", "a#1 end", "a#1 end 2")
    assert point_names(Skeleton(two, intrinsic=False)) == ("a", "a#1", "a#1 end 2")
    assert point_names(WALKS["acclaim"].skeleton)[:2] == ("root", "lhipjoint")
    assert point_names(WALKS["markers"].skeleton)[0] == "LFHD"


@pytest.mark.parametrize("angle_unit", ["deg", "rad", ""])
def test_angle_units(angle_unit: str) -> None:
    bone = Joint("bone", tails=((0.0, 2.0, 0.0),), channels=(Channel("rz"),))
    skeleton = Skeleton((bone,), angle_unit=angle_unit, intrinsic=False)
    values = np.array([[90.0 if angle_unit == "deg" else np.pi / 2]])
    if angle_unit:
        agree(positions_of(skeleton, values), np.array([[[-2.0, 0, 0]]]), 2.0)
    else:
        with pytest.raises(MotionError, match="angle unit .*is unknown"):
            positions_of(skeleton, values)


def test_scalars_alone_place_nothing() -> None:
    """An AMC without its ASF."""
    skeleton = Skeleton((Joint("root", channels=(Channel("", "1"),)),), intrinsic=False)
    with pytest.raises(MotionError, match="channels are plain scalars, which do not move joints"):
        positions_of(skeleton, np.zeros((1, 1)))


def test_what_does_not_fit() -> None:
    walk = WALKS["acclaim"]
    with pytest.raises(MotionError, match="values of shape"):
        positions_of(walk.skeleton, walk.values[:, :5])
    own = Signal(walk.values, channels=walk.skeleton.channels)
    with pytest.raises(MotionError, match="differ from those of its skeleton"):
        positions(replace(walk, signals=(own,)))


def test_the_registry_of_point_sets() -> None:
    section = (Path(__file__).parent.parent / "SPEC.md").read_text().split("## Kinematics", 1)[1]
    rows = section.split("|---|---|---|\n", 1)[1].split("\n\n", 1)[0].splitlines()
    assert {row.split("|")[1].strip() for row in rows} == {*WALKS}


def test_nothing_to_place() -> None:
    assert positions_of(Skeleton(()), np.zeros((4, 0))).shape == (4, 0, 3)
    assert positions_of(WALKS["bvh"].skeleton, np.zeros((0, 96))).shape == (0, 38, 3)
    assert reach(Skeleton(())) == reach(WALKS["markers"].skeleton) == 0.0


@given(skeletons(), st.booleans(), st.integers(0, 2**32))
def test_a_frame_alone_is_as_among_many(skeleton: Skeleton, plain: bool, seed: int) -> None:
    if plain:  # what is compiled
        skeleton = replace(skeleton, joints=tuple(map(_turning_and_moving, skeleton.joints)))
    values = values_for(skeleton, seed=seed)
    meant = positions_of(skeleton, values)
    place = FramePositions(skeleton)
    agree(np.array([place(row) for row in values]), meant, reach(skeleton))
    skeleton = replace(skeleton, unit_cm=2.0)
    place = FramePositions(skeleton, virtual_markers=True)
    meant = np.concatenate([meant, places_of(skeleton, values, markers=True).markers], axis=1)
    agree(np.array([place(row) for row in values]), meant, 3 + reach(skeleton))


def _turning_and_moving(joint: Joint) -> Joint:
    kept = {c.kind: c for c in joint.channels if c.kind[:1] in ("t", "r")}
    return replace(joint, channels=tuple(kept.values()))


def test_a_frame_alone_knows_what_is_missing() -> None:
    skeleton = Skeleton((Joint("a", channels=MARKER), Joint("b", channels=MARKER)), unit_cm=1.0)
    found = FramePositions(skeleton)(np.array([1.0, np.nan, 3.0, 4.0, 5.0, 6.0]))
    np.testing.assert_array_equal(found, [[np.nan] * 3, [4, 5, 6]])
    with pytest.raises(MotionError):
        FramePositions(Skeleton((Joint("a", channels=(Channel("rx"),)),), angle_unit=""))
    with pytest.raises(OptionError):
        FramePositions(replace(skeleton, unit_cm=None), virtual_markers=True)
