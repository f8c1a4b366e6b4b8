"""Run a decoder over the conformance vectors.

    python -m conformance.run --decoder "CMD" [--only SUBSTRING] [--every N] [--json] [--jobs N]
                              [--timeout S] [--memory MIB] [--arrays-only]

README.md beside this file is the contract. Standard library only, so that an implementation in any
language can be tested without installing this package.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

try:
    import resource
except ImportError:  # not on Windows: no memory limit there
    resource = None  # type: ignore[assignment]

HERE = Path(__file__).parent
VECTORS = HERE / "vectors"
GROUPS = ("valid", "uncommon", "invalid")
MAX_LINE = 2**20  # bytes of the JSON line
MAX_OUTPUT = 2**28  # bytes of everything that a decoder may write for one vector
OK, REFUSED, UNSUPPORTED = 0, 1, 3
FIELDS = {
    "arrays": ("clip", "signal", "array", "dtype", "shape"),
    "sources": ("path",),
}


@dataclass(frozen=True, slots=True)
class Request:
    """One call of the decoder: ``expected`` are rows with a sha256, what ``listing`` names."""

    vector: dict[str, Any]
    arguments: tuple[str, ...]
    listing: str  # "arrays" or "sources"
    expected: list[dict[str, Any]]

    @property
    def path(self) -> Path:
        return VECTORS / self.vector["file"]


@dataclass(slots=True)
class Outcome:
    """What became of one vector: ``faults`` is empty where it passed."""

    vector: dict[str, Any]
    faults: list[str] = field(default_factory=list)
    stderr: str = ""


def load_manifest() -> list[dict[str, Any]]:
    """The vectors of manifest.json."""
    manifest = json.loads((HERE / "manifest.json").read_text("utf-8"))
    vectors: list[dict[str, Any]] = manifest["vectors"]
    return vectors


def requests(
    vector: dict[str, Any], options: Sequence[str], *, arrays_only: bool = False
) -> Iterator[Request]:
    """The calls that ``vector`` asks for, of a decoder with these optional arguments."""
    for mode in vector["modes"]:
        if mode == "sources" and arrays_only:
            continue
        arguments = ("--source",) if mode == "sources" else ()
        yield Request(vector, arguments, mode, vector["expected"].get(mode, []))
    for part in vector.get("parts", []):
        if all(word in options for word in part["arguments"] if word.startswith("--")):
            yield Request(vector, tuple(part["arguments"]), "arrays", part["arrays"])


def judge(request: Request, code: int, output: bytes) -> str | None:
    """What is wrong with the answer to ``request``, None where nothing is."""
    wanted = request.vector["exit"]
    if code not in wanted:
        return f"exit {code}, expected {' or '.join(map(str, wanted))}"
    if code != OK:
        return None
    try:
        rows = listed(output, request.listing)
    except ValueError as error:
        return str(error)
    if len(rows) != len(request.expected):
        return f"{len(rows)} {request.listing}, expected {len(request.expected)}"
    for row, expected in zip(rows, request.expected, strict=True):
        for name in (*FIELDS[request.listing], "sha256"):
            if row[name] != expected[name]:
                return f"{request.listing}: {name} is {row[name]!r}, expected {expected[name]!r}"
    return None


def listed(output: bytes, listing: str) -> list[dict[str, Any]]:
    """The rows of a decoder's ``output``, each with the hash of its bytes; ValueError if bad."""
    line, newline, body = output.partition(b"\n")
    if not newline or len(line) >= MAX_LINE:
        raise ValueError(f"the first line has {len(line)} bytes, or no end")
    document = json.loads(line)  # its errors, of UTF-8 too, are ValueErrors
    rows = document.get(listing) if isinstance(document, dict) else None
    if not isinstance(rows, list):
        raise ValueError(f"the line is no object with a list {listing!r}")
    found, at = [], 0
    for row in rows:
        missing = {"bytes", *FIELDS[listing]} - set(row)
        if missing:
            raise ValueError(f"a row without {', '.join(sorted(missing))}")
        size = int(row["bytes"])
        found.append(dict(row) | {"sha256": hashlib.sha256(body[at : at + size]).hexdigest()})
        if listing == "arrays":
            found[-1]["shape"] = [int(length) for length in row["shape"]]
        at += size
    if at != len(body):
        raise ValueError(f"{len(body)} bytes follow the line, which lists {at}")
    return found


class Child:
    """One running decoder."""

    def __init__(self, command: Sequence[str], request: Request, memory: int) -> None:
        self.request = request
        self.started = time.monotonic()
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in finish()
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        with request.path.open("rb") as vector:
            self.process = subprocess.Popen(
                [*command, *request.arguments],
                stdin=vector,
                stdout=self._output,
                stderr=self._errors,
                start_new_session=os.name == "posix",
                preexec_fn=_limiter(memory),  # noqa: PLW1509 - safe, there is one thread
            )

    def kill(self) -> None:
        if os.name == "posix":
            os.killpg(self.process.pid, signal.SIGKILL)
        else:
            self.process.kill()
        self.process.wait()

    def finish(self) -> tuple[bytes, str]:
        """Standard output and the end of standard error."""
        with self._output, self._errors:
            self._output.seek(0)
            self._errors.seek(0)
            return self._output.read(), self._errors.read()[-2000:].decode("utf-8", "replace")


