"""Numbers of processes that work on the files of a command, and their break-even.

``pool.py`` runs them. Parsing is Python, which threads of one process share and processes do not:
packing takes half the time with two. Results do not depend on the number.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Protocol, TypeVar

from mcz.errors import OptionError
from mcz.model import threads

LEAST_BYTES = 8_000_000  # of source files; fewer are done before a worker has started
LEAST_STORED = 2_000_000  # the same, of an MCZ file
DEFAULT_JOBS = 1  # a library must not start processes unasked

Item = TypeVar("Item")
Result = TypeVar("Result")
Answer = Callable[[], Result]  # returns a result, or raises the error of the function


class Engine(Protocol):
    """Another engine for the work of processes."""

    @property
    def jobs(self) -> int: ...

    def in_order(
        self, function: Callable[[Any, Item], Result], items: Iterable[Item | None], state: object
    ) -> Generator[Answer[Result] | None, None, None]: ...


_ENGINE: ContextVar[Engine | None] = ContextVar("engine", default=None)
_LIMIT: ContextVar[int | None] = ContextVar("jobs", default=None)


def job_limit() -> int:
    """Number of processes that a call may use: one by default."""
    return _LIMIT.get() or DEFAULT_JOBS


@contextmanager
def limit_jobs(jobs: int | None) -> Iterator[None]:
    """Limit the processes of calls within the block; None: keep the present limit.

    Raises OptionError for a number below 1.
    """
    if jobs is not None and jobs < 1:
        raise OptionError(f"jobs: {jobs}, not at least 1")
    token = _LIMIT.set(jobs or _LIMIT.get())
    try:
        yield
    finally:
        _LIMIT.reset(token)


def engine() -> Engine | None:
    """Engine that works in place of processes of this machine, if any."""
    return _ENGINE.get()


@contextmanager
def use_engine(engine: Engine) -> Iterator[None]:
    """Let ``engine`` do the work of calls within the block, of any size."""
    token = _ENGINE.set(engine)
    try:
        yield
    finally:
        _ENGINE.reset(token)


def useful_jobs(n_items: int, n_bytes: int, *, stored: bool = False) -> int:
    """Number of processes that is worthwhile for so many files of so many bytes in all.

    ``stored``: they are clips of an MCZ file of that size.
    """
    if (other := engine()) is not None:
        return max(other.jobs, DEFAULT_JOBS + 1)
    least = LEAST_STORED if stored else LEAST_BYTES
    if n_bytes < least or getattr(sys, "frozen", False):  # has no interpreter to start
        return DEFAULT_JOBS
    return max(DEFAULT_JOBS, min(job_limit(), n_items))


def threads_each(jobs: int) -> int:
    """Threads of each of ``jobs`` processes: together as many as one process would use."""
    return max(1, threads.thread_limit() // jobs)
