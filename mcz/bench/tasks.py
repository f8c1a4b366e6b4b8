"""Work as tasks that run in processes of their own; results come from the cache where it has them.

A task is a function's name and plain arguments, so that it travels between processes and makes a
key. Speeds and memory are measured one task at a time, with nothing else of ours running.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from mcz.bench import curves, deflated, kwak_work, ladder, measure, peers, spatial, ways_back
from mcz.bench.cache import Cache
from mcz.bench.cases import Case, Variant, load, why
from mcz.codecs import by_name
from mcz.errors import MczError

Progress = Callable[[int, int, str], None]
THREADS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"),
    "VECLIB_MAXIMUM_THREADS",
)
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
    return kwak_work.perform(task.case, task.variant, *task.arguments)


def _kwak_speeds(task: Task) -> Any:
    return kwak_work.speeds(task.case, *task.arguments)


KINDS = {
    "sweep": _sweep,  # n_points
    "point": _point,  # pairs of parameter and value
    "deflated": _deflated,  # threshold
    "at": _at,  # metric, wanted, where to begin
    "resolutions": _resolutions,  # joint, pairs of parameter and value
    "speeds": _speeds,  # pairs of parameter and value
    "peers": _peers,  # names of the installed ones
    "curve": _curve,  # bases as text, if any
    "bases": _bases,  # clips, pairs of a recipe
    "convergence": _convergence,  # clips, iterations, every so many frames
    "spatial": _spatial,  # clips, pairs of name and bases as text
    "speeds_beside": _speeds_beside,  # triples of codec, its parameters, setting
    "way_back": _way_back,  # step in cm, whether with virtual markers
    "kwak": _kwak,  # what, form of the clip, what it says
    "kwak_speeds": _kwak_speeds,  # form of the clip, triples of codec, its parameters, more
}
ALONE = ("speeds", "peers", "speeds_beside", "kwak_speeds")


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


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that start meanwhile multiply matrices in one thread.

    CPU time is that of all threads, and those of BLAS wait for each other by running.
    """
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


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
        # New processes, not copies of this one: their memory is their own, and their threads.
        with ExitStack() as stack:
            if tasks[0].kind in ALONE:
                stack.enter_context(_one_thread())
            pool = stack.enter_context(ProcessPoolExecutor(jobs, mp_context=get_context("spawn")))
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
