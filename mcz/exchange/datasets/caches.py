"""Caches of computed features: in memory, or in a folder."""

from __future__ import annotations

import os
import tempfile
import zlib
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from decimal import Decimal
from pathlib import Path
from threading import Lock
from urllib.parse import quote, unquote

import numpy as np

from mcz.errors import AccessError, OptionError, reason_of
from mcz.model.types import Reals

Arrays = Mapping[str, Reals]
UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
UNITS |= {f"{letter}IB": 2 ** (10 * (n + 1)) for n, letter in enumerate("KMGT")}


def to_size(text: int | str) -> int:
    """A number of bytes, or a text such as "64 MB" or "2 GiB"; raises OptionError.

    >>> to_size("64 MB"), to_size("1.5GiB"), to_size(4096)
    (64000000, 1610612736, 4096)
    """
    words = str(text).strip()
    number = words.rstrip("ABDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz ")
    unit = words[len(number) :].strip().upper()
    with suppress(ArithmeticError, KeyError):
        size = Decimal(number) * UNITS[unit]
        if 0 <= size < 2**62:
            return int(size)
    raise OptionError(
        f"cache is {text!r}; it must be a number of bytes, or a string such as '64 MB'"
    )


def size_of(arrays: Arrays) -> int:
    return sum(array.nbytes for array in arrays.values())


class MemoryCache:
    """Blocks by key, those that were used last: at most ``most_bytes``."""

    def __init__(self, most_bytes: int) -> None:
        self.most_bytes = most_bytes
        self._held: OrderedDict[str, Arrays] = OrderedDict()
        self._size = 0
        self._lock = Lock()

    def get(self, key: str) -> Arrays | None:
        with self._lock:
            found = self._held.get(key)
            if found is not None:
                self._held.move_to_end(key)
            return found

    def put(self, key: str, arrays: Arrays) -> None:
        size = size_of(arrays)
        if size > self.most_bytes:
            return
        with self._lock:
            if key in self._held:
                return
            self._held[key] = arrays
            self._size += size
            while self._size > self.most_bytes:
                self._size -= size_of(self._held.popitem(last=False)[1])


class FolderCache:
    """Blocks as files of a folder, at most ``most_bytes`` of them; what is there stays there.

    Processes may share it: a file gets its name when it is whole, and one that is not what was
    written is created again. Raises AccessError where the folder cannot be used.
    """

    SUFFIX = ".features"

    def __init__(self, folder: Path, most_bytes: int) -> None:
        self.folder, self.most_bytes = folder, most_bytes
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._size = sum(path.stat().st_size for path in folder.glob(f"*{self.SUFFIX}"))
        except OSError as error:
            raise AccessError(reason_of(error), path=folder) from None

    def get(self, key: str) -> Arrays | None:
        try:
            data = self._path(key).read_bytes()
        except OSError:
            return None
        if len(data) < 4 or zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
            return None
        return _unpacked(data[:-4])

    def put(self, key: str, arrays: Arrays) -> None:
        data = _packed(arrays)
        if self._size + len(data) + 4 > self.most_bytes:
            return
        try:
            handle, name = tempfile.mkstemp(dir=self.folder)
            with os.fdopen(handle, "wb") as file:
                file.write(data + zlib.crc32(data).to_bytes(4, "little"))
            os.replace(name, self._path(key))
        except OSError as error:
            raise AccessError(reason_of(error), path=self.folder) from None
        self._size += len(data) + 4

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{self.SUFFIX}"


def _packed(arrays: Arrays) -> bytes:
    """Arrays as bytes: of each a line of its name, type and shape, then its values."""
    parts = []
    for name, array in arrays.items():
        shape = ",".join(map(str, array.shape))
        parts.append(f"{quote(name)} {array.dtype.str} {shape}\n".encode("ascii") + array.tobytes())
    return b"".join(parts)


def _unpacked(data: bytes) -> Arrays:
    arrays, at = {}, 0
    while at < len(data):
        end = data.index(b"\n", at)
        name, dtype, shape = data[at:end].decode("ascii").split(" ")
        dims = tuple(map(int, shape.split(",")))
        count = int(np.prod(dims))
        array = np.frombuffer(data, dtype, count, end + 1).reshape(dims)
        arrays[unquote(name)] = array
        at = end + 1 + array.nbytes
    return arrays


Cache = MemoryCache | FolderCache
