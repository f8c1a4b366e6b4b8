"""BVH files of every shape: bytes -> Motion -> the same bytes."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Channel, Exceptions, Joint, Motion, MotionError, Signal, Skeleton, SourceError
from mcz.container.limits import BASE, LARGE
from mcz.model.numbers import Grid, GridKind
from mcz.sources import likely_formats
from mcz.sources.text import amc, asf, bvh, hierarchy, source
from tests.formats.text_files import BVH


def test_what_a_file_says() -> None:
    motion = bvh.read(BVH, "walk")
    hips, arm = motion.skeleton.joints
    assert (hips.name, arm.name, arm.parent) == ("Hips", "left arm", 0)
    assert arm.offset == (1.5, -0.2, 0.0) and arm.tails == ((0.0, 1.0, 0.0),)
    assert [c.kind for c in motion.skeleton.channels] == ["tx", "ty", "tz", "rz"]
    assert motion.frame_rate == 120 and not motion.frame_rate_exact
    assert motion.values.tolist()[0] == [1, 2, 3, -4]
    assert motion.skeleton.unit_cm is None and motion.skeleton.intrinsic
    assert set(motion.signals[0].grids) == {Grid(GridKind.FIXED, 2)}
    assert motion.signals[0].mask is None and motion.frame_numbers is None


def test_clips_that_differ_in_length_share_their_template() -> None:
    shorter = BVH.replace(b"Frames: 3", b"Frames: 2")[: BVH.index(b"1.20") - 0]
    a, b = bvh.read(BVH, "a").source, bvh.read(shorter, "b").source
    assert a is not None and b is not None
    assert a.template == b.template
    assert a.detail == b.detail


def test_latin_1_names_are_flagged() -> None:
    data = BVH.replace(b"Hips", b"H\xfcfte")
    motion = bvh.read(data, "walk")
    assert motion.skeleton.joints[0].name == "Hüfte"
    assert motion.metadata["name-encoding"] == "latin-1"
    assert bvh.write(motion) == data


def test_a_joint_without_channels_anywhere_has_a_row_a_line() -> None:
    data = (
        b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION\nFrames: 2\nFrame Time: 1\n\n\n"
    )
    motion = bvh.read(data, "empty")
    assert motion.signals[0].values.shape == (2, 0)
    assert bvh.write(motion) == data


@pytest.mark.parametrize("width", ["%8.3f", "%-8.3f", "% .3f"])
def test_padded_columns_need_no_pattern_a_row(width: str) -> None:
    head, _, _ = BVH.partition(b"1.00 2.00")
    values = np.random.default_rng(1).normal(0, 40, (400, 4))
    body = "".join(" ".join(width % x for x in row) + "\n" for row in values)
    data = head + body.encode()
    motion = bvh.read(data, "padded")
    assert bvh.write(motion) == data
    assert motion.source is not None
    assert len(motion.source.detail) < 40 and motion.source.notes is None


@pytest.mark.parametrize(
    ("first", "adds"), [(b"0.5 -1.0 0.0", True), (b"9.0 21.0 0.0", False), (b"0.0 0.0 0.0", True)]
)
def test_positions_near_the_offset_replace_it(first: bytes, adds: bool) -> None:
    data = BVH.replace(b"OFFSET 0 0 0", b"OFFSET 10 20 0").replace(b"1.00 2.00 3.00", first)
    assert bvh.read(data, "walk").skeleton.joints[0].adds_to_offset is adds


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"HIERARCHY\n", b"", "line 1: no HIERARCHY"),
        (b"CHANNELS 1", b"CHANNELS 2", "line 10: CHANNELS 2, but 1"),
        (b"CHANNELS 3", b"CHANNELS 2", "line 5: CHANNELS 2, but more"),
        (b"CHANNELS 3", b"CHANNELS -3", "line 5: CHANNELS '-3'"),
        (b"OFFSET 1.5", b"OFFSET x", "line 8: expected a number, not 'x'"),
        (b"OFFSET 1.5", b"OFFSET inf", "line 8: expected a number, not 'inf'"),
        (b"OFFSET 1.5", b"OFFSETS 1.5", "line 8: unexpected 'OFFSETS'"),
        (b"ROOT Hips\n{", b"ROOT Hips\n", "line 4: expected { after ROOT"),
        (b"Frames: 3", b"Frame: 3", "line 16: 'Frames:' must follow"),
        (b"Frame Time:", b"Time:", "line 17: 'Frame Time:' must follow"),
        (b"2.20", b"2,20", "line 21: '2,20' is not a number"),
        (b" -4.20\n", b"\n", "line 21: the last frame has 3 of 4 values"),
    ],
)
def test_what_cannot_be_read_is_refused(old: bytes, new: bytes, message: str) -> None:
    assert old in BVH
    with pytest.raises(SourceError) as error:
        bvh.read(BVH.replace(old, new, 1), "bad")
    assert message in str(error.value)


def plain(skeleton: Skeleton, values: np.ndarray, **more: object) -> Motion:
    return Motion(skeleton, (Signal(values),), **more)  # type: ignore[arg-type]


def test_a_motion_without_source_is_written_plainly_and_comes_back() -> None:
    joints = (
        Joint("Hips", -1, channels=(Channel("tx"), Channel("rz"))),
        Joint("left arm", 0, (1.0, 0.1, -2.5), ((0.0, 1e-7, 3.0),), channels=(Channel("rx"),)),
        Joint("leg", 0, (0.0, -1.0, 0.0), ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))),
        Joint("prop", channels=(Channel("", "Bend"),)),
    )
    values = np.array([[0.1, -0.0, 1e-300, 5.0], [1 / 3, 2.0, 3.5, -1e22]])
    motion = plain(Skeleton(joints), values, frame_rate=Fraction(30000, 1001), name="walk")
    again = bvh.read(bvh.write(motion), "walk")
    assert again.skeleton == motion.skeleton
    assert again.signals[0].values.tobytes() == values.tobytes()
    assert again.frame_rate == motion.frame_rate


@pytest.mark.parametrize(
    "joint",
    [
        Joint("a\nb"),
        Joint(" a"),
        Joint("a{"),
        Joint("a", axis=(0.0, 90.0, 0.0)),
        Joint("a", channels=(Channel("length"),)),
        Joint("a", channels=(Channel("", "x y"),)),
        Joint("a", channels=(Channel("", "Xrotation"),)),
    ],
)
def test_what_bvh_cannot_say_is_refused(joint: Joint) -> None:
    motion = plain(Skeleton((joint,)), np.zeros((1, len(joint.channels))))
    with pytest.raises(MotionError):
        bvh.write(motion)


def chain(n_joints: int) -> bytes:
    return b"HIERARCHY\nROOT r\n{\n" + b"JOINT j\n{\n" * n_joints + b"}\n" * (n_joints + 1)


def test_far_too_many_joints_are_refused_before_they_are_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A million took 51 seconds and 1.8 GB."""
    monkeypatch.setattr(hierarchy, "MOST_JOINTS", 100)
    bvh_of = b"HIERARCHY\nROOT r\n{\n%s}\nMOTION\nFrames: 0\nFrame Time: 1\n"
    assert bvh.read(bvh_of % (b"JOINT j\n{\n}\n" * 99)).skeleton.n_joints == 100
    for joints in (b"JOINT j\n{\n}\n" * 100, b"JOINT j { } JOINT k { }\n" * 50):
        with pytest.raises(SourceError, match=r"line \d+: more than 100 joints"):
            bvh.read(bvh_of % joints)
    seen: list[object] = []
    monkeypatch.setattr(hierarchy, "_Node", lambda *of: seen.append(of))
    with pytest.raises(SourceError, match="more than 100 joints"):
        bvh.read(bvh_of % (b"JOINT j\n{\n}\n" * 100))
    assert not seen


