"""``python -m tools.fuzz TARGET ...``: fuzz targets one after the other; exit 1 with findings."""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tools.fuzz import sanitizers
from tools.fuzz.targets import TARGETS

ROOT = Path(__file__).parents[2]
STATUS = re.compile(r"#\d+\s+\S+\s+cov: (\d+) ft: (\d+) corp: (\d+)/")
MOST_STARTS = 10  # processes that may die of one target
ABSENT = 0  # the exit code without atheris: what cannot be done here is no fault of the code


@dataclass(slots=True)
class Outcome:
    """Result of one target; ``deaths`` counts processes that ended by themselves."""

    target: str
    executions: int = 0
    decoded: int = 0
    seconds: float = 0.0
    coverage: int = 0
    features: int = 0
    corpus: int = 0
    deaths: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    findings: dict[str, int] = field(default_factory=dict)

    def line(self) -> str:
        return (
            f"{self.target:12} {self.executions:9} {self.decoded:9} {self.seconds:8.0f} "
            f"{self.coverage:8} {self.corpus:7} {len(self.findings) + self.deaths:8}"
        )


HEADING = "target       executed   decoded  seconds coverage  corpus findings"


def main(arguments: list[str] | None = None) -> int:
    given = _parser().parse_args(arguments)
    if given.list:
        print("\n".join(f"{t.name:12} {t.purpose}" for t in TARGETS.values()))
        return 0
    if find_spec("atheris") is None:
        print("FUZZING SKIPPED: atheris is not installed (pip install atheris)", file=sys.stderr)
        return ABSENT
    names = list(TARGETS) if given.all else given.targets
    unknown = [name for name in names if name not in TARGETS]
    if unknown or not names:
        print(f"no such target: {unknown}; --list names them", file=sys.stderr)
        return 2
    print(HEADING, flush=True)
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="mcz-fuzz-") as folder:
        for name in names:
            outcomes.append(_fuzz(name, given, Path(folder)))
            print(outcomes[-1].line(), flush=True)
            for finding, count in outcomes[-1].findings.items():
                print(f"  {count} x {finding}", flush=True)
    if given.json is not None:
        given.json.write_text(json.dumps([_document(o) for o in outcomes], indent=1) + "\n")
    return int(any(outcome.findings or outcome.deaths for outcome in outcomes))


def _document(outcome: Outcome) -> dict[str, Any]:
    return {name: getattr(outcome, name) for name in Outcome.__slots__}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="tools.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--list", action="store_true", help="say what targets there are")
    parser.add_argument("--all", action="store_true", help="every target")
    parser.add_argument("--seconds", type=int, default=60, help="of each target")
    parser.add_argument("--runs", type=int, default=-1, help="inputs of each target at most")
    parser.add_argument("--seed", type=int, default=1, help="of the mutations")
    parser.add_argument("--most-seeds", type=int, default=10**6, help="files to begin with")
    loops = parser.add_mutually_exclusive_group()
    loops.add_argument("--plain", action="store_true", help="run compiled loops as they stand")
    loops.add_argument("--sanitized", action="store_true", help="run them under ASan and UBSan")
    parser.add_argument("--corpus", type=Path, help="folder that keeps what reaches new code")
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--json", type=Path, help="file for the figures")
    return parser


def _fuzz(name: str, given: argparse.Namespace, folder: Path) -> Outcome:
    outcome, start = Outcome(name), time.monotonic()
    while outcome.deaths < MOST_STARTS:
        left = given.seconds - int(time.monotonic() - start)
        ended = left < 1 or _run(name, given, folder, left, outcome)
        outcome.seconds = time.monotonic() - start
        if ended:
            break
    return outcome


def _run(
    name: str, given: argparse.Namespace, folder: Path, seconds: int, outcome: Outcome
) -> bool:
    """One process; whether it ended well. What it did is added to ``outcome``."""
    corpus = (given.corpus or folder / "corpus").resolve() / name
    seeds, figures = folder / f"{name}-seeds", folder / f"{name}.json"
    findings: Path = given.findings.resolve()
    for path in (corpus, seeds, findings):
        path.mkdir(parents=True, exist_ok=True)
    figures.unlink(missing_ok=True)
    options = {
        "--corpus": corpus,
        "--seeds": seeds,
        "--findings": findings,
        "--figures": figures,
        "--seconds": seconds,
        "--runs": given.runs,
        "--seed": given.seed + outcome.deaths,
        "--most-seeds": given.most_seeds,
    }
    words = [str(word) for pair in options.items() for word in pair]
    words += ["--plain"] if given.plain else []
    words += ["--sanitized"] if given.sanitized else []
    command = [sys.executable, "-m", "tools.fuzz.worker", name, *words]
    log = findings / f"{name}.log"
    env = sanitizers.environment() if given.sanitized else None
    with open(log, "ab") as errors:
        done = subprocess.run(command, cwd=ROOT, env=env, stdout=errors, stderr=errors, check=False)
    _add(outcome, figures, log)
    outcome.deaths += done.returncode != 0
    return done.returncode == 0


def _add(outcome: Outcome, figures: Path, log: Path) -> None:
    if figures.exists():
        document = json.loads(figures.read_text())
        outcome.executions += document["executions"]
        outcome.decoded += document["decoded"]
        for kind in ("refused", "findings"):
            counts = getattr(outcome, kind)
            for key, count in document[kind].items():
                counts[key] = counts.get(key, 0) + count
    for match in _statuses(log):
        outcome.coverage, outcome.features, outcome.corpus = map(int, match.groups())


def _statuses(log: Path) -> Iterator[re.Match[str]]:
    return STATUS.finditer(log.read_text(errors="replace"))


if __name__ == "__main__":
    sys.exit(main())
