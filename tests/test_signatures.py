"""The signatures for tools that know formats: of every vector, and of nothing else."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from conformance.manifest import VECTORS
from mcz.container.chunks import SIGNATURE

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "conformance" / "signatures"
SPEC = (ROOT / "SPEC.md").read_text("utf-8")
DROID = "{http://www.nationalarchives.gov.uk/pronom/SignatureFile}"
TYPE = "application/vnd.mcz"


def file(*words: object) -> str:
    program = shutil.which("file")
    if program is None:
        pytest.skip("no file(1) here")
    command = [program, "-b", "-m", FOLDER / "mcz.magic", *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_file_says_what_head_says(samples: Path, tmp_path: Path) -> None:
    sound = VECTORS / "valid/container/minimal.mcz"
    told = r"MCZ motion capture, version 1\.0, for readers of 1\.0, base profile"
    assert re.fullmatch(told, file(sound))
    newer = VECTORS / "uncommon/container/newer-minor.mcz"
    assert ", for readers of 1.255, base profile" in file(newer)
    assert file("--mime-type", sound) == TYPE
    assert file("--extension", sound) == "mcz"
    (tmp_path / "cut.mcz").write_bytes(sound.read_bytes()[:40])
    assert file(tmp_path / "cut.mcz").startswith("MCZ motion capture, version")
    (tmp_path / "hit.mcz").write_bytes(SIGNATURE + b"XEAD")
    assert file(tmp_path / "hit.mcz") == "MCZ motion capture, damaged"
    assert "MCZ" not in file(samples / "walk.bvh")
    assert file("-c", "-m", FOLDER / "mcz.magic") is not None  # its own syntax check


def test_the_signature_for_droid_is_ours() -> None:
    root = ET.parse(FOLDER / "mcz-droid.xml").getroot()
    (sequence,) = root.iter(f"{DROID}Sequence")
    assert bytes.fromhex(sequence.text or "") == SIGNATURE
    (part,) = root.iter(f"{DROID}SubSequence")
    assert (part.get("SubSeqMinOffset"), part.get("SubSeqMaxOffset")) == ("0", "0")
    shifts = {shift.get("Byte"): shift.text for shift in root.iter(f"{DROID}Shift")}
    last = {f"{byte:02X}": str(len(SIGNATURE) - at) for at, byte in enumerate(SIGNATURE)}
    assert shifts == last  # from the last occurrence of a byte to behind the end
    (format_,) = root.iter(f"{DROID}FileFormat")
    assert format_.get("MIMEType") == TYPE
    (extension,) = root.iter(f"{DROID}Extension")
    assert extension.text == "mcz"


def test_the_signature_for_fido_is_ours() -> None:
    root = ET.parse(FOLDER / "mcz-fido.xml").getroot()
    (regex,) = root.iter("regex")
    pattern = re.compile(regex.text or "", re.S)
    assert pattern.match((SIGNATURE + b"HEAD").decode("latin-1"))
    assert not pattern.match("x" + SIGNATURE.decode("latin-1"))
    assert [node.text for node in root.iter("mime")] == [TYPE]


def test_the_registry_says_the_same() -> None:
    rows = SPEC.partition("**Identification**")[2].partition("\n\n**")[0]
    assert f"`{TYPE}`" in rows
    assert "`.mcz`" in rows
    assert f"`{SIGNATURE.hex(' ').upper()}`" in rows
