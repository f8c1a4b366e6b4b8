"""``mcz diff``, run as a user would: figures, units, clips, frames; records in ``info``."""

from __future__ import annotations

import io
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz import codecs
from mcz.cli.figures import figure_lines
from tests import overlap_codec
from tests.commands import Call, fails
from tests.test_contacts import markers


@pytest.fixture
def moved_walk(folder: Path) -> Path:
    """The walk of walk.bvh, in cm, its root 1 to the side and, in frame 7, 5: an .mcz."""
    motion = mcz.read(folder / "walk.bvh", unit="cm")
    values = motion.values.copy()
    values[:, 0] += 1
    values[7, 0] += 4
    mcz.write(replace(motion.with_values(values), source=None), folder / "moved.mcz")
    return folder / "moved.mcz"


@pytest.mark.parametrize("name", ["walk.amc", "walk.bvh", "walk.c3d"])
def test_a_file_and_its_mcz_are_equal(folder: Path, call: Call, name: str) -> None:
    assert call("encode", folder / name, "-o", folder / "x.mcz")[0] == 0
    shown = call("diff", folder / name, folder / "x.mcz", "--json").document
    (clip,) = shown["clips"]
    assert (clip["mse"], clip["mse_raw"], clip["max_position_error"]) == (0, 0, 0)
    assert (clip["mismatched_values"], clip["mismatched_points"]) == (0, 0)
    assert clip["ratios_a"] is None
    assert set(clip["ratios_b"]) == {"cr_source", "cr_float32", "cr_40B"}
    info = call("info", folder / "x.mcz", "--json").document["clips"][0]
    assert clip["ratios_b"] == {key: info[key] for key in clip["ratios_b"]}
    if name == "walk.c3d":
        assert [key for key in clip if key.startswith("signal.")]


def test_figures_are_printed_with_their_units(folder: Path, moved_walk: Path, call: Call) -> None:
    code, out, err = call("diff", folder / "walk.bvh", moved_walk, "--unit", "cm")
    assert (code, err) == (0, "")
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line.startswith("  ")}
    assert rows["max_position_error"][1:7] == ["5", "units", "5", "frame", "7,", "point"]
    assert rows["virtual_marker_max"][1:] == ["5"]
    assert rows["mse"][2:] == ["channels,", "squared"]
    assert "1 unit = 1 cm" in out
    assert "note" not in out
    assert f"{moved_walk}: cr_float32" in out


def test_unit_is_for_files_that_say_none(folder: Path, moved_walk: Path, call: Call) -> None:
    clip = call("diff", folder / "walk.bvh", moved_walk, "--json").document["clips"][0]
    assert clip["max_position_error"] == pytest.approx(5)
    assert clip["max_position_error_cm"] is clip["virtual_marker_max_cm"] is None
    assert any("unit" in note for note in clip["notes"])
    shown = call("diff", moved_walk, folder / "walk.bvh", "--unit", "m", "--json").document
    clip = shown["clips"][0]
    assert clip["unit_cm"] == 1  # moved.mcz says cm
    assert clip["max_position_error_cm"] > 100
    assert clip["mse"] is None


def test_frames(folder: Path, moved_walk: Path, call: Call) -> None:
    bvh = folder / "walk.bvh"
    clip = call("diff", bvh, moved_walk, "--frames", "5:10", "--json").document["clips"][0]
    assert (clip["frames"], clip["max_position_error_frame"]) == (5, 7)
    clip = call("diff", bvh, moved_walk, "--frames", ":7", "--json").document["clips"][0]
    assert (clip["frames"], clip["max_position_error"]) == (7, pytest.approx(1))
    fails(call("diff", bvh, moved_walk, "--frames", "5:99999"), 2, "99999")
    fails(call("diff", bvh, moved_walk, "--frames", "5"), 2, "A:B")


