"""Conversion: the points stay where they are; what cannot be said is refused with the reason."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import mcz
from mcz import Channel, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.exchange.conversion import converted_files
from mcz.kinematics.points import point_names, positions, reach
from mcz.kinematics.rotations import ORDERS, euler_angles, euler_order
from mcz.model.skeleton import QUATERNION_KINDS
from mcz.sources import FORMATS
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.skeletons import skeletons, values_for

POSITION = tuple(map(Channel, ("tx", "ty", "tz")))
WALKS = {"amc": acclaim_walk(), "bvh": bvh_walk(), "c3d": marker_walk()}


def read(files: dict[str, bytes], to: str) -> Motion:
    if to == "amc":
        return FORMATS["amc"].read(files["amc"], "walk", FORMATS["asf"].read(files["asf"]))
    return FORMATS[to].read(files[to])


def farthest(points: np.ndarray, among: np.ndarray) -> float:
    """The distance, over all frames, of each point from the same one of ``among``; the greatest."""
    distances = [np.abs(among - points[:, [k]]).max(axis=(0, 2)) for k in range(points.shape[1])]
    return max((d.min() for d in distances), default=0.0)


def turns(angles: np.ndarray, order: str) -> np.ndarray:
    return np.moveaxis(Rotation.from_euler(order.upper(), angles).as_matrix(), 0, 2)


@given(st.integers(0, 2**32), st.sampled_from(ORDERS), st.booleans())
def test_euler_angles_make_the_matrix(seed: int, order: str, locked: bool) -> None:
    random = np.random.default_rng(seed)
    made = turns(random.uniform(-np.pi, np.pi, (20, 3)), order)
    if locked:
        angles = random.uniform(-np.pi, np.pi, (20, 3))
        angles[::2, 1] = np.pi / 2
        angles[1::4, 1] = -np.pi / 2 + random.uniform(-1e-9, 1e-9, 5)
        made = turns(angles, order)
    assert np.abs(turns(euler_angles(made, order), order) - made).max() < 1e-13
    assert euler_angles(made[:, :, :0], order).shape == (0, 3)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_are_continuous(order: str) -> None:
    """Through the second angle's 90 degrees, and around and around."""
    time = np.linspace(0, 1, 500)[:, None]
    angles = time * [9.0, 4.0, -11.0] + [0.1, 0.2, 0.3]
    assert np.abs(euler_angles(turns(angles, order), order) - angles).max() < 1e-9


def test_an_order_away_from_gimbal_lock() -> None:
    time = np.linspace(0, 1, 50)[:, None]
    assert euler_order(turns(time * [2.0, 1.2, 2.0], "zyx")) == "zyx"
    steep = turns(time * [0.1, 1.57, 0.1], "zyx")
    order = euler_order(steep)
    assert np.abs(euler_angles(steep, order)[:, 1]).max() < np.deg2rad(60)


def test_the_end_of_a_bone_stays_where_a_child_leaves_it() -> None:
    """A child that begins at the tail and then moves does not stand for it."""
    bone = Joint("bone", tails=((1.0, 0.0, 0.0),))
    child = Joint("child", 0, (1.0, 0.0, 0.0), channels=(Channel("tx"),), adds_to_offset=False)
    skeleton = Skeleton((bone, child), unit_cm=1.0, intrinsic=False)
    motion = Motion(skeleton, (Signal(np.array([[5.0], [7.0]])),), Fraction(120))
    before, after = positions(motion), positions(mcz.convert(motion, "bvh"))
    assert farthest(before, after) < 1e-12


@given(skeletons(), st.integers(0, 2**32))
def test_any_skeleton_to_bvh(skeleton: Skeleton, seed: int) -> None:
    """Scales, lengths, quaternions, axes and radians included."""
    plain = [
        replace(joint, channels=tuple(c for c in joint.channels if c.kind))
        for joint in skeleton.joints
    ]
    skeleton = replace(skeleton, joints=tuple(plain))
    motion = Motion(skeleton, (Signal(values_for(skeleton, seed=seed)),), Fraction(120))
    converted = mcz.convert(motion, "bvh")
    before, after = positions(motion), positions(converted)
    assert farthest(before, after) < 1e-9 * (1 + reach(skeleton))
    again = read(converted_files(motion, "bvh"), "bvh")
    assert farthest(before, positions(again)) < 1e-4


