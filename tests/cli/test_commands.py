"""Every command, run as a user would: what it writes, prints, refuses and returns."""

from __future__ import annotations

import csv
import hashlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.info import info_command
from mcz.cli.main import COMMANDS
from mcz.container.limits import FORMAT_NAME as VERSION
from tests.commands import Call, fails

CLIP_KEYS = {
    "name",
    "codec",
    "n_frames",
    "n_channels",
    "n_joints",
    "frame_rate",
    "payload_bytes",
    "overhead_bytes",
    "source_chunk_bytes",
    "source_bytes",
    "cr_source",
    "cr_float32",
    "cr_40B",
    "cr_file",
    "quality",
}


@pytest.fixture
def walk(folder: Path, call: Call) -> Path:
    """walk.mcz, made of walk.bvh."""
    result = call("encode", folder / "walk.bvh")
    assert result.code == 0, result.err
    return folder / "walk.mcz"


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_sample(tmp_path: Path, call: Call) -> None:
    result = call("sample", tmp_path / "new", "--json")
    names = [Path(o["path"]).name for o in result.document["outputs"]]
    assert names == ["walk.asf", "walk.amc", "walk.bvh", "walk.c3d"]
    fails(call("sample", tmp_path / "new"), 2, "walk.asf", "--force")
    assert call("sample", tmp_path / "new", "--force").code == 0


def test_decode_with_skeleton(folder: Path, call: Call) -> None:
    call("encode", folder / "walk.amc")
    (folder / "out").mkdir()
    result = call("decode", folder / "walk.mcz", "-o", folder / "out", "--with-skeleton", "--json")
    assert [o["kind"] for o in result.document["outputs"]] == ["source", "skeleton"]
    for name in ("walk.amc", "walk.asf"):
        assert digest(folder / "out" / name) == digest(folder / name)


def test_encode_says_what_it_did(folder: Path, call: Call) -> None:
    shown = call("encode", folder / "walk.bvh").out
    assert "240 frames of 96 channels" in shown
    options = ("--force", "--json", "--rate", "30000/1001", "--unit", "cm", "--codec", "raw")
    document = call("encode", folder / "walk.bvh", *options).document
    assert document["output"] == str(folder / "walk.mcz")
    assert document["clips"][0]["frame_rate"] == pytest.approx(30000 / 1001)
    assert document["skeletons"][0]["unit_cm"] == 1


def test_refused_sources(folder: Path, call: Call) -> None:
    (folder / "bad.bvh").write_bytes(b"HIERARCHY\nROOT\n")
    fails(call("encode", folder / "bad.bvh"), 1, "bad.bvh")
    assert not (folder / "bad.mcz").exists()
    fails(call("encode", folder / "absent.bvh"), 1, "absent.bvh: no such file")
    result = call("encode", folder / "bad.bvh", "--verbatim")
    assert result.code == 0, result.err
    assert call("decode", folder / "bad.mcz", "-o", folder / "good").code == 0
    assert digest(folder / "good") == digest(folder / "bad.bvh")


@pytest.mark.parametrize(
    "options",
    [
        ["--codec", "none"],
        ["--param", "frames"],
        ["--param", "nonsense=1"],
        ["--rate", "0"],
        ["--rate", "fast"],
        ["--unit", "furlong"],
        ["--bogus"],
    ],
)
def test_wrong_usage(folder: Path, call: Call, options: list[str]) -> None:
    fails(call("encode", folder / "walk.bvh", *options), 2)
    assert not (folder / "walk.mcz").exists()


def test_csv(walk: Path, call: Call) -> None:
    out = walk.with_suffix(".csv")
    chosen = ("--frames", "10:13", "--joints", "Head,Hips")
    assert call("decode", walk, "--to", "csv", *chosen).code == 0
    rows = list(csv.reader(out.read_text("utf-8").splitlines()))
    assert rows[0] == [
        "frame",
        "time",
        *(f"Head.r{a}" for a in "zyx"),
        *(f"Hips.t{a}" for a in "xyz"),
        *(f"Hips.r{a}" for a in "zyx"),
    ]
    assert [row[0] for row in rows[1:]] == ["11", "12", "13"]
    assert [float(row[1]) for row in rows[1:]] == pytest.approx([10 / 120, 11 / 120, 0.1])
    with mcz.open(walk) as file:
        expected = file.clips["walk"].read(frames=(10, 13), joints=["Head", "Hips"])
    assert (np.array([[float(c) for c in row[2:]] for row in rows[1:]]) == expected).all()


@pytest.mark.parametrize(
    "options",
    [
        ["--joints", "Head"],
        ["--to", "bvh", "--joints", "Head"],
        ["--rate", "120"],
        ["--resolution", "1"],
        ["--to", "csv", "--joints", "Tail"],
        ["--to", "csv", "--resolution", "9"],
        ["--frames", "9"],
        ["--frames", "9:3"],
        ["--frames", "0:999"],
        ["--clip", "run"],
        ["--to", "xlsx"],
        ["-o", "-", "--json"],
    ],
)
def test_decode_refuses(walk: Path, call: Call, options: list[str]) -> None:
    result = call("decode", walk, *options)
    fails(result, result.code)
    assert result.code in (1, 2)


