"""Work as tasks that run in separate processes, with a cache of results.

A task has a kind and plain arguments, so that it can be sent between processes and hashed to a key.
The runner gets a table of kinds, ``KINDS`` or an extension of it, with their functions. Speeds and
memory are measured one task at a time, with no other task running.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import mcz
from mcz.bench import measure, peers
from mcz.bench.cases import Case, Variant, load, reason_of_failure
from mcz.codecs import codec_by_name
from mcz.errors import MczError, SkeletonWarning

Progress = Callable[[int, int, str], None]
THREADS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"),
    "VECLIB_MAXIMUM_THREADS",
)
NONE = Variant("")  # of tasks without a codec


@dataclass(frozen=True, slots=True)
class Task:
    """``kind`` is a row of the runner's table; ``arguments`` follow case and variant."""

    kind: str
    case: Case
    variant: Variant = NONE
    arguments: tuple[Any, ...] = ()

    @property
    def label(self) -> str:
        return " ".join(word for word in (self.case.name, self.variant.label, self.kind) if word)


def _sweep(task: Task) -> Any:
    return measure.sweep(task.case, task.variant, *task.arguments)


def _point(task: Task) -> Any:
    return measure.measure(task.case, task.variant, dict(task.arguments))


def _speeds(task: Task) -> Any:
    return measure.speeds(task.case, task.variant, dict(task.arguments))


def _peers(task: Task) -> Any:
    return peers.measure(load(task.case))


@dataclass(frozen=True, slots=True)
class TaskKind:
    """A kind of task; ``alone``: no other task runs at the same time.

    ``work`` is a function of a module, since other processes get it by name.
    """

    work: Callable[[Task], Any]
    alone: bool = False


KINDS: Mapping[str, TaskKind] = {
    "sweep": TaskKind(_sweep),  # n_points
    "point": TaskKind(_point),  # pairs of parameter and value
    "speeds": TaskKind(_speeds, alone=True),  # pairs of parameter and value
    "peers": TaskKind(_peers, alone=True),  # names of the installed peers
}


def perform(task: Task, kind: TaskKind) -> Any:
    """The result of a task; ``{"error": ...}`` if the clip or a parameter is refused."""
    try:
        with warnings.catch_warnings():
            # the computation of the key has warned
            warnings.simplefilter("ignore", SkeletonWarning)
            return kind.work(task)
    except MczError as error:
        return {"error": reason_of_failure(error)}


def key_of(task: Task) -> str:
    """Cache key: all inputs of the result, except the package itself."""
    codec = codec_by_name(task.variant.codec) if task.variant.codec else None
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
    """Limit processes started in the block to one thread of matrix products.

    CPU time counts all threads, and BLAS threads spin while they wait.
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
    """Runs tasks of ``kinds`` in ``jobs`` processes; 1 means this process, except for speeds."""

    def __init__(
        self,
        jobs: int,
        cache: Cache,
        kinds: Mapping[str, TaskKind] = KINDS,
        progress: Progress | None = None,
    ) -> None:
        self.jobs, self.cache, self.kinds = jobs, cache, kinds
        self.progress = progress or (lambda done, total, label: None)
        self.n_cached = self.n_run = 0

    def run(self, tasks: Iterable[Task]) -> dict[Task, Any]:
        """Results by task; tasks that share a clip run one after the other."""
        pending = sorted(
            dict.fromkeys(tasks), key=lambda task: (self.kinds[task.kind].alone, task.case.path)
        )
        results: dict[Task, Any] = {}
        missing = []
        for task in pending:
            result = self.cache.get(key_of(task))
            if result is None:
                missing.append(task)
            else:
                results[task] = result
        self.n_cached += len(results)
        self.n_run += len(missing)
        alone = [task for task in missing if self.kinds[task.kind].alone]
        for part, jobs in ((missing[: len(missing) - len(alone)], self.jobs), (alone, 1)):
            self._run_part(part, jobs, results, len(pending))
        return results

    def _run_part(
        self, tasks: Sequence[Task], jobs: int, results: dict[Task, Any], total: int
    ) -> None:
        if not tasks:
            return
        alone = self.kinds[tasks[0].kind].alone
        if jobs == 1 and not alone:
            for task in tasks:
                self.progress(len(results), total, task.label)
                self._keep(task, perform(task, self.kinds[task.kind]), results)
            return
        # Spawned processes, not forks: they share neither memory nor threads with this one.
        with ExitStack() as stack:
            if alone:
                stack.enter_context(_one_thread())
            pool = stack.enter_context(ProcessPoolExecutor(jobs, mp_context=get_context("spawn")))
            self._collect(pool, tasks, jobs, results, total)

    def _collect(
        self, pool: Executor, tasks: Sequence[Task], jobs: int, results: dict[Task, Any], total: int
    ) -> None:
        waiting = list(tasks)[::-1]
        running: dict[Any, Task] = {}
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.pop()
                running[pool.submit(perform, task, self.kinds[task.kind])] = task
            done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in done:
                self._keep(running.pop(future), future.result(), results)
            if running:
                self.progress(len(results), total, next(iter(running.values())).label)

    def _keep(self, task: Task, result: object, results: dict[Task, Any]) -> None:
        results[task] = result
        self.cache.put(key_of(task), result)


# Files of this folder that figures depend on; none depends on cli/.
MEASURING = ("cases.py", "measure.py", "peers.py", "tasks.py")


def default_folder() -> Path:
    """Below the user's cache folder; RuntimeError without a home."""
    home = Path.home()
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(home / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(home / ".cache")
    return Path(base) / "mcz" / "bench"


@cache
def code_digest() -> str:
    """Digest of every file of the package that a figure may depend on."""
    folder = Path(mcz.__file__).parent
    digest = hashlib.sha256(mcz.__version__.encode())
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.json"), *folder.rglob("*.bin")]):
        part = path.relative_to(folder).parts[0]
        if part not in ("bench", "cli") or (part == "bench" and path.name in MEASURING):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


class Cache:
    """Results as JSON files named by the hash of their key; without a folder no result is kept.

    ``code`` are files that results depend on besides the files of the package.
    """

    def __init__(self, folder: Path | None, code: Iterable[Path] = ()) -> None:
        self.folder = folder
        digest = hashlib.sha256()
        for path in sorted(code):
            digest.update(path.name.encode() + path.read_bytes())
        self._code = digest.hexdigest()

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        name = hashlib.sha256(f"{code_digest()} {self._code} {key}".encode()).hexdigest()
        return self.folder / name[:2] / f"{name}.json"

    def get(self, key: str) -> Any:
        """Return the entry of ``key``, None if absent or unreadable."""
        if self.folder is None:
            return None
        try:
            entry = json.loads(self._path(key).read_text("utf-8"))
        except (OSError, ValueError):
            return None
        return entry.get("result") if isinstance(entry, dict) else None

    def put(self, key: str, result: object) -> None:
        """Store ``result``; a folder that is not writable is not an error."""
        if self.folder is None:
            return
        path = self._path(key)
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as stream:
                json.dump({"key": key, "result": result}, stream)
            os.replace(stream.name, path)