@given(skeletons(), st.integers(0, 2**32))
def test_any_plain_bvh_to_amc(skeleton: Skeleton, seed: int) -> None:
    """One root, no channels that Acclaim lacks, positions on the root alone."""
    joints = []
    for index, joint in enumerate(skeleton.joints):
        kinds = ("rx", "ry", "rz") if index else ("rx", "ry", "rz", "tx", "ty", "tz")
        kept = tuple(c for c in joint.channels if c.kind in kinds)
        joints.append(replace(joint, parent=max(joint.parent, 0) if index else -1, channels=kept))
    skeleton = replace(skeleton, joints=tuple(joints), intrinsic=True)
    motion = Motion(skeleton, (Signal(values_for(skeleton, seed=seed)),))
    converted = mcz.convert(motion, "amc")
    size = 1 + reach(skeleton)
    assert farthest(positions(motion), positions(converted)) < 1e-9 * size
    again = read(converted_files(motion, "amc", with_skeleton=True), "amc")
    assert again.skeleton.joints == converted.skeleton.joints
    assert farthest(positions(motion), positions(again)) < 1e-9 * size


def test_the_walk_to_bvh() -> None:
    walk = WALKS["amc"]
    converted = mcz.convert(walk, "bvh")
    assert converted.source is None
    assert [len(joint.channels) for joint in converted.skeleton.joints] == [6] + 30 * [3]
    assert len(point_names(converted.skeleton)) == 38
    assert np.abs(np.diff(converted.values, axis=0)).max() < 5  # curves have no jumps
    root = [c.kind for c in converted.skeleton.joints[0].channels]
    assert root == ["tx", "ty", "tz", "rz", "ry", "rx"]
    assert np.abs(converted.values[:, [0, 1, 2, 5, 4, 3]] - walk.values[:, :6]).max() < 1e-9
    text = converted_files(walk, "bvh")["bvh"]
    assert b"Frame Time: 0.00833" in text
    assert farthest(positions(walk), positions(read({"bvh": text}, "bvh"))) < 1e-5


def test_a_bvh_says_what_positions_mean() -> None:
    """Readers guess whether positions add to an offset; without an offset they need not."""
    root = Joint("hips", -1, (0.0, 1.0, 0.0), ((0.0, 1, 0),), channels=POSITION)
    motion = Motion(Skeleton((root,)), (Signal(np.array([[0.0, 0.9, 0]])),), Fraction(120))
    again = read(converted_files(motion, "bvh"), "bvh")
    assert positions(motion)[0, 0].tolist() == positions(again)[0, 0].tolist() == [0, 1.9, 0]


def test_others_read_the_bvh(tmp_path: Path) -> None:
    import pybvh

    path = tmp_path / "walk.bvh"
    path.write_bytes(converted_files(WALKS["amc"], "bvh")["bvh"])
    other = pybvh.read_bvh_file(path, world_up="+y", warn_on_world_up_disagreement=False)
    assert farthest(positions(WALKS["amc"]), other.node_positions()) < 1e-5


def test_the_walk_to_amc_and_back() -> None:
    walk = WALKS["bvh"]
    files = converted_files(walk, "amc", with_skeleton=True)
    again = read(files, "amc")
    assert (again.values[:, :3] == walk.values[:, :3]).all()  # the numbers are the same
    assert farthest(positions(walk), positions(again)) < 1e-9 * reach(walk.skeleton)
    back = mcz.convert(again, "bvh", rate=120)
    assert farthest(positions(walk), positions(back)) < 1e-9 * reach(walk.skeleton)


def test_its_own_format_is_printed_plainly() -> None:
    for to, walk in WALKS.items():
        assert np.array_equal(mcz.convert(walk, to).values, walk.values, equal_nan=True)
    text = converted_files(WALKS["amc"], "amc", with_skeleton=True)
    assert text["amc"] == FORMATS["amc"].write(WALKS["amc"])
    assert text["asf"] == FORMATS["asf"].write(WALKS["amc"].skeleton)
    assert list(converted_files(WALKS["amc"], "amc")) == ["amc"]


@pytest.mark.parametrize("name", ["amc", "bvh"])
def test_points_as_markers(name: str) -> None:
    walk = WALKS[name]
    markers = read(converted_files(walk, "c3d"), "c3d")
    mm = 10 * (walk.skeleton.unit_cm or 0.1)
    assert tuple(joint.name for joint in markers.skeleton.joints) == point_names(walk.skeleton)
    assert markers.skeleton.unit_cm == (0.1 if name == "amc" else None)
    assert np.abs(positions(markers) - mm * positions(walk)).max() < 1e-3
    assert markers.frame_rate == 120


