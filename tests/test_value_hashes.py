"""Comparing the hash of the values, by readers and writers; known answers of the codecs."""

from __future__ import annotations

import dataclasses
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.codecs import CODECS, codec_by_name, known_answers
from mcz.errors import ChecksumError, UnsupportedError
from tests.codecs.cases import CASES
from tests.commands import run
from tests.motions import smooth
from tools import known_answers as maker
from tools.vectors.engine.edits import edit_file

WRONG = 'CEND.value_sha256.0 = "vvvvvvvvvvvvvvvvvvvvvvvvvvvvvvvv"'
OPTIONAL = {"raw", "fast"}
NAMES = sorted(CODECS)


def wrong_hash_file(codec: str) -> bytes:
    """A clip whose hash is that of other values."""
    out, case = BytesIO(), CASES[codec]
    mcz.write(smooth(12), out, codec, **case.params)
    return edit_file(out.getvalue(), [WRONG])


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_signal_is_compared_unless_the_codec_excuses_it(name: str, tmp_path: Path) -> None:
    path = tmp_path / "clip.mcz"
    path.write_bytes(wrong_hash_file(name))
    for verify in (False, True):
        with mcz.open(path, verify=verify) as file:
            clip = file.only_clip()
            clip.read((0, 5))  # a part has no hash
            if name in OPTIONAL and not verify:
                assert len(clip.read()) == 12
                assert mcz.read(path).n_frames == 12
                continue
            with pytest.raises(ChecksumError, match="the hash of the values is"):
                clip.read()
            with pytest.raises(ChecksumError, match="the hash of the values is"):
                mcz.read(path, verify=verify)
    assert [problem.heading for problem in mcz.verify(path)] == ["CEND"]


@pytest.fixture
def wrong(tmp_path: Path, samples: Path) -> Path:
    """A clip of a BVH whose hash is that of other values; its source is right."""
    path = tmp_path / "walk.mcz"
    mcz.encode(samples / "walk.bvh", path)
    path.write_bytes(edit_file(path.read_bytes(), [WRONG]))
    return path


@pytest.mark.parametrize(
    "words",
    [
        "decode walk.mcz -o out.bvh",
        "decode walk.mcz --to csv -o out.csv",
        "convert walk.mcz out.glb",
        "unpack walk.mcz -o out",
        "export walk.mcz --to npz -o out",
        "replace walk.mcz --joint Head --with head.csv -o out.mcz",
        "verify walk.mcz",
        "info walk.mcz --validate",
    ],
)
def test_no_command_writes_values_that_are_not_those_hashed(
    words: str, wrong: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("decode", "walk.mcz", "--frames", "0:240", "--joints", "Head", "-o", "head.csv") == 0
    assert run(*words.split()) != 0
    assert not [path for path in tmp_path.rglob("out*") if path.is_file()]


def test_a_repaired_file_has_no_clip_of_other_values(wrong: Path, tmp_path: Path) -> None:
    report = mcz.repair(wrong, tmp_path / "repaired.mcz")
    assert report.clips == [] and "the hash of the values is" in " ".join(report.lost)
    assert mcz.verify(tmp_path / "repaired.mcz") == []


def test_a_faulty_encoder_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """It changes one bit of one segment, after all else was made."""
    raw = codec_by_name("raw")

    def encode(source, params):  # type: ignore[no-untyped-def]
        good = raw.encode(source, params)

        def segments():  # type: ignore[no-untyped-def]
            for segment in good.segments:
                streams = list(segment.streams)
                streams[0] = bytes([streams[0][0] ^ 1]) + streams[0][1:]
                yield dataclasses.replace(segment, streams=tuple(streams))

        return dataclasses.replace(good, segments=segments())

    faulty = dataclasses.replace(raw, id=250, name="faulty", encode=encode)
    monkeypatch.setitem(CODECS, "faulty", faulty)
    out = BytesIO()
    with pytest.raises(ChecksumError, match="does not decode to the values that it encoded"):
        mcz.write(smooth(12), out, "faulty")


@pytest.mark.parametrize("name", NAMES)
def test_the_first_decode_runs_a_known_answer(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A decoder that is off by the last bit of one value is not used."""
    assert name in known_answers.known_answers()
    data, codec = BytesIO(), codec_by_name(name)
    mcz.write(smooth(12), data, name, **CASES[name].params)

    def off(*arguments):  # type: ignore[no-untyped-def]
        found = codec.decode(*arguments).copy()
        found.view(np.int64)[-1:, -1:] ^= 1
        return found

    monkeypatch.setattr(known_answers, "_proved", set())
    monkeypatch.setitem(CODECS, name, dataclasses.replace(codec, decode=off, earlier={}))
    with (
        mcz.open(data.getvalue()) as file,
        pytest.raises(
            UnsupportedError, match="MCZ_LOOPS=interpreted decodes without compiled code"
        ),
    ):
        file.only_clip().read((0, 1))


def test_known_answers_are_what_the_encoders_make() -> None:
    assert maker.TABLE.read_text("utf-8") == maker.table()