def test_what_a_profile_cannot_hold_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.bvh"
    joints = b"JOINT j\n{\n}\n" * BASE.joints
    path.write_bytes(b"HIERARCHY\nROOT r\n{\n%s}\nMOTION\nFrames: 0\nFrame Time: 1\n" % joints)
    monkeypatch.setattr(hierarchy, "_Node", None)  # none is looked at
    with pytest.raises(mcz.LimitError, match="the limit of 4096; profile='large' allows more"):
        mcz.encode(path, tmp_path / "a.mcz")
    monkeypatch.undo()
    assert mcz.encode(path, tmp_path / "a.mcz", profile="large").clips[0].n_channels == 0
    assert not hierarchy.has_more_joints(path.read_bytes(), BASE.joints + 1)
    after = b"HIERARCHY\nROOT r\n{\n}\nMOTION\n" + joints
    assert not hierarchy.has_more_joints(after, 10)


def test_joints_lie_only_so_deep() -> None:
    with pytest.raises(SourceError, match="line 8195: more than 4,096 joints inside each other"):
        bvh.read(chain(5000))


def test_channels_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hierarchy, "MOST_CHANNELS", 3)
    with pytest.raises(SourceError, match="line 9: more than 3 channels"):
        bvh.read(BVH)


def test_limits_are_those_of_the_largest_profile() -> None:
    assert (LARGE.joints, LARGE.channels) == (source.MOST_JOINTS, source.MOST_CHANNELS)
    assert BASE.joints == source.MOST_DEPTH


