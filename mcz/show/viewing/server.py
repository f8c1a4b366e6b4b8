"""The server of the page: on this machine only, below an unguessable path.

tools/viewer/README.md, "The server", lists the requests of the page; no others are answered.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import select
import socket
import sys
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from hmac import compare_digest
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from threading import BoundedSemaphore, Thread
from typing import Any, cast

from mcz.errors import AccessError, MczError, OptionError, reason_of
from mcz.model.extras import annex_bytes, annex_names
from mcz.model.types import JsonObject
from mcz.show.viewing.file_registry import FileRegistry
from mcz.show.viewing.page import Page
from mcz.show.viewing.requests import (
    LONGEST_JSON,
    Refused,
    check_same,
    check_sender,
    is_known,
    json_of,
    length_of,
    range_of,
)
from mcz.show.viewing.server_tasks import OpenPages, ServerTasks, Site, lossy_codecs

PULSE = 1.0  # seconds between two checks of an open page
BEAT = 15  # pulses between two signs of life
IDLE = 120  # seconds of silence after which a kept connection is closed
STRICT_POLICY = "default-src 'none'; frame-ancestors 'none'; sandbox"
SAFETY = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "DENY",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}
JSON, BYTES = "application/json", "application/octet-stream"


class Handler(BaseHTTPRequestHandler):
    """Answers the requests of a connection, one after the other."""

    protocol_version = "HTTP/1.1"
    timeout = IDLE
    command = "GET"  # until one is read
    _unread = _has_answered = False  # unread posted bytes; an answer has begun

    @property
    def _site(self) -> Site:
        return cast(Site, cast(Any, self.server).site)

    def do_GET(self) -> None:
        self._answer(self._get, unread=False)

    def do_HEAD(self) -> None:
        self._answer(self._get, unread=False)

    def do_POST(self) -> None:
        self._answer(self._post, unread=True)

    def _answer(self, answer: Callable[[str], None], *, unread: bool) -> None:
        """Answer an allowed request; answer others with the reason."""
        self._unread, self._has_answered = unread, False
        try:
            answer(self._route())
        except Refused as refused:
            self._fail(refused.status, "Refused", str(refused))
        except MczError as error:
            self._fail(422, type(error).__name__, error.describe(self._site.registry.hints))
        except MemoryError:
            self._fail(507, "MemoryError", "out of memory")

    def _route(self) -> str:
        """Path below the token; raises Refused for a request without it."""
        if self.request_version not in ("HTTP/1.0", "HTTP/1.1"):
            raise Refused(505, "the server requires HTTP/1.1")
        check_sender(self.headers, self._site.port)
        if self.command != "POST" and self.headers.get("Content-Length", "0") != "0":
            raise Refused(400, "a GET request must have no body")
        before, *below = self.path.partition("?")[0].split("/", 2)
        token = below[0] if below else ""
        known = compare_digest(token.encode("utf-8", "replace"), self._site.token.encode())
        if before or not known or len(below) != 2:
            raise Refused(404, "there is nothing here")
        return below[1]

    # Resources to get ------------------------------------------------------------

    def _get(self, path: str) -> None:
        if path == "":
            self._send(self._site.page.text.encode(), "text/html; charset=utf-8", 200)
        elif path == "api.json":
            self._send_json(self._site.tasks.document())
        elif path == "alive":
            self._alive()
        elif match := re.fullmatch(r"files/([0-9]{1,9})", path):
            self._file(int(match[1]))
        elif path.removeprefix("annex/") in annex_names("*") and path.startswith("annex/"):
            self._send(annex_bytes(path.removeprefix("annex/")), BYTES, 200)
        else:
            raise Refused(404, "there is nothing here")

    def _file(self, number: int) -> None:
        """Answer a GET or HEAD of a file, or of a range of its bytes."""
        try:
            file = self._site.registry[number]
        except KeyError:
            raise Refused(404, "no such file") from None
        with closing(file.open()) as contents:
            headers = {"ETag": contents.tag, "Accept-Ranges": "bytes"}
            check_same(self.headers, contents.tag)
            if is_known(self.headers, contents.tag):
                self._head(304, {"ETag": contents.tag, "Cache-Control": "private, no-cache"})
                return
            start, stop, status = 0, contents.size, 200
            byte_range = None
            if self.command == "GET":
                try:
                    byte_range = range_of(self.headers, contents.size, contents.tag)
                except Refused as refused:
                    size = {"Content-Range": f"bytes */{contents.size}"}
                    self._fail(refused.status, "Refused", str(refused), size)
                    return
            if byte_range is not None:
                (start, stop), status = byte_range, 206
                headers["Content-Range"] = f"bytes {start}-{stop - 1}/{contents.size}"
            headers |= {"Content-Length": str(stop - start), "Content-Type": BYTES}
            self._head(status, {**headers, "Cache-Control": "private, no-cache"})
            if self.command == "HEAD":
                return
            for piece in contents.pieces(start, stop):
                self.wfile.write(piece)
                start += len(piece)
            self.close_connection = self.close_connection or start != stop

    def _alive(self) -> None:
        """Keep an event stream open as long as the page is."""
        self.close_connection = True
        if self.command == "HEAD":
            self._head(200, {"Content-Type": "text/event-stream", "Cache-Control": "no-store"})
            return
        with self._site.open_pages as pages:
            head = {"Content-Type": "text/event-stream", "Connection": "close"}
            self._head(200, {**head, "Cache-Control": "no-store"})
            pulses = 0
            while not self._is_gone():
                if pulses % BEAT == 0:
                    self.wfile.write(b": here\n\n")
                if not pages.stay(PULSE):
                    self.wfile.write(b"event: end\ndata: \n\n")
                    break
                pulses += 1

    def _is_gone(self) -> bool:
        """Return True if the other side has closed the connection."""
        try:
            readable, _, _ = select.select([self.connection], [], [], 0)
            return bool(readable) and not self.connection.recv(1, socket.MSG_PEEK)
        except (OSError, ValueError):
            return True

    # Tasks to post ---------------------------------------------------------------

    def _post(self, path: str) -> None:
        server_tasks = self._site.tasks
        if path == "convert":
            size = length_of(self.headers, server_tasks.most_posted)
            result = server_tasks.convert(self.rfile, size, self.headers.get("Content-Type", ""))
            self._unread = False
            self._send_json(result)
            return
        tasks: Mapping[str, Callable[[JsonObject], object]] = {
            "encode": server_tasks.encode,
            "diff": server_tasks.diff,
            "glb": server_tasks.glb,
        }
        if path not in tasks:
            raise Refused(404, "there is nothing here")
        if self.headers.get_content_type() != JSON:
            raise Refused(415, "requests must be posted as application/json")
        data = self.rfile.read(length_of(self.headers, LONGEST_JSON))
        self._unread = False
        document = json_of(data)
        with server_tasks.turn(self._is_gone):
            answer = tasks[path](document)
        if isinstance(answer, bytes):
            self._send(answer, "model/gltf-binary", 200)
        else:
            self._send_json(answer)

    # Format of answers -----------------------------------------------------------

    def _send_json(self, document: object) -> None:
        self._send(json.dumps(document, allow_nan=False).encode(), JSON, 200)

    def _send(
        self, data: bytes, kind: str, status: int, more: Mapping[str, str] | None = None
    ) -> None:
        head = {"Content-Type": kind, "Content-Length": str(len(data)), "Cache-Control": "no-store"}
        self._head(status, {**head, **(more or {})})
        if self.command != "HEAD":
            self.wfile.write(data)

    def _head(self, status: int, headers: Mapping[str, str]) -> None:
        self._has_answered = True
        is_page = headers.get("Content-Type", "").startswith("text/html")
        policy = f"{self._site.page.policy}; frame-ancestors 'none'" if is_page else STRICT_POLICY
        self.send_response(status)
        for name, value in {**headers, **SAFETY, "Content-Security-Policy": policy}.items():
            self.send_header(name, value)
        if self.close_connection and "Connection" not in headers:
            self.send_header("Connection", "close")
        self.end_headers()

    def _fail(
        self, status: int, kind: str, text: str, more: Mapping[str, str] | None = None
    ) -> None:
        """Send the error, unless the answer has begun."""
        self.close_connection = self.close_connection or self._unread
        if self._has_answered:
            self.close_connection = True
            return
        error = {"class": kind, "message": " ".join(text.split())}
        self._send(json.dumps({"error": error}).encode(), JSON, status, more)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer malformed requests and unknown methods, as the library reports them."""
        self.close_connection = True
        self._has_answered = False
        self._fail(int(code), "Refused", self.responses.get(int(code), ("refused",))[0])

    def version_string(self) -> str:
        return "mcz"

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing, for privacy."""


GRACE = 5.0  # seconds for a page to come back, such as on a reload
MOST_CONNECTIONS = 128
HOSTS = {"127.0.0.1": "127.0.0.1", "localhost": "127.0.0.1", "::1": "::1"}


class Server(ThreadingHTTPServer):
    """Serves ``page`` and the files of ``registry`` from a thread until it is closed; a context.

    ``host`` is a name of this machine (127.0.0.1, localhost, ::1), ``port`` 0 any free one. Raises
    OptionError for another host, AccessError if the port is not available.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = 64
    allow_reuse_address = os.name == "posix"  # elsewhere others could take the port too

    def __init__(
        self,
        page: Page,
        registry: FileRegistry,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        grace: float | None = None,
    ) -> None:
        if host not in HOSTS:
            text = f"the page is served only to this machine, as one of {', '.join(HOSTS)}"
            raise OptionError(text, path=host)
        self.address_family = socket.AF_INET6 if ":" in HOSTS[host] else socket.AF_INET
        self.site = Site(
            page,
            registry,
            ServerTasks(registry),
            OpenPages(GRACE if grace is None else grace),
            secrets.token_urlsafe(24),
        )
        self._free = BoundedSemaphore(MOST_CONNECTIONS)
        try:
            super().__init__((HOSTS[host], port), Handler)
        except (OSError, OverflowError) as error:
            raise AccessError(reason_of(error), path=f"{host}:{port}") from None
        self.site.port = int(self.server_address[1])
        named = f"[{host}]" if ":" in host else host
        self.url = f"http://{named}:{self.site.port}/{self.site.token}/"
        self._thread = Thread(target=self.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()
        Thread(target=lossy_codecs, daemon=True).start()  # half a second, while the page loads

    def server_bind(self) -> None:
        """Bind without asking a name server for the name of this machine."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = "mcz", int(self.server_address[1])

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop answering, and delete converted files."""
        self.site.open_pages.close()
        with suppress(OSError):
            self.shutdown()
            self.server_close()
        self._thread.join()
        self.site.registry.close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a new thread, or not at all if there are too many."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except BaseException:
            self._free.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report faults of the server; ignore clients that disconnected."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)
