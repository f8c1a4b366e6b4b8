"""A web server on this computer that gives one file in ranges, or answers as a test wants."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

Answering = Callable[[BaseHTTPRequestHandler, bytes, int, int], None]


@dataclass
class Server:
    """Gives ``data`` in ranges; ``wrong`` answers in its place from request ``after`` on."""

    data: bytes
    address: str = ""
    wrong: Answering | None = None
    after: int = 0
    knows_ends: bool = True
    asked: list[str] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)
    headers: list[dict[str, str]] = field(default_factory=list)
    n_connections: int = 0
    n_sent: int = 0  # bytes of ranges

    def answer(self, handler: BaseHTTPRequestHandler) -> None:
        self.asked.append(handler.headers.get("Range", ""))
        self.headers.append(dict(handler.headers))
        first, _, last = self.asked[-1].removeprefix("bytes=").partition("-")
        if not first and not self.knows_ends:
            handler.send_error(501)
            return
        start = int(first) if first else max(0, len(self.data) - int(last))
        stop = min(int(last) + 1, len(self.data)) if first else len(self.data)
        self.n_sent += stop - start
        if self.wrong is not None and len(self.asked) > self.after:
            self.wrong(handler, self.data, start, stop)
        else:
            answer_range(handler, self.data, start, stop)


def answer_range(
    handler: BaseHTTPRequestHandler,
    data: bytes,
    start: int,
    stop: int,
    said: str = "",
    body: bytes | None = None,
    tag: str = '"1"',
    more: dict[str, str] | None = None,
) -> None:
    part = data[start:stop] if body is None else body
    handler.send_response(206)
    handler.send_header("Content-Range", said or f"bytes {start}-{stop - 1}/{len(data)}")
    handler.send_header("Content-Length", str(stop - start))
    for name, value in {"ETag": tag, **(more or {})}.items():
        if value:
            handler.send_header(name, value)
    handler.end_headers()
    handler.wfile.write(part)
    handler.close_connection = handler.close_connection or len(part) != stop - start


@contextmanager
def serve(found: Server, context: ssl.SSLContext | None = None) -> Iterator[None]:
    """Serve ``found`` at a local address, with persistent connections."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            found.paths.append(self.path)
            found.answer(self)

        def log_message(self, format: str, *args: object) -> None:
            pass

    class Listening(ThreadingHTTPServer):
        daemon_threads = True

        def get_request(self) -> tuple[socket.socket, object]:
            connection, address = super().get_request()
            found.n_connections += 1
            return connection, address

        def handle_error(self, request: object, client_address: object) -> None:
            pass  # who was cut off

    with Listening(("127.0.0.1", 0), Handler) as listening:
        if context is not None:
            listening.socket = context.wrap_socket(listening.socket, server_side=True)
        scheme = "http" if context is None else "https"
        found.address = f"{scheme}://127.0.0.1:{listening.server_address[1]}/a.mcz"
        thread = Thread(target=listening.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield
        listening.shutdown()
        thread.join()
