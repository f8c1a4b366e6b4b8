"""A whole run: what is measured, the document, the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import mcz
from mcz.bench import hou2016, khan2014, khan2016, kwak, peers, sweep
from mcz.bench.cases import Case, Variant, find_cases, named, variants_of
from mcz.bench.panels import Panels
from mcz.bench.sweep import ClipResult
from mcz.bench.tables import Table
from mcz.bench.tasks import Runner, Task
from mcz.errors import OptionError

PAPERS: dict[str, ModuleType] = {
    "khan2014": khan2014,
    "khan2016": khan2016,
    "hou2016": hou2016,
    "kwak": kwak,
}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run found: clips that were swept, tables, plots, and what is to be said."""

    clips: list[ClipResult] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    panels: list[Panels] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def document(self) -> dict[str, Any]:
        return {
            "mcz": mcz.__version__,
            "clips": [clip.document() for clip in self.clips],
            "tables": [table.document() for table in self.tables],
            "notes": self.notes,
        }

    def markdown(self, plots: Sequence[str]) -> Iterator[str]:
        yield "# Codecs compared"
        yield ""
        yield f"By mcz {mcz.__version__}; its SPEC.md defines sizes, ratios and metrics."
        yield ""
        for note in self.notes:
            yield f"- {note}"
        if self.notes:
            yield ""
        for plot in plots:
            yield f"![{plot}]({plot})"
            yield ""
        for table in self.tables:
            yield from table.markdown()


def bench(
    paths: Sequence[str],
    runner: Runner,
    *,
    codecs: Sequence[str] = (),
    papers: Sequence[str] = (),
    with_sweep: bool = True,
    with_peers: bool = False,
    speeds: bool = True,
    unit: str | None = None,
) -> Outcome:
    """Measure the clips of ``paths``; raises OptionError for an unknown codec or no clip at all."""
    variants = variants_of(codecs)
    outcome = Outcome()
    for paper in papers:
        _paper(outcome, PAPERS[paper], paper, paths, unit, runner)
    if with_sweep or not papers:
        cases = named(find_cases(paths, unit))
        _sweep(outcome, cases, variants, runner, speeds=speeds, with_peers=with_peers)
    return outcome


def _paper(
    outcome: Outcome,
    module: ModuleType,
    paper: str,
    paths: Sequence[str],
    unit: str | None,
    runner: Runner,
) -> None:
    """Add the tables of a paper for its clips among ``paths``."""
    if module is kwak:
        _kwak(outcome, paths, unit, runner)
        return
    wanted: tuple[str, ...] = module.NAMES
    cases = {case.name: case for case in find_cases(paths, unit, wanted) if case.name in wanted}
    cases = {name: cases[name] for name in wanted if name in cases}
    if not cases:
        raise OptionError(f"{paper}: none of its clips is here: {', '.join(wanted)}")
    absent = [name for name in wanted if name not in cases]
    if absent:
        outcome.notes.append(f"{paper}: clips that are not here: {', '.join(absent)}")
    if left := module.missing():
        outcome.notes.append(f"{paper}: codecs that this version does not have: {', '.join(left)}")
    results: Mapping[Task, Any]
    if module is hou2016:
        found = hou2016.measure(runner, cases, _beside(paths, unit))
        results = found.results
        outcome.tables.extend(hou2016.tables(found))
        outcome.panels.extend(hou2016.panels(found))
    else:
        results = runner.run(module.tasks(cases))
        outcome.tables.extend(module.tables(cases, results))
    _refusals(outcome, results)


def _kwak(outcome: Outcome, paths: Sequence[str], unit: str | None, runner: Runner) -> None:
    """The same of one whose clips are not told by name alone."""
    found = kwak.measure(runner, kwak.find_clips(paths, unit))
    here = {clip.stem for clip in found.clips}
    absent = [name for name in kwak.NAMES if name not in here]
    if absent:
        outcome.notes.append(f"kwak: clips that are not here: {', '.join(absent)}")
    outcome.tables.extend(kwak.tables(found))
    outcome.panels.extend(kwak.panels(found))
    _refusals(outcome, found.results)


def _refusals(outcome: Outcome, results: Mapping[Task, Any]) -> None:
    for task, result in results.items():
        if isinstance(result, dict) and "error" in result:
            outcome.notes.append(f"{task.label}: {result['error']}")


def _beside(paths: Sequence[str], unit: str | None) -> dict[str, Case]:
    """The clips at hand that bases are learned from, those of the tables not left out."""
    names = sorted({case.name for case in find_cases(paths, unit)})
    wanted = hou2016.others(names)
    found = [case for case in find_cases(paths, unit, wanted) if case.name in wanted]
    return {case.name: case for case in reversed(found)}  # of one name the first


def _sweep(
    outcome: Outcome,
    cases: Mapping[str, Case],
    variants: Sequence[Variant],
    runner: Runner,
    *,
    speeds: bool,
    with_peers: bool,
) -> None:
    asked = peers.installed() if with_peers else ()
    clips = sweep.measured(runner, cases, variants, speeds=speeds, peers=asked)
    outcome.clips.extend(clips)
    for clip in clips:
        outcome.tables.extend(sweep.tables(clip))
        outcome.notes.extend(
            f"{clip.name}, {curve.label}: {curve.error}" for curve in clip.curves if curve.error
        )
    if with_peers and peers.missing():
        outcome.notes.append(f"peers that are not installed: {', '.join(peers.missing())}")
