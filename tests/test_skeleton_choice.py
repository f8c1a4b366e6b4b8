"""Never the wrong skeleton: which ASF an AMC gets, with what words, and what is recorded of it."""

from __future__ import annotations

import io
import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import SkeletonWarning, SourceError
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.file import EncodingOptions
from tests.commands import Call
from tests.live_codec import encode_live

ASF = b""":name small
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name %s
    direction 0 1 0
    length 2
    axis 0 0 0 XYZ
    dof %s
  end
:hierarchy
  begin
    root %s
  end
"""
AMC = b"1\nroot 0 0 0 0 0 0\nspine 1.5 2\n2\nroot 0 0 1 0 0 0\nspine 2.5 2\n"


def asf(bone: bytes = b"spine", dofs: bytes = b"rx ry") -> bytes:
    return ASF % (bone, dofs, bone)


FITS, OTHER_DOFS, FOREIGN = asf(), asf(dofs=b"rx ry rz"), asf(b"tail")
FILES = {"fits": FITS, "dofs": OTHER_DOFS, "foreign": FOREIGN}


def put_files(folder: Path, amc: str, **kinds: str) -> Path:
    """The path of an AMC in ``folder`` beside ASF files, each ``name="fits"`` or the like."""
    for name, kind in kinds.items():
        (folder / f"{name}.asf").write_bytes(FILES[kind])
    path = folder / f"{amc}.amc"
    path.write_bytes(AMC)
    return path


def read(path: Path, **options: object) -> tuple[mcz.Motion, list[str]]:
    """The motion of a file, and what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        motion = mcz.read(path, **options)
    assert all((one.category, one.filename) == (SkeletonWarning, __file__) for one in caught)
    return motion, [str(one.message) for one in caught]


@pytest.mark.parametrize(
    ("amc", "asfs", "note"),
    [
        ("walk_01", {"walk_01": "fits", "walk": "dofs"}, "ASF of the name of the take"),
        ("walk_01", {"walk": "fits", "other": "fits"}, "ASF of the name of the subject"),
        ("walk1", {"walk": "fits", "zombie": "fits"}, "the take without its number"),
        ("a_b_c", {"a_b": "foreign", "a": "fits"}, "ASF of the name of the subject"),
    ],
)
def test_without_a_word(tmp_path: Path, amc: str, asfs: dict[str, str], note: str) -> None:
    """Skeletons are chosen by the take's name if bones and DOFs fit the file."""
    motion, decoded = read(put_files(tmp_path, amc, **asfs))
    assert decoded == []
    assert note in motion.metadata["skeleton-note"]
    assert motion.skeleton.n_joints == 2 and motion.skeleton.base is None


@pytest.mark.parametrize(
    ("amc", "asfs", "words"),
    [
        ("05_01", {"09": "fits"}, "09.asf, the only one around whose bones fit"),
        ("05_01", {"09": "fits", "10": "foreign"}, "09.asf, the only one around whose bones fit"),
        ("05_01", {"09": "fits", "10": "dofs"}, "09.asf, the only one around whose bones fit"),
        ("05_01", {"09": "dofs"}, "the only one around whose bones fit; the dofs of spine"),
        ("05_01", {"05": "dofs"}, "05.asf; the dofs of spine are not those of the file"),
    ],
)
def test_with_a_line(tmp_path: Path, amc: str, asfs: dict[str, str], words: str) -> None:
    motion, decoded = read(put_files(tmp_path, amc, **asfs))
    assert len(decoded) == 1
    assert words in decoded[0]
    assert motion.skeleton.n_joints == 2


@pytest.mark.parametrize(
    ("amc", "asfs", "words"),
    [
        ("05_01", {"09": "fits", "10": "fits"}, "no skeleton has its name, and 2 have its bones"),
        ("05_01", {"09": "foreign"}, "no skeleton around has its name or its bones"),
        ("05_01", {"05": "foreign"}, "has its name, but not its bones"),
        ("05_01", {"05": "foreign", "09": "fits"}, "has its name, but not its bones"),
    ],
)
def test_refused(tmp_path: Path, amc: str, asfs: dict[str, str], words: str) -> None:
    """The error names the candidates and the option."""
    path = put_files(tmp_path, amc, **asfs)
    with pytest.raises(SourceError) as caught:
        mcz.read(path)
    assert words in str(caught.value)
    assert "choose one with skeleton=" in str(caught.value)
    assert all(f"{name}.asf" in str(caught.value) for name in asfs)


