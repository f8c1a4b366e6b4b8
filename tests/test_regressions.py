"""Faults that were found once, each with the smallest motion or file that shows it."""

from __future__ import annotations

import errno
import io
import os
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
import mcz.sources.restore as restore_module
from mcz import Signal
from mcz.cli.figures import figure_lines
from mcz.cli.info_lines import _tree
from mcz.codecs import codec_by_name
from mcz.codecs.transforms import wavelets
from mcz.container import scanner
from mcz.container.chunks import build_header
from mcz.container.writer import Writer
from mcz.files.writing.atomic import replacing
from mcz.files.writing.clip_writer import write_clip
from mcz.model.numbers import Grid, GridKind
from mcz.sources import FORMATS
from mcz.sources.c3d import c3d
from mcz.sources.restore import PrintedCells
from mcz.sources.sample import marker_walk, write_samples
from mcz.sources.text.hierarchy import write_hierarchy
from mcz.sources.text.layout import MAX_RUNS, FrameLayout, Pattern, Run
from tests.clocked_files import bvh
from tests.commands import run
from tests.motions import smooth, write_bytes

BVH = bvh("1.25", "1.23456789e-01", "2.50")


def test_exceptions_do_not_outlive_their_values(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(BVH)
    motion = mcz.read(path)
    assert len(motion.signals[0].exceptions) == 1
    changed = motion.with_values(motion.values + 1)
    with mcz.open(write_bytes(changed)) as file:
        np.testing.assert_array_equal(file.clips["a"].read(), motion.values + 1)


def test_salvage_of_integers() -> None:
    bones = mcz.Skeleton((mcz.Joint("m", channels=(mcz.Channel("", "count"),)),))
    signal = Signal(np.arange(40).reshape(40, 1))
    data = bytearray(write_bytes(mcz.Motion(bones, (signal,)), codec="raw", segment_frames=10))
    with mcz.open(bytes(data), salvage=True) as file:
        assert file.clips["motion"].motion().signals[0].values.tolist() == signal.values.tolist()
    with mcz.open(bytes(data)) as file:
        data[file.clips["motion"].signals[0].rows[2].stop - 1] ^= 1
    with mcz.open(bytes(data), salvage=True) as file:
        values, mask = file.clips["motion"].read_masked()
    assert mask is not None
    assert np.flatnonzero(~mask[:, 0]).tolist() == list(range(20, 30))
    assert values[mask].tolist() == [*range(20), *range(30, 40)]


def test_templates_keep_their_limit() -> None:
    with pytest.raises(mcz.LimitError, match="template"):
        Writer(io.BytesIO()).template(3, bytes(2**26 + 1))


def test_reserved_metadata() -> None:
    with pytest.raises(mcz.MotionError, match="frame-numbers"):
        write_bytes(smooth(3, metadata={"frame-numbers": "zzz"}))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("one", "two"):
        (tmp_path / f"{name}.bvh").write_text(
            BVH.replace("2.50", f"{len(name)}.5{name == 'two':d}")
        )
    return tmp_path


def test_failed_append_keeps_even_what_was_cut_off(folder: Path) -> None:
    path = folder / "a.mcz"
    mcz.encode(folder / "one.bvh", path)
    mcz.append([folder / "two.bvh"], path)
    path.write_bytes(path.read_bytes()[:-40])
    before = path.read_bytes()
    with pytest.raises(mcz.SourceError):
        mcz.append([folder / "none.bvh"], path, force=True)
    assert path.read_bytes() == before
    with mcz.open(path, salvage=True) as file:
        assert list(file.clips) == ["one", "two"]


def test_unpack_never_overwrites_one_member_by_another(folder: Path) -> None:
    with (folder / "a.mcz").open("wb") as stream:
        writer = Writer(stream)
        for name in ("one", "two"):
            motion = mcz.read(folder / f"{name}.bvh")
            assert motion.source is not None
            same = replace(motion, source=replace(motion.source, path="one.bvh"))
            write_clip(writer, same, codec_by_name("raw"), {})
        writer.finish()
    report = mcz.unpack(folder / "a.mcz", folder / "out", force=True)
    assert [outcome.result for outcome in report.outcomes] == ["restored", "failed"]
    assert (folder / "out/one.bvh").read_bytes() == (folder / "one.bvh").read_bytes()


def test_unpack_goes_on_behind_a_file_in_the_way(tmp_path: Path) -> None:
    with (tmp_path / "a.mcz").open("wb") as stream:
        writer = Writer(stream)
        for name in ("a", "a/b", "c"):
            writer.attachment(name, name.encode())
        writer.finish()
    report = mcz.unpack(tmp_path / "a.mcz", tmp_path / "out")
    assert [outcome.result for outcome in report.outcomes] == ["restored", "failed", "restored"]


@pytest.mark.parametrize("target", ["foo://x", None, 5])
def test_odd_targets(target: object) -> None:
    with pytest.raises(mcz.OptionError):
        mcz.open(target)


def test_writing_onto_a_folder(tmp_path: Path) -> None:
    with pytest.raises(mcz.OptionError):
        mcz.write(smooth(3), tmp_path, force=True)
    assert list(tmp_path.parent.glob("*.part")) == []


def test_names_with_colons(tmp_path: Path) -> None:
    mcz.write(smooth(3), tmp_path / "a::b.mcz")
    assert mcz.read(tmp_path / "a::b.mcz").n_frames == 3


def test_a_base_in_another_file_is_forgotten() -> None:
    motion = smooth(3)
    bones = replace(motion.skeleton, base=b"a" * 16)
    assert mcz.verify(write_bytes(replace(motion, skeleton=bones))) == []


@pytest.mark.parametrize("through", ["walk.mcz", "walk.amc", "clip"])
def test_a_skeletons_own_file_survives(tmp_path: Path, through: str) -> None:
    write_samples(tmp_path)
    mcz.encode(tmp_path / "walk.amc", tmp_path / "walk.mcz")
    if through == "clip":
        with mcz.open(tmp_path / "walk.mcz") as file:
            motion = file.clips["walk"].motion()
    else:
        motion = mcz.read(tmp_path / through)
    mcz.write(motion, tmp_path / "again.mcz")
    assert mcz.verify(tmp_path / "again.mcz") == []
    assert not mcz.unpack(tmp_path / "again.mcz", tmp_path / "out").failures
    for name in ("walk.amc", "walk.asf"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / name).read_bytes()


def test_joints_by_numpy_numbers() -> None:
    motion = smooth(3)
    with mcz.open(write_bytes(motion)) as file:
        clip = file.clips["smooth"]
        wanted = clip.read(joints=[1, 0])
        np.testing.assert_array_equal(clip.read(joints=np.array([1, 0])), wanted)
        with pytest.raises(mcz.MotionError, match="no joint"):
            clip.read(joints=[5000 * "9"])


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        (120, Fraction(120)),
        (29.97, Fraction(29.97).limit_denominator(2**52)),
        (np.float32(0.5), Fraction(1, 2)),
        (np.int64(60), Fraction(60)),
    ],
)
def test_rates_of_other_kinds(rate: object, expected: Fraction) -> None:
    motion = replace(smooth(3), frame_rate=rate)
    assert motion.frame_rate == expected
    with mcz.open(write_bytes(motion)) as file:
        assert file.clips["smooth"].frame_rate == expected


