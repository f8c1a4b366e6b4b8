"""A motion on other bones: the same turns in the world, the root's way in proportion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.points import origins_of, places_of, reach
from mcz.kinematics.retargeting.joint_maps import SKELETONS, SMPL_BODY
from mcz.kinematics.retargeting.retargeting import size_ratio
from mcz.kinematics.retargeting.turns import _least_turn
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.motions import POSITIONS, ROTATIONS, smooth
from tests.skeletons import VECTORS, skeletons, values_for

ORDERS = ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx")


def world_turns(motion: Motion) -> np.ndarray:
    """W of every joint, (n_frames, n_joints, 3, 3), by other means: points beside the joints."""
    skeleton, values = replace(motion.skeleton, unit_cm=1.0), motion.values
    shell = places_of(skeleton, values, shell_cm=1.0).shell.reshape(len(values), -1, 3, 3)
    return np.swapaxes(shell - origins_of(skeleton, values)[:, :, None], 2, 3)


def degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angles between rotations, (..., 3, 3)."""
    half = np.sqrt(((a - b) ** 2).sum(axis=(-2, -1)) / 8)
    return np.degrees(2 * np.arcsin(np.minimum(half, 1)))


def origins(motion: Motion) -> np.ndarray:
    return origins_of(motion.skeleton, motion.values)


@st.composite
def turning_skeleton(draw: st.DrawFn, parents: list[int], how: str = "euler") -> Skeleton:
    """A skeleton of these parents, each of whose joints turns as it likes."""
    made = []
    for number, parent in enumerate(parents):
        kinds = [f"r{letter}" for letter in draw(st.sampled_from(ORDERS))]
        if draw(st.integers(0, 4)) == 0:
            kinds = ["qw", "qx", "qy", "qz"]
        moves = POSITIONS if number == 0 else ()
        axis = draw(st.sampled_from([(0.0, 0.0, 0.0), (10.0, -70.0, 35.0)]))
        order = draw(st.sampled_from(ORDERS)).upper()
        channels = (*moves, *map(Channel, kinds))
        adds = draw(st.booleans())
        joint = Joint(f"j{number}", parent, draw(VECTORS), (), axis, order, channels, adds)
        made.append(joint)
    unit = draw(st.sampled_from(["deg", "rad"]))
    return Skeleton(tuple(made), angle_unit=unit, intrinsic=draw(st.booleans()))


@st.composite
def two_alike(draw: st.DrawFn) -> tuple[Skeleton, Skeleton]:
    """Two skeletons of the same names and parents, and of nothing else in common."""
    n_joints = draw(st.integers(1, 5))
    parents = [-1, *(draw(st.integers(0, k - 1)) for k in range(1, n_joints))]
    return draw(turning_skeleton(parents)), draw(turning_skeleton(parents))


@given(two_alike())
def test_joints_turn_alike_on_other_bones(pair: tuple[Skeleton, Skeleton]) -> None:
    source, target = pair
    motion = Motion(source, (Signal(values_for(source)),))
    made = mcz.retarget(motion, target, scale=2.0, match_rest=())
    assert made.skeleton == target
    assert np.abs(world_turns(made) - world_turns(motion)).max() < 1e-9
    assert np.abs(origins(made)[:, 0] - 2 * origins(motion)[:, 0]).max() < 1e-9


@given(skeletons())
def test_a_motion_on_its_own_skeleton_stays_where_it_is(skeleton: Skeleton) -> None:
    """Whatever its channels turn; stretched bones and a second turn about one axis are no turns."""
    plain = ("tx", "ty", "tz", "rx", "ry", "rz", "qw", "qx", "qy", "qz")
    joints = []
    for joint in skeleton.joints:
        kinds = [c.kind for c in joint.channels if c.kind in plain]
        kinds = [k for k in kinds if k[0] != "r" or "qw" not in kinds]
        kinds = [k for n, k in enumerate(kinds) if k[0] != "t" or k not in kinds[:n]]
        joints.append(replace(joint, channels=tuple(map(Channel, kinds))))
    skeleton = replace(skeleton, joints=tuple(joints))
    values = values_for(skeleton)
    motion = Motion(skeleton, (Signal(values),))
    places = origins(motion)
    assume(np.abs(places).max() < 1e3)
    made = mcz.retarget(motion, skeleton, {n: n for n in skeleton.joint_names}, scale=1)
    assert np.abs(origins(made) - places).max() < 1e-9