def test_points_of_missing_joints_are_invalid_markers() -> None:
    walk = WALKS["amc"]
    mask = np.ones(walk.values.shape, np.bool_)
    mask[7, walk.skeleton.columns(walk.skeleton.find("ltibia"))[0]] = False
    holed = replace(walk, signals=(replace(walk.signals[0], mask=mask),))
    markers = read(converted_files(holed, "c3d"), "c3d")
    lost = np.argwhere(np.isnan(positions(markers)).any(axis=2)).tolist()
    names = point_names(walk.skeleton)
    assert [(f, names[k]) for f, k in lost] == [(7, "ltibia"), (7, "lfoot"), (7, "ltoes")]
    with pytest.raises(MotionError, match="joint 'ltibia' has no value in frame 7"):
        mcz.convert(holed, "bvh")


def test_positions_that_stand_still_are_offsets() -> None:
    """Exporters give every joint six channels, most of which never change."""
    joints = (
        Joint("hips", channels=POSITION),
        Joint("knee", 0, (1.0, 1, 1), (), channels=POSITION, adds_to_offset=False),
        Joint("foot", 1, (1.0, 1, 1), ((0.0, 1, 0),), channels=POSITION),
    )
    values = np.tile(np.arange(9.0), (4, 1))
    values[:, 0] = range(4)
    motion = Motion(Skeleton(joints), (Signal(values),))
    converted = mcz.convert(motion, "amc")
    assert converted.signals[0].n_channels == 3
    assert farthest(positions(motion), positions(converted)) == 0
    values = values.copy()
    values[2, 4] = 0.5
    with pytest.raises(
        MotionError, match="joint 'knee' moves relative to its parent, which ASF cannot express"
    ):
        mcz.convert(Motion(Skeleton(joints), (Signal(values),)), "amc")


def test_names_that_acclaim_lacks() -> None:
    names = ("Hips", "left (leg)", "left  leg", "#", "root", "left__leg")
    joints = tuple(
        Joint(name, number - 1, (0.0, 1, 0), channels=(Channel("rx"),))
        for number, name in enumerate(names)
    )
    motion = Motion(Skeleton(joints), (Signal(np.zeros((1, 6))),))
    converted = mcz.convert(motion, "amc")
    found = [joint.name for joint in converted.skeleton.joints]
    assert len(set(found)) == len(found)
    assert converted_files(motion, "amc", with_skeleton=True)["asf"]


def test_exceptions_and_grid_changes_move_with_their_column(tmp_path: Path) -> None:
    text = mcz_bvh(["1 2 3 4.5 5 6", "1e-9 2 3 4.25 0.1250000001 6", "1 2 3 4.5 5.5 NaN"])
    motion = FORMATS["bvh"].read(text)
    again = read(converted_files(motion, "amc", with_skeleton=True), "amc")
    assert np.array_equal(again.values, motion.values[:, [0, 1, 2, 5, 4, 3]], equal_nan=True)


def mcz_bvh(rows: list[str]) -> bytes:
    head = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition "
    head += "Zrotation Yrotation Xrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\n"
    head += f"Frames: {len(rows)}\nFrame Time: 0.01\n"
    return (head + "\n".join(rows) + "\n").encode()


