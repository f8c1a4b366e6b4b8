"""Parallel processes for the files of a command or the clips of a file; results in order.

Parsing is Python, which runs in parallel only in processes: two of them pack in half the time, and
verify and unpack a lossless archive in two thirds of the time of two threads. Results do not depend
on their number.

They are separate interpreters, started without the caller's main module, so that a script needs no
guard and running threads are not forked. If a process dies, its work is repeated by another one.
Messages to a process are a length of 8 bytes and a pickle: first the number of threads and the
pickled state, then for each call a function and an item. The reply is a flag of success, and the
result or the error.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from contextvars import ContextVar
from functools import cache, partial
from queue import SimpleQueue
from threading import Lock
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, TypeVar, cast

from mcz.codecs import CODECS, ENTRIES
from mcz.errors import FormatError, OptionError, WorkerError
from mcz.hints import Hint
from mcz.model import threads
from mcz.model.types import Settings
from mcz.sources import FORMATS

if TYPE_CHECKING:
    from mcz.files.reading.file import File

LEAST_BYTES = 8_000_000  # of source files; fewer are processed before a worker has started
LEAST_STORED = 2_000_000  # the same for an MCZ file
DEFAULT_JOBS = 1  # a library must not start processes unasked

Item = TypeVar("Item")
Result = TypeVar("Result")
Answer = Callable[[], Result]  # returns a result, or raises the error of the function


class Engine(Protocol):
    """Another engine for the work of processes."""

    @property
    def jobs(self) -> int: ...

    def map_in_order(
        self, function: Callable[[Any, Item], Result], items: Iterable[Item | None], state: object
    ) -> Generator[Answer[Result] | None, None, None]: ...


_ENGINE: ContextVar[Engine | None] = ContextVar("engine", default=None)
_LIMIT: ContextVar[int | None] = ContextVar("jobs", default=None)  # most processes of a call


@contextmanager
def limit_jobs(jobs: int | None) -> Iterator[None]:
    """Limit the processes of calls within the block; None: keep the present limit.

    Raises OptionError for a number below 1.
    """
    if jobs is not None and jobs < 1:
        raise OptionError(f"jobs is {jobs}; it must be at least 1")
    token = _LIMIT.set(jobs or _LIMIT.get())
    try:
        yield
    finally:
        _LIMIT.reset(token)


def engine() -> Engine | None:
    """The engine in use instead of processes of this machine, if any."""
    return _ENGINE.get()


@contextmanager
def use_engine(engine: Engine) -> Iterator[None]:
    """Let ``engine`` do the work of all calls within the block, however small."""
    token = _ENGINE.set(engine)
    try:
        yield
    finally:
        _ENGINE.reset(token)


def useful_jobs(n_items: int, n_bytes: int, *, stored: bool = False) -> int:
    """Number of processes worth starting for ``n_items`` files of ``n_bytes`` in all.

    ``stored``: the items are clips of an MCZ file of that size.
    """
    if (in_use := engine()) is not None:
        return max(in_use.jobs, DEFAULT_JOBS + 1)
    least = LEAST_STORED if stored else LEAST_BYTES
    if n_bytes < least or getattr(sys, "frozen", False):  # a frozen program cannot start Python
        return DEFAULT_JOBS
    return max(DEFAULT_JOBS, min(_LIMIT.get() or DEFAULT_JOBS, n_items))


AHEAD = 2  # items in work or done, for each process: a bounded queue
TRIES = 2
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}


class Pool:
    """``jobs`` processes with ``state``; the end of the context ends them at once."""

    def __init__(self, jobs: int, state: object = None) -> None:
        self.jobs = jobs
        n_threads = max(
            1, threads.thread_limit() // jobs
        )  # of each process; all together have as many as one
        self._setup = pickle.dumps((n_threads, pickle.dumps(state, pickle.HIGHEST_PROTOCOL)))
        self._free: SimpleQueue[Worker | None] = SimpleQueue()
        for _ in range(jobs):
            self._free.put(None)  # started on its first work
        self._threads = ThreadPoolExecutor(jobs)
        self._workers: set[Worker] = set()
        self._closed, self._lock = False, Lock()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._closed = True
            for worker in self._workers:
                worker.process.kill()  # so that no thread waits for its reply any longer
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.end()

    @property
    def pids(self) -> list[int]:
        with self._lock:
            return [worker.process.pid for worker in self._workers]

    def map_in_order(
        self, function: Callable[[Any, Item], Result], items: Iterable[Item | None]
    ) -> Iterator[Answer[Result] | None]:
        """Yield ``function(state, item)`` for each item, in order; for None, None.

        ``function`` is one of a module. Items are read as needed, few at a time.
        """
        waiting: deque[Future[Result] | None] = deque()
        for item in items:
            waiting.append(
                None if item is None else self._threads.submit(self._call, function, item)
            )
            while waiting and (waiting[0] is None or len(waiting) > AHEAD * self.jobs):
                yield _answer(waiting.popleft())
        while waiting:
            yield _answer(waiting.popleft())

    def _call(self, function: Callable[[Any, Item], Result], item: Item) -> Result:
        """Call in a free process; runs in a thread of its own."""
        message = pickle.dumps((function, item), pickle.HIGHEST_PROTOCOL)
        for _ in range(TRIES):
            worker = self._free.get() or self._start_worker()
            reply = worker.ask(message)
            if reply is not None:
                self._free.put(worker)
                is_result, value = pickle.loads(reply)
                if not is_result:
                    raise value
                return cast(Result, value)
            worker.end()
            with self._lock:
                self._workers.discard(worker)
            self._free.put(None)
        raise WorkerError(
            f"the process that worked on it ended unexpectedly ({worker.exit_text}), {TRIES} "
            "times; perhaps too little memory is free",
            hint=Hint.JOBS,
        )

    def _start_worker(self) -> Worker:
        with self._lock:
            if self._closed:
                raise WorkerError("the work was cancelled")
            worker = Worker(self._setup)
            self._workers.add(worker)
            return worker


def _answer(future: Future[Result] | None) -> Answer[Result] | None:
    return None if future is None else future.result


class Worker:
    """One process, and its two pipes."""

    def __init__(self, setup: bytes) -> None:
        script = "from mcz.files.jobs import main; main()"
        script = f"import sys; sys.path[:] = {sys.path!r}; {script}"
        self.process = subprocess.Popen(
            [sys.executable, "-c", script],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | ONE_THREAD,
            **_SEPARATE_GROUP,
        )
        with suppress(OSError):  # the process has died; its first request reports it
            send(cast(BinaryIO, self.process.stdin), setup)

    @property
    def exit_text(self) -> str:
        code = self.process.poll()
        if code is None:
            return "without an exit code"
        return f"exit code {code}" if code >= 0 else f"signal {-code}"

    def ask(self, message: bytes) -> bytes | None:
        """Send a message; return the reply, None if the process has died."""
        try:
            send(cast(BinaryIO, self.process.stdin), message)
            reply = receive(cast(BinaryIO, self.process.stdout))
        except OSError:
            reply = None
        if reply is None:
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(1)
        return reply

    def end(self) -> None:
        """End the process now, without its results."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            with suppress(OSError):
                cast(BinaryIO, stream).close()