@pytest.mark.parametrize("walk", [acclaim_walk(), bvh_walk()], ids=["amc", "bvh"])
def test_longer_legs_make_longer_steps(walk: Motion) -> None:
    """Bones of 1.5 times the length, which turn alike, take everything 1.5 times as far."""
    longer = replace(
        walk.skeleton,
        joints=tuple(
            replace(
                joint,
                offset=tuple(1.5 * part for part in joint.offset),
                tails=tuple(tuple(1.5 * x for x in tail) for tail in joint.tails),
            )
            for joint in walk.skeleton.joints
        ),
    )
    made = mcz.retarget(walk, longer)
    size = reach(walk.skeleton)
    assert np.abs(mcz.positions(made) - 1.5 * mcz.positions(walk)).max() < 1e-9 * size
    assert made.source is None
    assert (made.frame_rate, made.name) == (walk.frame_rate, walk.name)
    assert np.abs(
        origins(mcz.retarget(walk, longer, scale=1))[:, 0] - origins(walk)[:, 0]
    ).max() < (1e-9 * size)


def test_heights_of_hips_give_the_scale() -> None:
    """Bones from hip to foot count, legs straight, and how far down the one to the hip leads."""
    legs = (
        Joint("hips"),
        Joint("LHip", 0, (1.0, -0.5, 0.0)),
        Joint("LKnee", 1, (0.6, -0.8, 0.0)),
        Joint("LFoot", 2, (0.0, -1.0, 0.0)),
        Joint("LToe", 3, (0.0, 0.0, 9.0)),
        Joint("RHip", 0, (-1.0, -0.5, 0.0)),
        Joint("RKnee", 5, (-0.6, -0.8, 0.0)),
        Joint("RFoot", 6, (0.0, -1.0, 0.0)),
    )
    ours = Skeleton(legs)
    straight = [
        Joint("hips"),
        *(Joint(f"{s} hip", 0, (x, 0.0, 0.0)) for s, x in (("l", 1.0), ("r", -1.0))),
        *(Joint(f"{s} shin", k, (0.0, -5.0, 0.0)) for k, s in ((1, "l"), (2, "r"))),
    ]
    theirs = Skeleton(tuple(straight))
    same = {k: k for k in range(len(legs))}
    doubled = [replace(j, offset=tuple(2 * x for x in j.offset)) for j in legs]
    assert size_ratio(Skeleton(tuple(doubled)), ours, same) == 2
    assert size_ratio(ours, theirs, {0: 0, 3: 3, 7: 4}) == pytest.approx(2.5 / 5)
    # Without feet all bones count, without bones nothing does.
    assert size_ratio(ours, theirs, {0: 0, 2: 3}) == pytest.approx((np.sqrt(1.25) + 1) / 6)
    assert size_ratio(ours, theirs, {0: 0}) == 1
    # One leg leads from the root straight to the foot.
    one = Skeleton((Joint("a"), Joint("b", 0, (0, -2, 0)), Joint("foot_l", 1, (0, -3, 0))))
    assert size_ratio(one, theirs, {0: 0, 2: 3}) == pytest.approx(5 / (5 + 1 / np.sqrt(26)))


def test_joints_below_make_up_for_what_a_joint_cannot_do() -> None:
    free = Skeleton(
        tuple(Joint(f"j{k}", k - 1, (0, 1, 0), (), channels=ROTATIONS) for k in range(3))
    )
    hinge = replace(free.joints[1], channels=(Channel("rx"),))
    target = replace(free, joints=(free.joints[0], hinge, free.joints[2]))
    motion = Motion(free, (Signal(values_for(free)),))
    made = mcz.retarget(motion, target)
    wrong = degrees(world_turns(made), world_turns(motion))
    assert wrong[:, [0, 2]].max() < 1e-6 < wrong[:, 1].max()


