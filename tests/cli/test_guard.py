"""Never destroy, never mix up: inputs, suffixes, options given twice, and what is left out."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest

import mcz
from mcz import OptionError
from mcz.cli.common import run
from mcz.cli.info import info_command
from mcz.cli.main import COMMANDS, cli
from tests.commands import ENV, Call

SLOPPY = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: %d\n"
SLOPPY += "Frame Time: 0.01\n1\n2\n3\n"


@pytest.fixture
def archive_path(folder: Path, call: Call) -> Path:
    """walk.amc, walk.bvh and walk.c3d in one file."""
    call("pack", folder, folder / "all.mcz")
    return folder / "all.mcz"


# An input is no output -----------------------------------------------------------


def names_of(path: Path) -> list[Path]:
    """The file under its name, behind a symbolic link, and under a second name."""
    link, second = path.with_name("link.bvh"), path.with_name("second.bvh")
    link.symlink_to(path)
    os.link(path, second)
    return [path, path.parent / "." / ".." / path.parent.name / path.name, link, second]


def test_encode_keeps_its_source(folder: Path, call: Call) -> None:
    source = folder / "walk.bvh"
    before = source.read_bytes()
    for target in names_of(source):
        code, out, errors = call("encode", source, "-o", target, "--force")
        assert (code, out) == (2, "")
        assert errors.startswith(f"mcz: {target}: the output is the input itself")
        with pytest.raises(OptionError, match="the input itself"):
            mcz.encode(source, target, force=True)
        assert target.read_bytes() == before
    with source.open("r+b") as stream, pytest.raises(OptionError, match="the input itself"):
        mcz.encode(source, stream)
    with pytest.raises(OptionError, match="the input itself"):
        mcz.encode(source, source.as_uri(), force=True)


def test_append_keeps_its_target(archive_path: Path, folder: Path) -> None:
    with pytest.raises(OptionError, match="the input itself"):
        mcz.append([archive_path], archive_path, verbatim=True)
    with pytest.raises(OptionError, match="the input itself"):
        mcz.append([folder / "walk.amc"], folder / "walk.asf", skeleton=folder / "walk.asf")


def test_pack_keeps_what_it_packs(folder: Path, call: Call) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    code, _, errors = call("pack", folder, folder / "walk.bvh", "--force")
    assert code == 2
    assert "the output is the input itself" in errors
    (folder / "x.mcz").symlink_to(folder / "walk.bvh")
    assert call("pack", folder, folder / "x.mcz", "--force")[0] == 2
    (folder / "x.mcz").unlink()
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    for _ in range(2):  # the earlier archive is no part of the new one
        assert call("pack", folder, folder / "all.mcz", "--keep-all", "--force")[0] == 0
        with mcz.open(folder / "all.mcz") as file:
            assert not file.attachments


def test_unpack_keeps_its_archive(tmp_path: Path, call: Call) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "all.mcz").write_bytes(b"an earlier one")
    assert call("pack", tmp_path / "in", tmp_path / "all.mcz", "--keep-all")[0] == 0
    before = (tmp_path / "all.mcz").read_bytes()
    code, _, errors = call("unpack", tmp_path / "all.mcz", tmp_path, "--force")
    assert code == 1
    assert "the output is the input itself" in errors
    assert (tmp_path / "all.mcz").read_bytes() == before


@pytest.mark.parametrize(
    "words",
    [
        "encode - -o walk.bvh --force",
        "encode - --codec lsdt-frame --param step=0.1 -o walk.bvh --force",
        "encode walk.bvh -o - >> walk.bvh",
        "stream encode -o walk.bvh --force",
        "stream decode >> walk.bvh",
        "decode - -o walk.bvh --force < walk.mcz",
    ],
)
def test_standard_streams_are_files_too(folder: Path, words: str) -> None:
    before = (folder / "walk.bvh").read_bytes()
    mcz.encode(folder / "walk.bvh", folder / "walk.mcz")
    if "<" in words:
        os.replace(folder / "walk.mcz", folder / "kept.mcz")
        os.link(folder / "kept.mcz", folder / "walk.mcz")
        words = words.replace("-o walk.bvh", "-o kept.mcz --to csv")
    else:
        words += " < walk.bvh"
    done = subprocess.run(
        f"{sys.executable} -m mcz {words}",
        shell=True,
        cwd=folder,
        env=ENV,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert b"the output is the input itself" in done.stderr
    assert (folder / "walk.bvh").read_bytes() == before


def test_a_device_is_nobody_s_input(folder: Path, call: Call) -> None:
    if not Path("/dev/null").exists():
        pytest.skip("no /dev/null")
    assert call("encode", folder / "walk.bvh", "-o", "/dev/null", "--force")[0] == 0


# What the suffix says ------------------------------------------------------------


def test_what_is_kept_has_one_format(folder: Path, call: Call) -> None:
    call("encode", folder / "walk.asf")
    code, _, errors = call("decode", folder / "walk.mcz", "-o", folder / "x.bvh")
    assert code == 2
    assert "walk.asf, which cannot be converted to .bvh" in errors
    assert call("decode", folder / "walk.mcz", "-o", folder / "x.asf")[0] == 0


# Outputs: all or none ------------------------------------------------------------


def test_all_outputs_or_none(folder: Path, call: Call) -> None:
    mcz.encode(folder / "walk.amc", folder / "p.mcz", codec="lsdt-clip", rate=120)
    (folder / "out").mkdir()
    (folder / "out" / "walk.asf").write_bytes(b"mine")
    words = ("decode", folder / "p.mcz", "--to", "amc", "--solve-ik", "--with-skeleton", "-o")
    for target in (folder / "out", folder / "out" / "x.amc"):
        code, _, errors = call(*words, target)
        assert (code, "walk.asf: already exists; use --force" in errors) == (2, True)
        assert [path.name for path in (folder / "out").iterdir()] == ["walk.asf"]
    assert (folder / "out" / "walk.asf").read_bytes() == b"mine"


def test_two_outputs_of_one_name(folder: Path, call: Call) -> None:
    call("encode", folder / "walk.amc")
    words = ("decode", folder / "walk.mcz", "--with-skeleton", "--force", "-o")
    code, _, errors = call(*words, folder / "walk.asf", "--to", "csv")
    assert (code, "2 outputs have this name" in errors) == (2, True)


# Options given twice -------------------------------------------------------------


def single_options(
    command: click.Command, words: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], list[str]]]:
    """Words of commands, and each option of theirs that takes no list, given twice."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from single_options(inner, (*words, name))
        return
    for option in command.params:
        if isinstance(option, click.Option) and not (option.multiple or option.is_eager):
            values = [] if option.is_flag else ["1"] * option.nargs
            for other in option.secondary_opts or option.opts:
                yield words, [option.opts[0], *values, other, *values]


