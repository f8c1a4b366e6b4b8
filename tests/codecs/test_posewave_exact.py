"""Codec posewave: joints that are coded exactly beside the others."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.files.editing.extraction import extract
from mcz.model.motion import Exceptions, Signal
from mcz.model.numbers import Grid, GridKind
from tests.codecs.lossy import Array, amc, bytes_of, encode_file
from tests.motions import smooth

NAME = "posewave"
SPINE = [6, 7, 8]  # columns of ``smooth``; its joints are hips 0 to 5, spine, knee 9
SIX, FOUR = Grid(GridKind.FIXED, 6), Grid(GridKind.FIXED, 4)


def same_bits(one: Array, other: Array) -> bool:
    return bool(
        np.array_equal(*(np.ascontiguousarray(a, "<f8").view(np.int64) for a in (one, other)))
    )


def read(data: bytes, **request: Any) -> Array:
    with mcz.open(data) as file:
        return file.only_clip().read(**request)


@pytest.mark.parametrize("words", ["spine", "knee,hips", "hips,spine,knee", ("spine", "knee")])
def test_exact_joints_come_back_at_every_resolution(words: str) -> None:
    motion = smooth(90)
    data = encode_file(NAME, motion, step=0.5, levels=2, lossless=words)
    names = words.split(",") if isinstance(words, str) else words
    columns = [c for name in names for c in motion.skeleton.columns(motion.skeleton.find(name))]
    for resolution in range(3):
        decoded = read(data, resolution=resolution)
        assert same_bits(decoded[:, columns], motion.values[:, columns])
        others = np.delete(decoded, columns, 1)
        assert not others.size or not same_bits(others, np.delete(motion.values, columns, 1))


@pytest.mark.real
def test_exact_joints_of_a_file_print_as_they_did(data: Path) -> None:
    motion = amc(data, "16_02")
    coded = encode_file(NAME, motion, step=0.05, lossless="lfoot,hands")
    with mcz.open(coded) as file:
        text = file.only_clip().source_bytes()
    source = (data / "cmu/amc/16_02.amc").read_bytes()
    lines = [
        [line.strip() for line in file.split(b"\n") if line.startswith((b"lfoot", b"rhand"))]
        for file in (source, text)
    ]
    assert lines[0] == lines[1] and len(lines[0]) == 2 * motion.n_frames
    assert bytes_of(coded) < 0.5 * bytes_of(encode_file("fast", motion))


def test_grids_exceptions_and_gaps_of_exact_channels() -> None:
    """The grid of a channel changes, values are off theirs, a token is odd, some are invalid."""
    motion = smooth(80)
    values, mask = np.array(motion.values), np.ones((80, 10), bool)
    values[40:, 7] = np.round(values[40:, 7] / 3, 6)
    values[10, 6], values[11, 6], values[12, 8] = 1e-9, -0.0, 2.5
    values[:, 2] += 1e-7  # off the grid, but not exact
    mask[20:30, 8] = mask[5:9, 3] = False
    signal = Signal(
        values,
        (FOUR,) * 10,
        mask=mask,
        grid_changes=((40, 7, SIX),),
        exceptions=Exceptions(np.array([12]), np.array([8]), (b"2.50000000001e0"[:5],)),
    )
    motion = replace(motion, signals=(signal,))
    with mcz.open(encode_file(NAME, motion, step=0.5, lossless="spine")) as file:
        clip = file.only_clip()
        decoded = clip.motion().signals[0]
        assert [row.header.first for row in clip.signals[0].rows] == [0, 40]
        alone = clip.read(joints=["spine"])
    assert same_bits(decoded.values[:, SPINE], values[:, SPINE])
    assert same_bits(alone[mask[:, SPINE]], values[:, SPINE][mask[:, SPINE]])
    assert np.array_equal(decoded.mask, mask)
    assert set(decoded.exceptions.channels.tolist()) == {6, 8}
    assert decoded.grid_changes == ((40, 7, SIX),)


def test_segments_of_exact_joints_are_those_that_fast_has() -> None:
    motion = smooth(5000)
    with mcz.open(
        encode_file(NAME, motion, step=8.0, lossless="knee", segment_frames=5000)
    ) as file:
        clip = file.only_clip()
        assert [row.header.n_frames for row in clip.signals[0].rows] == [4096, 904]
        assert same_bits(clip.read(joints=["knee"]), motion.values[:, 9:])


def test_extract_takes_out_exact_joints_alone() -> None:
    motion, out = smooth(90), io.BytesIO()
    data = encode_file(NAME, motion, step=0.5, levels=2, lossless="spine,knee")
    extract(data, out, joints=["spine"])
    assert same_bits(read(out.getvalue()), motion.values[:, SPINE])
    for joints in (["hips"], ["hips", "knee"]):
        with pytest.raises(
            mcz.OptionError,
            match="joints can be cut out or left out only if they are coded exactly",
        ):
            extract(data, io.BytesIO(), joints=joints)
    out = io.BytesIO()
    extract(data, out, frames=(10, 60), resolution=1)
    assert same_bits(read(out.getvalue()), read(data, resolution=1)[10:60])


@pytest.mark.parametrize(
    "target", [{"max_error_cm": 0.3}, {"mean_error_cm": 0.1}, {"target_bytes": 1500}]
)
def test_targets_and_quality(target: dict[str, Any]) -> None:
    motion = smooth(200)
    with mcz.open(
        encode_file(NAME, motion, lossless="knee", quality="spine=2mm", **target)
    ) as file:
        clip = file.only_clip()
        decoded, quality = clip.motion(), clip.quality
    assert same_bits(decoded.values[:, 9], motion.values[:, 9])
    assert quality["param.lossless"] == "knee" and "target_reached" in quality


@pytest.mark.parametrize("words", ["", "lfoot", "spine,", "fixed", 3])
def test_words_that_mean_nothing(words: object) -> None:
    with pytest.raises(mcz.OptionError, match="lossless"):
        encode_file(NAME, smooth(20), step=0.1, lossless=words)


@pytest.mark.real
def test_commands_name_exact_joints(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "clip.mcz"
    path.write_bytes(encode_file(NAME, amc(data, "16_02"), step=0.5, lossless="rfoot,rtoes"))
    assert run(cli, "mcz", ["info", str(path)]) == 0
    assert "  exact      rfoot, rtoes\n" in capsys.readouterr().out
    assert run(cli, "mcz", ["diff", str(data / "cmu/amc/16_02.amc"), str(path)]) == 0
    output = capsys.readouterr().out
    (line,) = [line for line in output.split("\n") if "equal in every bit" in line]
    assert "rfoot, rtoes" in line and "lfoot" not in line
