"""Work as tasks that run in processes of their own; results come from the cache where it has them.

A task is a function's name and plain arguments, so that it travels between processes and makes a
key. Speeds and memory are measured one task at a time, with nothing else of ours running.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from mcz.bench import deflated, ladder, measure, peers
from mcz.bench.cache import Cache
from mcz.bench.cases import Case, Variant, load, why
from mcz.codecs import by_name
from mcz.errors import MczError

Progress = Callable[[int, int, str], None]
NONE = Variant("")  # of tasks that are about no codec


@dataclass(frozen=True, slots=True)
class Task:
    """``kind`` names a row of ``KINDS``; ``arguments`` are those behind case and variant."""

    kind: str
    case: Case
    variant: Variant = NONE
    arguments: tuple[Any, ...] = ()

    @property
    def label(self) -> str:
        return " ".join(word for word in (self.case.name, self.variant.label, self.kind) if word)


def _sweep(task: Task) -> Any:
    return ladder.sweep(task.case, task.variant, *task.arguments)


def _point(task: Task) -> Any:
    return measure.point(task.case, task.variant, dict(task.arguments))


def _at(task: Task) -> Any:
    return ladder.at_figure(task.case, task.variant, *task.arguments)


def _deflated(task: Task) -> Any:
    return {"bytes": deflated.deflated_bytes(task.case, task.variant, *task.arguments)}


def _resolutions(task: Task) -> Any:
    joint, *params = task.arguments
    return measure.resolutions(task.case, task.variant, dict(params), joint)


def _speeds(task: Task) -> Any:
    return measure.speeds(task.case, task.variant, dict(task.arguments))


def _peers(task: Task) -> Any:
    return peers.measure(load(task.case))


KINDS = {
    "sweep": _sweep,  # n_points
    "point": _point,  # pairs of parameter and value
    "deflated": _deflated,  # threshold
    "at": _at,  # metric, wanted, where to begin
    "resolutions": _resolutions,  # joint, pairs of parameter and value
    "speeds": _speeds,  # pairs of parameter and value
    "peers": _peers,  # names of the installed ones
}
ALONE = ("speeds", "peers")


def perform(task: Task) -> Any:
    """The result of a task; ``{"error": ...}`` where the clip or a parameter is refused."""
    try:
        return KINDS[task.kind](task)
    except MczError as error:
        return {"error": why(error)}


def key_of(task: Task) -> str:
    """What the result depends on, the package itself apart."""
    codec = by_name(task.variant.codec) if task.variant.codec else None
    return json.dumps(
        [
            task.kind,
            load(task.case).digest,
            [codec.id, codec.name, codec.version] if codec else [],
            task.variant.params,
            task.arguments,
        ]
    )


class Runner:
    """Runs tasks in ``jobs`` processes; one of them means this one, speeds apart."""

    def __init__(self, jobs: int, cache: Cache, progress: Progress | None = None) -> None:
        self.jobs, self.cache = jobs, cache
        self.progress = progress or (lambda done, total, what: None)
        self.n_cached = self.n_run = 0

    def run(self, tasks: Iterable[Task]) -> dict[Task, Any]:
        """Results by task, those that share a clip one after the other."""
        wanted = sorted(dict.fromkeys(tasks), key=lambda task: (task.kind in ALONE, task.case.path))
        results: dict[Task, Any] = {}
        missing = []
        for task in wanted:
            found = self.cache.get(key_of(task))
            if found is None:
                missing.append(task)
            else:
                results[task] = found
        self.n_cached += len(results)
        self.n_run += len(missing)
        alone = [task for task in missing if task.kind in ALONE]
        for part, jobs in ((missing[: len(missing) - len(alone)], self.jobs), (alone, 1)):
            self._run_part(part, jobs, results, len(wanted))
        return results

    def _run_part(
        self, tasks: Sequence[Task], jobs: int, results: dict[Task, Any], total: int
    ) -> None:
        if not tasks:
            return
        if jobs == 1 and tasks[0].kind not in ALONE:
            for task in tasks:
                self.progress(len(results), total, task.label)
                self._keep(task, perform(task), results)
            return
        # New processes, not copies of this one: their memory is their own.
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            self._collect(pool, tasks, jobs, results, total)

    def _collect(
        self,
        pool: Executor,
        tasks: Sequence[Task],
        jobs: int,
        results: dict[Task, Any],
        total: int,
    ) -> None:
        waiting = list(tasks)[::-1]
        running: dict[Any, Task] = {}
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.pop()
                running[pool.submit(perform, task)] = task
            done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in done:
                self._keep(running.pop(future), future.result(), results)
            if running:
                self.progress(len(results), total, next(iter(running.values())).label)

    def _keep(self, task: Task, result: Any, results: dict[Task, Any]) -> None:
        results[task] = result
        self.cache.put(key_of(task), result)
