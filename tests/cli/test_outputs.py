"""Commands that write files: no input is overwritten, none is replaced unasked, none is half."""

from __future__ import annotations

import errno
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.cli.main import COMMANDS
from tests.commands import Call, run

# Words of a command, of which {} is the output, and an input of it that must survive.
WRITERS = {
    "encode walk.bvh -o {}": "walk.bvh",
    "encode walk.amc -o {}": "walk.asf",  # found beside it
    "encode walk.amc --skeleton walk.asf -o {}": "walk.asf",
    "encode walk.c3d --codec lsdt-clip --param basis=walk.basis -o {}": "walk.basis",
    "convert walk.bvh {}": "walk.bvh",
    "decode walk.mcz --to csv -o {}": "walk.mcz",
    "pack takes {}": "takes/walk.bvh",
    "extract takes.mcz {} --clip walk": "takes.mcz",
    "merge takes.mcz walk.mcz --rename -o {}": "walk.mcz",
    "delete takes.mcz walk.bvh -o {}": "takes.mcz",
    "rename takes.mcz walk run -o {}": "takes.mcz",
    "reorder takes.mcz --by name -o {}": "takes.mcz",
    "replace walk.mcz {} --joint Head --values head.npz": "head.npz",
    "repair walk.mcz -o {}": "walk.mcz",
    "train walk.c3d --iterations 1 -o {}": "walk.c3d",
    "view walk.bvh -o {}": "walk.bvh",
    "render walk.bvh --size 64 -o {}": "walk.bvh",
    "plot walk.bvh -o {}": "walk.bvh",
}
# These write folders, standard output or their own file.
OTHERS = "append bag bench codecs completion diff export info list meta protect sample selftest"
OTHERS += " split stream unpack verify"
SUFFIXES = {"encode": ".mcz", "view": ".html", "render": ".png", "plot": ".svg"}  # that they take
every_writer = pytest.mark.parametrize("words", WRITERS)


@pytest.fixture(scope="module")
def inputs(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample files, archives of them, a basis, and values of a joint."""
    folder = tmp_path_factory.mktemp("inputs")
    shutil.copytree(samples, folder, dirs_exist_ok=True)
    shutil.copytree(samples, folder / "takes", ignore=shutil.ignore_patterns("*.c3d"))
    mcz.pack(folder / "takes", folder / "takes.mcz")
    mcz.encode(folder / "walk.bvh", folder / "walk.mcz", unit="cm")
    train = ("train", folder / "walk.c3d", "-o", folder / "walk.basis", "--iterations", 1)
    assert run(*train) == 0
    with mcz.open(folder / "walk.mcz") as file:
        np.savez(folder / "head.npz", values=file.only_clip().read(joints=["Head"]))
    return folder


@pytest.fixture
def folder(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the inputs, in which the command runs."""
    shutil.copytree(inputs, tmp_path / "in")
    monkeypatch.chdir(tmp_path / "in")
    return tmp_path / "in"


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def suffix_of(words: str) -> str:
    """A suffix that the command takes for its output."""
    return SUFFIXES.get(words.split()[0], Path(WRITERS[words]).suffix)


def arguments(words: str, output: Path | str) -> list[str]:
    return [str(output) if word == "{}" else word for word in words.split()]


def test_every_command_is_asked() -> None:
    assert {words.split()[0] for words in WRITERS} | set(OTHERS.split()) == set(COMMANDS)


@every_writer
def test_no_output_takes_the_place_of_an_input(words: str, folder: Path, call: Call) -> None:
    """Forced or not, under the input's name, behind a link, and under a second name of it."""
    kept = folder / WRITERS[words]
    link, second = (folder / f"{name}{suffix_of(words)}" for name in ("link", "second"))
    link.symlink_to(kept)
    os.link(kept, second)
    before = contents(folder)
    names = [link, second]
    if kept.suffix == suffix_of(words):
        names += [kept, folder / "takes" / ".." / WRITERS[words]]
    for target in names:
        code, out, errors = call(*arguments(words, target), "--force")
        assert (code, out, errors.count("\n")) == (2, "", 1), errors
        assert re.search(r"the output is the (input|damaged file) itself", errors)
        assert errors.endswith("; name another output\n")
        assert contents(folder) == before


@every_writer
def test_what_is_there_is_replaced_by_force_alone(words: str, folder: Path, call: Call) -> None:
    target = folder / f"mine{suffix_of(words)}"
    target.write_bytes(b"mine")
    before = contents(folder)
    code, out, errors = call(*arguments(words, target))
    assert (code, out) == (2, "")
    assert errors.endswith("already exists; use --force to replace it\n")
    assert contents(folder) == before
    code, _, errors = call(*arguments(words, target), "--force")
    assert code == 0, errors
    after = contents(folder)
    assert after.pop(target) != before.pop(target) == b"mine"
    assert after == before


@every_writer
def test_a_full_disk_leaves_all_as_it_was(
    words: str, folder: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    target = folder / f"mine{suffix_of(words)}"
    target.write_bytes(b"mine")
    before = contents(folder)
    monkeypatch.setattr("os.replace", full)
    code, out, errors = call(*arguments(words, target), "--force")
    assert (code, out, "No space left on device" in errors) == (1, "", True)
    assert contents(folder) == before


@every_writer
def test_an_input_that_is_missing_is_named(words: str, folder: Path, call: Call) -> None:
    first = folder / words.split()[1]
    shutil.rmtree(first) if first.is_dir() else first.unlink()
    before = contents(folder)
    code, out, errors = call(*arguments(words, f"new{suffix_of(words)}"))
    is_folder = words.startswith("pack")  # the only command whose wrong input is a wrong word
    assert (code, out, first.name in errors) == (2 if is_folder else 1, "", True), errors
    assert contents(folder) == before
