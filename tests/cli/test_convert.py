"""``mcz convert``, and ``mcz decode`` of a source file: what two commands do, in one step."""

from __future__ import annotations

import json
from itertools import permutations
from pathlib import Path

import pytest

import mcz
from tests.commands import Call

UNITS = ["--unit", "cm"]


TO_OTHERS = (".csv", ".npz", ".trc", ".sto", ".mot", ".glb", ".usda", ".c3d")
PAIRS = [
    *((".bvh", to) for to in (*TO_OTHERS, ".amc")),
    *((".amc", to) for to in (*TO_OTHERS, ".bvh")),
    *((".c3d", to) for to in TO_OTHERS if to != ".c3d"),
    *permutations((".trc", ".sto", ".csv"), 2),  # numbers alone become no markers: refused alike
]


@pytest.mark.parametrize(("origin", "to"), PAIRS)
def test_one_step_is_two(folder: Path, call: Call, origin: str, to: str) -> None:
    """Each pair of formats: the bytes are those of encode and decode, nothing else is written."""
    source = folder / f"walk{origin}"
    facts = [*UNITS, "--rate", "120"]
    if not source.exists():
        assert call("convert", folder / "walk.bvh", source, *facts)[0] == 0
    before = set(folder.iterdir())
    one, out, err = call("convert", source, folder / f"one{to}", *facts, "--json")
    new = set(folder.iterdir()) - before
    assert call("encode", source, *facts, "-o", folder / "two.mcz")[0] == 0
    two, out2, err2 = call("decode", folder / "two.mcz", "-o", folder / f"two{to}", "--json")
    assert one == two
    if one:
        assert (
            not new
            and "channels are plain scalars, which do not move joints" in err
            and "channels are plain scalars, which do not move joints" in err2
        )
        return
    (output,) = json.loads(out)["outputs"]
    assert output["result"] == "converted" and new == {folder / f"one{to}"}
    assert json.loads(out).get("left_out") == json.loads(out2).get("left_out")
    assert (folder / f"one{to}").read_bytes() == (folder / f"two{to}").read_bytes()


def test_a_unit_that_a_format_needs_is_asked_for(folder: Path, call: Call) -> None:
    code, _, errors = call("convert", folder / "walk.bvh", folder / "x.trc")
    assert code == 1 and "TRC needs a length unit of mm, cm or m; set the unit (--unit)" in errors


def test_what_is_left_out_is_said(folder: Path, call: Call) -> None:
    code, out, err = call("convert", folder / "walk.c3d", folder / "x.trc")
    size = (folder / "x.trc").stat().st_size
    assert (code, out) == (0, f"{folder / 'x.trc'}  {size:,} bytes, converted\n")
    assert "left out: signal residuals" in err
    assert call("decode", folder / "walk.c3d", "-o", folder / "y.trc")[2] == err
    assert (folder / "x.trc").read_bytes() == (folder / "y.trc").read_bytes()


@pytest.mark.parametrize("to", ["bvh", "amc", "c3d", "trc", "sto", "mot", "glb", "usda", "csv"])
def test_columns_and_signals_that_are_lost_are_said(tmp_path: Path, call: Call, to: str) -> None:
    """In one step or two, in words and in JSON, whatever the target."""
    head = "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ,State"
    text = (
        f"Objects\n100\n,,A:A,,,,,,,\n{head}\n,,,,,,mm,mm,mm,\n"
        "1,0,0,0,0,1,1,2,3,up\n2,0,0,0,0.6,0.8,1,2,4,down\n\n"
        "Devices\n200\n,,Amp\nFrame,Sub Frame,EMG\n,,V\n1,0,1\n1,1,2\n2,0,3\n2,1,4\n"
    )
    (tmp_path / "a.csv").write_text(text)
    assert call("encode", tmp_path / "a.csv")[0] == 0
    up = ["--up", "z"] if to in ("c3d", "glb", "usda") else []
    for verb, source in (("convert", "a.csv"), ("decode", "a.mcz")):
        words = [verb, tmp_path / source, "--to", to, "-o", tmp_path / f"x.{to}", "--force", *up]
        if verb == "convert":
            words = [verb, tmp_path / source, tmp_path / f"x.{to}", "--force", *up]
        if to == "csv" and verb == "convert":
            continue  # the same format: restored
        code, out, err = call(*words)
        assert code == 0 and "converted" in out
        document = json.loads(call(*words, "--json")[1])["left_out"]["a"]
        for lost in ("left out: signal Devices", "left out: columns of text: A:A.State"):
            assert err.count(lost) == 1 and any(line.startswith(lost) for line in document)


