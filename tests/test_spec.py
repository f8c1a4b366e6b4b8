"""SPEC.md agrees with the code: tables, headings, registries, the worked example."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mcz
from mcz.codecs import CODECS
from mcz.container import limits
from mcz.formats import FORMATS
from mcz.motion import CHANNEL_KINDS

ROOT = Path(__file__).parent.parent
SPEC = (ROOT / "SPEC.md").read_text()
HEADINGS = set(re.findall(r"^#+ (.+)$", SPEC, re.M))


def rows_under(heading: str) -> list[list[str]]:
    """The cells of the first table under ``heading``, its two head lines left out."""
    section = SPEC.split(f"# {heading}\n", 1)[1]
    lines = re.search(r"(?:^\|.*\n)+", section, re.M)
    assert lines is not None
    return [[c.strip() for c in row.strip("|").split("|")] for row in lines[0].splitlines()[2:]]


def test_field_tables_are_those_of_the_schemas() -> None:
    command = [sys.executable, str(ROOT / "tools/spec_tables.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_named_headings_exist() -> None:
    """Code refers to SPEC.md as: SPEC.md, "Heading"."""
    named = set()
    for path in (ROOT / "mcz").rglob("*.py"):
        for mention in re.findall(r"SPEC\.md,((?:\s+(?:and\s+)?\"[^\"{]+\",?)+)", path.read_text()):
            named |= {" ".join(h.split()) for h in re.findall(r'"([^"]+)"', mention)}
    assert named
    assert named <= HEADINGS, named - HEADINGS


def test_codec_registry() -> None:
    rows = [row for row in rows_under("Codecs") if row[0].isdigit()]
    found = {int(row[0]): (row[1], int(row[2]), row[3]) for row in rows}
    assert found == {c.id: (c.name, c.version, c.domain) for c in CODECS.values()}
    assert len({c.name for c in CODECS.values()}) == len(CODECS)
    for codec in CODECS.values():
        assert f"Codec {codec.id}: {codec.name}" in HEADINGS


def test_source_format_registry() -> None:
    found = re.findall(r"^\| (\d+) \| (\w+) \| ([.\w ]+) \| a (?:clip|skeleton) \|$", SPEC, re.M)
    assert found == [(str(f.id), f.name, " ".join(f.suffixes)) for f in FORMATS.values()]


def test_channel_kinds() -> None:
    kinds: list[str] = []
    for numbers, names in re.findall(r"^\| (\d+(?:, \d+)*) \| ([a-z ]+) \| ", SPEC, re.M):
        if not names.strip() or names.split()[0] not in CHANNEL_KINDS:
            continue
        kinds += names.split()
        assert [int(n) for n in numbers.split(", ")][-1] == len(kinds)
    assert tuple(kinds) == CHANNEL_KINDS


def number(text: str) -> int:
    text = text.replace(",", "")
    if "^" in text:
        return 2 ** int(text.split("^")[1])
    value, _, unit = text.partition(" ")
    return int(value) * {"": 1, "KiB": 2**10, "MiB": 2**20}[unit]


def test_profile_limits() -> None:
    table = {row[0]: row[1:] for row in rows_under("Limits and profiles")}
    fields = {
        "channels of a signal": "channels",
        "joints of a skeleton": "joints",
        "decoded bytes of a segment (8 a value)": "segment_bytes",
        "bytes of all models": "model_bytes",
        "bytes of a chunk's payload": "chunk_bytes",
        "bytes of a packet's body": "packet_bytes",
        "bytes of a template": "text_bytes",
    }
    assert set(table) == set(fields)
    for name, field in fields.items():
        assert number(table[name][0]) == getattr(limits.BASE, field), name
        assert number(table[name][1]) == getattr(limits.ARCHIVE, field), name


def test_worked_example_is_the_smallest_clip() -> None:
    """The hex dump is a file that the reader reads."""
    section = SPEC.split("## A worked example\n", 1)[1]
    dump = re.search(r"```hex\n(.*?)```", section, re.S)
    assert dump is not None
    digits = "".join(line.split("#")[0] for line in dump[1].splitlines())
    data = bytes.fromhex("".join(digits.split()))
    with mcz.open(data) as file:
        clip = file.clips["a"]
        assert clip.read().tolist() == [[1.5], [-2.0]]
        from mcz.files.report import validate

        assert validate(file) == []


def test_metadata_keys_of_the_code_are_registered() -> None:
    keys = set(re.findall(r"^\| `([a-z-]+)` \|", SPEC, re.M))
    used: set[str] = set()
    for path in (ROOT / "mcz").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Dict):
                used |= {
                    k.value
                    for k in node.keys
                    if isinstance(k, ast.Constant)
                    and isinstance(k.value, str)
                    and re.fullmatch(r"(frame|skeleton|name)s?-[a-z-]+", k.value)
                }
    assert used <= keys, used - keys


@pytest.mark.parametrize("word", ["TBD", "TODO", "see the code", "reference implementation"])
def test_spec_never_defers(word: str) -> None:
    assert word not in SPEC


@pytest.mark.parametrize("name", [f"{n}_start.json" for n in ("lossless", "pca", "qbc", "wavelet")])
def test_annex_is_what_the_package_ships_and_the_text_names(name: str) -> None:
    import hashlib

    data = (ROOT / "conformance/annex" / name).read_bytes()
    assert data == (ROOT / "mcz/codecs" / name).read_bytes()
    assert hashlib.sha256(data).hexdigest() in SPEC


def test_wavelets_of_the_text_and_the_annex_are_those_of_the_package() -> None:
    from mcz.transforms.wavelets import IDS, WAVELETS

    annex = json.loads((ROOT / "conformance/annex/wavelets.json").read_text())
    found = {n: {"id": IDS[n], "lo": list(w.lo), "hi": list(w.hi)} for n, w in WAVELETS.items()}
    assert annex == found
    rows = [(int(row[0]), row[1], int(row[2])) for row in rows_under("Wavelets")]
    assert rows == [(IDS[name], name, w.n_taps) for name, w in WAVELETS.items()]
    text = SPEC.split("### Wavelets")[1].split("```")[1]
    printed = [float(word) for word in text.split() if word[0] in "-.0123456789"]
    derived = [w.lo if name != "bior4.4" else (*w.lo, *w.hi) for name, w in WAVELETS.items()]
    assert printed == [tap for taps in derived for tap in taps]
