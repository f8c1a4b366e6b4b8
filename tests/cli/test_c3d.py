"""C3D on the command line: analog samples in units, outputs, what info tells, the up axis."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.sources.c3d import c3d
from tests.commands import Call
from tests.formats.c3d_files import INTEL, make_c3d, real
from tests.formats.test_c3d_outputs import add_point_lists
from tests.formats.test_c3d_recording import integers, reals, with_analog


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """gait.c3d: an output among four points, two analog channels at twice the rate, an event."""
    file = add_point_lists(make_c3d(6, 4, 2, 2, size=2), ANGLES=["p1"], ANGLE_UNITS=["deg"])
    file.parameters["POINT"]["Y_SCREEN"] = file.texts([b"+Z"])
    with_analog(
        file,
        SCALE=reals(file, [0.5, 2.0]),
        OFFSET=integers(file, [1000, 0]),
        LABELS=file.texts([b"Fx", b"EMG\x1b[2J"]),
        UNITS=file.texts([b"N", b""]),
        DESCRIPTIONS=file.texts([b"force to the right"]),
        RATE=(4, (), real(200.0, INTEL)),
    )
    file.parameters["EVENT"] = {
        "USED": file.number(1),
        "TIMES": reals(file, [0.0, 0.25], 2, 1),
        "LABELS": file.texts([b"Foot Strike"]),
        "CONTEXTS": file.texts([b"Left"]),
    }
    file.parameters["FORCE_PLATFORM"] = {
        "USED": file.number(1),
        "TYPE": integers(file, [2]),
        "CORNERS": reals(file, [float(k) for k in range(12)], 3, 4, 1),
        "ORIGIN": reals(file, [0.0, 0.0, float("nan")], 3, 1),
        "CHANNEL": integers(file, [1, 2], 2, 1),
    }
    (tmp_path / "gait.c3d").write_bytes(file.build())
    mcz.encode(tmp_path / "gait.c3d", tmp_path / "gait.mcz")
    return tmp_path


def rows_of(path: Path) -> tuple[list[str], np.ndarray[Any, Any]]:
    head, *rows = csv.reader(path.read_text().splitlines())
    return head, np.array([[float(cell or "nan") for cell in row] for row in rows])


def test_other_signals_as_csv(folder: Path, call: Call) -> None:
    motion = c3d.read((folder / "gait.c3d").read_bytes(), "gait")
    outputs, analog = motion.signals[2:]
    to = ("--to", "csv", "--force", "-o", folder / "x.csv")
    assert call("decode", folder / "gait.mcz", "--signal", "analog", *to)[0] == 0
    head, rows = rows_of(folder / "x.csv")
    assert head == ["frame", "time", "Fx [N]", r"EMG\x1b[2J"]  # escaped
    assert rows[:, 0].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]
    np.testing.assert_allclose(rows[:, 1], mcz.times(motion, signal="analog"), atol=1e-9)
    assert np.array_equal(rows[:, 2:], (analog.stored - [1000, 0]) * [0.5, 2.0])
    part = ("--signal", "analog", "--stored", "--frames", "2:4")
    assert call("decode", folder / "gait.mcz", *part, *to)[0] == 0
    head, rows = rows_of(folder / "x.csv")
    assert head[2] == "Fx" and np.array_equal(rows[:, 2:], analog.stored[4:8])
    assert call("decode", folder / "gait.mcz", "--signal", "outputs", *to)[0] == 0
    head, rows = rows_of(folder / "x.csv")
    assert head == ["frame", "time", "p1 x [deg]", "p1 y [deg]", "p1 z [deg]"]
    assert np.array_equal(rows[:, 2:], outputs.masked(), equal_nan=True)


def test_events_as_tables(folder: Path, call: Call) -> None:
    clip = folder / "gait.mcz"
    with mcz.open(clip) as file:
        found = file.only_clip().recording
    assert found is not None
    to = ("--signal", "events", "--force", "-o")
    assert call("decode", clip, *to, folder / "x.csv")[0] == 0
    head, *rows = csv.reader((folder / "x.csv").read_text().splitlines())
    assert head == ["time", "label", "context", "subject", "description"]
    assert [float(row[0]) for row in rows] == [event.time for event in found.events]
    assert call("decode", clip, *to, folder / "x.npz")[0] == 0
    with np.load(folder / "x.npz") as arrays:
        assert arrays["times"].tolist() == [event.time for event in found.events]
        assert arrays["label"].tolist() == [event.label for event in found.events]
    assert call("decode", clip, "--stored", *to, folder / "x.csv")[0] == 2


def test_other_signals_as_npz(folder: Path, call: Call) -> None:
    target = folder / "x.npz"
    options = ("--to", "npz", "--signal", "analog", "-o", target)
    assert call("decode", folder / "gait.mcz", *options)[0] == 0
    with np.load(target) as arrays, mcz.open(folder / "gait.mcz") as file:
        assert np.array_equal(arrays["values"], file.clips["gait"].read(signal="analog"))
        assert arrays["units"].tolist() == ["N", ""]
        assert arrays["names"].tolist()[0] == "Fx"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--signal", "analog"], "--signal needs --to csv or --to npz"),
        (["--signal", "analog", "--to", "c3d"], "--signal needs --to csv or --to npz"),
        (["--stored", "--to", "csv"], "--stored needs --signal"),
        (["--signal", "analog", "--to", "csv", "--joints", "p0"], "--signal excludes --joints"),
        (
            ["--signal", "emg", "--to", "csv"],
            "no signal 'emg'; its signals are motion, residuals, outputs",
        ),
        (["--up", "y", "--to", "csv"], "--up needs --to c3d"),
    ],
)
def test_what_does_not_go_together(
    folder: Path, call: Call, options: list[str], message: str
) -> None:
    code, out, err = call("decode", folder / "gait.mcz", *options)
    assert code in (1, 2) and not out and message in err and err.count("\n") == 1


def test_info_tells_what_the_file_says(folder: Path, call: Call) -> None:
    code, text, _ = call("info", folder / "gait.mcz")
    assert code == 0 and "\x1b" not in text
    for words in (
        "z up",
        "first frame 1, points in mm, z up, 2 analog channels at 200 Hz",
        "0.250 s  Left  Foot Strike",
        "(0, 1, 2) (3, 4, 5) (6, 7, 8) (9, 10, 11)",
        "force to the right",
        "p1      deg   angles",
    ):
        assert words in text, text
    code, text, _ = call("info", folder / "gait.mcz", "--json")
    clip = json.loads(text)["clips"][0]
    said = clip["recording"]
    assert said["up_axis"] == "z" and said["y_screen"] == "+Z" and said["first_frame"] == 1
    assert said["events"] == [
        {
            "label": "Foot Strike",
            "time": 0.25,
            "context": "Left",
            "subject": "",
            "description": "",
        }
    ]
    assert said["platforms"][0]["origin"] == [0.0, 0.0, None]
    assert said["analog"][0] == {
        "name": "Fx",
        "description": "force to the right",
        "unit": "N",
        "offset": 1000.0,
        "scale": 0.5,
    }
    assert said["points"][1]["groups"] == ["ANGLES"]
    signals = [(s["signal"], s["channels"], s["samples_per_frame"]) for s in clip["codecs"]]
    assert signals[-1] == ("analog", 2, 2)


def test_joints_alone_leave_words(folder: Path, call: Call) -> None:
    """The source says what words mean, and a cut of joints has none."""
    target = folder / "cut.mcz"
    code, _, err = call("extract", folder / "gait.mcz", target, "--joints", "p0")
    assert code == 0 and "what the words of its signal analog mean" in err
    with mcz.open(target) as file, mcz.open(folder / "gait.mcz") as whole:
        clip = file.clips["gait"]
        assert np.array_equal(
            clip.read(signal="analog"), whole.clips["gait"].read_masked(signal="analog")[0]
        )
        assert {channel.unit for channel in clip.signals[3].channels or ()} == {""}
        assert "analog: words as they were stored" in clip.metadata["source-note"]
    assert not mcz.verify(target)


def test_a_range_of_frames_keeps_units(folder: Path, call: Call) -> None:
    target = folder / "cut.mcz"
    assert call("extract", folder / "gait.mcz", target, "--frames", "2:5")[0] == 0
    with mcz.open(target) as file, mcz.open(folder / "gait.mcz") as whole:
        cut = file.clips["gait"].read(signal="analog")
        assert np.array_equal(cut, whole.clips["gait"].read(signal="analog")[4:10])
    assert not mcz.verify(target)


@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc", "walk.c3d"])
def test_up_is_what_the_caller_says(samples: Path, tmp_path: Path, call: Call, name: str) -> None:
    for path in samples.iterdir():
        shutil.copy(path, tmp_path)
    said = {"walk.bvh": "", "walk.amc": "", "walk.c3d": "z"}[name]
    plain, target = tmp_path / "plain.mcz", tmp_path / "walk.mcz"
    assert call("encode", tmp_path / name, "-o", plain)[0] == 0
    assert call("encode", tmp_path / name, "-o", target, "--up", "y")[0] == 0
    with mcz.open(plain) as file:
        assert file.clips["walk"].skeleton.up_axis == said
    with mcz.open(target) as file:
        clip = file.clips["walk"]
        assert clip.skeleton.up_axis == "y"
        assert clip.source_bytes() == (tmp_path / name).read_bytes()
        assert (clip.base_skeleton is not None) == (name == "walk.amc")
    assert not mcz.verify(target)
    assert mcz.read(tmp_path / name, up="x").skeleton.up_axis == "x"


def test_an_asf_stays_as_it_is(samples: Path, tmp_path: Path, call: Call) -> None:
    for path in samples.iterdir():
        shutil.copy(path, tmp_path)
    asf = (tmp_path / "walk.asf").read_bytes()
    options = ("-o", tmp_path / "s.mcz", "--up", "y")
    code, _, err = call("encode", tmp_path / "walk.asf", *options)
    assert code == 2 and "set the up axis when you encode its AMC" in err
    target = tmp_path / "walk.mcz"
    assert call("encode", tmp_path / "walk.amc", "-o", target, "--up", "y")[0] == 0
    out = tmp_path / "out"
    out.mkdir()
    assert call("decode", target, "-o", out, "--with-skeleton")[0] == 0
    assert (out / "walk.asf").read_bytes() == asf
    assert call("pack", tmp_path, tmp_path.parent / "all.mcz", "--up", "x")[0] == 0
    with mcz.open(tmp_path.parent / "all.mcz") as file:
        assert {clip.skeleton.up_axis for clip in file.clips.values()} == {"x"}


def test_up_of_what_is_converted(samples: Path, tmp_path: Path, call: Call) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "walk.mcz", unit="cm")
    for options, up in (((), ""), (("--up", "y"), "y")):
        target = tmp_path / "points.c3d"
        to = ("--to", "c3d", "-o", target, "--force", *options)
        assert call("decode", tmp_path / "walk.mcz", *to)[0] == 0
        assert c3d.read(target.read_bytes(), "points").skeleton.up_axis == up


def lines_in(text: str) -> list[str]:
    return [
        line.strip() for line in text.splitlines() if " in A, " in line or "not the same" in line
    ]


def test_diff_names_what_is_beside_the_numbers(folder: Path, call: Call) -> None:
    """A plain C3D of the same numbers has lost events, platforms and groups, which is said."""
    gait, plain = folder / "gait.c3d", folder / "plain.c3d"
    assert call("decode", folder / "gait.mcz", "--to", "c3d", "-o", plain)[0] == 0
    code, text, _ = call("diff", gait, plain)
    assert code == 0
    shown = lines_in(text)
    assert shown[:2] == [
        "events: 1 in A, 0 in B; only in A: Left Foot Strike at 0.25 s",
        "force platforms: 1 in A, 0 in B; only in A: platform 1",
    ]
    assert shown[2].startswith("groups of parameters: ") and "EVENT" in shown[2]
    code, text, _ = call("diff", gait, plain, "--json")
    document = {each["what"]: each for each in json.loads(text)["clips"][0]["differences"]}
    assert document["events"] == {
        "what": "events",
        "a": 1,
        "b": 0,
        "only_in_a": ["Left Foot Strike at 0.25 s"],
        "only_in_b": [],
        "changed": [],
    }
    assert "EVENT" in document["groups of parameters"]["only_in_a"]
    code, text, _ = call("diff", plain, gait)
    assert lines_in(text)[0].endswith("only in B: Left Foot Strike at 0.25 s")


def test_diff_of_the_same_names_nothing(folder: Path, call: Call) -> None:
    shutil.copy(folder / "gait.c3d", folder / "copy.c3d")
    for other in ("copy.c3d", "gait.mcz"):
        code, text, _ = call("diff", folder / "gait.c3d", folder / other)
        assert code == 0 and lines_in(text) == []
    cut = ["--frames", "2:5"]
    assert call("decode", folder / "gait.mcz", *cut, "-o", folder / "cut.c3d")[0] == 0
    mcz.encode(folder / "cut.c3d", folder / "cut.mcz")
    assert lines_in(call("diff", folder / "cut.c3d", folder / "cut.mcz")[1]) == []


def test_diff_names_what_has_changed(folder: Path, call: Call) -> None:
    """Bytes of a text of the parameters, and of the header: numbers alike, named all the same."""
    data = (folder / "gait.c3d").read_bytes()
    (folder / "right.c3d").write_bytes(data.replace(b"force to the right", b"force to the wrong"))
    shown = lines_in(call("diff", folder / "gait.c3d", folder / "right.c3d")[1])
    n = shown[0].split()[1]
    assert shown == [f"parameters: {n} in A, {n} in B; changed: ANALOG:DESCRIPTIONS"]
    header = bytearray(data)
    header[200] ^= 1  # which nobody reads
    (folder / "header.c3d").write_bytes(header)
    shown = lines_in(call("diff", folder / "gait.c3d", folder / "header.c3d")[1])
    assert shown == ["header or layout of the files: not the same"]
