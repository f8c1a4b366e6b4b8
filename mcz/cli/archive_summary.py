"""Summaries of commands over many files or clips: counts of results, errors, an exit code."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from mcz.cli.common import Exit, in_options
from mcz.cli.terminal import echo, plural, print_json, say
from mcz.files.reading.differences import GIVEN_BACK

if TYPE_CHECKING:
    from mcz.files.editing import Outcome, Report


STORED_RESULTS = ("parsed", "skeleton", "alias", "verbatim", "present", "written", *GIVEN_BACK)
MANY = 50  # files of one kind and reason that are named; --json names all


def _table(report: Report) -> Iterator[str]:
    """Results by kind of file; empty for a single kind."""
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


def _summary(report: Report) -> str:
    """Counts of results, and the bytes of the sources and of the MCZ file."""
    counts = Counter(outcome.result for outcome in report.outcomes)
    counts_text = ", ".join(f"{n:,} {result}" for result, n in sorted(counts.items()))
    stored = [outcome for outcome in report.outcomes if outcome.result in STORED_RESULTS]
    size = sum(outcome.size for outcome in stored)
    files = plural(len(report.outcomes), "file") + (f" ({counts_text})" if counts_text else "")
    if report.size is None:
        return f"{files}, {size:,} bytes"
    return f"{files}; sources {size:,} bytes, the file {report.size:,} bytes"


def _say_left_out(report: Report, target: str) -> None:
    """Print to standard error the number of files left out, by kind."""
    kinds = Counter(
        PurePosixPath(outcome.path).suffix.lower() or "without suffix"
        for outcome in report.outcomes
        if outcome.result == "skipped"
    )
    if kinds and report.size is not None:
        kinds_text = ", ".join(f"{count:,} {kind}" for kind, count in sorted(kinds.items()))
        say(f"{target}: left out {plural(sum(kinds.values()), 'file')}: {kinds_text}")


def _say_notes(report: Report) -> None:
    """Print to standard error why files were left out, and the notes on the others."""
    messages: Counter[tuple[str, str, str]] = Counter()
    noted: Counter[tuple[str, str]] = Counter()
    for outcome in report.outcomes:
        kind = PurePosixPath(outcome.path).suffix.lower()
        if outcome.message and outcome not in report.failures:
            messages[outcome.result, kind, outcome.message] += 1
            if messages[outcome.result, kind, outcome.message] <= MANY:
                say(f"{outcome.path}: {outcome.result}: {in_options(outcome.message)}")
        for note in outcome.notes:
            noted[kind, note] += 1
            if noted[kind, note] <= MANY:
                say(f"{outcome.path}: {in_options(note)}")
    for (result, kind, message), count in messages.items():
        if count > MANY:
            files = plural(count - MANY, f"more {kind} file".replace("  ", " "))
            say(f"{files} {result}: {in_options(message)} (--json names them)")
    for (kind, note), count in noted.items():
        if count > MANY:
            files = plural(count - MANY, f"more {kind} file".replace("  ", " "))
            say(f"{files}: {in_options(note)} (--json names them)")


def print_file_results(report: Report, target: str, as_json: bool) -> Exit:
    """Print the results of files, errors last; return the exit code."""
    if as_json:
        rows = [
            {
                "path": o.path,
                "result": o.result,
                "bytes": o.size,
                "message": in_options(o.message),
                "notes": [in_options(note) for note in o.notes],
            }
            for o in report.outcomes
        ]
        counts = Counter(outcome.result for outcome in report.outcomes)
        document = {"target": target, "bytes": report.size, "counts": counts, "files": rows}
        damage = {"damage": report.damage} if report.damage else {}
        print_json(document | damage | {"left_out": report.left_out})
    else:
        echo(f"{target}: {_summary(report)}", *_table(report))
    _say_left_out(report, target)
    for text in report.left_out:
        say(f"left out: {text}")
    _say_notes(report)
    for failure in report.failures:
        say(in_options(failure.message))
    if any(failure.result == "failed" for failure in report.failures):
        return Exit.BAD_INPUT
    if report.failures:
        return Exit.USAGE
    for line in report.damage:
        say(f"salvage: {line}")
    damaged = report.count("damaged")
    if damaged and damaged == len(report.outcomes):  # no file is intact
        return Exit.BAD_INPUT
    lost = report.damage or report.count("salvaged") or damaged
    return Exit.SALVAGED if lost else Exit.FINE


def print_clip_results(report: Report, target: str, as_json: bool, listed: tuple[str, ...]) -> Exit:
    """Print the results of clips, each clip with a ``listed`` result on its own line."""
    counts = Counter(outcome.result for outcome in report.outcomes)
    if as_json:
        rows = [{"name": o.path, "result": o.result, "message": o.message} for o in report.outcomes]
        document = {"target": target, "bytes": report.size, "counts": counts}
        print_json(document | {"names": rows, "left_out": report.left_out})
        return Exit.FINE
    counts_text = ", ".join(f"{n:,} {result}" for result, n in sorted(counts.items()))
    size = "" if report.size is None else f"; the file {report.size:,} bytes"
    echo(f"{target}: {plural(len(report.outcomes), 'name')} ({counts_text}){size}")
    for outcome in report.outcomes:
        if outcome.result in listed:
            arrow = "as" if outcome.result == "renamed" else "-"
            echo(f"  {outcome.path}: {outcome.result} {arrow} {outcome.message}")
    for text in report.left_out:
        say(f"left out: {text}")
    return Exit.FINE
