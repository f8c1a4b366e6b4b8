"""Access to a stream over TCP: tokens, and the messages about them."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from mcz.cli import tcp
from mcz.cli.common import Failure
from tests.commands import run

TOKEN = "s3cret-of-the-stage"


@contextmanager
def listen(token: str | None = TOKEN) -> Iterator[tcp.Listener]:
    listener = tcp.Listener("127.0.0.1:0", token)
    listener.write(b"opening")
    yield listener
    listener.close()


def test_who_knows_the_token_gets_the_stream() -> None:
    with listen() as listener, tcp.connect(listener.address, TOKEN) as stream:
        assert stream.read(7) == b"opening"
        listener.wait_for(1)
        listener.entry = lambda: 0
        listener.write(b"frame")
        assert stream.read(5) == b"frame"


@pytest.mark.parametrize(
    "sent", [b"", b"\n", TOKEN.encode()[:-1] + b"\n", TOKEN.encode() + b"x\n", b"x" * 10_000]
)
def test_who_does_not_gets_nothing(sent: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    with listen() as listener:
        where = tcp.address_of(listener.address)
        with socket.create_connection(where) as connection:
            connection.sendall(sent)
            if not sent:
                connection.shutdown(socket.SHUT_WR)
            with suppress(ConnectionResetError):  # what it sent was not read to its end
                assert connection.recv(100) == b""
        assert listener._clients == []
    assert "did not send the token, and was disconnected" in capsys.readouterr().err


def test_a_silent_client_keeps_nobody_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "PATIENCE", 0.2)
    with (
        listen() as listener,
        socket.create_connection(tcp.address_of(listener.address)) as silent,
        tcp.connect(listener.address, TOKEN) as stream,
    ):
        assert stream.read(7) == b"opening"
        assert silent.recv(10) == b""


@pytest.mark.parametrize(
    ("given", "hint"), [("wrong", "is the --token right?"), (None, "it may ask for a --token")]
)
def test_a_client_is_told(given: str | None, hint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "PATIENCE", 0.2)
    with listen() as listener, pytest.raises(Failure) as raised:  # noqa: SIM117
        with tcp.connect(listener.address, given):
            pass
    assert hint in str(raised.value)


def test_a_token_to_one_who_asks_for_none() -> None:
    with listen(None) as listener, tcp.connect(listener.address, TOKEN) as stream:
        assert stream.read(7) == b"opening"


@pytest.mark.parametrize("token", ["", "two words", "x" * 201, "ä", "a\nb"])
def test_what_is_no_token(token: str) -> None:
    with pytest.raises(Failure, match="a token must have 1 to 200"):
        tcp.line_of(token)


@pytest.mark.parametrize(
    ("host", "here"),
    [
        *(("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("0.0.0.0", False)),
        *(("::", False), ("192.168.1.7", False), ("fe80::1%eth0", False)),
    ],
)
def test_which_addresses_are_of_this_machine(host: str, here: bool) -> None:
    assert tcp.is_local(host) is here


@pytest.mark.parametrize(
    ("where", "token", "said"),
    [
        ("127.0.0.1:0", [], None),
        ("0.0.0.0:0", [], "everyone who reaches the port can read the stream"),
        ("0.0.0.0:0", ["--token", TOKEN], "everyone who has the token and reaches the port can"),
    ],
)
def test_what_is_open_to_others_is_said(
    where: str, token: list[str], said: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    from tests.cli.test_stream import CODER

    run("stream", "encode", *CODER, "--listen", where, *token)
    error = capsys.readouterr().err
    assert "listening on" in error
    assert (said in error) if said else ("everyone" not in error)
    assert TOKEN not in error
