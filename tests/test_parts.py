"""Parts of a clip are verified like the whole, unless the caller asks for unverified ones."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.codecs import CODECS, codec_by_name
from mcz.sources.sample import bvh_walk
from tests.motions import smooth

N_FLIPS = 12  # of each codec
Read = Callable[[mcz.Clip], NDArray[Any]]


@cache
def encode_walk(codec: str) -> bytes:
    """The walk in several segments."""
    motion, out = bvh_walk(), io.BytesIO()
    skeleton = replace(motion.skeleton, unit_cm=1.0)
    names = {parameter.name for parameter in codec_by_name(codec).parameters}
    sizes = {"segment_frames": 100} if "segment_frames" in names else {}
    mcz.write(replace(motion, skeleton=skeleton), out, codec=codec, **sizes)
    return out.getvalue()


def reads(clip: mcz.Clip) -> Iterator[tuple[str, Read]]:
    """Everything that can be asked for in part, by name."""
    yield "joints", lambda clip: clip.read(joints=[0])
    yield "joints of frames", lambda clip: clip.read((30, 60), joints=[1, 4])
    yield "frames", lambda clip: clip.read((90, 130))
    coarsest = clip.signals[0].counts.n_resolutions - 1
    for resolution in sorted({1, coarsest} if coarsest else ()):
        yield f"resolution {resolution}", lambda clip, k=resolution: clip.read(resolution=k)
        yield "preview", lambda clip: clip.preview()[1]


def places(data: bytes, n: int) -> list[int]:
    """Offsets in DATA chunks, framing included."""
    with mcz.open(data) as file:
        (clip,) = file.clips.values()
        chunks = [row.chunk() for signal in clip.signals for row in signal.rows]
    offsets = [at for chunk in chunks for at in range(chunk.offset, chunk.offset + chunk.size)]
    return random.Random(1).sample(offsets, n)


@pytest.mark.parametrize("codec", CODECS)
def test_a_flipped_byte_is_found_or_does_not_matter(codec: str) -> None:
    data = encode_walk(codec)
    with mcz.open(data) as file:
        (name,) = file.clips
        right = {what: (read, read(file.clips[name])) for what, read in reads(file.clips[name])}
    found = 0
    for at in places(data, N_FLIPS):
        damaged = data[:at] + bytes((data[at] ^ 0x10,)) + data[at + 1 :]
        for what, (read, values) in right.items():
            try:
                with mcz.open(damaged) as file:
                    got = read(file.clips[name])
            except mcz.FormatError:
                found += 1
                continue
            np.testing.assert_array_equal(got, values, err_msg=f"{what}, byte {at}")
    assert found > N_FLIPS


def test_unverified_parts_are_counted() -> None:
    out = io.BytesIO()
    motion = smooth(40)
    mcz.write(motion, out, segment_frames=10)
    knee = motion.values[:, 9:]
    with mcz.open(out.getvalue()) as file:
        np.testing.assert_array_equal(file.clips["smooth"].read(joints=["knee"]), knee)
        assert file.unverified == 0
    with mcz.open(out.getvalue(), unverified=True) as file:
        clip = file.clips["smooth"]
        np.testing.assert_array_equal(clip.read((0, 10)), motion.values[:10])
        assert file.unverified == 0  # of these segments everything is wanted
        np.testing.assert_array_equal(clip.read((0, 20), joints=["knee"]), knee[:20])
        assert file.unverified == 2


def test_the_command_says_what_is_unverified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "walk.mcz").write_bytes(encode_walk("raw"))
    arguments = ["decode", str(tmp_path / "walk.mcz"), "--to", "csv", "--joints", "0", "--force"]
    assert run(cli, "mcz", [*arguments, "--json"]) == 0
    out, err = capsys.readouterr()
    assert (json.loads(out)["unverified_segments"], err) == (0, "")
    assert run(cli, "mcz", [*arguments, "--json", "--unverified"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["unverified_segments"] == 3
    assert err.endswith("walk.mcz: 3 segments read in part, not verified\n")
    assert run(cli, "mcz", [*arguments, "--unverified", "--salvage"]) == 2