def test_joints_that_are_left_out_rest_and_others_turn_for_them() -> None:
    free = Skeleton(
        (
            Joint("a", channels=POSITIONS + ROTATIONS),
            *(Joint(name, k, (0, 1, 0), (), channels=ROTATIONS) for k, name in enumerate("bc")),
        )
    )
    motion = Motion(free, (Signal(values_for(free)),))
    made = mcz.retarget(motion, free, {"a": "a", "c": "c"})
    assert not made.values[:, 6:9].any()
    assert np.abs(world_turns(made) - world_turns(motion))[:, [0, 2]].max() < 1e-9
    # The root stays where it is, and what is next carries the motion.
    only = mcz.retarget(motion, free, {"a": "b"}, scale=1)
    assert np.abs(origins(only)[:, 1] - origins(motion)[:, 0]).max() < 1e-9
    assert np.abs(world_turns(only)[:, 1] - world_turns(motion)[:, 0]).max() < 1e-9


def test_other_positions_keep_what_they_add_to_rest() -> None:
    """One joint adds positions to its offset, the other replaces it."""

    def skeleton(offset: tuple[float, float, float], adds: bool) -> Skeleton:
        joint = Joint("b", 0, offset, channels=POSITIONS + ROTATIONS, adds_to_offset=adds)
        return Skeleton(
            (Joint("a", channels=POSITIONS + ROTATIONS), joint, replace(joint, name="c"))
        )

    source, target = skeleton((1.0, 2.0, 3.0), False), skeleton((2.0, 4.0, 6.0), True)
    motion = Motion(source, (Signal(values_for(source)),))
    made = mcz.retarget(motion, target, {"a": "a", "b": "b"}, scale=2)
    assert np.abs(origins(made)[:, :2] - 2 * origins(motion)[:, :2]).max() < 1e-9
    assert not made.values[:, 12:].any()
    back = mcz.retarget(made, source, {"a": "a", "b": "b"}, scale=0.5)
    assert np.abs(back.values[:, 12:] - [[1, 2, 3, 0, 0, 0]]).max() == 0
    assert np.abs(origins(back) - origins(motion))[:, :2].max() < 1e-9


def test_unknown_values_leave_the_rest_known() -> None:
    walk = bvh_walk()
    values = walk.values.copy()
    column = walk.skeleton.columns(walk.skeleton.find("LeftLeg"))[1]
    values[10:12, column] = np.nan
    values[:, walk.skeleton.columns(walk.skeleton.find("Head"))[0]] = np.nan
    made = mcz.retarget(walk.with_values(values), walk.skeleton)
    unknown = {walk.skeleton.joint_names[k]: set() for k in range(walk.skeleton.n_joints)}
    for row, number in np.argwhere(np.isnan(made.values)).tolist():
        joint = next(k for k in range(len(unknown)) if number in walk.skeleton.columns(k))
        unknown[walk.skeleton.joint_names[joint]].add(row)
    assert {k: v for k, v in unknown.items() if v} == {"LeftLeg": {10, 11}, "Head": set(range(240))}
    assert made.signals[0].mask is not None
    rows = [k for k in range(240) if k not in (10, 11)]
    steps = origins(walk)[rows] - origins(made)[rows]
    known = [k for k, n in enumerate(walk.skeleton.joint_names) if "Leg" not in n and n != "Head"]
    assert np.nanmax(np.abs(steps[:, known])) < 1e-9


@given(VECTORS, VECTORS)
def test_the_least_turn_turns_one_bone_to_another(a: tuple, b: tuple) -> None:
    one, other = np.array(a), np.array(b)
    for end in (other, -one, 2 * one):
        turn = _least_turn(one, end)
        if turn is None:
            assert not one.any() or not end.any()
            continue
        assert np.abs(turn @ turn.T - np.eye(3)).max() < 1e-9
        assert np.linalg.det(turn) == pytest.approx(1)
        along = turn @ one * np.linalg.norm(end) / np.linalg.norm(one)
        assert np.abs(along - end).max() < 1e-6


