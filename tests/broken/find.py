"""The variants of rules that vectors notice: searched for once, kept in found.txt, tried again."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any

from tests.broken import answers, by_hand, variants
from tests.broken.marks import ROOT
from tools.vectors import requirements

FOUND = Path(__file__).with_name("found.txt")
SHORT, LONG = 1.5, 30.0  # seconds that a broken decoder may take
FEW = 12  # variants of a place that are tried first
MOST = 30  # vectors that are tried on one variant
WEAK = ("negated", "nudge")  # operators that are tried where no other is noticed


@dataclass(frozen=True)
class Catch:
    """A variant of a rule, and a vector that the decoder so broken fails."""

    variant: str
    vector: str


class Nursery:
    """A process that breaks rules in children of its own."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "tests.broken.nursery"],
            cwd=ROOT,
            env=os.environ | {"MCZ_LOOPS": "interpreted"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Nursery:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.process.__exit__(kind, error, trace)  # closes its ends of the pipes and waits

    def ask(self, rule: str, variant: str, vectors: Sequence[str], seconds: float = LONG) -> Any:
        """{vector, fault, crashes} of the first of ``vectors`` that fails, {slip}, or None."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps([rule, variant, vectors, seconds]) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def catch(
        self, rule: str, names: Iterable[str], vectors: Sequence[str], seconds: float
    ) -> Catch | None:
        """The first of the variants ``names`` that one of ``vectors`` notices."""
        for name in names:
            answer = self.ask(rule, name, vectors, seconds)
            if bites(rule, answer):
                return Catch(name, answer["vector"])
        return None


def bites(rule: str, answer: Any) -> bool:
    """True for a wrong answer; a crash counts only where nothing else can show."""
    return bool(answer) and "fault" in answer and (not answer["crashes"] or rule in by_hand.CRASH)


def vectors_of(rule: str, known: Iterable[Catch] = ()) -> list[str]:
    """The vectors that ought to notice that ``rule`` is broken, the known ones first.

    They are those that are said to (requirements.txt), or all that the manifest names.
    """
    named = answers.of_rules()[rule]
    noticing = requirements.read_catches().get(rule) or named[:MOST]
    return list(dict.fromkeys([*(c.vector for c in known if c.vector in named), *noticing]))


def search(nursery: Nursery, rule: str, known: Sequence[Catch] = ()) -> list[Catch]:
    """A catch for each place of ``rule`` that has one by itself, else one of all together."""
    names = variants.names(rule)
    weak = [name for name in names if any(f".{operator}." in name for operator in WEAK)]
    strong = [name for name in names if name not in weak]
    first = [catch.variant for catch in known if catch.variant in names]
    candidates = vectors_of(rule, known)
    more = [name for name in answers.of_rules()[rule][:MOST] if name not in candidates]
    for tried, most, vectors, seconds in (
        ([*first, *strong], FEW, candidates, SHORT),
        (strong, len(names), candidates, SHORT),
        (weak, len(names), candidates, SHORT),
        ([*first, *names], len(names), more, SHORT),
        ([*first, *strong], FEW, candidates, LONG),
    ):
        catches = []
        for place in dict.fromkeys(map(variants.place_of, names)):
            if place == variants.ALL and catches:
                break
            own = list(dict.fromkeys(n for n in tried if variants.place_of(n) == place))
            catch = nursery.catch(rule, own[:most], vectors, seconds) if vectors else None
            catches += [catch] if catch else []
        if catches:
            return catches
    return []


def read_catches() -> dict[str, list[Catch]]:
    """Parse found.txt: the catches of each rule."""
    rows: dict[str, list[Catch]] = {}
    if FOUND.exists():
        for line in FOUND.read_text("utf-8").splitlines():
            rule, variant, vector = line.split()
            rows.setdefault(rule, []).append(Catch(variant, vector))
    return rows


def write(rows: dict[str, list[Catch]]) -> None:
    lines = [f"{rule} {c.variant} {c.vector}\n" for rule in sorted(rows) for c in rows[rule]]
    FOUND.write_text("".join(lines), "utf-8")


def rules() -> list[str]:
    """The rules of which vectors say that they notice when they are broken (requirements.txt)."""
    return sorted(requirements.read_catches())


def main(wanted: Sequence[str]) -> int:
    rows = read_catches()
    for rule in set(rows) - set(rules()):
        del rows[rule]
    todo = [rule for rule in rules() if not wanted or any(map(rule.startswith, wanted))]
    jobs = min(2, os.cpu_count() or 1)
    free: SimpleQueue[Nursery] = SimpleQueue()

    def one(rule: str) -> tuple[str, list[Catch]]:
        nursery = free.get()
        try:
            return rule, search(nursery, rule, rows.get(rule, []))
        finally:
            free.put(nursery)

    missed = 0
    nurseries = [Nursery() for _ in range(jobs)]
    for nursery in nurseries:
        free.put(nursery)
    with ThreadPoolExecutor(jobs) as pool:
        for rule, catches in pool.map(one, todo):
            rows[rule] = catches
            print(rule, *(f"{c.variant} {c.vector}" for c in catches), flush=True)
            missed += not catches
            write(rows)
    for nursery in nurseries:
        with nursery:
            pass
    print(f"{len(todo)} rules, {missed} that nothing notices")
    return int(bool(missed))
