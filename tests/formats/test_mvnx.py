"""MVNX: segments, signals, times and names; what is refused; nothing is expanded or loaded."""

from __future__ import annotations

import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.model.motion import Motion
from mcz.sources import FORMATS, likely_formats
from mcz.sources.sample import bvh_walk
from tools.vectors.build.mvnx_files import MvnxFile

FILE = MvnxFile()
TEXT = FILE.text()


def back(data: bytes) -> Motion:
    motion: Motion = FORMATS["mvnx"].read(data, "take")
    assert FORMATS["mvnx"].write(motion) == data
    return motion


def refusal(data: bytes) -> str:
    with pytest.raises(mcz.SourceError) as caught:
        FORMATS["mvnx"].read(data, "take")
    return str(caught.value)


def test_segments_are_joints_in_the_world() -> None:
    motion = back(TEXT)
    assert [joint.name for joint in motion.skeleton.joints] == ["Pelvis", "L5", "RightUpperLeg"]
    assert {joint.parent for joint in motion.skeleton.joints} == {-1}
    kinds = [channel.kind for channel in motion.skeleton.joints[0].channels]
    assert kinds == ["tx", "ty", "tz", "qw", "qx", "qy", "qz"]
    assert (motion.skeleton.unit_cm, motion.skeleton.up_axis) == (100.0, "z")
    places = mcz.positions(motion)
    np.testing.assert_array_equal(places[:, 0], motion.values[:, :3])
    assert motion.skeleton.joints[1].offset == (0.0, 0.0, 0.25)
    assert motion.skeleton.joints[0].tails == ((0.0, 0.0, 0.25),)


def test_every_element_is_a_signal_with_names_and_units() -> None:
    signals = {signal.name: signal for signal in back(TEXT).signals}
    labels = {
        name: [channel.label for channel in signal.channels or ()]
        for name, signal in signals.items()
    }
    assert labels["velocity"][:4] == ["Pelvis.x", "Pelvis.y", "Pelvis.z", "L5.x"]
    assert labels["sensorOrientation"] == ["Pelvis.w", "Pelvis.x", "Pelvis.y", "Pelvis.z"]
    assert labels["jointAngle"][-1] == "j2.z"
    assert labels["footContacts"] == ["Heel", "Toe"]
    assert labels["centerOfMass"] == ["x", "y", "z"]
    units = {name: (signal.channels or [None])[0] for name, signal in signals.items()}
    found = {name: channel.unit for name, channel in units.items() if channel is not None}
    assert (found["velocity"], found["jointAngleXZY"]) == ("m/s", "deg")
    assert (found["angularVelocity"], found["sensorFreeAcceleration"]) == ("rad/s", "m/s^2")
    np.testing.assert_array_equal(signals["footContacts"].values[:2], [[0, 1], [1, 0]])


def test_metadata() -> None:
    metadata = back(TEXT).metadata
    assert metadata == {
        "subject": "S <1>",
        "system": "Xsens MVN 2026.0.0",
        "description": "a walk & a turn",
        "date": "2026-11-03",
        "time": "2026-11-03T05:17:11.827",
    }
    italian = TEXT.replace(b"Tue Nov 3 05:17:11.827 2026", b"gio 3 marzo 2026")
    assert "date" not in back(italian).metadata


def test_times_follow_from_the_numbers_of_frames() -> None:
    motion = back(replace(FILE, first=57).text())
    assert motion.frame_rate == 60
    assert motion.frame_numbers is not None and motion.frame_numbers[0] == 57
    assert "time" not in [signal.name for signal in motion.signals]


def test_measured_times_are_a_signal_and_the_rate_is_stated() -> None:
    motion = back(TEXT.replace(b'time="33"', b'time="36"'))
    assert motion.frame_rate == 60 and motion.signals[-1].role == "times"
    late = TEXT.replace(b'time="33"', b'time="53"').replace(b'time="50"', b'time="99"')
    assert back(late).frame_rate is None
    assert back(replace(FILE, attributes=()).text()).frame_rate == 60


def test_a_time_code_costs_digits() -> None:
    motion = back(replace(FILE, n_frames=40).text())
    text = next(signal for signal in motion.signals if signal.name == "text")
    assert text.channels is not None and text.channels[0].name == "tc.1"


