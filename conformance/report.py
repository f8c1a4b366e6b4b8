"""The page for a person: what failed, tables, and the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from conformance.encode import Result
from conformance.outcome import Outcome
from conformance.summary import STATUSES, Report, badge, encoder_table, requirements, tables

WIDTHS = (8, 8, 11)  # of the columns of STATUSES


def text(report: Report) -> str:
    """The page for a person: what failed, the tables, the result."""
    parts = [_failures(report.outcomes), *map("\n".join, _tables(report)), _lacks(report)]
    if report.results is not None:
        parts.append(_encoder(report.results))
    parts += ["\n".join(report.remarks), _sums(report)]
    return "\n\n".join(part for part in parts if part)


def _failures(outcomes: Iterable[Outcome]) -> str:
    lines = []
    for outcome in outcomes:
        for words, fault in outcome.faults:
            lines.append(f"FAIL {outcome.file}: {f'{words}: ' if words else ''}{fault}")
        if outcome.faults:
            lines.append(f"     {outcome.vector['purpose']}")
            ids = outcome.vector.get("requirements")
            lines += [f"     requirements: {', '.join(ids)}"] if ids else []
            last_line = outcome.stderr.splitlines()[-1:]
            lines += [f"     stderr: {line[:200]}" for line in last_line]
    return "\n".join(lines)


def _tables(report: Report) -> Iterator[list[str]]:
    for title, table in tables(report.outcomes).items():
        head = f"{title:<24}{'passed':>8}{'failed':>8}{'not asked':>11}"
        yield [head, *(_line(key, row) for key, row in table.items())]
    kinds = Counter(fault.kind for o in report.outcomes for _, fault in o.faults)
    if kinds:
        yield ["faults", *(f"  {kind:<30}{n:>8}" for kind, n in kinds.most_common())]
    yield _requirements(report.outcomes)


def _line(key: str, row: Counter[str]) -> str:
    widths = zip(STATUSES, WIDTHS, strict=True)
    return f"  {key:<22}" + "".join(f"{row[status]:>{width}}" for status, width in widths)


def _requirements(outcomes: Sequence[Outcome]) -> list[str]:
    """A line for each section of SPEC.md, and one for each requirement that a vector denies."""
    counts = requirements(outcomes)
    sections: dict[str, Counter[str]] = {}
    for name, lists in counts.items():
        status = next(s for s in ("failed", "passed", "not asked") if lists[s])
        sections.setdefault(name.rpartition("-")[0], Counter())[status] += 1
    if not sections:
        return []
    lines = [f"{'requirements':<24}{'held':>8}{'broken':>8}{'not asked':>11}"]
    for section, row in sections.items():
        lines.append(_line(section, row))
    for name, lists in counts.items():
        if lists["failed"]:
            named = ", ".join(file.removesuffix(".mcz") for file in lists["failed"][:4])
            more = len(lists["failed"]) - 4
            lines.append(f"  {name} broken: {named}{f' and {more} more' if more > 0 else ''}")
    return lines


def _lacks(report: Report) -> str:
    """Capabilities that the decoder lacks, and the number of vectors skipped for them."""
    missing = Counter(lack for outcome in report.outcomes for lack in outcome.lacks)
    partly = sum(bool(o.asked and o.lacks) for o in report.outcomes)
    lines = [f"  {lack:<22}{n:>8}" for lack, n in sorted(missing.items())]
    note = f" ({partly} of these vectors were asked in part)" if partly else ""
    return "\n".join([f"not asked, for want of{note}:", *lines]) if lines else ""


def _encoder(results: Sequence[Result]) -> str:
    lines = []
    for result in results:
        name = f"{result.task.vector['file']} {result.task.name}"
        if result.fault:
            lines.append(f"FAIL encoder, {name}: {result.fault}")
        elif not result.declined and not result.deterministic:
            lines.append(f"NOTE encoder, {name}: other bytes the second time")
    head = ("restored", "failed", "declined", "same twice", "source bytes", ".mcz bytes")
    lines.append(f"{'encoder':<10}" + "".join(f"{word:>13}" for word in head))
    for name, row in encoder_table(results).items():
        lines.append(f"  {name:<8}" + "".join(f"{row[word]:>13,}" for word in head))
    return "\n".join(lines)


def _sums(report: Report) -> str:
    passed, failed, not_asked = map(report.count, STATUSES)
    rest = f", {not_asked} not asked" if not_asked else ""
    label, message, _ = badge(report)
    return (
        f"conformance: {passed} of {passed + failed} passed in {report.seconds:.1f} s\n"
        f"{passed} passed, {failed} failed{rest}\n"
        f"{label}: {message}"
    )
