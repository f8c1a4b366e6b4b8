"""Files that grow: one process at a time, a full disk, a writing cut short, equal names."""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.files.editing.appending import append_at_end
from mcz.sources.sample import write_samples
from tests.clocked_files import bvh


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """a.mcz with the clip "one", and sources one, two, three."""
    for n, name in enumerate(("one", "two", "three")):
        (tmp_path / f"{name}.bvh").write_text(bvh(f"{n}.25", "2.5"))
    mcz.encode(tmp_path / "one.bvh", tmp_path / "a.mcz")
    return tmp_path


def results(report: mcz.Report) -> dict[str, str]:
    return {outcome.path: outcome.result for outcome in report.outcomes}


def test_two_appends_at_once(folder: Path) -> None:
    path = folder / "a.mcz"
    before = path.read_bytes()
    with (
        append_at_end(path, salvage=False, force=False) as growth,
        pytest.raises(mcz.AccessError, match="another process is appending"),
    ):
        mcz.append([folder / "two.bvh"], path)
        growth.added.write(b"never")
    assert path.read_bytes() == before
    mcz.append([folder / "two.bvh"], path)
    with mcz.open(path) as file:
        assert list(file.clips) == ["one", "two"]


def test_a_file_replaced_while_it_grows(folder: Path) -> None:
    path = folder / "a.mcz"
    mcz.encode(folder / "two.bvh", folder / "b.mcz")
    wanted = (folder / "b.mcz").read_bytes()
    with (
        pytest.raises(mcz.AccessError, match="another file replaced it"),
        append_at_end(path, salvage=False, force=False) as growth,
    ):
        growth.added.write(b"x")
        (folder / "b.mcz").replace(path)
    assert path.read_bytes() == wanted


def full_after(room: int) -> Callable[..., Any]:
    """An ``open`` whose files take ``room`` bytes in all."""

    class Full(io.FileIO):
        def write(self, data: Any, /) -> int:
            free = room - self.tell()
            if free <= 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return super().write(data[:free])

    return lambda path, mode, buffering: Full(path, mode)


@pytest.mark.parametrize("more", [0, 1, 100])
def test_full_disk(folder: Path, monkeypatch: pytest.MonkeyPatch, more: int) -> None:
    path = folder / "a.mcz"
    before = path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(builtins, "open", full_after(len(before) + more))
        with pytest.raises(OSError, match="No space"):
            mcz.append([str(folder / "two.bvh")], path)
    assert path.read_bytes() == before


@pytest.fixture
def cut(folder: Path) -> Path:
    """a.mcz after "two" was appended and its FOOT lost."""
    mcz.append([folder / "two.bvh"], folder / "a.mcz")
    data = (folder / "a.mcz").read_bytes()
    (folder / "a.mcz").write_bytes(data[:-20])
    return folder


@pytest.mark.parametrize("keep", [True, False])
def test_whole_clips_behind_the_last_foot(cut: Path, keep: bool) -> None:
    path = cut / "a.mcz"
    report = mcz.append([cut / "three.bvh"], path, salvage=keep, force=not keep)
    said = {"three.bvh": "parsed", "two": "salvaged" if keep else "dropped"}
    assert results(report) == said
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        assert list(file.clips) == (["one", "two", "three"] if keep else ["one", "three"])
        for clip in file.clips.values():
            assert clip.source_bytes() == (cut / f"{clip.name}.bvh").read_bytes()


def test_every_cut_can_be_taken_up(folder: Path) -> None:
    """Whatever was cut off: what was whole is kept, or nothing is asked for and nothing lost."""
    path = folder / "a.mcz"
    old = path.stat().st_size
    mcz.append([folder / "two.bvh"], path)
    data = path.read_bytes()
    kept = []
    for size in range(old + 1, len(data)):
        path.write_bytes(data[:size])
        report = mcz.append([folder / "three.bvh"], path, salvage=True)
        assert mcz.verify(path) == []
        kept.append("two" in results(report))
        with mcz.open(path) as file:
            assert list(file.clips) == ["one", *["two"] * kept[-1], "three"]
    assert kept == sorted(kept)
    assert kept[-1]