def test_a_byte_order_mark_is_kept_of_text_that_arrives() -> None:
    data = b"\xef\xbb\xbf" + BVH
    assert likely_formats(data) == ("bvh",)
    arriving = bvh.arrive(iter(data.splitlines(keepends=True)))
    assert [joint.name for joint in arriving.skeleton.joints] == ["Hips", "left arm"]
    wide = BVH.decode().encode("utf-16")
    with pytest.raises(SourceError, match="UTF-16"):
        bvh.arrive(iter(wide.splitlines(keepends=True)))


def test_a_byte_order_mark_before_acclaim_hides_nothing(samples: Path) -> None:
    mark = b"\xef\xbb\xbf"
    text = (samples / "walk.asf").read_bytes()
    commented = mark + b"# of a program\n" + text
    assert asf.write(asf.read(commented)) == commented
    assert replace(asf.read(commented), source=None) == replace(asf.read(text), source=None)
    with pytest.raises(SourceError, match="line 1: a UTF-8 byte order mark precedes ':units"):
        asf.read(mark + b":units\n" + text)
    frames = (samples / "walk.amc").read_bytes()
    first = re.search(rb"(?m)^1\s*$", frames)
    assert first is not None
    headless = frames[first.start() :]
    for hidden in (headless, b":RADIANS\n" + headless):
        with pytest.raises(SourceError, match="a UTF-8 byte order mark precedes"):
            amc.read(mark + hidden)
    motion = amc.read(mark + b"#!OML:ASF\n" + headless)
    assert amc.write(motion) == mark + b"#!OML:ASF\n" + headless


@pytest.mark.parametrize(
    ("rows", "channels"),
    [([3], [0]), ([0], [4]), ([0], [-1]), ([1, 0], [0, 0]), ([1, 1], [0, 0])],
)
def test_exceptions_out_of_place_are_refused(rows: list[int], channels: list[int]) -> None:
    exceptions = Exceptions(np.array(rows), np.array(channels), (b"1",) * len(rows))
    with pytest.raises(MotionError):
        Signal(np.zeros((3, 4)), exceptions=exceptions)


def test_a_new_layout_in_every_row_stays_linear() -> None:
    """3,000 layouts are refused after 1,024 of them; 40,000 rows that alternate are read."""
    head = b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 2 Xrotation Yrotation\n}\nMOTION\n"
    head += b"Frames: 1\nFrame Time: 1\n"
    rows = b"".join(b"1 " + b"\t" * k + b"2\n" for k in range(3000))
    with pytest.raises(mcz.MczError, match="too irregular"):
        bvh.read(head + rows)
    data = head + b"1 2\n1  2\n" * 20_000
    assert bvh.write(bvh.read(data)) == data