def test_bones_point_alike_where_rest_poses_do_not() -> None:
    """Arms that hang down at rest are held out, as those of the motion; hands turn along."""

    def arm(direction: tuple[float, float, float]) -> Skeleton:
        names = ("chest", "arm", "forearm", "hand")
        joints = [Joint("chest", channels=POSITIONS + ROTATIONS)]
        joints += [
            Joint(name, k, direction if k else (1.0, 1.0, 0.0), channels=ROTATIONS)
            for k, name in enumerate(names[1:])
        ]
        joints[3] = replace(joints[3], tails=((0.0, 0.0, 0.0),))
        return Skeleton(tuple(joints))

    out, down = arm((3.0, 0.0, 0.0)), arm((0.0, -3.0, 0.0))
    motion = Motion(out, (Signal(values_for(out)),))
    made = mcz.retarget(motion, down, scale=1, match_rest=["arm", "forearm"])
    assert np.abs(origins(made) - origins(motion)).max() < 1e-9
    quarter = degrees(world_turns(made), world_turns(motion))
    assert np.abs(quarter - [0, 90, 90, 90]).max() < 1e-6
    back = mcz.retarget(made, out, scale=1, match_rest=["arm", "forearm"])
    assert np.abs(world_turns(back) - world_turns(motion)).max() < 1e-9
    for name, reason in (
        ("hand", "retarget: match_rest: joint 'hand' has no bone to align"),
        ("hnad", "did you mean 'hand'"),
    ):
        with pytest.raises(OptionError, match=reason):
            mcz.retarget(motion, down, match_rest=[name])
    two = replace(down, joints=(*down.joints, replace(down.joints[1], name="other arm")))
    forked = Motion(two, (Signal(values_for(two)),))
    with pytest.raises(OptionError, match="'chest' has several bones"):
        mcz.retarget(forked, two, match_rest=["chest"])


def turned_at(skeleton: Skeleton, name: str, turn: np.ndarray) -> Skeleton:
    """The skeleton with the bones from this joint on turned in its rest pose."""
    first, joints, below = skeleton.find(name), list(skeleton.joints), {skeleton.find(name)}
    for number in range(first, len(joints)):
        joint = joints[number]
        if number != first and joint.parent not in below:
            continue
        below.add(number)
        offset = joint.offset if number == first else tuple(turn @ joint.offset)
        tails = tuple(tuple(turn @ tail) for tail in joint.tails)
        joints[number] = replace(joint, offset=offset, tails=tails)
    return replace(skeleton, joints=tuple(joints), source=None)


def test_limbs_of_usual_skeletons_point_alike_by_themselves() -> None:
    """Arms that rest elsewhere point as those of the motion; others are left as they are."""
    walk = bvh_walk()
    usual = {"Toes": "ToeBase", "Wrist": "Hand", "Hand": "FingerBase"}
    motion = mcz.rename(
        walk, {side + old: side + new for side in ("Left", "Right") for old, new in usual.items()}
    )
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    other = turned_at(motion.skeleton, "LeftArm", quarter)
    chain = [motion.skeleton.find(name) for name in ("LeftArm", "LeftForeArm", "LeftHand")]
    away = {}
    for match_rest in ("auto", ()):
        made = mcz.retarget(motion, other, match_rest=match_rest)
        bones = np.diff((origins(made) - origins(motion))[:, chain], axis=1)
        away[match_rest] = float(np.abs(bones).max())
    assert away["auto"] < 1e-4 < 0.1 < away[()]
    same = mcz.retarget(motion, motion.skeleton)
    plain = mcz.retarget(motion, motion.skeleton, match_rest=())
    np.testing.assert_array_equal(same.values, plain.values)


def test_rest_poses_that_differ_are_told_of_other_skeletons() -> None:
    bones = Skeleton(
        (
            Joint("a", channels=POSITIONS + ROTATIONS),
            Joint("b", 0, (0.0, 1.0, 0.0), channels=ROTATIONS, tails=((0.0, 1.0, 0.0),)),
        )
    )
    other = replace(bones, joints=(bones.joints[0], replace(bones.joints[1], offset=(1, 0, 0))))
    motion = Motion(bones, (Signal(values_for(bones)),))
    with pytest.warns(mcz.SkeletonWarning, match=r"a by 90 degrees; match_rest=") as caught:
        retargeted = mcz.retarget(motion, other)
    assert caught[0].filename == __file__
    np.testing.assert_array_equal(
        retargeted.values, mcz.retarget(motion, other, match_rest=()).values
    )
    assert mcz.retarget(motion, other, match_rest="a").n_frames == motion.n_frames


