"""Bags are what another tool takes for bags, and every change of one is found."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.files.bags import manifest_text, read_manifest, read_tags, tags_text
from tests.commands import Call
from tests.motions import smooth

bagit = pytest.importorskip("bagit")
DATE = {"Bagging-Date": "2026-11-24"}


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "Väsa 100.mcz"
    mcz.write(smooth(12), path, "raw")
    return path


@pytest.fixture
def bag_path(archive: Path, tmp_path: Path) -> Path:
    (tmp_path / "report.txt").write_text("fine\n")
    return mcz.bag([archive, tmp_path / "report.txt"], tmp_path / "bag", DATE)


def is_valid(folder: Path) -> bool:
    """Validate a bag with the library of the Library of Congress."""
    logging.disable(logging.CRITICAL)
    try:
        return bool(bagit.Bag(str(folder)).is_valid())
    except bagit.BagError:
        return False
    finally:
        logging.disable(logging.NOTSET)


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_bag_is_one_for_others(bag_path: Path, archive: Path) -> None:
    assert is_valid(bag_path)
    found = mcz.check_bag(bag_path)
    assert found.problems == []
    assert (found.version, found.algorithms) == ("1.0", ["sha256", "sha512"])
    assert found.files == ["data/Väsa 100.mcz", "data/report.txt"]
    assert (bag_path / "data" / archive.name).read_bytes() == archive.read_bytes()
    info = dict(found.info)
    assert info["Payload-Oxum"] == f"{archive.stat().st_size + 5}.2"
    assert info["Bagging-Date"] == "2026-11-24"


def test_the_same_files_make_the_same_bag(bag_path: Path, archive: Path, tmp_path: Path) -> None:
    again = mcz.bag([tmp_path / "report.txt", archive], tmp_path / "again", DATE)
    assert files_of(bag_path) == files_of(again)


def test_every_change_is_found(bag_path: Path) -> None:
    """By us and by others: each file changed, longer, or gone; a file too many."""
    for name, data in files_of(bag_path).items():
        for change in (data[:-1] + bytes([data[-1] ^ 1]), data + b"\n ", None):
            if change is None and "manifest" in name:
                continue  # the others are enough
            path = bag_path / name
            path.unlink() if change is None else path.write_bytes(change)
            try:
                problems = mcz.check_bag(bag_path).problems
            except mcz.OptionError:  # no bagit.txt
                problems = ["not a bag"]
            assert problems or name.startswith("tagmanifest"), name  # for which nothing vouches
            path.write_bytes(data)
    (bag_path / "data" / "more.mcz").write_bytes(b"")
    assert "data/more.mcz is not in manifest-sha256.txt" in mcz.check_bag(bag_path).problems
    assert not is_valid(bag_path)
    (bag_path / "data" / "more.mcz").unlink()
    assert mcz.check_bag(bag_path).problems == []


def test_bags_of_others_are_checked(archive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "theirs"
    (folder / "sub").mkdir(parents=True)
    (folder / "sub" / "a.mcz").write_bytes(archive.read_bytes())
    (folder / "b c.txt").write_bytes(b"b")
    logging.disable(logging.CRITICAL)
    bagit.make_bag(str(folder), {"Contact-Name": "A\n B"}, checksums=["md5", "sha256"])
    logging.disable(logging.NOTSET)
    found = mcz.check_bag(folder)
    assert (found.problems, found.version, found.algorithms) == ([], "0.97", ["md5", "sha256"])
    assert found.files == ["data/b c.txt", "data/sub/a.mcz"]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("bagit.txt", "BagIt-Version: 9\nTag-File-Character-Encoding: UTF-8\n", "'9' is not known"),
        ("bagit.txt", "BagIt-Version: 1.0\nTag-File-Character-Encoding: X\n", "'X' is not known"),
        ("bagit.txt", "nothing\n", "not a name and a value"),
        ("manifest-sha256.txt", "zz  data/a\n", "line 1 is not a digest and a path"),
        ("manifest-sha256.txt", "00  ../a\n", "'../a' does not belong there"),
        ("manifest-sha256.txt", "00  data/../../a\n", "does not belong there"),
        ("manifest-sha256.txt", "00  /data/a\n", "does not belong there"),
        ("manifest-sha256.txt", "00  data/a\n11  data/a\n", "twice"),
        ("manifest-sha256.txt", "00  data/gone\n", "data/gone is missing"),
        ("tagmanifest-sha256.txt", "00  data/a\n", "does not belong there"),
        ("manifest-crc99.txt", "00  data/a\n", "crc99 is not known"),
        ("fetch.txt", "http://a 1 data/a\n", "files elsewhere"),
        ("bag-info.txt", "Payload-Oxum: 1.1\n", "Payload-Oxum is 1.1"),
    ],
)
def test_what_is_no_sound_bag(bag_path: Path, name: str, text: str, said: str) -> None:
    (bag_path / name).write_text(text)
    assert any(said in problem for problem in mcz.check_bag(bag_path).problems)
    assert name == "manifest-crc99.txt" or not is_valid(bag_path) or name == "fetch.txt"


def test_what_cannot_be_a_bag(archive: Path, tmp_path: Path, call: Call) -> None:
    """And leaves nothing behind."""
    before = sorted(tmp_path.iterdir())
    bad = bytearray(archive.read_bytes())
    bad[-40] ^= 1
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / archive.name).write_bytes(bad)
    damaged, target = tmp_path / "sub" / archive.name, tmp_path / "new"
    for files, error, said in (
        ([damaged], mcz.FormatError, "damaged, so it was not added to the bag"),
        ([archive, damaged], mcz.OptionError, "would have the same name"),
        ([archive, tmp_path / "none"], mcz.AccessError, "no such file"),
        ([archive, tmp_path], mcz.AccessError, "not a file"),
        ([], mcz.OptionError, "at least one file"),
        ([tmp_path / "100%.mcz"], mcz.OptionError, "contains %.*rename the file"),
        ([tmp_path / "a\nb.mcz"], mcz.OptionError, "contains a line end.*rename the file"),
        ([tmp_path / "gr\udcf6.mcz"], mcz.OptionError, "not valid UTF-8; rename the file"),
    ):
        with pytest.raises(error, match=said):
            mcz.bag(files, target)
    with pytest.raises(mcz.ExistsError):
        mcz.bag([archive], tmp_path / "sub")
    for info in ({"a:b": "c"}, {"": "c"}, {"a": "b\nc"}, {"payload-oxum": "1.1"}):
        with pytest.raises(mcz.OptionError):
            mcz.bag([archive], target, info)
    with pytest.raises(mcz.AccessError):
        mcz.bag([archive], tmp_path / "none" / "new")
    with pytest.raises(mcz.OptionError, match="not a bag"):
        mcz.check_bag(tmp_path)
    assert call("bag", archive, target, "--info", "a")[0] == 2
    assert call("bag", archive, target, "--info", "a=1", "--info", "A=2")[0] == 2
    names = sorted([*(path.name for path in before), "sub"])
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_commands(archive: Path, tmp_path: Path, call: Call) -> None:
    folder, report = tmp_path / "bag", tmp_path / "r.json"
    code, out, _ = call("bag", archive, folder, "--info", "Source-Organization=A = B")
    assert code == 0
    assert out == f"{folder}: a bag of 1 file, {archive.stat().st_size:,} bytes\n"
    assert "Source-Organization: A = B\n" in (folder / "bag-info.txt").read_text()
    for quick in ([], ["--quick"]):
        code, out, _ = call("verify", folder, "--report", report, "--force", *quick)
        assert code == 0
        assert f"{folder}: a valid bag, 1 file" in out
        document = json.loads(report.read_bytes())
        assert document["verified"] and document["files"][0]["verified"]
        assert document["info"]["Source-Organization"] == "A = B"
    assert call("verify", folder, "--where", "n_frames > 1")[0] == 2
    assert call("verify", tmp_path)[0] == 1
    data = bytearray(archive.read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "data" / archive.name).write_bytes(data)
    (folder / "data" / "z.mcz").write_bytes(data[:8])
    code, out, errors = call("verify", folder, "--report", tmp_path / "r.txt")
    assert (code, out) == (3, "")
    assert "its sha256 is" in errors and "z.mcz: structure: " in errors
    assert "NOT VERIFIED" in (tmp_path / "r.txt").read_text("utf-8")
    assert not json.loads(call("verify", folder, "--json")[1])["verified"]


paths = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1)


@given(st.dictionaries(paths.map(lambda path: f"data/{path}x"), st.just("0a")))
def test_manifests_give_back_what_they_hold(rows: dict[str, str]) -> None:
    assert dict(read_manifest(manifest_text(rows))) == rows


words = st.text(st.characters(exclude_categories=["Cs", "Cc", "Z"], exclude_characters=":"))


@given(st.lists(st.tuples(words.filter(bool), words)))
def test_tags_give_back_what_they_hold(pairs: list[tuple[str, str]]) -> None:
    assert read_tags(tags_text(pairs)) == pairs
