"""Archives packed, verified and read by the machines of a Dask cluster (the extra ``mcz[dask]``).

The processes of ``mcz.files.jobs`` are one engine, a cluster is another: both do the same work, and
their results are joined in the same order. A lost machine costs only time: Dask repeats its work.
"""

from __future__ import annotations

import os
import pickle
import posixpath
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast
from uuid import uuid4

from mcz.container.limits import Profile, profile_named
from mcz.container.source import file_system
from mcz.errors import AccessError, MczError, OptionError, SourceError, WorkerError
from mcz.files.editing import Outcome, Report
from mcz.files.editing.archive import write_in_turn
from mcz.files.editing.folders import NO_MOTION, files_below, motion_files, notes_on, size_of
from mcz.files.editing.merging import Part, RemotePart, encode_part
from mcz.files.jobs import Answer, Item, Result, can_be_shared, share_clips, use_engine
from mcz.files.reading import faults
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.faults import Problem
from mcz.files.reading.file import File, open
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.atomic import WriteTransaction, replacing
from mcz.files.writing.file import SourceEncoder, encoding_options
from mcz.hints import Remark
from mcz.model.extras import import_extra
from mcz.model.threads import limit_threads
from mcz.model.types import Params, Progress, Target
from mcz.sources import wants_skeleton

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["map_clips", "pack", "verify"]


def verify(
    target: Target,
    client: object = None,
    *,
    max_decoded: int | None = None,
    where: Where | None = None,
) -> list[Problem]:
    """Check an MCZ file as ``mcz.verify`` does, with clips on the workers of ``client``.

    ``target`` is a path or URL that all of them can read; ``client`` is as in ``pack``. Raises as
    ``mcz.verify``, and WorkerError if machines are lost.
    """
    with connect(client) as used, use_engine(Cluster(used)):
        return faults.verify(target, max_decoded=max_decoded, where=where)


def map_clips(
    target: Target,
    function: Callable[[Clip], Result],
    client: object = None,
    *,
    where: Where | None = None,
    max_decoded: int | None = None,
) -> list[Result]:
    """``function`` of every clip of an MCZ file, on the workers; results in the order of the clips.

    ``where`` selects clips, see ``File.find``. The rest is as in ``verify``. An error raised by
    ``function`` is raised here.
    """
    with open(target, max_decoded=max_decoded) as file, connect(client) as used:
        if not can_be_shared(file):
            raise OptionError(
                "the machines of a cluster can open none of these files", path=file.name
            )
        names = [clip.name for clip in file.select_clips(where=where)]
        with (
            use_engine(Cluster(used)),
            share_clips(_call_on_clip, file, names, function) as answers,
        ):
            return [answer() for answer in answers]


