"""Unpacking into folders that hold files, and names that some systems reject."""

from __future__ import annotations

import csv
import io
import os
import unicodedata
from dataclasses import replace
from pathlib import Path

import pytest

import mcz
from mcz import OptionError
from mcz.files.editing import folders, unpacking
from mcz.files.editing.folders import HIDDEN, PortableNames, fault_of, fold_name, notes_on
from mcz.files.editing.unpacking import NAMES
from tests.commands import Call, run
from tests.motions import smooth


def pack_names(folder: Path, *names: str) -> Path:
    """An archive of files with these names, each with its own text."""
    source = folder / "in"
    for number, name in enumerate(names):
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"%d %s" % (number, name.encode()))
    mcz.pack(source, folder / "a.mcz", keep_all=True)
    return folder / "a.mcz"


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("linked", ["sub", "sub/note.txt"])
def test_unpack_follows_no_link(tmp_path: Path, linked: str, force: bool) -> None:
    archive = pack_names(tmp_path, "sub/note.txt", "other.txt")
    outside, out = tmp_path / "outside", tmp_path / "out"
    outside.mkdir()
    target = outside / "note.txt"
    if linked != "sub":
        target.write_bytes(b"mine")
    (out / linked).parent.mkdir(parents=True)
    (out / linked).symlink_to(outside if linked == "sub" else target)
    report = mcz.unpack(archive, out, force=force)
    assert [o.path for o in report.failures] == ["sub/note.txt"]
    assert "is a symbolic link" in report.failures[0].message
    assert (out / "other.txt").exists()
    assert (target.read_bytes() == b"mine") if linked != "sub" else not any(outside.iterdir())
    assert (out / linked).is_symlink()


def test_unpack_writes_to_no_pipe(tmp_path: Path) -> None:
    archive, out = pack_names(tmp_path, "note.txt"), tmp_path / "out"
    out.mkdir()
    os.mkfifo(out / "note.txt")
    report = mcz.unpack(archive, out, force=True)
    assert "neither a file nor a folder" in report.failures[0].message


@pytest.mark.parametrize("names", NAMES)
def test_unpack_leaves_its_folder_with_no_names(
    tmp_path: Path, names: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = pack_names(tmp_path, "note.txt")
    for name in ("../out.txt", "/out.txt", "a/../../out.txt"):
        stored = unpacking.StoredFile(name, "attachment", "note.txt")
        monkeypatch.setattr(unpacking, "files_of", lambda file, clips, one=stored: [one])
        report = mcz.unpack(archive, tmp_path / names, names=names)
        assert [o.result for o in report.outcomes] == ["failed"]
        assert "not a plain relative path" in report.outcomes[0].message


def test_unpack_into_a_folder_that_is_itself_a_link(tmp_path: Path) -> None:
    """The user named it."""
    archive = pack_names(tmp_path, "note.txt")
    (tmp_path / "real").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "real")
    assert not mcz.unpack(archive, tmp_path / "out").failures


@pytest.mark.parametrize(
    "part",
    [
        *("CON", "con.bvh", "Nul", "COM1.amc", "lpt9", "walk.", "walk ", "a:b", "a\x01"),
        *('a"b', "a<b", "a|b", "a?", "a*b", "x" * 256, "ä" * 128, "Icon\r", "a\x1bb", "a\x85b"),
        *("a\u202eb", "a\u2066b", "a\u2028b", "a\u200fb", "a\ufeffb"),
    ],
)
def test_names_that_not_every_system_can_hold(part: str) -> None:
    assert fault_of(part)
    assert not fault_of(PortableNames()(part))
    (note,) = notes_on([f"walks/{part}", "walks/fine.bvh"]).values()
    is_hidden = HIDDEN.search(part) is not None
    assert ("does not write" if is_hidden else "Windows cannot hold") in note


HOSTILE = (
    "a\u202egpj.txt",
    "a\x1b]0;x\x07.txt",
    "Icon\r",
    "d\x01/x.txt",
    "d\x02/x.txt",
    "a_gpj.txt",
)


