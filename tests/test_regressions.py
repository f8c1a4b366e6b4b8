"""Faults that were found once, each with the smallest motion or file that shows it."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.container.writer import Writer
from mcz.motion import Exceptions, Signal
from mcz.report import validate
from tests.motions import smooth
from tests.repair import with_index_content

BVH = (
    "HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 1 Xrotation\n}\nMOTION\nFrames: 3\n"
    "Frame Time: 0.01\n1.25\n1.23456789e-01\n2.50\n"
)


def written(motion: mcz.Motion, **params: object) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, **params)
    return out.getvalue()


@pytest.mark.parametrize(
    ("codec", "params"), [("lossless", {}), ("raw", {"segment_frames": 10**6})]
)
def test_segments_keep_the_decoded_limit(codec: str, params: dict[str, int]) -> None:
    joints = tuple(mcz.Joint(f"j{n}", channels=(mcz.Channel("rx"),)) for n in range(300))
    motion = mcz.Motion(mcz.Skeleton(joints), (Signal(np.zeros((66_000, 300))),))
    with mcz.open(written(motion, codec=codec, **params), max_decoded=2**40) as file:
        assert len(file.clips["motion"].signals[0].rows) > 1
        assert not file.clips["motion"].read((0, 5)).any()


def test_exceptions_do_not_outlive_their_values(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(BVH)
    motion = mcz.read(path)
    assert len(motion.signals[0].exceptions) == 1
    changed = motion.with_values(motion.values + 1)
    with mcz.open(written(changed)) as file:
        np.testing.assert_array_equal(file.clips["a"].read(), motion.values + 1)


def test_exceptions_that_are_no_numbers_are_not_written() -> None:
    motion = smooth(3)
    odd = Exceptions(np.array([1]), np.array([2]), (b"foo",))
    signal = replace(motion.signals[0], exceptions=odd)
    with mcz.open(written(replace(motion, signals=(signal,)))) as file:
        np.testing.assert_array_equal(file.clips["smooth"].read(), motion.values)


def test_salvage_of_integers() -> None:
    bones = mcz.Skeleton((mcz.Joint("m", channels=(mcz.Channel("", "count"),)),))
    signal = Signal(np.arange(40).reshape(40, 1))
    data = bytearray(written(mcz.Motion(bones, (signal,)), codec="raw", segment_frames=10))
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


@pytest.mark.parametrize("numbers", [[10**17, 5, 6], [-(10**16), 1, 2]])
def test_frame_numbers_of_many_digits(numbers: list[int]) -> None:
    with pytest.raises(mcz.MotionError, match="digits"):
        written(replace(smooth(3), frame_numbers=np.array(numbers)))


def test_reserved_metadata() -> None:
    with pytest.raises(mcz.MotionError, match="frame-numbers"):
        written(smooth(3, metadata={"frame-numbers": "zzz"}))


def test_indexed_attachment_without_parts() -> None:
    out = io.BytesIO()
    writer = Writer(out)
    writer.attachment("note", b"kept")
    writer.finish()

    def without_parts(content: bytes) -> bytes:
        at = content.index(b"\x04note") + 6  # behind name and size: the number of parts
        return content[:at] + b"\0" + content[at + 3 :]

    data = with_index_content(out.getvalue(), without_parts)
    with pytest.raises(mcz.FormatError), mcz.open(data) as file:
        validate(file)


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
        mcz.append([folder / "none.bvh"], path)
    assert path.read_bytes() == before
    with mcz.open(path, salvage=True) as file:
        assert list(file.clips) == ["one", "two"]


def test_append_of_a_folder(folder: Path) -> None:
    mcz.encode(folder / "one.bvh", folder / "a.mcz")
    with pytest.raises(mcz.MczError):
        mcz.append([folder], folder / "a.mcz")


def test_unpack_never_overwrites_one_member_by_another(folder: Path) -> None:
    (folder / "d").mkdir()
    (folder / "d/one.bvh").write_text(BVH)
    mcz.encode(folder / "one.bvh", folder / "a.mcz")
    mcz.append([folder / "d/one.bvh"], folder / "a.mcz")
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


def test_ramps_are_coded() -> None:
    values = np.round(np.arange(200)[:, None] * np.linspace(-2, 2, 10), 4)
    with mcz.open(written(smooth(200).with_values(values))) as file:
        np.testing.assert_array_equal(file.clips["smooth"].read(), values)


def test_changed_and_cut_motions_have_sources_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(BVH)
    motion = mcz.read(path)
    for changed in (motion.with_values(motion.values + 1), None):
        if changed is None:
            with mcz.open(written(motion)) as file:
                changed = file.clips["a"].motion((1, 3))
        data = written(changed)
        assert mcz.verify(data) == []


def test_a_base_in_another_file_is_forgotten() -> None:
    motion = smooth(3)
    bones = replace(motion.skeleton, base=b"a" * 16)
    assert mcz.verify(written(replace(motion, skeleton=bones))) == []


def test_least_int64_is_refused() -> None:
    bones = mcz.Skeleton((mcz.Joint("m", channels=(mcz.Channel("", "n"),)),))
    signal = Signal(np.array([[-(2**63)]], np.int64))
    with pytest.raises(mcz.MotionError, match="beyond"):
        written(mcz.Motion(bones, (signal,)))


def test_unsafe_source_paths_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / "back\\slash.bvh"
    path.write_text(BVH)
    with pytest.raises(mcz.MotionError, match="plain"):
        mcz.encode(path, tmp_path / "a.mcz")
