"""Files on a web server: read in part, and every way in which a server fails is an AccessError."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import numpy as np
import pytest

import mcz
from mcz.cli.common import run
from mcz.cli.main import cli
from mcz.errors import AccessError
from tests.motions import smooth


@dataclass
class Server:
    """Gives ``data`` in ranges; ``wrong`` answers in its place from request ``after`` on."""

    data: bytes
    address: str = ""
    wrong: Callable[[BaseHTTPRequestHandler, bytes, int, int], None] | None = None
    after: int = 0
    asked: list[str] = field(default_factory=list)

    def answer(self, handler: BaseHTTPRequestHandler) -> None:
        self.asked.append(handler.headers.get("Range", ""))
        first, _, last = self.asked[-1].removeprefix("bytes=").partition("-")
        start, stop = int(first), min(int(last) + 1, len(self.data))
        if self.wrong is not None and len(self.asked) > self.after:
            self.wrong(handler, self.data, start, stop)
        else:
            ranged(handler, self.data, start, stop)


def ranged(
    handler: BaseHTTPRequestHandler,
    data: bytes,
    start: int,
    stop: int,
    said: str = "",
    body: bytes | None = None,
    tag: str = "1",
) -> None:
    part = data[start:stop] if body is None else body
    handler.send_response(206)
    handler.send_header("Content-Range", said or f"bytes {start}-{stop - 1}/{len(data)}")
    handler.send_header("Content-Length", str(stop - start))
    handler.send_header("ETag", tag)
    handler.end_headers()
    handler.wfile.write(part)


@pytest.fixture
def server() -> Iterator[Server]:
    import io

    out = io.BytesIO()
    mcz.write(smooth(2000), out, "raw")
    found = Server(out.getvalue())

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found.answer(self)

        def log_message(self, format: str, *args: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        found.address = f"http://127.0.0.1:{listening.server_address[1]}/a.mcz"
        thread = Thread(target=listening.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield found
        listening.shutdown()
        thread.join()


def test_a_part_is_read_in_few_requests(server: Server) -> None:
    with mcz.open(server.address) as file:
        assert file.size == len(server.data)
        values = file.only_clip().read(frames=(10, 20))
        requests = len(server.asked)
    with mcz.open(server.data) as here:
        np.testing.assert_array_equal(values, here.only_clip().read(frames=(10, 20)))
    assert requests <= 6


def status(code: int) -> Callable[[BaseHTTPRequestHandler, bytes, int, int], None]:
    return lambda handler, *_: handler.send_error(code)


def whole(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    """A server that knows no ranges."""
    handler.send_response(200)
    handler.send_header("Content-Length", str(len(data)))
    handler.end_headers()
    handler.wfile.write(data)


def short(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    """The connection is cut."""
    ranged(handler, data, start, stop, body=data[start : max(start, stop - 1)])


def moved(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    ranged(handler, data, start, stop, said=f"bytes {start + 1}-{stop}/{len(data)}")


def nonsense(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    ranged(handler, data, start, stop, said="bytes a-b/c")


def silent(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.close_connection = True


def no_http(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.wfile.write(b"\x00\x01 no http at all\r\n\r\n")


def other_file(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    ranged(handler, data, start, stop, tag="2")


def longer_file(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    ranged(handler, data, start, stop, said=f"bytes {start}-{stop - 1}/{len(data) + 7}")


def endless(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.send_response(302)
    handler.send_header("Location", "/again")
    handler.end_headers()


FAILURES = {
    "the server answers 500": status(500),
    "the server answers 404": status(404),
    "the server answers 503": status(503),
    "the server answers 403": status(403),
    "so it gives no parts; download the file first": whole,
    "bytes are announced|IncompleteRead": short,
    "are asked for, it gives": moved,
    "does not say which range": nonsense,
    "closed connection|Connection|RemoteDisconnected": silent,
    "no http|BadStatusLine": no_http,
    "redirect": endless,
}
LATER = {"was replaced while it was read": other_file, "replaced while": longer_file}


@pytest.mark.parametrize(
    ("said", "after"),
    [(said, after) for said in (*FAILURES, *LATER) for after in range(said in LATER, 3)],
)
def test_each_failure_is_an_access_error(server: Server, said: str, after: int) -> None:
    server.wrong, server.after = {**FAILURES, **LATER}[said], after
    with pytest.raises(AccessError, match=said) as found:  # noqa: SIM117
        with mcz.open(server.address) as file:
            file.only_clip().read()
    assert str(found.value).startswith(server.address)


def test_a_failure_is_one_line_of_a_command(
    server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    server.wrong = status(500)
    assert run(cli, "mcz", ["info", server.address]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"mcz: {server.address}: the server answers 500") and "\n" in said


def test_an_empty_file_is_no_mcz_file(server: Server) -> None:
    def empty(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
        handler.send_response(416)
        handler.send_header("Content-Range", "bytes */0")
        handler.send_header("Content-Length", "0")
        handler.end_headers()

    server.wrong = empty
    with pytest.raises(mcz.FormatError):
        mcz.open(server.address)


def test_nobody_listens() -> None:
    with pytest.raises(AccessError, match="127.0.0.1:9/a.mcz: .*refused"):
        mcz.open("http://127.0.0.1:9/a.mcz")


@pytest.mark.parametrize("when", ["open", "read"])
def test_errors_of_any_file_system_are_access_errors(
    when: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each that fsspec knows has errors of its own."""
    import fsspec

    class Odd(Exception):
        pass

    memory = fsspec.filesystem("memory")
    memory.pipe("/odd.mcz", b"x" * 1000)

    def fails(*arguments: object, **named: object) -> bytes:
        raise Odd("token expired")

    of = type(memory.open("/odd.mcz"))
    monkeypatch.setattr(*((type(memory), "_open") if when == "open" else (of, "read")), fails)
    with pytest.raises(AccessError, match=r"memory://odd.mcz: token expired"):
        mcz.open("memory://odd.mcz")
