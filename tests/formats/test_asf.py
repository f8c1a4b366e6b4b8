"""ASF files: what they say, and that they come back."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz import Channel, Joint, MotionError, Skeleton, SourceError
from mcz.sources.text import asf
from tests.formats.text_files import ASF_OF_ALL_KINDS


@pytest.mark.parametrize("eol", ["\n", "\r\n", "\r"])
def test_what_a_file_says(eol: str) -> None:
    data = ASF_OF_ALL_KINDS.replace("\n", eol).encode()
    skeleton = asf.read(data)
    root, a, toe, b = skeleton.joints
    assert [joint.name for joint in skeleton.joints] == ["root", "a", "toe", "b"]
    assert skeleton.parents.tolist() == [-1, 0, 1, 0]
    assert (root.offset, root.axis, root.tails) == ((1, 2, 3), (0, -0.0, 90), ())
    assert [c.kind for c in root.channels] == ["rx", "ry", "rz", "tx", "ty", "tz"]
    assert a.tails == ((1.0, -0.2, 0.0),) and a.offset == (0, 0, 0)
    assert toe.offset == a.tails[0] and toe.tails == ((0, 0, 0.5),) and toe.axis_order == "ZYX"
    assert [c.kind for c in toe.channels] == ["rx", "tz", "length", ""]
    assert toe.channels[3].name == "bend" and b.channels == ()
    assert skeleton.unit_cm == pytest.approx(5.6444, abs=1e-4)
    assert (skeleton.angle_unit, skeleton.name, skeleton.intrinsic) == ("rad", "somebody", False)
    assert asf.write(skeleton) == data


def test_other_lengths_have_an_unknown_unit() -> None:
    assert asf.read(ASF_OF_ALL_KINDS.replace("0.45", ".045").encode()).unit_cm is None
    assert asf.read(ASF_OF_ALL_KINDS.replace("length 0.45", "").encode()).unit_cm is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (ASF_OF_ALL_KINDS, "HIERARCHY\nROOT\n", "line 1: no :root or :bonedata"),
        ("length 2", "length two", "line 21: expected a number, not 'two'"),
        ("length 2", "length", "line 21: expected a number, not ''"),
        ("length 2", "length \u0662", "line 21: expected a number, not '\u0662'"),
        ("length 2", "length 2\u2028", "line 21: "),
        ("0.5 -1e-1 0", "0.5 -1e-1", "line 22: expected a number, not ''"),
        ("length 2", "length 1e309", "line 21: expected a number, not '1e309'"),
        ("zyx", "zyz", "line 14: axis order 'ZYZ'"),
        ("angle rad", "angle gon", "line 38: angle unit 'gon'"),
        ("name a\n", "name toe\n", "line 24: a bone needs a unique name"),
        ("a toe", "a toe missing", "hierarchy: a missing: no bone has this name"),
        ("a toe", "a b toe", "two parents"),
        ("root a", "toe a", "hierarchy: these bones form a cycle"),
        ("  begin\n     name a", "     name a", "line 19: 'name' is outside"),
    ],
)
def test_what_cannot_be_read_is_refused(old: str, new: str, message: str) -> None:
    assert old in ASF_OF_ALL_KINDS
    with pytest.raises(SourceError) as error:
        asf.read(ASF_OF_ALL_KINDS.replace(old, new, 1).encode())
    assert message in str(error.value)


coordinates = st.floats(-1e6, 1e6)
vectors = st.tuples(coordinates, coordinates, coordinates)


@st.composite
def skeletons(draw: st.DrawFn) -> Skeleton:
    kinds = st.sampled_from(["tx", "ty", "tz", "rx", "ry", "rz", "length"])
    channels = st.lists(kinds.map(Channel), max_size=4).map(tuple)
    order = st.sampled_from(["XYZ", "ZXY"])
    root = Joint("root", -1, draw(vectors), (), draw(vectors), draw(order), draw(channels))
    joints = [root]
    for index in range(1, draw(st.integers(1, 6))):
        parent = draw(st.integers(-1, index - 1))
        offset = joints[parent].tails[0] if parent > 0 else (0.0, 0.0, 0.0)
        tail, axis = draw(vectors), draw(vectors)
        bone = Joint(f"b{index}", parent, offset, (tail,), axis, draw(order), draw(channels))
        joints.append(bone)
    unit = draw(st.sampled_from([None, asf.INCH_UNIT_CM]))
    angle = draw(st.sampled_from(["deg", "rad"]))
    return Skeleton(tuple(joints), "nobody", unit, angle, intrinsic=False)


@given(skeletons())
def test_a_skeleton_without_source_is_written_plainly_and_comes_back(skeleton: Skeleton) -> None:
    assert asf.read(asf.write(skeleton)) == skeleton


def test_a_changed_skeleton_is_not_written_as_its_source() -> None:
    skeleton = asf.read(ASF_OF_ALL_KINDS.encode())
    root = replace(skeleton.joints[0], offset=(9.0, 9.0, 9.0))
    changed = replace(skeleton, joints=(root, *skeleton.joints[1:]))
    assert asf.read(asf.write(changed)) == changed


@pytest.mark.parametrize(
    "bone",
    [
        Joint("a b", 0, tails=((0.0, 0.0, 1.0),)),
        Joint("root", 0, tails=((0.0, 0.0, 1.0),)),
        Joint("a", 0),
        Joint("a", 0, (1.0, 0.0, 0.0), ((0.0, 0.0, 1.0),)),
        Joint("a", 0, tails=((0.0, 0.0, 1.0),), channels=(Channel("sx"),)),
    ],
)
def test_what_asf_cannot_say_is_refused(bone: Joint) -> None:
    with pytest.raises(MotionError):
        asf.write(Skeleton((Joint("root"), bone), intrinsic=False))
