"""Writing a file so that it appears under its name only when it is whole."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from mcz.errors import OptionError


@contextmanager
def replacing(target: Any, *, force: bool) -> Iterator[BinaryIO]:
    """A binary stream whose bytes become ``target`` only when the block ends well.

    On disk that is a temporary file beside the target, synced and renamed; a stream that was
    given is written as it is. Raises OptionError where the target exists and not ``force``.
    """
    if hasattr(target, "write"):
        yield target
        return
    if "://" in str(target):
        import fsspec

        try:
            fs, path = fsspec.core.url_to_fs(str(target))
        except (ValueError, ImportError) as error:  # no such protocol, or not installed
            raise OptionError(f"{target}: {error}") from None
        if not force and fs.exists(path):
            raise OptionError(f"{target} exists; use force to replace it")
        with fs.transaction, fs.open(path, "wb") as remote:
            yield remote
        return
    path = Path(target)
    if not force and path.exists():
        raise OptionError(f"{path} exists; use force to replace it")
    with _temporary(path) as stream:
        yield stream


@contextmanager
def _temporary(path: Path) -> Iterator[BinaryIO]:
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise OptionError(f"{path}: {error.strerror or error}") from None
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)  # mkstemp made it private
        _rename(name, path)
        _sync_directory(path.parent)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def _rename(name: str, path: Path) -> None:
    try:
        os.replace(name, path)
    except OSError as error:  # a folder, perhaps
        raise OptionError(f"{path}: {error.strerror or error}") from None


def _sync_directory(path: Path) -> None:
    """Make the rename itself last; not every system lets a directory be opened."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
