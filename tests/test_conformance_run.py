"""The runner, on a suite of its own: decoders and encoders that go wrong, each in one way.

A vector here is a JSON text that says what a decoder must answer, so that an honest decoder is a
few lines and a dishonest one a line more.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest

from conformance import manifest, run
from conformance.child import Limits
from conformance.manifest import Capabilities, select

HERE = Path(run.__file__).parent
ROOT = HERE.parent
BVH, ASF, AMC = b"HIERARCHY", b":root", b":FULLY-SPECIFIED"


def rows_of(*arrays: tuple[str, bytes]) -> list[dict[str, Any]]:
    return [
        {
            "clip": "walk",
            "signal": name,
            "array": "values",
            "dtype": "u1",
            "shape": [len(data), 1],
            "bytes": len(data),
            "sha256": hashlib.sha256(data).hexdigest(),
        }
        for name, data in arrays
    ]


def sources_of(*files: tuple[str, bytes]) -> list[dict[str, Any]]:
    return [
        {"path": path, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        for path, data in files
    ]


def vector_content(code: int, **answers: tuple[list[dict[str, Any]], bytes]) -> dict[str, Any]:
    """The content of a vector: exit code, and for each kind of request rows and bytes."""
    plain = {
        key: {"rows": [{k: v for k, v in row.items() if k != "sha256"} for row in rows]}
        | {"body": body.hex()}
        for key, (rows, body) in answers.items()
    }
    return {"exit": code, **plain}


ARRAYS = rows_of(("motion", b"abcdef"), ("analog", b"ghi"))
PART = rows_of(("motion", b"bc"))
FILES = sources_of(("walk.amc", AMC), ("walk.asf", ASF))
VECTORS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "valid/raw/plain": (
        {
            "exit": [0],
            "codecs": ["raw"],
            "requirements": ["RAW-01", "RAW-02"],
            "expected": {"arrays": ARRAYS},
            "parts": [{"arguments": ["--frames", "1:3"], "arrays": PART}],
        },
        vector_content(0, arrays=(ARRAYS, b"abcdefghi"), frames=(PART, b"bc")),
    ),
    "valid/mrdwt/plain": (
        {"exit": [0], "codecs": ["mrdwt"], "since": "0.9", "expected": {"arrays": PART}},
        vector_content(0, arrays=(PART, b"bc")),
    ),
    "valid/sources/bvh": (
        {
            "exit": [0],
            "codecs": [],
            "modes": ["arrays", "sources"],
            "expected": {"arrays": PART, "sources": sources_of(("walk.bvh", BVH))},
        },
        vector_content(0, arrays=(PART, b"bc"), sources=(sources_of(("walk.bvh", BVH)), BVH)),
    ),
    "valid/sources/amc": (
        {"exit": [0], "codecs": [], "modes": ["sources"], "expected": {"sources": FILES}},
        vector_content(0, sources=(FILES, AMC + ASF)),
    ),
    "uncommon/raw/newer": (
        {"exit": [3], "codecs": [], "expected": {"refusal": "unsupported"}},
        vector_content(3),
    ),
    "invalid/raw/bad": (
        {
            "exit": [1],
            "codecs": ["raw"],
            "requirements": ["RAW-02"],
            "effect": "silent loss",
            "expected": {"refusal": "invalid"},
        },
        vector_content(1, arrays=([], b"")),
    ),
}

DECODER = """
import json, mmap, os, signal, sys, time
ARRAYS = {declared!r}

def answer(data, words):
    told = json.loads(data)
    key = "sources" if "--source" in words else "frames" if "--frames" in words else "arrays"
    code, rest = told["exit"], told.get(key, {{"rows": [], "body": ""}})
    listing, rows, body = "sources" if key == "sources" else "arrays", rest["rows"], rest["body"]
    body = bytes.fromhex(body)
    {edit}
    line = json.dumps({{listing: rows}}).encode() + b"\\n"
    return code, line + body if code == 0 else b""