def test_a_file_without_any_foot(folder: Path) -> None:
    path = folder / "a.mcz"
    path.write_bytes(path.read_bytes()[:-20])
    for force in (False, True):
        with pytest.raises(mcz.TruncatedError):
            mcz.append([folder / "two.bvh"], path, force=force)
    report = mcz.append([folder / "two.bvh"], path, salvage=True)
    assert results(report) == {"two.bvh": "parsed", "one": "salvaged"}
    assert mcz.verify(path) == []


def test_attachments_behind_the_last_foot(folder: Path) -> None:
    path = folder / "a.mcz"
    (folder / "big.c3d").write_bytes(os.urandom(2**20 + 5))
    mcz.append([folder / "big.c3d"], path, verbatim=True)
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    with pytest.raises(mcz.FormatError, match="big.c3d"):
        mcz.append([folder / "two.bvh"], path)
    path.write_bytes(data[: 2**20 + 2000])  # its second part is cut
    assert results(mcz.append([folder / "two.bvh"], path)) == {"two.bvh": "parsed"}
    assert mcz.verify(path) == []


def test_equal_names(folder: Path) -> None:
    path = folder / "a.mcz"
    (folder / "d").mkdir()
    other = folder / "d/one.bvh"
    other.write_text(bvh("9.75", "2.5"))
    before = path.read_bytes()
    with pytest.raises(mcz.SourceError, match=r"already has a source file 'one\.bvh'"):
        mcz.append([other], path)
    with pytest.raises(mcz.SourceError, match="the archive already has a source file"):
        mcz.append([folder / "two.bvh", folder / "d/one.bvh"], path)
    assert path.read_bytes() == before
    assert results(mcz.append([folder / "one.bvh"], path)) == {"one.bvh": "present"}
    assert path.read_bytes() == before
    assert results(mcz.append([other], path, root=folder)) == {"d/one.bvh": "parsed"}
    with pytest.raises(mcz.OptionError, match="is not below"):
        mcz.append([folder / "two.bvh"], path, root=folder / "d")
    assert not mcz.unpack(path, folder / "out").failures
    for name in ("one.bvh", "d/one.bvh"):
        assert (folder / "out" / name).read_bytes() == (folder / name).read_bytes()


def test_skeletons_of_one_name(tmp_path: Path) -> None:
    write_samples(tmp_path)
    (tmp_path / "d").mkdir()
    other = tmp_path / "d/walk.asf"
    other.write_bytes((tmp_path / "walk.asf").read_bytes() + b"# another\n")
    path = tmp_path / "a.mcz"
    mcz.encode(tmp_path / "walk.amc", path)
    with pytest.raises(mcz.SourceError, match=r"source file 'walk\.asf'"):
        mcz.append([other], path)
    assert results(mcz.append([tmp_path / "walk.asf"], path)) == {"walk.asf": "present"}
    mcz.append([other], path, root=tmp_path)
    assert not mcz.unpack(path, tmp_path / "out").failures
    assert (tmp_path / "out/d/walk.asf").read_bytes() == other.read_bytes()


def test_clips_of_one_name(folder: Path) -> None:
    """Clips that were named by hand leave a name for the next."""
    from dataclasses import replace

    path = folder / "b.mcz"
    mcz.write(replace(mcz.read(folder / "one.bvh"), name="two", source=None), path)
    mcz.append([folder / "two.bvh"], path)
    with mcz.open(path) as file:
        assert list(file.clips) == ["two", "two.bvh"]


BAD_NAME = os.fsdecode(b"bad\xff.bvh")


def test_names_that_are_not_utf8(folder: Path) -> None:
    bad = folder / BAD_NAME
    bad.write_text(bvh("7.5", "2.5"))
    with pytest.raises(mcz.MotionError, match=r"bad.*bvh' is not valid UTF-8; rename the file"):
        mcz.encode(bad, folder / "b.mcz")
    with pytest.raises(mcz.SourceError, match="not valid UTF-8"):
        mcz.append([bad], folder / "a.mcz")
    report = mcz.pack(folder, folder / "all.mcz")
    assert [outcome.path for outcome in report.failures] == [BAD_NAME]
    assert results(report)["two.bvh"] == "parsed"
    assert mcz.verify(folder / "all.mcz") == []


