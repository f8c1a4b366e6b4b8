"""Writing a file that gets its name only when it is complete, and never replaces an input.

A ``WriteTransaction`` writes in steps; a failed step leaves no trace.
"""

from __future__ import annotations

import errno
import io
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import copy
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO, cast
from urllib.parse import unquote, urlsplit

from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.encodings import Copy
from mcz.container.limits import Profile
from mcz.container.metadata import KEYS, PRIVATE
from mcz.container.scan import scan
from mcz.container.scanner import is_plain_path
from mcz.container.source import ByteSource, file_system, is_abandoned, lock
from mcz.container.writer import Writer
from mcz.errors import (
    AccessError,
    ExistsError,
    MczError,
    MotionError,
    OptionError,
    SourceError,
    reason_of,
)
from mcz.hints import Hint
from mcz.model.text_format import is_utf8, printable
from mcz.model.types import Target

SUFFIX = ".part"
SHOWN = 48  # characters of a name in its temporary file's: 192 bytes of 255 at most
FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)  # errors that only writing has


LOCAL = ("file", "local")  # protocols of fsspec for files of this machine


@contextmanager
def replacing(target: Target, *, force: bool, inputs: Iterable[object] = ()) -> Iterator[BinaryIO]:
    """A binary stream whose bytes become ``target`` only when the block succeeds.

    On disk that is a temporary file next to the target, synced and renamed; a device or a pipe, and
    a given stream, are written directly. Raises OptionError if the target is one of ``inputs``,
    even with ``force``, ExistsError if it exists and not ``force``, AccessError if it cannot
    be written.
    """
    refuse_inputs(target, inputs)
    if hasattr(target, "write"):
        yield cast(BinaryIO, target)
        return
    if "://" in str(target):
        with _remote(str(target), force) as stream:
            yield stream
        return
    if not isinstance(target, (str, os.PathLike)):
        raise OptionError(
            f"cannot write to {target!r}, which is neither a path nor a binary stream"
        )
    if os.fspath(target)[-1:] in (os.sep, os.altsep):
        raise OptionError("it is a folder; name a file in it", path=target)
    path = Path(target)
    if path.is_dir():
        raise OptionError("it is a folder; name a file in it", path=path)
    if not force and os.path.lexists(path):
        raise ExistsError("already exists", path=path, hint=Hint.FORCE)
    with _write_in_place(path) if _is_special(path) else _temporary(path, force) as stream:
        yield stream


@contextmanager
def replacing_file(
    target: Target, *, force: bool, inputs: Iterable[object] = ()
) -> Iterator[BinaryIO]:
    """``replacing`` for an MCZ file, which is read again, strictly, before it gets its name.

    The stream can be read. Also raises FormatError if the new file breaks a rule.
    """
    with replacing(target, force=force, inputs=inputs) as stream, rereadable(stream) as own:
        yield own
        own.flush()
        scan(ByteSource(own), whole=True)
        own.seek(0, os.SEEK_END)


@contextmanager
def rereadable(stream: BinaryIO) -> Iterator[BinaryIO]:
    """``stream`` itself, or, if it cannot be read, a temporary file that is copied to it.

    So the output can be read again before it gets its name; it is copied only when the block
    succeeds.
    """
    if all(getattr(stream, name, bool)() for name in ("readable", "seekable", "writable")):
        yield stream
        return
    with tempfile.TemporaryFile() as own:
        yield own
        own.seek(0)
        shutil.copyfileobj(own, stream)


@contextmanager
def _remote(target: str, force: bool) -> Iterator[BinaryIO]:
    fs, path = file_system(target)
    if not force and fs.exists(path):
        raise ExistsError("already exists", path=target, hint=Hint.FORCE)
    with fs.transaction, fs.open(path, "wb") as stream:
        yield stream


