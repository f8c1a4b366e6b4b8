"""``python -m tools.fuzz.differential``: mutated vectors, given to this package and to tools/js.

Both must refuse a file, or give equal bytes. Exit 1 where they did not; each kind of difference is
kept in a folder, with what either said. Two are told apart as choices that SPEC.md, "Strict
reading", leaves: which of two reasons a reader names (1 or 3), and what it refuses in stored frames
that are not shown.
"""

from __future__ import annotations

import argparse
import collections
import hashlib
import json
import random
import re
import shutil
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import mcz
from conformance.child import Limits
from conformance.server import Server
from mcz.cli.conformance import _parser as contract
from mcz.cli.conformance import respond
from mcz.container import reader
from mcz.errors import MczError, UnsupportedError
from tools.fuzz import guard
from tools.fuzz.files import hides_frames
from tools.fuzz.mutation import Mutation, plain_change
from tools.fuzz.repair import with_hashes
from tools.fuzz.seeds import vectors

HERE = Path(__file__).parent
DECODED = 2**21  # bytes that either may decode to
MOST_OUTPUT = 2**26  # bytes of all signals of a file
LARGEST = 2**15  # bytes of a mutant
PATIENCE = 60.0  # seconds of wall time for one answer
HASHED = 0.6  # of the mutants get hashes of what this package makes of them
MOST_OF_A_KIND = 3
DECODED_OK, REFUSED, FAILED, UNSUPPORTED, HUNG = 0, 1, 2, 3, 4


@dataclass(frozen=True, slots=True)
class Answer:
    """An exit code of the contract, its output, or why there is none."""

    exit: int
    output: bytes = b""
    message: str = ""


def main(arguments: list[str] | None = None) -> int:
    given = _options(arguments)
    if shutil.which("node") is None or not (given.js / "conformance.js").exists():
        print("DIFFERENTIAL FUZZING SKIPPED: there is no node, or no decoder", file=sys.stderr)
        return 0
    given.findings.mkdir(parents=True, exist_ok=True)
    found = Comparison(given.findings)
    with Other(given.js) as other, mock.patch.object(reader, "output_limit", lambda size: DECODED):
        _run(given, other, found)
    print(found.text(), flush=True)
    return int(bool(found.differences))


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools.fuzz.differential", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="mutants")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--seed", type=int, default=1, help="of the first mutant")
    parser.add_argument("--only", default="", help="part of the names of seeds")
    parser.add_argument("--js", type=Path, default=HERE.parent / "js", help="the other decoder")
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    return parser.parse_args(arguments)


def _run(given: argparse.Namespace, other: Other, found: Comparison) -> None:
    seeds = {name: data for name, data in vectors().items() if given.only in name}
    names, start = sorted(seeds), time.monotonic()
    guard.limit_time()
    for number in range(given.seed, given.seed + given.runs):
        rng = random.Random(number)
        name = rng.choice(names)
        data = Mutation(rng, plain_change(rng)).of(seeds[name], LARGEST)
        if rng.random() < HASHED:
            data = _add_hashes(data)
        if found.compare(number, name, data, [], other):
            # A fault that only other requests meet need not be found by these.
            for request in requests(data, rng):
                found.compare(number, name, data, request, other)
        if number % 1000 == 0:
            print(f"{time.monotonic() - start:.0f} s, {found.text()}", flush=True)
        if time.monotonic() - start > given.seconds:
            break


def _add_hashes(data: bytes) -> bytes:
    try:
        return with_hashes(data)
    except (MczError, AssertionError):
        return data


def requests(data: bytes, rng: random.Random) -> list[list[str]]:
    """Further requests about a decoded file: its sources, and a part of it."""
    with mcz.open(data) as file:
        clips = list(file.clips.values())
        part = [_part(rng.choice(clips), rng)] if clips else []
    return [["--source"], *part]


def _part(clip: mcz.Clip, rng: random.Random) -> list[str]:
    a, b = sorted((rng.randint(0, clip.n_frames), rng.randint(0, clip.n_frames)))
    words = ["--clip", clip.name, "--frames", f"{a}:{b}"]
    n_joints = len(clip.skeleton.joints)
    if rng.random() < 0.5 and n_joints:
        joints = rng.sample(range(n_joints), rng.randint(1, min(3, n_joints)))
        words += ["--joints", ",".join(map(str, joints))]
    resolutions = clip.signals[0].counts.n_resolutions
    if resolutions > 1 and rng.random() < 0.7:
        words += ["--resolution", str(rng.randrange(resolutions))]
    return words


