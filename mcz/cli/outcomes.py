"""How commands over many files end: a count of each result, one line an error, an exit code."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, plural, print_json, printable, say

if TYPE_CHECKING:
    from mcz.editing.archive import Outcome, Report


TOLD = ("skipped", "verbatim", "salvaged", "dropped", "damaged")  # results whose reason is said


def _table(report: Report) -> Iterator[str]:
    """What became of the files of each kind, where there is more than one kind."""
    kinds: dict[str, list[Outcome]] = {}
    for outcome in report.outcomes:
        kinds.setdefault(PurePosixPath(outcome.path).suffix.lower() or "-", []).append(outcome)
    if len(kinds) < 2:
        return
    yield f"  {'kind':<8} {'files':>7} {'bytes':>15}  results"
    for kind, outcomes in sorted(kinds.items()):
        counts = Counter(outcome.result for outcome in outcomes)
        results = ", ".join(f"{n:,} {result}" for result, n in sorted(counts.items()))
        size = sum(outcome.size for outcome in outcomes)
        yield f"  {kind:<8} {len(outcomes):>7,} {size:>15,}  {results}"


def _damage(report: Report) -> dict[str, list[str]]:
    return {"damage": report.damage} if report.damage else {}


def conclude(report: Report, target: str, as_json: bool) -> Exit:
    """Print what became of the files; the errors last, one line each on standard error."""
    if as_json:
        rows = [
            {"path": o.path, "result": o.result, "bytes": o.size, "message": o.message}
            for o in report.outcomes
        ]
        print_json({"target": target, "files": rows} | _damage(report))
    else:
        counts = Counter(outcome.result for outcome in report.outcomes)
        shown = ", ".join(f"{n:,} {result}" for result, n in sorted(counts.items()))
        size = sum(outcome.size for outcome in report.outcomes)
        click.echo(
            printable(
                f"{target}: {plural(len(report.outcomes), 'file')}, {size:,} bytes"
                + (f" ({shown})" if shown else "")
            )
        )
        for line in _table(report):
            click.echo(printable(line))
        for outcome in report.outcomes:
            if outcome.result in TOLD and outcome.message:
                say(f"{outcome.path}: {outcome.result}: {outcome.message}")
    for failure in report.failures:
        named = failure.path in failure.message
        say(failure.message if named else f"{failure.path}: {failure.message}")
    if any(failure.result == "failed" for failure in report.failures):
        return Exit.BAD_INPUT
    if report.failures:
        return Exit.USAGE
    for line in report.damage:
        say(f"salvage: {line}")
    lost = report.damage or report.count("salvaged") or report.count("damaged")
    return Exit.SALVAGED if lost else Exit.FINE
