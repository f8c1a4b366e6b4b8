"""Numbers of processes that work on the files of a command, and when they pay.

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
ONE = 1  # in a library nobody expects processes that were not asked for

Item = TypeVar("Item")
Result = TypeVar("Result")
Answer = Callable[[], Result]  # gives a result, or raises what the function has raised


class Engine(Protocol):
    """Another engine for the work of processes."""

    @property
    def jobs(self) -> int: ...

    def in_order(
        self, function: Callable[[Any, Item], Result], items: Iterable[Item | None], state: object
    ) -> Generator[Answer[Result] | None, None, None]: ...


_ENGINE: ContextVar[Engine | None] = ContextVar("engine", default=None)
_LIMIT: ContextVar[int | None] = ContextVar("jobs", default=None)


def in_force() -> int:
    """Number of processes that a call may use: one, unless more are asked for."""
    return _LIMIT.get() or ONE


@contextmanager
def limited(jobs: int | None) -> Iterator[None]:
    """Let what is called meanwhile use so many processes; None: as many as before.

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
    """Let ``engine`` do what is called meanwhile, however little it is."""
    token = _ENGINE.set(engine)
    try:
        yield
    finally:
        _ENGINE.reset(token)


def useful_jobs(n_items: int, n_bytes: int, *, stored: bool = False) -> int:
    """Number of processes that pay for so many files of so many bytes in all.

    ``stored``: they are clips of an MCZ file of that size.
    """
    if (other := engine()) is not None:
        return max(other.jobs, ONE + 1)
    least = LEAST_STORED if stored else LEAST_BYTES
    if n_bytes < least or getattr(sys, "frozen", False):  # which has no interpreter to start
        return ONE
    return max(ONE, min(in_force(), n_items))


def threads_each(jobs: int) -> int:
    """Threads of each of ``jobs`` processes: all together as many as one would use."""
    return max(1, threads.in_force() // jobs)
