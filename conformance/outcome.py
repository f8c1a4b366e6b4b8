"""Asking for all vectors, several at a time, and what became of each."""

from __future__ import annotations

import queue
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeVar

from conformance.child import Asker, Limits, Once, Worker
from conformance.judge import Fault, judge_answer
from conformance.manifest import Capabilities, Request, Vector, all_requests
from conformance.server import Server

AnyWorker = TypeVar("AnyWorker", bound=Worker)
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(slots=True)
class Outcome:
    """Result of one vector: ``asked`` counts the requests made."""

    vector: Vector
    asked: int = 0
    faults: list[tuple[str, Fault]] = field(default_factory=list)  # arguments, fault
    lacks: set[str] = field(default_factory=set)  # why requests were not made
    stderr: str = ""
    seconds: float = 0.0

    @property
    def file(self) -> str:
        return str(self.vector["file"])

    @property
    def status(self) -> str:
        """passed, failed or not asked."""
        if not self.asked:
            return "not asked"
        return "failed" if self.faults else "passed"


def capabilities(command: Sequence[str], limits: Limits) -> Capabilities:
    """Ask the command for its capabilities; ValueError if its output is malformed.

    A command that fails, or writes nothing, declares nothing.
    """
    asker = Once(command, limits)
    answer = asker.ask(["--capabilities"], b"", 2**20)
    if answer.code or answer.fault or not answer.output.strip():
        return Capabilities()
    try:
        return Capabilities.parse(answer.output)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"--capabilities writes no declaration: {error}") from None


def ask(
    vectors: Sequence[Vector],
    can: Capabilities,
    start: Callable[[], Asker],
    *,
    jobs: int,
) -> list[Outcome]:
    """Make every request that the decoder can answer; outcomes in the order of ``vectors``."""
    outcomes = {vector["file"]: Outcome(vector) for vector in vectors}
    wanted: list[Request] = []
    for vector in vectors:
        for request in all_requests(vector):
            lacks = can.lacks(request)
            outcomes[vector["file"]].lacks.update(lacks)
            wanted += [] if lacks else [request]

    def answer(asker: Asker, request: Request) -> tuple[Request, Fault | None, str, float]:
        given = asker.ask(request.arguments, request.path, request.max_output)
        return request, judge_answer(request, given), given.errors, given.seconds

    for request, fault, errors, seconds in spread(answer, wanted, start, jobs):
        outcome = outcomes[request.vector["file"]]
        outcome.asked += 1
        outcome.seconds += seconds
        if fault is not None:
            outcome.faults.append((request.words, fault))
            outcome.stderr = errors
    return list(outcomes.values())


def starter(command: Sequence[str], limits: Limits, *, serve: bool) -> Callable[[], Asker]:
    """Return a function that starts an asker of ``command``."""
    return lambda: Server(command, limits) if serve else Once(command, limits)


def spread(
    work: Callable[[AnyWorker, Item], Result],
    items: Sequence[Item],
    start: Callable[[], AnyWorker],
    jobs: int,
) -> Iterator[Result]:
    """Results of ``work`` in the order of ``items``, ``jobs`` at a time, an asker each."""
    askers = [start() for _ in range(max(1, min(jobs, len(items))))]
    free: queue.SimpleQueue[AnyWorker] = queue.SimpleQueue()
    for asker in askers:
        free.put(asker)

    def one(item: Item) -> Result:
        asker = free.get()
        try:
            return work(asker, item)
        finally:
            free.put(asker)

    pool = ThreadPoolExecutor(len(askers))
    try:
        yield from _show_progress(pool.map(one, items), len(items))
    except BaseException:  # an interrupt, too: nothing may be left running
        pool.shutdown(wait=False, cancel_futures=True)
        for asker in askers:
            asker.kill()
        raise
    finally:
        pool.shutdown()
        for asker in askers:
            asker.close()


def _show_progress(results: Iterable[Result], total: int) -> Iterator[Result]:
    """``results``, counted on a terminal."""
    shows = sys.stderr.isatty()
    for done, result in enumerate(results, 1):
        if shows and (done % 10 == 0 or done == total):
            end = "\n" if done == total else ""
            print(f"\r{done} of {total} requests", end=end, file=sys.stderr, flush=True)
        yield result