def test_what_cannot_be_done_is_refused() -> None:
    walk = bvh_walk()
    skeleton = walk.skeleton
    same = {name: name for name in skeleton.joint_names}
    headless = mcz.rename(skeleton, {"Head": "Kopf"})
    still = replace(skeleton.joints[0], channels=skeleton.joints[0].channels[3:])
    flat = replace(skeleton.joints[0], channels=skeleton.joints[0].channels[:2])
    up = replace(walk, skeleton=replace(skeleton, up_axis="z"))
    for motion, target, joints, reason in (
        (walk, headless, None, "map it with joint_map=, which leaves out unmapped joints"),
        (mcz.rename(walk, {"Head": "Kopf"}), skeleton, None, "the skeleton has no joint 'Kopf'"),
        (walk, skeleton, {"Haed": "Head"}, "the motion has no joint 'Haed'.*did you mean 'Head'"),
        (walk, skeleton, {"Head": "Haed"}, "the skeleton has no joint 'Haed'.*mean 'Head'"),
        (
            walk,
            skeleton,
            same | {"Neck": "Head"},
            "retarget: joint_map: 'Neck' and 'Head' are both mapped to 'Head'",
        ),
        (walk, skeleton, {}, "retarget: joint_map is empty"),
        (up, replace(skeleton, up_axis="y"), None, "the up axes differ: z in the motion"),
        (
            walk,
            replace(skeleton, joints=(still, *skeleton.joints[1:])),
            None,
            "of the skeleton nor a joint above it has position channels",
        ),
        (
            walk,
            replace(skeleton, joints=(flat, *skeleton.joints[1:])),
            None,
            "lacks channel tz",
        ),
    ):
        with pytest.raises(OptionError, match=reason):
            mcz.retarget(motion, target, joints)
    for scale in (0, -1, np.nan, np.inf):
        with pytest.raises(OptionError, match="retarget: scale is"):
            mcz.retarget(walk, skeleton, scale=scale)
    for motion, target in ((walk, marker_walk().skeleton), (marker_walk(), skeleton)):
        with pytest.raises(MotionError, match="has only markers, which rotate no bones"):
            mcz.retarget(motion, target)
    with pytest.raises(MotionError, match="angle unit .*is unknown"):
        mcz.retarget(walk, replace(skeleton, angle_unit=""))
    assert mcz.retarget(smooth(0), smooth().skeleton).n_frames == 0


def test_joint_maps_of_usual_skeletons() -> None:
    sizes = dict(zip(SKELETONS, (31, 31, 31, 43, 22, 24, 52), strict=True))
    for kind, count in sizes.items():
        own = mcz.joint_map(kind, kind)
        assert len(own) == count
        assert all(one == other for one, other in own.items())
        for other in SKELETONS:
            there, back = mcz.joint_map(kind, other), mcz.joint_map(other, kind)
            assert {b: a for a, b in there.items()} == back
    assert tuple(mcz.joint_map("humanml3d-22", "smpl-24")) == SMPL_BODY
    found = mcz.joint_map("cmu-amc", "smpl-24")
    assert len(found) == 24
    assert [found[k] for k in ("root", "lfemur", "rwrist", "ltoes", "thorax", "lhand")] == [
        *("pelvis", "left_hip", "right_wrist", "left_foot", "spine3", "left_hand")
    ]
    assert "upperneck" not in found and "lhipjoint" not in found
    assert mcz.joint_map("cmu-bvh-daz", "smplh-52")["lMid2"] == "left_middle2"


