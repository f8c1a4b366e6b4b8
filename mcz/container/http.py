"""A file on a web server, read a range at a time: connections, redirects, repeated attempts.

Threads may share it, and processes after a fork. Faults of a server, a proxy or a network are
AccessErrors that name the address.
"""

from __future__ import annotations

import base64
import http.client
import io
import os
import re
import ssl
import time
from email.message import Message
from email.utils import parsedate_to_datetime
from threading import Lock
from typing import NamedTuple
from urllib.parse import SplitResult, quote, unquote, urljoin, urlsplit
from urllib.request import getproxies, proxy_bypass

from mcz.errors import AccessError, reason_of

TIMEOUT = 30.0  # seconds that a server may be silent
ATTEMPTS = 3  # of a request that may do better the next time
DELAY = 0.5  # seconds before the second attempt, doubled before the third
PATIENCE = 30.0  # seconds that a server may ask to wait
BUSY = (429, 502, 503, 504)  # statuses that may change in a moment
REDIRECTS = (301, 302, 303, 307, 308)
MOST_REDIRECTS = 5
EXPIRED = (401, 403, 404, 410)  # statuses of an address that a redirect gave for a limited time
MOST_IGNORED = 64 * 1024  # bytes of an unused body that are read to keep a connection
PLAIN = "%/:=&?~+!$,;'@()*[]"  # characters of an address that are not escaped

sleep = time.sleep


class Answer(NamedTuple):
    """A server's answer; ``body`` is at most the requested bytes and one more."""

    status: int
    reason: str
    headers: Message
    body: bytes


