"""Segments that are coded by other threads before they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from itertools import islice
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

Streams = tuple[bytes, ...]
Span = tuple[int, int]  # frames first <= f < stop
Prepare = Callable[[int, int], Callable[[], Streams]]  # takes frames; the rest may be done anywhere


class Ahead(AbstractContextManager["Ahead"]):
    """Codes the segment that is asked for, and meanwhile those that are likely to be next."""

    def __init__(self, prepare: Prepare, threads: int) -> None:
        self._prepare = prepare
        self._threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._begun: dict[Span, Future[Streams]] = {}

    def code(self, span: Span, following: Iterator[Span]) -> Streams:
        """The streams of ``span``. Nothing depends on ``following`` but how long it takes."""
        if self._threads < 2:
            return self._prepare(*span)()
        wanted = [span, *islice(following, self._threads)]
        if self._pool is None:
            if len(wanted) < 2:
                return self._prepare(*span)()
            from concurrent.futures import ThreadPoolExecutor  # on first use

            self._pool = ThreadPoolExecutor(self._threads)
        for other in self._begun.keys() - set(wanted):
            self._begun.pop(other).cancel()
        for other in wanted:
            if other not in self._begun:
                self._begun[other] = self._pool.submit(self._prepare(*other))
        return self._begun.pop(span).result()

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
