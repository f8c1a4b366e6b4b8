"""Requests to a server of the page, as browsers and others send them."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from mcz.show.viewing.file_registry import FileRegistry, add_path
from mcz.show.viewing.page import page
from mcz.show.viewing.server import Server


class Answer(NamedTuple):
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@contextmanager
def serve_files(*paths: object, **facts: Any) -> Iterator[Server]:
    """A server of the page and of files."""
    registry = FileRegistry(facts)
    for path in paths:
        add_path(registry, str(path))
    with Server(page(), registry) as server:
        yield server


def ask(
    server: Server,
    path: str,
    method: str = "GET",
    body: bytes | None = None,
    **headers: str,
) -> Answer:
    """The answer to a request for ``path`` below the token; a header's ``_`` is a ``-``."""
    return ask_anywhere(server, f"/{server.site.token}/{path}", method, body, **headers)


def ask_anywhere(
    server: Server, path: str, method: str = "GET", body: bytes | None = None, **headers: str
) -> Answer:
    connection = http.client.HTTPConnection("127.0.0.1", server.site.port, timeout=60)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, named)
    response = connection.getresponse()
    answer = Answer(response.status, dict(response.getheaders()), response.read())
    connection.close()
    return answer


def post(server: Server, path: str, document: Any) -> Answer:
    data = json.dumps(document).encode()
    return ask(server, path, "POST", data, Content_Type="application/json")


def form(*files: tuple[str, bytes]) -> bytes:
    """The body of a form whose boundary is ``X``."""
    parts = [
        b'--X\r\nContent-Disposition: form-data; name="file"; filename="%s"\r\n\r\n%s\r\n'
        % (name.encode(), data)
        for name, data in files
    ]
    return b"".join(parts) + b"--X--\r\n"


def convert(server: Server, body: bytes) -> Answer:
    return ask(server, "convert", "POST", body, Content_Type="multipart/form-data; boundary=X")


def raw(server: Server, data: bytes) -> bytes:
    """Send bytes that may be no request; return the server's reply until it closes."""
    with socket.create_connection(("127.0.0.1", server.site.port), timeout=30) as connection:
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
        said = b""
        while piece := connection.recv(65536):
            said += piece
        return said
