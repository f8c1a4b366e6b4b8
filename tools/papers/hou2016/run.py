"""Its tables, from clips to figures."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.bench.tasks import Runner
from tools.papers.hou2016.panels import panels
from tools.papers.hou2016.tables import tables
from tools.papers.hou2016.tasks import NAMES, measure, missing_codecs, others
from tools.papers.outcome import BenchResult, add, cases_by_name, cases_of, without


def hou2016(outcome: BenchResult, paths: Sequence[str], unit: str | None, runner: Runner) -> None:
    """Add the paper's tables; raises OptionError where none of its clips is among ``paths``."""
    here = cases_by_name(paths, unit)
    cases = cases_of(outcome, "hou2016", NAMES, here)
    without(outcome, "hou2016", missing_codecs())
    found = measure(runner, cases, {name: here[name] for name in others(sorted(here))})
    add(outcome, tables(found), found.results, panels(found))
