"""A file on a web server, read a range at a time; whatever goes wrong there is an AccessError."""

from __future__ import annotations

import io
import re
from email.message import Message

from mcz.container.http_connections import Answer, Connections

TAIL = 128 * 1024  # bytes at the end that come with the first request: most indexes fit
RANGE = re.compile(r"bytes (?:([0-9]{1,18})-([0-9]{1,18})|\*)/([0-9]{1,18})")
STRONG = re.compile(r'"[^"]*"')  # an ETag by which bytes are the same
NO_SUFFIX = (200, 400, 416, 501)  # what servers answer that do not know of ranges at the end
REPLACED = "the file was replaced while it was read"


class HttpFile(io.RawIOBase):
    """The file at an http or https address, which may seek; a read is at most one request.

    The server must give ranges of bytes (RFC 9110, section 14), of one and the same file: by its
    ETag, else by when it was last modified, and by its size. Threads may share it, and processes
    after a fork. Raises AccessError, which names the address and what the server did.
    """

    is_remote = True  # as ByteSource asks

    def __init__(self, address: str) -> None:
        super().__init__()
        self.name = address
        self._at = 0
        self._server = Connections(address)
        self._conditions: dict[str, str] = {}  # that each request after the first makes
        self._said: tuple[str | None, ...] | None = None  # what tells this file from a later one
        self._size, self._tail = self._read_end()

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at}.get(whence, self._size)
        return self._at

    def tell(self) -> int:
        return self._at

    def read(self, size: int = -1) -> bytes:
        data = self.read_at(self._at, self._size if size < 0 else size)
        self._at += len(data)
        return data

    def read_at(self, at: int, size: int) -> bytes:
        """The ``size`` bytes at ``at``, fewer where the file ends; wherever the file stands."""
        size = max(0, min(size, self._size - at))
        start = at - (self._size - len(self._tail))
        if not size:
            return b""
        if start >= 0:
            return self._tail[start : start + size]
        answer = self._answer(f"{at}-{at + size - 1}", size)
        self._check_range(answer, at, at + size - 1)
        return self._body(answer, size)

    def close(self) -> None:
        if not self.closed and hasattr(self, "_server"):
            self._server.close()
        super().close()

    def _read_end(self) -> tuple[int, bytes]:
        """The size of the file, and the bytes at its end."""
        for asked, most in (f"-{TAIL}", TAIL), ("0-0", 1):
            answer = self._answer(asked, most)
            if _states_empty(answer):
                return 0, b""
            if answer.status not in NO_SUFFIX:
                break
        if asked == "0-0":
            whole, tail = self._check_range(answer, 0, 0), b""
        else:
            whole = self._check_range(answer, None, None)
            tail = self._body(answer, min(TAIL, whole))
        tag, date = answer.headers.get("ETag"), answer.headers.get("Last-Modified")
        self._said = _identity_of(answer.headers)
        if tag and STRONG.fullmatch(tag):
            self._conditions = {"If-Match": tag}
        elif date and not tag:
            self._conditions = {"If-Unmodified-Since": date}
        return whole, tail

    def _answer(self, asked: str, most: int) -> Answer:
        headers = {
            "Range": f"bytes={asked}",
            "Accept-Encoding": "identity",
            "User-Agent": "mcz",
            **self._conditions,
        }
        return self._server.get(headers, most)

    def _check_range(self, answer: Answer, first: int | None, last: int | None) -> int:
        """The size of the whole file, where this is an answer to what was asked.

        ``first``, ``last``: the bytes that were, None for those at the end.
        """
        found = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
        if answer.status == 412 or (answer.status == 416 and self._said is not None):
            raise self._server.error(REPLACED)
        if answer.status == 200:
            raise self._server.error(
                "the server answers 200 to a range of bytes, so it gives no parts; "
                "download the file first"
            )
        if answer.status != 206:
            raise self._server.error(f"the server answers {answer.status} {answer.reason}")
        if found is None or found[1] is None:
            raise self._server.error("the server does not say which range it gives")
        start, stop, whole = (int(number) for number in found.groups())
        if self._said and (self._said, self._size) != (_identity_of(answer.headers), whole):
            raise self._server.error(REPLACED)
        first = max(0, whole - TAIL) if first is None else first
        last = whole - 1 if last is None else last
        if (start, stop) != (first, min(last, whole - 1)):
            raise self._server.error(f"bytes {first} to {last} are asked for, it gives {found[0]}")
        return whole

    def _body(self, answer: Answer, size: int) -> bytes:
        if len(answer.body) != size:
            came = "more" if len(answer.body) > size else f"{len(answer.body)}"
            raise self._server.error(f"{size} bytes are announced, {came} came")
        return answer.body


def _states_empty(answer: Answer) -> bool:
    found = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
    return answer.status == 416 and found is not None and found[3] == "0"


def _identity_of(headers: Message) -> tuple[str | None, ...]:
    """The ETag by which a server tells files apart, else when the file was modified."""
    tag = headers.get("ETag")
    return (tag, None) if tag else (None, headers.get("Last-Modified"))
