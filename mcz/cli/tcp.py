"""A live stream over TCP: to any client, from the beginning or from an entry point."""

from __future__ import annotations

import re
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hmac import compare_digest
from io import BufferedReader
from threading import Condition, Event, Lock, Thread
from time import monotonic, sleep
from typing import TYPE_CHECKING, BinaryIO

from mcz.cli.common import Exit, Failure, errors_about
from mcz.cli.standard_input import InputWaiter
from mcz.cli.terminal import say

if TYPE_CHECKING:
    from mcz.files.live.writer import LiveWriter

MOST_WAITING = 4 * 2**20  # bytes that a client may lag behind
LINGER = 10.0  # seconds that clients have for the rest, after the last frame
PATIENCE = 10.0  # seconds for a client to send its token
LOOPBACK = "127.0.0.1"


def address_of(text: str) -> tuple[str, int]:
    """Parse ``HOST:PORT``; the loopback without a host. Raises Failure."""
    host, colon, port = text.rpartition(":")
    plain = port.isascii() and port.isdigit() and len(port) <= 5 and int(port) <= 65_535
    if not colon or not plain or not _is_name(host):
        raise Failure(f"{text!r} is not HOST:PORT", Exit.USAGE)
    return host.strip("[]") or LOOPBACK, int(port)


def _is_name(host: str) -> bool:
    try:
        host.encode("idna")
    except UnicodeError:
        return False
    return True


@contextmanager
def connect(
    text: str, token: str | None = None, timeout: float | None = None
) -> Iterator[BinaryIO]:
    """Connect to ``HOST:PORT`` and yield its binary stream; ``token`` is sent first if given.

    The stream ends after ``timeout`` seconds of silence. Raises Failure if no byte arrives at all.
    """
    with (
        socket.create_connection(address_of(text), timeout) as connection,
        connection.makefile("rb", buffering=0) as raw,
    ):
        connection.settimeout(None)
        if token is not None:
            connection.sendall(line_of(token))
        waiting = InputWaiter(raw, timeout)
        stream = BufferedReader(waiting)
        if not stream.peek(1):
            hint = "is the --token right?" if token else "it may ask for a --token"
            ending = waiting.ending or "the connection was closed before anything came"
            raise Failure(f"{ending}; {hint}", path=text)
        yield stream


def line_of(token: str) -> bytes:
    """The line that a client sends first; raises Failure for a bad token."""
    if not re.fullmatch("[!-~]{1,200}", token):
        raise Failure("a token must have 1 to 200 characters of ASCII, without blanks", Exit.USAGE)
    return token.encode() + b"\n"


def is_local(host: str) -> bool:
    """Return whether a listening address is reachable from this machine only."""
    from ipaddress import ip_address

    return ip_address(host.partition("%")[0]).is_loopback


class Listener:
    """Sends written bytes to all clients; no client can block the writer.

    The first write goes first to every client. Later ones are frames: a client that connects after
    the first of them starts at the next frame whose ``entry`` is not None, the number of bytes
    before it that are not needed there. ``beat`` sends bytes to all clients that are not an entry.
    A client that is ``MOST_WAITING`` bytes behind is dropped. With ``token`` a client gets no bytes
    before it has sent a line with this token. Raises OSError if the address is not available.
    """

    def __init__(self, text: str, token: str | None = None) -> None:
        host, port = address_of(text)
        self._token = None if token is None else line_of(token)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._server = socket.create_server((host, port), family=family)
        self.entry: Callable[[], int | None] = lambda: None
        self._opening: bytes | None = None
        self._is_closed = False
        self._has_frames = self._is_beat = False
        self._clients: list[_Client] = []
        self._changed = Condition()
        self._accepting = Thread(target=self._accept, daemon=True)
        self._accepting.start()

    @property
    def address(self) -> str:
        host, port = self._server.getsockname()[:2]
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

    @property
    def is_open_to_others(self) -> bool:
        """Return whether other machines can reach the port."""
        return not is_local(str(self._server.getsockname()[0]))

    def wait_for(self, n_clients: int) -> None:
        """Wait for ``n_clients``."""
        with self._changed:
            self._changed.wait_for(lambda: len(self._clients) >= n_clients)

    def write(self, data: bytes, /) -> int:
        """Send ``data`` to all clients without waiting for them."""
        data = bytes(data)
        with self._changed:
            if self._opening is None:
                self._opening = data
                self._send(data, None)
            else:
                self._has_frames = self._has_frames or not self._is_beat
                self._send(data, self.entry())
        return len(data)

    def beat(self, write: Callable[[], None]) -> None:
        """Call ``write`` and send its bytes as a heartbeat."""
        self._is_beat = True
        try:
            write()
        finally:
            self._is_beat = False

    def _send(self, data: bytes, entry: int | None) -> None:
        for client in list(self._clients):
            if client.has_joined:
                client.put(data)
            elif entry is not None:
                client.has_joined = not self._is_beat
                client.put(data[entry:])
            if client.is_gone:
                self._clients.remove(client)

    def _accept(self) -> None:
        while True:
            try:
                connection, where = self._server.accept()
            except OSError as error:
                if self._is_closed:
                    return
                say(f"a client could not connect: {error.strerror}")
                sleep(0.1)  # the shortage may pass
                continue
            name = f"{where[0]}:{where[1]}"
            if self._token is None:
                self._admit(connection, name)
            else:  # a silent client delays no other
                Thread(target=self._ask, args=(connection, name), daemon=True).start()

    def _ask(self, connection: socket.socket, name: str) -> None:
        assert self._token is not None
        if compare_digest(_first_line(connection, len(self._token)), self._token):
            self._admit(connection, name)
            return
        say(f"client {name} did not send the token, and was disconnected")
        connection.close()

    def _admit(self, connection: socket.socket, name: str) -> None:
        with self._changed:
            if self._is_closed:
                connection.close()
                return
            client = _Client(connection, name, not self._has_frames)
            if self._opening is not None:
                client.put(self._opening)
            self._clients.append(client)
            self._changed.notify_all()

    def close(self) -> None:
        """Accept no more clients, and give the connected ones a while for the rest."""
        self._is_closed = True
        with suppress(OSError):  # close alone does not wake a waiting accept
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._accepting.join(LINGER)
        until = monotonic() + LINGER
        for client in self._clients:
            client.finish(until)


