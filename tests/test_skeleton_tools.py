"""Joints renamed and chosen: numbers and places stay; what cannot be is refused with a reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Exceptions, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.files.reading.source_files import SourceOptions
from mcz.kinematics.points import origins_of, places_of
from mcz.model.numbers import Grid, GridKind
from mcz.model.signal import Scaling
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.motions import POSITIONS, ROTATIONS, smooth, write_and_read
from tests.skeletons import skeletons, values_for

WALKS = {"amc": acclaim_walk(), "bvh": bvh_walk(), "c3d": marker_walk()}


def numbers_of(motion: Motion, joint: str) -> np.ndarray:
    """The values of a joint, bit by bit."""
    columns = motion.skeleton.columns(motion.skeleton.find(joint))
    return np.ascontiguousarray(motion.signals[0].values[:, list(columns)]).view(np.int64)


def apart(before: Motion, after: Motion) -> float:
    """Greatest position or rotation difference of joints with the same name."""
    unit = {"unit_cm": 1.0}
    kept = [before.skeleton.find(name) for name in after.skeleton.joint_names]
    there = replace(before.skeleton, **unit), before.values
    here = replace(after.skeleton, **unit), after.values
    shell = [
        places_of(*both, shell_cm=3.0).shell.reshape(before.n_frames, -1, 9)
        for both in (there, here)
    ]
    steps = (
        origins_of(*there)[:, kept] - origins_of(*here),
        shell[0][:, kept] - shell[1],
    )
    unknown = np.isnan(before.values).any()
    assert unknown or not any(np.isnan(step).any() for step in steps)
    return max(float(np.nanmax(np.abs(step), initial=0.0)) for step in steps)


def test_what_a_skeleton_says() -> None:
    skeleton = smooth().skeleton
    assert skeleton.offsets.dtype == np.float64
    assert skeleton.offsets.tolist() == [list(joint.offset) for joint in skeleton.joints]
    assert skeleton.joint_names == ("hips", "spine", "fixed", "knee")
    assert skeleton.children == ((1, 3), (2,), (), ())
    assert mcz.rest_positions(skeleton).tolist() == [
        [0, 1, 0],
        [0, 3, 0.5],
        [0, 3, 0.5],
        [0, -1, 0],
    ]
    nothing = Skeleton(())
    assert nothing.offsets.shape == mcz.rest_positions(nothing).shape == (0, 3)
    assert nothing.children == nothing.joint_names == ()


@given(skeletons())
def test_rest_positions_are_those_of_channels_at_rest(skeleton: Skeleton) -> None:
    adding = replace(
        skeleton, joints=tuple(replace(j, adds_to_offset=True) for j in skeleton.joints)
    )
    ones = ("sx", "sy", "sz", "qw")
    values = np.array([[float(c.kind in ones) for c in skeleton.channels]])
    expected = origins_of(adding, values)[0]
    assert np.abs(mcz.rest_positions(skeleton) - expected).max() < 1e-12


def test_renaming_keeps_all_but_names() -> None:
    motion = WALKS["bvh"]
    renamed = mcz.rename(motion, {"LeftArm": "RightArm", "RightArm": "LeftArm", "Hips": "pelvis"})
    changed = {"LeftArm": "RightArm", "RightArm": "LeftArm", "Hips": "pelvis"}
    names = tuple(changed.get(name, name) for name in motion.skeleton.joint_names)
    assert renamed.skeleton.joint_names == names
    assert renamed.signals == motion.signals
    assert renamed.source is None and renamed.skeleton.source is None
    assert renamed.frame_rate == motion.frame_rate
    assert mcz.rename(motion.skeleton, changed) == renamed.skeleton
    back = mcz.rename(renamed, {new: old for old, new in changed.items()})
    assert back.skeleton == motion.skeleton
    assert write_and_read(renamed).skeleton == renamed.skeleton


def test_a_name_that_repeats_is_renamed_by_its_address() -> None:
    skeleton = Skeleton((Joint("a"), Joint("a", 0), Joint("b", 1)))
    assert mcz.rename(skeleton, {"a#1": "c"}).joint_names == ("a", "c", "b")
    assert mcz.rename(skeleton, {"b": "c"}).joint_names == ("a", "a#1", "c")


@pytest.mark.parametrize(
    ("mapping", "reason"),
    [
        ({"LeftAm": "x"}, "no joint 'LeftAm'; the joints are .*did you mean 'LeftArm'"),
        ({"LeftArm": "RightArm"}, "2 joints would have the name 'RightArm'"),
        ({"LeftArm": "x", "RightArm": "x"}, "rename: 2 joints would have the name 'x'"),
        ({"LeftArm": ""}, "'' is not a valid name for joint 'LeftArm'"),
        ({"LeftArm": 3}, "3 is not a valid name"),
    ],
)
def test_names_that_cannot_be_are_refused(mapping: dict, reason: str) -> None:
    with pytest.raises(OptionError, match=reason):
        mcz.rename(WALKS["bvh"], mapping)


@pytest.mark.parametrize("form", WALKS)
def test_leaves_are_cut_off_bit_for_bit(form: str) -> None:
    motion = WALKS[form]
    names = motion.skeleton.joint_names
    leaves = {names[k] for k, below in enumerate(motion.skeleton.children) if not below}
    kept = [name for name in names if name not in leaves or form == "c3d"][::-1]
    selected = mcz.select(motion, kept[1:] if form == "c3d" else kept)
    assert set(selected.skeleton.joint_names) <= set(kept)
    assert selected.signals[1:] == motion.signals[1:]
    for name in selected.skeleton.joint_names:
        assert np.array_equal(numbers_of(selected, name), numbers_of(motion, name))
    assert apart(motion, selected) == 0
    assert selected.source is None
    again = write_and_read(selected)
    assert again.skeleton == selected.skeleton
    assert np.array_equal(again.values, selected.values, equal_nan=True)


def test_grids_masks_and_texts_are_those_of_the_columns() -> None:
    motion = smooth()
    values = motion.values.copy()
    values[3, 9] = 1e-15
    mask = np.ones(values.shape, bool)
    mask[5, 6] = mask[6, 9] = False
    binary = Grid(GridKind.BINARY64)
    signal = replace(
        motion.signals[0],
        values=values,
        stored=values,
        mask=mask,
        exceptions=Exceptions(np.array([2, 3]), np.array([0, 9]), (b"-0", b"1e-15")),
        grid_changes=((10, 9, binary), (20, 7, binary)),
    )
    found = mcz.select(replace(motion, signals=(signal,)), ["knee", "hips"]).signals[0]
    assert found.n_channels == 7
    assert found.mask is not None and np.argwhere(~found.mask).tolist() == [[6, 6]]
    assert found.exceptions.channels.tolist() == [0, 6]
    assert found.exceptions.texts == (b"-0", b"1e-15")
    assert found.grid_changes == ((10, 6, binary),)
    assert found.grids == motion.signals[0].grids[:7]


def test_columns_keep_what_their_numbers_mean() -> None:
    words = np.arange(12, dtype=np.int64).reshape(4, 3)
    scaling = Scaling(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.25, 2.0]))
    channels = tuple(Channel("", name) for name in "abc")
    signal = Signal(words, channels=channels, ordinals=words).in_units(scaling)
    found = signal.of_columns([2, 0])
    assert np.array_equal(found.values, signal.values[:, [2, 0]])
    assert np.array_equal(found.as_stored().values, words[:, [2, 0]])
    assert found.ordinals is not None and np.array_equal(found.ordinals, words[:, [2, 0]])
    assert [channel.name for channel in found.channels or ()] == ["c", "a"]


def test_a_joint_that_rests_may_be_left_out_between() -> None:
    """Its offset goes to the joint below, whether position channels add to it or replace it."""
    middle = Joint("middle", 0, (1.0, 2.0, 3.0), axis=(10.0, 20.0, 30.0))
    kinds = (Channel("ty"), Channel("rx"), Channel("rz"))
    for adds in (True, False):
        low = Joint("low", 1, (5.0, 6.0, 7.0), ((0.0, 1.0, 0.0),), (0.0, 40.0, 0.0), "XYZ", kinds)
        for turning in ((), (Channel("ry"),)):
            skeleton = Skeleton(
                (
                    Joint("top", channels=POSITIONS + ROTATIONS),
                    replace(middle, channels=turning),
                    replace(low, adds_to_offset=adds),
                )
            )
            values = values_for(skeleton)
            values[:, 6 : 6 + len(turning)] = 0
            motion = Motion(skeleton, (Signal(values),))
            selected = mcz.select(motion, ["low", "top"])
            assert selected.skeleton.joint_names == ("top", "low")
            assert selected.skeleton.joints[1].offset == (6.0, 8.0 if adds else 2.0, 10.0)
            assert apart(motion, selected) < 1e-13
    values[3, 6] = 1e-9
    with pytest.raises(OptionError, match="joint 'middle' moves 'low', which is kept"):
        mcz.select(motion, ["low", "top"])


def test_a_joint_below_one_that_stretches_keeps_its_parent() -> None:
    stretchy = Joint("top", channels=(*POSITIONS, Channel("sx")))
    skeleton = Skeleton((stretchy, Joint("mid", 0, (1, 1, 1)), Joint("low", 1, (1, 1, 1))))
    motion = Motion(skeleton, (Signal(values_for(skeleton)),))
    with pytest.raises(OptionError, match="joint 'top' moves 'low'"):
        mcz.select(motion, ["top", "low"])
    with pytest.raises(
        OptionError,
        match="joint 'top' scales its children",
    ):
        mcz.select(motion, ["top", "low"], allow_translation=True)


@given(skeletons(), st.data())
def test_what_hangs_on_joints_left_out_is_held_by_channels(
    skeleton: Skeleton, data: st.DataObject
) -> None:
    """Every joint kept is where it was and turned as it was, whatever was in between."""
    motion = Motion(skeleton, (Signal(values_for(skeleton)),))
    chosen = data.draw(st.sets(st.integers(0, skeleton.n_joints - 1), min_size=1))
    try:
        selected = mcz.select(motion, sorted(chosen), allow_translation=True)
    except OptionError as error:
        assert (
            "scales its children, so joints between it and a kept joint below it must be kept too"
            in str(error)
        )
        return
    named = [skeleton.joint_names[k] for k in sorted(chosen)]
    assert list(selected.skeleton.joint_names) == named
    if any(channel.kind for channel in selected.skeleton.channels):
        assert apart(motion, selected) < 1e-9


def test_a_value_that_is_not_known_stays_unknown_where_it_is_held() -> None:
    motion = WALKS["bvh"]
    values = motion.values.copy()
    column = motion.skeleton.columns(motion.skeleton.find("LeftLeg"))[0]
    values[7, column] = np.nan
    selected = mcz.select(
        motion.with_values(values), ["Hips", "LeftFoot", "RightFoot"], allow_translation=True
    )
    invalid = np.isnan(selected.values)
    assert set(np.argwhere(invalid)[:, 0]) == {7}
    assert invalid[7].tolist() == [False] * 6 + [True] * 6 + [False] * 6


@pytest.mark.parametrize(
    ("joints", "reason"),
    [
        ([], "select: keep at least one joint"),
        ("Hipps", "no joint 'Hipps'; the joints are .*did you mean 'Hips'"),
        (["Hips", 99], "no joint 99"),
        (["Hips", "LeftFoot"], "joint 'LeftLeg' moves 'LeftFoot', which is kept"),
        (["LeftFoot"], "joint 'LeftLeg' moves 'LeftFoot'"),
    ],
)
def test_joints_that_cannot_be_chosen_are_refused(joints: object, reason: str) -> None:
    with pytest.raises(OptionError, match=reason):
        mcz.select(WALKS["bvh"], joints)  # type: ignore[arg-type]


def test_channels_that_are_no_joints_are_refused() -> None:
    signal = replace(smooth().signals[0], channels=(Channel("", "x"),) * 10)
    with pytest.raises(MotionError, match="the channels of its motion signal differ"):
        mcz.select(replace(smooth(), signals=(signal,)), "hips")


@pytest.mark.real
def test_joints_of_real_clips_stay_where_they_are(data: Path) -> None:
    chosen = {
        "cmu/amc/02_01.amc": ["root", "lfemur", "ltibia", "lfoot", "head"],
        "cmu/bvh-blender/02_01.bvh": ["Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightHand"],
        "other/bandai-namco/dataset-1_bow_active_001.bvh": ["Head", "LowerArm_L", "Hand_L"],
    }
    for path, joints in chosen.items():
        motion = mcz.read(data / path)
        selected = mcz.select(motion, joints, allow_translation=True)
        missed = apart(motion, selected)
        print(path, selected, f"apart by {missed:.1e}")
        assert selected.skeleton.joint_names == tuple(joints)
        assert missed < 1e-12


def test_axes_have_signs_and_are_not_parallel(tmp_path: Path) -> None:
    said = SourceOptions(up="-y", forward="+z", handedness="left")
    motion = said.applied_to(bvh_walk())
    found = motion.skeleton
    assert (found.up_axis, found.forward_axis, found.handedness) == ("-y", "z", "left")
    mcz.write(motion, tmp_path / "walk.mcz")
    again = mcz.read(tmp_path / "walk.mcz")
    assert again.skeleton == found
    assert (again.values == bvh_walk().values).all()
    assert SourceOptions(up="x", forward="y").complete(motion).skeleton == found
    assert mcz.Skeleton((), up_axis="+y").up_axis == "y"
    with pytest.raises(mcz.MotionError, match="parallel"):
        mcz.Skeleton((), up_axis="y", forward_axis="-y")
    with pytest.raises(mcz.OptionError, match="parallel"):
        SourceOptions(up="y", forward="y")
    with pytest.raises(mcz.OptionError, match="neither right nor left"):
        SourceOptions(handedness="both")
