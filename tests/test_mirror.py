"""Motions in the mirror: exactly the mirrored positions, on joints that have changed sides."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Exceptions, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.kinematics.joint_names import counterparts
from mcz.kinematics.points import origins_of, points_of, reach
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.motions import POSITIONS, ROTATIONS, smooth, write_bytes
from tests.skeletons import joints as random_joints
from tests.skeletons import skeletons, values_for

WALKS = {"amc": acclaim_walk(), "bvh": bvh_walk(), "c3d": marker_walk()}


def without_scalars(skeleton: Skeleton) -> Skeleton:
    return replace(
        skeleton,
        joints=tuple(
            replace(joint, channels=tuple(c for c in joint.channels if c.kind))
            for joint in skeleton.joints
        ),
    )


def mirror_error(
    motion: Motion, mirrored: Motion, axis: str = "x", pairs: dict | None = None
) -> float:
    """Distance of points from the mirrored points of their counterparts."""
    others = counterparts(motion.skeleton.joint_names, pairs)
    numbers = iter(range(10**6))
    ours = [[next(numbers) for _ in tails] for tails in points_of(motion.skeleton)]
    numbers = iter(range(10**6))
    theirs = [[next(numbers) for _ in tails] for tails in points_of(mirrored.skeleton)]
    there = [k for joint in range(len(others)) for k in ours[others[joint]]]
    here = [k for joint in theirs for k in joint]
    sign = np.array([-1.0 if letter == axis else 1.0 for letter in "xyz"])
    steps = mcz.positions(mirrored)[:, here] - mcz.positions(motion)[:, there] * sign
    return float(np.nanmax(np.abs(steps), initial=0.0))


@st.composite
def two_sided(draw: st.DrawFn) -> Skeleton:
    """A root and pairs of joints below it, whose two sides have nothing but parents in common."""
    n_pairs = draw(st.integers(1, 3))
    parents = [draw(st.integers(-1, k - 1)) for k in range(n_pairs)]
    right_first = [draw(st.booleans()) for _ in range(n_pairs)]
    made = [replace(draw(random_joints(0)), name="root", parent=-1)]
    at: dict[tuple[int, str], int] = {}
    for k, parent in enumerate(parents):
        for side in ("right", "left") if right_first[k] else ("left", "right"):
            at[k, side] = len(made)
            above = 0 if parent < 0 else at[parent, side]
            made.append(replace(draw(random_joints(1)), name=f"{side}{k}", parent=above))
    made.append(Joint("known", channels=(Channel("rx"),)))
    return Skeleton(
        tuple(made),
        unit_cm=1.0,
        angle_unit=draw(st.sampled_from(["deg", "rad"])),
        intrinsic=draw(st.booleans()),
    )


@given(st.one_of(two_sided(), skeletons()).map(without_scalars), st.sampled_from("xyz"))
def test_positions_are_the_mirrored_ones(skeleton: Skeleton, axis: str) -> None:
    motion = Motion(skeleton, (Signal(values_for(skeleton)),))
    mirrored = mcz.mirror(motion, axis)
    assert mirrored.skeleton.joint_names == skeleton.joint_names
    assert mirrored.skeleton.parents.tolist() == skeleton.parents.tolist()
    assert mirror_error(motion, mirrored, axis) < 1e-9
    twice = mcz.mirror(mirrored, axis)
    assert np.abs(mcz.positions(twice) - mcz.positions(motion)).max(initial=0.0) < 1e-9
    assert twice.skeleton == replace(skeleton, source=None)
    assert np.array_equal(twice.values, motion.values)


@pytest.mark.parametrize("form", WALKS)
def test_the_walk_in_the_mirror_is_a_file_again(form: str) -> None:
    motion = replace(WALKS[form], signals=WALKS[form].signals[:1])
    mirrored = mcz.mirror(motion)
    assert mirror_error(motion, mirrored) < 1e-9 * reach(motion.skeleton) + 1e-12
    assert mirrored.source is None
    assert not np.signbit(mirrored.signals[0].values[mirrored.signals[0].values == 0]).any()
    with mcz.open(write_bytes(mirrored)) as file:
        again = file.only_clip("walk").motion()
    assert np.array_equal(again.values, mirrored.values, equal_nan=True)
    assert again.skeleton == mirrored.skeleton


def test_masks_and_texts_go_with_their_numbers() -> None:
    motion = smooth()
    skeleton = Skeleton(
        (
            Joint("root", channels=POSITIONS + ROTATIONS),
            Joint("lhand", 0, channels=(Channel("rx"), Channel("ry"))),
            Joint("rhand", 0, channels=(Channel("rx"), Channel("rz"))),
        )
    )
    mask = np.ones(motion.values.shape, bool)
    mask[4, 7] = False
    texts = Exceptions(np.array([1, 1, 2]), np.array([6, 9, 0]), (b"+1", b"+2", b"+3"))
    signal = replace(motion.signals[0], mask=mask, exceptions=texts)
    mirrored = mcz.mirror(Motion(skeleton, (signal,)))
    found, values = mirrored.signals[0], motion.signals[0].values
    assert [c.kind for c in mirrored.skeleton.channels[6:]] == ["rx", "rz", "rx", "ry"]
    signs = [-1, 1, 1, -1, -1, 1, 1, -1, 1, -1]
    assert np.array_equal(found.values, values[:, [0, 1, 2, 3, 4, 5, 8, 9, 6, 7]] * signs)
    assert found.mask is not None and np.argwhere(~found.mask).tolist() == [[4, 9]]
    # Texts of numbers that have another sign now are gone, as are their signs.
    assert (found.exceptions.channels.tolist(), found.exceptions.texts) == ([8], (b"+1",))


def pairs_of(*names: str, pairs: dict | None = None) -> list[str]:
    return [names[k] for k in counterparts(names, pairs)]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("LeftUpLeg", "RightUpLeg"),
        ("lfemur", "rfemur"),
        ("LHipJoint", "RHipJoint"),
        ("left_hip", "right_hip"),
        ("upperarm_l", "upperarm_r"),
        ("foot.L", "foot.R"),
        ("Bip01 L Foot", "Bip01 R Foot"),
        ("CC_Base_L_Thigh", "CC_Base_R_Thigh"),
        ("mixamorig:LeftHandIndex1", "mixamorig:RightHandIndex1"),
        ("LEFT_HIP#", "RIGHT_HIP#"),
        ("__lThigh", "__rThigh"),
        ("leftEye", "rightEye"),
        ("LASI", "RASI"),
        ("Tom:LKNE", "Tom:RKNE"),
        ("ThighL", "ThighR"),
        ("LeftFoot#1", "RightFoot#1"),
        ("oris04.L", "oris04.R"),
    ],
)
def test_names_say_the_side(left: str, right: str) -> None:
    middle = ["root", "lowerback", "LowerBack", "Hips", "rib", "Lumbar", "Bright", "tail"]
    assert pairs_of(*middle, left, right) == [*middle, right, left]
    # What may be no side at all is refused only where a part of the body follows.
    plain = left in ("LASI", "Tom:LKNE", "ThighL")
    if plain:
        assert pairs_of("root", left) == ["root", left]
    else:
        with pytest.raises(OptionError, match=f"there is no joint '{right}'; name its counterpart"):
            pairs_of("root", left)


def test_pairs_say_what_names_do_not() -> None:
    assert pairs_of("a", "b", "LeftArm", pairs={"a": "b", "LeftArm": "LeftArm"}) == [
        *("b", "a", "LeftArm")
    ]
    assert pairs_of("a", "b", pairs={"a": "b", "b": "a"}) == ["b", "a"]
    for pairs, reason in (
        ({"a": "x"}, "no joint 'x'; the joints are"),
        ({"a": "b", "b": "c"}, "mirror: pairs: 'b' or 'c' has more than one counterpart"),
        ({"a": "LeftArm"}, "'LeftArm' would be the counterpart of 'RightArm' and of 'a'"),
    ):
        with pytest.raises(OptionError, match=reason):
            pairs_of("a", "b", "c", "LeftArm", "RightArm", pairs=pairs)


def test_what_has_no_mirror_image_is_refused() -> None:
    motion = smooth()
    with pytest.raises(OptionError, match="mirror: axis is 'w'; it must be one of x, y, z"):
        mcz.mirror(motion, "w")
    beside = Signal(np.zeros((50, 1)), name="residuals", channels=(Channel("", "a"),))
    with pytest.raises(MotionError, match="signals residuals cannot be mirrored"):
        mcz.mirror(replace(motion, signals=(*motion.signals, beside)))
    scalars = (Joint("root", channels=(Channel("", "smile"), Channel("rx"))),)
    with pytest.raises(MotionError, match="joint 'root' has plain scalars"):
        mcz.mirror(Motion(Skeleton(scalars), (Signal(np.zeros((2, 2))),)))
    crooked = (Joint("root"), Joint("TLS", 0), Joint("TRS", 0), Joint("l_a", 1), Joint("r_a", 2))
    bent = Motion(Skeleton(crooked), (Signal(np.zeros((2, 0))),))
    with pytest.raises(
        OptionError, match="mirror: 'l_a' is a child of 'TLS' and its counterpart 'r_a' of"
    ):
        mcz.mirror(bent)
    mcz.mirror(bent, pairs={"TLS": "TRS"})


@pytest.mark.real
def test_real_clips_in_the_mirror(data: Path) -> None:
    """Bones are as long as their counterparts were, feet as high."""
    folders = ("cmu/amc/1*.amc", "cmu/bvh*/0*1.bvh", "other/bandai-namco/*2*.bvh")
    greatest = 0.0
    for path in [path for folder in folders for path in sorted(data.glob(folder))[:4]]:
        motion = mcz.read(path)
        mirrored = mcz.mirror(motion)
        size = reach(motion.skeleton)
        greatest = max(greatest, mirror_error(motion, mirrored) / size)
        others = counterparts(motion.skeleton.joint_names)
        there = origins_of(motion.skeleton, motion.values)[:, others, 1]
        here = origins_of(mirrored.skeleton, mirrored.values)[:, :, 1]
        assert np.abs(there - here).max() < 1e-12 * size
        offsets = [np.linalg.norm(s.skeleton.offsets, axis=1) for s in (motion, mirrored)]
        assert np.array_equal(offsets[0][others], offsets[1])
    print(f"greatest distance from the mirrored place, of the skeleton's size: {greatest:.1e}")
    assert greatest < 1e-12
