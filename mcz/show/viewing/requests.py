"""Requests: permission, ranges of bytes, posted forms, and the bytes of a served file."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from email.message import Message
from pathlib import Path
from typing import Protocol

from mcz.container.source import ByteSource
from mcz.errors import AccessError, MczError, reason_of
from mcz.files.editing.folders import PortableNames
from mcz.model.types import JsonObject, Params

LONGEST_JSON = 2**16  # bytes that a request may post as JSON
MOST_PARAMS = 64

Headers = Message  # of a request, as http.server parses it


class Refused(Exception):
    """A refused request: an HTTP status, and a sentence with the reason."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


def check_sender(headers: Headers, port: int) -> None:
    """Raise Refused unless a request came to this server by its own name, and from its own page.

    A foreign name for this machine (DNS rebinding) is in Host; a page of another origin in Origin,
    or in the metadata of browsers (Sec-Fetch-Site).
    """
    hosts = [f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]")]
    host = headers.get_all("Host", [])
    if len(host) != 1 or host[0].lower() not in hosts:
        raise Refused(421, "the Host of the request is not this server")
    for origin in headers.get_all("Origin", []):
        if origin != f"http://{host[0].lower()}":
            raise Refused(403, "the request comes from another page")
    fetched = {key: headers.get(f"Sec-Fetch-{key}") for key in ("Site", "Mode", "Dest")}
    opened = (fetched["Mode"], fetched["Dest"]) == ("navigate", "document")  # a link, in its window
    if fetched["Site"] not in (None, "same-origin", "none") and not opened:
        raise Refused(403, "the request comes from another page")


def range_of(headers: Headers, size: int, tag: str) -> tuple[int, int] | None:
    """The range of bytes, start and stop, that a GET requests of ``size``; None: all.

    By RFC 9110 all bytes are sent for a malformed range, for several ranges, and if ``If-Range``
    names other bytes. Raises Refused (416) for a range that begins after the end.
    """
    if headers.get("If-Range", tag) != tag:
        return None
    match = re.fullmatch(r"bytes=[ \t]*(\d{0,18})-(\d{0,18})[ \t]*", headers.get("Range", ""))
    if not match or not (match[1] or match[2]):
        return None
    if not match[1]:
        start, stop = max(0, size - int(match[2])), size
    else:
        start, stop = int(match[1]), size
        if match[2]:
            if int(match[2]) < start:
                return None
            stop = min(size, int(match[2]) + 1)
    if start >= stop:
        raise Refused(416, f"the range begins after the end, at {size}")
    return start, stop


def is_known(headers: Headers, tag: str) -> bool:
    """Return True if the sender has these bytes already (If-None-Match)."""
    return tag in _tags(headers.get("If-None-Match", "")) or headers.get("If-None-Match") == "*"


def check_same(headers: Headers, tag: str) -> None:
    """Raise Refused (412) if the sender requires other bytes (If-Match)."""
    tags = headers.get("If-Match")
    if tags is not None and tags != "*" and tag not in _tags(tags):
        raise Refused(412, "the file has changed meanwhile")


def _tags(text: str) -> list[str]:
    """
    >>> _tags('"a-1", W/"b"')
    ['"a-1"', '"b"']
    """
    return re.findall(r'"[^"]*"', text)


def length_of(headers: Headers, most: int) -> int:
    """The number of posted bytes; raises Refused if it is not stated, or too large."""
    lengths = headers.get_all("Content-Length", [])
    if headers.get("Transfer-Encoding") is not None or len(lengths) != 1:
        raise Refused(411, "the request must state its Content-Length")
    if not re.fullmatch(r"[0-9]{1,15}", lengths[0]):
        raise Refused(400, "Content-Length is not a number")
    if int(lengths[0]) > most:
        raise Refused(
            413, f"the request has {int(lengths[0]):,} bytes; at most {most:,} are accepted"
        )
    return int(lengths[0])