def serve(one, two):
    while line := one.readline():
        request = json.loads(line)
        code, output = answer(one.read(request["bytes"]), request["arguments"])
        two.write(json.dumps({{"exit": code, "bytes": len(output)}}).encode() + b"\\n" + output)
        two.flush()
    return 0

words = sys.argv[1:]
if "--capabilities" in words:
    sys.exit(print(json.dumps(ARRAYS)))
if "--serve" in words:
    sys.exit(serve(sys.stdin.buffer, sys.stdout.buffer))
code, output = answer(sys.stdin.buffer.read(), words)
sys.stdout.buffer.write(output)
sys.exit(code)
"""
EVERYTHING = {"options": ["--frames", "--serve"]}


@pytest.fixture(autouse=True)
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder like conformance/, which the runner then takes for its own."""
    home = tmp_path / "conformance"
    rows = []
    for name, (fields, content) in VECTORS.items():
        path = home / "vectors" / f"{name}.mcz"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content))
        row = {"file": f"{name}.mcz", "group": name.partition("/")[0], "purpose": "One."}
        rows.append(row | {"modes": ["arrays"]} | fields)
    (home / "manifest.json").write_text(json.dumps({"format_version": "0.9", "vectors": rows}))
    monkeypatch.setattr(manifest, "HERE", home)
    monkeypatch.setattr(manifest, "VECTORS", home / "vectors")
    return home


def script(folder: Path, text: str, name: str = "decoder.py") -> str:
    """The command that runs a Python program."""
    path = folder / name
    path.write_text(text)
    return f"{sys.executable} -S -E {path}"


def decoder(folder: Path, edit: str = "", declared: dict[str, Any] | None = None) -> str:
    given = EVERYTHING if declared is None else declared
    return script(folder, DECODER.format(edit=edit or "pass", declared=given))


RUNNER = """
import sys
from pathlib import Path
from conformance import manifest, run

manifest.HERE = Path(sys.argv[1])
manifest.VECTORS = manifest.HERE / "vectors"
ballast = b"x" * int(sys.argv[2])
sys.exit(run.main(sys.argv[3:]))
"""


