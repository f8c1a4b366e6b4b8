"""The files of a server: each as an ``.mcz``, given ones unchanged, others converted on request."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import tempfile
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path, PurePosixPath
from threading import Lock, RLock
from typing import BinaryIO, Protocol

from mcz.container.source import ByteSource
from mcz.errors import AccessError, LimitError, MczError, OptionError, reason_of
from mcz.files.reading.file import open_bytes
from mcz.files.reading.source_files import SourceOptions
from mcz.hints import PYTHON_HINTS, Words, with_worded_hint
from mcz.model.motion import Motion
from mcz.model.types import Params
from mcz.show.viewing.requests import Contents, FileContents, RemoteContents
from mcz.sources import FORMATS, wants_skeleton
from mcz.sources.text.bones import skeletons_around

Report = Callable[[str], None]
WriteMcz = Callable[[BinaryIO], None]  # writes an .mcz

MOST_RESULTS = 16  # files converted from a clip in view: the oldest is deleted for a new one
MOST_UPLOADS = 256  # files that the page gave
MCZ = ".mcz"
FACTS = ("rate", "unit", "up")  # facts that files may lack
SCAN_FACTOR = 10  # pause before the next scan of a folder, in durations of the last


class RegisteredFile(Protocol):
    """A file of a registry: ``kind`` is the format of the given file, such as "mcz" or "bvh"."""

    name: str
    kind: str
    source: str  # its path or URL

    @property
    def size(self) -> int | None:
        """Bytes of the ``.mcz``; None before it is made."""
        ...

    def target(self) -> str:
        """Target for ``mcz.open``, encoded on first use; raises MczError if that fails."""
        ...

    def open(self) -> Contents:
        """Open its bytes; raises as ``target``."""
        ...


class Stored:
    """An ``.mcz`` on this machine."""

    def __init__(self, name: str, path: Path, kind: str = "mcz") -> None:
        self.name, self.kind, self.path, self.source = name, kind, path, str(path)

    @property
    def size(self) -> int | None:
        try:
            return self.path.stat().st_size
        except OSError:
            return None

    def target(self) -> str:
        return str(self.path)

    def open(self) -> Contents:
        return FileContents(self.path)


class Remote:
    """An ``.mcz`` at a URL, opened on first use."""

    kind = "mcz"

    def __init__(self, url: str) -> None:
        self.name = PurePosixPath(url.partition("?")[0]).name or url
        self.source, self._tag = url, f'"{secrets.token_hex(8)}"'
        self._source: ByteSource | None = None
        self._lock = Lock()

    @property
    def size(self) -> int | None:
        return None if self._source is None else self._source.size

    def target(self) -> str:
        return self.source

    def open(self) -> Contents:
        with self._lock:
            if self._source is None:
                self._source = open_bytes(self.source)
        return RemoteContents(self._source, self._tag)


class Converted:
    """An ``.mcz`` that is made from ``source`` on first use, and when that changes."""

    def __init__(
        self, registry: FileRegistry, name: str, kind: str, source: Path, write_mcz: WriteMcz
    ) -> None:
        self.name, self.kind = name, kind
        self.source = str(source)
        self._registry, self._write_mcz = registry, write_mcz
        self._lock = Lock()
        self._stored: Stored | None = None
        self._error: MczError | None = None
        self._source_state: object = None
        self._next_check = 0.0  # monotonic seconds

    @property
    def size(self) -> int | None:
        return None if self._stored is None else self._stored.size

    def target(self) -> str:
        with self._lock:
            if time.monotonic() >= self._next_check:
                self._refresh()
        if self._error is not None:
            raise self._error
        assert self._stored is not None
        return self._stored.target()

    def _refresh(self) -> None:
        """Convert it again if its source has changed; raises AccessError."""
        began = time.monotonic()
        now = _state(Path(self.source), self._registry.facts.get("skeleton"))
        took = time.monotonic() - began
        if self._source_state != now:
            self._run()
            self._source_state = now
        if self.kind == "folder":  # pages ask for many ranges, and folders may be large
            self._next_check = time.monotonic() + SCAN_FACTOR * took

    def _run(self) -> None:
        before, self._stored, self._error = self._stored, None, None
        try:
            self._stored = Stored(self.name, self._registry.write(self._write_mcz))
        except MczError as error:
            error.add(path=self.source)
            self._error = error
            self._registry.report(error.describe(self._registry.hints))
        if before is not None:
            with suppress(OSError):
                before.path.unlink()

    def open(self) -> Contents:
        return FileContents(self.target())


def _state(path: Path, skeleton: object = None) -> object:
    """Stamp that changes with a file, a motion file below a folder, or the ASF of an AMC.

    ``skeleton``: the named ASF, or None. Raises AccessError if there is no ``path``.
    """
    from mcz.files.editing.folders import files_below, motion_files

    try:
        is_folder, own = stat.S_ISDIR(path.stat().st_mode), _stamp(path)
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None
    paths = motion_files(files_below(path, None)[0])[0] if is_folder else [path]
    takes = {one.parent: one for one in paths if wants_skeleton(one)}
    around = [asf.path for take in takes.values() for asf in skeletons_around(take)]
    if takes and isinstance(skeleton, (str, os.PathLike)) and not is_folder:
        around = [Path(skeleton)]
    stamps = {str(one): _stamp(one) for one in (*paths, *around)}
    return stamps if is_folder else (own, stamps)


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Time of change, size and number of a file; None if it is gone."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


class FileRegistry:
    """Files by number, and a temporary folder of converted ones, deleted by ``close``.

    ``facts`` are those that files lack: arguments of ``mcz.encode`` such as ``unit``. ``report``
    gets a line for each failed conversion. ``salvage``: damaged files are read. ``hints`` words
    the hints of errors.
    """

    def __init__(
        self,
        facts: Params | None = None,
        report: Report | None = None,
        *,
        salvage: bool = False,
        hints: Words = PYTHON_HINTS,
    ) -> None:
        self.hints = hints
        self.facts, self.salvage = dict(facts or {}), salvage
        self.report: Report = report or (lambda line: None)
        self._folder: Path | None = None
        self._files: dict[int, RegisteredFile] = {}
        self._n_given = self._n_uploads = self._next = self._n_written = 0
        self._results: deque[int] = deque()
        self._lock = RLock()
        self._is_closed = False

    def __getitem__(self, number: int) -> RegisteredFile:
        """The file of that number; raises KeyError."""
        with self._lock:
            return self._files[number]

    def with_facts(self, motion: Motion) -> Motion:
        """``motion`` with the facts that its file lacks; raises OptionError."""
        rate, unit, up = map(self.facts.get, FACTS)
        options = SourceOptions(rate=rate, unit=unit, up=up)
        return options.complete(motion)

    def initial_files(self) -> list[tuple[int, RegisteredFile]]:
        """The initial files, with their numbers."""
        with self._lock:
            return list(self._files.items())[: self._n_given]

    def add_initial(self, file: RegisteredFile) -> None:
        """Add an initial file."""
        with self._lock:
            self._n_given += 1
            self._add(file)

    def _add(self, file: RegisteredFile) -> int:
        number, self._next = self._next, self._next + 1
        self._files[number] = file
        return number

    def upload(self, name: str, kind: str, write_mcz: WriteMcz) -> tuple[int, Stored]:
        """Make an ``.mcz`` from an upload; raises LimitError for too many."""
        with self._lock:
            if self._n_uploads >= MOST_UPLOADS:
                raise LimitError(
                    f"the limit of {MOST_UPLOADS} files is reached; start mcz view again"
                )
            self._n_uploads += 1
        stored = Stored(name, self.write(write_mcz), kind)
        with self._lock:
            return self._add(stored), stored

    def result(self, name: str, write_mcz: WriteMcz) -> tuple[int, Stored]:
        """Make an ``.mcz`` from a clip in view; the oldest of ``MOST_RESULTS`` is deleted."""
        stored = Stored(name, self.write(write_mcz))
        with self._lock:
            number = self._add(stored)
            self._results.append(number)
            while len(self._results) > MOST_RESULTS:
                old = self._files.pop(self._results.popleft())
                assert isinstance(old, Stored)
                with suppress(OSError):
                    old.path.unlink()
        return number, stored

    def write(self, write_mcz: WriteMcz) -> Path:
        """A new file of the temporary folder, written by ``write_mcz``."""
        with self._lock:
            path = self.folder() / f"{self._n_written}{MCZ}"
            self._n_written += 1
        try:
            with path.open("xb+") as stream:
                write_mcz(stream)
        except BaseException:
            with suppress(OSError):
                path.unlink()
            raise
        return path

    def folder(self) -> Path:
        """The private temporary folder; raises OptionError once closed."""
        with self._lock:
            if self._is_closed:
                raise OptionError("the viewer is closed")
            if self._folder is None:
                self._folder = Path(tempfile.mkdtemp(prefix="mcz-view-"))
            return self._folder

    def new_folder(self) -> Path:
        """A new folder below the temporary one, for files that are made into an ``.mcz``."""
        return Path(tempfile.mkdtemp(dir=self.folder(), prefix="given-"))

    def close(self) -> None:
        """Delete the temporary folder; a task that still writes into it fails."""
        with self._lock:
            self._is_closed = True
            folder, self._folder = self._folder, None
        for _ in range(10):
            if folder is None or not folder.exists():
                return
            shutil.rmtree(folder, ignore_errors=True)
            if folder.exists():
                time.sleep(0.05)


def add_path(registry: FileRegistry, path: str) -> None:
    """Add a file, a folder or a URL; raises AccessError or OptionError.

    Of a folder these are its ``.mcz`` files, and one archive of all its other motion files.
    """
    if "://" in path:
        if not path.partition("?")[0].lower().endswith(MCZ):
            raise OptionError("a remote file must be an .mcz", path=path)
        registry.add_initial(Remote(path))
        return
    place = Path(path)
    if path and place.is_dir():
        _add_folder(registry, place)
        return
    if not (path and place.is_file()):
        text = "not a file" if path and place.exists() else "no such file"
        raise AccessError(text, path=path or repr(path))
    kind = kind_of(place)
    if kind == "mcz":
        registry.add_initial(Stored(place.name, place))
    else:
        registry.add_initial(
            Converted(
                registry, place.name, kind, place, lambda out: encode(place, out, registry.facts)
            )
        )


def kind_of(path: Path) -> str:
    """The format of a file by its suffix; raises OptionError for one that cannot be shown."""
    suffix = path.suffix.lower()
    motions = [source_format for source_format in FORMATS.values() if not source_format.is_skeleton]
    known = {MCZ: "mcz"} | {s: f.name for f in reversed(motions) for s in f.suffixes}
    if suffix not in known:
        raise OptionError(
            f"unsupported suffix; it must be one of {' '.join(sorted(known))}", path=path
        )
    return known[suffix]


def encode(source: Path, out: BinaryIO, facts: Params) -> None:
    """Write ``source`` as an ``.mcz``, fast."""
    from mcz.files.writing.file import encode

    skeleton = facts.get("skeleton") if wants_skeleton(source) else None
    encode(source, out, **{**facts, "skeleton": skeleton})


def _add_folder(registry: FileRegistry, folder: Path) -> None:
    from mcz.files.editing.folders import files_below, motion_files

    paths, _ = files_below(folder, None)
    for path in paths:
        if path.suffix.lower() == MCZ:
            registry.add_initial(Stored(path.relative_to(folder).as_posix(), path))
    motions, _ = motion_files(paths)
    if motions:
        name = folder.resolve().name or "motions"
        registry.add_initial(
            Converted(registry, name, "folder", folder, lambda out: pack(folder, out, registry))
        )
    elif not registry.initial_files():
        raise OptionError("the folder contains no motion file", path=folder)


def pack(folder: Path, out: BinaryIO, registry: FileRegistry) -> None:
    """Write all motion files below ``folder`` as one ``.mcz``; unreadable ones are reported."""
    from mcz.files.editing.archive import pack
    from mcz.model import threads

    facts = {key: value for key, value in registry.facts.items() if key != "skeleton"}
    report = pack(folder, out, jobs=threads.processors(), copies=False, **facts)
    for outcome in report.outcomes:
        if outcome.result == "failed":
            registry.report(with_worded_hint(outcome.message, registry.hints))
    if not any(outcome.result == "parsed" for outcome in report.outcomes):
        raise OptionError("none of its motion files is readable", path=folder)
