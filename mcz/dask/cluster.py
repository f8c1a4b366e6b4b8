"""A Dask cluster as an engine of ``mcz.jobs``: tasks out, answers back in order."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any
from uuid import uuid4

from mcz.errors import MczError, OptionError, WorkerError
from mcz.jobs import Answer
from mcz.threads import limited

AHEAD = 3  # tasks for each thread of the cluster: what waits there and here is bounded
RETRIES = 2  # of a task whose worker failed in another way than by ending


class Cluster:
    """The workers of a ``distributed.Client``.

    Each task has a key of its own, so that one that is done again gives one answer all the same.
    """

    def __init__(self, client: Any) -> None:
        self._client = client

    @property
    def jobs(self) -> int:
        """How many tasks it does at once; raises WorkerError where it has no worker."""
        n_threads = sum(self._client.nthreads().values())
        if not n_threads:
            raise WorkerError(f"{self._client.scheduler.address}: the cluster has no worker")
        return int(n_threads)

    def in_order(
        self, function: Callable[[Any, Any], Any], items: Iterable[Any], state: Any
    ) -> Generator[Answer[Any] | None, None, None]:
        """What gives ``function(state, item)`` for each item, in order; for None, None."""
        import cloudpickle

        packed = cloudpickle.dumps((function, state))
        waiting: deque[Any] = deque()
        run, most = uuid4().hex, AHEAD * self.jobs
        try:
            for index, item in enumerate(items):
                key = f"mcz-{run}-{index}"
                waiting.append(
                    None
                    if item is None
                    else self._client.submit(done, packed, item, key=key, retries=RETRIES)
                )
                while waiting and (waiting[0] is None or len(waiting) > most):
                    yield _answer(waiting.popleft())
            while waiting:
                yield _answer(waiting.popleft())
        finally:
            for future in waiting:
                if future is not None:
                    future.cancel()


def _answer(future: Any) -> Answer[Any] | None:
    """What gives the result, and lets the cluster forget it."""
    if future is None:
        return None

    def answer() -> Any:
        from distributed.scheduler import KilledWorker

        try:
            went_well, value = future.result()
        except KilledWorker as error:
            raise WorkerError(f"the machines that worked on it were lost: {error}") from None
        except OSError as error:
            raise WorkerError(f"the cluster is lost: {error}") from None
        finally:
            future.release()
        if not went_well:
            raise value
        return value

    return answer


def done(packed: bytes, item: Any) -> tuple[bool, Any]:
    """On a worker: whether the call went well, and its result or its MczError."""
    function, state = _unpacked(packed)
    try:
        with limited(1):  # the cluster knows how many tasks a machine takes
            return True, function(state, item)
    except MczError as error:
        return False, error


@lru_cache(maxsize=4)
def _unpacked(packed: bytes) -> Any:
    """Function and state, an open file among it: kept for the next task."""
    return pickle.loads(packed)


@contextmanager
def connected(client: Any) -> Iterator[Any]:
    """The client itself, or one of the scheduler at an address ("tcp://host:8786").

    None: the client that the process has. Raises OptionError where there is none, or no Dask.
    """
    try:
        from distributed import Client, default_client
    except ImportError:
        raise OptionError("Dask is not installed; pip install 'mcz[dask]'") from None
    try:
        if isinstance(client, str):
            with Client(client) as made:
                yield made
            return
        found = default_client() if client is None else client
    except ValueError as error:
        raise OptionError(f"no Dask client: {error}") from None
    except OSError as error:
        raise OptionError(f"{client}: no scheduler answers: {error}") from None
    yield found
