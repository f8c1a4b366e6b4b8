"""How commands end that carry clips over to another file: counts, and what was left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, echo, existing, plural, print_json, say
from mcz.cli.suffixes import file_in

if TYPE_CHECKING:
    from mcz.editing.outcomes import Report

Function = Callable[..., object]


def output_option(function: Function) -> Function:
    """``-o``, without which a file is rewritten in its own place."""

    @wraps(function)
    def command(*, file: str, output: str | None, **options: object) -> object:
        existing(file)
        return function(file=file, output=output and file_in(output, file), **options)

    return click.option(
        "-o",
        "--output",
        metavar="OUT.mcz",
        help="Write OUT.mcz and leave FILE.mcz as it is. Default: FILE.mcz is replaced once the "
        "new one is whole.",
    )(command)


def conclude(report: Report, target: str, as_json: bool, told: tuple[str, ...]) -> Exit:
    """Print what became of the clips; those with a result of ``told`` one by one."""
    counts = Counter(outcome.result for outcome in report.outcomes)
    if as_json:
        rows = [{"name": o.path, "result": o.result, "message": o.message} for o in report.outcomes]
        document = {"target": target, "bytes": report.size, "counts": counts}
        print_json(document | {"names": rows, "left_out": report.left_out})
        return Exit.FINE
    shown = ", ".join(f"{n:,} {result}" for result, n in sorted(counts.items()))
    size = "" if report.size is None else f"; the file {report.size:,} bytes"
    echo(f"{target}: {plural(len(report.outcomes), 'name')} ({shown}){size}")
    for outcome in report.outcomes:
        if outcome.result in told:
            arrow = "as" if outcome.result == "renamed" else "-"
            echo(f"  {outcome.path}: {outcome.result} {arrow} {outcome.message}")
    for text in report.left_out:
        say(f"left out: {text}")
    return Exit.FINE