def test_missing_elements_are_invalid() -> None:
    motion = back(replace(FILE, left_out=((2, "velocity"),)).text())
    mask = motion.signals[1].mask
    assert mask is not None and mask.all(axis=1).tolist() == [True, True, False, True, True]
    first = back(replace(FILE, left_out=((0, "velocity"),)).text())
    assert first.signals[-2].name == "velocity"


def test_words_are_kept_as_text() -> None:
    at = TEXT.index(b"\t\t</frame>", TEXT.index(b'type="normal"'))
    marked = TEXT[:at] + b"<marker>kick off &amp; go</marker>" + TEXT[at:]
    assert "marker" not in [signal.name for signal in back(marked).signals]
    words = TEXT[:at] + b"<velocity>fast</velocity>" + TEXT[at:]
    assert "a frame has two elements of the same name" in refusal(words)
    at = TEXT.rindex(b"<velocity>") + len(b"<velocity>")
    assert "'velocity' contains words, not numbers" in refusal(TEXT[:at] + b"fast " + TEXT[at:])


def test_a_part_has_the_calibration(tmp_path: Path) -> None:
    path = tmp_path / "take.mvnx"
    path.write_bytes(replace(FILE, n_frames=20).text())
    mcz.encode(path, tmp_path / "take.mcz")
    with mcz.open(tmp_path / "take.mcz") as file:
        clip = file.only_clip()
        part = clip.source_bytes(frames=(5, 9))
        assert clip.source_bytes() == path.read_bytes()
    motion = back(part)
    assert motion.n_frames == 4 and b'type="tpose"' in part
    assert motion.frame_numbers is not None and motion.frame_numbers.tolist() == [5, 6, 7, 8]


def test_another_rate_is_stated(tmp_path: Path) -> None:
    path = tmp_path / "take.mvnx"
    path.write_bytes(TEXT)
    motion = mcz.read(path).at_rate(100)
    mcz.write(motion, tmp_path / "take.mcz")
    with mcz.open(tmp_path / "take.mcz") as file:
        again = FORMATS["mvnx"].read(file.only_clip().source_bytes(frames=(1, 4)), "part")
    assert again.frame_rate == 100


def test_content_is_recognized() -> None:
    assert likely_formats(TEXT) == ("mvnx",)
    assert likely_formats(b"<html><body/></html>") == ()


def test_only_an_mvnx_is_written() -> None:
    with pytest.raises(mcz.MotionError, match="was not read from an MVNX file"):
        FORMATS["mvnx"].write(bvh_walk())


def back_or_refused(data: bytes) -> str:
    """The refusal, or "" for a file that comes back."""
    try:
        back(data)
    except (mcz.SourceError, mcz.LimitError) as error:
        assert "\n" not in str(error)
        return str(error)
    return ""


def test_a_frame_that_is_cut_off_is_kept_as_text() -> None:
    motion = back(TEXT[: TEXT.rindex(b"<centerOfMass>")])
    assert motion.n_frames == FILE.n_frames - 1
    assert motion.metadata["source-note"] == "cut off in a frame, which is kept as text"
    ended = back(replace(FILE, ending="").text())
    assert ended.metadata["source-note"] == "no end of 'frames'"


def test_encodings() -> None:
    """The declared one is not asked for: Python has encodings that are none of bytes."""
    text = replace(FILE, segments=("Füße", "Arm")).text()
    old = text.decode().encode("latin-1")
    cases = (text, None), (b"\xef\xbb\xbf" + text, None), (old, "latin-1")
    for data, encoding in cases:
        for declared in (b"UTF-8", b"ISO-8859-1", b"klingon", b"idna"):
            motion = back(data.replace(b"UTF-8", declared))
            assert motion.skeleton.joints[0].name == "Füße"
            assert motion.metadata.get("name-encoding") == encoding


DOCTYPE = b"<!DOCTYPE mvnx ["
LAUGHS = b"".join(
    b"<!ENTITY l%d '%s'>" % (k, b"&l%d;" % (k - 1) * 10 if k else b"lol") for k in range(12)
)


