"""Commands that people try first: folders, empty files, units, sizes of figures."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import mcz
from mcz.codecs.posewave.choices import PRESETS
from mcz.sources import FORMATS
from tests.commands import Call

SUFFIXES = sorted({suffix for found in FORMATS.values() for suffix in found.suffixes} | {".mcz"})


@pytest.fixture(scope="module")
def sample_files(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The samples, and two files of them."""
    target = tmp_path_factory.mktemp("made") / "here"
    shutil.copytree(samples, target)
    mcz.encode(target / "walk.bvh", target / "walk.mcz", unit="cm")
    mcz.pack(samples, target / "all.mcz")
    return target


@pytest.fixture
def folder(sample_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same in the current folder."""
    shutil.copytree(sample_files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


# Folders and empty files -----------------------------------------------------------


def test_a_folder_is_packed_and_a_file_encoded(folder: Path, call: Call) -> None:
    (folder / "my takes").mkdir()
    code, _, errors = call("encode", "my takes")
    assert (code, errors) == (1, "mcz: my takes: is a folder: mcz pack 'my takes' OUT.mcz\n")
    code, _, errors = call("pack", "walk.bvh", "x.mcz")
    assert (code, errors) == (
        2,
        "mcz: walk.bvh: it is a file, not a folder; use mcz encode walk.bvh\n",
    )


INTO = [
    ("walk.mcz", "encode", "walk.bvh", "-o", "OUT"),
    ("walk.bvh", "decode", "walk.mcz", "-o", "OUT"),
    ("walk.mcz", "extract", "walk.mcz", "OUT", "--frames", "2:9"),
    ("all.mcz", "reorder", "all.mcz", "walk.c3d", "-o", "OUT"),
    ("all.mcz", "rename", "all.mcz", "walk.c3d", "other", "-o", "OUT"),
    ("all.mcz", "delete", "all.mcz", "walk.c3d", "-o", "OUT"),
    ("walk.mcz", "repair", "walk.mcz", "-o", "OUT"),
    ("walk.png", "plot", "walk.mcz", "-o", "OUT"),
    ("walk.gif", "render", "walk.mcz", "-o", "OUT", "--frames", "0:2"),
    ("motions.mcz", "pack", "motions", "OUT"),
]


@pytest.mark.parametrize("slash", ["", "/"])
@pytest.mark.parametrize("words", INTO, ids=[words[1] for words in INTO])
def test_an_output_may_be_a_folder(
    words: tuple[str, ...], slash: str, folder: Path, call: Call
) -> None:
    (folder / "motions").mkdir()
    shutil.copy("walk.bvh", "motions")
    if not slash:
        (folder / "out").mkdir()
    name, *arguments = words
    code, _, errors = call(*(f"out{slash}" if word == "OUT" else word for word in arguments))
    assert code == 0, errors
    assert [path.name for path in (folder / "out").iterdir()] == [name]


def test_a_folder_that_cannot_stand_for_a_file_is_refused(folder: Path, call: Call) -> None:
    (folder / "out").mkdir()
    for words in (("merge", "walk.mcz", "all.mcz", "--rename"), ("train", "walk.amc")):
        for more in ((), ("--force",)):
            code, _, errors = call(*words, "-o", "out", *more)
            assert code == 2 and "out" in errors and "exists" not in errors
    assert not list((folder / "out").iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_empty_files_are_called_empty(suffix: str, folder: Path, call: Call) -> None:
    empty = folder / f"none{suffix}"
    empty.touch()
    commands = [("info", empty), ("append", empty, "all.mcz")]
    if suffix != ".asf":  # of which no motion is read, whatever it holds
        commands += [("diff", empty, "walk.bvh")]
    if suffix == ".mcz":
        commands += [(word, empty) for word in ("verify", "list", "meta", "decode")]
        commands += [("unpack", empty, "out"), ("extract", empty, "x.mcz", "--frames", "0:1")]
    else:
        commands += [("encode", empty)]
    for words in commands:
        code, out, errors = call(*words)
        assert code in (1, 3), (words, errors)
        assert re.search("is empty(; --verbatim keeps the file as an attachment)?\n", errors)
        assert not out
    (folder / "many").mkdir()
    empty.rename(folder / "many" / empty.name)
    _, _, errors = call("pack", "many", "y.mcz")
    assert "is empty" in errors or "no motion file" in errors


# Units and heights -----------------------------------------------------------------


def test_a_unit_may_be_a_length(folder: Path, call: Call) -> None:
    for unit, centimeters in {"5.6444cm": 5.6444, "0.1 in": 0.254, "2m": 200.0, "dm": 10.0}.items():
        assert call("encode", "walk.bvh", "--unit", unit, "-o", "u.mcz", "--force")[0] == 0
        with mcz.open("u.mcz") as file:
            assert file.clips["walk"].skeleton.unit_cm == centimeters
            assert file.clips["walk"].source_bytes() == Path("walk.bvh").read_bytes()
    assert mcz.read("walk.bvh", unit="5.6444cm").skeleton.unit_cm == 5.6444


@pytest.mark.parametrize("unit", ["5.6", "cm5", "0cm", "-1cm", "1e400cm", ".cm", "feet", "", "١cm"])
def test_a_unit_that_is_none_is_refused(unit: str, folder: Path, call: Call) -> None:
    code, _, errors = call("encode", "walk.bvh", "--unit", unit, "-o", "u.mcz")
    assert code == 2 and "'--unit'" in errors and not Path("u.mcz").exists()
    with pytest.raises(mcz.OptionError, match="unit"):
        mcz.read("walk.bvh", unit=unit)


def test_a_height_that_is_no_persons_is_remarked_upon(folder: Path, call: Call) -> None:
    code, _, errors = call("encode", "walk.bvh", "--unit", "mm", "-o", "u.mcz")
    note = "height 166 units = 16.6 cm, which is not human; is 1 unit = 0.1 cm right?"
    assert (code, errors) == (0, f"mcz: walk.bvh: {note}\n")
    assert note in call("info", "u.mcz")[1]
    assert call("encode", "walk.bvh", "--unit", "cm", "-o", "v.mcz")[2] == ""
    assert "height 166 cm\n" in call("info", "v.mcz")[1]
    assert "height 166 units\n" in call("info", "walk.bvh")[1]


def test_what_is_no_figure_has_no_height(folder: Path, call: Call) -> None:
    """Hands, faces, props and markers are of any size."""
    text = Path("walk.bvh").read_text().replace("Foot", "Spoke").replace("Toe", "Rim")
    Path("wheel.bvh").write_text(text)
    assert call("encode", "wheel.bvh", "--unit", "mm")[2] == ""
    assert call("encode", "walk.c3d", "-o", "c.mcz")[2] == ""
    assert "height" not in call("info", "wheel.mcz")[1] + call("info", "c.mcz")[1]


# Quality -----------------------------------------------------------------------------


@pytest.mark.parametrize(("quality", "most"), [("0.5mm", 0.05), *PRESETS.items()])
def test_quality_is_the_greatest_error(quality: str, most: float, folder: Path, call: Call) -> None:
    assert call("encode", "walk.bvh", "--unit", "cm", "--quality", quality, "-o", "q.mcz")[0] == 0
    whole = mcz.read("walk.bvh", unit="cm")
    with mcz.open("q.mcz") as file:
        assert file.clips["walk"].codec == "posewave"
        decoded = mcz.compare(whole, file.clips["walk"].motion()).entries()
    assert most / 3 < float(decoded["max_position_error_cm"]) <= most


def test_quality_is_said_once_and_of_a_length(folder: Path, call: Call) -> None:
    for words in (
        ("--quality", "high"),
        ("--quality", "5"),
        ("--quality", "1mm", "--param", "max_error_cm=2"),
        ("--quality", "1mm", "--param", "preset=mm"),
        ("--quality", "1mm", "--effort", "best"),
        ("--quality", "1mm", "--codec", "best"),
    ):
        code, _, errors = call("encode", "walk.bvh", "--unit", "cm", *words, "-o", "q.mcz")
        assert code == 2 and errors.count("\n") == 1, errors
    words = ("--unit", "cm", "--quality", "1cm", "--codec", "qbc", "-o", "q.mcz")
    assert call("encode", "walk.bvh", *words)[0] == 0
    with mcz.open("q.mcz") as file:
        assert file.clips["walk"].codec == "qbc"


# Lists and metadata ------------------------------------------------------------------


def test_one_long_name_widens_its_own_row_alone(folder: Path, call: Call) -> None:
    assert call("rename", "all.mcz", "walk", "w" * 200)[0] == 0
    for words in (("list", "all.mcz"), ("info", "all.mcz", "--no-preview")):
        code, out, _ = call(*words)
        assert code == 0 and "w" * 200 in out
        lengths = sorted(len(line) for line in out.splitlines())
        assert lengths[-2] < 110 or words[0] == "info"
    head, *rows = call("list", "all.mcz")[1].splitlines()
    columns = [row.index("fast") for row in rows if "fast" in row]
    assert columns == [202, head.index("codec"), head.index("codec")]


def test_columns_have_the_names_of_headings(folder: Path, call: Call) -> None:
    code, out, _ = call("list", "all.mcz", "--columns", "clip,frames,channels,rate,fps", "--csv")
    assert code == 0
    assert out.splitlines()[2] == "walk.bvh,240,96,120.0,120.0"
    by_field = call("list", "all.mcz", "--where", "frame_rate > 1", "--sort", "-n_channels")[1]
    assert call("list", "all.mcz", "--where", "fps > 1", "--sort", "-channels")[1] == by_field


def test_license_is_licence(folder: Path, call: Call) -> None:
    assert call("meta", "walk.mcz", "--set", "license=CC-BY-4.0")[0] == 0
    assert call("meta", "walk.mcz")[1] == "walk:\n  licence: CC-BY-4.0\n"
    assert "CC-BY-4.0" in call("list", "walk.mcz", "--columns", "license")[1]
    assert "walk" in call("list", "walk.mcz", "--where", "license == 'CC-BY-4.0'")[1]
    Path("t.csv").write_text("clip,license\nwalk,MIT\n")
    assert call("meta", "walk.mcz", "--from", "t.csv")[0] == 0
    assert call("meta", "walk.mcz")[1] == "walk:\n  licence: MIT\n"
    assert call("meta", "walk.mcz", "--set", "license=a", "--set", "licence=b")[0] == 2
    with pytest.raises(mcz.OptionError, match="the same key"):
        mcz.set_metadata("walk.mcz", {"walk": {"license": "MIT", "licence": "MIT"}})
    assert call("meta", "walk.mcz", "--remove", "license")[0] == 0
    assert "MIT" not in call("meta", "walk.mcz")[1]


def test_a_row_that_may_mean_two_clips_says_how_to_be_exact(folder: Path, call: Call) -> None:
    for day in ("1", "2"):
        (folder / "days" / day).mkdir(parents=True)
        text = Path("walk.bvh").read_bytes()
        (folder / "days" / day / "run.bvh").write_bytes(
            text.replace(b"0.0", b"0.%s" % day.encode(), 1)
        )
    mcz.pack("days", "days.mcz")
    Path("t.csv").write_text("clip,x-day,subject\nrun,1,05\n")
    code, _, errors = call("meta", "days.mcz", "--from", "t.csv")
    assert code == 2
    assert "write one of these names, or build it from more columns with match, such as" in errors
    words = ("--match", "{x-day}/{clip}", "--take", "subject")
    assert call("meta", "days.mcz", "--from", "t.csv", *words)[0] == 0
    assert call("meta", "days.mcz", "--clip", "1/run")[1] == "1/run:\n  subject: 05\n"


# What an archive does not keep, and what takes another's place -------------------------


def test_what_of_a_folder_is_not_kept_is_said(folder: Path, call: Call) -> None:
    (folder / "takes/none/at all").mkdir(parents=True)
    for name in ("walk.bvh", "walk.amc", "walk.asf"):
        shutil.copy(name, "takes")
    shutil.copy("walk.bvh", "takes/z.bvh")  # an alias, which has no time of its own
    Path("takes/walk.bvh").chmod(0o755)
    timeless = "times of files that are not clips: walk.asf, z.bvh"
    said = {"empty folders: none/at all", "modes of executable files: walk.bvh", timeless}
    code, _, errors = call("pack", "takes", "t.mcz", "--mtimes")
    assert code == 0
    assert {text.removeprefix("mcz: left out: ") for text in errors.splitlines()} == said
    code, _, errors = call("unpack", "t.mcz", "out", "--mtimes")
    assert (code, errors) == (0, f"mcz: left out: {timeless}\n")
    for name in ("walk.bvh", "walk.amc"):
        assert Path("out", name).stat().st_mtime_ns == Path("takes", name).stat().st_mtime_ns
    report = mcz.pack("takes", "u.mcz")
    assert set(report.left_out) == {text for text in said if "times" not in text}


def test_append_replaces_what_came_from_the_path(folder: Path, call: Call) -> None:
    assert call("meta", "all.mcz", "--set", "license=MIT", "--set", "x-day=2")[0] == 0
    new = Path("walk.bvh").read_bytes().replace(b"0.008333333333333333", b"0.01")
    assert new != Path("walk.bvh").read_bytes()
    Path("walk.bvh").write_bytes(new)
    before = Path("all.mcz").read_bytes()
    code, _, errors = call("append", "walk.bvh", "all.mcz")
    assert code == 1 and "--replace" in errors
    Path("broken.bvh").write_bytes(new[:-900])
    code, _, errors = call("append", "--replace", "walk.bvh", "broken.bvh", "all.mcz")
    assert code == 1 and Path("all.mcz").read_bytes() == before
    assert call("append", "--replace", "walk.bvh", "walk.c3d", "all.mcz")[0] == 0
    assert not mcz.verify("all.mcz") and not list(folder.glob(".*"))
    with mcz.open("all.mcz") as file:
        assert sorted(file.clips) == ["walk", "walk.bvh", "walk.c3d"]
        clip = file.clips["walk.bvh"]
        assert clip.source_bytes() == new and clip.frame_rate == 100
        assert clip.metadata == {"licence": "MIT", "x-day": "2"}
    size = Path("all.mcz").stat().st_size
    assert call("append", "--replace", "walk.bvh", "all.mcz")[0] == 0  # present
    assert Path("all.mcz").stat().st_size == size


def test_append_replaces_attachments_and_skeletons(folder: Path, call: Call) -> None:
    (folder / "kept").mkdir()
    Path("kept/notes.txt").write_text("one")
    shutil.copy("walk.asf", "kept")
    mcz.pack("kept", "kept.mcz", keep_all=True)
    Path("kept/notes.txt").write_text("two")
    asf = Path("walk.asf").read_bytes().replace(b":name", b"# changed\n:name", 1)
    Path("kept/walk.asf").write_bytes(asf)
    words = ("kept/notes.txt", "kept/walk.asf", "kept.mcz", "--replace", "--verbatim")
    code, _, errors = call("append", *words)
    assert code == 0, errors
    assert call("unpack", "kept.mcz", "out")[0] == 0
    assert Path("out/notes.txt").read_text() == "two"
    assert Path("out/walk.asf").read_bytes() == asf


# Wrong words -----------------------------------------------------------------------------


def test_answers_to_wrong_words_name_the_right_ones(folder: Path, call: Call) -> None:
    for words, answer in (
        (("encode", "walk.bvh", "--codec", "losy"), "did you mean 'lossy'?"),
        (("encode", "walk.bvh", "walk.c3d"), "mcz pack takes a folder of them, mcz append several"),
        (
            ("list", "walk.bvh"),
            "not an MCZ file: it begins with 'HIERARCH'; encode a source file with mcz encode",
        ),
        (("unpack", "walk.bvh", "out"), "; encode a source file with mcz encode"),
        (
            ("encode", "all.mcz"),
            "all.mcz: it is an .mcz already; to add it to another, use mcz append",
        ),
    ):
        code, out, errors = call(*words)
        assert code in (1, 2) and not out and errors.count("\n") == 1
        assert answer in errors, errors


def test_rows_of_numbers_are_taken_for_no_table(folder: Path, call: Call) -> None:
    Path("cut.bvh").write_text("1 2 3\n4 5 6\n")
    code, _, errors = call("encode", "cut.bvh")
    assert code == 1 and "not a BVH file" in errors and ".csv" not in errors
