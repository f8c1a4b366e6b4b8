"""Damaged files: what is whole in them is told, read, and written as a sound file."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.container.chunks import HEADER


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> bytes:
    """Two lossless clips with an ASF, markers, a lossy clip in segments, and an attachment."""
    folder = tmp_path_factory.mktemp("takes")
    for name in ("walk.asf", "walk.amc", "walk.c3d"):
        (folder / name).write_bytes((samples / name).read_bytes())
    (folder / "copy.c3d").write_bytes((samples / "walk.c3d").read_bytes())
    (folder / "notes.txt").write_bytes(b"taken on a Sunday\n" * 99)
    target = tmp_path_factory.mktemp("archive") / "takes.mcz"
    mcz.pack(folder, target, params={"segment_frames": 60}, keep_all=True, copies=False)
    mcz.append([samples / "walk.bvh"], target, codec="mrdwt", params={"segment_frames": 50})
    return target.read_bytes()


def everything(file: mcz.File) -> dict[str, list[tuple[Any, Any]]]:
    """Values and masks of all signals of all clips."""
    return {
        name: [clip.read_masked(signal=signal.index) for signal in clip.signals]
        for name, clip in file.clips.items()
    }


def check(repaired: bytes, whole: dict[str, list[tuple[Any, Any]]]) -> int:
    """Every value of ``repaired`` is as it was; returns how many frames there are."""
    assert mcz.verify(repaired) == []
    total = 0
    with mcz.open(repaired) as file:
        for name, signals in everything(file).items():
            of, start = (name, 0) if name in whole else origin(name)
            for index, (values, mask) in enumerate(signals):
                before, mask_before = whole[of][index]
                rows = slice(start, start + file.clips[name].n_frames)
                np.testing.assert_array_equal(values, before[rows])
                valid = True if mask is None else mask
                np.testing.assert_array_equal(
                    valid, True if mask_before is None else mask_before[rows]
                )
            total += file.clips[name].n_frames
    return total


def origin(name: str) -> tuple[str, int]:
    """The clip that ``name`` was a run of frames of, and its first frame."""
    of, _, span = name.rpartition(".")
    return of, int(span.partition("-")[0])


def repaired(damaged: bytes, folder: Path) -> tuple[mcz.Repair, bytes]:
    found = mcz.repair(damaged, folder / "out.mcz", force=True)
    return found, (folder / "out.mcz").read_bytes()


def test_any_byte_costs_a_segment_at_most_and_is_named(archive: bytes, tmp_path: Path) -> None:
    with mcz.open(archive) as file:
        whole = everything(file)
        frames = sum(clip.n_frames for clip in file.clips.values())
    chosen = random.Random(7)
    for _ in range(8):
        at = chosen.randrange(60, len(archive))
        damaged = (
            archive[:at] + bytes((archive[at] ^ 1 << chosen.randrange(8),)) + archive[at + 1 :]
        )
        found, data = repaired(damaged, tmp_path)
        assert found.damage
        kept = check(data, whole)
        assert kept == frames or found.lost, f"byte {at}"


def test_runs_of_frames_keep_names_numbers_and_sources(
    archive: bytes, samples: Path, tmp_path: Path
) -> None:
    with mcz.open(archive) as file:
        row = file.clips["walk"].signals[0].rows[1]
        assert file.clips["walk"].source is not None
        path = file.clips["walk"].source.path
    damaged = bytearray(archive)
    damaged[row.offset + row.size // 2] ^= 1
    found, data = repaired(bytes(damaged), tmp_path)
    assert found.runs == {"walk": [(0, 60), (120, 240)]}
    assert len(found.lost) == 1
    assert "60 of 240 frames" in found.lost[0]
    with mcz.open(data) as file:
        clip = file.clips["walk.120-240"]
        assert clip.frame_numbers.tolist() == list(range(121, 241))
        assert clip.source is not None
        assert clip.source.path == path.replace("walk", "walk.120-240")
        stored = file.clips["walk.0-60"].source_bytes()
    text = (samples / path).read_bytes()
    assert text.startswith(stored)  # of 60 frames


def test_what_was_lost_with_a_template_is_its_source_alone(archive: bytes, tmp_path: Path) -> None:
    with mcz.open(archive) as file:
        chunks = dict(file.container.directory.shared)
        whole = everything(file)
        frames = sum(clip.n_frames for clip in file.clips.values())
    for (kind, _), chunk in chunks.items():
        if kind == b"SRCE":
            damaged = bytearray(archive)
            damaged[chunk.offset + HEADER.size + 9] ^= 1
            found, data = repaired(bytes(damaged), tmp_path)
            assert check(data, whole) == frames
            assert found.lost


@pytest.mark.parametrize("cut", [0.7, 0.99])
def test_a_file_that_was_cut_short(archive: bytes, tmp_path: Path, cut: float) -> None:
    with mcz.open(archive) as file:
        whole = everything(file)
    found, data = repaired(archive[: int(cut * len(archive))], tmp_path)
    assert check(data, whole) > 100
    assert found.lost


def test_junk_at_the_end_costs_nothing(archive: bytes, tmp_path: Path) -> None:
    found, data = repaired(archive + b"junk" * 5, tmp_path)
    assert found.lost == []
    with mcz.open(data) as file, mcz.open(archive) as before:
        assert list(file.clips) == list(before.clips)
        assert list(file.attachments) == list(before.attachments) == ["notes.txt"]
        assert file.aliases == before.aliases


def test_nothing_whole_is_an_error(archive: bytes, tmp_path: Path) -> None:
    with pytest.raises(mcz.FormatError):
        mcz.repair(archive[:40], tmp_path / "out.mcz")
    assert not (tmp_path / "out.mcz").exists()


def test_the_damaged_file_is_never_overwritten(archive: bytes, tmp_path: Path) -> None:
    path = tmp_path / "takes.mcz"
    path.write_bytes(archive[:-9])
    (tmp_path / "link.mcz").symlink_to(path)
    with pytest.raises(mcz.OptionError, match="not overwritten"):
        mcz.repair(path, tmp_path / "link.mcz", force=True)
    assert path.read_bytes() == archive[:-9]


def test_commands_say_what_is_whole(
    archive: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "takes.mcz", tmp_path / "out"
    path.write_bytes(archive[: int(0.97 * len(archive))])
    asked = {
        "list": ["list", str(path)],
        "info": ["info", str(path)],
        "unpack": ["unpack", str(path), str(out), "--force"],
        "decode": ["decode", str(path), "--clip", "walk", "-o", str(out / "walk"), "--force"],
        "extract": ["extract", str(path), str(out / "x.mcz"), "--clip", "walk", "--force"],
    }
    out.mkdir()
    for name, arguments in asked.items():
        assert run(cli, "mcz", arguments) == 1, name
        assert "--salvage" in capsys.readouterr().err, name
        assert run(cli, "mcz", [*arguments, "--salvage"]) in (0, 4), name
        capsys.readouterr()
    assert run(cli, "mcz", ["repair", str(path), "-o", str(out / "r.mcz"), "--json"]) == 4
    shown = json.loads(capsys.readouterr().out)
    assert shown["clips"]
    assert shown["lost"]
    assert run(cli, "mcz", ["verify", str(out / "r.mcz")]) == 0


def test_unpack_writes_no_damaged_file(archive: bytes, tmp_path: Path) -> None:
    with mcz.open(archive) as file:
        row = file.clips["walk"].signals[0].rows[0]
        assert file.clips["walk"].source is not None
        path = file.clips["walk"].source.path
    damaged = bytearray(archive)
    damaged[row.offset + 40] ^= 1
    (tmp_path / "d.mcz").write_bytes(damaged)
    report = mcz.unpack(tmp_path / "d.mcz", tmp_path / "out", salvage=True)
    assert {o.path for o in report.outcomes if o.result == "damaged"} == {path}
    whole = report.count("restored") + report.count("lossy")
    assert whole == len(report.outcomes) - 1
    assert not (tmp_path / "out" / path).exists()
