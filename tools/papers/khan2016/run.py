"""Its tables, from clips to figures."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.bench.tasks import Runner
from tools.papers.khan2016.tables import NAMES, missing_presets, tables, tasks
from tools.papers.outcome import BenchResult, add, cases_by_name, cases_of, without


def khan2016(outcome: BenchResult, paths: Sequence[str], unit: str | None, runner: Runner) -> None:
    """Add the paper's tables; raises OptionError where none of its clips is among ``paths``."""
    cases = cases_of(outcome, "khan2016", NAMES, cases_by_name(paths, unit))
    without(outcome, "khan2016", missing_presets())
    results = runner.run(tasks(cases))
    add(outcome, tables(cases, results), results)
