"""The vectors, their manifest, the runner, and this package as a decoder under test."""

from __future__ import annotations

import hashlib
import io
import json
import re
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import pytest

from conformance import run
from conformance.child import Limits
from conformance.outcome import ask, capabilities, starter
from mcz.cli import conformance
from tests.broken import find
from tools import make_vectors

ROOT = Path(run.__file__).parent.parent
MANIFEST = json.loads((run.HERE / "manifest.json").read_text("utf-8"))
SCHEMA = json.loads((run.HERE / "manifest.schema.json").read_text("utf-8"))
VECTORS = MANIFEST["vectors"]
TYPES = {"object": dict, "array": list, "string": str, "integer": int}


def faults(value: Any, schema: dict[str, Any], where: str) -> list[str]:
    """Faults of ``value`` by the part of JSON Schema that our schema uses."""
    if "$ref" in schema:
        return faults(value, SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], where)
    if "enum" in schema:
        return [] if value in schema["enum"] else [f"{where}: {value!r}"]
    if not isinstance(value, TYPES[schema["type"]]):
        return [f"{where}: {value!r} is no {schema['type']}"]
    if isinstance(value, str):
        good = re.search(schema.get("pattern", ""), value)
        return [] if good else [f"{where}: {value!r} does not match {schema['pattern']}"]
    messages: list[str] = []
    if isinstance(value, list):
        messages += [f"{where}: too few"] * (len(value) < schema.get("minItems", 0))
        for index, item in enumerate(value):
            messages += faults(item, schema["items"], f"{where}[{index}]")
    if isinstance(value, dict):
        missing = set(schema.get("required", [])) - set(value)
        messages += [f"{where}: without {sorted(missing)}"] * bool(missing)
        for key, item in value.items():
            if key in schema["properties"]:
                messages += faults(item, schema["properties"][key], f"{where}.{key}")
            else:
                messages.append(f"{where}: unknown key {key!r}")
    return messages


def test_manifest_follows_its_schema() -> None:
    assert all("description" in key for key in SCHEMA["$defs"]["vector"]["properties"].values())
    assert faults(MANIFEST, SCHEMA, "manifest") == []
    assert faults({**MANIFEST, "more": 1}, SCHEMA, "m") == ["m: unknown key 'more'"]


def test_manifest_and_files_agree() -> None:
    listed = [vector["file"] for vector in VECTORS]
    stored = {p.relative_to(run.VECTORS).as_posix() for p in run.VECTORS.rglob("*.*")}
    assert len(listed) == len(set(listed))
    assert set(listed) == stored
    for vector in VECTORS:
        data = (run.VECTORS / vector["file"]).read_bytes()
        assert hashlib.sha256(data).hexdigest() == vector["sha256"], vector["file"]
        assert vector["group"] == vector["file"].partition("/")[0]


def test_groups_and_exit_codes() -> None:
    for vector in VECTORS:
        allowed = {"valid": [[0]], "uncommon": [[0, 3], [3]], "invalid": [[1]]}[vector["group"]]
        assert vector["exit"] in allowed, vector["file"]
        assert ("refusal" in vector["expected"]) == (0 not in vector["exit"]), vector["file"]
    assert sum(vector["group"] == "invalid" for vector in VECTORS) >= 150
    assert sum((run.VECTORS / vector["file"]).stat().st_size for vector in VECTORS) <= 2**22
    assert (run.HERE / "manifest.json").stat().st_size < 3 * 2**20


def test_headings_are_in_the_specification() -> None:
    text = (ROOT / "SPEC.md").read_text("utf-8")
    headings = set(re.findall(r"(?m)^#+ (.+)$", text))
    used = {heading for vector in VECTORS for heading in vector["spec"]}
    assert used <= headings, used - headings


def test_purposes_differ() -> None:
    purposes: dict[str, str] = {}
    for vector in VECTORS:
        place = vector["file"].rpartition("/")[0]
        assert (
            purposes.setdefault(f"{place}: {vector['purpose']}", vector["file"]) == vector["file"]
        )


