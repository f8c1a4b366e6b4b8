"""Files on a web server: read in part, and every way in which a server fails is an AccessError."""

from __future__ import annotations

import os
import ssl
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import AccessError
from mcz.container import http
from tests.commands import run
from tests.motions import smooth, write_bytes
from tests.web_server import Answering, Server, answer_range, serve


@pytest.fixture(scope="module")
def data() -> bytes:
    return write_bytes(smooth(2000), "raw")


@pytest.fixture
def server(data: bytes, retry_delays: list[float]) -> Iterator[Server]:
    found = Server(data)
    with serve(found):
        yield found


@pytest.fixture
def retry_delays(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds that a reader would have waited between attempts."""
    found: list[float] = []
    monkeypatch.setattr(http, "sleep", found.append)
    return found


@pytest.mark.parametrize("knows_ends", [True, False])
def test_a_part_is_read_in_few_requests(
    server: Server, knows_ends: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On one connection; servers that give no ranges at the end cost one more."""
    monkeypatch.setattr(http, "TAIL", 1000)
    server.knows_ends = knows_ends
    with mcz.open(server.address) as file:
        assert file.size == len(server.data)
        values = file.only_clip().read(frames=(10, 20))
        requests = len(server.asked)
    with mcz.open(server.data) as here:
        np.testing.assert_array_equal(values, here.only_clip().read(frames=(10, 20)))
    assert requests <= 5 + (not knows_ends)
    assert server.n_connections == 1 + (not knows_ends)  # an error closes it


def test_a_small_file_is_one_request(server: Server) -> None:
    with mcz.open(server.address) as file:
        file.only_clip().read()
        assert file.container.source.n_requests >= len(server.asked) == 1


def status(code: int) -> Answering:
    return lambda handler, *_: handler.send_error(code)


def whole(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    """A server that knows no ranges."""
    handler.send_response(200)
    handler.send_header("Content-Length", str(len(data)))
    handler.end_headers()
    handler.wfile.write(data)


def short(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    """The connection is cut."""
    answer_range(handler, data, start, stop, body=data[start : max(start, stop - 1)])


def answer_shifted(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    answer_range(handler, data, start, stop, said=f"bytes {start + 1}-{stop}/{len(data)}")


def nonsense(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    answer_range(handler, data, start, stop, said="bytes a-b/c")


def silent(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.close_connection = True


def no_http(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.wfile.write(b"\x00\x01 no http at all\r\n\r\n")
    handler.close_connection = True


def other_file(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    answer_range(handler, data, start, stop, tag='"2"')


def longer_file(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    answer_range(handler, data, start, stop, said=f"bytes {start}-{stop - 1}/{len(data) + 7}")


def endless(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
    handler.send_response(302)
    handler.send_header("Location", "/again")
    handler.send_header("Content-Length", "0")
    handler.end_headers()


FAILURES = {
    "the server answers 500": status(500),
    "the server answers 404": status(404),
    "the server answers 503": status(503),
    "the server answers 403": status(403),
    "the server ignores byte ranges .it answers 200.; download the file first": whole,
    "bytes were announced|IncompleteRead": short,
    "were requested, the server sent": answer_shifted,
    "does not state the range": nonsense,
    "closed connection|Connection|RemoteDisconnected": silent,
    "no http|BadStatusLine": no_http,
    "redirect": endless,
}
LATER = {"was replaced while it was read": other_file, "replaced while": longer_file}


@pytest.mark.parametrize(
    ("said", "after"),
    [(said, after) for said in (*FAILURES, *LATER) for after in range(said in LATER, 3)],
)
def test_each_failure_is_an_access_error(
    server: Server, said: str, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http, "TAIL", 1000)  # else the first request brings the whole file
    server.wrong, server.after = {**FAILURES, **LATER}[said], after
    with pytest.raises(AccessError, match=said) as raised:  # noqa: SIM117
        with mcz.open(server.address) as file:
            file.only_clip().read()
    assert str(raised.value).startswith(server.address)


def test_a_failure_is_one_line_of_a_command(
    server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    server.wrong = status(500)
    assert run("info", server.address) == 1
    errors = capsys.readouterr().err
    assert errors.startswith(f"mcz: {server.address}: the server answers 500") and "\n" in errors


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


# A file that changes -------------------------------------------------------------


def answer_with_tag(tag: str = "", **more: str) -> Answering:
    """A sound answer that says this of the file."""
    named = {name.replace("_", "-"): value for name, value in more.items()}
    return lambda handler, data, start, stop: answer_range(
        handler, data, start, stop, tag=tag, more=named
    )


OLD, NEW = "Mon, 23 Nov 2026 10:00:00 GMT", "Mon, 23 Nov 2026 10:00:01 GMT"
IDENTITIES = {
    "strong": (answer_with_tag('"a"'), answer_with_tag('"b"'), {"If-Match": '"a"'}),
    "weak": (answer_with_tag('W/"a"'), answer_with_tag('W/"b"'), {}),
    "tag-goes": (answer_with_tag('"a"'), answer_with_tag(), {"If-Match": '"a"'}),
    "date": (
        answer_with_tag(Last_Modified=OLD),
        answer_with_tag(Last_Modified=NEW),
        {"If-Unmodified-Since": OLD},
    ),
    "412": (
        answer_with_tag('"a"'),
        lambda handler, *_: handler.send_error(412),
        {"If-Match": '"a"'},
    ),
    "shorter": (answer_with_tag(), lambda handler, *_: handler.send_error(416), {}),
}


@pytest.mark.parametrize("name", IDENTITIES)
def test_a_change_between_requests_is_noticed(
    server: Server, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, after, conditions = IDENTITIES[name]
    monkeypatch.setattr(http, "TAIL", 1000)
    server.wrong = before
    with mcz.open(server.address) as file:
        clip = file.only_clip()
        clip.read((0, 10))
        server.wrong = after
        with pytest.raises(AccessError, match="was replaced while it was read"):
            clip.read((1500, 1510))
    sent = server.headers[-1]
    named = {"If-Match", "If-Unmodified-Since"}
    assert {key: sent[key] for key in sent if key in named} == conditions


# Tried again ---------------------------------------------------------------------


def fail_first(times: int, wrong: Answering) -> Answering:
    """So many answers are wrong, and all others sound."""
    left = [times]

    def answer(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
        left[0] -= 1
        (wrong if left[0] >= 0 else answer_range)(handler, data, start, stop)

    return answer


def busy(code: int, after: str = "") -> Answering:
    def answer(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
        handler.send_response(code)
        handler.send_header("Content-Length", "4")
        if after:
            handler.send_header("Retry-After", after)
        handler.end_headers()
        handler.wfile.write(b"busy")

    return answer


@pytest.mark.parametrize(
    "wrong",
    [busy(429), busy(502), busy(503), busy(504), short, silent],
    ids=["429", "502", "503", "504", "short", "silent"],
)
def test_what_may_pass_is_tried_three_times(
    server: Server, retry_delays: list[float], wrong: Answering
) -> None:
    server.wrong = fail_first(2, wrong)
    with mcz.open(server.address) as file:
        assert file.size == len(server.data)
    assert len(server.asked) == 3
    assert retry_delays == [0.5, 1.0]
    server.wrong = fail_first(3, wrong)
    with pytest.raises(AccessError, match="tried 3 times"):
        mcz.open(server.address)


@pytest.mark.parametrize("wrong", [status(500), status(404), whole, answer_shifted, nonsense])
def test_what_will_not_pass_is_tried_once(
    server: Server, retry_delays: list[float], wrong: Answering
) -> None:
    server.wrong = wrong
    with pytest.raises(AccessError) as raised:
        mcz.open(server.address)
    assert retry_delays == []
    assert "tried" not in str(raised.value)


def test_a_server_may_ask_to_wait(server: Server, retry_delays: list[float]) -> None:
    server.wrong = fail_first(1, busy(503, "7"))
    mcz.open(server.address).close()
    assert retry_delays == [7.0]
    server.wrong = busy(429, "3600")
    with pytest.raises(AccessError, match="429 .* and asks to wait 3600 s"):
        mcz.open(server.address)
    server.wrong = fail_first(1, busy(503, "Mon, 23 Nov 2020 10:00:00 GMT"))  # long past
    mcz.open(server.address).close()
    server.wrong = fail_first(1, busy(503, "soon"))
    mcz.open(server.address).close()
    assert retry_delays == [7.0, 0.5, 0.5]


def test_a_connection_that_was_closed_is_made_anew(
    server: Server, retry_delays: list[float]
) -> None:
    """A server closes what is idle: that is no failure."""

    def once(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
        answer_range(handler, data, start, stop)
        handler.close_connection = True  # unsaid

    server.wrong = once
    stream = http.HttpFile(server.address)
    stream._tail = b""
    assert stream.read_at(0, 8) == server.data[:8]
    assert stream.read_at(8, 8) == server.data[8:16]
    assert (server.n_connections, retry_delays) == (3, [])
    stream.close()


# Redirects, proxies, threads, processes ------------------------------------------


def redirect_to(to: str, code: int = 302) -> Answering:
    def answer(handler: BaseHTTPRequestHandler, data: bytes, start: int, stop: int) -> None:
        if handler.path == "/a.mcz":
            handler.send_response(code)
            handler.send_header("Location", to)
            handler.send_header("Content-Length", "0")
            handler.end_headers()
        else:
            answer_range(handler, data, start, stop)

    return answer


@pytest.mark.parametrize("code", [301, 302, 303, 307, 308])
def test_later_requests_go_where_the_first_was_led(server: Server, code: int) -> None:
    server.wrong = redirect_to("b%20b.mcz?key=1", code)
    stream = http.HttpFile(server.address)
    stream._tail = b""
    assert stream.read_at(4, 4) == server.data[4:8]
    assert server.paths == ["/a.mcz", "/b%20b.mcz?key=1", "/b%20b.mcz?key=1"]
    server.wrong = lambda handler, *rest: (  # that address has expired
        redirect_to("/c.mcz")(handler, *rest) if "key" not in handler.path else status(403)(handler)
    )
    assert stream.read_at(4, 4) == server.data[4:8]
    assert server.paths[3:] == ["/b%20b.mcz?key=1", "/a.mcz", "/c.mcz"]
    stream.close()


@pytest.mark.parametrize("to", ["ftp://127.0.0.1/a", "https://127.0.0.1:x/", "http://"])
def test_bad_redirects_are_refused(server: Server, to: str) -> None:
    server.wrong = redirect_to(to)
    with pytest.raises(AccessError):
        mcz.open(server.address)


@pytest.mark.parametrize("address", ["http://", "https://a:b/c", "http://me:secret@127.0.0.1/a"])
def test_bad_addresses_are_refused(address: str) -> None:
    with pytest.raises(AccessError):
        mcz.open(address)


def test_proxies_of_the_system_are_used(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    proxy = server.address.removesuffix("/a.mcz").replace("://", "://me:se%20cret@")
    monkeypatch.setenv("http_proxy", proxy)
    monkeypatch.setenv("no_proxy", "localhost")
    with mcz.open("http://example.invalid/a b.mcz") as file:
        assert file.size == len(server.data)
    assert server.paths == ["http://example.invalid/a%20b.mcz"]
    assert server.headers[0]["Proxy-Authorization"] == "Basic bWU6c2UgY3JldA=="
    assert server.headers[0]["Host"] == "example.invalid"


def test_threads_share_a_file(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http, "TAIL", 1000)
    with mcz.open(server.address) as file, ThreadPoolExecutor(4) as pool:
        clip = file.only_clip()
        spans = [(at, at + 20) for at in range(0, 2000, 100)]
        found = list(pool.map(clip.read, spans))
        whole = clip.read()
    for (first, stop), values in zip(spans, found, strict=True):
        np.testing.assert_array_equal(values, whole[first:stop])
    assert server.n_connections <= 4 + 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no such processes here")
def test_a_fork_has_connections_of_its_own(server: Server) -> None:
    stream = http.HttpFile(server.address)
    stream._tail = b""
    stream.read_at(0, 4)
    before = server.n_connections
    pid = os.fork()
    if not pid:
        os._exit(stream.read_at(0, 8) != server.data[:8])
    assert os.waitpid(pid, 0)[1] == 0
    assert stream.read_at(0, 4) == server.data[:4]
    assert server.n_connections == before + 1
    stream.close()


# https ---------------------------------------------------------------------------

CERTIFICATE = Path(__file__).parent / "https" / "server.pem"


@pytest.fixture
def secure(data: bytes, retry_delays: list[float]) -> Iterator[Server]:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(CERTIFICATE)
    found = Server(data)
    with serve(found, context):
        yield found


def test_https(secure: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """With what the package installs, and one handshake."""
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    monkeypatch.setattr(http, "TAIL", 1000)
    with mcz.open(secure.address) as file:
        assert file.only_clip().read((0, 10)).shape[0] == 10
    assert len(secure.asked) > 1
    assert secure.n_connections == 1


def test_a_certificate_that_nobody_vouches_for(secure: Server, retry_delays: list[float]) -> None:
    with pytest.raises(AccessError, match="the certificate of 127.0.0.1 is not accepted: self"):
        mcz.open(secure.address)
    assert retry_delays == []
    assert secure.asked == []


def test_https_does_not_lead_to_http(
    secure: Server, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(CERTIFICATE))
    secure.wrong = redirect_to(server.address)
    with pytest.raises(AccessError, match="redirects from https to http"):
        mcz.open(secure.address)
    server.wrong = redirect_to(secure.address.replace("a.mcz", "b.mcz"))
    with mcz.open(server.address) as file:
        assert file.size == len(server.data)
    assert secure.paths[-1] == "/b.mcz"