def _limiter(memory: int) -> Any:
    if resource is None:
        return None

    def limit() -> None:
        # Data, not address space: JavaScript engines reserve far more than they use.
        for kind, value in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_FSIZE, MAX_OUTPUT)):
            if value:
                hard = resource.getrlimit(kind)[1]
                value = value if hard == resource.RLIM_INFINITY else min(value, hard)
                resource.setrlimit(kind, (value, hard))

    return limit


def run(
    command: Sequence[str],
    vectors: Sequence[dict[str, Any]],
    *,
    jobs: int,
    timeout: float,
    memory: int,
    arrays_only: bool = False,
) -> list[Outcome]:
    """Answer every request by a process of its own; outcomes in the order of ``vectors``."""
    options = capabilities(command, timeout)
    outcomes = {vector["file"]: Outcome(vector) for vector in vectors}
    waiting = [r for v in vectors for r in requests(v, options, arrays_only=arrays_only)][::-1]
    running: list[Child] = []
    while waiting or running:
        while waiting and len(running) < jobs:
            running.append(Child(command, waiting.pop(), memory))
        still = []
        for child in running:
            if child.process.poll() is None and time.monotonic() - child.started < timeout:
                still.append(child)
            else:
                _note(outcomes, child, timeout)
        if len(still) == len(running):
            time.sleep(0.005)
        running = still
    return list(outcomes.values())


def _note(outcomes: dict[str, Outcome], child: Child, timeout: float) -> None:
    """Judge a child that has ended, or end one that has not."""
    code = child.process.poll()
    if code is None:
        child.kill()
    output, errors = child.finish()
    fault = f"no answer in {timeout:g} s" if code is None else judge(child.request, code, output)
    outcome = outcomes[child.request.vector["file"]]
    if fault is not None:
        words = " ".join(child.request.arguments)
        outcome.faults.append(f"{words}: {fault}" if words else fault)
        outcome.stderr = errors


def capabilities(command: Sequence[str], timeout: float) -> list[str]:
    """The optional arguments that a decoder says it has."""
    try:
        answer = subprocess.run(
            [*command, "--capabilities"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=timeout,
            check=True,
        )
        options = json.loads(answer.stdout)["options"]
        return [str(option) for option in options]
    except (subprocess.SubprocessError, ValueError, KeyError, TypeError):
        return []


def report(outcomes: Sequence[Outcome], seconds: float) -> None:
    """Print what failed, a line a group and a SPEC heading, and the sums."""
    for outcome in outcomes:
        for fault in outcome.faults:
            print(f"FAIL {outcome.vector['file']}: {fault}")
        if outcome.faults:
            print(f"     {outcome.vector['purpose']}")
            for line in outcome.stderr.splitlines()[-1:]:
                print(f"     stderr: {line[:200]}")
    for name, parts in _tables(outcomes).items():
        print(f"\n{name:<36} passed")
        for key, (good, total) in parts.items():
            print(f"  {key:<34} {good} of {total}")
    good = sum(not outcome.faults for outcome in outcomes)
    print(f"\nconformance: {good} of {len(outcomes)} passed in {seconds:.1f} s")
    print(f"{good} passed, {len(outcomes) - good} failed")


def _tables(outcomes: Sequence[Outcome]) -> dict[str, dict[str, tuple[int, int]]]:
    tables: dict[str, dict[str, tuple[int, int]]] = {"group": {}, "SPEC heading": {}}
    for outcome in outcomes:
        keys = [("group", outcome.vector["group"])]
        keys += [("SPEC heading", heading) for heading in outcome.vector["spec"]]
        for table, key in keys:
            good, total = tables[table].get(key, (0, 0))
            tables[table][key] = good + (not outcome.faults), total + 1
    return tables


def document(outcomes: Sequence[Outcome], seconds: float) -> dict[str, Any]:
    """What ``--json`` prints."""
    passed = sum(not outcome.faults for outcome in outcomes)
    return {
        "passed": passed,
        "failed": len(outcomes) - passed,
        "seconds": round(seconds, 3),
        "vectors": [
            {"file": o.vector["file"], "passed": not o.faults, "faults": o.faults} for o in outcomes
        ],
    }


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="conformance.run", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--decoder", required=True, help="the command to test, quoted as in a shell"
    )
    parser.add_argument("--only", default="", help="only vectors with this in their path")
    parser.add_argument("--every", type=int, default=1, help="of these only every so many")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at once")
    parser.add_argument("--timeout", type=float, default=60.0, help="seconds a vector")
    parser.add_argument("--memory", type=int, default=2048, help="MiB a process, 0: no limit")
    parser.add_argument("--arrays-only", action="store_true", help="ask for no sources")
    given = parser.parse_args(arguments)
    vectors = [vector for vector in load_manifest() if given.only in vector["file"]]
    vectors = vectors[:: max(1, given.every)]
    if given.arrays_only:
        vectors = [vector for vector in vectors if "arrays" in vector["modes"]]
    if not vectors:
        print(f"no vector has {given.only!r} in its path", file=sys.stderr)
        return 2
    started = time.monotonic()
    outcomes = run(
        shlex.split(given.decoder),
        vectors,
        jobs=max(1, given.jobs),
        timeout=given.timeout,
        memory=given.memory * 2**20,
        arrays_only=given.arrays_only,
    )
    seconds = time.monotonic() - started
    if given.json:
        print(json.dumps(document(outcomes, seconds), indent=2))
    else:
        report(outcomes, seconds)
    return int(any(outcome.faults for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