SAME_ZLIB = pytest.mark.skipif(
    MANIFEST["zlib"] != zlib.ZLIB_RUNTIME_VERSION, reason="another zlib deflates differently"
)


@SAME_ZLIB
def test_regeneration_gives_the_same_files() -> None:
    for name, data in make_vectors.files().items():
        assert (run.HERE / name).read_bytes() == data, f"{name}: run tools/make_vectors.py"


def answer(request: run.Request) -> tuple[int, bytes]:
    """Exit code and output of our adapter, without a process."""
    return conformance.answer(request.path.read_bytes(), request.arguments)


CHUNKS = 4  # so that the vectors spread over workers


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_our_decoder(chunk: int) -> None:
    """All vectors by the runner that strangers use, each judged by itself; no warning passes."""
    command = [sys.executable, "-W", "error", "-m", "mcz.cli.conformance"]
    chosen, limits = VECTORS[chunk::CHUNKS], Limits()
    start = starter(command, limits, serve=True)
    outcomes = ask(chosen, capabilities(command, limits), start, jobs=1)
    assert [outcome.file for outcome in outcomes] == [vector["file"] for vector in chosen]
    failed = [outcome for outcome in outcomes if outcome.status != "passed" or outcome.lacks]
    failures = [f"{o.file}: {o.status} {o.faults} {o.lacks} {o.stderr[-200:]}" for o in failed]
    assert not failures, "\n".join(failures)


