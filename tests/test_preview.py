"""Previews: frames of a clip without decoding it."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import codecs
from mcz.cli.decode_options import preview_motion
from mcz.errors import OptionError
from mcz.files.reading.signal_info import SignalInfo
from mcz.model.motion import Motion, Signal
from tests import overlap_codec
from tests.commands import run
from tests.motions import skeleton, smooth, write_bytes


@pytest.fixture(autouse=True)
def overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, overlap_codec.CODEC)


@given(st.integers(0, 400), st.integers(1, 90), st.integers(1, 200))
def test_marks_are_what_they_decode_to(n_frames: int, delta: int, length: int) -> None:
    data = write_bytes(smooth(n_frames), "qbc", delta=delta, segment_frames=length)
    with mcz.open(data) as file:
        clip = file.only_clip()
        frames, values = clip.preview()
        whole = clip.read()
    wanted = {*range(0, n_frames, delta)} | ({n_frames - 1} if n_frames else set())
    assert frames.tolist() == sorted(wanted)
    assert np.array_equal(values, whole[frames])


def test_joints_in_their_order() -> None:
    with mcz.open(write_bytes(smooth(300), "qbc", segment_frames=80)) as file:
        clip = file.only_clip()
        frames, values = clip.preview(["knee", "hips"])
        assert np.array_equal(values, clip.read(joints=["knee", "hips"])[frames])


def test_the_coarsest_resolution_where_no_frame_is_exact() -> None:
    for codec, step in (("mrdwt", 16), ("overlap", 2)):
        with mcz.open(write_bytes(smooth(301), codec)) as file:
            clip = file.only_clip()
            frames, values = clip.preview()
            resolution = step.bit_length() - 1
            assert frames.tolist() == list(range(0, 301, step))
            assert np.array_equal(values, clip.read(resolution=resolution, decimate=True))
            assert clip.read_preview().is_regular


def test_one_resolution_has_no_preview() -> None:
    with (
        mcz.open(write_bytes(smooth(30), "fast")) as file,
        pytest.raises(OptionError, match="codec fast stored it at a single resolution"),
    ):
        file.only_clip().preview()


@pytest.mark.parametrize("frames", [(0, 95), (33, 200), (90, 91), (160, 240), (215, 333)])
def test_of_a_clip_that_was_cut(frames: tuple[int, int], tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.mcz", tmp_path / "part.mcz"
    mcz.write(smooth(333), whole, "qbc", segment_frames=80, delta=40)
    mcz.extract(whole, part, frames=frames)
    with mcz.open(part) as file:
        clip = file.only_clip()
        shown, values = clip.preview()
        marks = [*range(0, 333, 40), 332]
        assert shown.tolist() == [m - frames[0] for m in marks if frames[0] <= m < frames[1]]
        assert np.array_equal(values, clip.read()[shown])


def test_of_a_clip_without_its_curves(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.mcz", tmp_path / "part.mcz"
    mcz.write(smooth(333), whole, "qbc", segment_frames=80, delta=40)
    mcz.extract(whole, part, resolution=1)
    with mcz.open(part) as file, mcz.open(whole) as other:
        (a, x), (b, y) = file.only_clip().preview(), other.only_clip().preview()
    assert np.array_equal(a, b)
    assert np.array_equal(x, y)


def test_what_is_invalid_is_nan() -> None:
    motion = smooth(200)
    mask = np.ones(motion.values.shape, bool)
    mask[70:130, 4] = False
    motion = replace(motion, signals=(replace(motion.signals[0], mask=mask),))
    with mcz.open(write_bytes(motion, "qbc", delta=40)) as file:
        clip = file.only_clip()
        frames, values = clip.preview()
        assert np.array_equal(values, clip.read()[frames], equal_nan=True)
        assert np.isnan(values[:, 4]).tolist() == [70 <= f < 130 for f in frames.tolist()]
        assert preview_motion(clip).signals[0].mask is not None


def test_as_a_motion_at_a_lower_rate() -> None:
    motion = smooth(201, metadata={"subject": "x"})
    with mcz.open(write_bytes(motion, "qbc", delta=40)) as file:
        found = preview_motion(file.only_clip())
        assert found.frame_rate == 3
        assert found.frame_numbers.tolist() == [1, 41, 81, 121, 161, 201]
        assert found.metadata == {"subject": "x"} and found.source is None
    with mcz.open(write_bytes(smooth(190), "qbc", delta=40)) as file:
        found = preview_motion(file.only_clip())  # the last frame is nearer: it does not fit a rate
        assert found.frame_numbers.tolist() == [1, 41, 81, 121, 161]
        assert not file.only_clip().read_preview().is_regular
    with mcz.open(write_bytes(smooth(0), "qbc")) as file:
        assert preview_motion(file.only_clip()).n_frames == 0


class Watched(io.BytesIO):
    """Bytes that remember which of them were read."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.seen = np.zeros(len(data), bool)

    def read(self, size: int | None = -1, /) -> bytes:
        start = self.tell()
        decoded = super().read(size)
        self.seen[start : start + len(decoded)] = True
        return decoded


