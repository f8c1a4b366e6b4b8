"""Files of a release: one version, placeholders in one list, the archive of the specification."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import mcz
from tools import make_vectors
from tools.figures import __main__ as figures
from tools.figures.table import names_in, replaced
from tools.vectors.build.files import Vector

ROOT = Path(__file__).parents[1]
REGISTRATIONS = ROOT / "conformance" / "registrations" / "README.md"


def test_every_file_states_the_version() -> None:
    versions = {
        name: re.search(pattern, (ROOT / name).read_text("utf-8"))
        for name, pattern in {
            "pyproject.toml": r'(?m)^version = "(.*)"',
            "CITATION.cff": r"(?m)^version: (.*)",
            "tools/js/package.json": r'"version": "(.*)"',
            "tools/viewer/package.json": r'"version": "(.*)"',
        }.items()
    }
    assert {name: found and found[1] for name, found in versions.items()} == dict.fromkeys(
        versions, mcz.__version__
    )
    assert json.loads((ROOT / ".zenodo.json").read_text("utf-8"))["title"]


@pytest.mark.parametrize("placeholder", ["https://mcz.invalid", "contact@mcz.invalid"])
def test_placeholders_are_listed(placeholder: str) -> None:
    found = subprocess.run(
        ["git", "grep", "-lF", placeholder], cwd=ROOT, check=True, capture_output=True, text=True
    )
    row = next(
        line
        for line in REGISTRATIONS.read_text("utf-8").splitlines()
        if line.startswith(f"| `{placeholder}`")
    )
    own = {"tests/test_release.py", REGISTRATIONS.relative_to(ROOT).as_posix()}
    listed = set(re.findall(r"`([^`]+)`", row)) - {placeholder}
    assert listed == set(found.stdout.split()) - own


def test_frozen_vectors() -> None:
    """SPEC.md states the hash of their list; each file is there as it was."""
    sums = (ROOT / "conformance" / "SHA256SUMS").read_bytes()
    assert f"`{hashlib.sha256(sums).hexdigest()}`" in (ROOT / "SPEC.md").read_text("utf-8")
    for path, digest in make_vectors.frozen().items():
        data = (ROOT / "conformance" / path).read_bytes()
        assert hashlib.sha256(data).hexdigest() == digest, path


def test_frozen_vectors_stay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Later encoders neither change nor remove them; other vectors follow the encoder."""
    monkeypatch.setattr(make_vectors, "CONFORMANCE", tmp_path)

    def make(*names: str, data: bytes) -> None:
        made = [Vector(f"valid/{name}", (), "p", data, exit=(1,)) for name in names]
        monkeypatch.setattr(make_vectors, "vectors", lambda: made)

    def stored() -> dict[str, bytes]:
        return {path.stem: path.read_bytes() for path in tmp_path.rglob("*.mcz")}

    monkeypatch.setattr(make_vectors, "requirements", lambda names: dict.fromkeys(names, ()))
    make("a", "b", data=b"1")
    assert make_vectors.main(["--freeze"]) == 0
    listed = (tmp_path / "SHA256SUMS").read_bytes()
    make("b", "c", data=b"2")
    assert make_vectors.main(["--check"]) == 1
    assert make_vectors.main([]) == 0 and make_vectors.main(["--check"]) == 0
    assert stored() == {"a": b"1", "b": b"1", "c": b"2"}
    make("b", data=b"3")
    assert make_vectors.main([]) == 0
    assert stored() == {"a": b"1", "b": b"1"}
    assert (tmp_path / "SHA256SUMS").read_bytes() == listed
    (tmp_path / "vectors" / "valid" / "a.mcz").unlink()
    with pytest.raises(SystemExit, match="vectors/valid/a.mcz is frozen, but it was changed"):
        make_vectors.main([])


def test_archive_of_the_specification(tmp_path: Path) -> None:
    """It is the same each time, whole, and has hashes of its members."""
    script = ROOT / "tools" / "spec_archive.py"
    archives = []
    for folder in (tmp_path / "1", tmp_path / "2"):
        subprocess.run([sys.executable, script, folder], check=True, capture_output=True)
        (path,) = folder.iterdir()
        archives.append(path.read_bytes())
    assert archives[0] == archives[1]
    with zipfile.ZipFile(path) as archive:
        top = path.stem + "/"
        contents = {name.removeprefix(top): archive.read(name) for name in archive.namelist()}
    sums = dict(
        reversed(line.split("  ", 1)) for line in contents.pop("SHA256SUMS").decode().splitlines()
    )
    assert sums == {name: hashlib.sha256(data).hexdigest() for name, data in contents.items()}
    assert contents["SPEC.md"] == (ROOT / "SPEC.md").read_bytes()
    for part in ("annex", "vectors"):
        files = [p for p in (ROOT / "conformance" / part).rglob("*") if p.is_file()]
        assert {p.relative_to(ROOT).as_posix() for p in files} <= contents.keys()


def test_marks_of_figures() -> None:
    """Each mark stands above a table that ``tools.figures`` can replace, and stands once."""
    names = [name for path in figures.DOCUMENTS for name in names_in(path.read_text("utf-8"))]
    marks = [
        re.findall("(?m)^<!-- figures: ", path.read_text("utf-8")) for path in figures.DOCUMENTS
    ]
    assert len(names) == len(set(names)) == sum(map(len, marks))
    before = "<!-- figures: a -->\n| x |\n|---|\n| 1 |\n\n<!-- figures: b -->\n| y |\n"
    assert replaced(before, {"a": "| z |\n"}) == (
        "<!-- figures: a -->\n| z |\n\n<!-- figures: b -->\n| y |\n"
    )
