"""``mcz stream``: over real pipes and sockets, frame by frame."""

from __future__ import annotations

import io
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import live_frames
from mcz.cli import tcp
from mcz.cli.standard_input import Rows
from tests.commands import Started, run_piped
from tests.commands import run as run_command

NAMES = b"a,b\n"
ROWS = np.arange(60).reshape(10, 6) / 4
CODER = ("--codec", "lsdt-frame", "--param", "step=0.01", "--param", "segment_frames=4")


def line(row: np.ndarray) -> bytes:
    return ",".join("" if np.isnan(v) else repr(float(v)) for v in row).encode() + b"\n"


CSV = NAMES + b"".join(map(line, ROWS))


def run(*arguments: object, data: bytes = b"") -> tuple[int, bytes, str]:
    """``mcz stream`` with these arguments and standard input, in this process."""
    return run_piped("stream", *arguments, data=data)


def encode_stream(*arguments: str | Path, data: bytes = CSV) -> bytes:
    code, out, errors = run("encode", *CODER, *arguments, data=data)
    assert (code, errors) == (0, "")
    return out


# Pipes -------------------------------------------------------------------------


def test_each_frame_is_out_before_the_next_row_is_read() -> None:
    with Started("stream", "encode", *CODER) as started:
        started.say(NAMES)
        found = live_frames(started.stdout)
        for number, row in enumerate(ROWS):
            started.say(line(row)[:3])
            started.say(line(row)[3:])
            frame, values, _ = next(found)  # waits for ever if it were held back
            assert frame == number
            np.testing.assert_allclose(values, row, atol=0.02)
        started.stdin.close()
        assert list(found) == []
        assert started.process.wait() == 0


def test_each_row_is_printed_before_the_next_frame_is_read() -> None:
    parts = list(mcz.stream_encode(ROWS, ["a", "b"], codec="lsdt-frame", params={"step": 0.01}))
    with Started("stream", "decode") as started:
        started.say(parts[0])
        started.say(parts[1])
        assert started.stdout.readline() == b"frame,a.tx,a.ty,a.tz,b.tx,b.ty,b.tz\n"
        for number, part in enumerate(parts[2:-1]):
            assert started.stdout.readline().startswith(b"%d," % number)
            started.say(part)
        assert started.stdout.readline().startswith(b"9,")
        started.say(parts[-1])
        assert started.end() == 0
        errors = started.stderr.read().decode()
    assert "10 frames decoded, 0 concealed, 0 missing" in errors


def test_a_binary_stream_there_and_back() -> None:
    rows = ROWS.copy()
    rows[3, 1] = np.nan
    data = NAMES + rows.astype("<f4").tobytes()
    coded = encode_stream("--float32", data=data)
    code, out, _ = run("decode", "--float32", data=coded)
    assert code == 0
    names, _, values = out.partition(b"\n")
    assert names == b"a.tx,a.ty,a.tz,b.tx,b.ty,b.tz"
    found = np.frombuffer(values, "<f4").reshape(10, 6)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(rows))
    np.testing.assert_allclose(found, rows, atol=0.02)
    again = encode_stream("--float32", data=out)
    assert len(list(live_frames(io.BytesIO(again)))) == 10
    code, _, errors = run("encode", *CODER, "--float32", data=data[:-5])
    assert code == 1
    assert "row 9 ends after 19 of 24 bytes" in errors


def test_what_is_printed_can_be_read_again(tmp_path: Path) -> None:
    rows = ROWS.copy()
    rows[3, 1] = np.nan
    path = tmp_path / "a.mcz"
    path.write_bytes(encode_stream(data=NAMES + b"".join(map(line, rows))))
    plain = list(live_frames(io.BytesIO(path.read_bytes())))
    stored = tmp_path / "a.csv"
    assert run_command("decode", path, "--to", "csv", "-o", stored) == 0
    for printed in (
        run("decode", path)[1],
        run("decode", "--states", path)[1],
        stored.read_bytes(),
    ):
        found = list(live_frames(io.BytesIO(encode_stream(data=printed))))
        assert len(found) == 10
        for (_, values, valid), (_, wanted, known) in zip(found, plain, strict=True):
            np.testing.assert_array_equal(valid, known)
            np.testing.assert_allclose(values, wanted, atol=0.02)