@pytest.mark.parametrize("rate", [0, -1.5, float("nan"), float("inf"), "fast", [], 1e-300])
def test_rates_that_are_none(rate: object) -> None:
    with pytest.raises(mcz.MotionError, match="frame rate"):
        replace(smooth(3), frame_rate=rate)


def test_runs_are_limited_when_written() -> None:
    runs = tuple(Run(b" ", column) for column in range(MAX_RUNS + 1))
    with pytest.raises(mcz.LimitError, match="runs"):
        FrameLayout((b"",), (Pattern(runs, b"\n"),)).build()


def test_salvage_gives_up_where_everything_looks_like_a_chunk() -> None:
    data = bytearray(write_bytes(smooth(3)))
    false = b"".join(build_header(b"DATA", 0, 16 * left - 20) for left in range(20_000, 1, -1))
    false += bytes(16)
    with mcz.open(bytes(data) + b"\0" + false, salvage=True) as file:
        assert list(file.clips) == ["smooth"]
        assert "false starts of a chunk" in file.damage[-1]


def test_equal_numbers_are_printed_once() -> None:
    signal = Signal(np.full((50_000, 3), 1 / 3), (Grid(GridKind.TEXT64),) * 3)
    cells = PrintedCells(signal, None)
    assert len(cells.texts()) < 100
    assert (
        cells.texts()[cells.start[-1, 2] :][: cells.size[-1, 2]].tobytes() == repr(1 / 3).encode()
    )


