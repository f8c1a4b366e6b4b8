"""The bytes of a file that is served: of one on disk, or far away; a part of them at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from typing import Protocol

from mcz.container.source import ByteSource
from mcz.errors import AccessError, MczError, reason_of

PIECE = 2**18  # bytes that are in memory at a time


class Contents(Protocol):
    """Bytes whose ``size`` and strong ``tag`` were taken when they were opened."""

    size: int
    tag: str

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        """Bytes start <= b < stop in pieces; fewer where the file has become shorter meanwhile."""
        ...

    def close(self) -> None: ...


class OnDisk:
    """A file on this machine; its tag changes whenever the file is written to or replaced."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._stream = open(path, "rb")  # noqa: SIM115 (closed by close)
        except (OSError, ValueError) as error:
            raise AccessError(reason_of(error), path=path) from None
        found = os.fstat(self._stream.fileno())
        self.size = found.st_size
        self.tag = f'"{found.st_size:x}-{found.st_mtime_ns:x}-{found.st_ino:x}"'

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        self._stream.seek(start)
        while start < stop and (piece := self._stream.read(min(PIECE, stop - start))):
            yield piece
            start += len(piece)

    def close(self) -> None:
        self._stream.close()


class FarAway:
    """A file behind a URL, which its source reads by ranges; it does not change while open."""

    def __init__(self, source: ByteSource, tag: str) -> None:
        self._source, self.size, self.tag = source, source.size, tag

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        with suppress(MczError):  # the answer ends early, as of a file that became shorter
            while start < stop:
                size = min(PIECE, stop - start)
                yield self._source.read(start, size)
                start += size

    def close(self) -> None:
        """Nothing: others read the source, too."""
