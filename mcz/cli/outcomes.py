"""How commands over many files end: a count of each result, one line an error, an exit code."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, plural, print_json, printable, say

if TYPE_CHECKING:
    from mcz.archive import Report


def conclude(report: Report, target: str, as_json: bool) -> Exit:
    """Print what became of the files; the errors last, one line each on standard error."""
    if as_json:
        rows = [
            {"path": o.path, "result": o.result, "bytes": o.size, "message": o.message}
            for o in report.outcomes
        ]
        print_json({"target": target, "files": rows})
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
        for outcome in report.outcomes:
            if outcome.result == "skipped":
                say(f"{outcome.path}: skipped: {outcome.message}")
    for failure in report.failures:
        named = failure.path in failure.message
        say(failure.message if named else f"{failure.path}: {failure.message}")
    return Exit.BAD_INPUT if report.failures else Exit.FINE