class _Goal(NamedTuple):
    scheme: str
    host: str
    port: int | None
    path: str

    @property
    def address(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        port = "" if self.port is None else f":{self.port}"
        return f"{self.scheme}://{host}{port}{self.path}"


class _Line(NamedTuple):
    """A connection; ``headers`` are for its proxy, None without a proxy."""

    connection: http.client.HTTPConnection
    headers: dict[str, str] | None = None


class Connections:
    """Gets ranges of the file at ``address``; raises AccessError for a bad address."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._first = self._goal = self._parse_address(address)
        self._idle: dict[_Goal, list[_Line]] = {}
        self._lock, self._process = Lock(), os.getpid()
        self._context: ssl.SSLContext | None = None

    def get(self, headers: dict[str, str], most: int) -> Answer:
        """The answer to GET with these headers, its body up to ``most`` bytes and one more.

        Tries again, ``ATTEMPTS`` times in all, if the connection breaks, no answer comes or the
        server is busy; raises AccessError with the number of attempts.
        """
        attempt, wait = 1, 0.0
        while True:
            try:
                answer = self._follow(headers, most)
            except (OSError, http.client.HTTPException, ValueError) as error:
                text = _describe(error)
                again = _is_worth_a_retry(error)
                wait = 0.0
            else:
                if answer.status not in BUSY:
                    return answer
                text = f"the server answers {answer.status} {answer.reason}"
                wait = _retry_after(answer.headers)
                again = wait <= PATIENCE
                if not again:
                    text += f" and asks to wait {wait:.0f} s"
            if not again or attempt == ATTEMPTS:
                raise self.error(text if attempt == 1 else f"{text}; tried {attempt} times")
            sleep(max(wait, DELAY * 2 ** (attempt - 1)))
            attempt += 1

    def error(self, text: str) -> AccessError:
        return AccessError(text, path=self.address)

    def close(self) -> None:
        """Close kept connections."""
        idle, self._idle = self._idle, {}
        for lines in idle.values():
            for line in lines:
                line.connection.close()

    def _parse_address(self, address: str) -> _Goal:
        try:
            parts: SplitResult = urlsplit(address)
            port = parts.port
        except ValueError as error:
            raise self.error(str(error)) from None
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise self.error(f"{address} is not an http or https URL")
        if "@" in parts.netloc:
            raise self.error("a URL with user and password is not accepted")
        query = f"?{parts.query}" if parts.query else ""
        path = quote((parts.path or "/") + query, safe=PLAIN)
        return _Goal(parts.scheme, parts.hostname, port, path)

    def _follow(self, headers: dict[str, str], most: int) -> Answer:
        """The answer after all redirects, whose target the next request uses directly."""
        goal = self._goal
        for _ in range(MOST_REDIRECTS + 1):
            answer = self._send(goal, headers, most)
            place = answer.headers.get("Location")
            if answer.status in REDIRECTS and place:
                goal = self._redirect(goal, place)
            elif answer.status in EXPIRED and goal == self._goal != self._first:
                goal = self._goal = self._first
            else:
                if answer.status < 400:
                    self._goal = goal
                return answer
        raise self.error(f"more than {MOST_REDIRECTS} redirects")

    def _redirect(self, goal: _Goal, place: str) -> _Goal:
        led = self._parse_address(urljoin(goal.address, place))
        if goal.scheme == "https" and led.scheme == "http":
            raise self.error("the server redirects from https to http, which is refused")
        return led

    def _send(self, goal: _Goal, headers: dict[str, str], most: int) -> Answer:
        """The answer of the server at ``goal``; a closed connection is opened again."""
        while True:
            line, is_new = self._find_line(goal)
            try:
                answer, is_whole = _exchange(line, goal, headers, most)
            except ssl.SSLCertVerificationError as error:
                line.connection.close()
                raise self.error(
                    f"the certificate of {goal.host} is not accepted: {error.verify_message}; "
                    "SSL_CERT_FILE names a file of further authorities"
                ) from None
            except BaseException as error:
                line.connection.close()
                if is_new or not isinstance(error, ConnectionError):
                    raise
                continue
            if is_whole:
                self._keep(goal, line)
            else:
                line.connection.close()
            return answer

    def _find_line(self, goal: _Goal) -> tuple[_Line, bool]:
        if self._process != os.getpid():  # connections of the parent belong to it
            self._idle, self._lock, self._process = {}, Lock(), os.getpid()
        with self._lock:
            idle = self._idle.get(goal._replace(path=""))
            if idle:
                return idle.pop(), False
        return self._connect(goal), True

    def _keep(self, goal: _Goal, line: _Line) -> None:
        with self._lock:
            self._idle.setdefault(goal._replace(path=""), []).append(line)

    def _connect(self, goal: _Goal) -> _Line:
        proxy = None if proxy_bypass(goal.host) else getproxies().get(goal.scheme)
        via = urlsplit(proxy if "://" in proxy else f"http://{proxy}") if proxy else None
        host, port = (via.hostname or "", via.port) if via else (goal.host, goal.port)
        if goal.scheme == "http":
            plain = http.client.HTTPConnection(host, port, timeout=TIMEOUT)
            return _Line(plain, _authorization(via) if via else None)
        if self._context is None:
            self._context = ssl.create_default_context()
        secure = http.client.HTTPSConnection(host, port, timeout=TIMEOUT, context=self._context)
        if via:
            secure.set_tunnel(goal.host, goal.port, headers=_authorization(via))
        return _Line(secure)


def _exchange(line: _Line, goal: _Goal, headers: dict[str, str], most: int) -> tuple[Answer, bool]:
    """The answer on this connection, and whether it may be kept for the next request."""
    if line.headers is None:
        line.connection.request("GET", goal.path, headers=headers)
    else:
        line.connection.request("GET", goal.address, headers=headers | line.headers)
    came = line.connection.getresponse()
    announced = came.length
    body = came.read(most + 1 if came.status == 206 else MOST_IGNORED)
    if came.status == 206 and announced is not None and len(body) < min(most + 1, announced):
        raise http.client.IncompleteRead(body, announced - len(body))
    is_whole = came.isclosed() and not came.will_close
    return Answer(came.status, came.reason, came.headers, body), is_whole


def _describe(error: Exception) -> str:
    if isinstance(error, http.client.IncompleteRead):
        came = len(error.partial)
        return f"{came + (error.expected or 0)} bytes were announced, but {came} received"
    if isinstance(error, TimeoutError):
        return f"no answer within {TIMEOUT:.0f} s"
    return reason_of(error)


def _is_worth_a_retry(error: Exception) -> bool:
    if isinstance(error, ConnectionRefusedError | ssl.SSLError):
        return False
    return isinstance(error, ConnectionError | TimeoutError | http.client.IncompleteRead)


def _retry_after(headers: Message) -> float:
    """The requested seconds to wait, 0 if the server states none."""
    text = headers.get("Retry-After", "").strip()
    if text.isdecimal():
        return float(text[:9])
    try:
        return max(0.0, parsedate_to_datetime(text).timestamp() - time.time())
    except (ValueError, TypeError, OverflowError):
        return 0.0


def _authorization(proxy: SplitResult) -> dict[str, str]:
    if proxy.username is None:
        return {}
    words = f"{unquote(proxy.username)}:{unquote(proxy.password or '')}"
    return {"Proxy-Authorization": "Basic " + base64.b64encode(words.encode()).decode("ascii")}


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

    def _answer(self, span: str, most: int) -> Answer:
        headers = {
            "Range": f"bytes={span}",
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
                "the server ignores byte ranges (it answers 200); download the file first"
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
            raise self._server.error(f"{size} bytes were announced, but {received} received")
        return answer.body


def _states_empty(answer: Answer) -> bool:
    match = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
    return answer.status == 416 and match is not None and match[3] == "0"


def _identity_of(headers: Message) -> tuple[str | None, ...]:
    """(ETag, None), or (None, date of the last change) without an ETag."""
    tag = headers.get("ETag")
    return (tag, None) if tag else (None, headers.get("Last-Modified"))
