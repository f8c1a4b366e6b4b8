"""Opening, reading in part, writing: the public faces on small motions."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import mcz
from mcz import Signal
from mcz.container.model_records import canonical
from mcz.container.scan import scan
from mcz.files.reading.faults import validate
from mcz.files.reading.report import info
from mcz.files.writing.atomic import METADATA_KEYS
from mcz.model.extras import annex_bytes
from mcz.model.numbers import Grid, GridKind
from tests.motions import motions, skeleton, smooth, write_bytes


@given(motions())
def test_any_motion_comes_back(motion: mcz.Motion) -> None:
    with mcz.open(write_bytes(motion)) as file:
        back = file.clips[motion.name].motion()
    assert back.skeleton == motion.skeleton
    assert (back.name, back.frame_rate) == (motion.name, motion.frame_rate)
    assert len(back.signals) == len(motion.signals)
    for one, other in zip(motion.signals, back.signals, strict=True):
        assert one.values.dtype == other.values.dtype
        assert canonical(one.values) == canonical(other.values)
        assert (one.grids, one.channels) == (other.grids, other.channels)
        all_valid = np.ones(one.values.shape, bool)
        left = all_valid if one.mask is None else one.mask
        np.testing.assert_array_equal(left, all_valid if other.mask is None else other.mask)


def test_joints_by_name_and_index() -> None:
    motion = smooth(20)
    with mcz.open(write_bytes(motion)) as file:
        clip = file.clips["smooth"]
        np.testing.assert_array_equal(clip.read(joints=["knee"]), motion.values[:, 9:])
        np.testing.assert_array_equal(
            clip.read((5, 6), joints=[3, "spine"]), motion.values[5:6, [9, 6, 7, 8]]
        )
        assert clip.read(joints=["fixed"]).shape == (20, 0)
        with pytest.raises(mcz.MotionError, match="no joint 'elbow'"):
            clip.read(joints=["elbow"])


@pytest.mark.parametrize("frames", [(-1, 3), (3, 2), (0, 21)])
def test_range_outside_the_clip(frames: tuple[int, int]) -> None:
    with mcz.open(write_bytes(smooth(20))) as file, pytest.raises(mcz.OptionError):
        file.clips["smooth"].read(frames)


def test_values_off_their_grid_become_exceptions() -> None:
    motion = smooth(10)
    values = motion.values.copy()
    values[4, 1], values[5, 9] = 1 / 3, np.nan
    with mcz.open(write_bytes(motion.with_values(values))) as file:
        clip = file.clips["smooth"]
        np.testing.assert_array_equal(clip.read(), values)
        np.testing.assert_array_equal(clip.read((5, 7), ["knee"]), values[5:7, 9:])
        assert info(file)["clips"][0]["n_exceptions"] == 2


def test_values_off_a_binary_grid_are_refused() -> None:
    signal = Signal(np.full((2, 10), 1 / 3), (Grid(GridKind.BINARY32),) * 10)
    with pytest.raises(mcz.MotionError, match="row 0 of a segment, channel 0"):
        write_bytes(replace(smooth(2), signals=(signal,)))


def test_grid_changes_begin_a_segment() -> None:
    motion = smooth(20)
    values = motion.values.copy()
    values[8:] = np.round(values[8:], 1)
    changes = tuple((8, c, Grid(GridKind.FIXED, 1)) for c in range(10))
    signal = replace(motion.signals[0], values=values, grid_changes=changes)
    with mcz.open(write_bytes(replace(motion, signals=(signal,)))) as file:
        clip = file.clips["smooth"]
        assert [row.header.first for row in clip.signals[0].rows] == [0, 8]
        np.testing.assert_array_equal(clip.read(), values)
        np.testing.assert_array_equal(clip.read((7, 9), ["spine"]), values[7:9, 6:9])
        assert clip.motion().signals[0].grid_changes == changes


@pytest.mark.parametrize(
    "numbers", [[1, 2, 2, 3], [4, 3, 2, 1], [1, 2, 3, 2**52], [-(2**52), 1, 2, 3]]
)
def test_bad_frame_numbers(numbers: list[int]) -> None:
    with pytest.raises(mcz.MotionError, match="frame number"):
        replace(smooth(4), frame_numbers=np.array(numbers))


def test_usual_frame_numbers_cost_nothing() -> None:
    assert write_bytes(replace(smooth(8), frame_numbers=np.arange(1, 9))) == write_bytes(smooth(8))


def test_output_limit() -> None:
    with mcz.open(write_bytes(smooth(100)), max_decoded=1000) as file:
        with pytest.raises(mcz.LimitError, match="limit of 1000"):
            file.clips["smooth"].read()
        assert file.clips["smooth"].read((0, 12)).shape == (12, 10)


def test_limits_of_the_profile() -> None:
    joints = tuple(mcz.Joint(f"j{i}", channels=(mcz.Channel("rx"),)) for i in range(4097))
    bones = mcz.Skeleton(joints)
    motion = mcz.Motion(bones, (Signal(np.zeros((1, 4097))),))
    with pytest.raises(mcz.LimitError, match="joints: 4097"):
        write_bytes(motion)
    with mcz.open(write_bytes(motion, profile="large")) as file:
        assert file.header["profile"] == "large"
        assert file.clips["motion"].read().shape == (1, 4097)


def test_a_small_file_is_for_embedded_readers(tmp_path: Path) -> None:
    """Its chunks and segments are short, nothing is packed; what does not fit is refused."""
    motion, path = smooth(3000), tmp_path / "small.mcz"
    mcz.write(motion, path, profile="small", copies=True)
    with mcz.open(path) as file:
        assert file.header["profile"] == "small"
        assert validate(file) == []
        clip = file.clips[motion.name]
        np.testing.assert_array_equal(clip.values[:], motion.signals[0].values)
        assert clip.values.ndim == motion.signals[0].values.ndim
        container = file.container
        chunks = scan(container.source).chunks
        assert max(chunk.length or 0 for chunk in chunks) <= 64 * 1024
        rows = container.directory.clips[clip.name].segments
        assert len(rows) > 1
        assert all(row.header.n_frames <= 1024 for row in rows)
        assert not {chunk.type for chunk in chunks} & {b"INDX", b"COPY", b"MODL"}
    for codec in ("best", "mrdwt"):
        with pytest.raises(mcz.LimitError, match="small allows only codecs raw and fast"):
            mcz.write(motion, path, codec, force=True, profile="small")
    with pytest.raises(mcz.OptionError, match="is not small, base or large"):
        mcz.write(motion, path, profile="tiny", force=True)
    joints = tuple(mcz.Joint(f"j{i}", channels=(mcz.Channel("rx"),)) for i in range(257))
    bones = mcz.Skeleton(joints)
    wide = mcz.Motion(bones, (Signal(np.zeros((1, 257))),))
    with pytest.raises(mcz.LimitError, match="limit of 256"):
        mcz.write(wide, path, profile="small", force=True)


def test_unit_and_rate_are_taken_not_guessed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    mcz.write(replace(smooth(3), frame_rate=None), path)
    assert mcz.read(path).frame_rate is None
    motion = mcz.read(path, rate=59.94, unit="m")
    assert float(motion.frame_rate or 0) == 59.94
    assert motion.skeleton.unit_cm == 100
    for arguments in ({"rate": 0}, {"rate": "fast"}, {"rate": float("inf")}, {"unit": "ell"}):
        with pytest.raises(mcz.OptionError):
            mcz.read(path, **arguments)


def test_skeleton_comes_back_to_the_bit() -> None:
    motion = mcz.Motion(skeleton(), (Signal(np.zeros((0, 10))),), frame_rate=Fraction(30000, 1001))
    with mcz.open(write_bytes(motion)) as file:
        back = file.clips["motion"].motion()
    assert repr(back.skeleton.joints[0].offset) == "(0.0, 1.0, -0.0)"
    assert back.frame_rate == Fraction(30000, 1001)


def test_reading_a_closed_file() -> None:
    file = mcz.open(write_bytes(smooth(20)))
    clip = file.clips["smooth"]
    file.close()
    with pytest.raises(mcz.OptionError, match="closed"):
        clip.read()


@pytest.mark.parametrize("key", ["weather", "", "Subject", "X-a", "x"])
def test_metadata_that_nobody_registered_are_refused(key: str, tmp_path: Path) -> None:
    motion = smooth(3, metadata={"subject": "7", key: "fair"})
    with pytest.raises(mcz.MotionError) as raised:
        mcz.write(motion, tmp_path / "a.mcz")
    message = str(raised.value)
    assert repr(key) in message and "rights, credit" in message and "begin with 'x-'" in message
    assert not (tmp_path / "a.mcz").exists()
    with pytest.raises(mcz.MotionError, match="is not registered"):
        mcz.LiveWriter(io.BytesIO(), motion.skeleton, "online", metadata={key: "fair"})


def test_metadata_that_are_registered_or_private_are_kept(tmp_path: Path) -> None:
    registered = json.loads(annex_bytes("registry.json"))["metadata_keys"]
    assert [row["key"] for row in registered] == list(METADATA_KEYS)
    keys = [*METADATA_KEYS[1:], "x-", "x-weather"]
    metadata = {key: f"of {key}" for key in keys}
    mcz.write(smooth(3, metadata=metadata), tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        assert file.only_clip().metadata == metadata
    with pytest.raises(mcz.MotionError, match="must be text to text"):
        mcz.write(smooth(3, metadata={"subject": 7}), tmp_path / "b.mcz")


def test_clips_that_nobody_has_are_let_go() -> None:
    """Dropping a clip drops its cache, so that work on a whole archive stays bounded."""
    from weakref import ref

    from mcz.codecs import codec_by_name
    from mcz.container.writer import Writer
    from mcz.files.reading.clips import KEPT_CLIPS
    from mcz.files.writing.clip_writer import write_clip

    out, motion = io.BytesIO(), smooth(3)
    writer = Writer(out)
    for number in range(KEPT_CLIPS + 9):
        write_clip(writer, replace(motion, name=f"{number}"), codec_by_name("raw"), {})
    writer.finish()
    with mcz.open(out.getvalue()) as file:
        first = file.clips["0"]
        seen = ref(file.clips["1"])
        assert all(clip.n_frames == 3 for clip in file)
        assert first is file.clips["0"]
        assert seen() is None
        np.testing.assert_array_equal(file["1"].read(), motion.values)