def json_of(data: bytes) -> JsonObject:
    """An object of JSON; raises Refused for anything else."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        raise Refused(400, "the request is not valid JSON") from None
    if not isinstance(document, dict):
        raise Refused(400, "the request must be a JSON object")
    return document


def text_of(document: Params, key: str) -> str:
    """A text of an object; raises Refused for another type."""
    value = document.get(key)
    if not isinstance(value, str) or not value:
        raise Refused(400, f"{key} must be a string")
    return value


def object_of(document: Params, key: str) -> JsonObject:
    """An object in an object; raises Refused for another type."""
    value = document.get(key)
    if not isinstance(value, dict):
        raise Refused(400, f"{key} must be an object")
    return value


def params_of(document: Params) -> JsonObject:
    """The parameters of a codec by name: texts, numbers and truths, no null; raises Refused."""
    stated = document.get("params") or {}
    if not isinstance(stated, dict) or len(stated) > MOST_PARAMS:
        raise Refused(400, "params must be an object of parameters")
    params = {key: value for key, value in stated.items() if value is not None}
    for key, value in params.items():
        if not isinstance(value, str | int | float | bool):
            raise Refused(400, f"parameter {key[:40]!r} must be a string or a number")
    return params


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
        raise Refused(415, "files must be posted as multipart/form-data")
    return match[2].encode()


def save_files(stream: Readable, size: int, boundary: bytes, folder: Path) -> list[Path]:
    """Write the files of a form of ``size`` bytes below ``folder``; return their paths.

    Fields other than files are skipped. Raises Refused for a bad form, for more than ``MOST_PARTS``
    parts, and for two files of one name.
    """
    body = _Body(stream, size, b"\r\n--" + boundary)
    for _ in body.until_delimiter():
        pass  # the text before the first part is ignored
    paths: list[Path] = []
    for _ in range(MOST_PARTS):
        after = body.take(2)
        if after == b"--":
            return paths
        if after != b"\r\n":
            raise Refused(400, "a boundary of the form is followed by something else")
        name = FILE_NAME.search(body.head())
        if name is None or not name[1]:
            for _ in body.until_delimiter():
                pass
            continue
        paths.append(_save(body, folder, path_of(name[1])))
    raise Refused(413, f"the form has more than {MOST_PARTS:,} parts")


def _save(body: _Body, folder: Path, name: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        stream = path.open("xb")
    except OSError:  # a file or folder of that name exists
        raise Refused(400, "two files of the form have the same name") from None
    with stream:
        for piece in body.until_delimiter():
            stream.write(piece)
    return path


def path_of(name: bytes) -> str:
    """The path that a browser gives a file, made to stay inside a folder.

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
        self._held = b"\r\n"  # so that the first boundary looks like all others

    def _read_more(self) -> None:
        """Read another piece; raises Refused at the end of the form."""
        piece = self._stream.read(min(PIECE, self._left)) if self._left else b""
        if not piece:
            raise Refused(400, "the form is truncated within a part")
        self._left -= len(piece)
        self._held += piece

    def take(self, size: int) -> bytes:
        while len(self._held) < size:
            self._read_more()
        data, self._held = self._held[:size], self._held[size:]
        return data

    def head(self) -> bytes:
        """The headers of a part, up to the empty line."""
        while (end := self._held.find(b"\r\n\r\n")) < 0:
            if len(self._held) > LONGEST_HEAD:
                raise Refused(400, "a part of the form has headers that are too long")
            self._read_more()
        if end > LONGEST_HEAD:
            raise Refused(400, "a part of the form has headers that are too long")
        head, self._held = self._held[:end], self._held[end + 4 :]
        return head

    def until_delimiter(self) -> Iterator[bytes]:
        """The content of a part in pieces; the delimiter after it is consumed."""
        while (end := self._held.find(self._delimiter)) < 0:
            kept = len(self._delimiter) - 1  # the delimiter may have begun in them
            if len(self._held) > kept:
                piece, self._held = self._held[:-kept], self._held[-kept:]
                yield piece
            self._read_more()
        piece, self._held = self._held[:end], self._held[end + len(self._delimiter) :]
        yield piece


READ_SIZE = 2**18  # bytes that are in memory at a time


class Contents(Protocol):
    """Bytes whose ``size`` and strong ``tag`` are fixed when they are opened."""

    size: int
    tag: str

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        """Yield the bytes start <= b < stop in pieces; fewer if the file has become shorter."""
        ...

    def close(self) -> None: ...


class FileContents:
    """A file on this machine; its tag changes whenever the file is written to or replaced."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._stream = open(path, "rb")  # noqa: SIM115 (closed by close)
        except (OSError, ValueError) as error:
            raise AccessError(reason_of(error), path=path) from None
        status = os.fstat(self._stream.fileno())
        self.size = status.st_size
        self.tag = f'"{status.st_size:x}-{status.st_mtime_ns:x}-{status.st_ino:x}"'

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        self._stream.seek(start)
        while start < stop and (piece := self._stream.read(min(READ_SIZE, stop - start))):
            yield piece
            start += len(piece)

    def close(self) -> None:
        self._stream.close()


class RemoteContents:
    """A file at a URL, read by ranges; it does not change while open."""

    def __init__(self, source: ByteSource, tag: str) -> None:
        self._source, self.size, self.tag = source, source.size, tag

    def pieces(self, start: int, stop: int) -> Iterator[bytes]:
        with suppress(MczError):  # the answer ends early, as of a file that became shorter
            while start < stop:
                size = min(READ_SIZE, stop - start)
                yield self._source.read(start, size)
                start += size

    def close(self) -> None:
        """Keep the source open, which others read too."""