def test_a_text_keeps_to_the_stated_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.bvh").write_text(BVH)
    motion = mcz.read(tmp_path / "a.bvh")
    assert motion.source is not None
    grids = (Grid(GridKind.FIXED, 15),)
    signal = Signal(np.linspace(1, 2, 400)[:, None], grids)
    monkeypatch.setattr(restore_module, "TEXT_LIMIT", 200)
    source = replace(motion.source, size=100)
    with pytest.raises(mcz.LimitError, match="text of"):
        restore_module.restore(replace(motion, signals=(signal,)), source)


def test_deep_skeletons_are_not_indented_without_end() -> None:
    joints = [mcz.Joint("j0")]
    joints += [mcz.Joint(f"j{n}", n - 1) for n in range(1, 3000)]
    text, order = write_hierarchy(mcz.Skeleton(tuple(joints)))
    assert len(text) < 3000 * 5 * 80
    assert order == list(range(3000))
    parents = [{"name": j.name, "parent": j.parent, "channels": []} for j in joints]
    shown = list(_tree(parents))
    assert len(shown) == 3000
    assert max(map(len, shown)) < 120


@pytest.mark.parametrize("links", [True, False])
def test_what_comes_meanwhile_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    if not links:
        monkeypatch.setattr("os.link", refuse)
    path = tmp_path / "a"
    with pytest.raises(mcz.ExistsError), replacing(path, force=False) as stream:
        stream.write(b"mine")
        path.write_bytes(b"theirs")
    assert path.read_bytes() == b"theirs"
    with replacing(tmp_path / "b", force=False) as stream:
        stream.write(b"mine")
    with replacing(path, force=True) as stream:
        stream.write(b"mine")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a": b"mine", "b": b"mine"}


@pytest.mark.parametrize("target", [None, 5, b"bytes"])
def test_odd_targets_to_write(target: object) -> None:
    with pytest.raises(mcz.OptionError, match="cannot write"):
        mcz.write(smooth(3), target)
    with pytest.raises(mcz.OptionError):
        mcz.write(smooth(3), "a\0b")


@pytest.mark.parametrize("to", ["bvh", "amc", "c3d"])
def test_a_motion_without_frames_is_converted(tmp_path: Path, to: str) -> None:
    write_samples(tmp_path)
    for source in ("walk.amc", "walk.bvh"):
        motion = mcz.read(tmp_path / source)
        empty = replace(motion, signals=tuple(s.cut(0, 0) for s in motion.signals), source=None)
        assert mcz.positions(empty).shape == (0, mcz.positions(motion).shape[1], 3)
        converted = mcz.convert(replace(empty, frame_numbers=None), to, rate=120)
        assert converted.n_frames == 0


