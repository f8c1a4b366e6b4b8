"""The kinds of work that papers need beside those of ``mcz bench``, by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcz.bench import tasks
from mcz.bench.cases import Variant
from mcz.bench.tasks import Task, TaskKind
from tools.papers import curves
from tools.papers.at_figure import at_figure
from tools.papers.hou2016 import spatial, ways_back
from tools.papers.khan2016.deflated import deflated_bytes
from tools.papers.khan2016.resolutions import resolutions
from tools.papers.kwak import work as kwak

HERE = Path(__file__).parent
# Results do not depend on what sets them in tables.
PRINTING = "__main__ claims outcome panels printed run tables verdicts".split()
CODE = [path for path in HERE.rglob("*.py") if path.stem not in PRINTING]


def _at(task: Task) -> Any:
    return at_figure(task.case, task.variant, *task.arguments)


def _measure_deflated(task: Task) -> Any:
    return {"bytes": deflated_bytes(task.case, task.variant, *task.arguments)}


def _resolutions(task: Task) -> Any:
    joint, *params = task.arguments
    return resolutions(task.case, task.variant, dict(params), joint)


def _curve(task: Task) -> Any:
    return curves.curve(task.case, task.variant, *task.arguments)


def _bases(task: Task) -> Any:
    return curves.bases(*task.arguments)


def _convergence(task: Task) -> Any:
    return spatial.measured_convergence(*task.arguments)


def _spatial(task: Task) -> Any:
    return spatial.measured_distortions(*task.arguments)


def _speeds_beside(task: Task) -> Any:
    given = [(Variant(codec, params), setting) for codec, params, setting in task.arguments]
    return curves.speeds_beside(task.case, given)


def _way_back(task: Task) -> Any:
    return ways_back.way_back(task.case, *task.arguments)


def _kwak(task: Task) -> Any:
    return kwak.perform(task.case, task.variant, *task.arguments)


def _kwak_speeds(task: Task) -> Any:
    return kwak.speeds(task.case, *task.arguments)


KINDS: Mapping[str, TaskKind] = {
    **tasks.KINDS,
    "at": TaskKind(_at),  # metric, wanted, where to begin
    "deflated": TaskKind(_measure_deflated),  # threshold
    "resolutions": TaskKind(_resolutions),  # joint, pairs of parameter and value
    "curve": TaskKind(_curve),  # bases as text, if any
    "bases": TaskKind(_bases),  # clips, pairs of a recipe
    "convergence": TaskKind(_convergence),  # clips, iterations, every so many frames
    "spatial": TaskKind(_spatial),  # clips, pairs of name and bases as text
    "speeds_beside": TaskKind(
        _speeds_beside, alone=True
    ),  # triples of codec, its parameters, setting
    "way_back": TaskKind(_way_back),  # step in cm, whether with virtual markers
    "kwak": TaskKind(_kwak),  # what, form of the clip, what it says
    "kwak_speeds": TaskKind(
        _kwak_speeds, alone=True
    ),  # form, triples of codec, its parameters, more
}
