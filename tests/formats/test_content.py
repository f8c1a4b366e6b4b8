"""Formats by content: a file under the suffix of another format is read as what it is, and said."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

import mcz
from mcz import SourceError
from mcz.sources import FORMATS, format_of, likely_formats
from tests.cli.test_ways_out import CLIPS, source_files
from tests.commands import run

SUFFIXES = sorted({suffix for known in FORMATS.values() for suffix in known.suffixes})


@pytest.mark.parametrize(("name", "suffix"), list(product(CLIPS, SUFFIXES)))
def test_content_counts(name: str, suffix: str, tmp_path: Path) -> None:
    """A source of every format under every suffix: its own reader takes it, its bytes come back."""
    _, data = source_files()[name]
    path = tmp_path / f"take{suffix}"
    path.write_bytes(data)
    own = suffix in FORMATS[name].suffixes or {suffix, *FORMATS[name].suffixes} == {".sto", ".mot"}
    if name == "csv" and not own:  # rows of numbers tell nothing: refused, with a hint
        with pytest.raises(mcz.SourceError, match="it looks like .csv"):
            mcz.encode(path, tmp_path / "take.mcz", skeleton="none")
        return
    found = format_of(path, data)
    assert own or found.suffixes == FORMATS[name].suffixes or found.name in ("sto", "mot")
    written = mcz.encode(path, tmp_path / "take.mcz", skeleton="none")
    said = any("but its suffix is" in note for note in written.notes)
    assert said != own, written.notes
    with mcz.open(tmp_path / "take.mcz") as file:
        clip = file.only_clip()
        assert clip.source is not None and clip.source_bytes() == data
        assert own or clip.source.format in (name, "sto")
        assert ("but its suffix is" in clip.metadata.get("source-note", "")) != own


def test_every_way_in(tmp_path: Path, samples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Info, diff, pack, read and skeletons detect a source's format by content."""
    path = tmp_path / "walk.c3d"
    path.write_bytes((samples / "walk.bvh").read_bytes())
    motion = mcz.read(path)
    assert motion.source is not None and motion.source.format == "bvh"
    assert run("info", path) == 0
    assert "its content is BVH, but its suffix is .c3d" in capsys.readouterr().out
    assert run("diff", path, samples / "walk.bvh") == 0
    assert run("pack", tmp_path, tmp_path / "p.mcz") == 0
    assert "its content is BVH, but its suffix is .c3d" in capsys.readouterr().err
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "walk.bvh").write_bytes((samples / "walk.asf").read_bytes())
    assert mcz.read_skeleton(tmp_path / "s" / "walk.bvh").n_joints == 31
    written = mcz.encode(tmp_path / "s" / "walk.bvh", tmp_path / "s.mcz")
    assert written.notes == ("its content is ASF, but its suffix is .bvh",)


def test_an_acclaim_take_by_its_content(tmp_path: Path, samples: Path) -> None:
    """An AMC of another suffix gets the skeleton that is named, and the one beside it."""
    path = tmp_path / "walk.bvh"
    path.write_bytes((samples / "walk.amc").read_bytes())
    mcz.encode(path, tmp_path / "a.mcz", skeleton=samples / "walk.asf", rate=120)
    (tmp_path / "walk.asf").write_bytes((samples / "walk.asf").read_bytes())
    mcz.encode(path, tmp_path / "b.mcz", rate=120)
    for name in ("a.mcz", "b.mcz"):
        with mcz.open(tmp_path / name) as file:
            assert file.only_clip().skeleton.n_joints == 31


@pytest.mark.parametrize(
    "data",
    [
        b'"Pelvis x","Pelvis y"\n1,2\n3,4\n',  # no C3D, though its second byte is a P
        b"1\n2\n3\n",  # no AMC, though a line is a whole number
        b"PathFileType,4\n1,2\n3,4\n",  # no TRC
        b"x,y\n1,2\n3,4\n",
    ],
)
def test_tables_stay_tables(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "t.csv").write_bytes(data)
    assert format_of(tmp_path / "t.csv", data).name == "csv"
    assert mcz.read(tmp_path / "t.csv").n_frames in (2, 3)


def test_content_that_is_no_other_format_is_refused_by_its_suffix(tmp_path: Path) -> None:
    (tmp_path / "t.c3d").write_bytes(b"no motion\n")
    assert likely_formats(b"no motion\n") == ()
    with pytest.raises(mcz.SourceError, match="the file is truncated in its C3D header"):
        mcz.read(tmp_path / "t.c3d")


@pytest.mark.parametrize("name", ["take", "take.dat", "take.c3d.old"])
def test_a_file_without_a_known_suffix_is_refused_with_a_hint(
    tmp_path: Path, samples: Path, name: str
) -> None:
    (tmp_path / name).write_bytes((samples / "walk.bvh").read_bytes())
    with pytest.raises(SourceError, match=r"format has the suffix .*; it looks like .bvh"):
        mcz.encode(tmp_path / name, tmp_path / "a.mcz")
    (tmp_path / name).write_bytes(b"\0\1\2")
    with pytest.raises(SourceError, match=r", .pth$"):
        mcz.read(tmp_path / name)
    with pytest.raises(SourceError, match=r", .pth$"):
        mcz.read(tmp_path / f"no{name}")