def test_reading_many_segments_is_not_quadratic(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = [0]

    def count_range(*args: Any) -> tuple[int, int]:
        counted[0] += 1
        return own_range(*args)

    own_range = wavelets.own_range
    monkeypatch.setattr(wavelets, "own_range", count_range)
    counts = []
    for n_frames in (4096, 16384):
        motion = replace(smooth(2), signals=(Signal(np.zeros((n_frames, 10))),))
        motion = replace(motion, frame_numbers=None)
        with mcz.open(write_bytes(motion, codec="mrdwt", segment_frames=16)) as file:
            counted[0] = 0
            file.clips[motion.name].read()
        counts.append(counted[0])
    assert counts[1] < 5 * counts[0]


@pytest.mark.parametrize("name", ["T_g", "Q", "target_bytes", "mean_error_cm"])
def test_a_truth_is_no_number(name: str) -> None:
    with pytest.raises(mcz.OptionError, match=f"{name} is True; it must be"):
        codec_by_name("mrdwt").options({name: True})


def test_a_full_disk_is_told_of_the_target(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    with (
        pytest.raises(mcz.AccessError, match=r"a\.mcz: File too large"),
        replacing(path, force=False),
    ):
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    assert not list(tmp_path.iterdir())


def test_points_of_other_names_are_noted() -> None:
    motion = smooth(3)
    joints = tuple(replace(joint, name=f"{joint.name}!") for joint in motion.skeleton.joints)
    other = replace(motion, skeleton=replace(motion.skeleton, joints=joints))
    assert not any("other names" in note for note in mcz.compare(motion, motion).notes)
    comparison = mcz.compare(motion, other)
    assert comparison.mean_position_error == 0
    assert any("other names" in note for note in comparison.notes)


def test_extract_and_diff_take_a_limit_of_decoded_bytes(tmp_path: Path) -> None:
    path, out = tmp_path / "a.mcz", tmp_path / "b.mcz"
    path.write_bytes(write_bytes(smooth(100), codec="mrdwt"))
    for limit, code in (("100", 1), ("1M", 0)):
        options = ["--max-decoded", limit]
        assert run("extract", path, out, "--frames", "0:90", *options) == code
        assert run("diff", path, path, *options) == code
        assert out.exists() == (code == 0)


def test_figures_of_a_clip_that_was_cut_are_shown_in_cm() -> None:
    entries = {"uncut_mean_position_error": 2.0, "uncut_mean_position_error_cm": 3.25}
    (line,) = [line for line in figure_lines(entries) if "uncut" in line]
    assert line.split() == ["uncut_mean_position_error", "2", "units", "3.25"]


def test_extract_says_which_clip_lacks_a_joint() -> None:
    with pytest.raises(mcz.MotionError, match="clip 'smooth': no joint 'tail'; the joints are"):
        mcz.extract(write_bytes(smooth(3, name="smooth")), io.BytesIO(), joints=["tail"])


def test_salvage_of_a_c3d_without_frames() -> None:
    """Its points have a mask then, of no rows."""
    motion = marker_walk()
    first = motion.signals[0]
    nothing = replace(first, values=first.values[:0], mask=None)
    data = c3d.write(replace(motion, signals=(nothing,), source=None))
    with mcz.open(write_bytes(c3d.read(data, "none")), salvage=True) as file:
        assert file.only_clip().source_bytes() == data


def test_sorts_of_source_formats_are_those_of_the_registry() -> None:
    assert {f.id for f in FORMATS.values() if f.is_skeleton} == scanner.OF_SKELETONS
    assert {f.id for f in FORMATS.values() if not f.is_skeleton} == scanner.OF_CLIPS


BONES = mcz.Skeleton((mcz.Joint("knee", channels=(mcz.Channel("rx"),)),), angle_unit="deg")


def test_amc_that_arrives_with_zeros_behind_its_first_frame_number() -> None:
    lines = [b":DEGREES\n", b"2\0\0 \n", b"knee 1.5\n", b"3\n", b"knee 2\n"]
    arriving = FORMATS["amc"].arrive(iter(lines), BONES)  # type: ignore[misc]
    assert arriving.first_number == 2
    assert [row.tolist() for _, row in arriving.frames] == [[1.5], [2.0]]


def test_amc_that_arrives_with_nothing_in_its_first_frame() -> None:
    """Later frames have no bones then either, as they would be others in each frame."""
    lines = [b":DEGREES\n", b"1\n", b"2\n", b"knee 2\n"]
    with pytest.raises(mcz.SourceError, match="bone 'knee' is not in the first frame"):
        list(FORMATS["amc"].arrive(iter(lines), BONES).frames)  # type: ignore[misc]
