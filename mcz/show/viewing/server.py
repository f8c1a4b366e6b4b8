"""The server of the page: on this machine only, below an unguessable path."""

from __future__ import annotations

import os
import secrets
import socket
import sys
from contextlib import suppress
from http.server import ThreadingHTTPServer
from socketserver import TCPServer
from threading import BoundedSemaphore, Thread
from typing import Any

from mcz.errors import AccessError, OptionError, reason_of
from mcz.show.viewing.file_registry import FileRegistry
from mcz.show.viewing.handler import Handler
from mcz.show.viewing.page import Page
from mcz.show.viewing.server_tasks import ServerTasks, Site, Visitors, lossy_codecs

GRACE = 5.0  # seconds in which a page may come back, such as on a reload
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
            text = f"the page is served to this machine alone: one of {', '.join(HOSTS)}"
            raise OptionError(text, path=host)
        self.address_family = socket.AF_INET6 if ":" in HOSTS[host] else socket.AF_INET
        self.site = Site(
            page,
            registry,
            ServerTasks(registry),
            Visitors(GRACE if grace is None else grace),
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
        self.site.visitors.close()
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
