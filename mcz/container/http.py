"""A file on a web server, read a range at a time; every failure is an AccessError."""

from __future__ import annotations

import io
import re
from email.message import Message

from mcz.container.http_connections import Answer, Connections

TAIL = 128 * 1024  # bytes at the end that come with the first request: most indexes fit
RANGE = re.compile(r"bytes (?:([0-9]{1,18})-([0-9]{1,18})|\*)/([0-9]{1,18})")
STRONG = re.compile(r'"[^"]*"')  # a strong ETag: equal tags, equal bytes
NO_SUFFIX = (200, 400, 416, 501)  # statuses of servers without suffix ranges
REPLACED = "the file was replaced while it was read"


class HttpFile(io.RawIOBase):
    """The seekable file at an http or https address; a read is at most one request.

    The server must serve ranges of bytes (RFC 9110, section 14). Its ETag, else its date, and its
    size show that the file is unchanged. Threads may share it, and processes after a fork. Raises
    AccessError with the address and the server's answer.
    """

    is_remote = True  # read by ByteSource

    def __init__(self, address: str) -> None:
        super().__init__()
        self.name = address
        self._at = 0
        self._server = Connections(address)
        self._conditions: dict[str, str] = {}  # headers of each later request
        self._identity: tuple[str | None, ...] | None = None  # (ETag, date) of the first answer
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
        """The ``size`` bytes at ``at``, fewer at the end; the position of ``tell`` is not used."""
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
        for range_text, size in (f"-{TAIL}", TAIL), ("0-0", 1):
            answer = self._answer(range_text, size)
            if _states_empty(answer):
                return 0, b""
            if answer.status not in NO_SUFFIX:
                break
        if range_text == "0-0":
            whole, tail = self._check_range(answer, 0, 0), b""
        else:
            whole = self._check_range(answer, None, None)
            tail = self._body(answer, min(TAIL, whole))
        tag, date = answer.headers.get("ETag"), answer.headers.get("Last-Modified")
        self._identity = _identity_of(answer.headers)
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
        """Check that the answer has the requested range; return the file's size.

        ``first``, ``last``: the requested bytes; None: a range at the end.
        """
        match = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
        if answer.status == 412 or (answer.status == 416 and self._identity is not None):
            raise self._server.error(REPLACED)
        if answer.status == 200:
            raise self._server.error(
                "the server answers 200 to a range of bytes, so it gives no parts; "
                "download the file first"
            )
        if answer.status != 206:
            raise self._server.error(f"the server answers {answer.status} {answer.reason}")
        if match is None or match[1] is None:
            raise self._server.error("the server does not state the range that it sends")
        start, stop, whole = (int(number) for number in match.groups())
        if self._identity and (self._identity, self._size) != (_identity_of(answer.headers), whole):
            raise self._server.error(REPLACED)
        first = max(0, whole - TAIL) if first is None else first
        last = whole - 1 if last is None else last
        if (start, stop) != (first, min(last, whole - 1)):
            raise self._server.error(
                f"bytes {first} to {last} were requested, the server sent {match[0]}"
            )
        return whole

    def _body(self, answer: Answer, size: int) -> bytes:
        if len(answer.body) != size:
            received = "more" if len(answer.body) > size else f"{len(answer.body)}"
            raise self._server.error(f"{size} bytes are announced, {received} were received")
        return answer.body


def _states_empty(answer: Answer) -> bool:
    match = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
    return answer.status == 416 and match is not None and match[3] == "0"


def _identity_of(headers: Message) -> tuple[str | None, ...]:
    """(ETag, None), or (None, date of the last change) without an ETag."""
    tag = headers.get("ETag")
    return (tag, None) if tag else (None, headers.get("Last-Modified"))
