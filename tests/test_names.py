"""Clips by whatever they are called, parts of them as of an array, and what prints of a thing."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import mcz
from mcz import Exceptions, OptionError
from mcz.model.numbers import Grid, GridKind
from tests.commands import run
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
        ("walk", "'walk' is ambiguous: a/walk, b/walk; choose one"),
        ("walk.bvh", "is ambiguous: a/walk, b/walk; choose one"),
        ("a/wlak", "did you mean 'a/walk'"),
        ("RUN", "did you mean 'run'"),
        ("xyzzy", "there are: a/run, a/walk, b/copy, b/jump.v2, b/walk"),
    ],
)
def test_a_near_miss_is_suggested(archive: Path, name: str, said: str) -> None:
    with mcz.open(archive) as file, pytest.raises(OptionError) as raised:
        file.only_clip(name)
    assert said in str(raised.value)


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
        assert run(*arguments) == 0, capsys.readouterr().err
    assert mcz.read(archive, clip="run").name == "a/run"
    assert mcz.read(f"{out}2.mcz", clip="run").name == "a/run"


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Iterator[mcz.Clip]:
    path = tmp_path_factory.mktemp("clip") / "a.mcz"
    mcz.write(smooth(40), path)
    with mcz.open(path) as file:
        yield file.only_clip()


ROWS = st.one_of(
    st.integers(-45, 45),
    st.slices(40),
    st.lists(st.integers(-41, 40), max_size=4),
    arrays(
        np.int8, array_shapes(min_dims=0, max_dims=2, max_side=3), elements=st.integers(-41, 40)
    ),
    arrays(np.uint64, 2, elements=st.integers(0, 39)),
    arrays(np.bool_, st.sampled_from([40, 39, (40, 10)])),
    st.sampled_from([..., None, True, np.True_, 1.0, "root", [1.5], [], np.array(3), {1}, 10**30]),
    st.just([[1], [2, 3]]),
)
COLUMNS = st.one_of(
    st.integers(-10, 9), st.slices(10), st.lists(st.integers(-10, 9), min_size=1, max_size=3),
    arrays(np.bool_, 10), st.sampled_from([..., None]),
)  # fmt: skip


@given(
    st.tuples(ROWS) | st.tuples(ROWS, COLUMNS) | st.tuples(ROWS, COLUMNS, COLUMNS), st.booleans()
)
def test_values_are_an_array_for_any_index(clip: mcz.Clip, key: Any, single: bool) -> None:
    key = key[0] if single and len(key) == 1 else key
    try:
        expected = clip.read()[key]
    except (IndexError, ValueError, TypeError):
        with pytest.raises((IndexError, ValueError, TypeError)):
            clip.values[key]
    else:
        found = clip.values[key]
        assert np.shape(found) == np.shape(expected)
        np.testing.assert_array_equal(found, expected)


@given(st.slices(60))
def test_a_part_of_a_motion_is_that_of_its_clip(samples: Path, frames: slice) -> None:
    for name in ("walk.bvh", "walk.c3d", "walk.amc"):
        motion = mcz.read(samples / name)[:60]
        target = io.BytesIO()
        mcz.write(motion, target)
        with mcz.open(target.getvalue()) as file:
            clip = file.only_clip()
            assert len(clip) == len(motion) == 60 and clip.shape == motion.shape and motion and clip
            start, stop, step = frames.indices(60)
            if step != 1:
                with pytest.raises(mcz.OptionError, match="has a step"):
                    motion[frames]
                return
            part, other = motion[frames], clip.motion((start, max(start, stop)))
            assert part.n_frames == other.n_frames == len(range(start, stop))
            for one, two in zip(part.signals, other.signals, strict=True):
                np.testing.assert_array_equal(one.values, two.values)
            np.testing.assert_array_equal(numbers_of(part), numbers_of(other))
            written = io.BytesIO()
            mcz.write(part, written)
            with mcz.open(written.getvalue()) as again:
                assert not mcz.verify(written.getvalue())
                expected = clip.source_bytes((start, max(start, stop)))
                assert again.only_clip().source_bytes() == expected


def numbers_of(motion: mcz.Motion) -> np.ndarray:
    return np.arange(1, len(motion) + 1) if motion.frame_numbers is None else motion.frame_numbers


@pytest.mark.parametrize("key", [3, "a", (1, 2), None, slice("a", None), slice(0, 1.5)], ids=str)
def test_a_motion_is_no_sequence(samples: Path, key: Any) -> None:
    motion = mcz.read(samples / "walk.bvh")
    with pytest.raises(OptionError) as raised:
        motion[key]
    assert isinstance(raised.value, IndexError)
    with pytest.raises(TypeError):
        iter(motion)


def test_clips_are_found_as_files_find_them(samples: Path, tmp_path: Path) -> None:
    for name in ("walk.bvh", "walk.c3d"):
        (tmp_path / "in").mkdir(exist_ok=True)
        (tmp_path / "in" / name).write_bytes((samples / name).read_bytes())
    mcz.pack(tmp_path / "in", tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        assert len(file.clips) == len(file) == 2
        for name in file.clips:
            assert file.clips[name] is file[name]
            assert name in repr(file.clips)
        assert file.clips["walk.bvh"] is file["walk.bvh"] is file.clips.get("walk.bvh")
        assert "walk.bvh" in file.clips and "run" not in file.clips and 3 not in file.clips
        assert file.clips.get("run") is None
        for name in ("run", 3, None):
            for find in (file.clips, file):
                with pytest.raises(KeyError) as raised:
                    find[name]
                assert isinstance(raised.value, mcz.OptionError)
                assert "a.mcz: " in str(raised.value) and not str(raised.value).startswith("'")


def test_one_joint_by_its_name(clip: mcz.Clip, tmp_path: Path) -> None:
    for joint in (clip.skeleton.joints[0].name, 0, np.int64(0)):
        np.testing.assert_array_equal(clip.read(joints=joint), clip.read(joints=[joint]))
    mcz.extract(clip.container.source.name, tmp_path / "b.mcz", joints=clip.skeleton.joints[1].name)
    with pytest.raises(mcz.MotionError, match="no joint 'nobody'"):
        clip.read(joints="nobody")


def test_a_joint_of_nearly_this_name_is_suggested(samples: Path) -> None:
    skeleton = mcz.read(samples / "walk.bvh").skeleton
    with pytest.raises(
        mcz.MotionError, match=r"no joint 'hed'; the joints are Hips, .*did you mean 'Head'"
    ):
        skeleton.find("hed")
    many = replace(skeleton, joints=tuple(mcz.Joint(f"j{n}") for n in range(500)))
    with pytest.raises(
        mcz.MotionError, match=r"the joints are j0, .*j39 \.\.\. \(500 in all\)"
    ) as raised:
        many.find("xyz")
    assert len(str(raised.value)) < 400


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
        np.zeros((600, n_channels)),
        (Grid(GridKind.FIXED, 4),) * n_channels,
        mask=np.zeros((600, n_channels), bool),
        exceptions=exceptions,
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
