"""The files of a form (multipart/form-data) that a browser posts: onto the disk, in pieces.

The parsers of the library hold all in memory; this one holds no more than a piece.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from mcz.files.editing.safe_names import PortableNames
from mcz.show.viewing.requests import Refused

MOST_PARTS = 2048
LONGEST_HEAD = 2**13  # bytes of the headers of a part
PIECE = 2**16
DEEPEST = 8  # names in the path of a file

BOUNDARY = re.compile(r'multipart/form-data;\s*boundary=("?)([0-9A-Za-z\'()+_,./:=?-]{1,70})\1\s*')
FILE_NAME = re.compile(rb'(?im)^content-disposition:[^\r\n]*?[;\s]filename="([^"\r\n]*)"')


def boundary_of(content_type: str) -> bytes:
    """Boundary between the parts of a form; raises Refused for any other content."""
    match = BOUNDARY.fullmatch(content_type)
    if match is None:
        raise Refused(415, "files are taken as multipart/form-data")
    return match[2].encode()


def save_files(stream: Readable, size: int, boundary: bytes, folder: Path) -> list[Path]:
    """Write the files of a form of ``size`` bytes below ``folder``; return where each is.

    Fields that are no files are passed over. Raises Refused for what is no form, for more than
    ``MOST_PARTS`` parts, and for two files of one name.
    """
    body = _Body(stream, size, b"\r\n--" + boundary)
    for _ in body.until_delimiter():
        pass  # what stands before the first part says nothing
    found: list[Path] = []
    for _ in range(MOST_PARTS):
        after = body.take(2)
        if after == b"--":
            return found
        if after != b"\r\n":
            raise Refused(400, "the form has a boundary that is followed by something else")
        name = FILE_NAME.search(body.head())
        if name is None or not name[1]:
            for _ in body.until_delimiter():
                pass
            continue
        found.append(_save(body, folder, path_of(name[1])))
    raise Refused(413, f"the form has more than {MOST_PARTS:,} parts")


def _save(body: _Body, folder: Path, name: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        stream = path.open("xb")
    except OSError:  # it is there, or a folder is
        raise Refused(400, "two files of the form have one name") from None
    with stream:
        for piece in body.until_delimiter():
            stream.write(piece)
    return path


def path_of(name: bytes) -> str:
    """The path that a browser gives a file, in which nothing leads out of a folder.

    >>> path_of(b"walks/05 (a).amc"), path_of(b"/../x//b.bvh"), path_of(b"C:\\\\a.bvh")
    ('walks/05 (a).amc', '__/x/b.bvh', 'C_/a.bvh')
    """
    parts = [part for part in re.split(r"[/\\]", name.decode("utf-8", "replace")) if part]
    return PortableNames()("/".join(parts[-DEEPEST:]) or "_")


class Readable(Protocol):
    """Protocol of the stream of a request."""

    def read(self, size: int, /) -> bytes: ...


class _Body:
    """The bytes of a form, read once from start to end; ``delimiter`` ends each part."""

    def __init__(self, stream: Readable, size: int, delimiter: bytes) -> None:
        self._stream, self._left, self._delimiter = stream, size, delimiter
        self._held = b"\r\n"  # so that the first boundary is one like all others

    def _more(self) -> None:
        """Hold a piece more; raises Refused at the end of the form."""
        piece = self._stream.read(min(PIECE, self._left)) if self._left else b""
        if not piece:
            raise Refused(400, "the form ends in a part")
        self._left -= len(piece)
        self._held += piece

    def take(self, size: int) -> bytes:
        while len(self._held) < size:
            self._more()
        taken, self._held = self._held[:size], self._held[size:]
        return taken

    def head(self) -> bytes:
        """The headers of a part, up to the empty line."""
        while (end := self._held.find(b"\r\n\r\n")) < 0:
            if len(self._held) > LONGEST_HEAD:
                raise Refused(400, "a part of the form has headers that are too long")
            self._more()
        if end > LONGEST_HEAD:
            raise Refused(400, "a part of the form has headers that are too long")
        head, self._held = self._held[:end], self._held[end + 4 :]
        return head

    def until_delimiter(self) -> Iterator[bytes]:
        """The content of a part in pieces; the delimiter behind it is passed."""
        while (end := self._held.find(self._delimiter)) < 0:
            kept = len(self._delimiter) - 1  # of which the delimiter may have begun
            if len(self._held) > kept:
                piece, self._held = self._held[:-kept], self._held[-kept:]
                yield piece
            self._more()
        piece, self._held = self._held[:end], self._held[end + len(self._delimiter) :]
        yield piece
