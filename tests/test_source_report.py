"""Output of info about source files and groups of joints; one fault is reported once."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.files.reading.faults import validate
from mcz.files.reading.report import info, source_info
from mcz.files.reading.sizes import layout
from tests.motions import smooth


@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc", "walk.c3d"])
def test_a_source_is_described_as_its_mcz_would_be(
    samples: Path, tmp_path: Path, name: str
) -> None:
    found = source_info(samples / name)
    mcz.encode(samples / name, tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        meant = info(file)
    (ours,), (theirs,) = found["clips"], meant["clips"]
    for key in set(ours) & set(theirs):
        assert ours[key] == theirs[key], key
    assert {"n_frames", "frame_rate", "source_sha256", "n_exceptions"} <= set(ours) & set(theirs)
    skeleton = next(s for s in meant["skeletons"] if s["id"] == theirs["skeleton"])
    for key in set(found["skeletons"][0]) & set(skeleton):
        assert found["skeletons"][0][key] == skeleton[key], key
    assert found["file_bytes"] == (samples / name).stat().st_size


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("walk.bvh", ["BVH, ", "Hips  tx ty tz", "clip walk: 240 frames at about 120 Hz (2.00 s)"]),
        ("walk.amc", ["AMC, ", "skeleton   walk.asf", "240 frames at an unknown rate"]),
        ("walk.asf", ["ASF, ", "31 joints, 62 channels, 1 unit = 5.64444 cm"]),
        ("walk.c3d", ["C3D, ", "signal     residuals: 34 channels", "invalid    237 values"]),
    ],
)
def test_info_of_a_source(
    samples: Path, name: str, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(cli, "mcz", ["info", str(samples / name)]) == 0
    text = capsys.readouterr().out
    assert all(part in text for part in said), text
    assert run(cli, "mcz", ["info", str(samples / name), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["format"] == name[-3:]
    assert run(cli, "mcz", ["info", str(samples / name), "--validate"]) == 3


def test_info_of_a_bad_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.bvh").write_bytes(b"HIERARCHY\nnothing")
    assert run(cli, "mcz", ["info", str(tmp_path / "a.bvh")]) == 1
    assert f"mcz: {tmp_path / 'a.bvh'}: line 2: " in capsys.readouterr().err
    assert run(cli, "mcz", ["info", str(tmp_path / "none.bvh")]) == 1
    assert "no such file" in capsys.readouterr().err


def test_layout_names_the_joints_of_groups(tmp_path: Path, samples: Path) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz")
    mcz.encode(samples / "walk.bvh", tmp_path / "b.mcz", codec="mrdwt")
    mcz.encode(samples / "walk.c3d", tmp_path / "c.mcz", codec="lsdt-clip")
    texts = []
    for name in "abc":
        with mcz.open(tmp_path / f"{name}.mcz") as file:
            parts = layout(file)
            assert sum(size for _, size, _ in parts) == file.size
            texts.append([text for _, _, text in parts])
    assert "group 0 (Hips)" in texts[0] and "group 4 (LeftFoot)" in texts[0]
    assert "group 0 (Hips.tx), stored resolution 0" in texts[1]
    assert "group 0 (LFHD, LBHD, LSHO, LELB and 30 more)" in texts[2]


@pytest.mark.parametrize("of", ["group 0", "CLIP payload", "SKEL payload"])
def test_validate_names_a_fault_once(tmp_path: Path, of: str) -> None:
    path = tmp_path / "a.mcz"
    mcz.write(smooth(40), path)
    with mcz.open(path) as file:
        at = next(at for at, _, text in layout(file) if text.startswith(of))
    data = bytearray(path.read_bytes())
    data[at + 3] ^= 1
    path.write_bytes(data)
    with mcz.open(path) as file:
        problems = validate(file)
    assert len(problems) == 1
    assert "crc of chunk" in problems[0].message
    assert problems[0].heading == {"group 0": "DATA"}.get(of, of[:4])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--unit", "cm"],
            "error of positions: mean 0.0462925 cm, greatest 0.461326 cm",
        ),
        ([], " units; --unit gives centimeters"),
    ],
)
def test_a_lossy_encode_ends_with_its_error(
    samples: Path,
    tmp_path: Path,
    options: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = ["encode", str(samples / "walk.bvh"), "-o", str(tmp_path / "a.mcz"), *options]
    assert run(cli, "mcz", [*arguments, "--codec", "mrdwt"]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    if options:
        assert last.startswith(f"  {said}") and "point LeftFingers end)" in last
    else:
        assert "units" in last and last.endswith("--unit gives centimeters")
    assert run(cli, "mcz", [*arguments, "--codec", "mrdwt", "--force", "--json"]) == 0
    quality = json.loads(capsys.readouterr().out)["clips"][0]["quality"]
    assert float(quality["max_position_error"]) > 0
    assert "max_position_error_frame" in quality
    assert run(cli, "mcz", [*arguments, "--force"]) == 0
    assert "error of positions" not in capsys.readouterr().out


def test_what_was_reached_is_what_the_file_says(samples: Path, tmp_path: Path) -> None:
    params = {"mean_error_cm": 0.1}
    found = mcz.encode(samples / "walk.amc", tmp_path / "a.mcz", codec="mrdwt", params=params)
    with mcz.open(tmp_path / "a.mcz") as file:
        assert found.clips[0].quality == file.only_clip().quality
    assert mcz.encode(samples / "walk.amc", tmp_path / "b.mcz").clips[0].quality is None
    motion = smooth(40)
    written = mcz.write(motion, tmp_path / "c.mcz", "qbc")
    assert written.clips[0].quality and np.isfinite(float(written.clips[0].quality["mse"]))


@pytest.mark.parametrize("target", ["mean_error_cm=1", "max_error_cm=1"])
def test_an_unknown_unit_names_its_option(
    samples: Path, tmp_path: Path, target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["encode", str(samples / "walk.bvh"), "-o", str(tmp_path / "a.mcz")]
    assert run(cli, "mcz", [*arguments, "--codec", "mrdwt", "--param", target]) == 2
    assert "the length unit is unknown; set the unit (--unit)" in capsys.readouterr().err
    bvh = str(samples / "walk.bvh")
    assert run(cli, "mcz", ["diff", bvh, bvh]) == 0
    text = "the length unit is unknown: no figures in cm; set the unit (--unit)"
    assert text in capsys.readouterr().out