def test_rows_of_the_channels_of_a_skeleton(tmp_path: Path) -> None:
    bvh = tmp_path / "a.bvh"
    bvh.write_text(
        "HIERARCHY\nROOT hips\n{\nOFFSET 1 2 3\nCHANNELS 3 Xposition Yposition Zposition\n"
        "JOINT arm\n{\nOFFSET 0 4 0\nCHANNELS 1 Zrotation\nEnd Site\n{\nOFFSET 0 2 0\n}\n}\n}\n"
        "MOTION\nFrames: 1\nFrame Time: .01\n1 2 3 4\n"
    )
    data = b"1,2,3,10\n1,2,3,20\n"
    coded = encode_stream("--skeleton", bvh, "--param", "domain=channels", data=data)
    found = [values for _, values, _ in live_frames(io.BytesIO(coded))]
    np.testing.assert_allclose(found, [[1, 2, 3, 10], [1, 2, 3, 20]], atol=0.02)
    places = encode_stream("--skeleton", bvh, data=data)
    assert next(live_frames(io.BytesIO(places)))[1].shape == (9,)
    (tmp_path / "a.mcz").write_bytes(coded)
    again = encode_stream("--skeleton", tmp_path / "a.mcz", data=data)
    assert next(live_frames(io.BytesIO(again)))[1].shape == (9,)
    code, _, errors = run("encode", *CODER, "--skeleton", tmp_path / "no.bvh", data=data)
    assert (code, "no such file" in errors) == (1, True)
    code, _, errors = run("encode", *CODER, "--skeleton", __file__, data=data)
    assert (code, "give the skeleton as" in errors) == (2, True)


def test_parameters_change_by_a_line(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    changed = NAMES + line(ROWS[0]) + b"# a comment\n# set step=0.5 gof=3\n" + line(ROWS[1]) * 9
    online = ("--param", "step=0.01", "--param", "gof=2", "--param", "intra_period=2")
    code, out, errors = run("encode", *online, "-o", path, data=changed)
    assert (code, errors) == (0, "")
    assert out.decode().startswith(f"{path}: 10 frames of 6 channels, live; ")
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        quality = file.clips["live"].quality
    assert quality is not None
    assert "param.step" not in quality
    changed = changed.replace(b" gof=3", b"")
    code, _, errors = run("encode", *CODER, "-o", path, "--force", data=changed)
    assert (code, "cannot change" in errors) == (2, True)
    strict = run("decode", path)
    assert (strict[0], strict[1].count(b"\n")) == (4, 2)  # what came before that line, and no end
    bad = NAMES + b"# set step\n"
    assert "not '# set name=value" in run("encode", *CODER, data=bad)[2]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "its first line must be names"),
        (b"\n1\n", "need"),
        (b"a\xff,b\n", "not a line of names"),
        (NAMES + b"1,2\n", "line 2: 2 values, but a row of 2 markers has 6: x, y and z of each"),
        (b"a.x,a.y,a.z\n1;2;3\n", "line 2: 1 value, not 3, separated by commas"),
        (NAMES + line(ROWS[0]) + b"1,2,3,4,5,x\n", "line 3: 'x' is not a number"),
        (NAMES + b"1,2,3,4,5,1_000\n", "line 2: '1_000' is not a number"),
        (b"a.x,a.z,a.y\n", "... must name x, y and z of each marker in turn"),
    ],
)
def test_bad_rows(data: bytes, message: str) -> None:
    code, _, errors = run("encode", *CODER, data=data)
    assert code in (1, 2)
    assert errors.startswith("mcz: standard input: ")
    assert message in errors
    assert "Traceback" not in errors