@pytest.mark.parametrize("name", COMMANDS)
def test_an_option_given_twice_is_an_error(name: str, call: Call) -> None:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    for words, given in single_options(command, (name,)):
        code, out, errors = call(*words, *given)
        assert (code, out) == (2, ""), given
        assert "is given 2 times; give it once" in errors, given
        assert f"see mcz {' '.join(words)} --help" in errors


def test_help_and_lists_may_be_repeated(call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("decode", "--joints", "a", "--joints", "b", "--help")[0] == 0
    words = ("encode", "a.bvh", "--param", "x=1", "--param", "y=2")
    assert "a.bvh: no such file" in call(*words)[2]
    assert run(info_command, "mcz-info", ["a.mcz", "--json", "--json"]) == 2
    assert "--json is given 2 times" in capsys.readouterr().err


def test_decode_several_clips(archive_path: Path, folder: Path, call: Call) -> None:
    out = folder / "out"
    words = ("decode", archive_path, "--clip", "walk", "--clip", "walk.bvh", "--clip", "walk")
    assert call(*words, "-o", f"{out}/")[0] == 0
    assert sorted(path.name for path in out.iterdir()) == ["walk.amc", "walk.bvh"]
    assert (out / "walk.amc").read_bytes() == (folder / "walk.amc").read_bytes()
    for target in ("-", folder / "x.amc"):
        code, _, errors = call(*words, "-o", target)
        assert (code, "is one file, for 2 clips" in errors) == (2, True)
    rows = json.loads(call(*words, "--to", "csv", "-o", out, "--json")[1])["outputs"]
    assert [Path(row["path"]).name for row in rows] == ["walk.csv", "walk.bvh.csv"]
    assert call(*words, "--clip", "none", "-o", out)[0] == 2


def test_unpack_and_extract_several_clips(archive_path: Path, folder: Path, call: Call) -> None:
    out = folder / "out"
    assert call("unpack", archive_path, out, "--clip", "walk", "--clip", "walk.c3d")[0] == 0
    names = ["walk.amc", "walk.asf", "walk.c3d"]  # a clip comes with its skeleton
    assert sorted(path.name for path in out.iterdir()) == names
    small = folder / "small.mcz"
    assert call("extract", archive_path, small, "--clip", "walk", "--clip", "walk.bvh")[0] == 0
    with mcz.open(small) as file:
        assert list(file.clips) == ["walk", "walk.bvh"]
        assert file.clips["walk"].source_bytes() == (folder / "walk.amc").read_bytes()
    assert call("verify", small)[0] == 0
    assert call("unpack", archive_path, out, "--clip", "none")[0] == 2


def test_info_of_some_clips(archive_path: Path, call: Call) -> None:
    document = json.loads(call("info", archive_path, "--json", "--clip", "walk")[1])
    assert [clip["name"] for clip in document["clips"]] == ["walk"]
    assert [one["name"] for one in document["skeletons"]] == ["walk"]
    assert len(json.loads(call("info", archive_path, "--json")[1])["skeletons"]) == 3
    assert call("info", archive_path, "--clip", "none")[0] == 2
    assert call("info", archive_path, "--clip", "walk", "--layout")[0] == 2


# What is left out, what was noticed ----------------------------------------------


def test_pack_names_what_it_leaves_out(folder: Path, call: Call) -> None:
    (folder / "sub").mkdir()
    for name in ("a.log", "sub/b.log", "notes.txt", "README"):
        (folder / name).write_bytes(b"12345")
    (folder / "sloppy.bvh").write_text(SLOPPY % 2)
    words = ("pack", folder, folder / "all.mcz")
    code, out, errors = call(*words)
    assert code == 0
    assert "left out 4 files: 2 .log, 1 .txt, 1 without suffix" in errors
    for name in ("a.log", "sub/b.log", "notes.txt", "README"):
        assert f"mcz: {name}: skipped: no motion file; --keep-all keeps it" in errors
    assert "mcz: sloppy.bvh: 2 frames are declared, 3 are there" in errors
    size = (folder / "all.mcz").stat().st_size
    total = sum((folder / f"walk.{s}").stat().st_size for s in ("asf", "amc", "bvh", "c3d"))
    total += (folder / "sloppy.bvh").stat().st_size
    assert f"sources {total:,} bytes, the file {size:,} bytes" in out
    code, out, errors = call(*words, "--force", "--json")
    document = json.loads(out)
    assert "left out 4 files" in errors
    assert document["bytes"] == size
    assert document["counts"] == {"parsed": 4, "skeleton": 1, "skipped": 4}
    rows = {row["path"]: row for row in document["files"]}
    assert rows["a.log"]["result"] == "skipped"
    assert rows["sloppy.bvh"]["notes"] == ["2 frames are declared, 3 are there"]
    assert "left out" not in call(*words, "--force", "--keep-all")[2]


def test_many_of_a_kind_are_counted(tmp_path: Path, call: Call) -> None:
    for number in range(60):
        (tmp_path / f"{number:02}.png").write_bytes(b"")
    errors = call("pack", tmp_path, tmp_path / "a.mcz")[2]
    assert errors.count(".png: skipped") == 50
    assert "mcz: 10 more .png files skipped: no motion file" in errors
    for number in range(53):
        (tmp_path / f"{number:02}.bvh").write_text(
            (SLOPPY % 2).replace("ROOT a", f"ROOT a{number}")
        )
    errors = call("pack", tmp_path, tmp_path / "b.mcz")[2]
    note = "2 frames are declared, 3 are there"
    assert errors.count(f".bvh: {note}") == 50
    assert f"mcz: 3 more .bvh files: {note}" in errors


def test_encode_and_append_pass_on_what_was_noticed(folder: Path, call: Call) -> None:
    for number, name in enumerate("ab"):
        (folder / f"{name}.bvh").write_text(SLOPPY % number)
    errors = call("encode", folder / "a.bvh")[2]
    assert errors == f"mcz: {folder / 'a.bvh'}: 0 frames are declared, 3 are there\n"
    _, out, errors = call("append", folder / "b.bvh", folder / "a.mcz")
    assert "mcz: b.bvh: 1 frames are declared, 3 are there" in errors
    assert f"the file {(folder / 'a.mcz').stat().st_size:,} bytes" in out


def test_info_of_many_clips_passes_it_on(folder: Path, call: Call) -> None:
    (folder / "notes.txt").write_text("left foot first")
    for number in range(4):
        (folder / f"s{number}.bvh").write_text((SLOPPY % 2).replace("3\n", f"3{number}\n"))
    call("pack", folder, folder / "all.mcz")
    shown = call("info", folder / "all.mcz")[1]
    assert "source-note  2 frames are declared, 3 are there: s0, s1, s2, s3" in shown
    assert "skeleton-note  ASF of the name of the take: walk" in shown
    call("pack", folder, folder / "all.mcz", "--keep-all", "--force")
    assert "\\n" not in call("info", folder / "all.mcz")[1]


def test_list_says_what_a_name_restores(folder: Path, call: Call) -> None:
    shutil.copy(folder / "walk.bvh", folder / "again.bvh")
    call("pack", folder, folder / "all.mcz")
    shown = call("list", folder / "all.mcz")[1]
    assert "walk.asf  the file of skeleton " in shown
    assert "walk.bvh  same content as clip again" in shown
    document = json.loads(call("list", folder / "all.mcz", "--json")[1])
    assert document["aliases"] == ["walk.asf", "walk.bvh"]
    assert document["alias_targets"][1] == {"name": "walk.bvh", "of": "clip", "target": "again"}
    assert document["alias_targets"][0]["of"] == "skeleton"


def test_replace_counts_exceptions(folder: Path, call: Call) -> None:
    call("encode", folder / "walk.bvh")
    with mcz.open(folder / "walk.mcz") as file:
        values = file.clips["walk"].read(joints=["Head"]) + np.pi / 1000
    np.savez(folder / "v.npz", values=values)
    words = ("replace", folder / "walk.mcz", folder / "x.mcz", "--joint", "Head")
    words = (*words, "--values", folder / "v.npz", "--force")
    code, out, _ = call(*words)
    assert code == 0
    assert "720 numbers of the joint off the grid, 0 before; use --on-grid" in out
    document = json.loads(call(*words, "--json")[1])
    assert (document["n_exceptions"], document["n_exceptions_before"]) == (720, 0)
    grown = (folder / "x.mcz").stat().st_size - (folder / "walk.mcz").stat().st_size
    assert document["joint_bytes"] - document["joint_bytes_before"] == pytest.approx(grown, abs=300)
    info = json.loads(call("info", folder / "x.mcz", "--json")[1])
    assert info["clips"][0]["n_exceptions"] == 720
    assert json.loads(call(*words, "--on-grid", "--json")[1])["n_exceptions"] == 0


@pytest.mark.parametrize("name", ["new.bvh", "new.C3D", "new.csv", "new.npz"])
def test_no_mcz_has_the_suffix_of_another_format(folder: Path, call: Call, name: str) -> None:
    suffix = Path(name).suffix.lower()
    message = f"{name}: an MCZ file must not have the suffix {suffix}; convert writes that format"
    code, out, errors = call("encode", folder / "walk.bvh", "-o", folder / name)
    assert (code, out) == (2, "")
    assert errors.endswith(f"{message}\n")
    with pytest.raises(OptionError, match=message):
        mcz.write(mcz.read(folder / "walk.bvh"), folder / name)
    assert not (folder / name).exists()


def test_a_file_over_the_limits_is_refused_with_the_way_out(folder: Path, call: Call) -> None:
    names = ",".join(f"c{n}" for n in range(20_000))
    (folder / "wide.csv").write_text(f"{names}\n{'1,' * 19_999}1\n")
    code, _, errors = call("encode", folder / "wide.csv")
    assert code == 1
    assert "channels: 20000 is over the limit of 16384; --profile large allows more" in errors
    assert call("encode", folder / "wide.csv", "--profile", "large").code == 0