def test_files_of_one_name_are_a_riddle(tmp_path: Path) -> None:
    path = put_files(tmp_path, "walk_1", walk="fits")
    (tmp_path / "walk.ASF").write_bytes(OTHER_DOFS + b"# more\n")
    if len(list(tmp_path.iterdir())) < 3:
        pytest.skip("this file system does not tell upper from lower case")
    assert read(path)[1] == []  # one fits better
    (tmp_path / "walk.ASF").write_bytes(FITS + b"# more\n")
    with pytest.raises(SourceError, match="2 skeletons are equally near"):
        mcz.read(path)


def test_a_skeleton_that_cannot_be_read(tmp_path: Path) -> None:
    path = put_files(tmp_path, "walk_1", other="fits")
    (tmp_path / "bad.asf").write_bytes(b"no")
    assert "other.asf" in read(path)[1][0]
    (tmp_path / "walk.asf").write_bytes(b"no")
    with pytest.raises(SourceError, match=r"walk\.asf: line 1"):
        mcz.read(path)


def test_bones_that_come_late(tmp_path: Path) -> None:
    """The whole file counts, not its first frame alone."""
    path = put_files(tmp_path, "walk", walk="fits")
    path.write_bytes(AMC + b"3\nroot 0 0 0 0 0 0\nspine 1 2\nprop 7\n")
    with pytest.raises(SourceError, match=r"lacks prop; choose one with skeleton="):
        mcz.read(path)
    motion, decoded = read(path, skeleton=tmp_path / "walk.asf")
    assert "lacks prop; they are scalars without kinematics" in decoded[0]
    assert motion.skeleton.n_joints == 3


def test_one_that_is_given(tmp_path: Path) -> None:
    path = put_files(tmp_path, "05_01", a="fits", b="dofs", c="foreign")
    motion, decoded = read(path, skeleton=tmp_path / "a.asf")
    assert decoded == [] and "skeleton-note" not in motion.metadata
    again = read(path, skeleton=mcz.read_skeleton(tmp_path / "a.asf"))[0]
    assert (again.skeleton, again.metadata) == (motion.skeleton, motion.metadata)
    motion, decoded = read(path, skeleton=tmp_path / "b.asf")
    assert "the dofs of spine are not those of the file" in decoded[0]
    assert motion.metadata["skeleton-note"].startswith("the channels of")
    with pytest.raises(SourceError, match=r"c\.asf has none of its bones: spine"):
        mcz.read(path, skeleton=tmp_path / "c.asf")
    motion, decoded = read(path, skeleton="none")
    assert decoded == []
    assert motion.metadata["skeleton-note"].startswith("no ASF")


def test_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    path = put_files(tmp_path, "05_01")
    try:
        (tmp_path / "caf\udce9.asf").write_bytes(FITS)
    except (OSError, UnicodeError):
        pytest.skip("this file system has no such names")
    motion, decoded = read(path)
    assert len(decoded) == 1
    assert "caf\\udce9.asf" in motion.metadata["skeleton-note"]
    report = mcz.pack(tmp_path, tmp_path / "a.mcz")
    assert report.count("parsed") == 1


# Every door ----------------------------------------------------------------------


def test_encode_says_it_and_keeps_it(tmp_path: Path, call: Call) -> None:
    path = put_files(tmp_path, "05_01", **{"09": "fits"})
    code, _, errors = call("encode", path)
    assert (code, errors.count("\n")) == (0, 1)
    assert errors.startswith(f"mcz: {path}: its skeleton is {tmp_path / '09.asf'}, the only one")
    shown = call("info", path.with_suffix(".mcz"))[1]
    assert "skeleton-note  ASF the only one that fits: 09.asf" in shown
    with pytest.warns(SkeletonWarning, match="the only one around") as caught:
        mcz.encode(path, tmp_path / "b.mcz")
    assert caught[0].filename == __file__


def test_encode_refuses_and_leads_on(tmp_path: Path, call: Call) -> None:
    path = put_files(tmp_path, "05_01", **{"09": "foreign"})
    code, out, errors = call("encode", path)
    assert (code, out, errors.count("\n")) == (1, "", 1)
    assert "09.asf (which lacks spine)" in errors and "--skeleton" in errors
    assert not path.with_suffix(".mcz").exists()
    assert call("encode", path, "--skeleton", "none")[0] == 0
    code, _, errors = call("encode", path, "--force", "--skeleton", tmp_path / "09.asf")
    assert code == 1 and "none of its bones" in errors
    assert call("encode", path, "--force", "--verbatim")[0] == 0