def result(*arguments: str, ballast: int = 0) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON document of a run in a process of its own, small as the command's is."""
    done = subprocess.run(
        [sys.executable, "-c", RUNNER, str(manifest.HERE), str(ballast), *arguments, "--json"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        check=False,
    )
    document: dict[str, Any] = json.loads(done.stdout)
    return done.returncode, document


def kinds(document: dict[str, Any]) -> dict[str, set[str]]:
    """The names of the faults of each vector that has some."""
    return {
        row["file"].removesuffix(".mcz"): {fault["kind"] for fault in row["faults"]}
        for row in document["vectors"]
        if not row["passed"]
    }


# Decoders


@pytest.mark.parametrize("serve", [[], ["--serve"]], ids=["processes", "served"])
def test_an_honest_decoder_passes(tmp_path: Path, serve: list[str]) -> None:
    code, document = result("--decoder", decoder(tmp_path), *serve)
    assert (code, kinds(document)) == (0, {})
    assert document["badge"] == "MCZ 0.9 conformance: 6/6 full decoder"
    assert document["tables"]["group"]["valid"] == {"passed": 4}
    assert document["requirements"]["RAW-02"]["passed"] == [
        "valid/raw/plain.mcz",
        "invalid/raw/bad.mcz",
    ]


IS_PLAIN = "if key == 'arrays' and len(rows) == 2:"
WRONG = {
    "hangs": (f"{IS_PLAIN} time.sleep(60)", "hang"),
    "allocates": (f"{IS_PLAIN} bytearray(2**31)", "memory"),
    "fills shared memory": (
        f"{IS_PLAIN} m = mmap.mmap(-1, 2**28); [m.write(bytes(2**20)) for _ in range(256)]",
        "memory",
    ),
    "crashes": (f"{IS_PLAIN} os.kill(os.getpid(), signal.SIGSEGV)", "crash (signal 11)"),
    "raises": (f"{IS_PLAIN} code = told['missing']", "crash (uncaught exception)"),
    "writes on": (f"{IS_PLAIN} body = bytes(2**26)", "output too long"),
    "flips a bit": (f"{IS_PLAIN} body = b'b' + body[1:]", "wrong values"),
    "swaps arrays": (f"{IS_PLAIN} rows = rows[::-1]; body = body[6:] + body[:6]", "wrong order"),
    "loses an array": (f"{IS_PLAIN} rows = rows[:1]; body = body[:6]", "wrong listing"),
    "turns an array": (f"{IS_PLAIN} rows[0]['shape'].reverse()", "wrong listing"),
    "lists too little": (f"{IS_PLAIN} rows = rows[:1]", "bad listing"),
    "lists no rows": (f"{IS_PLAIN} rows = 3", "bad listing"),
    "lists without end": (f"{IS_PLAIN} rows[0]['bytes'] = float('inf')", "bad listing"),
    "lists half a byte": (f"{IS_PLAIN} rows[0]['bytes'] += 0.5", "bad listing"),
    "refuses": (f"{IS_PLAIN} code = 1", "wrongly refused"),
    "has not": (f"{IS_PLAIN} code = 3", "called unsupported"),
    "exits with 7": (f"{IS_PLAIN} code = 7", "bad exit code"),
}


@pytest.mark.parametrize("serve", [[], ["--serve"]], ids=["processes", "served"])
@pytest.mark.parametrize("fault", WRONG)
def test_a_fault_has_a_name(tmp_path: Path, fault: str, serve: list[str]) -> None:
    edit, kind = WRONG[fault]
    limits = ["--timeout", "5" if fault == "hangs" else "60", "--memory", "200", "--jobs", "2"]
    command = decoder(tmp_path, edit)
    code, document = result("--decoder", command, "--only", "raw", *limits, *serve)
    assert code == 1
    assert kinds(document) == {"valid/raw/plain": {kind}}  # the others are as they were


@pytest.mark.parametrize("serve", [[], ["--serve"]], ids=["processes", "served"])
def test_a_large_runner_accuses_nobody(tmp_path: Path, serve: list[str]) -> None:
    """The runner's own memory is not counted as its decoder's."""
    limits = ["--memory", "100", "--jobs", "2"]
    code, document = result("--decoder", decoder(tmp_path), *limits, *serve, ballast=2**28)
    assert (code, kinds(document)) == (0, {})


def test_what_is_accepted_is_named_with_its_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run.main(["--decoder", decoder(tmp_path, "code = 0")])
    shown = capsys.readouterr().out
    assert code == 1
    assert "FAIL invalid/raw/bad.mcz: accepted: exit 0, expected 1; effect: silent loss" in shown
    assert "FAIL uncommon/raw/newer.mcz: accepted: exit 0, expected 3" in shown
    assert "  RAW-02 broken: invalid/raw/bad\n" in shown
    assert shown.endswith("4 passed, 2 failed\nMCZ 0.9 conformance: 4/6 full decoder\n")


def test_too_much_on_standard_error(tmp_path: Path) -> None:
    command = decoder(tmp_path, f"{IS_PLAIN} sys.stderr.write('x' * 2**26)")
    _, document = result("--decoder", command, "--only", "valid/raw")
    assert kinds(document) == {"valid/raw/plain": {"output too long"}}


def test_what_a_decoder_started_ends_with_it(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    edit = f"os.fork(); held = open({str(pipe)!r}, 'wb', 0); time.sleep(20); held.write(b'x')"
    options = ["--timeout", "2", "--only", "valid/mrdwt"]
    code, document = result("--decoder", decoder(tmp_path, edit), *options)
    assert (code, kinds(document)) == (1, {"valid/mrdwt/plain": {"hang"}})
    os.set_blocking(reader, True)
    assert os.read(reader, 1) == b""  # all that held it are gone, and none got so far as to write
    os.close(reader)


LINES = {
    "crash (exit 0)": "sys.exit(0)",
    "crash (exit 4)": "sys.exit(4)",
    "bad answer": "two.write(b'hello\\n')",
    "output too long": 'two.write(b\'{{"exit": 0, "bytes": 99999999}}\\n\')',
    "hang": "time.sleep(60)",
}


@pytest.mark.parametrize("kind", LINES)
def test_a_server_that_does_not_answer(tmp_path: Path, kind: str) -> None:
    text = DECODER.replace("code, output = answer(one", f"{LINES[kind]}; code, output = answer(one")
    command = script(tmp_path, text.format(edit="pass", declared=EVERYTHING))
    options = ["--serve", "--only", "valid/mrdwt", "--timeout", "3"]
    code, document = result("--decoder", command, *options)
    assert (code, kinds(document)) == (1, {"valid/mrdwt/plain": {kind}})


def test_serving_must_be_declared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = decoder(tmp_path, declared={"options": ["--frames"]})
    assert run.main(["--decoder", command, "--serve"]) == 2
    assert "does not list it" in capsys.readouterr().err


# Partial decoders


def test_a_partial_decoder_is_judged_on_what_it_has(tmp_path: Path) -> None:
    declared = {"codecs": ["raw"], "sources": ["bvh"]}
    command = decoder(tmp_path, "if rows == [] and code == 0: code = 3", declared)
    junit, badge = tmp_path / "junit.xml", tmp_path / "badge.json"
    files = ["--junit", str(junit), "--badge", str(badge)]
    code, document = result("--decoder", command, *files)
    assert (code, kinds(document)) == (0, {})
    assert document["not_asked_vectors"] == [
        {"file": "valid/mrdwt/plain.mcz", "lacks": ["codec mrdwt"]},
        {"file": "valid/sources/amc.mcz", "lacks": ["source amc", "source asf"]},
    ]
    lacks = {row["file"]: row["lacks"] for row in document["vectors"]}
    assert lacks["valid/raw/plain.mcz"] == ["--frames"]
    summary = "core, sources of bvh: 4/4, 2 not asked"
    assert (document["passed"], document["failed"], document["not_asked"]) == (4, 0, 2)
    assert document["badge"] == f"MCZ 0.9 conformance: {summary}"
    assert json.loads(badge.read_text()) == {
        "schemaVersion": 1,
        "label": "MCZ 0.9 conformance",
        "message": summary,
        "color": "blue",
    }
    suites = {s.get("name"): s for s in Xml.parse(junit).getroot()}
    assert suites["conformance.valid"].get("skipped") == "2"
    assert len(suites["conformance.valid"].findall("testcase/skipped")) == 2


@pytest.mark.parametrize(
    ("declared", "passed", "message"),
    [
        ({"codecs": [], "sources": []}, 2, "container, no sources: 2/2, 4 not asked"),
        ({"codecs": ["mrdwt"]}, 4, "container + mrdwt: 4/4, 2 not asked"),
        ({"codecs": ["raw", "mrdwt", "qbc"]}, 6, "6/6 full decoder"),
        ({"format": "0.8"}, 5, "all codecs: 5/5, 1 not asked"),
        ({}, 6, "6/6 full decoder"),
    ],
)
def test_declarations(
    tmp_path: Path,
    declared: dict[str, Any],
    passed: int,
    message: str,
) -> None:
    code, document = result("--decoder", decoder(tmp_path, declared=declared))
    assert (code, document["passed"]) == (0, passed)
    assert document["badge"] == f"MCZ 0.9 conformance: {message}"
    assert bool(document["remarks"]) == ("qbc" in declared.get("codecs", []))


def test_without_sources(tmp_path: Path) -> None:
    code, document = result("--decoder", decoder(tmp_path), "--arrays-only")
    assert (code, document["passed"], document["not_asked"]) == (0, 5, 1)
    assert "all codecs, no sources: 5/5" in document["badge"]


@pytest.mark.parametrize(
    "line",
    [
        b"[]",
        b'{"codecs": "raw"}',
        b'{"sources": ["fbx"]}',
        b'{"format": "new"}',
        b'{"format": 0.9}',
        b"\xff",
        b"{",
    ],
)
def test_bad_declarations(line: bytes) -> None:
    with pytest.raises(ValueError):
        Capabilities.parse(line)


def test_a_decoder_without_declaration(tmp_path: Path) -> None:
    for text in ("raise SystemExit(2)", ""):
        command = script(tmp_path, text).split()
        assert run.capabilities(command, Limits()) == Capabilities()


def test_invalid_sources_need_every_format_unless_stated() -> None:
    vector = {"file": "invalid/s/x.mcz", "modes": ["sources"], "exit": [1], "expected": {}}
    (request,) = manifest.all_requests(vector)
    some = Capabilities(sources=frozenset(("bvh", "asf")))
    assert some.lacks(request) == [
        f"source {name}" for name in manifest.FORMATS if name not in ("bvh", "asf")
    ]
    vector["formats"] = ["bvh"]
    assert some.lacks(request) == []


# What is asked


def select_names(*patterns: str) -> set[str]:
    rows = manifest.load_manifest()
    return {row["file"].removesuffix(".mcz") for row in select(rows, patterns)}


def test_only() -> None:
    assert select_names() == set(VECTORS)
    assert select_names("valid") == {name for name in VECTORS if name.startswith("valid/")}
    assert select_names("raw") == {"valid/raw/plain", "uncommon/raw/newer", "invalid/raw/bad"}
    assert select_names("valid/raw") == {"valid/raw/plain"}
    assert select_names("RAW-02") == {"valid/raw/plain", "invalid/raw/bad"}
    assert select_names("RAW-*1") == {"valid/raw/plain"}
    assert select_names("*/plain") == {"valid/raw/plain", "valid/mrdwt/plain"}
    assert select_names("sources/a", "mrdwt") == {"valid/sources/amc", "valid/mrdwt/plain"}
    with pytest.raises(ValueError, match="'qbc'"):
        select_names("mrdwt", "qbc")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--decoder", "no-such-program"], "there is no command"),
        (["--decoder", "true", "--only", "nothing"], "no vector is meant by 'nothing'"),
        (["--decoder", "true", "--badge", "badge.png"], "neither .svg nor .json"),
        (["--decoder", "echo []"], "--capabilities writes no declaration: "),
    ],
)
def test_usage(capsys: pytest.CaptureFixture[str], arguments: list[str], message: str) -> None:
    assert run.main(arguments) == 2
    assert message in capsys.readouterr().err