def test_a_plain_c3d_names_the_groups_that_it_has_not(folder: Path, call: Call) -> None:
    data = (folder / "walk.c3d").read_bytes()
    assert data.count(b"FORCE_PLATFORM") == 1
    (folder / "made.c3d").write_bytes(data.replace(b"FORCE_PLATFORM", b"MANUFACTURERS_"))
    assert call("encode", folder / "made.c3d")[0] == 0
    to = ("--to", "c3d", "-o", folder / "x.c3d")
    err = call("decode", folder / "made.mcz", *to)[2]
    assert "left out: parameters of MANUFACTURERS_" in err


def test_the_skeleton_is_an_input(folder: Path, call: Call) -> None:
    """Forcing never overwrites a file that was read for a source, its ASF included."""
    data = (folder / "walk.asf").read_bytes()
    words = ["--to", "amc", "--with-skeleton", "--rate", "120", "--force"]
    for given in ([], ["--skeleton", folder / "walk.asf"]):
        code, _, err = call("convert", folder / "walk.amc", folder / "x.amc", *words, *given)
        assert code == 2 and "walk.asf: the output is the input itself" in err
    assert (folder / "walk.asf").read_bytes() == data and not (folder / "x.amc").exists()


def test_to_and_from_mcz(folder: Path, call: Call) -> None:
    assert call("convert", folder / "walk.bvh", folder / "w.mcz", *UNITS)[0] == 0
    assert mcz.read(folder / "w.mcz").skeleton.unit_cm == 1
    assert call("convert", folder / "w.mcz", folder / "w.trc")[0] == 0
    assert call("convert", folder / "w.mcz", folder / "again.bvh")[1].endswith(", restored\n")
    assert (folder / "again.bvh").read_bytes() == (folder / "walk.bvh").read_bytes()
    refused = {
        ("w.mcz", "v.mcz"): "use mcz extract for clips of an .mcz",
        ("walk.bvh", "v.mcz", "--frames", "0:9"): "cut it with mcz extract",
        ("w.mcz", "v.csv", "--skeleton", "none"): "need a source file",
        ("walk.bvh", "v"): "use --to",
        ("walk.bvh", "v.trcc"): "did you mean .trc?",
    }
    for (name, output, *words), text in refused.items():
        code, _, err = call("convert", folder / name, folder / output, *words)
        assert code == 2 and text in err and err.count("\n") == 1
    assert not list(folder.glob("v*"))


def test_a_part_in_its_own_format(folder: Path, call: Call) -> None:
    out = call("convert", folder / "walk.amc", folder / "cut.amc", "--frames", "10:20")[1]
    assert out.endswith(" bytes, cut\n")
    assert mcz.read(folder / "cut.amc", skeleton="none").n_frames == 10
    out = call("convert", folder / "walk.amc", folder / "copy.amc")[1]
    assert out.endswith(" bytes, restored\n")
    assert (folder / "copy.amc").read_bytes() == (folder / "walk.amc").read_bytes()


def test_decode_of_a_source_wants_an_output(folder: Path, call: Call) -> None:
    code, _, err = call("decode", folder / "walk.bvh", "--force")
    assert code == 2 and "a source file, not an .mcz" in err
    code, _, err = call("decode", folder / "walk.bvh", "-o", folder / "x.csv", "--salvage")
    assert code == 2 and "need an .mcz" in err
    assert call("decode", folder / "walk.bvh", "--to", "csv")[0] == 0
    assert (folder / "walk.csv").exists()


def test_an_mcz_file_of_another_name(folder: Path, call: Call) -> None:
    """An .mcz file is recognized under any name."""
    mcz.encode(folder / "walk.c3d", folder / "w.mcz")
    (folder / "w.mcz").rename(folder / "w.bvh")
    assert mcz.read(folder / "w.bvh").n_frames == 240
    out = call("decode", folder / "w.bvh", "-o", folder / "again.c3d")[1]
    assert out.endswith(", restored\n")
    assert json.loads(call("info", folder / "w.bvh", "--json")[1])["file_bytes"] > 0
    code, out, _ = call("diff", folder / "w.bvh", folder / "walk.c3d", "--json")
    assert code == 0 and json.loads(out)["clips"][0]["mse_raw"] == 0
