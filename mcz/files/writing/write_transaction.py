"""A file that is written in steps, and its names; a failed step leaves no trace."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

from mcz.container import payloads
from mcz.container.copies import Copy
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.metadata import KEYS, PRIVATE
from mcz.container.strict import is_plain_path
from mcz.container.writer import Writer
from mcz.errors import MczError, MotionError, SourceError
from mcz.hints import Hint

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
        there = self.paths[path]
        if (there if isinstance(there, bytes) else there()) == digest:
            return True
        raise SourceError(f"the file already restores another {path!r}", hint=Hint.REPLACE)

    def finish(self) -> None:
        self.writer.finish()
        self.keep()


def _snapshot(directory: Directory) -> Directory:
    kept = copy(directory)
    for name in ("shared", "attachments", "aliases", "clips"):
        setattr(kept, name, getattr(directory, name).copy())
    return kept


def alias_once(writer: Writer, name: str, id_: bytes) -> None:
    """Name the skeleton ``id_`` as ``name``, unless another has that name."""
    check_name(name)
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def check_name(path: str) -> None:
    """Raise MotionError if a file cannot be stored and restored under ``path``."""
    try:
        path.encode("utf-8")
    except UnicodeEncodeError:
        raise MotionError(
            f"the name {os.fsencode(path)!r} is not UTF-8, as MCZ keeps names; rename the file"
        ) from None
    if not is_plain_path(path):
        raise MotionError(f"source path {path!r} is not relative and plain; rename the file")


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