def test_other_numbers_of_frames_are_refused(folder: Path, call: Call) -> None:
    motion = mcz.read(folder / "walk.bvh")
    signal = motion.signals[0].cut(0, 100)
    short = replace(motion, signals=(signal,), source=None, frame_numbers=None)
    mcz.write(short, folder / "short.mcz")
    files = folder / "walk.bvh", folder / "short.mcz"
    fails(call("diff", *files), 1, "100", f"{motion.n_frames} frames", "--frames")
    fails(call("diff", *files, "--frames", "50:"), 1, "short.mcz 50;", "--frames")
    clip = call("diff", *files, "--frames", "0:100", "--json").document["clips"][0]
    assert (clip["frames"], clip["mse"]) == (100, 0)


def test_what_cannot_be_compared_is_said(folder: Path, call: Call) -> None:
    code, out, _ = call("diff", folder / "walk.bvh", folder / "walk.c3d")
    assert code == 0
    assert "note: other channels" in out
    assert "mse" not in out


def test_clips_of_archives(folder: Path, call: Call) -> None:
    walk = (folder / "walk.bvh").read_bytes()
    one, two = folder / "one", folder / "two"
    for path, names in ((one, "ab"), (two, "bcd"), (folder / "three", "b"), (folder / "four", "x")):
        path.mkdir()
        for place, name in enumerate(names):
            changed = walk.replace(b"OFFSET 9.59556", f"OFFSET {10 + place}.5".encode())
            (path / f"{name}.bvh").write_bytes(changed)
        assert call("pack", path, f"{path}.mcz")[0] == 0
    files = folder / "one.mcz", folder / "two.mcz"
    shown = call("diff", *files, "--json").document
    assert [clip["name_a"] for clip in shown["clips"]] == ["b"]
    assert (shown["only_in_a"], shown["only_in_b"]) == (["a"], ["c", "d"])
    code, out, _ = call("diff", *files)
    assert code == 0
    assert f"only in {files[0]}: a" in out
    shown = call("diff", files[1], files[1], "--clip", "d", "--clip", "c", "--json").document
    assert [clip["name_b"] for clip in shown["clips"]] == ["d", "c"]
    assert "only_in_a" not in shown
    shown = call("diff", folder / "walk.bvh", files[1], "--clip", "c", "--json").document
    assert shown["clips"][0]["mse"] == 0
    fails(call("diff", *files, "--clip", "a"), 2, "two.mcz", "no clip 'a'")
    fails(call("diff", folder / "walk.bvh", files[1]), 2, "two.mcz", "choose one")
    shown = call("diff", folder / "three.mcz", files[1], "--json").document
    assert (shown["only_in_a"], shown["only_in_b"]) == ([], ["c", "d"])
    assert shown["clips"][0]["max_position_error"] == 0
    fails(call("diff", files[0], folder / "four.mcz"), 2, "no clip in common")
    shown = call("diff", folder / "three.mcz", folder / "four.mcz", "--json").document
    assert (shown["clips"][0]["name_b"], "only_in_b" in shown) == ("x", False)


def test_the_skeleton_of_an_amc(folder: Path, call: Call) -> None:
    away = folder / "away"
    away.mkdir()
    shutil.copy(folder / "walk.amc", away / "walk.amc")
    files = folder / "walk.amc", away / "walk.amc"
    shown = call("diff", *files, "--skeleton", folder / "walk.asf", "--json").document
    assert shown["clips"][0]["max_position_error_cm"] == 0


