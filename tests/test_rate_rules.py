"""The frame rate of a file: its own if it states one, otherwise the caller's."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.sources import FORMATS
from mcz.sources.sample import sample_files
from tests.clocked_files import csv, motive, npz, sto, trc, vicon
from tests.formats.c3d_files import Made

GAP = (*range(124, 127), *range(130, 136))  # numbers of frames: 127 to 129 are missing


FILES = {
    "trc": trc,
    "sto": sto,
    "mot": sto,
    "motive.csv": motive,
    "table.csv": csv,
    "vicon.csv": vicon,
    "npz": npz,
}


def read(data: bytes, suffix: str, tmp_path: Path) -> mcz.Motion:
    path = tmp_path / (suffix if "." in suffix else f"a.{suffix}")
    path.write_bytes(data)
    return mcz.read(path)


@pytest.mark.parametrize("suffix", FILES)
def test_a_rate_is_known_where_frames_are_missing(suffix: str, tmp_path: Path) -> None:
    motion = read(FILES[suffix](GAP), suffix, tmp_path)
    assert (motion.frame_rate, motion.frame_rate_exact) == (100, True)
    assert "not uniform" not in motion.metadata.get("source-note", "")


def test_frame_numbers_count_before_rows(tmp_path: Path) -> None:
    every_other = tuple(range(100, 120, 2))
    assert read(motive(every_other), "m.csv", tmp_path).frame_rate == 100
    assert read(trc(every_other), "trc", tmp_path).frame_rate == 100
    assert read(trc(every_other, "50"), "trc", tmp_path).frame_rate == 50  # by rows, as it says
    assert read(trc(every_other, "90"), "trc", tmp_path).frame_rate == 100


def test_a_stated_rate_comes_before_one_of_frame_numbers(tmp_path: Path) -> None:
    numbers = (*range(125, 190, 2), *range(231, 300, 2))  # every other frame, and a gap
    assert read(trc(numbers, "60", 6, 120), "trc", tmp_path).frame_rate == 60
    assert read(trc(numbers, "70", 6, 120), "trc", tmp_path).frame_rate == 120


def test_times_that_are_no_frames_have_no_rate(tmp_path: Path) -> None:
    text = b"a\nendheader\ntime\tknee\n0.000\t1\n0.010\t2\n0.020\t3\n0.033\t4\n0.043\t5\n"
    assert read(text, "sto", tmp_path).frame_rate is None
    assert read(sto((1, 2, 4, 6)), "sto", tmp_path).frame_rate is None  # one step of three
    assert read(sto((1, 2, 6)), "sto", tmp_path).frame_rate is None
    coarse = sto((*range(1, 9), 12), places=2, hz=60)  # fits 58 and 61 a second, too
    assert read(coarse, "sto", tmp_path).frame_rate is None
    assert read(sto((*range(1, 9), 12), "DataRate=60\n", 2, 60), "mot", tmp_path).frame_rate == 60


@given(
    st.sampled_from([Fraction(30), Fraction(60), Fraction(100), Fraction(120000, 1001)]),
    st.lists(st.tuples(st.integers(3, 30), st.integers(2, 5000)), min_size=1, max_size=5),
    st.integers(0, 10**5),
    st.integers(4, 6),
)
def test_any_gap(rate: Fraction, runs: list[tuple[int, int]], first: int, places: int) -> None:
    numbers, number = [], first
    for length, gap in runs:
        numbers += range(number, number + length)
        number += length - 1 + gap
    rows = "".join(f"{float(n / rate):.{places}f}\t{n}\n" for n in numbers)
    data = f"a\nendheader\ntime\tknee\n{rows}".encode()
    decoded = FORMATS["sto"].read(data).frame_rate
    assert (
        decoded is not None and abs(decoded / rate - 1) < 2e-3
    )  # 119.88 prints as 120 in few rows
    away = np.array([float(Fraction(n - first) / rate) for n in numbers])
    assert np.abs(away - np.rint(away * float(decoded)) / float(decoded)).max() < 3 * 10.0**-places


def folder_of(tmp_path: Path) -> Path:
    """An AMC, which states no rate, and a BVH of 60 frames a second."""
    folder = tmp_path / "takes"
    folder.mkdir()
    files = sample_files()
    for name in ("walk.asf", "walk.amc"):
        (folder / name).write_bytes(files[name])
    bvh = re.sub(rb"Frame Time: \S+", b"Frame Time: 0.0166667", files["walk.bvh"])
    (folder / "run.bvh").write_bytes(bvh)
    return folder


def test_pack_uses_a_rate_for_files_that_state_none(tmp_path: Path) -> None:
    folder, target = folder_of(tmp_path), tmp_path / "a.mcz"
    report = mcz.pack(folder, target, rate=120)
    notes = {o.path: o.notes for o in report.outcomes}
    with mcz.open(target) as file:
        assert {clip.name: clip.frame_rate for clip in file} == {"walk": 120, "run": 60}
    assert (
        "it states 60 frames a second, not the requested 120; force_rate=True overrides it"
        in notes["run.bvh"]
    )
    assert not notes["walk.amc"]
    mcz.pack(folder, target, rate=120, force_rate=True, force=True)
    with mcz.open(target) as file:
        assert {clip.frame_rate for clip in file} == {120}


def test_append_uses_a_rate_for_files_that_state_none(tmp_path: Path) -> None:
    folder, target = folder_of(tmp_path), tmp_path / "a.mcz"
    mcz.encode(folder / "walk.amc", target)
    mcz.append([folder / "run.bvh"], target, rate=120)
    with mcz.open(target) as file:
        assert [clip.frame_rate for clip in file] == [None, 60]
    other = tmp_path / "b.mcz"
    mcz.encode(folder / "walk.amc", other)
    mcz.append([folder / "run.bvh"], other, rate=120, force_rate=True)
    with mcz.open(other) as file:
        assert [clip.frame_rate for clip in file] == [None, 120]


@pytest.mark.parametrize("rate", [0, -1, float("nan"), float("inf"), 1e400])
def test_a_rate_that_is_none_is_refused(rate: float, tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    with pytest.raises(mcz.OptionError, match="frame rate"):
        mcz.pack(folder, tmp_path / "a.mcz", rate=rate)


@pytest.mark.parametrize("command", ["pack", "append"])
def test_force_rate_on_the_command_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, target = folder_of(tmp_path), tmp_path / "a.mcz"
    (folder / "walk.amc").unlink()
    mcz.encode(folder / "walk.asf", target)
    arguments = [command, str(folder), str(target), "--rate", "120"]
    arguments += ["--force"] if command == "pack" else []
    assert run(cli, "mcz", arguments) == 0
    assert "not the requested 120; --force-rate overrides it" in capsys.readouterr().err
    with mcz.open(target) as file:
        assert [clip.frame_rate for clip in file] == [60]


WIDE = tuple(range(124, 164))
SOURCES = {  # a file, where its rate stands, and that at 50 a second
    "bvh": (sample_files()["walk.bvh"], rb"Frame Time: (\S+)", b"0.02"),
    "trc": (trc(WIDE), rb"\n(\S+)\t\S+\t\d+\t1\tmm", b"50.00"),
    "motive.csv": (motive(WIDE), rb"Export Frame Rate,([^,]+)", b"50.000000"),
    "vicon.csv": (vicon(WIDE), rb"\n(\d+)\n", b"50"),
}


def write_corrected(suffix: str, tmp_path: Path, **options: Any) -> tuple[Path, bytes]:
    """A clip of 50 frames a second whose source states another rate, and the source."""
    data = SOURCES[suffix][0]
    path, target = tmp_path / (suffix if "." in suffix else f"a.{suffix}"), tmp_path / "a.mcz"
    path.write_bytes(data)
    mcz.encode(path, target, rate=50, **options)
    return target, data


def stated_rate(suffix: str, data: bytes) -> bytes:
    found = re.search(SOURCES[suffix][1], data)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("suffix", SOURCES)
def test_parts_state_a_corrected_rate(suffix: str, tmp_path: Path) -> None:
    target, data = write_corrected(suffix, tmp_path)
    wanted = SOURCES[suffix][2]
    with mcz.open(target) as file:
        clip = file.only_clip()
        assert clip.source_bytes() == data
        assert clip.source_bytes((0, clip.n_frames)) == data
        part = clip.source_bytes((3, 9))
        assert stated_rate(suffix, part) == wanted
        times = clip.times
        assert np.allclose(np.diff(times), 0.02, atol=1e-9)
    cut = tmp_path / "cut.mcz"
    mcz.extract(target, cut, frames=(3, 9))
    with mcz.open(cut) as file:
        assert file.only_clip().source_bytes() == part
        assert np.abs(file.only_clip().times - times[3:9]).max() < 1e-9
    again = read(part, suffix, tmp_path)
    start = 0.06 if suffix == "bvh" else 0.0  # which it cannot state
    assert again.frame_rate == 50
    assert np.abs(again.times + start - times[3:9]).max() < 0.006
    assert mcz.verify(cut) == []


def test_lossy_copies_state_a_corrected_rate(tmp_path: Path) -> None:
    target, _ = write_corrected("bvh", tmp_path, codec="mrdwt")
    with mcz.open(target) as file:
        assert stated_rate("bvh", file.only_clip().source_bytes()) == b"0.02"


def test_a_c3d_states_a_corrected_rate(tmp_path: Path) -> None:
    path, target = tmp_path / "walk.c3d", tmp_path / "a.mcz"
    path.write_bytes(sample_files()["walk.c3d"])
    mcz.encode(path, target, rate=50)
    with mcz.open(target) as file:
        clip = file.only_clip()
        assert clip.source_bytes() == path.read_bytes()
        part = tmp_path / "part.c3d"
        part.write_bytes(clip.source_bytes((3, 9)))
    again = mcz.read(part)
    assert (again.frame_rate, again.n_frames) == (50, 6)
    assert "rate" not in again.metadata.get("source-note", "")  # header and parameters agree
    assert np.frombuffer(part.read_bytes(), "<f4", 1, 20)[0] == 50


@pytest.mark.parametrize("suffix", ["sto", "npz", "bvh", "trc"])
def test_a_rate_that_the_source_contradicts_is_said(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = {"sto": sto(WIDE), "npz": npz(WIDE)}.get(suffix) or SOURCES[suffix][0]
    path, target = tmp_path / f"a.{suffix}", tmp_path / "a.mcz"
    path.write_bytes(data)
    mcz.encode(path, target, rate=50)
    back = tmp_path / f"back.{suffix}"
    assert run(cli, "mcz", ["decode", str(target), "-o", str(back)]) == 0
    own = f"{float(mcz.read(path).frame_rate):g}"
    told = f"its source states {own} frames a second, the clip has 50"
    assert back.read_bytes() == data
    assert f"clip a: {told}" in capsys.readouterr().err
    assert run(cli, "mcz", ["unpack", str(target), str(tmp_path / "out")]) == 0
    assert told in capsys.readouterr().err
    part = tmp_path / f"part.{suffix}"
    assert run(cli, "mcz", ["decode", str(target), "--frames", "3:9", "-o", str(part)]) == 0
    assert (told in capsys.readouterr().err) == (suffix in ("sto", "npz"))  # times are numbers


def test_a_rate_that_is_the_source_s_is_not_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix, make in FILES.items():
        path, target = tmp_path / (suffix if "." in suffix else f"a.{suffix}"), tmp_path / "a.mcz"
        path.write_bytes(make(GAP))
        mcz.encode(path, target, force=True)
        back = tmp_path / "back.bin"
        capsys.readouterr()
        with mcz.open(target) as file:
            clip = file.only_clip()
            whole, part = clip.source_bytes(), clip.source_bytes((0, 2))
        assert whole == make(GAP)
        arguments = ["unpack", str(target), str(tmp_path / "out"), "--force"]
        assert run(cli, "mcz", arguments) == 0
        assert "states" not in capsys.readouterr().err
        assert not back.exists()
        assert len(part) < len(whole)


@pytest.mark.parametrize("time", [b"0", b"-0.0083333", b"0.0"])
def test_a_rate_for_a_file_that_states_none(time: bytes, tmp_path: Path) -> None:
    path, target = tmp_path / "a.bvh", tmp_path / "a.mcz"
    data = re.sub(rb"Frame Time: \S+", b"Frame Time: " + time, sample_files()["walk.bvh"])
    path.write_bytes(data)
    mcz.encode(path, target, rate=120)
    with mcz.open(target) as file:
        clip = file.only_clip()
        assert clip.source_bytes() == data
        part = re.search(rb"Frame Time: (\S+)", clip.source_bytes((3, 9)))
        assert part is not None and abs(float(part[1]) * 120 - 1) < 1e-4
    mcz.encode(path, target, force=True)
    mcz.set_rate(target, 120)
    with mcz.open(target) as file:
        assert (file.only_clip().frame_rate, file.only_clip().source_bytes()) == (120, data)
    with pytest.raises(mcz.OptionError, match="has 120 frames a second"):
        mcz.set_rate(target, 100, ["a"])
    mcz.set_rate(target, 100, ["a"], force=True)
    with mcz.open(target) as file:
        assert (file.only_clip().frame_rate, file.only_clip().source_bytes()) == (100, data)


@pytest.mark.parametrize("command", ["pack", "append"])
def test_force_rate_needs_a_rate(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, target = folder_of(tmp_path), tmp_path / "a.mcz"
    mcz.encode(folder / "walk.asf", target)
    assert run(cli, "mcz", [command, str(folder), str(target), "--force-rate"]) == 2
    assert "--force-rate needs --rate" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["trc", "motive.csv"])
@pytest.mark.parametrize("rate", [120, 200])
def test_times_of_parts_have_the_decimals_of_their_rate(
    suffix: str, rate: int, tmp_path: Path
) -> None:
    path = tmp_path / (suffix if "." in suffix else f"a.{suffix}")
    path.write_bytes(FILES[suffix](tuple(range(101, 121))))
    mcz.encode(path, tmp_path / "a.mcz", rate=rate)
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file.only_clip()
        path.write_bytes(clip.source_bytes(frames=(3, 14)))
        assert np.abs(mcz.read(path).times - clip.times[3:14]).max() < 6e-7


def test_events_keep_their_frames_at_a_corrected_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    made = Made(np.zeros((15, 1, 4), np.uint32), np.ones((15, 4, 1), np.uint32), first=124)
    made.parameters["EVENT"] = {
        "USED": made.number(2),
        "TIMES": (4, (2, 2), b"".join(made.real(number)[2] for number in (0.0, 1.3, 0.0, 1.35))),
    }
    made.parameters["ANALOG"] = {"RATE": made.real(400.0)}
    path.write_bytes(made.build())
    decoded = mcz.recording(mcz.read(path))
    assert decoded is not None and decoded.events
    rate = mcz.read(path).frame_rate
    assert rate is not None
    frames = [event.time * float(rate) for event in decoded.events]
    mcz.encode(path, tmp_path / "a.mcz", rate=rate * 2)
    mcz.extract(tmp_path / "a.mcz", tmp_path / "b.mcz", frames=(5, 14))
    with mcz.open(tmp_path / "a.mcz") as file, mcz.open(tmp_path / "b.mcz") as part:
        assert file.only_clip().source_bytes() == path.read_bytes()
        path.write_bytes(part.only_clip().source_bytes())
        motions = file.only_clip().motion(), part.only_clip().motion((3, 8)), mcz.read(path)
        found = [file.only_clip().recording, part.only_clip().recording]
        found += [mcz.recording(motion) for motion in motions]
    for recording in found:
        assert recording is not None
        assert recording.analog_rate == (decoded.analog_rate and decoded.analog_rate * 2)
        times = [event.time * float(rate * 2) for event in recording.events]
        np.testing.assert_allclose(times, frames, rtol=1e-6)
