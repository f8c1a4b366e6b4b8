"""A file that is being written in steps, each of which is kept or leaves no trace."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from typing import BinaryIO

from mcz.container.copies import Copy
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.writer import Writer
from mcz.errors import MczError, SourceError
from mcz.hints import Hint

Digest = bytes | Callable[[], bytes]


class Draft:
    """A file that is being written in steps: a step that fails leaves no trace.

    ``paths`` tells what the file restores under each path: the SHA-256 of those bytes, or a
    function that finds it. With ``hold`` False what is written goes straight to ``sink``, so that
    nothing can be taken back; that needs no memory and suits a file of one step. ``copies``,
    ``uncopied`` and ``short`` are those of ``Writer``.
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
        self.clips: dict[str, str] = {}  # what the clip of each file is called that was written
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
        self._commit()

    def write(self, data: bytes, /) -> int:
        return (self._pending if self._hold else self._sink).write(data)

    def _commit(self) -> None:
        self._sink.write(self._pending.getbuffer())
        self._pending = io.BytesIO()

    @contextmanager
    def step(self) -> Iterator[None]:
        """What the block writes is kept when the block ends well."""
        before, offset = _snapshot(self.writer.directory), self.writer.offset
        try:
            yield
        except MczError:
            self._pending = io.BytesIO()
            self.writer.rewind(before, offset)
            raise
        self._commit()

    def keep(self) -> None:
        """Keep what was written since the last step."""
        self._commit()

    def holds(self, path: str, digest: bytes) -> bool:
        """Whether the file restores these bytes as ``path``; raises where it restores others."""
        if path not in self.paths:
            return False
        there = self.paths[path]
        if (there if isinstance(there, bytes) else there()) == digest:
            return True
        raise SourceError(f"the file already restores another {path!r}", hint=Hint.REPLACE)

    def finish(self) -> None:
        self.writer.finish()
        self._commit()


def _snapshot(directory: Directory) -> Directory:
    kept = copy(directory)
    for name in ("shared", "attachments", "aliases", "clips"):
        setattr(kept, name, getattr(directory, name).copy())
    return kept
