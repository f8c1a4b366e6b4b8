"""Random access to the bytes of a file, on disk, in memory or on a server; and its write lock.

One process writes to a file at a time, and others can see it. A lock is advisory, and some file
systems have none; then writing continues without.
"""

from __future__ import annotations

import errno
import io
import os
import sys
import time
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, cast

from mcz.errors import AccessError, MczError, OptionError, TruncatedError, reason_of
from mcz.model.extras import import_extra
from mcz.model.types import Target

BUSY = (errno.EACCES, errno.EAGAIN)  # errors of a lock held by another process
LOCK_OFFSET = 2**62  # Windows locks bytes; no file has one here
PATIENCE, PAUSE = 0.2, 0.01  # seconds: a reader holds the lock only for an instant


def lock(stream: BinaryIO) -> bool:
    """Lock the file of ``stream`` until it closes; False if another process has it."""
    until = time.monotonic() + PATIENCE
    while _take(stream) is False:
        if time.monotonic() > until:
            return False
        time.sleep(PAUSE)
    return True


@contextmanager
def locked_file(path: Path) -> Iterator[BinaryIO]:
    """The file at ``path``, to read and write, which no other process appends to in the block.

    Raises AccessError if one does, and if the file cannot be opened.
    """
    try:
        stream = open(path, "r+b", buffering=0)  # noqa: SIM115 - closed by the with below
    except (OSError, ValueError) as error:
        raise AccessError(reason_of(error), path=path) from None
    with stream:
        if not lock(stream):
            raise AccessError("another process is appending to it", path=path)
        yield stream


def is_locked(stream: BinaryIO) -> bool:
    """Return True if another process has locked the file of ``stream``."""
    is_free = _take(stream)
    if is_free:
        _release(stream)
    return is_free is False


def is_abandoned(stream: BinaryIO) -> bool:
    """Return True, with the file locked, for a file that its writer has abandoned."""
    return _take(stream) is True


if sys.platform == "win32":
    import msvcrt

    def _take(stream: BinaryIO) -> bool | None:
        """Try to lock the file; None on systems without locks."""
        return _lock_far(stream, msvcrt.LK_NBLCK)

    def _release(stream: BinaryIO) -> None:
        _lock_far(stream, msvcrt.LK_UNLCK)

    def _lock_far(stream: BinaryIO, mode: int) -> bool | None:
        at = stream.tell()
        try:
            stream.seek(LOCK_OFFSET)
            msvcrt.locking(stream.fileno(), mode, 1)
        except OSError as error:
            return False if error.errno in BUSY else None
        finally:
            stream.seek(at)
        return True

else:
    import fcntl

    def _take(stream: BinaryIO) -> bool | None:
        """Try to lock the file; None on systems without locks."""
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return False if error.errno in BUSY else None
        return True

    def _release(stream: BinaryIO) -> None:
        fcntl.flock(stream, fcntl.LOCK_UN)


