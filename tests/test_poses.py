"""Poses as arrays: against the chain, SciPy and pybvh; parts as the whole; rates and gaps."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pybvh
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.kinematics.chain import Chain
from mcz.kinematics.points import positions_of
from mcz.kinematics.poses.conversions import FORMS, continuous_signs, from_matrices
from tests.motions import smooth
from tests.skeletons import skeletons, values_for
from tests.test_rotations import matrices_of

FORM_NAMES = st.sampled_from(sorted(FORMS))


def motion_of(skeleton: Skeleton, n_frames: int = 7, rate: int | None = 100) -> Motion:
    return Motion(skeleton, (Signal(values_for(skeleton, n_frames)),), frame_rate=rate)


@given(skeletons())
def test_rotations_are_those_of_the_chain(skeleton: Skeleton) -> None:
    motion = motion_of(skeleton)
    chain = Chain(skeleton)
    ((_, _, pose),) = chain.poses(motion.values)
    world = mcz.rotations(motion, "matrix", space="world")
    local = mcz.rotations(motion, "matrix")
    for joint, (axes, own) in enumerate(zip(pose.axes, chain.turned, strict=True)):
        turned = np.moveaxis(np.broadcast_to(axes, (3, 3, 7)), 2, 0)
        turned = turned if own is None else turned @ own.T
        np.testing.assert_allclose(world[:, joint], turned, atol=1e-12)
        parent = skeleton.joints[joint].parent
        above = world[:, parent] if parent >= 0 else np.eye(3)
        np.testing.assert_allclose(above @ local[:, joint], turned, atol=1e-12)


@given(skeletons(), FORM_NAMES, st.sampled_from(["XYZ", "zxy", "ZYZ"]))
def test_every_form_leads_back(skeleton: Skeleton, form: str, order: str) -> None:
    motion = motion_of(skeleton)
    turns = mcz.rotations(motion, form, order=order)
    back = matrices_of(turns, form, order)
    np.testing.assert_allclose(back, mcz.rotations(motion, "matrix"), atol=1e-7)
    assert mcz.rotations(motion, form, order=order, dtype="float32").dtype == np.float32


def test_at_rest_nothing_is_turned() -> None:
    skeleton = smooth().skeleton
    rest = Motion(skeleton, (Signal(np.zeros((2, 10))),))
    quaternions = mcz.rotations(rest, "quat", space="world")
    np.testing.assert_allclose(quaternions, np.broadcast_to([1.0, 0, 0, 0], quaternions.shape))


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_quaternions_keep_their_sign(seed: int, gap: bool) -> None:
    random = np.random.default_rng(seed)
    steps = Rotation.from_rotvec(random.normal(size=(40, 3)) * 0.4)
    turns = [Rotation.random(random_state=seed)]
    for step in steps:
        turns.append(turns[-1] * step)
    quaternions = np.stack([t.as_quat(scalar_first=True) for t in turns])
    quaternions *= random.choice([-1.0, 1.0], size=(41, 1))
    if gap:
        quaternions[20:23] = np.nan
    found = continuous_signs(quaternions[:, None].copy())[:, 0]
    np.testing.assert_array_equal(np.abs(found), np.abs(quaternions))
    dots = (found[1:] * found[:-1]).sum(axis=1)
    assert (dots[~np.isnan(dots)] > 0).all()
    assert found[0, 0] >= 0 and (not gap or found[23, 0] >= 0)


@given(st.data())
def test_a_part_is_the_part_of_the_whole(data: st.DataObject) -> None:
    motion = smooth(30)
    start = data.draw(st.integers(0, 30))
    stop = data.draw(st.integers(start, 30))
    joints = data.draw(st.lists(st.sampled_from(["hips", "fixed", 3]), min_size=1, unique=True))
    numbers = [motion.skeleton.find(joint) for joint in joints]
    for of in (mcz.positions, mcz.velocities, mcz.accelerations):
        whole = of(motion, joints)
        np.testing.assert_array_equal(of(motion, joints, (start, stop)), whole[start:stop])
        np.testing.assert_array_equal(of(motion, joints, slice(start, stop)), whole[start:stop])
    for space in ("local", "world"):
        whole = mcz.rotations(motion, "6d", space=space)
        part = mcz.rotations(motion, "6d", space=space, joints=joints, frames=(start, stop))
        np.testing.assert_array_equal(part, whole[start:stop, numbers])


def test_a_clip_gives_what_its_motion_gives(tmp_path: Path) -> None:
    motion = smooth(60)
    mcz.write(motion, tmp_path / "smooth.mcz")
    with mcz.open(tmp_path / "smooth.mcz") as file:
        clip = file.clips["smooth"]
        assert clip.joint_names == ("hips", "spine", "fixed", "knee")
        assert clip.point_names == mcz.point_names(motion)
        np.testing.assert_array_equal(
            clip.positions(["spine", "hips"], (10, 20)),
            mcz.positions(motion, ["spine", "hips"])[10:20],
        )
        np.testing.assert_array_equal(
            clip.rotations("6d", joints="knee", frames=slice(-5, None)),
            mcz.rotations(motion, "6d")[-5:, [3]],
        )
        np.testing.assert_array_equal(clip.root().positions, mcz.root(motion).positions)
        for name in ("velocities", "accelerations"):
            np.testing.assert_array_equal(
                getattr(clip, name)(frames=(3, 9)), getattr(mcz, name)(motion)[3:9]
            )
        with pytest.raises(mcz.MotionError, match="foot"):
            clip.contacts()
        assert clip.contacts("knee") == mcz.contacts(motion, ["knee"])


def test_points_are_named_as_joints_and_end_sites_are() -> None:
    motion = smooth(3)
    whole = mcz.positions(motion)
    assert mcz.point_names(motion) == ("hips", "spine", "spine end", "fixed", "knee")
    positions = mcz.positions(motion, ["spine end", "knee", 2])
    np.testing.assert_array_equal(positions, whole[:, [2, 4, 3]])
    assert mcz.point_names(motion, ["spine end", "knee", 2]) == ("spine end", "knee", "fixed")
    with pytest.raises(mcz.MotionError, match="did you mean 'spine end'"):
        mcz.positions(motion, "spine ende")


def test_units() -> None:
    motion = smooth(3)
    np.testing.assert_allclose(mcz.positions(motion, unit="mm"), mcz.positions(motion) * 25)
    np.testing.assert_allclose(
        mcz.root(motion, unit="m").positions, mcz.root(motion).positions * 0.025
    )
    nameless = replace(motion, skeleton=replace(motion.skeleton, unit_cm=None))
    with pytest.raises(mcz.OptionError, match="length unit .*is unknown"):
        mcz.positions(nameless, unit="cm")
    with pytest.raises(mcz.OptionError, match="unit 'ell' is unknown"):
        mcz.positions(motion, unit="ell")


def test_what_is_asked_for_wrongly() -> None:
    motion = smooth(5)
    for words, wrong in {
        "unknown rotations 'quaternion'": {"form": "quaternion"},
        "space 'global'": {"space": "global"},
        "Euler order is 'XYx'; it must be three axes, such as ZXY": {
            "form": "euler",
            "order": "XYx",
        },
        "degrees has no meaning": {"degrees": True},
        "5 frames, not 2:9": {"frames": (2, 9)},
        "but a step is not supported; take every n-th frame of the result": {
            "frames": slice(0, 5, 2)
        },
        "float64 or float32": {"dtype": "int32"},
    }.items():
        with pytest.raises(mcz.OptionError, match=words):
            mcz.rotations(motion, **wrong)
    with pytest.raises(mcz.OptionError, match="frame rate is unknown"):
        mcz.velocities(replace(motion, frame_rate=None))


def test_headings_count_turns() -> None:
    """A joint that spins about what is up, and leans: the twist is the spin."""
    joint = Joint("top", channels=tuple(Channel(kind) for kind in ("ry", "rx")))
    spin = np.linspace(0, 900, 50)
    values = np.stack([spin, np.full(50, 20.0)], axis=1)
    motion = Motion(Skeleton((joint,), up_axis="y"), (Signal(values),))
    np.testing.assert_allclose(mcz.root(motion).headings, np.radians(spin), atol=1e-9)
    down = replace(motion, skeleton=Skeleton((joint,), up_axis="-y"))
    np.testing.assert_allclose(mcz.root(down).headings, np.radians(-spin), atol=1e-9)
    with pytest.raises(mcz.OptionError, match="the up axis is unknown; set it with up="):
        _ = mcz.root(replace(motion, skeleton=Skeleton((joint,)))).headings


def one_column(values: list[float], rate: int = 2) -> Motion:
    joint = Joint("root", channels=(Channel("tx"),))
    array = np.array(values)[:, None]
    signal = Signal(array, mask=~np.isnan(array))
    return Motion(Skeleton((joint,)), (signal,), frame_rate=rate)


def test_differences_stop_at_gaps() -> None:
    nan = np.nan
    motion = one_column([0, 1, 4, nan, 16, nan, 36, 49, 64, 81])
    speeds = mcz.velocities(motion)[:, 0, 0]
    np.testing.assert_array_equal(speeds, [2, 4, 6, nan, nan, nan, 26, 28, 32, 34])
    changes = mcz.accelerations(motion)[:, 0, 0]
    np.testing.assert_array_equal(changes, [8, 8, 8, nan, nan, nan, 8, 8, 8, 8])
    whole = one_column([float(n**3) for n in range(9)])
    np.testing.assert_allclose(
        mcz.velocities(whole)[:, 0, 0], np.gradient(whole.values[:, 0]) * 2, rtol=1e-12
    )


@given(skeletons(), st.sampled_from([30, 50, 100, 250, Fraction(30000, 1001)]))
def test_resampled_turns_are_slerps(skeleton: Skeleton, rate: Fraction | int) -> None:
    motion = motion_of(skeleton, 6)
    other = mcz.resample(motion, rate)
    times = np.arange(other.n_frames) / float(rate)
    assert other.n_frames == int(Fraction(5, 100) * rate) + 1 and other.frame_rate == rate
    before, after = mcz.rotations(motion, "matrix"), mcz.rotations(other, "matrix")
    for number, joint in enumerate(skeleton.joints):
        kinds = [channel.kind for channel in joint.channels]
        axes = [kind for kind in kinds if kind in ("rx", "ry", "rz")]
        alone = len(axes) == 3 == len(set(axes)) or len(axes) == 1
        whole = [part for part in ("qw qx qy qz", "vx vy vz") if set(part.split()) <= set(kinds)]
        if whole:
            alone = not axes and len(whole) == 1
        if alone and "length" not in kinds:
            slerp = Slerp(np.arange(6) / 100, Rotation.from_matrix(before[:, number]))
            wanted = slerp(np.minimum(times, 0.05)).as_matrix()
            np.testing.assert_allclose(after[:, number], wanted, atol=1e-6)


def test_quaternions_need_no_angle_unit_to_turn() -> None:
    """As those of Motive and of arrays, which state none."""
    joint = mcz.Joint("a", channels=tuple(mcz.Channel(f"q{part}") for part in "xyzw"))
    turns = Rotation.from_rotvec(np.outer(np.arange(6.0) ** 2, [0.05, 0.02, -0.03]))
    signal = mcz.Signal(turns.as_quat())
    motion = mcz.Motion(mcz.Skeleton((joint,), angle_unit=""), (signal,), 100)
    found = mcz.resample(motion, 250)
    expected = Slerp(np.arange(6) / 100, turns)(np.arange(found.n_frames) / 250)
    np.testing.assert_allclose(found.values, expected.as_quat(), atol=1e-12)


def test_frames_that_coincide_are_the_same_bits() -> None:
    motion = smooth(41)  # 120 a second
    twice = mcz.resample(motion, 240)
    np.testing.assert_array_equal(twice.values[::2], motion.values)
    third = mcz.resample(motion, 40)
    np.testing.assert_array_equal(third.values, motion.values[::3])
    assert third.frame_rate == 40 and third.n_frames == 14


def test_positions_follow_cubics() -> None:
    """A parabola is followed exactly, but for the first and last stretch, and a gap stays one."""
    motion = one_column([float(n * n) for n in range(9)], 10)
    resampled = mcz.resample(motion, 40).values[:, 0]
    times = np.arange(len(resampled)) / 4
    np.testing.assert_allclose(resampled[4:-4], times[4:-4] ** 2, atol=1e-12)
    gap = one_column([0.0, 1.0, 2.0, np.nan, 4.0, 5.0], 10)
    np.testing.assert_allclose(
        mcz.resample(gap, 20).values[:, 0], [0, 0.5, 1, 1.5, 2, *[np.nan] * 3, 4, 4.5, 5]
    )


def test_what_cannot_be_resampled(samples: Path) -> None:
    walk = mcz.read(samples / "walk.c3d")
    with pytest.raises(mcz.OptionError, match="residuals"):
        mcz.resample(walk, 30)
    resampled = mcz.resample(walk, 30, drop_signals=True)
    assert [signal.name for signal in resampled.signals] == ["motion"] and resampled.n_frames == 60
    with pytest.raises(mcz.OptionError, match="frame rate is unknown"):
        mcz.resample(mcz.read(samples / "walk.amc"), 30)
    with pytest.raises(mcz.MotionError, match="frame rate"):
        mcz.resample(walk, 0, drop_signals=True)
    with pytest.raises(mcz.OptionError, match="too many frames"):
        mcz.resample(smooth(), 1e12)


def test_resampled_motions_can_be_written(samples: Path, tmp_path: Path) -> None:
    motion = mcz.resample(mcz.read(samples / "walk.bvh", unit="cm"), 30)
    mcz.write(motion, tmp_path / "slow.mcz")
    with mcz.open(tmp_path / "slow.mcz") as file:
        clip = file.only_clip()
        assert clip.frame_rate == 30
        np.testing.assert_array_equal(clip.read(), motion.values)


def test_one_more_party(samples: Path) -> None:
    motion, other = mcz.read(samples / "walk.bvh"), pybvh.read_bvh_file(str(samples / "walk.bvh"))
    np.testing.assert_allclose(mcz.positions(motion), other.node_positions(), atol=1e-9)
    np.testing.assert_allclose(mcz.rotations(motion, "6d"), other.to_6d()[1], atol=1e-12)
    np.testing.assert_allclose(
        mcz.rotations(mcz.resample(motion, 30), "matrix"),
        other.resample(30).to_rotmat()[1],
        atol=1e-9,
    )


@given(skeletons(), st.data())
def test_unknown_values_lose_what_depends_on_them(skeleton: Skeleton, data: st.DataObject) -> None:
    values = values_for(skeleton)
    cell = data.draw(st.integers(0, 6)), data.draw(st.integers(0, skeleton.n_channels - 1))
    values[cell] = np.nan
    motion = Motion(skeleton, (Signal(values),))
    positions = mcz.positions(motion)
    np.testing.assert_array_equal(
        np.isnan(positions), np.isnan(positions_of(skeleton, values)), strict=True
    )


def test_a_joint_that_turns_unknown_stays_where_it_is() -> None:
    motion = smooth(3)  # which only turns and moves: compiled
    values = motion.values.copy()
    values[1, 7] = values[2, 9] = np.nan  # of the spine, of the knee
    positions = mcz.positions(motion.with_values(values))
    lost = np.isnan(positions).all(axis=2)
    assert [mcz.point_names(motion)[n] for n in np.flatnonzero(lost[1])] == ["spine end", "fixed"]
    assert not lost[[0, 2]].any()


def test_what_is_invalid_is_nan_in_every_form() -> None:
    motion = smooth(4)
    mask = np.ones((4, 10), bool)
    mask[2, 7] = False  # of the spine
    motion = replace(motion, signals=(replace(motion.signals[0], mask=mask),))
    for form in FORMS:
        turns = mcz.rotations(motion, form)
        assert np.isnan(turns[2, 1]).all() and np.isfinite(np.delete(turns, 1, axis=1)).all()
    assert np.isnan(from_matrices(np.full((1, 1, 3, 3), np.nan), "euler")).all()