# An interrupt at the terminal goes to the foreground group: the pool ends its processes itself.
_SEPARATE_GROUP: Settings = (
    {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
    if os.name == "nt"
    else {"process_group": 0}
)


@contextmanager
def answers(
    function: Callable[[Any, Item], Result],
    items: Iterable[Item | None],
    jobs: int,
    state: object = None,
) -> Iterator[Iterator[Answer[Result] | None]]:
    """``Pool.map_in_order`` of a pool for this call, or of the engine in use."""
    in_use = engine()
    if in_use is not None:
        with closing(in_use.map_in_order(function, items, state)) as results:
            yield results
        return
    with Pool(jobs, state) as pool:
        yield pool.map_in_order(function, items)


LENGTH = 8


def send(stream: BinaryIO, message: bytes) -> None:
    stream.write(len(message).to_bytes(LENGTH, "little"))
    stream.write(message)
    stream.flush()


def receive(stream: BinaryIO) -> bytes | None:
    """The next message, None if the other side has closed."""
    head = stream.read(LENGTH)
    if len(head) < LENGTH:
        return None
    size = int.from_bytes(head, "little")
    message = stream.read(size)
    return message if len(message) == size else None


def main() -> None:
    """Answer requests of the parent process until it closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    setup = receive(sys.stdin.buffer)
    if setup is None:
        return
    from mcz.model.threads import limit_threads

    n_threads, packed = pickle.loads(setup)
    with limit_threads(n_threads):
        state = cache(
            partial(pickle.loads, packed)
        )  # unpickled at the first call, which reports its error
        with suppress(BrokenPipeError):  # the parent has gone
            while (message := receive(sys.stdin.buffer)) is not None:
                send(replies, _reply_to(state, message))


def _reply_to(state: Callable[[], object], message: bytes) -> bytes:
    try:
        function, item = pickle.loads(message)
        return pickle.dumps((True, function(state(), item)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # the caller gets any error
        return _failure(error)


def _failure(error: Exception) -> bytes:
    try:
        packed = pickle.dumps((False, error))
        pickle.loads(packed)
    except Exception:  # an error of a library that cannot be pickled
        packed = pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
    return packed


Shared = tuple["File", Any]  # the file, and the arguments of all calls
PACKAGE = "mcz."


@contextmanager
def share_clips(
    function: Callable[[Shared, Item], Result],
    file: File,
    items: Sequence[Item],
    arguments: object = None,
) -> Iterator[Iterator[Answer[Result]]]:
    """Yield an iterator over ``function((file, arguments), item)`` for each item, in order.

    Processes of ``mcz.files.jobs`` do it if they can open the file and are worthwhile; otherwise
    each call runs here when its answer is read.
    """
    jobs = useful_jobs(len(items), file.size, stored=True) if can_be_shared(file) else DEFAULT_JOBS
    if jobs == DEFAULT_JOBS:
        yield (partial(function, (file, arguments), item) for item in items)
        return
    with answers(
        partial(_check_and_call, function), items, jobs, (file, file.size, arguments)
    ) as results:
        yield cast(Iterator[Answer[Result]], results)  # no item is None


def _check_and_call(
    function: Callable[[Shared, Item], Result], state: tuple[File, int, Any], item: Item
) -> Result:
    file, size, arguments = state
    if file.size != size:
        raise FormatError(
            f"the file changed meanwhile: it has {file.size} bytes, before {size}", path=file.name
        )
    return function((file, arguments), item)


def can_be_shared(file: File) -> bool:
    """Return True if another process can open the same file.

    False for streams, growing files and clips found by salvage.
    """
    container = file.container
    if container.salvage or file.damage or file.grows or container.source.target is None:
        return False
    return has_only_builtins()


def has_only_builtins() -> bool:
    """Return True if every codec and format is built in, so that another process has it."""
    formats = all(source.read.__module__.startswith(PACKAGE) for source in FORMATS.values())
    return formats and set(CODECS) <= set(ENTRIES)
