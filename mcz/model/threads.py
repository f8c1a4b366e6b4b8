"""Numbers of threads that work on a file, and the work that they share.

Compiled loops and hashes release the interpreter lock, so independent segments are decoded and
coded in parallel. The result does not depend on the number.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf
from time import perf_counter
from typing import TypeVar

from mcz.errors import OptionError

Item = TypeVar("Item")
Result = TypeVar("Result")

LEAST_PARALLEL_SECONDS = 0.01  # seconds: work that takes less is done in one thread

_PACES: dict[str, float] = {}  # last measured seconds for one unit of amount, by the kind of work
_LIMIT: ContextVar[int | None] = ContextVar("threads", default=None)


def thread_limit() -> int:
    """Number of threads that a call may use: by default one a processor."""
    return _LIMIT.get() or processors()


def processors() -> int:
    """Number of processors that the process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def limit_threads(threads: int | None) -> Iterator[None]:
    """Limit the threads of calls within the block; None: keep the present limit."""
    token = _LIMIT.set(check_threads(threads) or _LIMIT.get())
    try:
        yield
    finally:
        _LIMIT.reset(token)


def check_threads(threads: int | None) -> int | None:
    """Return ``threads``; raises OptionError for a number below 1."""
    if threads is not None and threads < 1:
        raise OptionError(f"threads is {threads}; it must be at least 1")
    return threads


@contextmanager
def timing(kind: str, amount: int) -> Iterator[None]:
    """Measure how long work of some kind takes."""
    start = perf_counter()
    yield
    _PACES[kind] = (perf_counter() - start) / max(amount, 1)


def useful_threads(kind: str, amount: int, threads: int) -> int:
    """``threads``, or 1 if this work takes less than ``LEAST_PARALLEL_SECONDS``."""
    return threads if _PACES.get(kind, inf) * amount >= LEAST_PARALLEL_SECONDS else 1


def map_in_order(
    function: Callable[[Item], Result], items: Sequence[Item], threads: int
) -> Iterator[Result]:
    """Map ``function`` over the items, in order; few results wait, so that memory is bounded.

    The calling thread computes one of every ``threads`` items.
    """
    if threads < 2 or len(items) < 2:
        yield from map(function, items)
        return
    from concurrent.futures import ThreadPoolExecutor  # on first use

    with ThreadPoolExecutor(threads - 1) as pool:
        for first in range(0, len(items), threads):
            futures = [pool.submit(function, item) for item in items[first + 1 : first + threads]]
            try:
                yield function(items[first])
                for future in futures:
                    yield future.result()
            finally:
                for future in futures:
                    future.cancel()