def test_skeletons_are_known_by_their_names() -> None:
    found = mcz.joint_map(acclaim_walk().skeleton, "cmu-bvh")
    assert found == mcz.joint_map("cmu-amc", "cmu-bvh")
    renamed = mcz.rename(acclaim_walk().skeleton, found | {"lfingers": "LFingers"})
    assert mcz.joint_map(renamed, "cmu-amc") == {
        other if one != "lfingers" else "LFingers": one for one, other in found.items()
    }
    smplh = Skeleton(tuple(Joint(name) for name in SKELETONS["smplh-52"]))
    assert len(mcz.joint_map(smplh, "smplh-52")) == 52
    fewer = Skeleton(smplh.joints[:30])
    assert len(mcz.joint_map(fewer, "smplh-52")) == 22
    body = list(mcz.joint_map("cmu-amc", "humanml3d-22"))
    fingerless = mcz.select(acclaim_walk(), ["lhipjoint", "rhipjoint", "upperneck", *body])
    assert len(mcz.joint_map(fingerless.skeleton, "smpl-24")) == 22
    for known, reason in (
        (smooth().skeleton, "skeleton 'puppet' has the joint names of none of cmu-amc, "),
        ("smpl", "no skeleton 'smpl' among cmu-amc.*did you mean 'smpl-24'"),
        (7, "no skeleton 7 among"),
    ):
        with pytest.raises(OptionError, match=reason):
            mcz.joint_map(known, "cmu-amc")  # type: ignore[arg-type]


@pytest.mark.real
def test_flavors_of_real_clips_are_recognized(data: Path) -> None:
    for path, kind, count in (
        ("cmu/amc/01_01.amc", "cmu-amc", 31),
        ("cmu/bvh/01_01.bvh", "cmu-bvh", 31),
        ("cmu/bvh-blender/02_01.bvh", "cmu-bvh", 31),
        ("cmu/bvh-3dsmax/131_01.bvh", "cmu-bvh-3dsmax", 31),
        ("cmu/bvh-daz/02_01.bvh", "cmu-bvh-daz", 43),
    ):
        decoded = mcz.joint_map(mcz.read(data / path).skeleton, kind)
        assert len(decoded) == count, path


@pytest.mark.real
def test_a_real_clip_on_the_skeleton_of_its_own_conversion(data: Path) -> None:
    """Retargeting an AMC equals a third party's conversion: all turns, to four decimals."""
    motion = mcz.read(data / "cmu/amc/01_01.amc")
    other = mcz.read(data / "cmu/bvh/01_01.bvh")
    made = mcz.retarget(motion, other.skeleton, mcz.joint_map(motion.skeleton, other.skeleton))
    turned = degrees(world_turns(made), world_turns(other)[1:])
    size = reach(other.skeleton)
    away = np.linalg.norm(origins(made) - origins(other)[1:], axis=2).max() / size
    back = mcz.retarget(made, motion.skeleton, mcz.joint_map(other.skeleton, motion.skeleton))
    again = np.abs(origins(back) - origins(motion)).max() / reach(motion.skeleton)
    print(f"{turned.max():.1e} degrees, {away:.1e} of the size; there and back {again:.1e}")
    assert turned.max() < 0.01
    assert away < 1e-4
    assert again < 1e-12


@pytest.mark.real
def test_real_clips_on_other_people(data: Path) -> None:
    """Turns as they were, bones as they are, feet about as high as theirs were in proportion."""
    for clip, person in (("02_01", "16"), ("07_05", "135"), ("16_01", "02")):
        motion = mcz.read(data / f"cmu/amc/{clip}.amc")
        target = mcz.read_skeleton(data / f"cmu/asf/{person}.asf")
        made = mcz.retarget(motion, target)
        turned = degrees(world_turns(made), world_turns(motion)).max()
        bones = np.linalg.norm(np.diff(origins(made)[:, [2, 3, 4]], axis=1), axis=2)
        scale = origins(made)[0, 0, 1] / origins(motion)[0, 0, 1]
        feet = find_feet(target)
        low = [origins(m)[:, feet, 1].min() for m in (made, motion)]
        print(
            f"{clip} on {person}: {turned:.1e} degrees, scale {scale:.3f}, "
            f"lowest foot {low[0]:.2f}, was {low[1]:.2f}"
        )
        assert turned < 5e-6
        assert np.abs(bones - np.linalg.norm(target.offsets[3:5], axis=1)).max() < 1e-9
        assert abs(low[0] - scale * low[1]) < 1.0