def _is_special(path: Path) -> bool:
    """Return True for a device, a pipe or the like, which a rename would replace."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


@contextmanager
def _write_in_place(path: Path) -> Iterator[BinaryIO]:
    whole = io.BytesIO()
    yield whole
    try:
        with path.open("wb") as stream:
            stream.write(whole.getvalue())
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None


@contextmanager
def _temporary(path: Path, force: bool) -> Iterator[BinaryIO]:
    prefix = f".{path.name[:SHOWN]}."
    _clear_leftovers(path.parent, prefix)
    stream, name = _locked_file(path, prefix)
    try:
        with stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(name, 0o666 & ~umask)  # mkstemp made it private
            if os.name == "posix":  # elsewhere open files cannot be replaced
                _give_name(name, path, force)
        if os.name != "posix":
            _give_name(name, path, force)
        _sync_directory(path.parent)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(name)
        if isinstance(error, OSError) and error.errno in FULL and error.filename is None:
            raise AccessError(reason_of(error), path=path) from error
        raise


def _locked_file(path: Path, prefix: str) -> tuple[BinaryIO, str]:
    """A temporary file for ``path`` that no other writer treats as a leftover."""
    while True:
        try:
            handle, name = tempfile.mkstemp(prefix=prefix, suffix=SUFFIX, dir=path.parent)
        except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
            raise AccessError(reason_of(error), path=path) from None
        stream = os.fdopen(handle, "w+b")
        if lock(stream) and Path(name).exists():  # else one has cleared it away just now
            return stream, name
        stream.close()


def _clear_leftovers(folder: Path, prefix: str) -> None:
    """Delete temporary files of killed writers, which are not locked."""
    with suppress(OSError, ValueError):
        for entry in os.scandir(folder):
            is_leftover = entry.name.startswith(prefix) and entry.name.endswith(SUFFIX)
            if not (is_leftover and entry.is_file(follow_symlinks=False)):
                continue
            with suppress(OSError), open(entry.path, "r+b") as leftover:
                if is_abandoned(leftover):
                    os.unlink(entry.path)


def _give_name(name: str, path: Path, force: bool) -> None:
    """Rename ``name`` to ``path``; without ``force`` never over a file that has appeared since."""
    try:
        if not force and _link(name, path):
            os.unlink(name)
        else:
            os.replace(name, path)
    except FileExistsError:
        raise ExistsError("already exists", path=path, hint=Hint.FORCE) from None
    except OSError as error:  # a folder, perhaps
        raise AccessError(reason_of(error), path=path) from None


def _link(name: str, path: Path) -> bool:
    """Make ``path`` a hard link to the file; False if the file system has none.

    Raises FileExistsError, which a rename would not.
    """
    try:
        os.link(name, path)
    except FileExistsError:
        raise
    except OSError as error:
        if os.path.lexists(path):
            raise FileExistsError from error
        return False
    return True


def _sync_directory(path: Path) -> None:
    """Sync the rename itself; not every system opens directories."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def refuse_inputs(target: object, inputs: Iterable[object]) -> None:
    """Raise OptionError if ``target`` is one of ``inputs``, by its file and not by its name.

    Each is a path, an fsspec target, a stream or anything else, which is not a file. Links of both
    sorts lead to the same file; a device, a pipe or a missing file is never an input.
    """
    target_is = _identity(target)
    if target_is is None:
        return
    for source in inputs:
        if _identity(source) == target_is:
            name = _name(target)
            other = f" ({_name(source)})" if _name(source) != name else ""
            text = f"the output is the input itself{other}; name another output"
            raise OptionError(text, path=name)


def _name(file: object) -> str:
    return str(file if isinstance(file, (str, os.PathLike)) else getattr(file, "name", "a stream"))


def _identity(file: object) -> object:
    if isinstance(file, (str, os.PathLike)):
        path = os.fspath(file)
        if isinstance(path, str) and "://" in path:
            url = urlsplit(path)
            if url.scheme not in LOCAL:
                return path
            path = unquote(url.path)
        return _stat_of(path)
    try:
        number = getattr(file, "fileno", None)
        return None if number is None else _stat_of(number())
    except (OSError, ValueError):  # a stream of memory, or a closed one
        return None