class ByteSource:
    """Reads ranges of a seekable binary stream and counts the bytes.

    Threads may share it, and processes after a fork: a file on disk and one on a web server are
    read at explicit positions, other streams are opened again. With ``target``, as for
    ``open_source``, it can be pickled.

    ``gap``: two requested ranges at most this far apart are read as one. Zero suits a disk; over a
    network a request costs more than the bytes between. ``tail``: number of bytes at the end that
    are read together when the file is opened. ``block``: bytes that a ``Forward`` reads at a time.
    """

    def __init__(
        self,
        stream: BinaryIO,
        *,
        remote: bool = False,
        name: str = "",
        size: int | None = None,
        target: str | bytes | None = None,
    ) -> None:
        self._stream = stream
        self._positioned = _is_plain_file(stream)
        self._reads_at = getattr(stream, "read_at", None)  # of an HttpFile
        self._lock = Lock()  # seek and read belong together
        self._process = os.getpid()
        self.target = target
        self.gap = 64 * 1024 if remote else 0
        self.block = 64 * 1024 if remote else 8 * 1024
        self.tail = 128 * 1024 if remote else 512
        self.remote = remote
        self.name = name
        self.n_requests = 0
        self.n_bytes = 0
        self.size = stream.seek(0, os.SEEK_END) if size is None else size
        self._held: list[tuple[int, bytes]] = []  # blocks read ahead, newest last

    def read(self, offset: int, size: int) -> bytes:
        """The ``size`` bytes at ``offset``; raises TruncatedError if the file ends before."""
        if offset + size > self.size:
            raise TruncatedError(
                f"cannot read bytes {offset} to {offset + size}: the file ends at {self.size}"
            )
        if size == 0:
            return b""
        for start, block in reversed(self._held):
            if start <= offset and offset + size <= start + len(block):
                return block[offset - start : offset - start + size]
        return self._request(offset, size)

    def read_ahead(self, ranges: Iterable[tuple[int, int]]) -> None:
        """Over a network, read the (offset, size) ranges now, near ones in one request."""
        if not self.remote:
            return
        self._held = self._held[-1:]
        start = stop = -1
        for offset, size in sorted(ranges):
            if start >= 0 and offset - stop <= self.gap:
                stop = max(stop, offset + size)
                continue
            self._hold(start, stop)
            start, stop = offset, offset + size
        self._hold(start, stop)

    def _hold(self, start: int, stop: int) -> None:
        stop = min(stop, self.size)
        if 0 <= start < stop:
            self._held.append((start, self._request(start, stop - start)))

    def _request(self, offset: int, size: int) -> bytes:
        if self._process != os.getpid():
            self._reset_after_fork()
        if getattr(self._stream, "closed", False):
            raise OptionError("the file is closed", path=self.name)
        data = self._read_stream(offset, size)
        self.n_requests += 1
        self.n_bytes += size
        return data

    def _read_stream(self, offset: int, size: int) -> bytes:
        try:
            data = self._read_at(offset, size)
            while len(data) < size:  # raw streams may return fewer than requested
                more = self._read_at(offset + len(data), size - len(data))
                if not more:
                    raise TruncatedError(
                        f"the file was shortened to {offset + len(data)} bytes while it was read"
                    )
                data += more
        except MczError as error:
            if self.remote and isinstance(error, TruncatedError):
                raise AccessError(error.message, path=self.name) from None
            raise
        except Exception as error:
            if not self.remote and not isinstance(error, OSError):
                raise
            raise _no_access(self.name, error) from None
        return data

    def _read_at(self, offset: int, size: int) -> bytes:
        if self._positioned:
            return os.pread(self._stream.fileno(), size, offset)
        if self._reads_at is not None:
            return cast(bytes, self._reads_at(offset, size))
        with self._lock:
            self._stream.seek(offset)
            return self._stream.read(size)

    def _reset_after_fork(self) -> None:
        """Replace things that a fork would share: a connection, and a lock perhaps held.

        An HttpFile does that itself, with the identity of its file.
        """
        self._process, self._lock = os.getpid(), Lock()
        if self.remote and self._reads_at is None and isinstance(self.target, str):
            self._stream = _remote_stream(self.target)

    def grows(self) -> bool:
        """True while another process appends to the file."""
        return self._positioned and is_locked(self._stream)

    def size_now(self) -> int:
        """The size of the file, which may have changed since it was opened."""
        return os.fstat(self._stream.fileno()).st_size if self._positioned else self.size

    def up_to(self, size: int) -> ByteSource:
        """The first ``size`` bytes, as a separate source of the same stream."""
        return ByteSource(self._stream, name=self.name, size=size, target=self.target)

    def __reduce__(self) -> tuple[object, ...]:
        if self.target is None:
            raise OptionError(
                "a file opened as a stream cannot be pickled; open it by its path", path=self.name
            )
        return open_source, (self.target,)

    def close(self) -> None:
        self._stream.close()


class Overlay(ByteSource):
    """``source`` with other bytes at some offsets.

    ``parts`` do not overlap. One after the end can be read, though ``size`` stays. A pickled
    Overlay opens ``source`` again, without the parts.
    """

    def __init__(self, source: ByteSource, parts: Mapping[int, bytes]) -> None:
        self._source = source
        self.parts = dict(sorted(parts.items()))
        self._starts = list(self.parts)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or "_source" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self._source, name)

    def read(self, offset: int, size: int) -> bytes:
        """The ``size`` bytes at ``offset``; raises TruncatedError if the file ends before."""
        stop = offset + size
        first = max(0, bisect_right(self._starts, offset) - 1)
        near = self._starts[first : bisect_left(self._starts, stop)]
        met = [start for start in near if start + len(self.parts[start]) > offset]
        if not met:
            return self._source.read(offset, size)
        if met[0] <= offset and stop <= met[0] + len(self.parts[met[0]]):
            return self.parts[met[0]][offset - met[0] : stop - met[0]]
        data = bytearray(self._source.read(offset, size))
        for start in met:
            part = self.parts[start]
            begin, end = max(start, offset), min(start + len(part), stop)
            data[begin - offset : end - offset] = part[begin - start : end - start]
        return bytes(data)

    def with_more(self, parts: Mapping[int, bytes]) -> Overlay:
        """A copy with further ``parts``."""
        return Overlay(self._source, self.parts | dict(parts))

    def close(self) -> None:
        self._source.close()


