"""A Dask cluster as an engine of ``mcz.files.jobs``: tasks out, answers back in order."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from mcz.errors import MczError, OptionError, WorkerError
from mcz.files.jobs import Answer, Item, Result
from mcz.model.extras import import_extra
from mcz.model.threads import limit_threads

if TYPE_CHECKING:
    from distributed import Client, Future

AHEAD = 3  # tasks for each thread of the cluster: a bounded queue there and here
TRIES = 3  # of a task that the machines were lost with
RETRIES = 2  # of a task whose worker failed but did not end


class Cluster:
    """The workers of a ``distributed.Client``.

    Each task has a key of its own, so that a repeated one gives one answer.
    """

    def __init__(self, client: Client) -> None:
        self._client = client

    @property
    def jobs(self) -> int:
        """Number of parallel tasks; raises WorkerError for a cluster without workers."""
        n_threads = sum(self._client.nthreads().values())
        if not n_threads:
            raise WorkerError("the cluster has no worker", path=self._client.scheduler.address)
        return int(n_threads)

    def in_order(
        self, function: Callable[[Any, Item], Result], items: Iterable[Item | None], state: object
    ) -> Generator[Answer[Result] | None, None, None]:
        """Yield ``function(state, item)`` for each item, in order; for None, None."""
        import cloudpickle

        packed = cloudpickle.dumps((function, state))
        waiting: deque[Task | None] = deque()
        run, most = uuid4().hex, AHEAD * self.jobs
        try:
            for index, item in enumerate(items):
                key = f"mcz-{run}-{index}"
                waiting.append(None if item is None else Task(self._client, key, packed, item))
                while waiting and (waiting[0] is None or len(waiting) > most):
                    yield _answer(waiting.popleft())
            while waiting:
                yield _answer(waiting.popleft())
        finally:
            for left in waiting:
                if left is not None:
                    left.future.cancel()


class Task:
    """One call, in work on the cluster from now on."""

    def __init__(self, client: Client, key: str, packed: bytes, item: object) -> None:
        self._client, self._key, self._call = client, key, (run_task, packed, item)
        self.future = self._submitted(0)

    def _submitted(self, again: int) -> Future:
        return self._client.submit(*self._call, key=f"{self._key}-{again}", retries=RETRIES)

    def answer(self) -> Any:
        """The result, or the MczError of the call; the cluster forgets both."""
        for again in range(1, TRIES + 1):
            try:
                went_well, value = self._outcome()
            except WorkerError:
                # Dask blames all that was in the hands of a machine that ended: once more, when
                # the task that ended it may be over.
                if again == TRIES:
                    raise
                self.future = self._submitted(again)
                continue
            if not went_well:
                raise value
            break
        return value

    def _outcome(self) -> Any:
        from distributed.scheduler import KilledWorker

        try:
            return self.future.result()
        except KilledWorker as error:
            raise WorkerError(f"the machines that worked on it were lost: {error}") from None
        except OSError as error:
            raise WorkerError(f"the cluster is lost: {error}") from None
        finally:
            self.future.release()


def _answer(task: Task | None) -> Answer[Any] | None:
    return None if task is None else task.answer


def run_task(packed: bytes, item: object) -> tuple[bool, object]:
    """Call on a worker: True and the result, or False and the MczError."""
    function, state = _unpack(packed)
    try:
        with limit_threads(1):  # the cluster decides how many tasks a machine runs
            return True, function(state, item)
    except MczError as error:
        return False, error


@lru_cache(maxsize=4)
def _unpack(packed: bytes) -> Any:
    """Function and state, perhaps with an open file: kept for the next task."""
    return pickle.loads(packed)


@contextmanager
def connect(client: Client | str | None) -> Iterator[Client]:
    """The client itself, or one of the scheduler at an address ("tcp://host:8786").

    None: the client of the process. Raises OptionError if there is none, or no Dask.
    """
    dask = import_extra("distributed", "dask", package="Dask")
    try:
        if isinstance(client, str):
            with dask.Client(client) as made:
                yield made
            return
        chosen_client = dask.default_client() if client is None else client
    except ValueError as error:
        raise OptionError(f"no Dask client: {error}") from None
    except OSError as error:
        raise OptionError(f"no scheduler answers: {error}", path=client) from None
    yield chosen_client
