"""Every way out of an .mcz: a source of every format is restored, or said to be something else."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import redirect_stdout
from functools import cache
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.sources import FORMATS
from tests.commands import Call

SOURCES = Path(__file__).parents[2] / "conformance" / "vectors" / "valid" / "sources"
CLIPS = [name for name, known in FORMATS.items() if not known.is_skeleton]


@cache
def source_files() -> dict[str, tuple[str, bytes]]:
    """One source file of every clip format, restored from a vector: its name and its bytes."""
    found: dict[str, tuple[str, bytes]] = {}
    for path in sorted(SOURCES.glob("*.mcz")):
        with mcz.open(path) as file:
            for clip in file:
                source = clip.source
                whole = all(info.codec.lossless for info in clip.signals)
                if source is None or not whole or not 3 <= clip.n_frames <= 9:
                    continue
                if clip.n_channels and source.format not in found and "missing" not in path.stem:
                    found[source.format] = source.path, clip.source_bytes()
    found["mot"] = "plain.mot", found["sto"][1]  # the same text; those of vectors have gaps
    return found


@pytest.fixture(params=CLIPS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def source(name: str, tmp_path: Path) -> Iterator[Path]:
    """A source file of the format ``name`` in a folder of its own, with ``a.mcz`` beside that."""
    path, data = source_files()[name]
    (tmp_path / "in").mkdir()
    source = tmp_path / "in" / path
    source.write_bytes(data)
    mcz.encode(source, tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        found = file.only_clip().source
        assert found is not None and found.format == name
    yield source


def result_of(call: Call, *arguments: object) -> tuple[Path, str]:
    """The first output of a decode and the word that JSON has for it, which is printed, too."""
    code, out, err = call("decode", *arguments, "--json")
    assert code == 0, err
    first = json.loads(out)["outputs"][0]
    code, out, _ = call("decode", *arguments, "--force")
    assert code == 0 and out.splitlines()[0].endswith(f" bytes, {first['result']}")
    return Path(first["path"]), first["result"]


def same_format(path: Path, name: str) -> int:
    """The frames of a file that has to be of the format ``name``."""
    found = FORMATS[name]
    given = (None,) if found.wants_skeleton else ()
    motion: mcz.Motion = found.read(path.read_bytes(), "again", *given)
    assert motion.source is not None and motion.source.format == name
    return motion.n_frames


def test_whole(source: Path, tmp_path: Path, call: Call) -> None:
    """Under every name that does not ask for another format, the same bytes."""
    data, suffix = source.read_bytes(), source.suffix
    names = [f"back{suffix}", f"BACK{suffix.upper()}", f"b.c{suffix.title()}", "back", "folder/"]
    for word in names:
        path, result = result_of(call, tmp_path / "a.mcz", "-o", f"{tmp_path}{os.sep}{word}")
        assert (path.read_bytes(), result) == (data, "restored"), word
    path, result = result_of(call, tmp_path / "a.mcz")
    assert path == tmp_path / source.name and path.read_bytes() == data and result == "restored"
    piped = TextIOWrapper(BytesIO())
    with redirect_stdout(piped):
        assert call("decode", tmp_path / "a.mcz", "-o", "-")[0] == 0
    assert piped.buffer.getvalue() == data  # type: ignore[attr-defined]


def test_packed(source: Path, tmp_path: Path, call: Call) -> None:
    data, archive = source.read_bytes(), tmp_path / "p.mcz"
    assert call("pack", source.parent, archive)[0] == 0
    path, result = result_of(call, archive, "-o", tmp_path / f"back{source.suffix}")
    assert (path.read_bytes(), result) == (data, "restored")
    code, out, _ = call("unpack", archive, tmp_path / "out", "--json")
    assert code == 0 and json.loads(out)["files"][0]["result"] == "restored"
    assert (tmp_path / "out" / source.name).read_bytes() == data
    assert call("extract", archive, tmp_path / "e.mcz", "--frames", "0:")[0] == 0
    path, result = result_of(call, tmp_path / "e.mcz", "-o", tmp_path / f"e{source.suffix}")
    assert (path.read_bytes(), result) == (data, "restored")


def test_cut(name: str, source: Path, tmp_path: Path, call: Call) -> None:
    """A cut of a source file has the same format."""
    target = tmp_path / f"back{source.suffix}"
    path, result = result_of(call, tmp_path / "a.mcz", "--frames", "1:3", "-o", target)
    assert (path, result, same_format(path, name)) == (target, "cut", 2)
    path, result = result_of(call, tmp_path / "a.mcz", "--frames", "0:", "-o", f"{tmp_path}/all/")
    assert (path.read_bytes(), result) == (source.read_bytes(), "restored")
    assert call("extract", tmp_path / "a.mcz", tmp_path / "e.mcz", "--frames", "1:3")[0] == 0
    path, result = result_of(call, tmp_path / "e.mcz", "-o", f"{tmp_path}/e{source.suffix}")
    assert (path.read_bytes(), result) == (target.read_bytes(), "cut")
    code, out, _ = call("unpack", tmp_path / "e.mcz", tmp_path / "out", "--json")
    assert code == 0 and json.loads(out)["files"][0]["result"] == "cut"


def test_lossy(name: str, source: Path, tmp_path: Path, call: Call) -> None:
    mcz.encode(source, tmp_path / "l.mcz", codec="dwt")
    path, result = result_of(call, tmp_path / "l.mcz", "-o", tmp_path / f"back{source.suffix}")
    with mcz.open(tmp_path / "l.mcz") as file:
        n_frames = file.only_clip().n_frames
    assert (result, same_format(path, name)) == ("lossy", n_frames)
    code, out, _ = call("unpack", tmp_path / "l.mcz", tmp_path / "out", "--json")
    assert code == 0 and json.loads(out)["files"][0]["result"] == "lossy"


def test_conversions(name: str, source: Path, tmp_path: Path, call: Call) -> None:
    """The suffix of another format, or ``--to``, converts, and says so."""
    suffix = ".npz" if source.suffix == ".csv" else ".csv"
    for words in (["-o", f"{tmp_path}/x{suffix}"], ["--to", suffix[1:], "-o", f"{tmp_path}/to/"]):
        assert result_of(call, tmp_path / "a.mcz", *words)[1] == "converted"
    words = ["--to", suffix[1:], "-o", f"{tmp_path}/x{source.suffix}"]
    path, result = result_of(call, tmp_path / "a.mcz", *words)
    assert result == "converted" and path.read_bytes() != source.read_bytes()


def test_an_unknown_suffix_is_refused(source: Path, tmp_path: Path, call: Call) -> None:
    """Nothing is written under a name that no format has, and the nearest one is named."""
    for word in (f"{source.suffix}d", ".xyzzy", ".mcz", ".asf", ".fbx"):
        code, out, err = call("decode", tmp_path / "a.mcz", "-o", tmp_path / f"x{word}")
        assert (code, out, err.count("\n")) == (2, "", 1) and f" as {word}; " in err
    near = call("decode", tmp_path / "a.mcz", "-o", tmp_path / f"x{source.suffix}d")[2]
    assert f"did you mean {source.suffix}" in near
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("x")] == []


def test_a_name_that_is_no_format_is_kept(tmp_path: Path, call: Call) -> None:
    """The suffix of the source's own name is no other format's, though its content has another."""
    _, data = source_files()["bvh"]
    (tmp_path / "walk.c3d").write_bytes(data)
    assert call("encode", tmp_path / "walk.c3d")[0] == 0
    for word in ("again.c3d", "again.bvh"):
        path, result = result_of(call, tmp_path / "walk.mcz", "-o", tmp_path / word)
        assert (path.read_bytes(), result) == (data, "restored")


def test_what_is_kept_has_its_suffix(samples: Path, tmp_path: Path, call: Call) -> None:
    mcz.encode(samples / "walk.asf", tmp_path / "s.mcz")
    assert "did you mean .asf?" in call("decode", tmp_path / "s.mcz", "-o", tmp_path / "x.asff")[2]
    path, result = result_of(call, tmp_path / "s.mcz", "-o", tmp_path / "x.ASF")
    assert (path.read_bytes(), result) == ((samples / "walk.asf").read_bytes(), "restored")
    (tmp_path / "odd.bvh").write_bytes((samples / "walk.asf").read_bytes())
    assert call("encode", tmp_path / "odd.bvh")[0] == 0
    for word in ("y.asf", "y.bvh"):
        path, result = result_of(call, tmp_path / "odd.mcz", "-o", tmp_path / word)
        assert (path.read_bytes(), result) == ((samples / "walk.asf").read_bytes(), "restored")
    (tmp_path / "notes.txt").write_bytes(b"notes")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "notes.txt").write_bytes(b"notes")
    assert call("pack", tmp_path / "in", tmp_path / "k.mcz", "--keep-all")[0] == 0
    assert call("decode", tmp_path / "k.mcz", "-o", tmp_path / "x.text")[0] == 2
    assert result_of(call, tmp_path / "k.mcz", "-o", tmp_path / "x.txt")[1] == "restored"


def words_of(document: Any) -> set[str]:
    return {output["result"] for output in document["outputs"]}


def test_other_words(samples: Path, tmp_path: Path, call: Call) -> None:
    """Values that were smoothed, coarsened or salvaged are not those of the source."""
    mcz.encode(samples / "walk.bvh", tmp_path / "walk.mcz")
    mcz.encode(samples / "walk.c3d", tmp_path / "m.mcz", codec="mrdwt")
    filtered = ["decode", tmp_path / "m.mcz", "--post-filter", "-o", f"{tmp_path}/f/", "--json"]
    assert words_of(json.loads(call(*filtered)[1])) == {"filtered"}
    coarse = ["decode", tmp_path / "m.mcz", "--resolution", "1", "-o", f"{tmp_path}/r/", "--json"]
    assert words_of(json.loads(call(*coarse)[1])) == {"lossy"}
    data = bytearray((tmp_path / "walk.mcz").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "bad.mcz").write_bytes(data)
    code, out, _ = call(
        "decode", tmp_path / "bad.mcz", "--salvage", "-o", f"{tmp_path}/s/", "--json"
    )
    assert code == 4 and words_of(json.loads(out)) == {"salvaged"}