def test_pack_names_each(tmp_path: Path, call: Call) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    put_files(folder, "walk_1", walk="fits", other="dofs")
    put_files(folder, "zombie")
    (folder / "alone").mkdir()
    put_files(folder / "alone", "riddle", a="fits", b="fits")
    code, out, _ = call("pack", folder, tmp_path / "a.mcz", "--json")
    rows = {row["path"]: row for row in json.loads(out)["files"]}
    assert code == 0
    assert rows["walk_1.amc"]["notes"] == []
    assert "walk.asf, the only one around" in rows["zombie.amc"]["notes"][0]
    note = "kept without a skeleton: no skeleton has its name, and 2 have its bones: a.asf b.asf"
    note += "; no ASF: a flat list of bones with plain scalar channels, without kinematics"
    assert rows["alone/riddle.amc"]["notes"] == [note]
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file.clips["alone/riddle"]
        assert clip.metadata["skeleton-note"] == note
        assert clip.source_bytes() == (folder / "alone/riddle.amc").read_bytes()
    _, _, errors = call("pack", folder, tmp_path / "a.mcz", "--force")
    assert "mcz: zombie.amc: its skeleton is" in errors


def test_append_names_it(tmp_path: Path, call: Call) -> None:
    put_files(tmp_path, "walk", walk="fits")
    assert call("encode", tmp_path / "walk.amc")[0] == 0
    (tmp_path / "x").mkdir()
    path = put_files(tmp_path / "x", "05_01", **{"09": "fits"})
    code, _, errors = call("append", path, tmp_path / "walk.mcz")
    assert code == 0
    assert "09.asf, the only one around" in errors
    path = put_files(tmp_path / "x", "05_02", **{"10": "fits"})
    code, _, errors = call("append", path, tmp_path / "walk.mcz")
    assert code == 1 and "2 have its bones" in errors


def test_write_keeps_what_read_recorded(tmp_path: Path) -> None:
    mcz.write(mcz.read(put_files(tmp_path, "walk", walk="fits")), tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        note = file.clips["walk"].motion().metadata["skeleton-note"]
    assert note == "ASF of the name of the take"


def test_diff_and_bench(tmp_path: Path, call: Call) -> None:
    path = put_files(tmp_path, "05_01", **{"09": "fits"})
    shutil.copy(path, tmp_path / "05_02.amc")
    code, _, errors = call("diff", path, tmp_path / "05_02.amc")
    assert (code, errors.count("the only one around")) == (0, 2)
    assert call("diff", path, path, "--skeleton", tmp_path / "09.asf")[2] == ""
    options = ("--codecs", "raw", "--no-speeds", "--no-cache", "--jobs", "1")
    code, _, errors = call("bench", path, *options)
    assert (code, errors.count("the only one around")) == (0, 1)
    put_files(tmp_path, "05_01", **{"10": "fits"})
    assert call("diff", path, path)[0] == 1


def test_live(tmp_path: Path) -> None:
    put_files(tmp_path, "walk", a="fits", b="dofs", c="foreign")

    def encode_remarks(name: str, sink: io.BytesIO) -> tuple[str, ...]:
        options = SourceOptions(skeleton=tmp_path / f"{name}.asf", rate=120)
        encoding = EncodingOptions("lsdt-frame", {"step": 0.01})
        return encode_live(AMC.splitlines(keepends=True), sink, "amc", options, encoding).remarks

    sink = io.BytesIO()
    assert encode_remarks("a", sink) == ()
    with mcz.open(sink.getvalue()) as file:
        assert "skeleton-note" not in file.clips["live"].metadata
        assert np.isfinite(file.clips["live"].read()).all()
    assert "b.asf does not fit" in encode_remarks("b", io.BytesIO())[0]
    with pytest.raises(SourceError, match="none of the bones: spine"):
        encode_remarks("c", io.BytesIO())


@pytest.mark.real
def test_real_subjects(data: Path, tmp_path: Path) -> None:
    """CMU's bones have the same names in all subjects: only names tell which is whose."""
    take = data / "cmu/amc/05_01.amc"
    assert read(take)[1] == []
    shutil.copy(take, tmp_path / "05_01.amc")
    shutil.copy(data / "cmu/asf/09.asf", tmp_path)
    assert "09.asf" in read(tmp_path / "05_01.amc")[1][0]
    shutil.copy(data / "cmu/asf/10.asf", tmp_path)
    with pytest.raises(SourceError, match=r"09\.asf .*10\.asf"):
        mcz.read(tmp_path / "05_01.amc")
    shutil.copy(data / "cmu/asf/05.asf", tmp_path)
    assert read(tmp_path / "05_01.amc")[1] == []


@pytest.mark.real
def test_a_real_skeleton_of_none_of_the_bones(data: Path, tmp_path: Path) -> None:
    shutil.copy(data / "cmu/amc/05_01.amc", tmp_path)
    shutil.copy(data / "other/endorphin/skeleton.asf", tmp_path)
    with pytest.raises(SourceError, match=r"skeleton\.asf \(which lacks lowerback"):
        mcz.read(tmp_path / "05_01.amc")