def _first_line(connection: socket.socket, size: int) -> bytes:
    """The first ``size`` bytes, or those received until a line end or the timeout."""
    line, until = b"", monotonic() + PATIENCE
    with suppress(OSError):
        while len(line) < size and not line.endswith(b"\n") and (left := until - monotonic()) > 0:
            connection.settimeout(left)
            if not (more := connection.recv(size - len(line))):
                break
            line += more
        connection.settimeout(None)
    return line


class _Client:
    def __init__(self, connection: socket.socket, name: str, has_joined: bool) -> None:
        self.has_joined = has_joined
        self.is_gone = False
        self._connection, self._name = connection, name
        self._queue: deque[bytes] = deque()
        self._waiting = 0  # bytes in the queue
        self._is_last = False
        self._changed = Condition()
        self._thread = Thread(target=self._feed, daemon=True)
        self._thread.start()

    def put(self, data: bytes) -> None:
        """Queue ``data``; the client is dropped if the queue is too long."""
        with self._changed:
            if self.is_gone:
                return
            self._queue.append(data)
            self._waiting += len(data)
            too_slow = self._waiting > MOST_WAITING
            self._changed.notify()
        if too_slow:
            say(
                f"client {self._name} is more than {MOST_WAITING:,} bytes behind, and was "
                "disconnected"
            )
            self._drop()

    def finish(self, until: float) -> None:
        """Close the connection when the queue is empty, or at ``until``."""
        with self._changed:
            self._is_last = True
            self._changed.notify()
        self._thread.join(max(0.0, until - monotonic()))
        if self._thread.is_alive():
            say(f"client {self._name} did not accept the rest, and was disconnected")
        self._drop()

    def _feed(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._queue or self._is_last or self.is_gone)
                if self.is_gone or not self._queue:
                    return
                data = b"".join(self._queue)
                self._queue.clear()
            try:
                self._connection.sendall(data)
            except OSError:  # the client left
                self._drop()
                return
            with self._changed:
                self._waiting -= len(data)

    def _drop(self) -> None:
        with self._changed:
            self.is_gone = True
            self._queue.clear()
            self._changed.notify()
        with suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()


@contextmanager
def listen(where: str, token: str | None) -> Iterator[Listener]:
    """A sink that sends to clients."""
    with errors_about(where):
        listener = Listener(where, token)
    say(f"listening on {listener.address}")
    if listener.is_open_to_others:
        who = "everyone who" if token is None else "everyone who has the token and"
        hint = "; --token asks for one" if token is None else ""
        say(f"{who} reaches the port can read the stream, which is not encrypted{hint}")
    try:
        yield listener
    finally:
        listener.close()


class Heartbeat:
    """Writes a heartbeat after every ``seconds`` without a frame, from a thread; 0: never.

    Users of the writer hold ``lock``.
    """

    def __init__(
        self, writer: LiveWriter, seconds: float, listener: Listener | None = None
    ) -> None:
        self.lock = Lock()
        self._writer, self._seconds, self._listener = writer, seconds, listener
        self._is_over = Event()
        self._thread = Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Heartbeat:
        if self._seconds:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        if self._seconds:
            self._thread.join()

    def _beat(self) -> None:
        sent, since = self._writer.traffic.total, monotonic()
        while not self._is_over.wait(min(self._seconds / 4, 1.0)):
            with self.lock:
                now = self._writer.traffic.total
                if now == sent and monotonic() - since >= self._seconds:
                    with suppress(OSError):  # the next frame gets the same error
                        self._write()
                    now = self._writer.traffic.total
            if now != sent:
                sent, since = now, monotonic()

    def _write(self) -> None:
        if self._listener is None:
            self._writer.heartbeat()
        else:
            self._listener.beat(self._writer.heartbeat)
