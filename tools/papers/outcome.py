"""Common steps of a paper's run: find its clips, report missing ones, gather results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from mcz.bench.cases import Case, find_cases
from mcz.bench.report import BenchResult
from mcz.bench.tables import ResultTable
from mcz.bench.tasks import Task
from mcz.errors import OptionError
from tools.papers.panels import Panels, draw

__all__ = ["BenchResult", "absent", "add", "cases_by_name", "cases_of", "without"]


def cases_by_name(paths: Sequence[str], unit: str | None) -> dict[str, Case]:
    """The clips that ``paths`` stand for, of those of one name the first."""
    return {case.name: case for case in reversed(find_cases(paths, unit))}


def cases_of(
    outcome: BenchResult, paper: str, names: Sequence[str], found: Mapping[str, Case]
) -> dict[str, Case]:
    """A paper's clips in its order; raises OptionError where none is here."""
    cases = {name: found[name] for name in names if name in found}
    if not cases:
        raise OptionError(f"{paper}: none of its clips is here: {', '.join(names)}")
    absent(outcome, paper, names, cases)
    return cases


def absent(outcome: BenchResult, paper: str, names: Sequence[str], here: Iterable[str]) -> None:
    """Say which clips of a paper are not ``here``."""
    known = set(here)
    if left := [name for name in names if name not in known]:
        outcome.notes.append(f"{paper}: clips that are not here: {', '.join(left)}")


def without(outcome: BenchResult, paper: str, codecs: Sequence[str]) -> None:
    """Say which codecs are not here."""
    if codecs:
        left = ", ".join(codecs)
        outcome.notes.append(f"{paper}: codecs that this version does not have: {left}")


def add(
    outcome: BenchResult,
    tables: Iterable[ResultTable],
    results: Mapping[Task, Any],
    panels: Iterable[Panels] = (),
) -> None:
    """Tables, plots, and what was refused."""
    outcome.tables.extend(tables)
    if drawn := list(panels):
        outcome.figures.append(partial(draw, drawn))
    for task, result in results.items():
        if isinstance(result, dict) and "error" in result:
            outcome.notes.append(f"{task.label}: {result['error']}")
