"""The search for the ASF of an AMC, by folder and by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from mcz import SourceError
from mcz.sources import format_of
from mcz.sources.text.bones import NUMBER, SUBJECT, TAKE, skeletons_around


def touch(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")


def around(path: Path, folder: Path) -> list[tuple[str, str]]:
    return [(c.path.relative_to(folder).as_posix(), c.name_of) for c in skeletons_around(path)]


@pytest.mark.parametrize(
    ("files", "found", "name_of"),
    [
        (["amc/14_02.asf", "amc/14.asf", "asf/14_02.asf"], "amc/14_02.asf", TAKE),
        (["amc/14.ASF", "amc/1.asf", "asf/14_02.asf"], "amc/14.ASF", SUBJECT),
        (["amc/140.asf", "amc/1.asf", "asf/14.asf"], "asf/14.asf", SUBJECT),
        (["amc/140.asf", "ASF/14_02.Asf", "asf2/14.asf"], "ASF/14_02.Asf", TAKE),
        (["amc/other.asf"], "amc/other.asf", ""),
        (["asf/other.asf"], "asf/other.asf", ""),
    ],
)
def test_the_nearest_comes_first(
    tmp_path: Path, files: list[str], found: str, name_of: str
) -> None:
    touch(tmp_path, "amc/14_02.AMC", *files)
    assert around(tmp_path / "amc/14_02.AMC", tmp_path)[0] == (found, name_of)


def test_nothing_is_looked_for_elsewhere(tmp_path: Path) -> None:
    touch(tmp_path, "amc/14_02.AMC", "other/14.asf", "14.asf", "amc/asf/14.asf")
    assert around(tmp_path / "amc/14_02.AMC", tmp_path) == []


def test_the_longest_prefix_comes_first(tmp_path: Path) -> None:
    touch(tmp_path, "a_b-c.amc", "a.asf", "a_b.asf", "b.asf")
    found = around(tmp_path / "a_b-c.amc", tmp_path)
    assert found == [("a_b.asf", SUBJECT), ("a.asf", SUBJECT), ("b.asf", "")]


def test_a_number_at_the_end_is_no_part_of_the_name(tmp_path: Path) -> None:
    touch(tmp_path, "walk12.amc", "walk.asf", "zombie.asf", "walk1.asf")
    assert around(tmp_path / "walk12.amc", tmp_path) == [
        ("walk.asf", NUMBER),
        ("walk1.asf", ""),
        ("zombie.asf", ""),
    ]
    touch(tmp_path, "12.amc", ".asf")
    assert {name_of for _, name_of in around(tmp_path / "12.amc", tmp_path)} == {""}


def test_files_of_one_name_are_equally_near(tmp_path: Path) -> None:
    touch(tmp_path, "14.asf", "14.ASF")
    if len(list(tmp_path.iterdir())) < 2:
        pytest.skip("this file system does not tell upper from lower case")
    first, second = skeletons_around(tmp_path / "14_02.amc")
    assert first.rank == second.rank


def test_formats_go_by_suffix() -> None:
    assert format_of("x/Y.BVH").name == "bvh"
    with pytest.raises(SourceError, match=r"'\.txt'"):
        format_of("x.txt")