@pytest.mark.parametrize("names", NAMES)
def test_unpack_writes_no_name_with_a_hidden_character(tmp_path: Path, names: str) -> None:
    archive, out = pack_names(tmp_path, *HOSTILE), tmp_path / "out"
    report = mcz.unpack(archive, out, names=names)
    assert not any(HIDDEN.search(str(path.relative_to(out))) for path in out.rglob("*"))
    if names == "strict":
        assert len(report.failures) == 5
        return
    assert not report.failures
    texts = {path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert texts == {path.read_bytes() for path in (tmp_path / "in").rglob("*") if path.is_file()}
    if names == "stored":
        assert sum(outcome.message.startswith("as ") for outcome in report.outcomes) == 5
        assert (out / "a_gpj.txt").read_bytes().endswith(b" a_gpj.txt")


@pytest.mark.parametrize(
    "name", ["a\u202eb", "a\x85b", 'x"\x1b]0;pwn\x07', "con", "walk. ", "day\u2028/con", "a\r\n=b"]
)
def test_exported_files_have_names_that_every_system_can_hold(tmp_path: Path, name: str) -> None:
    mcz.write(replace(smooth(4), name=name), tmp_path / "a.mcz")
    report = mcz.export(tmp_path / "a.mcz", tmp_path / "out", "csv")
    assert not report.failures
    (tmp_path / "own").mkdir()
    for target in ("csv", "npz", "bvh"):
        arguments = ["decode", str(tmp_path / "a.mcz"), "--to", target, "-o", str(tmp_path / "own")]
        assert run(*arguments) == 0
    paths = [*(tmp_path / "out").rglob("*"), *(tmp_path / "own").iterdir()]
    assert len(paths) >= 4
    assert not any(fault_of(path.name) for path in paths)


@pytest.mark.parametrize(
    "part", ["CONSOLE", "walk.bvh", ".hidden", "com10", "a.b.c", "Väsa", "nul1"]
)
def test_names_that_all_can_hold(part: str) -> None:
    assert not fault_of(part) and not notes_on([part])
    assert PortableNames()(part) == part


COMPOSED, APART = "Ä.txt", unicodedata.normalize("NFD", "Ä.txt")


@pytest.mark.parametrize(
    ("one", "other"),
    [("NOTES.TXT", "notes.txt"), ("A/x.bvh", "a/y.bvh"), (COMPOSED, APART), ("straße", "STRASSE")],
)
def test_names_that_a_disk_takes_for_the_same(one: str, other: str) -> None:
    assert list(notes_on([one, other])) == [other]
    give = PortableNames()
    given = give(one), give(other)
    assert given[0] == one and len(set(map(fold_name, given))) == 2
    assert give(other) == given[1]


def test_a_number_makes_no_name_too_long() -> None:
    give = PortableNames()
    names = [give(f"{start}{'n' * 250}.bvh") for start in "aA"]
    assert names[1].endswith("~2.bvh") and [fault_of(name) for name in names] == ["", ""]


def test_names_in_messages_are_what_they_are(tmp_path: Path, call: Call) -> None:
    """Neither are line ends and double blanks one blank, nor bytes half of a surrogate pair."""
    for name, shown in (("a\nb  c", r"a\nb  c"), ("gr\udcf6", r"gr\xf6")):
        code, _, errors = call("list", tmp_path / name)
        assert code == 1 and f"{shown}: no such file" in errors


def test_pack_notes_and_unpack_gives_a_choice(tmp_path: Path) -> None:
    names = ("CON", "NOTES.TXT", "fine.txt", "notes.txt")
    source = tmp_path / "in"
    source.mkdir()
    for name in names:
        (source / name).write_bytes(name.encode())
    report = mcz.pack(source, tmp_path / "a.mcz", keep_all=True)
    noted = {o.path for o in report.outcomes if "Windows" in o.message or "disks" in o.message}
    assert noted == {"CON", "notes.txt"}
    plain = mcz.unpack(tmp_path / "a.mcz", tmp_path / "stored")
    assert not plain.failures and sorted(os.listdir(tmp_path / "stored")) == sorted(names)
    strict = mcz.unpack(tmp_path / "a.mcz", tmp_path / "strict", names="strict")
    assert {o.path for o in strict.failures} == noted
    portable = mcz.unpack(tmp_path / "a.mcz", tmp_path / "portable", names="portable")
    assert not portable.failures
    data = {p.name: p.read_bytes() for p in (tmp_path / "portable").iterdir()}
    assert data == {
        "CON_": b"CON",
        "NOTES.TXT": b"NOTES.TXT",
        "fine.txt": b"fine.txt",
        "notes~2.txt": b"notes.txt",
    }
    assert {o.path: o.message for o in portable.outcomes}["notes.txt"] == "as notes~2.txt"
    with pytest.raises(OptionError, match="not one of stored"):
        mcz.unpack(tmp_path / "a.mcz", tmp_path / "x", names="any")


@pytest.mark.parametrize("force", [False, True])
def test_a_disk_that_folds_names_loses_nothing(
    tmp_path: Path, force: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here the disk is made to: the second name leads to the file of the first."""
    archive, out = pack_names(tmp_path, "NOTES.TXT", "notes.txt"), tmp_path / "out"
    write = folders.Folder.write

    def fold_case(self: folders.Folder, path: str, data: bytes, *more, **options) -> Path:
        place = write(self, path, data, *more, **options)
        os.link(place, out / "notes.txt")
        return place

    monkeypatch.setattr(folders.Folder, "write", fold_case)
    report = mcz.unpack(archive, out, force=force)
    assert [o.path for o in report.failures] == ["notes.txt"]
    assert "names='portable' writes both" in report.failures[0].message
    assert (out / "NOTES.TXT").read_bytes() == b"0 NOTES.TXT"


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", "'=", " =", "\t=", "\r@", "\uff1d", "''-"])
def test_no_cell_of_csv_is_a_formula(
    tmp_path: Path, sign: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Tables, lists and streams; what is read again is what it was."""
    name, path = f"{sign}cmd|' /C calc'!A0", tmp_path / "a.mcz"
    motion = smooth(4)
    joints = (replace(motion.skeleton.joints[0], name=name), *motion.skeleton.joints[1:])
    motion = replace(motion, skeleton=replace(motion.skeleton, joints=joints), name=name)
    mcz.write(replace(motion, metadata={"title": name}), path)
    table = tmp_path / "t.csv"
    assert run("decode", path, "--to", "csv", "-o", table) == 0
    listed = tmp_path / "l.csv"
    capsys.readouterr()
    columns = ["--csv", "--columns", "name,title"]
    assert run("list", path, *columns) == 0
    listed.write_text(capsys.readouterr().out, newline="")
    for file in (table, listed):
        rows = list(csv.reader(io.StringIO(file.read_text(), newline="")))
        cells = [cell for row in rows for cell in row if not _is_number(cell)]
        assert any("calc" in cell for cell in cells)
        assert not any(cell.lstrip().startswith(tuple("=+-@\t\r\uff1d")) for cell in cells)
    if sign == sign.strip():  # blanks around a name of a table are not part of it
        assert run("meta", path, "--from", listed) == 0
    with mcz.open(path) as file_:
        assert file_.only_clip().metadata["title"] == name
    given = tmp_path / "j.csv"
    chosen = ["--joints", "0", "--to", "csv", "-o", str(given)]
    assert run("decode", path, *chosen) == 0
    arguments = ["--in-place", "--joint", "0", "--values", str(given)]
    assert run("replace", path, *arguments) == 0


def _is_number(cell: str) -> bool:
    return cell.replace(".", "").replace("-", "").replace("e", "").isdigit()
