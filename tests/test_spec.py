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
from tests.broken import find
from tools import requirements

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "SPEC.md").read_text()
SPEC = re.sub(r" \[[A-Z][A-Z0-9]+-\d\d\]", "", TEXT)  # without the ids of rules
HEADINGS = set(re.findall(r"^#+ (.+)$", SPEC, re.M))


def rows_under(heading: str, text: str = SPEC) -> list[list[str]]:
    """The cells of the first table under ``heading``, its two head lines left out."""
    section = text.split(f"# {heading}\n", 1)[1]
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


def test_named_readmes_exist() -> None:
    """Code refers to what an encoder chooses as: mcz/codecs/FAMILY/README.md."""
    named = set()
    for path in (ROOT / "mcz").rglob("*.py"):
        named |= set(re.findall(r"\bmcz/[\w/]+/README\.md", path.read_text()))
    assert named == {str(path.relative_to(ROOT)) for path in (ROOT / "mcz").rglob("README.md")}


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
        from mcz.files.reading.faults import validate

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


def test_annexes_are_there_once() -> None:
    from mcz.model.extras import FOLDER

    assert (ROOT / "conformance/annex").resolve() == FOLDER.resolve()


def test_wavelets_of_the_text_are_those_of_the_package() -> None:
    """Their taps are read from the annex; tests/test_wavelets.py compares them with PyWavelets."""
    from mcz.codecs.transforms.wavelets import IDS, WAVELETS

    assert list(IDS.values()) == list(range(1, len(WAVELETS) + 1))
    rows = [(int(row[0]), row[1], int(row[2])) for row in rows_under("Wavelets")]
    assert rows == [(IDS[name], name, w.n_taps) for name, w in WAVELETS.items()]


def test_ids_of_rules() -> None:
    """Unique, in order within their section, and one behind every MUST and SHOULD."""
    assert requirements.faults(TEXT) == []
    rules = requirements.rules(TEXT)
    assert len(rules) > 400
    assert all(rule.words and "[" + rule.id + "]" in TEXT for rule in rules)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("A MUST [AB-01]. B MUST [AB-01].", "AB-01 stands twice"),
        ("A MUST [AB-02]. B MUST [AB-01].", "Heading: AB has ids in the order [2, 1]"),
        ("A MUST [AB-02].", "AB: no first id"),
        ("A MUST [AB-01]. B SHOULD\nNOT be.", "Heading, line 1: SHOULD\nNOT without an id"),
        ("\nA MUST be, B MUST [AB-01].", "Heading, line 2: MUST without an id"),
        ("A MUST [AB-1], B [AB-01].", "Heading: [AB-1] is no id"),
        ("A MUST [Ab-01], B [AB-01].", "Heading: [Ab-01] is no id"),
        ("A MUST [AB-001], B [AB-01].", "Heading: [AB-001] is no id"),
    ],
)
def test_faults_of_ids_are_found(text: str, fault: str) -> None:
    assert fault in requirements.faults(f"# Title\n\nMUST is a word.\n\n## Heading\n{text}\n")


def test_ids_end_their_sentences_and_lines_are_short() -> None:
    prose = "".join(TEXT.split("```")[::2])
    ends = re.findall(r"(?<!`)\[[A-Z][A-Z0-9]+-\d\d\](.{2})", prose, re.S)
    assert [end for end in ends if end[0] not in ".:;" and end != " |"] == []
    long = [line for line in TEXT.splitlines() if len(line) > 110]
    assert all(line.startswith("|") for line in long)
    assert len(long) <= 27  # rows with hashes, and rows of the registry


def test_contents_lead_to_all_sections() -> None:
    listed, rest = TEXT.split("<!-- contents -->\n")[1].split("<!-- end of contents -->\n")
    links = re.findall(r"\[(.+?)\]\(#(.+?)\)", listed)
    prose = "".join(rest.split("```")[::2])
    assert [heading for heading, _ in links] == re.findall(r"^##? (.+)$", prose, re.M)
    assert len({anchor for _, anchor in links}) == len(links)
    assert ("Codec 0: raw", "codec-0-raw") in links


def test_rules_have_their_own_words() -> None:
    text = (
        "# Title\n\nA MUST [XX-01] of the head is none.\n\n## One\n\n"
        "A reader MUST read a [AB-01], b [AB-02] and MUST NOT\nread c [AB-03], as `[AB-09]` says. "
        "It SHOULD do so [AB-04]:\n\n```\nx = 1\nrefuse if x > 2  [AB-05]\n```\n\n### Two\n\n"
        "It MUST refuse\n\n- d [AB-06];\n- e [AB-07].\n"
    )
    assert [(r.id, r.level, r.heading, r.words) for r in requirements.rules(text)] == [
        ("AB-01", "MUST", "One", "A reader MUST read a"),
        ("AB-02", "MUST", "One", "... b"),
        ("AB-03", "MUST NOT", "One", "... and MUST NOT read c, as `[AB-09]` says."),
        ("AB-04", "SHOULD", "One", "It SHOULD do so:"),
        ("AB-05", "MUST", "One", "refuse if x > 2"),
        ("AB-06", "MUST", "Two", "d"),
        ("AB-07", "MUST", "Two", "e."),
    ]


def test_rules_that_nothing_shows_are_missed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = requirements.rules(TEXT)
    binding = [rule.id for rule in rules if rule.binds]
    named = {id_: ["valid/a.mcz"] for id_ in binding[2:]}
    monkeypatch.setattr(requirements, "vectors_of", lambda manifest: named)
    monkeypatch.setattr(requirements, "ARGUED", {binding[0]: "because"})
    assert requirements.main(["--json", "--uncovered"]) == 1
    printed = capsys.readouterr()
    shown = {row["id"]: row for row in json.loads(printed.out)}
    assert shown.keys() == {*binding[:2], *(rule.id for rule in rules if not rule.binds)}
    assert (shown[binding[0]]["argued"], shown[binding[0]]["vectors"]) == ("because", [])
    assert printed.err.endswith("1 argued, 1 with neither\n")
    named[binding[1]] = ["valid/b.mcz"]
    assert requirements.main(["--section", binding[1].partition("-")[0]]) == 0
    assert "1 vectors: valid/b.mcz" in capsys.readouterr().out
    named["XX-01"] = ["valid/c.mcz"]
    assert requirements.main([]) == 1
    assert "XX-01: no such rule" in capsys.readouterr().err


def test_every_rule_is_shown_by_a_vector_or_argued(capsys: pytest.CaptureFixture[str]) -> None:
    assert requirements.main(["--uncovered"]) == 0, capsys.readouterr().out


def test_four_of_five_rules_are_shown_by_a_decoder_that_breaks_them() -> None:
    binding = {rule.id for rule in requirements.rules(TEXT) if rule.binds}
    broken = {rule for rule, catches in find.read_catches().items() if catches}
    assert broken <= {rule.id for rule in requirements.rules(TEXT)}
    assert len(broken & binding) >= 0.8 * len(binding)
