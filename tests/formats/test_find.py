"""Which ASF an AMC finds."""

from __future__ import annotations

from pathlib import Path

import pytest

from mcz.errors import SourceError
from mcz.formats import find_asf, format_of


def touch(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")


@pytest.mark.parametrize(
    ("files", "found"),
    [
        (["amc/14_02.asf", "amc/14.asf", "asf/14_02.asf"], "amc/14_02.asf"),
        (["amc/14.ASF", "amc/1.asf", "asf/14_02.asf"], "amc/14.ASF"),
        (["amc/140.asf", "amc/1.asf", "asf/14.asf"], "asf/14.asf"),
        (["amc/140.asf", "ASF/14_02.Asf", "asf2/14.asf"], "ASF/14_02.Asf"),
        (["amc/other.asf"], "amc/other.asf"),
        (["other/14.asf"], None),
    ],
)
def test_the_nearest_is_found(tmp_path: Path, files: list[str], found: str | None) -> None:
    touch(tmp_path, "amc/14_02.AMC", *files)
    assert find_asf(tmp_path / "amc/14_02.AMC") == (found and tmp_path / found)


def test_the_longest_prefix_wins(tmp_path: Path) -> None:
    touch(tmp_path, "a_b-c.amc", "a.asf", "a_b.asf")
    assert find_asf(tmp_path / "a_b-c.amc") == tmp_path / "a_b.asf"


@pytest.mark.parametrize("names", [("x.asf", "y.asf"), ("14.asf", "14.ASF")])
def test_two_equally_good_ones_are_an_error(tmp_path: Path, names: tuple[str, str]) -> None:
    touch(tmp_path, *names)
    if len(list(tmp_path.iterdir())) < 2:
        pytest.skip("this file system does not tell upper from lower case")
    with pytest.raises(SourceError, match=r"2 skeletons.*" + names[0]):
        find_asf(tmp_path / "14_02.amc")


def test_formats_go_by_suffix() -> None:
    assert format_of("x/Y.BVH").name == "bvh"
    with pytest.raises(SourceError, match=r"'\.txt'"):
        format_of("x.txt")