def test_nothing_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = decoder(tmp_path, declared={"codecs": []})
    assert run.main(["--decoder", command, "--only", "mrdwt"]) == 2
    assert "nothing was asked" in capsys.readouterr().err


def test_svg_and_junit_hold_what_happened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit = f"{IS_PLAIN} sys.stderr.write('\\x1b[31m<&>'); code = 1"
    svg, junit = tmp_path / "badge.svg", tmp_path / "junit.xml"
    files = ["--badge", str(svg), "--junit", str(junit), "--only", "raw"]
    assert run.main(["--decoder", decoder(tmp_path, edit), *files]) == 1
    label = "2/3 full decoder, a selection from 6"
    assert label in capsys.readouterr().out
    assert [t.text for t in Xml.parse(svg).getroot()][-1] == label
    cases = {case.get("name"): case for case in Xml.parse(junit).getroot().iter("testcase")}
    failure = cases["plain"].find("failure")
    assert failure is not None and failure.get("type") == "wrongly refused"
    assert cases["plain"].findtext("system-err") == "?[31m<&>"
    assert cases["bad"].find("failure") is None


def test_the_folder_alone_is_enough(tmp_path: Path, suite: Path) -> None:
    for module in HERE.glob("*.py"):
        shutil.copy(module, suite)
    command = [sys.executable, "-S", "-E", "-B", "-m", "conformance.run"]
    done = subprocess.run(
        [*command, "--decoder", decoder(tmp_path)],
        cwd=suite.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("MCZ 0.9 conformance: 6/6 full decoder\n")


# Encoders

ENCODER = """
import json, os, sys
data = sys.stdin.buffer.read()
name = "walk." + sys.argv[sys.argv.index("--format") + 1]
extra, code = {{}}, 0
if "--skeleton" in sys.argv:
    assert open(sys.argv[-1], "rb").read() == {asf!r}
{edit}
sources = {{"rows": [{{"path": name, "bytes": len(data)}}], "body": data.hex()}}
arrays = {{"rows": [], "body": ""}}
print(json.dumps({{"exit": 0, "arrays": arrays, "sources": sources}} | extra))
sys.exit(code)
"""


def run_encoder(folder: Path, edit: str = "", *more: str) -> tuple[int, dict[str, Any]]:
    encoder = script(folder, ENCODER.format(edit=edit, asf=ASF), "encoder.py")
    return result("--decoder", decoder(folder), "--encoder", encoder, *more)


def test_an_honest_encoder(tmp_path: Path) -> None:
    edit = "assert ('--skeleton' in sys.argv) == (name == 'walk.amc')"
    for more in ((), ("--serve",)):
        code, document = run_encoder(tmp_path, edit, *more)
        assert code == 0
        rows = {row["source"]: (row["status"], row["fault"]) for row in document["encoder"]}
        assert rows == dict.fromkeys(("walk.bvh", "walk.amc", "walk.asf"), ("restored", None))
        assert all(row["deterministic"] for row in document["encoder"])
        assert document["badge"].endswith("6/6 full decoder, encoder 3/3")


WRONG_ENCODERS = {
    "other bytes": "data = data.lower()",
    "refused by the decoder": "extra = {'exit': 1}",
    "wrongly refused": "code = 1",
    "bad exit code": "code = 9",
    "bad listing": "extra = {'sources': {'rows': 3, 'body': ''}}",
    "crash (uncaught exception)": "raise KeyError",
    "hang": "import time; time.sleep(60)",
}


@pytest.mark.parametrize("kind", WRONG_ENCODERS)
def test_wrong_encoders(tmp_path: Path, kind: str) -> None:
    more = ("--only", "sources/bvh", "--timeout", "3" if kind == "hang" else "60")
    code, document = run_encoder(tmp_path, WRONG_ENCODERS[kind], *more)
    assert (code, document["failed"]) == (1, 0)
    (row,) = document["encoder"]
    assert row["status"] == "failed" and row["fault"].startswith(kind)


def test_an_encoder_may_decline(tmp_path: Path) -> None:
    code, document = run_encoder(tmp_path, "if name != 'walk.bvh': sys.exit(3)")
    assert code == 0
    statuses = {row["source"]: row["status"] for row in document["encoder"]}
    assert statuses == {"walk.bvh": "restored", "walk.amc": "declined", "walk.asf": "declined"}
    assert document["badge"].endswith("encoder 1/1")


def test_an_encoder_with_dice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    encoder = script(
        tmp_path, ENCODER.format(edit="extra = {'x': os.urandom(4).hex()}", asf=ASF), "encoder.py"
    )
    junit = tmp_path / "junit.xml"
    files = ["--junit", str(junit)]
    assert run.main(["--decoder", decoder(tmp_path), "--encoder", encoder, *files]) == 0
    shown = capsys.readouterr().out
    assert shown.count("other bytes the second time") == 3
    names = [suite.get("name") for suite in Xml.parse(junit).getroot()]
    assert names[-1] == "conformance.encoder"


def test_classes_are_those_of_the_text() -> None:
    """Each has the codecs of the one before, and core restores no source."""
    assert list(manifest.CLASSES) == ["core", "archival", "lossy", "research"]
    can = manifest.Capabilities.parse(b'{"class": "core", "options": ["--clip"]}')
    assert (can.codecs, can.sources) == ({"raw", "fast"}, frozenset())
    can = manifest.Capabilities.parse(b'{"codecs": ["raw", "pca"]}')
    assert can.within("archival").codecs == {"raw"}
    assert can.within("research").codecs == {"raw", "pca"}
    with pytest.raises(ValueError, match="class is 'full'"):
        can.within("full")
