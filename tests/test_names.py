"""Clips by whatever they are called, parts of them as of an array, and what prints of a thing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.errors import OptionError
from mcz.motion import Exceptions
from mcz.numbers import Grid, GridKind
from tests.motions import smooth


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    folder = tmp_path_factory.mktemp("named")
    text = (samples / "walk.bvh").read_bytes()
    for name in ("a/walk.bvh", "a/run.bvh", "b/walk.bvh", "b/copy.bvh", "b/jump.v2.bvh"):
        path = folder / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        number = b"7" if name == "b/copy.bvh" else b"%d" % (len(list(folder.rglob("*"))) % 7)
        path.write_bytes(text.replace(b"Frame Time: ", b"Frame Time: " + number, 1))
    (folder / "in/c").mkdir()
    (folder / "in/c/again.bvh").write_bytes((folder / "in/b/copy.bvh").read_bytes())
    mcz.pack(folder / "in", folder / "a.mcz")
    return folder / "a.mcz"


@pytest.mark.parametrize(
    ("name", "clip"),
    [
        ("a/walk", "a/walk"),
        ("run", "a/run"),
        ("a/run.bvh", "a/run"),
        ("run.bvh", "a/run"),
        ("c/again.bvh", "b/copy"),
        ("c/again", "b/copy"),
        ("again", "b/copy"),
        ("again.bvh", "b/copy"),
        ("jump.v2", "b/jump.v2"),
    ],
)
def test_a_clip_is_found(archive: Path, name: str, clip: str) -> None:
    with mcz.open(archive) as file:
        assert file.only_clip(name).name == clip


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("walk", "'walk' may be a/walk, b/walk; choose one"),
        ("walk.bvh", "may be a/walk, b/walk; choose one"),
        ("a/wlak", "did you mean 'a/walk'"),
        ("RUN", "did you mean 'run'"),
        ("xyzzy", "there are: a/run, a/walk, b/copy, b/jump.v2, b/walk"),
    ],
)
def test_a_near_miss_is_suggested(archive: Path, name: str, said: str) -> None:
    with mcz.open(archive) as file, pytest.raises(OptionError) as found:
        file.only_clip(name)
    assert said in str(found.value)


def test_all_commands_find_it(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    for arguments in (
        ["decode", archive, "--clip", "run", "--to", "csv", "-o", f"{out}.csv"],
        ["extract", archive, f"{out}.mcz", "--clip", "run.bvh"],
        ["replace", archive, f"{out}2.mcz", "--clip=run", "--joint=0", f"--values={out}.csv"],
        ["diff", archive, archive, "--clip", "run"],
    ):
        assert run(cli, "mcz", [str(a) for a in arguments]) == 0, capsys.readouterr().err
    assert mcz.read(archive, clip="run").name == "a/run"
    assert mcz.read(f"{out}2.mcz", clip="run").name == "a/run"


KEYS: list[Any] = [
    np.s_[10:20, 3:6],
    np.s_[5],
    np.s_[-1, 2],
    np.s_[5, ::2],
    np.s_[::-3, 1],
    np.s_[3:3],
    np.s_[:, -1],
    np.s_[[4, 2, -1]],
    np.s_[[4, 2, 2], [0, 1, 2]],
    np.s_[[4, 2], 1:3],
    np.s_[[4, 2], 1],
    np.s_[...],
    np.s_[..., 2],
    np.s_[None, 3],
    np.s_[()],
    np.s_[np.arange(40) % 3 == 0],
    np.s_[np.arange(40) % 3 == 0, 1],
    np.s_[np.arange(4).reshape(2, 2)],
    np.s_[np.int64(7)],
    np.s_[[]],
    np.s_[2:4, None],
]


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Iterator[mcz.Clip]:
    path = tmp_path_factory.mktemp("clip") / "a.mcz"
    mcz.write(smooth(40), path)
    with mcz.open(path) as file:
        yield file.only_clip()


@pytest.mark.parametrize("key", KEYS, ids=str)
def test_values_are_indexed_as_an_array_is(clip: mcz.Clip, key: Any) -> None:
    np.testing.assert_array_equal(clip.values[key], clip.read()[key])


@pytest.mark.parametrize("key", [40, -41, (0, 99), "a", [1.5], [40], np.zeros(3, bool)], ids=str)
def test_values_refuse_what_an_array_does(clip: mcz.Clip, key: Any) -> None:
    for values in (clip.values, clip.read()):
        with pytest.raises(IndexError):
            values[key]


def test_one_joint_by_its_name(clip: mcz.Clip, tmp_path: Path) -> None:
    for joint in (clip.skeleton.joints[0].name, 0, np.int64(0)):
        np.testing.assert_array_equal(clip.read(joints=joint), clip.read(joints=[joint]))
    mcz.extract(clip.container.source.name, tmp_path / "b.mcz", joints=clip.skeleton.joints[1].name)
    with pytest.raises(mcz.MotionError, match="no joint 'nobody'"):
        clip.read(joints="nobody")


def public_things(folder: Path) -> Iterator[object]:
    """One of everything public that holds much, each with far too much in it."""
    long = "n" * 5000
    motion = smooth(600)
    joints = [replace(motion.skeleton.joints[0], name=long, tails=((0.0, 0.0, 1.0),) * 40)]
    joints += [replace(joints[0], name=f"{long}{n}", parent=0, tails=()) for n in range(400)]
    skeleton = replace(motion.skeleton, joints=tuple(joints), name=long)
    n_channels = skeleton.n_channels
    exceptions = Exceptions(np.arange(600), np.zeros(600, np.int64), (b"1e5" * 30,) * 600)
    signal = mcz.Signal(
        np.zeros((600, n_channels)), mask=np.zeros((600, n_channels), bool), exceptions=exceptions
    )
    source = mcz.Source("bvh", b"t" * 9000, b"d" * 9000, path=long)
    big = mcz.Motion(skeleton, (signal,) * 3, name=long, metadata={"x-a": long}, source=source)
    yield from (big, skeleton, signal, source, exceptions, big.skeleton.joints[0].channels[0])
    yield Grid(GridKind.FIXED, 4)
    path = folder / "many.mcz"
    for n in range(60):
        (folder / f"clip-{'x' * 200}{n}.txt").write_text(str(n))
    yield mcz.pack(folder, path, keep_all=True)
    plain = replace(big, signals=(replace(signal, exceptions=Exceptions()),), source=None)
    yield mcz.write(plain, folder / "b")
    with mcz.open(folder / "b") as file:
        found = file.only_clip()
        yield from (file, found, found.values, found.skeleton)
        yield mcz.compare(found.motion(), found.motion())
    with mcz.open(path) as file:
        yield from (file, next(iter(file.attachments.values())))
    yield mcz.LiveFrame(0, np.zeros(5000), np.zeros(5000, bool))
    yield mcz.extract(folder / "b", folder / "c", frames=(0, 3))
    yield mcz.StreamSummary()


def test_what_prints_of_a_thing_fits_on_a_screen(tmp_path: Path) -> None:
    seen = set()
    for thing in public_things(tmp_path):
        text = repr(thing)
        assert len(text) < 1200 and "\n" not in text, text[:300]
        assert " at 0x" not in text
        seen.add(type(thing).__name__)
    assert {"Motion", "Skeleton", "Signal", "File", "Clip", "Written", "Report"} <= seen


def test_what_prints_of_a_motion_says_what_it_is() -> None:
    motion = smooth(12)
    text = repr(motion)
    assert text.startswith(f"<Motion {motion.name!r}: 12 frames at ")
    assert f"{motion.skeleton.n_channels} channels" in text
