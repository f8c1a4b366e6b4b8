"""Messages that name the file as the user knows it, the fault, and the way out."""

from __future__ import annotations

import bz2
import gzip
import json
import lzma
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import mcz
from tests.commands import ROOT, run, run_piped


@pytest.fixture
def folder(samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("walk.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    mcz.encode("walk.bvh", "walk.mcz")
    return tmp_path


def errors(capsys: pytest.CaptureFixture[str], code: int, *words: object) -> str:
    """Standard error of a command that ends with ``code``."""
    capsys.readouterr()
    assert run(*words) == code
    return capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [("decode", "-"), ("list", "-"), ("info", "-"), ("diff", "walk.mcz", "-")]
)
def test_standard_input_is_called_by_its_name(folder: Path, words: tuple[str, ...]) -> None:
    code, _, text = run_piped(*words, data=Path("walk.bvh").read_bytes())
    assert code == 1
    assert text == "mcz: standard input: not an MCZ file: it begins with 'HIERARCH'\n"


@pytest.mark.parametrize(
    ("name", "pack"), [("gzip", gzip.compress), ("bzip2", bz2.compress), ("xz", lzma.compress)]
)
def test_a_compressed_file_is_named_as_such(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, pack: Callable[[bytes], bytes]
) -> None:
    remark = f"it is compressed by {name}: decompress it first"
    for file in ("walk.bvh", "walk.mcz"):
        Path(f"{file}.gz").write_bytes(pack(Path(file).read_bytes()))
    Path("packed.bvh").write_bytes(Path("walk.bvh.gz").read_bytes())
    for words in (("encode", "walk.bvh.gz"), ("encode", "packed.bvh"), ("info", "walk.mcz.gz")):
        assert remark in errors(capsys, 1, *words)
    data = Path("walk.bvh.gz").read_bytes()
    _, _, text = run_piped("encode", "-", "-o", "out.mcz", data=data)
    assert remark in text


def test_a_source_with_the_suffix_of_an_archive(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("other.mcz").write_bytes(Path("walk.bvh").read_bytes())
    text = errors(capsys, 1, "encode", "other.mcz")
    assert "other.mcz: its content is BVH, but its suffix is .mcz; rename it to .bvh" in text
    assert "it is an .mcz already" in errors(capsys, 1, "encode", "walk.mcz")


@pytest.mark.parametrize(
    ("content", "fault"), [("", "is empty"), ("\n", "is empty"), ("name,date\n", "has no row")]
)
def test_an_empty_table_of_metadata(
    folder: Path, capsys: pytest.CaptureFixture[str], content: str, fault: str
) -> None:
    Path("table.csv").write_text(content)
    text = errors(capsys, 2, "meta", "walk.mcz", "--from", "table.csv")
    assert f"table.csv: the table {fault}" in text


@pytest.mark.parametrize(
    "words", [("unpack",), ("export", "--to", "npz"), ("split", "--rest", "a")]
)
def test_a_file_in_the_place_of_a_folder(
    folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    before = Path("walk.mcz").read_bytes()
    text = errors(capsys, 1, *words, "walk.mcz", "walk.mcz")
    assert "walk.mcz: it is a file, but a folder is needed" in text
    assert Path("walk.mcz").read_bytes() == before


@pytest.mark.parametrize("joints", ["Hips,Hips", "Hips,0", "Head,Hips,Head"])
def test_a_joint_named_twice(folder: Path, capsys: pytest.CaptureFixture[str], joints: str) -> None:
    for target in ("csv", "npz"):
        text = errors(
            capsys, 2, "decode", "walk.mcz", "--to", target, "--joints", joints, "-o", "o"
        )
        assert "is named twice; name it once" in text and not Path("o").exists()
    assert run("decode", "walk.mcz", "--to", "csv", "--joints", "Hips,Head", "-o", "o.csv") == 0


def test_a_name_of_half_a_million_characters_in_a_plot(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "x" * 500_000
    Path("long.csv").write_text(f"time,{name}\n" + "".join(f"{k / 100},{k}\n" for k in range(50)))
    capsys.readouterr()
    assert run("plot", "long.csv", "-o", "long.svg") == 0
    assert len(capsys.readouterr().out) < 1000
    assert Path("long.svg").stat().st_size < 100_000


NAMED_BY_DATA = ("metadata", "quality", "counts", "joints", "channels", "parameters")


def json_keys(value: object) -> Iterator[str]:
    """The keys of all objects in a document, except those that are names of data."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            if key not in NAMED_BY_DATA:
                yield from json_keys(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from json_keys(inner)


@pytest.mark.parametrize(
    "words",
    [
        ("info", "walk.mcz"),
        ("info", "walk.bvh"),
        ("info", "walk.mcz", "--validate"),
        ("list", "walk.mcz"),
        ("decode", "walk.mcz", "-o", "again.bvh"),
        ("extract", "walk.mcz", "part.mcz", "--frames", "0:50"),
        ("verify", "walk.mcz"),
        ("bag", "walk.mcz", "bag"),
        ("codecs", "raw"),
        ("pack", "walk", "packed.mcz"),
        ("unpack", "walk.mcz", "out"),
        ("diff", "walk.bvh", "walk.mcz"),
        ("sample", "samples"),
    ],
)
def test_the_manual_has_every_key(
    folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    Path("walk").mkdir()
    Path("walk/a.bvh").write_bytes(Path("walk.bvh").read_bytes())
    capsys.readouterr()
    assert run(*words, "--json") == 0
    keys = set(json_keys(json.loads(capsys.readouterr().out)))
    page = (ROOT / "docs/reference/scripts.md").read_text("utf-8")
    ids = ("docs/reference/measures.md", "docs/guides/contacts.md")  # of metrics
    measures = "".join((ROOT / name).read_text("utf-8") for name in ids)
    known = set(re.findall(r"\w+", page + measures))
    assert {key.split(".")[0] for key in keys} <= known
