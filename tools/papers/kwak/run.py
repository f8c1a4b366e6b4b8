"""Its tables, from clips to figures."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.bench.tasks import Runner
from tools.papers.kwak.clips import NAMES, find_clips
from tools.papers.kwak.panels import panels
from tools.papers.kwak.tables import tables
from tools.papers.kwak.tasks import measure, missing_codecs
from tools.papers.outcome import BenchResult, absent, add, without


def kwak(outcome: BenchResult, paths: Sequence[str], unit: str | None, runner: Runner) -> None:
    """Add the paper's tables; raises OptionError where no clip is among ``paths``."""
    found = measure(runner, find_clips(paths, unit))
    absent(outcome, "kwak", NAMES, (clip.stem for clip in found.clips))
    without(outcome, "kwak", missing_codecs())
    add(outcome, tables(found), found.results, panels(found))
