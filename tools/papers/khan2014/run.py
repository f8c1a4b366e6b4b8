"""Its tables, from clips to figures."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.bench.tasks import Runner
from tools.papers.khan2014.tables import NAMES, missing_codecs, tables, tasks
from tools.papers.outcome import BenchResult, add, cases_by_name, cases_of, without


def khan2014(outcome: BenchResult, paths: Sequence[str], unit: str | None, runner: Runner) -> None:
    """Add the paper's tables; raises OptionError where none of its clips is among ``paths``."""
    cases = cases_of(outcome, "khan2014", NAMES, cases_by_name(paths, unit))
    without(outcome, "khan2014", missing_codecs())
    results = runner.run(tasks(cases))
    add(outcome, tables(cases, results), results)