def test_info(walk: Path, call: Call) -> None:
    text = call("info", walk).out
    for words in (
        f"MCZ {VERSION}",
        "31 joints",
        "96 channels",
        "codec",
        "payload",
        "sha256",
        "Hips",
    ):
        assert words in text
    document = call("info", walk, "--json").document
    assert document["file_bytes"] == walk.stat().st_size
    assert document["format_version"] == VERSION
    assert set(document["clips"][0]) >= CLIP_KEYS
    clip = document["clips"][0]
    manual = Path(mcz.__file__).parents[1].joinpath("docs/reference/scripts.md").read_text("utf-8")
    for keys in (document, clip, document["skeletons"][0]):
        assert all(re.search(rf"\b{key}\b", manual) for key in keys), "the manual lists them all"
    assert (clip["n_frames"], clip["n_channels"], clip["n_joints"]) == (240, 96, 31)
    assert clip["frame_rate"] == pytest.approx(120)


def test_layout_covers_every_byte(walk: Path, call: Call) -> None:
    at = 0
    for row in call("info", walk, "--layout", "--json").document:
        assert row["offset"] == at
        at += row["bytes"]
    assert at == walk.stat().st_size
    assert "FOOT" in call("info", walk, "--layout").out


def test_mcz_info_is_the_same(walk: Path, call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    expected = call("info", walk).out
    assert run(info_command, "mcz-info", [str(walk)]) == 0
    assert capsys.readouterr().out == expected


def test_not_an_mcz_file(folder: Path, call: Call) -> None:
    codes = {"decode": 2, "list": 1, "verify": 3}  # decode converts it; info describes it
    for name, code in codes.items():
        fails(call(name, folder / "walk.bvh"), code, "walk.bvh")
        fails(call(name, folder / "absent.mcz"), 1, "absent.mcz")


def test_help_lists_commands_and_exit_codes(call: Call) -> None:
    shown = call("--help").out
    assert all(name in shown for name in COMMANDS)
    assert "Exit codes" in shown
    assert call("--version").out == f"mcz {mcz.__version__}\n"
    fails(call("compress"), 2, "compress")


def test_pipes(walk: Path) -> None:
    """A file on standard input, its source on standard output."""
    command = [sys.executable, "-m", "mcz", "decode", "-", "-o", "-"]
    done = subprocess.run(command, input=walk.read_bytes(), capture_output=True, check=True)
    assert done.stdout == walk.with_suffix(".bvh").read_bytes()
    assert done.stderr == b""
    command[3:] = ["encode", str(walk.with_suffix(".bvh")), "-o", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    assert done.stdout == walk.read_bytes()


def test_verify(walk: Path, call: Call) -> None:
    assert "verified" in call("verify", walk).out
    source = walk.with_suffix(".bvh")
    document = call("verify", walk, "--source", source, "--json").document
    assert document["verified"]
    assert {part["kind"] for part in document["parts"]} == {
        "structure",
        "skeleton",
        "clip",
        "source",
    }
    source.write_bytes(source.read_bytes().replace(b"0.0000", b"0.0001", 1))
    fails(call("verify", walk, "--source", source), 3, "differs from byte")


def test_pack_and_unpack(
    folder: Path, call: Call, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("packed")
    target = elsewhere / "all.mcz"
    (folder / "sub").mkdir()
    shutil.copy(folder / "walk.bvh", folder / "sub" / "walk.bvh")
    (folder / "sub" / "bad.bvh").write_bytes(b"HIERARCHY")
    (folder / "notes.txt").write_text("left foot first")
    result = call("pack", folder, target)
    assert result.code == 1
    left_out, note, failed = result.err.splitlines()
    assert left_out.endswith("all.mcz: left out 1 file: 1 .txt")
    assert note == "mcz: notes.txt: skipped: no motion file; --keep-all keeps it"
    assert "sub/bad.bvh" in failed
    assert "1 failed" in result.out
    fails(call("pack", folder, target), 2, "all.mcz")
    assert call("pack", folder, target, "--keep-all", "--force").code == 0
    out = elsewhere / "out"
    assert call("unpack", target, out).code == 0
    found = {p.relative_to(out) for p in out.rglob("*") if p.is_file()}
    assert found == {p.relative_to(folder) for p in folder.rglob("*") if p.is_file()}
    assert all(digest(out / name) == digest(folder / name) for name in found)
    refused = call("unpack", target, out)
    assert refused.code == 2
    assert refused.err.count("\n") == len(found)
    assert call("unpack", target, out, "--force").code == 0


def test_append(walk: Path, call: Call) -> None:
    before = walk.read_bytes()
    bad = walk.with_name("bad.bvh")
    bad.write_bytes(b"HIERARCHY")
    result = call("append", walk.with_suffix(".amc"), bad, walk)
    assert (result.code, result.out) == (1, "")
    assert "bad.bvh" in result.err
    assert walk.read_bytes() == before
    shown = call("append", walk.with_suffix(".amc"), walk, "--json", "--rate", 120).document
    assert [row["result"] for row in shown["files"]] == ["parsed"]
    assert walk.read_bytes()[: len(before)] == before
    document = call("list", walk, "--json").document
    assert len(document["clips"]) == 2
    assert call("verify", walk).code == 0
    fails(call("decode", walk, "-o", "-"), 2, "2 clips")
