"""AMC files, with and without their ASF: bytes -> Motion -> the same bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcz import Channel, Joint, Motion, MotionError, Signal, Skeleton, SourceError
from mcz.model.numbers import Grid, GridKind
from mcz.sources.text import amc, asf
from mcz.sources.text.bones import derive_skeleton
from tests.formats.text_files import AMC, ASF

SKELETON = asf.read(ASF)


def test_what_a_file_says() -> None:
    motion = amc.read(AMC, "walk", SKELETON)
    assert motion.skeleton is SKELETON
    assert " ".join(c.kind for c in SKELETON.channels) == "tx ty tz rx ry rz rx ry rz rx"
    assert motion.values[0].tolist() == [1, 2, 3, 4, 5, 6, 7, 8e-5, 9, -0.5]
    assert motion.frame_rate is None and motion.frame_numbers is None
    assert motion.signals[0].mask is None and motion.metadata == {}
    assert motion.signals[0].grids[0].kind == GridKind.GENERAL
    assert len(motion.signals[0].exceptions) == 0


def test_frame_numbers_may_begin_anywhere_and_jump() -> None:
    data = AMC.replace(b"\n1\n", b"\n461\n").replace(b"\n2\n", b"\n470\n")
    motion = amc.read(data, "walk", SKELETON)
    assert motion.frame_numbers is not None and motion.frame_numbers.tolist() == [461, 470]
    assert amc.write(motion) == data
    renumbered = replace(motion, frame_numbers=None)
    assert amc.write(renumbered) == AMC


def test_a_bone_may_be_missing_in_a_frame() -> None:
    data = AMC.replace(b"toe -0.25\n", b"")
    motion = amc.read(data, "walk", SKELETON)
    signal = motion.signals[0]
    assert signal.mask is not None and not signal.mask[1, 9] and signal.mask.sum() == 19
    assert signal.values[1, 9] == -0.5 and np.isnan(motion.values[1, 9])
    assert amc.write(motion) == data


def test_a_bone_may_come_later_than_the_first_frame() -> None:
    data = AMC.replace(b"toe -0.5\n", b"")
    motion = amc.read(data, "walk", SKELETON)
    assert motion.signals[0].mask is not None and motion.signals[0].values[0, 9] == 0
    assert amc.write(motion) == data
    assert amc.write(amc.read(data, "walk")) == data


def test_without_asf_bones_are_a_flat_list_of_scalars() -> None:
    motion = amc.read(AMC, "walk")
    assert [joint.name for joint in motion.skeleton.joints] == ["root", "toe", "back"]
    assert {channel.kind for channel in motion.skeleton.channels} == {""}
    assert motion.skeleton.base is None
    assert "no ASF" in motion.metadata["skeleton-note"]
    assert amc.write(motion) == AMC


def test_other_channels_than_the_asf_derive_a_skeleton() -> None:
    data = AMC.replace(b"toe -0.5\n", b"toe 1 2 3\nhat 4 5\n").replace(b"toe -0.25", b"toe 1 2 3")
    motion = amc.read(data, "walk", SKELETON)
    assert motion.skeleton.base == b""
    assert motion.skeleton == derive_skeleton(SKELETON, {"root": 6, "toe": 3, "hat": 2, "back": 3})
    toe, hat = motion.skeleton.joints[2:]
    assert [c.kind for c in toe.channels] == ["rx", "ry", "rz"]
    assert (hat.name, hat.parent, [c.label for c in hat.channels]) == ("hat", -1, ["1", "2"])
    assert toe.tails == SKELETON.joints[2].tails
    assert amc.write(motion) == data


def test_radians_convert_the_axes() -> None:
    motion = amc.read(AMC.replace(b":DEGREES", b":RADIANS"), "walk", SKELETON)
    assert motion.skeleton.angle_unit == "rad"
    assert motion.skeleton.joints[1].axis[2] == pytest.approx(np.pi / 6)


def test_names_may_differ_in_case() -> None:
    data = AMC.replace(b"toe", b"TOE")
    motion = amc.read(data, "walk", SKELETON)
    assert motion.skeleton is SKELETON
    assert amc.write(motion) == data


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (AMC, b"", "no line with a frame number"),
        (AMC, b"\x89PNG\r\n\x1a\n\0\0\0", "no line with a frame number"),
        (b"back 7 8 -1.5e-014", b"back 7 8", "line 11: 2 values for bone 'back', but 3 elsewhere"),
        (b"toe -0.25", b"toe x", "line 10: 'x' is not a number"),
        (b"toe -0.25", b"root 1 2 3 4 5 6", "line 10: bone 'root' occurs twice in a frame"),
        (b"\n2\n", b"\n" + b"9" * 20 + b"\n", "is not a frame number, or too large"),
    ],
)
def test_what_cannot_be_read_is_refused(old: bytes, new: bytes, message: str) -> None:
    with pytest.raises(SourceError) as error:
        amc.read(AMC.replace(old, new), "bad", SKELETON)
    assert message in str(error.value)


def test_a_table_that_would_dwarf_the_file_is_refused() -> None:
    bones = b"".join(b"b%d 1\n" % k for k in range(3000))
    frames = b"".join(b"%d\n" % k for k in range(2, 20000))
    with pytest.raises(SourceError, match="far larger"):
        amc.read(b":DEGREES\n1\n" + bones + frames, "sparse")


def test_a_motion_without_source_is_written_plainly_and_comes_back() -> None:
    values = np.random.default_rng(2).normal(size=(3, 10))
    mask = np.ones((3, 10), np.bool_)
    mask[1, 6:9] = False
    signal = Signal(values, mask=mask)
    motion = Motion(SKELETON, (signal,), name="walk", frame_numbers=np.array([5, 6, 9]))
    data = amc.write(motion)
    again = amc.read(data, "walk", SKELETON)
    assert np.array_equal(again.values, motion.values, equal_nan=True)
    assert np.array_equal(again.frame_numbers, [5, 6, 9])  # type: ignore[arg-type]
    rounded = Signal(np.round(values, 2), (Grid(GridKind.FIXED, 2),) * 10)
    assert (
        b"e" not in amc.write(replace(motion, signals=(rounded,))).split(b"root")[1].split(b"\n")[0]
    )


def test_what_amc_cannot_say_is_refused() -> None:
    one = (Channel("rx"),)
    for joints in ((Joint("a b", channels=one),), (Joint("#a", channels=one),),
                   (Joint("a", channels=one), Joint("a", channels=one))):  # fmt: skip
        skeleton = Skeleton(joints)
        with pytest.raises(MotionError):
            amc.write(Motion(skeleton, (Signal(np.zeros((1, skeleton.n_channels))),)))
    half = Signal(np.zeros((1, 10)), mask=np.arange(10)[None] > 0)
    with pytest.raises(MotionError, match="AMC cannot omit some channels of joint 'root'"):
        amc.write(Motion(SKELETON, (half,)))