class Forward:
    """Reads many small parts of a source front to back, a block at a time."""

    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self._start, self._block = 0, b""

    def read(self, offset: int, size: int) -> bytes:
        """The ``size`` bytes at an offset that is not before the last ones read."""
        first = offset - self._start
        if first + size > len(self._block):
            block = max(size, min(self._source.block, self._source.size - offset))
            self._start, self._block, first = offset, self._source.read(offset, block), 0
        return self._block[first : first + size]


def path_of(target: Target) -> str | os.PathLike[str] | None:
    """The path or address of ``target``, for an error; None for bytes and streams."""
    return target if isinstance(target, (str, os.PathLike)) else None


def _is_plain_file(stream: object) -> bool:
    """Return True for a stream over a file on disk, which can be read at any position."""
    raw = stream.raw if isinstance(stream, io.BufferedReader) else stream
    return isinstance(raw, io.FileIO) and hasattr(os, "pread")


def open_source(target: Target) -> ByteSource:
    """A ByteSource of a path, an fsspec target such as "https://...", or a binary stream.

    A stream that cannot seek is read to its end first.
    """
    if isinstance(target, (bytes, bytearray, memoryview)):
        data = bytes(target)
        name = str(getattr(target, "name", "bytes"))
        return ByteSource(io.BytesIO(data), name=name, target=data)
    if not isinstance(target, (str, os.PathLike)):
        if not hasattr(target, "read"):
            raise OptionError(
                f"cannot open {target!r}, which is neither a path nor a binary stream"
            )
        name = str(getattr(target, "name", "stream"))
        if not target.seekable():
            return ByteSource(io.BytesIO(target.read()), name=name)
        return ByteSource(target, remote=_is_remote(target), name=name)
    if "://" in str(target):
        address = str(target)
        remote = _remote_stream(address)
        return ByteSource(remote, remote=_is_remote(remote), name=address, target=address)
    path = str(Path(target).absolute())  # valid after a change of the working folder
    return ByteSource(open(target, "rb"), name=os.fspath(target), target=path)


def _remote_stream(target: str) -> Any:
    """Open ``target``, a URL; raises OptionError or AccessError."""
    if target.lower().startswith(("http://", "https://")):
        from mcz.container.http import HttpFile

        return HttpFile(target)
    fs, path = file_system(target)
    try:
        return fs.open(path, "rb", cache_type="none")  # an option of the file, not of its store
    except Exception as error:  # each file system has its own errors
        raise _no_access(target, error) from None


def file_system(url: str) -> tuple[Any, str]:
    """The file system of fsspec for ``url``, and the path in it.

    Raises OptionError if fsspec, or its package for the protocol, is not installed.
    """
    fsspec = import_extra("fsspec", "remote", purpose=url)
    try:
        fs, path = fsspec.core.url_to_fs(url)
    except (ValueError, ImportError) as error:  # unknown protocol, or not installed
        raise OptionError(str(error), path=url) from None
    except Exception as error:  # each file system has its own errors
        raise _no_access(url, error) from None
    return fs, str(path)


def _no_access(name: str, error: Exception) -> AccessError:
    """Error of a file that cannot be read, from any exception of its file system."""
    text = "no such file" if isinstance(error, FileNotFoundError) else reason_of(error)
    return AccessError(text, path=name)


def _is_remote(stream: object) -> bool:
    """Return True if every read of ``stream`` is a request, as of an unbuffered fsspec file."""
    if isinstance(stream, io.RawIOBase) and getattr(stream, "is_remote", False):
        return True
    return hasattr(stream, "fs") and not isinstance(getattr(stream, "f", None), io.IOBase)