def runner(*arguments: str) -> tuple[int, str]:
    """Exit code and output of the runner, a process of its own."""
    command = [sys.executable, "-m", "conformance.run", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


SAYS = ("judge.py", "server.py", "encode.py")  # modules that name faults
OURS = f"{sys.executable} -m mcz.cli.conformance"


@pytest.mark.parametrize(("rule", "kind"), [("RAW-03", "wrongly refused"), ("RAW-04", "accepted")])
def test_runner_catches_a_broken_decoder(rule: str, kind: str) -> None:
    """Through the command; test_broken.py has all rules, without one."""
    caught = find.read_catches()[rule][0].vector
    command = f"{sys.executable} -m tests.broken {rule}"
    only = ("--only", caught, "--only", "valid/raw/plain")
    code, shown = runner("--decoder", command, "--serve", *only, "--json")
    assert code == 1, shown
    rows = {row["file"].removesuffix(".mcz"): row for row in json.loads(shown)["vectors"]}
    assert rows.keys() == {caught, "valid/raw/plain"}
    assert rows["valid/raw/plain"]["passed"]
    assert {fault["kind"] for fault in rows[caught]["faults"]} == {kind}


def test_runner_takes_every_so_many() -> None:
    code, shown = runner("--decoder", OURS, "--only", "valid/container", "--every", "9", "--json")
    files = [v["file"] for v in json.loads(shown)["vectors"]]
    names = [v["file"] for v in VECTORS if "valid/container" in v["file"]]
    assert code == 0 and files == names[::9]


def of(file: str, mode: str = "arrays") -> run.Request:
    vector = next(v for v in VECTORS if v["file"] == file)
    return next(r for r in run.requests(vector, []) if r.listing == mode)


def test_judge() -> None:
    request = of("valid/raw/plain.mcz")
    code, output = answer(request)
    assert run.judge(request, code, output) is None
    line, _, body = output.partition(b"\n")
    wrong = {
        "exit 1": (1, output),
        "3 exits": (3, output),
        "no line": (0, b""),
        "no newline": (0, line),
        "no JSON": (0, b"{\n"),
        "no list": (0, b'{"arrays": 1}\n'),
        "no object": (0, b"[]\n"),
        "not UTF-8": (0, b"\xff\n"),
        "nothing listed": (0, b'{"arrays": []}\n'),
        "a short row": (0, b'{"arrays": [{"clip": "dance"}]}\n'),
        "bytes missing": (0, output[:-1]),
        "bytes too many": (0, output + b"\0"),
        "another value": (0, line + b"\n" + bytes((body[0] ^ 1,)) + body[1:]),
        "another name": (0, output.replace(b"dance", b"dancf", 1)),
        "another shape": (0, output.replace(b"[4, 6]", b"[6, 4]", 1)),
        "a long line": (0, line[:-1] + b" " * 2**20 + b"}\n" + body),
    }
    for what, (code, changed) in wrong.items():
        assert run.judge(request, code, changed), what
    strings = output.replace(b'"shape": [4, 6]', b'"shape": ["4", "6"]')
    assert run.judge(request, 0, strings.replace(b'"bytes": 192', b'"bytes": "192"')) is None
    invalid = of("invalid/chunks/crc.mcz")
    assert run.judge(invalid, 1, b"") is None
    assert run.judge(invalid, 0, output)
    assert run.judge(invalid, 139, b"")


def test_capabilities(capsys: pytest.CaptureFixture[str]) -> None:
    assert conformance.main(["--capabilities"]) == 0
    assert json.loads(capsys.readouterr().out) == {"options": list(conformance.OPTIONS)}


def test_one_process_answers_as_many_do() -> None:
    files = ("valid/raw/plain.mcz", "invalid/chunks/crc.mcz", "uncommon/container/newer-major.mcz")
    asked = [of(file) for file in files] + [of("valid/sources/bvh-plain.mcz", "sources")]
    sent, alone = b"", []
    for request in asked:
        data = request.path.read_bytes()
        sent += json.dumps({"arguments": request.arguments, "bytes": len(data)}).encode()
        sent += b"\n" + data
        alone.append(answer(request))
    answers = io.BytesIO()
    assert conformance.serve(io.BytesIO(sent), answers) == 0
    answers.seek(0)
    for code, output in alone:
        head = json.loads(answers.readline())
        assert (head["exit"], answers.read(head["bytes"])) == (code, output)
    assert answers.read() == b""
    code, shown = runner("--decoder", OURS, "--only", "invalid/chunks", "--serve")
    assert code == 0, shown


def test_runner_passes_our_encoder() -> None:
    encoder = f"{sys.executable} -m mcz encode - -o -"
    only = ("--only", "valid/sources/amc.mcz", "--only", "valid/sources/c3d-intel-integers")
    code, shown = runner("--decoder", OURS, "--encoder", encoder, "--serve", *only, "--json")
    assert code == 0, shown
    statuses = {row["source"]: row["status"] for row in json.loads(shown)["encoder"]}
    wanted = ("take.amc", "small.asf", "intel-integers.c3d")
    assert statuses == dict.fromkeys(wanted, "restored")


def test_the_example_of_the_readme(tmp_path: Path) -> None:
    text = (run.HERE / "README.md").read_text("utf-8")
    (program,) = re.findall(r"(?ms)^```python\n(.*?)^```", text)
    assert len(program.splitlines()) == 10
    script = tmp_path / "decoder.py"
    script.write_text(program)
    only = ("valid/container/minimal", "invalid/chunks/crc", "uncommon/container/unknown-critical")
    arguments = [word for name in only for word in ("--only", name)]
    command = ("--decoder", f"{sys.executable} {script}")
    code, shown = runner(*command, *arguments)
    assert code == 0, shown
    code, shown = runner(*command, "--only", "invalid/chunks", "--json")
    passed = [row["passed"] for row in json.loads(shown)["vectors"]]
    assert code == 1 and any(passed) and not all(passed)


def test_the_readme_names_every_fault_and_argument() -> None:
    text = " ".join((run.HERE / "README.md").read_text("utf-8").split())
    assert f"conformance: {len(VECTORS)}/{len(VECTORS)} full decoder" in text
    code = "".join((run.HERE / name).read_text("utf-8") for name in SAYS)
    kinds = set(re.findall(r'(?:Fault|Wrong|_Lost)\(f?"([a-z ]+?)(?: \(|")', code))
    assert {"wrong order", "bad answer", "other bytes", "crash"} <= kinds
    assert not {kind for kind in kinds if f"`{kind}" not in text}
    for option in re.findall(r'add\("(--[a-z-]+)"', (run.HERE / "run.py").read_text("utf-8")):
        assert option in text