@pytest.mark.parametrize(
    ("types", "word"),
    [
        (DOCTYPE + LAUGHS + b"]>", b"&l11;"),
        (DOCTYPE + b'<!ENTITY a SYSTEM "file:///etc/passwd">]>', b"&a;"),
        (DOCTYPE + b'<!ENTITY % a SYSTEM "http://127.0.0.1:1/a.dtd"> %a;]>', b""),
        (b'<!DOCTYPE mvnx SYSTEM "http://127.0.0.1:1/a.dtd">', b""),
        (DOCTYPE + b"<!ENTITY a '" + b"a" * 10**6 + b"'>]>", b"&a;" * 1000),
    ],
)
def test_types_are_refused(types: bytes, word: bytes) -> None:
    text = TEXT.replace(b"<mvnx ", types + b"<mvnx ", 1).replace(b"a walk", b"a walk" + word)
    began = time.perf_counter()
    assert "which is not supported" in refusal(text)
    assert time.perf_counter() - began < 2


PELVIS = b'label="Pelvis"'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"a walk &amp;", b"a walk &lol;", "undefined entity"),
        (b"<position>", b"<position><![CDATA[", "a frame must consist of elements with text, not"),
        (
            b"</position>",
            b"<!-- x --></position>",
            "a frame must consist of elements with text, not",
        ),
        (b"</position>", b"</position><?a?>", "a frame must consist of elements with text, not"),
        (b"</position>", b"</positions>", "a frame must consist of elements with text, not"),
        (
            b"</position>",
            b"</position><a><b>1</b></a>",
            "a frame must consist of elements with text, not",
        ),
        (
            b"</position>",
            b"</position><position>1</position>",
            "a frame has two elements of the same name",
        ),
        (b"<position>", b"<position>&#48;", "'position' contains words, not numbers"),
        (b" 0.000000 ", b" &#48; ", "is not a number"),
        (b"</position>", b" 0.5</position>", "positions and orientations of segments"),
        (b"<mvnx ", b"<mvn ", "not an MVNX file"),
        (b"<frames>", b"<frame>", "mismatched tag"),
        (b"<frames>", b"<frames/>", "no plain tag"),
        (b'type="normal"', b'type="normal" type="tpose"', "attribute twice"),
        (b'index="3"', b'index="three"', "is not a frame number, or too large"),
        (
            b"<mvnx ",
            b"<a>" * 40 + b"<mvnx ",
            "not an MVNX file",
        ),
        (b"<comment>", b"<a>" * 40 + b"<comment>", "elements are nested more than 32 deep"),
    ],
)
def test_what_is_refused(old: bytes, new: bytes, words: str) -> None:
    at = TEXT.index(b'type="normal"') - 40 if old in TEXT[TEXT.index(b'type="normal"') :] else 0
    text = TEXT[:at] + TEXT[at:].replace(old, new, 1)
    assert words in refusal(text), refusal(text)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (PELVIS, PELVIS + b' a="' + b"x" * 2**20 + b'"'),
        (b"<comment>", b"<comment>" + b"&amp;" * 2**18),
        (b"<comment>", b"<comment><!--" + b"<frames>" * 2**16 + b"-->"),
        (b"<frames>", b"<frames>" + b" " * 2**20),
        (b"<frames>", b"<frames>" + b"<frame>" * 2**16),
        (b'type="normal"', b'type="normal"' + b" " * 2**20),
        (b'type="normal"', b'type="normal" ' + b"a=" * 2**18),
        (b"</orientation>", b"</orientation>" + b"<a>1</a>" * 2**14),
        (b"</orientation>", b" 1" * 2**18 + b"</orientation>"),
        (b"</orientation>", b"</orientation>" + b"<a>" * 2**16),
        (b"<segments>", b"<segments>" + b"<segment/>" * 2**16),
    ],
)
def test_large_parts_take_little_time_and_memory(old: bytes, new: bytes) -> None:
    text = TEXT.replace(old, new)
    began = time.perf_counter()
    tracemalloc.start()
    back_or_refused(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 64 * len(text) + 2**24
    assert time.perf_counter() - began < 30


def test_time_is_linear() -> None:
    sizes = []
    for n_frames in (500, 2000):
        text = replace(FILE, n_frames=n_frames).text()
        began = time.perf_counter()
        back(text)
        sizes.append((time.perf_counter() - began) / len(text))
    assert sizes[1] < 3 * sizes[0]
