"""Sums over what became of all vectors, and the result in one line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from conformance.encode import Result
from conformance.manifest import Capabilities
from conformance.outcome import Outcome

STATUSES = ("passed", "failed", "not asked")


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that the forms below are made from."""

    version: str  # of the format
    outcomes: Sequence[Outcome]
    can: Capabilities
    seconds: float
    total: int  # vectors in the manifest
    is_full: bool = True  # the decoder lacks nothing that one of these needs
    results: Sequence[Result] | None = None  # of the encoder, None without one
    command: str = ""
    remarks: Sequence[str] = ()

    def count(self, status: str) -> int:
        return sum(outcome.status == status for outcome in self.outcomes)

    @property
    def failed(self) -> bool:
        """True if anything failed, of the decoder or the encoder."""
        results = self.results or ()
        return self.count("failed") > 0 or any(result.fault for result in results)


def scope(report: Report) -> str:
    """Scope of a partial decoder, in a few words."""
    can = report.can
    if can.codecs is None:
        words = ["all codecs"]
    else:
        others = sorted(can.codecs - {"raw"})
        core = "core" if "raw" in can.codecs else "container"
        words = [f"{core} + {others[0]}", *others[1:]] if others else [core]
    if can.sources == frozenset():
        words.append("no sources")
    elif can.sources is not None:
        words.append(f"sources of {'/'.join(sorted(can.sources))}")
    return ", ".join(words)


def badge(report: Report) -> tuple[str, str, str]:
    """Label, message and color: the result in one line."""
    passed, failed, not_asked = map(report.count, STATUSES)
    ratio = f"{passed}/{passed + failed}"
    message = f"{ratio} full decoder" if report.is_full else f"{scope(report)}: {ratio}"
    if not_asked:
        message += f", {not_asked} not asked"
    if len(report.outcomes) < report.total:
        message += f", a selection from {report.total}"
    if report.results is not None:
        tried = [result for result in report.results if not result.declined]
        restored = sum(result.fault is None for result in tried)
        message += f", encoder {restored}/{len(tried)}"
    color = "red" if report.failed else "brightgreen" if report.is_full else "blue"
    return f"MCZ {report.version} conformance", message, color


def tables(outcomes: Iterable[Outcome]) -> dict[str, dict[str, Counter[str]]]:
    """Vectors by status, for each group and each codec."""
    counts: dict[str, dict[str, Counter[str]]] = {"group": {}, "codec": {}}
    for outcome in outcomes:
        names = outcome.vector.get("codecs")
        keys = [("group", outcome.vector["group"])]
        codecs = ["not stated"] if names is None else names or ["none"]
        keys += [("codec", name) for name in codecs]
        for table, key in keys:
            counts[table].setdefault(key, Counter())[outcome.status] += 1
    return counts


def requirements(outcomes: Iterable[Outcome]) -> dict[str, dict[str, list[str]]]:
    """The vectors of each requirement, by status."""
    statuses: dict[str, dict[str, list[str]]] = {}
    for outcome in outcomes:
        for name in outcome.vector.get("requirements", []):
            lists = statuses.setdefault(name, {status: [] for status in STATUSES})
            lists[outcome.status].append(outcome.file)
    return dict(sorted(statuses.items()))


def encoder_table(results: Iterable[Result]) -> dict[str, Counter[str]]:
    """Source files by status and format, and the bytes of those restored."""
    counts: dict[str, Counter[str]] = {}
    for result in results:
        row = counts.setdefault(result.task.format, Counter())
        row[result.status] += 1
        if result.status == "restored":
            row["same twice"] += result.deterministic
            row["source bytes"] += len(result.task.content)
            row[".mcz bytes"] += result.size
    return dict(sorted(counts.items()))
