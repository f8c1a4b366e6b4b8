"""Which frame rate a file has: its own, where it states one; the caller's, where it does not."""

from __future__ import annotations

import io
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.formats import FORMATS
from mcz.sample import sample_files

GAP = (*range(124, 127), *range(130, 136))  # numbers of frames: 127 to 129 are missing


def trc(numbers: tuple[int, ...], rate: str = "100.00", places: int = 3, hz: float = 100) -> bytes:
    rows = "".join(f"{n}\t{(n - 1) / hz:.{places}f}\t{n}.5\t7\t14\n" for n in numbers)
    return (
        "PathFileType\t4\t(X/Y/Z)\tin.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
        f"{rate}\t{rate}\t{len(numbers)}\t1\tmm\nFrame#\tTime\tRASI\n\t\tX1\tY1\tZ1\n\n{rows}"
    ).encode()


def sto(numbers: tuple[int, ...], header: str = "", places: int = 3, hz: float = 100) -> bytes:
    rows = "".join(f"{(n - 1) / hz:.{places}f}\t{n}.5\n" for n in numbers)
    return f"a\n{header}nRows={len(numbers)}\nendheader\ntime\tknee\n{rows}".encode()


def motive(numbers: tuple[int, ...], stated: str = "100.000000", hz: float = 100) -> bytes:
    rows = "".join(f"{n},{n / hz:.6g},{n}.5,1,2\n" for n in numbers)
    return (
        "Format Version,1.23,Take Name,a,Capture Frame Rate,"
        f"{stated},Export Frame Rate,{stated},Length Units,Meters\n\n"
        ",Type,Marker,Marker,Marker\n,Name,m,m,m\n,ID,1,1,1\n,,Position,Position,Position\n"
        f"Frame,Time (Seconds),X,Y,Z\n{rows}"
    ).encode()


def csv(numbers: tuple[int, ...], hz: float = 100) -> bytes:
    return ("time,a\n" + "".join(f"{n / hz:.3f},{n}.5\n" for n in numbers)).encode()


def vicon(numbers: tuple[int, ...]) -> bytes:
    rows = "".join(f"{n},0,{n}.5,1,2\n" for n in numbers)
    head = "Trajectories\n100\n,,s:A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"
    return (head + rows).encode()


def npz(numbers: tuple[int, ...], hz: float = 100) -> bytes:
    buffer = io.BytesIO()
    times = np.array(numbers) / hz
    np.savez(buffer, joints=np.arange(6.0 * len(numbers)).reshape(-1, 2, 3), times=times)
    return buffer.getvalue()


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
    found = FORMATS["sto"].read(data).frame_rate
    assert found is not None and abs(found / rate - 1) < 2e-3  # 119.88 prints as 120 in few rows
    away = np.array([float(Fraction(n - first) / rate) for n in numbers])
    assert np.abs(away - np.rint(away * float(found)) / float(found)).max() < 3 * 10.0**-places


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
    assert "it states 60 frames a second; --force-rate makes it 120" in notes["run.bvh"]
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
    assert "--force-rate makes it 120" in capsys.readouterr().err
    with mcz.open(target) as file:
        assert [clip.frame_rate for clip in file] == [60]