def test_a_mark_of_byte_order_is_no_part_of_a_name(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    data = b"\xef\xbb\xbf" + NAMES + line(ROWS[0])
    assert run("encode", *CODER, "-o", path, data=data)[0] == 0
    with mcz.open(path) as file:
        names = [joint.name for joint in file.clips["live"].skeleton.joints]
    assert names == ["a", "b"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("encode", "-o", "x.mcz", "--listen", ":0"),
        ("encode", "--clients", "1"),
        ("encode", "--listen", "nowhere"),
        ("encode", "--codec", "raw"),
        ("encode", "--codec", "what"),
        ("decode", "--connect", "localhost:1", "x.mcz"),
        ("decode", "--states", "--float32"),
        ("decode", "--rate", "120"),
        ("decode", "--connect", "what"),
        ("decode", "--lost", "what"),
        ("what",),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    code, out, errors = run(*arguments, data=CSV)
    assert (code, out) == (2, b"")
    assert errors.startswith("mcz: ")
    assert "Traceback" not in errors


def test_files_that_are_there_stay(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    path.write_bytes(b"dear")
    assert run("encode", *CODER, "-o", path, data=CSV)[0] == 2
    assert run("encode", "--codec", "raw", "-o", path, "--force", data=CSV)[0] == 2
    assert path.read_bytes() == b"dear"
    assert run("encode", *CODER, "-o", path, "--force", data=CSV)[0] == 0
    assert mcz.verify(path) == []
    assert run("decode", tmp_path / "no.mcz")[0] == 1
    code, out, _ = run("decode", path)
    assert (code, out.count(b"\n")) == (0, 11)


def test_an_interrupt_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    with Started("stream", "encode", *CODER, "-o", path) as started:
        started.say(CSV)
        while not path.exists() or b"DATA" not in path.read_bytes():  # a frame is there
            time.sleep(0.01)
        started.process.send_signal(signal.SIGINT)
        assert started.process.wait() == 130
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        assert 1 <= file.clips["live"].n_frames <= 10


def test_what_a_crash_leaves(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    with Started("stream", "encode", *CODER, "-o", path) as started:
        started.say(CSV)
        while not path.exists() or b"DATA" not in path.read_bytes():  # a frame is there
            time.sleep(0.01)
        started.process.kill()
        started.process.wait()
    code, out, errors = run("decode", "--lost", "hold", "--states", path)
    assert code == 4
    assert "cut off" in errors
    assert all(row.endswith(b",decoded") for row in out.splitlines()[1:])
    strict = run("decode", path)
    assert strict[0] == 4
    assert strict[1].count(b"\n") == out.count(b"\n")
    assert f"mcz: {path}: " in strict[2]


def test_a_reader_that_has_seen_enough() -> None:
    with Started("stream", "decode") as started:
        started.stdout.close()
        started.stdin.write(encode_stream())
        started.end()
        assert started.stderr.read() == b""


def test_lost_frames_are_marked(tmp_path: Path) -> None:
    sent = list(
        mcz.stream_encode(
            ROWS, ["a", "b"], codec="lsdt-frame", params={"step": 0.01, "segment_frames": 4}
        )
    )
    data = b"".join([*sent[:3], *sent[4:]])  # frame 2, and so 3, is lost
    assert run("decode", data=data)[0] == 1
    code, out, errors = run("decode", "--lost", "linear", "--states", data=data)
    assert code == 4
    assert "8 frames decoded, 2 concealed, 0 missing" in errors
    states = [row.rpartition(b",")[2].decode() for row in out.splitlines()]
    assert states == ["state", *["decoded"] * 2, *["concealed"] * 2, *["decoded"] * 6]
    code, out, _ = run("decode", "--lost", "missing", data=data)
    assert out.splitlines()[3] == b"2,,,,,,"
    code, out, errors = run("decode", "--join", "--lost", "hold", data=data[20:])
    assert (code, out.splitlines()[1][:2]) == (0, b"4,")
    assert "hash not checked" in errors


def test_filtered_rows_come_late() -> None:
    rows = np.repeat(ROWS, 4, axis=0)
    sent = list(
        mcz.stream_encode(rows, ["a", "b"], codec="lsdt-frame", params={"step": 0.01}, unit="cm")
    )
    with Started("stream", "decode", "--post-filter", "--rate", "120") as started:
        started.say(b"".join(sent[:14]))  # 13 frames
        started.stdout.readline()
        assert started.stdout.readline().startswith(b"0,")
        started.say(sent[14])
        assert started.stdout.readline().startswith(b"1,")
        started.say(b"".join(sent[15:]))
        assert len(started.stdout.read1(10**6)) > 0
        assert started.end() == 0


# TCP ---------------------------------------------------------------------------


def frames_from(stream: object) -> Iterator[mcz.LiveFrame]:
    return iter(mcz.stream_decode(stream, join=True))


def test_clients_early_and_late() -> None:
    with Started(
        "stream", "encode", *CODER, "--listen", "127.0.0.1:0", "--clients", "1"
    ) as started:
        started.stdin.write(NAMES)
        started.stdin.flush()
        host, port = tcp.address_of(started.address())
        with (
            socket.create_connection((host, port)) as early,
            early.makefile("rb") as ahead,
        ):
            first = frames_from(ahead)
            for number in range(2):
                started.say(line(ROWS[number]))
                assert next(first).number == number
            with socket.create_connection((host, port)) as late, late.makefile("rb") as stream:
                while not stream.peek():
                    pass  # what precedes the frames comes at once
                second = frames_from(stream)
                for number in range(2, 6):
                    started.say(line(ROWS[number]))
                    assert next(first).number == number
                found = [next(second), next(second)]
                assert [frame.number for frame in found] == [4, 5]  # a fresh one every 4 frames
                for number in range(6, 10):
                    started.say(line(ROWS[number]))
                started.stdin.close()
                rest = list(first), list(second)
        assert [[frame.number for frame in part] for part in rest] == [[6, 7, 8, 9]] * 2
        for a, b in zip(*rest, strict=True):
            np.testing.assert_array_equal(a.values, b.values)
        assert started.process.wait() == 0


def test_an_interrupt_ends_a_connection_well() -> None:
    with Started("stream", "encode", *CODER, "--listen", ":0", "--clients", "1") as started:
        started.say(NAMES)
        with (
            socket.create_connection(tcp.address_of(started.address())) as client,
            client.makefile("rb") as stream,
        ):
            started.say(line(ROWS[0]))
            reader = mcz.stream_decode(stream, join=True)
            next(reader)
            started.process.send_signal(signal.SIGINT)
            assert list(reader) == []
            assert not reader.summary.is_cut
        assert started.process.wait() == 130


def test_nobody_holds_the_others_up(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(tcp, "MOST_WAITING", 200_000)
    listener = tcp.Listener("127.0.0.1:0")
    where = tcp.address_of(listener.address)
    got = bytearray()
    with socket.create_connection(where), socket.create_connection(where) as quick:
        listener.wait_for(2)
        listener.write(b"opening")
        while len(got) < len(b"opening"):
            got += quick.recv(100)
        for _ in range(300):
            listener.write(bytes(50_000))
            left = 50_000
            while left:
                data = quick.recv(left)
                assert data
                left -= len(data)
        listener.close()
        assert quick.recv(10) == b""
    assert "behind, and was disconnected" in capsys.readouterr().err
    with pytest.raises(OSError):
        socket.create_connection(where)


def test_clients_that_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    listener = tcp.Listener(":0")
    with socket.create_connection(tcp.address_of(listener.address)):
        listener.wait_for(1)
        listener.write(b"opening")
    for _ in range(50):
        listener.write(b"frame")
        time.sleep(0.01)
    listener.close()
    assert listener._clients == []


def test_nobody_is_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    code, out, errors = run("decode", "--connect", f"127.0.0.1:{port}")
    assert (code, out) == (1, b"")
    assert f"127.0.0.1:{port}" in errors
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        code, _, errors = run("encode", *CODER, "--listen", f"127.0.0.1:{port}", data=CSV)
        assert (code, "Traceback" in errors) == (1, False)


@pytest.mark.parametrize(
    ("binary", "last"),
    [
        (False, b"7,8,9,10,11,12"),  # whole as it seems, but its last number may be longer
        (False, b"7,8,9"),
        (False, b"7,8,9,10,11,x\n"),
        (True, bytes(23)),
    ],
)
def test_a_source_that_dies_in_a_row_aborts_the_stream(binary: bool, last: bytes) -> None:
    rows = ROWS.astype("<f4").tobytes() if binary else b"".join(map(line, ROWS))
    words = ("encode", *CODER, *(["--float32"] if binary else []))
    code, out, errors = run(*words, data=NAMES + rows + last)
    assert (code, "aborted after 10 frames" in errors) == (1, True)
    code, out, errors = run("decode", data=out)
    assert (code, out.count(b"\n"), "cut off" in errors) == (4, 11, True)


def test_a_sender_that_is_killed_is_an_aborted_end() -> None:
    with Started("stream", "encode", *CODER, "--listen", ":0", "--clients", "1") as sender:
        sender.say(NAMES)
        with Started("stream", "decode", "--connect", sender.address()) as receiver:
            sender.say(b"".join(map(line, ROWS)))
            for _ in range(11):
                receiver.stdout.readline()
            sender.process.kill()
            assert receiver.process.wait() == 4
            assert "cut off" in receiver.stderr.read().decode()


@pytest.mark.parametrize(("size", "code"), [(None, 4), (40, 4), (0, 1)])
def test_a_silent_peer_is_not_waited_for_for_ever(size: int | None, code: int) -> None:
    data = encode_stream()

    def speak() -> None:
        peers.append(server.accept()[0])
        peers[0].sendall(data[: len(data) // 2 if size is None else size])

    peers: list[socket.socket] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=speak)
        thread.start()
        words = ("--connect", f"127.0.0.1:{server.getsockname()[1]}", "--timeout", "0.5")
        found, _, errors = run("decode", *words)
        thread.join()
        peers[0].close()
    assert (found, "nothing came for 0.5 s" in errors) == (code, True)


def test_a_silent_pipe_is_not_waited_for_for_ever() -> None:
    data = encode_stream()
    for sent, code in ((data[: len(data) // 2], 4), (data, 0)):  # all is there: it stays open
        with Started("stream", "decode", "--timeout", "3") as receiver:
            receiver.say(sent)
            assert receiver.process.wait() == code


def test_heartbeats_keep_listeners_while_the_source_is_silent() -> None:
    sending = ("stream", "encode", *CODER, "--listen", ":0", "--clients", "2", "--heartbeat", "0.1")
    with Started(*sending) as sender:
        sender.say(NAMES)
        address = sender.address()
        receiving = ("stream", "decode", "--connect", address, "--timeout", "2", "--states")
        with Started(*receiving) as first:
            time.sleep(3)  # the other client is waited for
            with Started(*receiving) as second:
                sender.say(line(ROWS[0]))
                for receiver in (first, second):
                    assert receiver.stdout.readline().startswith(b"frame")
                    receiver.stdout.readline()
                time.sleep(3)
                sender.say(line(ROWS[1]))
                assert sender.end() == 0
                for receiver in (first, second):
                    assert receiver.process.wait() == 0
                    assert receiver.stdout.read().startswith(b"1,")


def test_a_heartbeat_is_no_place_to_join() -> None:
    """Late receivers get heartbeats, and frames from the next join point."""
    sending = ("stream", "encode", *CODER, "--listen", ":0", "--clients", "1", "--heartbeat", "0.1")
    with Started(*sending) as sender:
        address = tcp.address_of(sender.address())
        sender.say(NAMES)
        with socket.create_connection(address) as early, early.makefile("rb") as ahead:
            first = frames_from(ahead)
            for number in range(2):
                sender.say(line(ROWS[number]))
                assert next(first).number == number
            with socket.create_connection(address) as late, late.makefile("rb") as stream:
                data = stream.read1(2000)
                while len(data) < 2000:  # heartbeats come
                    data += stream.read1(2000)
                sender.say(b"".join(map(line, ROWS[2:])))
                sender.stdin.close()
                data += stream.read()
            assert [frame.number for frame in first] == list(range(2, 10))
        reader = mcz.stream_decode(data, join=True)
        assert [frame.number for frame in reader] == list(range(4, 10))
        assert not reader.summary.is_cut
        assert sender.process.wait() == 0


def test_what_the_wire_takes_is_said(tmp_path: Path) -> None:
    walk = np.cumsum(np.random.default_rng(0).normal(0, 2, (240, 6)), axis=0)
    data = NAMES + b"".join(map(line, walk))
    asked = ("--rate", "30", "--param", "bitrate=4")
    code, out, errors = run("encode", *asked, data=data)
    assert code == 0
    sent = len(out) / 125 / 8
    assert f"240 frames, {len(out):,} bytes; {sent:.2f} kbit/s (4 asked): " in errors
    path = tmp_path / "a.mcz"
    code, said, errors = run("encode", *asked, "-o", path, data=data)
    assert (code, errors) == (0, "")
    assert f"live; {len(out):,} bytes; {sent:.2f} kbit/s (4 asked): " in said.decode()
    _, _, errors = run("decode", data=out)
    assert f"{sent:.2f} kbit/s received, " in errors
    code, _, errors = run("encode", "--rate", "240", "--param", "bitrate=4", data=data * 1)
    assert (code, "4 kbit/s cannot be kept: packets, " in errors) == (0, True)


# Rows, without a process -----------------------------------------------------------


def test_columns_that_are_not_values() -> None:
    def names(text: bytes) -> list[str] | None:
        return Rows(io.BytesIO(text), binary=False).names

    assert names(b"frame,a.tx,a.ty,a.tz,state\n") == ["a.tx", "a.ty", "a.tz"]
    assert names(b"frame,time,a.tx,a.ty,a.tz\n") == ["a.tx", "a.ty", "a.tz"]
    assert names(b"frame,state\n") == ["frame", "state"]
    assert names(b'"a,b",c\r\n') == ["a,b", "c"]
    rows = Rows(io.BytesIO(b"frame,a.x,a.y,a.z\n7,1,,nan\n\n# what\n8,1,2,3\n"), binary=False)
    rows.expect(3)
    np.testing.assert_array_equal(list(rows), [[1, np.nan, np.nan], [1, 2, 3]])