def detail_ranges(file: mcz.File, info: SignalInfo) -> list[slice]:
    """Byte ranges of the streams of all but the coarsest resolution."""
    out = []
    for row in info.rows:
        table = file.container.table(row, info.counts)
        first = table.offsets[table.codec(1, 0)]
        out.append(slice(row.offset + first, row.offset + row.size))
    return out


def long_motion(n_frames: int = 20_000) -> Motion:
    rng = np.random.default_rng(7)
    bumps = rng.normal(size=(n_frames, 10)).cumsum(axis=0) * 0.5
    return Motion(skeleton(), (Signal(bumps),), frame_rate=Fraction(120), name="long")


@pytest.mark.parametrize("codec", ["qbc", "mrdwt"])
def test_details_are_not_read(codec: str) -> None:
    data = write_bytes(long_motion(), codec)
    stream = Watched(data)
    with mcz.open(stream, unverified=True) as file:
        clip = file.only_clip()
        clip.preview()
        assert file.unverified == len(clip.signals[0].rows)
        n_bytes = file.container.source.n_bytes
        seen = stream.seen.copy()
        info = clip.signals[0]
        details = detail_ranges(file, info)
        tables = [file.container.table(row, info.counts) for row in info.rows]
    n_coarse = sum(t.size + sum(t.lengths[: info.counts.n_groups]) for t in tables)
    # A table is read with a few bytes more than it has, as its size is not known before.
    assert sum(int(seen[place].sum()) for place in details) == 0
    assert n_bytes <= n_coarse + 2500 + len(tables) * 64
    assert n_bytes < len(data) / 2


@pytest.fixture
def walk(samples: Path, tmp_path: Path) -> Path:
    target = tmp_path / "walk.mcz"
    mcz.encode(samples / "walk.bvh", target, codec="qbc", params={"delta": 40}, unit="cm")
    return target


def test_command_numbers(walk: Path, tmp_path: Path) -> None:
    with mcz.open(walk) as file:
        frames, values = file.only_clip().preview(joints=[1])
        joint = file.only_clip().skeleton.addresses()[1]
    assert run("decode", walk, "--preview", "--to", "csv", "--joints", joint) == 0
    rows = list(csv.reader(io.StringIO((tmp_path / "walk.csv").read_text("utf-8"))))
    assert [int(row[0]) for row in rows[1:]] == (frames + 1).tolist()
    np.testing.assert_allclose([float(row[1]) for row in rows[1:]], frames / 120, atol=1e-9)
    assert [[float(cell) for cell in row[2:]] for row in rows[1:]] == values.tolist()
    assert run("decode", walk, "--preview", "--to", "npz", "-o", tmp_path / "a.npz") == 0
    with np.load(tmp_path / "a.npz") as held:
        assert held["frame_numbers"].tolist() == (frames + 1).tolist()


@pytest.mark.parametrize("target", ["bvh", "c3d"])
def test_command_converts(walk: Path, tmp_path: Path, target: str) -> None:
    assert run("decode", walk, "--preview", "--to", target, "-o", tmp_path / f"a.{target}") == 0
    decoded = mcz.read(tmp_path / f"a.{target}")
    with mcz.open(walk) as file:
        wanted = preview_motion(file.only_clip())
    assert decoded.n_frames == wanted.n_frames
    assert decoded.frame_rate == pytest.approx(float(wanted.frame_rate or 0), rel=1e-3)


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("--to", "csv", "--frames", "0:3"),
        ("--to", "csv", "--resolution", "1"),
        ("--to", "csv", "--salvage"),
    ],
)
def test_command_refuses(walk: Path, arguments: tuple[str, ...]) -> None:
    assert run("decode", walk, "--preview", *arguments) == 2


def test_command_says_that_there_is_none(
    samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "walk.mcz"
    mcz.encode(samples / "walk.bvh", target)
    assert run("decode", target, "--preview", "--to", "csv") == 2
    assert "stored it at a single resolution, so it has no preview" in capsys.readouterr().err
