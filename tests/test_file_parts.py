"""``mcz info``: the parts of a file sum to it, and a ratio is of whole files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import mcz
from mcz.container.chunks import read_payload
from mcz.container.scan import scan
from mcz.files.reading.report import info
from tests.commands import run

VECTORS = sorted((Path(mcz.__file__).parents[1] / "conformance/vectors/valid").rglob("*.mcz"))
KINDS = {"skeletons": b"SKEL", "models": b"MODL", "quality": b"QUAL"}
SHARED = (b"SKEL", b"MODL")


def check(target: Path) -> None:
    with mcz.open(target, max_decoded=2**53) as file:
        document = info(file)
        found = scan(file.container.source)
        shared = [chunk for chunk in found.chunks if chunk.type in SHARED]
        payloads = {chunk: read_payload(file.container.source, chunk, 2**40) for chunk in shared}
    parts = document["parts"]
    assert sum(parts.values()) == document["file_bytes"] == target.stat().st_size
    assert min(parts.values()) >= 0, parts
    grown = len(found.feet) > 1  # what a later end replaced is none of these parts
    for part, kind in KINDS.items():
        chunks = [chunk for chunk in found.chunks if chunk.type == kind]
        if kind in SHARED:  # of equal ones the first counts, the others are "other"
            chunks = list({payloads[chunk]: chunk for chunk in chunks}.values())
        size = sum(chunk.size for chunk in chunks)
        assert parts[part] == size or (grown and parts[part] < size), (target, part)


@pytest.mark.parametrize("first", range(4))
def test_parts_sum_to_the_size_of_every_vector(first: int) -> None:
    assert len(VECTORS) > 200
    for target in VECTORS[first::4]:
        check(target)


def test_parts_and_ratio_of_the_samples(
    samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """encode, info and the table that info prints say one ratio: all that is given back / file."""
    for name, sources in {
        "walk.bvh": ["walk.bvh"],
        "walk.amc": ["walk.amc", "walk.asf"],
        "walk.c3d": ["walk.c3d"],
        "walk.asf": ["walk.asf"],
    }.items():
        target = tmp_path / f"{name}.mcz"
        assert run("encode", samples / name, "-o", target) == 0
        encoded = capsys.readouterr().out
        assert run("info", target) == 0
        shown = capsys.readouterr().out
        check(target)
        size = target.stat().st_size
        ratio = sum((samples / source).stat().st_size for source in sources) / size
        assert f"-> {size:,} bytes, {ratio:.2f} : 1" in encoded
        assert f"{ratio:.2f} : 1, the files stored / this file" in shown
        rows = dict(re.findall(r"^  (\w+) +([\d,]+) +[\d.]+ %$", shown, re.M))
        numbers = {part: int(text.replace(",", "")) for part, text in rows.items()}
        assert numbers.pop("file") == sum(numbers.values()) == size


def test_a_small_file_has_no_ratio_without_its_skeleton(
    samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Most bytes of a clip of two frames are its skeleton's, whatever the codec."""
    lines = (samples / "walk.bvh").read_text().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if line.startswith("Frames:"))
    lines[at] = "Frames: 2\n"
    short = tmp_path / "short.bvh"
    short.write_text("".join(lines[: at + 4]))
    assert run("encode", short, "--codec", "lossy", "--unit", "cm") == 0
    capsys.readouterr()
    assert run("info", tmp_path / "short.mcz") == 0
    out = capsys.readouterr().out
    true = short.stat().st_size / (tmp_path / "short.mcz").stat().st_size
    against_files = [float(text) for text in re.findall(r"([\d.]+) : 1, the files", out)]
    assert against_files == [round(true, 2)] and "against source" not in out


def test_a_pack_has_the_ratio_of_all_its_files(samples: Path, tmp_path: Path) -> None:
    target = tmp_path / "all.mcz"
    mcz.pack(samples, target)
    check(target)
    with mcz.open(target) as file:
        found = info(file)["cr_file"]
    assert found == sum(p.stat().st_size for p in samples.iterdir()) / target.stat().st_size