def _stat_of(file: str | bytes | int) -> tuple[int, int] | None:
    try:
        status = os.stat(file)  # noqa: PTH116 - of a path or a number
    except (OSError, ValueError):  # ValueError: a name with a zero byte
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


Digest = bytes | Callable[[], bytes]
METADATA_KEYS = tuple(KEYS)


class WriteTransaction:
    """A file that is written in steps: a failed step leaves no trace.

    ``paths`` has the SHA-256 of the restored file of each path, or a function that computes it.
    With ``hold`` False output goes straight to ``sink``, so that no step can be undone; that needs
    no memory and suits a file of one step. ``copies``, ``uncopied`` and ``short`` are those of
    ``Writer``.
    """

    def __init__(
        self,
        sink: BinaryIO,
        profile: Profile,
        directory: Directory | None = None,
        paths: Mapping[str, Digest] | None = None,
        *,
        hold: bool = True,
        copies: bool = False,
        uncopied: Iterable[Copy] = (),
        short: bool = False,
    ) -> None:
        self._sink, self._pending, self._hold = sink, io.BytesIO(), hold
        self.paths = dict(paths or {})
        self.clips: dict[str, str] = {}  # names of the written clips, by file
        offset = directory.end if directory is not None else 0
        self.writer = Writer(
            self,
            profile=profile,
            directory=directory,
            offset=offset,
            copies=copies,
            uncopied=uncopied,
            short=short,
        )
        self.keep()

    def write(self, data: bytes, /) -> int:
        return (self._pending if self._hold else self._sink).write(data)

    def keep(self) -> None:
        """Keep the output since the last step."""
        self._sink.write(self._pending.getbuffer())
        self._pending = io.BytesIO()

    @contextmanager
    def step(self) -> Iterator[None]:
        """Keep the output of the block, if it ends without an error."""
        before, offset = _snapshot(self.writer.directory), self.writer.offset
        try:
            yield
        except MczError:
            self._pending = io.BytesIO()
            self.writer.rewind(before, offset)
            raise
        self.keep()

    def holds(self, path: str, digest: bytes) -> bool:
        """Return True if the file restores these bytes as ``path``; raise if it restores others."""
        if path not in self.paths:
            return False
        stored = self.paths[path]
        if (stored if isinstance(stored, bytes) else stored()) == digest:
            return True
        raise SourceError(f"the archive already has a source file {path!r}", hint=Hint.REPLACE)

    def finish(self) -> None:
        self.writer.finish()
        self.keep()


def _snapshot(directory: Directory) -> Directory:
    snapshot = copy(directory)
    for name in ("shared", "attachments", "aliases", "clips"):
        setattr(snapshot, name, getattr(directory, name).copy())
    return snapshot


def alias_once(writer: Writer, name: str, id_: bytes) -> None:
    """Name the skeleton ``id_`` as ``name``, unless another has that name."""
    check_name(name)
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def check_name(path: str) -> None:
    """Raise MotionError if a file cannot be stored and restored under ``path``."""
    if not is_utf8(path):
        raise MotionError(f"the name '{printable(path)}' is not valid UTF-8; rename the file")
    if not is_plain_path(path):
        raise MotionError(f"source path {path!r} is not a plain relative path; rename the file")


def check_metadata(metadata: Mapping[str, str], name: str) -> None:
    """Raise MotionError for a key that neither SPEC.md's registry has nor is private."""
    for key in metadata:
        if key not in METADATA_KEYS and not key.startswith(PRIVATE):
            raise MotionError(
                f"metadata key {key!r} is not registered; registered are "
                f"{', '.join(METADATA_KEYS)}, and private keys begin with {PRIVATE!r}",
                clip=name,
            )


def clip_name(path: str, directory: Directory) -> str:
    """The relative path without its suffix; with it, or a number, if that name is taken."""
    names = chain((Path(path).with_suffix("").as_posix(), path), (f"{path}#{n}" for n in count(2)))
    return next(name for name in names if name not in directory.clips)