def test_standard_input(
    folder: Path, moved_walk: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.TextIOWrapper(io.BytesIO(moved_walk.read_bytes()))
    monkeypatch.setattr("sys.stdin", stream)
    clip = call("diff", folder / "walk.bvh", "-", "--json").document["clips"][0]
    assert clip["max_position_error"] == pytest.approx(5)
    fails(call("diff", "-", "-"), 2, "standard input")


def test_bad_files_are_refused(folder: Path, moved_walk: Path, call: Call) -> None:
    fails(call("diff", folder / "none.bvh", moved_walk), 1, "none.bvh", "no such file")
    fails(call("diff", moved_walk, folder / "none.mcz"), 1, "none.mcz", "no such file")
    fails(call("diff", folder / "walk.asf", moved_walk), 2, "walk.asf")
    (folder / "walk.txt").write_text("walk")
    assert call("diff", folder / "walk.txt", moved_walk)[0] in (1, 2)
    moved_walk.write_bytes(moved_walk.read_bytes()[:-40])
    fails(call("diff", folder / "walk.bvh", moved_walk), 1, "moved.mcz")


def test_info_shows_the_record(folder: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, overlap_codec.CODEC)
    arguments = "-o", folder / "x.mcz", "--codec", "overlap", "--param", "length=20"
    assert call("encode", folder / "walk.amc", *arguments)[0] == 0
    clip = call("info", folder / "x.mcz", "--json").document["clips"][0]
    assert clip["quality"]["param.length"] == "20"
    assert float(clip["quality"]["mse"]) < 1e-20
    assert clip["quality_bytes"] > 100
    code, out, _ = call("info", folder / "x.mcz")
    assert code == 0
    assert "codec overlap, length 20" in out
    assert "1 unit = 5.64444 cm" in out
    assert "mean_position_error" in out


def test_records_of_others_are_shown_as_they_are() -> None:
    """A record may say anything."""
    odd = {"frames": "many", "unit_cm": "?", "point_set": "x", "mse": "low", "mood": "good"}
    lines = list(figure_lines(odd))
    assert lines[0] == "point set x, 1 unit = ? cm"
    assert lines[2].split() == ["mse", "low", "channels,", "squared"]
    assert lines[3].split() == ["mood", "good"]
    assert list(figure_lines({})) == []
    long = list(figure_lines({"mood\n\x1b[2J": "9" * 5000, "frames": "9" * 5000}))
    assert len(long) == 3
    assert all(line.isprintable() and len(line) < 200 for line in long)
    assert list(figure_lines({"codec": "z", "param.q": "3"})) == ["codec z, q 3"]


# Shells, joints, contacts


@pytest.fixture
def foot_files(tmp_path: Path) -> tuple[Path, Path]:
    """Two .mcz of markers, frames 10 to 70 with a foot that stands; in the second it creeps."""
    places = np.zeros((90, 2, 3))
    places[:, 1] = (0, 0, 90)
    places[:10, 0, 0] = np.arange(10) * -5
    places[70:, 0, 0] = np.arange(20) * 5
    moved = places.copy()
    moved[:, 0, 1] += np.arange(90) * 0.01
    for name, values in (("a", places), ("b", moved)):
        motion = markers("lfoot head", values, frame_rate=None, up_axis="")
        mcz.write(motion, tmp_path / f"{name}.mcz")
    return tmp_path / "a.mcz", tmp_path / "b.mcz"


def test_the_shell_has_a_radius(folder: Path, moved_walk: Path, call: Call) -> None:
    walk = folder / "walk.bvh"
    clip = call("diff", walk, moved_walk, "--unit", "cm", "--json").document["clips"][0]
    assert (clip["shell_radius_cm"], clip["shell_max_frame"]) == (3, 7)
    assert clip["shell_max_cm"] == pytest.approx(5)
    code, out, _ = call(
        "diff", walk, moved_walk, "--unit", "cm", "--shell", "0.5", "--frames", "5:9"
    )
    rows = {line.split()[0]: line for line in out.splitlines() if line.startswith("  shell")}
    assert code == 0
    assert "0.5 cm from where joints start" in rows["shell_mean"]
    assert rows["shell_max"].split()[1:5] == ["5", "frame", "7,", "joint"]
    for bad in ("0", "-1", "nan", "wide"):
        assert call("diff", walk, moved_walk, "--shell", bad)[0] == 2


def test_a_table_by_joint(folder: Path, moved_walk: Path, call: Call) -> None:
    arguments = (
        "diff",
        folder / "walk.bvh",
        moved_walk,
        "--unit",
        "cm",
        "--frames",
        "5:9",
        "--by-joint",
    )
    code, out, _ = call(*arguments)
    lines = [line.strip() for line in out.splitlines()]
    head = lines.index("joint          mean cm  max cm  frame  shell mean cm  max cm  frame")
    assert code == 0
    assert lines[head - 1] == ""
    assert lines[head + 1].split() == ["Hips", "2", "5", "7", "2", "5", "7"]
    shown = call(*arguments, "--json").document["clips"][0]["by_joint"]
    assert [joint["joint"] for joint in shown] == mcz.read(moved_walk).skeleton.addresses()
    assert len(lines) - head - 1 >= len(shown)
    first = shown[0]
    assert (first["points"], first["max_position_error_frame"], first["shell_max_frame"]) == (
        1,
        7,
        7,
    )
    assert first["mean_position_error_cm"] == first["mean_position_error"] == pytest.approx(2)
    code, out, _ = call(*arguments[:3], "--by-joint")
    assert "mean units" in out and "shell" not in out
    both = call("diff", folder / "walk.bvh", folder / "walk.c3d", "--by-joint", "--json")
    assert both.document["clips"]
    assert "by_joint" not in call(*arguments[:3], "--json").document["clips"][0]


def test_small_distances_by_joint_are_in_mm(foot_files: tuple[Path, Path], call: Call) -> None:
    _, out, _ = call("diff", *foot_files, "--by-joint", "--frames", ":80")
    assert "joint  mean mm  max mm  frame  shell mean mm  max mm  frame" in out
    assert "lfoot     3.95     7.9     79" in out


def test_feet_that_stand_slide(foot_files: tuple[Path, Path], call: Call) -> None:
    code, out, _ = call("diff", *foot_files)
    lines = [line.strip() for line in out.splitlines()]
    assert code == 0
    (said,) = [line for line in lines if line.startswith("contacts of feet: 1, ")]
    (slid,) = [line for line in lines if line.startswith("feet slide")]
    assert "joint lfoot)" in slid and "mm on average, at most" in slid
    assert "feet: lfoot; z up (guessed), 120 frames a second (assumed)" in lines
    clip = call("diff", *foot_files, "--contacts", "--json").document["clips"][0]
    (contact,) = clip["contact_list"]
    assert said == f"contacts of feet: 1, {contact['n_frames']} frames"
    assert clip["slide_max_mm"] == pytest.approx((contact["n_frames"] - 1) * 0.1)
    assert clip["slide_max_mm"] == contact["max_mm"]
    assert clip["slide_max_frame"] == contact["first"] + contact["n_frames"] - 1
    assert clip["feet"] == {
        "joints": ["lfoot"],
        "up_axis": "z",
        "up_guessed": True,
        "frame_rate": 120.0,
        "rate_assumed": True,
    }
    cut = call("diff", *foot_files, "--frames", "30:60", "--contacts", "--json").document["clips"][
        0
    ]
    assert [(c["first"], c["n_frames"]) for c in cut["contact_list"]] == [(30, 30)]
    assert cut["slide_max_frame"] == 59
    _, out, _ = call("diff", *foot_files, "--contacts")
    assert "contact of  first  frames  mean mm  max mm  path mm  original's mm" in out


def test_who_stands_how_fast_and_where_up_is(foot_files: tuple[Path, Path], call: Call) -> None:
    found = call("diff", *foot_files, "--rate", "30", "--up", "z", "--json").document["clips"][0]
    assert (found["feet"]["frame_rate"], found["feet"]["up_guessed"]) == (30, False)
    found = call("diff", *foot_files, "--feet", "head, lfoot", "--json").document["clips"][0]
    assert found["feet"]["joints"] == ["head", "lfoot"]
    assert found["contacts"] == 2
    fails(
        call("diff", *foot_files, "--feet", "hand"),
        1,
        "a.mcz",
        "no joint 'hand'",
    )
    fails(call("diff", *foot_files, "--rate", "fast"), 2, "fast")


def test_without_feet_nothing_is_said_unless_asked(tmp_path: Path, call: Call) -> None:
    motion = markers("head", np.zeros((60, 1, 3)))
    mcz.write(motion, tmp_path / "a.mcz")
    pair = tmp_path / "a.mcz", tmp_path / "a.mcz"
    _, out, _ = call("diff", *pair)
    assert "contacts of" not in out and "feet:" not in out
    _, out, _ = call("diff", *pair, "--contacts")
    assert (
        "note: no joint is named like a foot: no contacts; name the joints of feet (--feet)" in out
    )
    clip = call("diff", *pair, "--contacts", "--json").document["clips"][0]
    assert (clip["feet"], clip["contacts"], clip["contact_list"]) == (None, None, [])


def test_records_with_contacts_are_shown() -> None:
    told = {"contacts": "3", "slide_mean_mm": "0.05", "slide_max_mm": "0.1"}
    lines = list(figure_lines(told | {"shell_mean_cm": "0.25"}))
    assert lines[-2:] == ["contacts of feet: 3", "feet slide 0.05 mm on average, at most 0.1 mm"]
    assert lines[-3].split() == ["shell_mean", "0.25"]


TRC = (
    "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t"
    "OrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t3\t2\tmm\t100\t1\t3\n"
    "Frame#\tTime\tA\t\t\tB\t\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n3\t0.02\t1\t2\t3\t4\t5\t6\n"
)
COLUMNS = "time,x,y,label\n0.00,1.5,2,a\n0.01,2.5,3,b\n0.02,3.5,4,c\n"


@pytest.mark.parametrize(
    ("text", "changes", "line"),
    [
        (TRC, [("\tB\t", "\tC\t")], "joints: 2 in A, 2 in B; only in A: B; only in B: C"),
        (TRC, [("\tA\t\t\tB", "\tB\t\t\tA")], "order of joints: not the same"),
        (TRC, [("3\t0.02", "5\t0.04")], "frame numbers: not the same"),
        (TRC, [("\t0.0", "\t1.0")], "time of the first frame in s: 0 in A, 1 in B"),
        (COLUMNS, [(",y,", ",z,")], "joints: 2 in A, 2 in B; only in A: y; only in B: z"),
        (COLUMNS, [(",x,y,", ",y,x,")], "order of joints: not the same"),
        (COLUMNS, [(",b\n", ",d\n")], "texts or layout of the rows: not the same"),
        (COLUMNS, [("\n0.0", "\n5.0")], "time of the first frame in s: 0 in A, 5 in B"),
    ],
)
def test_what_is_not_the_same_beside_the_numbers(
    tmp_path: Path, call: Call, text: str, changes: list[tuple[str, str]], line: str
) -> None:
    """Two sources of the same numbers: names, order, frame numbers, times and texts are named."""
    suffix = ".trc" if text is TRC else ".csv"
    (tmp_path / f"a{suffix}").write_text(text)
    for old, new in changes:
        text = text.replace(old, new)
    (tmp_path / f"b{suffix}").write_text(text)
    code, out, _ = call("diff", tmp_path / f"a{suffix}", tmp_path / f"b{suffix}")
    assert code == 0 and [f"  {line}"] == [
        found for found in out.splitlines() if " in A, " in found or "not the same" in found
    ]


def test_arrays_that_are_no_signals_are_compared(tmp_path: Path, call: Call) -> None:
    arrays: dict[str, Any] = {
        "poses": np.ones((3, 66)),
        "trans": np.zeros((3, 3)),
        "mocap_framerate": 120.0,
    }
    for name, shape in (("a", 0.0), ("b", 1.0)):
        np.savez(tmp_path / f"{name}.npz", **arrays, betas=np.full(10, shape))
    code, out, _ = call("diff", tmp_path / "a.npz", tmp_path / "b.npz")
    assert code == 0 and "arrays other than the signals: not the same" in out
