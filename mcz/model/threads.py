"""Numbers of threads that work on a file, and the work that they share.

Compiled loops and hashes let other threads run, so segments that need nothing of each other are
decoded and coded at once. What comes out does not depend on the number.
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

WORTH = 0.01  # seconds of work that threads are started for

_PACES: dict[str, float] = {}  # seconds for one of an amount, the last time, by the kind of work
_LIMIT: ContextVar[int | None] = ContextVar("threads", default=None)


def in_force() -> int:
    """Number of threads that a call may use: by default one a processor."""
    return _LIMIT.get() or processors()


def processors() -> int:
    """Number of processors that the process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def limited(threads: int | None) -> Iterator[None]:
    """Let what is called meanwhile use so many threads; None: as many as before."""
    token = _LIMIT.set(checked(threads) or _LIMIT.get())
    try:
        yield
    finally:
        _LIMIT.reset(token)


def checked(threads: int | None) -> int | None:
    """The same number; raises OptionError for one below 1."""
    if threads is not None and threads < 1:
        raise OptionError(f"threads: {threads}, not at least 1")
    return threads


@contextmanager
def timed(kind: str, amount: int) -> Iterator[None]:
    """Note how long work of some kind takes."""
    start = perf_counter()
    yield
    _PACES[kind] = (perf_counter() - start) / max(amount, 1)


def worthwhile(kind: str, amount: int, threads: int) -> int:
    """``threads``, or 1 where so much work of this kind is done as soon as they are started."""
    return threads if _PACES.get(kind, inf) * amount >= WORTH else 1


def in_order(
    function: Callable[[Item], Result], items: Sequence[Item], threads: int
) -> Iterator[Result]:
    """``function`` of each item, in order; few results wait, so that memory is bounded.

    The thread that asks takes one of as many items as there are threads.
    """
    if threads < 2 or len(items) < 2:
        yield from map(function, items)
        return
    from concurrent.futures import ThreadPoolExecutor  # on first use

    with ThreadPoolExecutor(threads - 1) as pool:
        for first in range(0, len(items), threads):
            others = [pool.submit(function, item) for item in items[first + 1 : first + threads]]
            try:
                yield function(items[first])
                for other in others:
                    yield other.result()
            finally:
                for other in others:
                    other.cancel()