def test_names_that_would_not_unpack(folder: Path) -> None:
    """Neither a duplicate nor an attachment gets a name that a reader must refuse."""
    (folder / "back\\slash.bvh").write_text(bvh("0.25", "2.5"))
    (folder / "x\\y.txt").write_text("hello")
    report = mcz.pack(folder, folder / "all.mcz", keep_all=True)
    assert {outcome.path for outcome in report.failures} == {"back\\slash.bvh", "x\\y.txt"}
    assert mcz.verify(folder / "all.mcz") == []


def test_pack_says_what_it_left_out(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "closed").mkdir()
    (folder / "link").symlink_to(folder / "closed")
    (folder / "dead.bvh").symlink_to(folder / "nowhere")
    os.mkfifo(folder / "pipe.bvh")
    scandir = os.scandir

    def guard_scandir(path: Any) -> Any:
        if str(path).endswith("closed"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", guard_scandir)
    report = mcz.pack(folder, folder / "all.mcz")
    found = results(report)
    assert [o.path for o in report.failures] == ["closed"]
    assert "Permission denied" in report.failures[0].message
    assert {p for p, r in found.items() if r == "skipped"} == {
        *("link", "dead.bvh", "pipe.bvh"),
        "a.mcz",  # it was there before, and is no motion file
    }


def test_verbatim_does_not_hide_a_missing_skeleton(tmp_path: Path) -> None:
    write_samples(tmp_path)
    with pytest.raises(mcz.SourceError, match="none.asf"):
        mcz.encode(
            tmp_path / "walk.amc",
            tmp_path / "a.mcz",
            skeleton=tmp_path / "none.asf",
            verbatim=True,
        )
    assert not (tmp_path / "a.mcz").exists()


def test_verbatim_keeps_what_is_over_a_limit(tmp_path: Path) -> None:
    channels = "CHANNELS 20000 " + " ".join(["Xrotation"] * 20000)
    text = bvh(*(" ".join([number] * 20000) for number in ("1.5", "2.5")))
    wide = tmp_path / "wide.bvh"
    wide.write_text(text.replace("CHANNELS 1 Xrotation", channels))
    with pytest.raises(mcz.LimitError, match="channels"):
        mcz.encode(wide, tmp_path / "a.mcz")
    mcz.encode(wide, tmp_path / "a.mcz", verbatim=True)
    assert mcz.verify(tmp_path / "a.mcz") == []
    with mcz.open(tmp_path / "a.mcz") as file:
        assert not file.skeletons
        assert file.attachments["wide.bvh"].read() == wide.read_bytes()
    (tmp_path / "a.mcz").unlink()
    report = mcz.pack(tmp_path, tmp_path / "a.mcz", verbatim=True)
    assert "channels" in report.outcomes[0].message
    assert results(report) == {"wide.bvh": "verbatim"}


@pytest.mark.parametrize("damage", [bytes(5000), b"not a chunk"])
def test_an_end_that_is_damaged(cut: Path, damage: bytes) -> None:
    """A crash may leave zeros where the end should be."""
    path = cut / "a.mcz"
    broken = path.read_bytes() + damage
    path.write_bytes(broken)
    with pytest.raises(mcz.FormatError):
        mcz.append([cut / "three.bvh"], path)
    assert path.read_bytes() == broken
    report = mcz.append([cut / "three.bvh"], path, salvage=True)
    assert results(report) == {"three.bvh": "parsed", "two": "salvaged"}
    assert mcz.verify(path) == []
    path.write_bytes(broken)
    assert results(mcz.append([cut / "three.bvh"], path, force=True))["two"] == "dropped"
    assert mcz.verify(path) == []


def test_no_mcz_file_is_none_by_force(folder: Path) -> None:
    for options in ({"salvage": True}, {"force": True}):
        with pytest.raises(mcz.FormatError, match="not an MCZ file"):
            mcz.append([folder / "two.bvh"], folder / "one.bvh", **options)


def test_pack_of_a_closed_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Any) -> Any:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(mcz.AccessError, match="Permission denied"):
        mcz.pack(folder, folder / "all.mcz")
    assert not (folder / "all.mcz").exists()