def test_refusals() -> None:
    amc, bvh, markers = WALKS["amc"], WALKS["bvh"], WALKS["c3d"]
    with pytest.raises(OptionError, match="cannot convert to 'fbx'; the formats are"):
        mcz.convert(amc, "fbx")
    for to in ("bvh", "amc"):
        with pytest.raises(MotionError, match="markers have no skeleton"):
            mcz.convert(markers, to)
    for to in ("bvh", "c3d"):
        with pytest.raises(OptionError, match="frame rate is unknown"):
            mcz.convert(replace(amc, frame_rate=None), to)
    mcz.convert(replace(markers, frame_rate=None), "c3d")
    scalars = tuple(replace(j, channels=(Channel("", "1"),)) for j in amc.skeleton.joints)
    flat = Motion(replace(amc.skeleton, joints=scalars), (Signal(np.zeros((1, 31))),), Fraction(1))
    for to in ("bvh", "c3d"):
        with pytest.raises(MotionError, match="plain scalars"):
            mcz.convert(flat, to)
    turning = Joint("hips", channels=tuple(Channel(kind) for kind in QUATERNION_KINDS))
    gap = Motion(Skeleton((turning,)), (Signal(np.full((1, 4), np.nan)),), Fraction(1))
    for to in ("bvh", "amc"):
        with pytest.raises(MotionError, match=f"{to.upper()} cannot omit values"):
            mcz.convert(gap, to)
    two = replace(bvh.skeleton, joints=(*bvh.skeleton.joints, Joint("prop")))
    with pytest.raises(MotionError, match=r"one root, .* has 2"):
        mcz.convert(replace(bvh, skeleton=two), "amc")
    smile = Joint("face", 0, channels=(Channel("", "smile"),))
    odd = Skeleton((Joint("hips", channels=POSITION), smile))
    with pytest.raises(MotionError, match="ASF cannot hold channel 'smile' of joint"):
        mcz.convert(Motion(odd, (Signal(np.zeros((1, 4))),)), "amc")


@pytest.mark.parametrize("to", ["bvh", "amc", "c3d", "trc", "sto", "mot"])
def test_signals_without_a_place_are_left_out_and_named(to: str) -> None:
    """Signals such as AMASS's soft tissue drop out; the others convert as they would alone."""
    tissue = Signal(np.zeros((240, 8)), name="dmpls", channels=(Channel("", "1"),) * 8)
    for motion in (WALKS["amc"], WALKS["bvh"]):
        more = replace(motion, signals=(*motion.signals, tissue))
        plain, made = mcz.convert(motion, to), mcz.convert(more, to)
        assert [signal.name for signal in made.signals] == [s.name for s in plain.signals]
        assert made.values.tobytes() == plain.values.tobytes()
        losses = set(mcz.conversion_losses(more, to)) - set(mcz.conversion_losses(motion, to))
        assert losses == {"left out: signal dmpls"}


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("cmu/amc/17_10.amc", ""),
        ("cmu/amc/01_01.amc", ""),
        ("cmu/amc-variants/16_11-96dof-reexport.amc", r"16\.asf; the dofs of lhipjoint"),
        # lower case, other keys
        ("other/endorphin/walking.amc", r"skeleton\.asf, the only one around whose bones fit"),
        ("other/acclaim-forrest/Forrest.Walking.AMC", ""),
    ],
)
def test_real_acclaim_clips(data: Path, tmp_path: Path, name: str, said: str) -> None:
    """Through an .mcz to BVH, read again, and back to AMC and ASF."""
    with pytest.warns(mcz.SkeletonWarning, match=said) if said else nullcontext():
        mcz.encode(data / name, tmp_path / "clip.mcz", rate=120)
    original = mcz.read(tmp_path / "clip.mcz")
    before, size = positions(original), reach(original.skeleton)
    assert farthest(before, positions(mcz.convert(original, "bvh"))) < 1e-9 * size
    bvh = read(converted_files(original, "bvh"), "bvh")
    assert farthest(before, positions(bvh)) < 1e-6 * size
    amc = read(converted_files(bvh, "amc", with_skeleton=True), "amc")
    assert farthest(before, positions(amc)) < 1e-6 * size


@pytest.mark.real
@pytest.mark.parametrize(
    "name",
    [
        "cmu/bvh/01_01.bvh",
        "cmu/bvh-3dsmax/131_01.bvh",  # two orders of rotation
        "cmu/bvh-daz/01_01.bvh",
        "cmu/bvh-iclone/001_01.bvh",
        "other/makehuman/walk1.bvh",
        "other/pybvh/rotation_first_root.bvh",
        "other/mocap-bvh-kevinxie4c/sample_del_1.bvh",
    ],
)
def test_real_bvh_clips(data: Path, name: str) -> None:
    original = mcz.read(data / name)
    again = read(converted_files(original, "amc", with_skeleton=True), "amc")
    before, after = positions(original)[:300], positions(again)[:300]
    assert farthest(before, after) < 1e-9 * reach(original.skeleton)


@pytest.mark.real
def test_real_refusal(data: Path) -> None:
    motion = mcz.read(data / "other/bandai-namco/dataset-2_run_normal_016.bvh")
    with pytest.raises(
        MotionError, match="joint 'Hips' moves relative to its parent, which ASF cannot express"
    ):
        mcz.convert(motion, "amc")