def ours(data: bytes, request: list[str]) -> Answer:
    """This package's answer; what is no MczError is a failure."""

    def ask(content: bytes) -> bool:
        output.append(b"".join(respond(content, contract().parse_args(request))))
        return True

    output: list[bytes] = []
    try:
        guard.call_in_time(ask, data)
    except UnsupportedError as error:
        return Answer(UNSUPPORTED, message=f"{type(error).__name__}: {error}")
    except MczError as error:
        return Answer(REFUSED, message=f"{type(error).__name__}: {error}")
    except guard.HangError as error:
        return Answer(HUNG, message=str(error))
    except Exception as error:
        return Answer(FAILED, message=f"{type(error).__name__}: {error}")
    return Answer(DECODED_OK, output[-1])


class Other:
    """The decoder in JavaScript, in one process, which is started again where it dies."""

    def __init__(self, folder: Path) -> None:
        program = str(folder.resolve() / "conformance.js")
        command = ["node", "--max-old-space-size=1536", program, "--decoded-limit", str(DECODED)]
        self._server = Server(command, Limits(PATIENCE, memory=0))

    def __enter__(self) -> Other:
        return self

    def __exit__(self, *error: object) -> None:
        self._server.close()

    def answer(self, data: bytes, request: list[str]) -> Answer:
        told = self._server.ask(request, data, MOST_OUTPUT)
        if told.fault or told.code < 0:
            code = HUNG if told.fault == "hang" else FAILED
            return Answer(code, message=f"{told.fault or told.code}: {told.detail}")
        return Answer(told.code, told.output, told.errors.strip())


@dataclass(slots=True)
class Comparison:
    """Results of all requests: the number of agreements, and the kinds of differences."""

    folder: Path
    agreed: collections.Counter[int] = field(default_factory=collections.Counter)
    differences: collections.Counter[str] = field(default_factory=collections.Counter)
    choices: collections.Counter[str] = field(default_factory=collections.Counter)

    def compare(
        self, number: int, name: str, data: bytes, request: list[str], other: Other
    ) -> bool:
        """Ask both; whether both decoded the file, and to the same."""
        own, theirs = ours(data, request), other.answer(data, request)
        both = own.exit == theirs.exit and own.exit in (DECODED_OK, REFUSED, UNSUPPORTED)
        if both and equal(own.output, theirs.output):
            self.agreed[own.exit] += 1
            return own.exit == DECODED_OK
        kind = f"{own.exit} {plain(own.message)} | {theirs.exit} {plain(theirs.message)}"
        counts = self.choices if is_choice(data, own.exit, theirs.exit) else self.differences
        counts[kind] += 1
        if counts[kind] <= MOST_OF_A_KIND:
            self._keep(f"mutant {number} of {name}, request {request}", data, own, theirs)
        return False

    def _keep(self, title: str, data: bytes, own: Answer, theirs: Answer) -> None:
        path = self.folder / f"{own.exit}{theirs.exit}-{hashlib.sha256(data).hexdigest()[:12]}"
        path.with_suffix(".mcz").write_bytes(data)
        lines = [title]
        for who, told in (("Python", own), ("JavaScript", theirs)):
            lines.append(f"{who}: {told.exit} {told.message}\n  {told.output[:600]!r}")
        path.with_suffix(".txt").write_text("\n".join(lines) + "\n")

    def text(self) -> str:
        decoded, refused, unsupported = (
            self.agreed[code] for code in (DECODED_OK, REFUSED, UNSUPPORTED)
        )
        different, chosen = self.differences.total(), self.choices.total()
        title = (
            f"{self.agreed.total() + different + chosen} requests: {decoded} decoded alike, "
            f"{refused} refused by both, {unsupported} unsupported by both, {chosen} choices, "
            f"{different} different"
        )
        kinds = (f"{n} x {kind}" for kind, n in self.differences.most_common())
        return "\n  ".join([title, *kinds])


def is_choice(data: bytes, one: int, other: int) -> bool:
    """True if SPEC.md lets a reader choose between two exit codes for ``data``."""
    if {one, other} == {REFUSED, UNSUPPORTED}:
        return True
    return {one, other} == {DECODED_OK, REFUSED} and hides_frames(data)


def equal(one: bytes, other: bytes) -> bool:
    """True if two outputs list and hold the same."""
    if one == other:
        return True
    ends = one.find(b"\n"), other.find(b"\n")
    if -1 in ends:
        return False
    listed = [json.loads(text[:end]) for text, end in zip((one, other), ends, strict=True)]
    return listed[0] == listed[1] and one[ends[0] :] == other[ends[1] :]


def plain(message: str) -> str:
    """A message without its numbers and names, so that those of a kind are alike."""
    line = " ".join(message.split("\n")[:3]) if message else ""
    return re.sub(r"[0-9a-f]{8,}|\d+|'[^']*'|\"[^\"]*\"", "#", line)[:110]


if __name__ == "__main__":
    sys.exit(main())