def _call_on_clip(shared: tuple[File, Callable[[Clip], Result]], name: str) -> Result:
    file, function = shared
    return function(file.clips[name])


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

    def map_in_order(
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
        self.future = self._submit(0)

    def _submit(self, again: int) -> Future:
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
                self.future = self._submit(again)
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


def pack(
    root: str | os.PathLike[str],
    target: Target,
    client: object = None,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    rate: float | None = None,
    force_rate: bool = False,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    profile: str = "base",
    copies: bool = True,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``root`` into one MCZ file, as ``mcz.pack``.

    ``root`` and ``target`` are paths or URLs for fsspec ("s3://bucket/takes"); all machines can
    read ``root``, only this one writes ``target``. ``client`` is a ``distributed.Client``, the
    address of a scheduler, or None for the client of the process. The bytes equal those of
    ``mcz.pack``. Raises OptionError, and WorkerError if the cluster has no workers; a file whose
    machines are lost repeatedly is reported as failed.
    """
    root = os.fspath(root)
    files, others = list_files(root, target)
    names, left = _choose_files(files, keep_all)
    options = SourceOptions(
        rate=rate,
        force_rate=force_rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim or keep_all,
        flat=True,
    )
    encoding = encoding_options(codec, effort, params)
    paths = [os.path.join(root, one.name) for one in names] if "://" not in root else []  # noqa: PTH118
    inputs = (*paths, *encoding.params.values())
    report, limits = Report(), profile_named(profile)
    skeletons = [one.name for one in files if one.name.lower().endswith(".asf")]
    entries = [SourceEncoder(Path(root, one.name), one.name, options, encoding) for one in names]
    asks = (RemoteFile(root, entry, skeletons_beside(entry.name, skeletons)) for entry in entries)
    with connect(client) as used, replacing(target, force=force, inputs=inputs) as stream:
        transaction = WriteTransaction(stream, limits, copies=copies)
        with closing(Cluster(used).map_in_order(encode_remotely, asks, limits)) as answers:
            results = cast(Iterator[Answer[Part]], answers)  # no item is None
            made = zip(entries, results, names, strict=True)
            parts = (RemotePart(entry, answer, one.size) for entry, answer, one in made)
            write_in_turn(transaction, parts, len(names), report, progress, {})
        transaction.finish()
    report.size = transaction.writer.offset
    report.add_messages(notes_on(one.name for one in names))
    report.outcomes += sorted([*others, *left], key=lambda one: os.fsencode(one.path))
    return report


def _choose_files(files: Sequence[Entry], keep_all: bool) -> tuple[list[Entry], list[Outcome]]:
    motions, _ = motion_files([Path(one.name) for one in files])
    known = {path.as_posix() for path in motions}
    left = [Outcome(o.name, "skipped", o.size, NO_MOTION) for o in files if o.name not in known]
    return (list(files), []) if keep_all else ([o for o in files if o.name in known], left)


@dataclass(frozen=True, slots=True)
class Entry:
    """A file below the root: its relative path, and its size in bytes."""

    name: str
    size: int


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """A file below ``root`` to encode; ``beside``: names of the ASFs that it may need."""

    root: str
    encoder: SourceEncoder
    beside: tuple[str, ...]


def is_url(root: str) -> bool:
    return "://" in root


def list_files(root: str, target: Target) -> tuple[list[Entry], list[Outcome]]:
    """The files below ``root`` except an earlier ``target``, in the order of an archive.

    Raises OptionError if it is not a folder, AccessError if it cannot be listed.
    """
    if not is_url(root):
        folder = Path(root)
        if not folder.is_dir():
            raise OptionError("not a folder", path=root)
        paths, others = files_below(folder, target)
        files = [Entry(path.relative_to(folder).as_posix(), size_of(path)) for path in paths]
        return files, others
    fs, base = _open_folder(root)
    own = _open_folder(str(target))[1] if is_url(str(target)) else None
    try:
        details = fs.find(base, detail=True)
    except Exception as error:  # each kind of store has errors of its own
        raise AccessError(str(error), path=root) from None
    files = [
        Entry(posixpath.relpath(path, base), int(entry["size"] or 0))
        for path, entry in details.items()
        if entry["type"] == "file" and path != own and not path.endswith("/")
    ]
    if not files:
        raise OptionError("the folder contains no file", path=root)
    return sorted(files, key=lambda one: os.fsencode(one.name)), []


def _open_folder(url: str) -> tuple[Any, str]:
    """The file system of a URL and the path of its folder in it; raises OptionError."""
    fs, path = file_system(url)
    return fs, path.rstrip("/")


def skeletons_beside(name: str, skeletons: list[str]) -> tuple[str, ...]:
    """ASFs that an AMC may have: in its folder and a sibling ``asf``."""
    path = PurePosixPath(name)
    if not wants_skeleton(name):
        return ()
    beside, above = path.parent, path.parent.parent

    def is_near(folder: PurePosixPath) -> bool:
        is_sibling = folder.parent == above != beside and folder.name.lower() == "asf"
        return folder == beside or is_sibling

    return tuple(asf for asf in skeletons if is_near(PurePosixPath(asf).parent))


def encode_remotely(profile: Profile, ask: RemoteFile) -> Part:
    """The part of a file, made by a machine that can read it; raises as ``encode_part``."""
    with ExitStack() as stack:
        root = ask.root
        if is_url(root):
            own = stack.enter_context(TemporaryDirectory(prefix="mcz-"))
            root = str(Path(own, "root"))  # the folder around it has no ASF
            _fetch(ask, Path(root))
        try:
            own_path = copy(ask.encoder)
            own_path.path = Path(root, ask.encoder.name)
            part = encode_part(profile, own_path)
        except MczError as error:
            if error.path is not None:
                error.path = _rename_copy(error.path, root, ask.root)
            raise
    done = part.encoder
    done.reason, done.remark = (
        _rename_copy(text, root, ask.root) for text in (done.reason, done.remark)
    )
    done.notes = tuple(_rename_copy(note, root, ask.root) for note in done.notes)
    done.inputs = []
    return part


def _rename_copy(text: str, place: str, root: str) -> str:
    """``text`` about a copy, with the name of the file itself."""
    if isinstance(text, Remark):
        return Remark(_rename_copy(text.words, place, root), text.hint)
    return text.replace(place, root.rstrip("/"))


def _fetch(ask: RemoteFile, folder: Path) -> None:
    """Copy the file, and the skeletons that it may need, below ``folder``."""
    fs, base = _open_folder(ask.root)
    for name in (ask.encoder.name, *ask.beside):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.write_bytes(fs.cat_file(f"{base}/{name}"))
        except Exception as error:  # each kind of store has errors of its own
            raise SourceError(f"{ask.root.rstrip('/')}/{name}: {error}") from None
