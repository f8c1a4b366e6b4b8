"""The server of the page: who is answered, with which bytes, and what hostile requests get."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import AccessError, FormatError, OptionError
from mcz.model.extras import annex_bytes
from mcz.show.viewing import file_registry as registry_module
from mcz.show.viewing.file_registry import FileRegistry, add_path
from mcz.show.viewing.page import Page, page
from mcz.show.viewing.requests import Refused, range_of
from mcz.show.viewing.server import Server
from tests.motions import smooth
from tests.viewing.asking import Answer, ask, ask_anywhere, convert, form, post, raw, serve_files


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """walk.mcz, in which no unit is said, and broken.bvh."""
    folder = tmp_path_factory.mktemp("served")
    mcz.encode(samples / "walk.bvh", folder / "walk.mcz")
    (folder / "broken.bvh").write_bytes((samples / "walk.bvh").read_bytes()[:300])
    return folder


@pytest.fixture(scope="module")
def server(samples: Path, folder: Path) -> Iterator[Server]:
    paths = folder / "walk.mcz", samples / "walk.amc", folder / "broken.bvh"
    with serve_files(*paths, unit="cm") as server:
        yield server


# What is there to get ------------------------------------------------------------


def test_the_page_comes_with_its_policy(server: Server) -> None:
    answer = ask(server, "")
    assert answer.status == 200
    assert answer.body.decode() == page().text
    policy = answer.headers["Content-Security-Policy"]
    assert policy == f"{page().policy}; frame-ancestors 'none'"
    assert "script-src 'sha256-AAAA='" in policy


@pytest.mark.parametrize("path", ["", "api.json", "files/0", "annex/words.bin", "nothing"])
def test_every_answer_is_safe(server: Server, path: str) -> None:
    headers = ask(server, path).headers
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cross-Origin-Opener-Policy"] == "same-origin"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert not [name for name in headers if name.startswith("Access-Control")]
    assert headers["Server"] == "mcz"


def test_api_says_what_is_there(server: Server) -> None:
    api = ask(server, "api.json").json
    assert [(file["name"], file["kind"], file["url"]) for file in api["files"]] == [
        ("walk.mcz", "mcz", "files/0"),
        ("walk.amc", "amc", "files/1"),
        ("broken.bvh", "bvh", "files/2"),
    ]
    assert (api["canEncode"], api["canConvert"], api["salvage"]) == (True, True, False)
    assert api["diff"] is False  # there are three
    texts = ".amc .asf .bvh .csv .mot .mvnx .sto .trc .tsv"
    assert api["suffixes"] == sorted(
        f"{texts} .c3d .joblib .npy .npz .pickle .pkl .pt .pth".split()
    )
    assert api["version"] == mcz.__version__
    codecs = {codec["name"]: codec for codec in api["codecs"]}
    assert next(iter(codecs)) == "posewave"  # what "lossy" stands for
    assert "fast" not in codecs
    dial = codecs["mrdwt"]["dial"]
    assert dial["parameter"] == codecs["mrdwt"]["quality"]
    assert dial["low"] < dial["high"]


def test_annexes_are_given_and_nothing_else_of_the_disk(server: Server) -> None:
    assert ask(server, "annex/words.bin").body == annex_bytes("words.bin")
    for path in (
        "annex/",
        "annex/../extras.py",
        "annex/..%2fextras.py",
        "annex//etc/passwd",
        "files/",
        "files/../api.json",
        "files/0/",
        "files/99",
        "files/-1",
        "files/0x0",
        "../",
        "%2e%2e/",
        "viewer.html",
    ):
        assert ask(server, path).status == 404, path


def test_sources_are_converted_when_asked_for(server: Server, samples: Path) -> None:
    data = ask(server, "files/1").body
    with mcz.open(data) as file:
        assert file["walk"].source_bytes() == (samples / "walk.amc").read_bytes()
        assert file["walk"].skeleton.unit_cm == 1.0
    assert ask(server, "api.json").json["files"][1]["size"] == len(data)


def test_what_cannot_be_converted_says_why(server: Server) -> None:
    answer = ask(server, "files/2", "HEAD")
    assert (answer.status, answer.body) == (422, b"")
    error = ask(server, "files/2").json["error"]
    assert error["class"] == "SourceError"
    assert "broken.bvh: line 13" in error["message"]


def test_a_source_that_changed_is_converted_anew(samples: Path, tmp_path: Path) -> None:
    source = tmp_path / "walk.bvh"
    source.write_bytes(b"nothing yet")
    with serve_files(source) as server:
        assert ask(server, "files/0").status == 422
        source.write_bytes((samples / "walk.bvh").read_bytes())
        before = ask(server, "files/0")
        assert before.status == 200
        source.write_bytes((samples / "walk.bvh").read_bytes() + b"\n")
        after = ask(server, "files/0")
        assert after.status == 200
        assert after.headers["ETag"] != before.headers["ETag"]


def test_what_is_below_a_folder_is_converted_anew(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry_module, "SCAN_FACTOR", 0)
    folder = tmp_path / "takes"
    (folder / "deep").mkdir(parents=True)
    source = folder / "deep" / "walk.bvh"
    source.write_bytes((samples / "walk.bvh").read_bytes())
    registry = FileRegistry()
    add_path(registry, str(folder))
    first = registry[0].target()
    (folder / "notes.txt").write_text("no motion")
    assert registry[0].target() == first
    source.write_bytes(source.read_bytes() + b"\n")
    with mcz.open(registry[0].target()) as file:
        assert file.only_clip().source_bytes() == source.read_bytes()
    registry.close()


@pytest.mark.parametrize("is_named", [False, True])
def test_an_amc_is_converted_anew_with_its_asf(
    samples: Path, tmp_path: Path, is_named: bool
) -> None:
    (tmp_path / "walk.amc").write_bytes((samples / "walk.amc").read_bytes())
    asf = tmp_path / "elsewhere" / "other.asf" if is_named else tmp_path / "walk.asf"
    asf.parent.mkdir(exist_ok=True)
    asf.write_bytes((samples / "walk.asf").read_bytes())
    registry = FileRegistry({"skeleton": str(asf)} if is_named else None)
    add_path(registry, str(tmp_path / "walk.amc"))
    first = registry[0].target()
    assert registry[0].target() == first
    asf.write_bytes(b"# edited\n" + asf.read_bytes())
    assert registry[0].target() != first
    registry.close()


def test_a_folder_is_its_files_and_one_archive(samples: Path, folder: Path) -> None:
    registry = FileRegistry()
    add_path(registry, str(folder))
    assert [(file.name, file.kind) for _, file in registry.initial_files()] == [
        ("walk.mcz", "mcz"),
        (folder.name, "folder"),
    ]
    add_path(registry, str(samples))
    with mcz.open(registry[2].target()) as file:
        assert len(file) == 3
    registry.close()
    with pytest.raises(OptionError, match="no motion file"):
        add_path(FileRegistry(), str(Path(__file__).parent))


@pytest.mark.parametrize("name", ["none.mcz", "walk.asf", "walk.txt", "http://x/a.bvh", ""])
def test_what_cannot_be_shown_is_refused_at_once(samples: Path, name: str) -> None:
    path = name if "://" in name or not name else str(samples / name)
    with pytest.raises((AccessError, OptionError)):
        add_path(FileRegistry(), path)


def test_a_url_is_read_by_ranges(folder: Path) -> None:
    from tests import web_server

    data = (folder / "walk.mcz").read_bytes()
    far = web_server.Server(data)
    with web_server.serve(far), serve_files(far.address) as server:
        assert ask(server, "files/0", Range="bytes=8-99").body == data[8:100]
        assert ask(server, "files/0").body == data
        assert ask(server, "api.json").json["files"][0]["name"] == "a.mcz"
        asked = {"url": "files/0", "clip": "walk", "codec": "qbc"}
        assert post(server, "encode", asked).status == 200


# Ranges --------------------------------------------------------------------------


def bytes_of(server: Server, folder: Path, said: str, **headers: str) -> Answer:
    return ask(server, "files/0", Range=said, **headers)


@pytest.mark.parametrize(
    ("said", "start", "stop"),
    [
        ("bytes=0-0", 0, 1),
        ("bytes=5-", 5, None),
        ("bytes=-7", -7, None),
        ("bytes=10-99999999", 10, None),
        ("bytes=-99999999", 0, None),
    ],
)
def test_ranges(server: Server, folder: Path, said: str, start: int, stop: int | None) -> None:
    data = (folder / "walk.mcz").read_bytes()
    answer = ask(server, "files/0", Range=said)
    assert answer.status == 206
    assert answer.body == data[start:stop]
    first = start % len(data)
    last = first + len(answer.body) - 1
    assert answer.headers["Content-Range"] == f"bytes {first}-{last}/{len(data)}"
    assert answer.headers["Accept-Ranges"] == "bytes"


@pytest.mark.parametrize(
    "said", ["bytes=9-3", "bytes=-", "bytes=a-b", "lines=1-2", "bytes=0-1,4-5", "bytes=1", "-"]
)
def test_what_is_no_range_is_passed_over(server: Server, folder: Path, said: str) -> None:
    answer = ask(server, "files/0", Range=said)
    assert (answer.status, answer.body) == (200, (folder / "walk.mcz").read_bytes())


def test_behind_the_end_there_is_nothing(server: Server, folder: Path) -> None:
    size = (folder / "walk.mcz").stat().st_size
    answer = ask(server, "files/0", Range=f"bytes={size}-")
    assert (answer.status, answer.headers["Content-Range"]) == (416, f"bytes */{size}")
    assert ask(server, "files/0", Range="bytes=-0").status == 416


def test_tags(server: Server, folder: Path) -> None:
    tag = ask(server, "files/0", "HEAD").headers["ETag"]
    assert re.fullmatch(r'"[0-9a-f-]+"', tag)
    assert ask(server, "files/0", If_None_Match=tag).status == 304
    assert ask(server, "files/0", If_None_Match='"other"').status == 200
    assert ask(server, "files/0", If_Match='"other"').status == 412
    assert ask(server, "files/0", If_Match=f'"other", {tag}').status == 200
    assert ask(server, "files/0", Range="bytes=0-3", If_Range=tag).status == 206
    assert ask(server, "files/0", Range="bytes=0-3", If_Range='"other"').status == 200


def test_another_file_has_another_tag(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "a.mcz"
    data = (folder / "walk.mcz").read_bytes()
    path.write_bytes(data)
    with serve_files(path) as server:
        tag = ask(server, "files/0").headers["ETag"]
        path.write_bytes(data)
        os.utime(path, ns=(1, 1))
        answer = ask(server, "files/0", Range="bytes=0-3", If_Range=tag)
        assert answer.status == 200
        assert answer.headers["ETag"] != tag
        path.unlink()
        assert ask(server, "files/0").status == 422


def test_ranges_at_once(server: Server, folder: Path) -> None:
    data = (folder / "walk.mcz").read_bytes()

    def part(start: int) -> bool:
        answer = ask(server, "files/0", Range=f"bytes={start}-{start + 499}")
        return answer.body == data[start : start + 500]

    with ThreadPoolExecutor(16) as pool:
        assert all(pool.map(part, range(0, len(data) - 500, 97)))


def test_a_file_without_a_byte(tmp_path: Path) -> None:
    (tmp_path / "a.mcz").write_bytes(b"")
    with serve_files(tmp_path / "a.mcz") as server:
        assert ask(server, "files/0").body == b""
        answer = ask(server, "files/0", Range="bytes=-100")
        assert (answer.status, answer.headers["Content-Range"]) == (416, "bytes */0")


@given(said=st.from_regex(r"(bytes=)?[0-9, -]{0,12}", fullmatch=True), size=st.integers(0, 300))
def test_a_range_lies_within_the_file(said: str, size: int) -> None:
    from email.message import Message

    headers = Message()
    headers["Range"] = said
    try:
        found = range_of(headers, size, '"a"')
    except Refused as refused:
        assert refused.status == 416
        return
    if found is not None:
        start, stop = found
        assert 0 <= start < stop <= size


# Who is answered -----------------------------------------------------------------


def test_without_the_token_there_is_nothing(server: Server) -> None:
    token = server.site.token
    assert len(token) >= 32
    for path in ("/", f"/{token}", f"/{token}x/", f"/{token[:-1]}/", "/api.json"):
        answer = ask_anywhere(server, path)
        assert answer.status == 404, path
        assert token.encode() not in answer.body
    assert ask_anywhere(server, f"/{'A' * 32}/api.json").status == 404


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "[::1]", ""])
def test_another_host_is_refused(server: Server, host: str) -> None:
    """A name that somebody made to mean this machine (DNS rebinding)."""
    assert ask(server, "api.json", Host=host).status == 421


def test_own_names_are_answered(server: Server) -> None:
    for name in ("127.0.0.1", "localhost", "LOCALHOST", "[::1]"):
        assert ask(server, "api.json", Host=f"{name}:{server.site.port}").status == 200


def test_other_pages_are_refused(server: Server) -> None:
    port = server.site.port
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{port}", "http://127.0.0.1"):
        assert ask(server, "api.json", Origin=origin).status == 403
        assert ask(server, "diff", "POST", b"{}", Origin=origin).status == 403
    assert ask(server, "api.json", Origin=f"http://127.0.0.1:{port}").status == 200
    assert ask(server, "files/0", Sec_Fetch_Site="cross-site").status == 403
    assert ask(server, "files/0", Sec_Fetch_Site="same-site").status == 403
    assert ask(server, "files/0", Sec_Fetch_Site="same-origin").status == 200
    link = {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}
    assert ask(server, "", Sec_Fetch_Dest="document", **link).status == 200
    assert ask(server, "", Sec_Fetch_Dest="iframe", **link).status == 403


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "X"])
def test_other_methods_are_not_answered(server: Server, method: str) -> None:
    answer = ask(server, "api.json", method)
    assert answer.status == 501
    assert "Access-Control-Allow-Origin" not in answer.headers


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\r\n\r\n",
        b"GET /\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/9.9\r\nHost: 127.0.0.1\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" * 20,
        b"GET /" + b"a" * 70000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 200 + b"\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
    ],
)
def test_what_is_no_request_does_no_harm(server: Server, data: bytes) -> None:
    said = raw(server, data)
    assert b"200 OK" not in said
    assert ask(server, "api.json").status == 200


def test_a_request_cannot_hide_another(server: Server) -> None:
    """The server does not read the body of a refused request as the next request."""
    token, host = server.site.token, f"Host: 127.0.0.1:{server.site.port}\r\n"
    start = f"POST /{token}/diff HTTP/1.1\r\n{host}"
    hidden = f"GET /{token}/api.json HTTP/1.1\r\n{host}\r\n"
    for said in ("Transfer-Encoding: chunked", "Content-Length: 0\r\nContent-Length: 9", "X: y"):
        head = f"{start}Content-Type: application/json\r\n{said}\r\n\r\n"
        answer = raw(server, (head + hidden).encode())
        assert answer.count(b"HTTP/1.1 ") == 1
        assert b"411" in answer.split(b"\r\n")[0]


def test_only_this_machine_is_served(monkeypatch: pytest.MonkeyPatch) -> None:
    for host in ("0.0.0.0", "", "example.org", "192.168.0.1"):
        with pytest.raises(OptionError, match="only to this machine"):
            Server(page(), FileRegistry(), host=host)
    with Server(page(), FileRegistry()) as server, pytest.raises(AccessError):
        Server(page(), FileRegistry(), port=server.site.port)


def test_too_many_connections_are_closed(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    from threading import BoundedSemaphore

    with Server(page(), FileRegistry()) as small:
        small._free = BoundedSemaphore(1)
        with small._free, pytest.raises(OSError):
            ask(small, "api.json")
        assert ask(small, "api.json").status == 200


# What can be done ----------------------------------------------------------------


def test_a_clip_is_coded_anew(server: Server) -> None:
    asked = {"url": "files/0", "clip": 0, "codec": "mrdwt", "params": {"T_g": 4, "Q": None}}
    answer = post(server, "encode", asked)
    assert answer.status == 200
    found = answer.json
    data = ask(server, found["url"]).body
    assert len(data) == found["size"]
    with mcz.open(data) as file:
        assert file["walk"].codec == "mrdwt"
        assert file["walk"].quality == found["quality"]
    assert found["quality"]["param.T_g"] == "4.0"
    assert 0 < found["payload"] < found["size"]
    assert found["seconds"] > 0
    pair = {"a": {"url": "files/0", "clip": "walk"}, "b": {"url": found["url"]}}
    document = post(server, "diff", pair).json
    assert document["b"] == found["name"]
    (clip,) = document["clips"]
    mean = clip["mean_position_error_cm"]
    assert mean == pytest.approx(float(found["quality"]["mean_position_error_cm"]))
    assert clip["by_joint"]
    assert set(clip["ratios_b"]) == {"cr_source", "cr_float32", "cr_40B"}


def test_diff_is_that_of_the_command(
    server: Server, folder: Path, samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from tests.commands import run

    words = ["diff", str(folder / "walk.mcz"), str(folder / "walk.mcz"), "--by-joint", "--json"]
    assert run(*words, "--unit", "cm") == 0
    printed = json.loads(capsys.readouterr().out)
    asked = {"a": {"url": "files/0"}, "b": {"url": "files/0"}}
    assert post(server, "diff", asked).json["clips"] == printed["clips"]


def test_a_unit_can_be_said_later(tmp_path: Path) -> None:
    motion = smooth(12)
    motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=None))
    mcz.write(motion, tmp_path / "a.mcz")
    with serve_files(tmp_path / "a.mcz") as server:
        asked = {"url": "files/0", "codec": "mrdwt", "params": {"mean_error_cm": 1}}
        refused = post(server, "encode", asked)
        assert (refused.status, refused.json["error"]["class"]) == (422, "OptionError")
        assert "unit" in refused.json["error"]["message"]
        assert post(server, "encode", {**asked, "unit": "cm"}).status == 200


def test_what_an_mcz_does_not_say_is_told(tmp_path: Path) -> None:
    motion = smooth(12)
    skeleton = replace(motion.skeleton, unit_cm=None, up_axis="")
    mcz.write(replace(motion, skeleton=skeleton, frame_rate=None), tmp_path / "a.mcz")
    with serve_files(tmp_path / "a.mcz", rate=50, unit="mm", up="z", skeleton=None) as server:
        made = post(server, "encode", {"url": "files/0", "codec": "mrdwt", "params": {"T_g": 4}})
        with mcz.open(ask(server, made.json["url"]).body) as file:
            clip = file.only_clip()
            assert (clip.frame_rate, clip.skeleton.unit_cm) == (50, 0.1)
            assert clip.skeleton.up_axis == "z"
        assert post(server, "glb", {"url": "files/0"}).status == 200  # which needs a rate
        pair = {"a": {"url": "files/0"}, "b": {"url": "files/0"}}
        (found,) = post(server, "diff", pair).json["clips"]
        assert found["mean_position_error_cm"] == 0  # which needs a unit


@pytest.mark.parametrize(
    ("path", "document", "status"),
    [
        ("encode", [], 400),
        ("encode", {}, 400),
        ("encode", {"url": "files/0"}, 400),
        ("encode", {"url": 3, "codec": "mrdwt"}, 400),
        ("encode", {"url": "/etc/passwd", "codec": "mrdwt"}, 404),
        ("encode", {"url": "files/77", "codec": "mrdwt"}, 404),
        ("encode", {"url": "files/0", "codec": "none"}, 422),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": []}, 200),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": [1]}, 400),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": {"T_g": [1]}}, 400),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": {"T_g": float("nan")}}, 422),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": {"force": True}}, 422),
        ("encode", {"url": "files/0", "codec": "mrdwt", "params": {"target": "x"}}, 422),
        ("encode", {"url": "files/0", "clip": [], "codec": "mrdwt"}, 400),
        ("encode", {"url": "files/0", "clip": True, "codec": "mrdwt"}, 400),
        ("encode", {"url": "files/0", "clip": 9, "codec": "mrdwt"}, 404),
        ("encode", {"url": "files/0", "clip": "run", "codec": "mrdwt"}, 422),
        ("encode", {"url": "files/0", "codec": "mrdwt", "unit": "mile"}, 422),
        ("encode", {"url": "files/0", "codec": "mrdwt", "unit": []}, 400),
        ("encode", {"url": "files/2", "codec": "mrdwt"}, 422),
        ("diff", {"a": {"url": "files/0"}}, 400),
        ("diff", {"a": {"url": "files/0"}, "b": 1}, 400),
        ("glb", {"url": "files/77"}, (404, 501)),
        ("nothing", {}, 404),
    ],
)
def test_what_cannot_be_done_says_why(
    server: Server, path: str, document: object, status: int | tuple[int, ...]
) -> None:
    answer = post(server, path, document)
    assert answer.status in (status if isinstance(status, tuple) else (status,)), answer.body
    if answer.status != 200:
        assert answer.json["error"]["message"]


def test_no_parameter_names_a_file(server: Server, tmp_path: Path) -> None:
    for name in (str(tmp_path), "../x", "x.basis", "C:\\x"):
        asked = {"url": "files/0", "codec": "lsdt-clip", "params": {"basis": name}}
        answer = post(server, "encode", asked)
        assert answer.status == 422
        assert "the page cannot choose files of this machine" in answer.json["error"]["message"]


@pytest.mark.parametrize("data", [b"", b"{", b"[" * 100000, b"\xff", b'{"a":' * 9999, b"9" * 9999])
def test_what_is_no_json_is_refused(server: Server, data: bytes) -> None:
    assert ask(server, "diff", "POST", data, Content_Type="application/json").status in (400, 413)


def test_a_form_is_no_json(server: Server) -> None:
    assert ask(server, "diff", "POST", b"{}", Content_Type="text/plain").status == 415


def test_results_are_few(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry_module, "MOST_RESULTS", 2)
    with serve_files(folder / "walk.mcz") as server:
        asked = {"url": "files/0", "codec": "mrdwt", "params": {"T_g": 8}}
        urls = [post(server, "encode", asked).json["url"] for _ in range(4)]
        assert [ask(server, url).status for url in urls] == [404, 404, 200, 200]
        assert len(list(server.site.registry.folder().iterdir())) == 2


# Files that the page gives -------------------------------------------------------


def test_dropped_files_are_converted(server: Server, samples: Path) -> None:
    bvh = (samples / "walk.bvh").read_bytes()
    found = convert(server, form(("a/b/walk.bvh", bvh))).json
    assert found["name"] == "walk.bvh"
    data = ask(server, found["url"]).body
    assert len(data) == found["size"]
    with mcz.open(data) as file:
        assert file["walk"].source_bytes() == bvh


def test_an_amc_comes_with_its_asf(server: Server, samples: Path) -> None:
    names = ("walk.asf", "walk.amc")
    files = [(name, (samples / name).read_bytes()) for name in names]
    with mcz.open(ask(server, convert(server, form(*files)).json["url"]).body) as file:
        assert file["walk"].skeleton.joints[1].tails
    more = [*files, ("c/walk.c3d", (samples / "walk.c3d").read_bytes())]
    found = convert(server, form(*more)).json
    assert found["name"] == "2 files"
    with mcz.open(ask(server, found["url"]).body) as file:
        assert sorted(file.clips) == ["c/walk", "walk"]


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"", 400),
        (b"--X", 400),
        (b"--X--\r\n", 400),
        (b"--X\r\n\r\n", 400),
        (b"--Y\r\n\r\n\r\n--Y--", 400),
        (b"--X!\r\n", 400),
        (b"--X\r\n" + b"a" * 20000, 400),
        (form(("a.bvh", b"")), 422),
        (form(("a.bvh", b"HIERARCHY\n" + b"{" * 9999)), 422),
        (form(("a.c3d", b"\x02\x50" + b"\xff" * 2000)), 422),
        (form(("a.amc", b":FULLY-SPECIFIED\n:DEGREES\n1\nroot x\n")), 422),
        (form(("a.exe", b"")), 422),
        (form(("a.mcz", b"")), 422),
        (form(("a.bvh", b"1"), ("a.bvh", b"2")), 400),
        (form(("a.asf", b"")), 400),
        (form(("../../a.bvh", b"")), 422),
        (form(("a" * 3000 + ".bvh", b"")), 422),
        (form(("/".join("abcdefghijklmnop") + ".bvh", b"")), 422),
        (form(("\x01\x9b.bvh", b"")), 422),
    ],
)
def test_hostile_forms(server: Server, body: bytes, status: int) -> None:
    before = sorted(server.site.registry.folder().iterdir())
    answer = convert(server, body)
    assert answer.status == status, answer.body
    assert answer.json["error"]["message"]
    assert str(server.site.registry.folder()) not in answer.json["error"]["message"]
    assert sorted(server.site.registry.folder().iterdir()) == before


@given(body=st.binary(max_size=200), cut=st.integers(0, 300))
def test_any_bytes_are_a_form_or_refused(
    tmp_path_factory: pytest.TempPathFactory, body: bytes, cut: int
) -> None:
    import io

    from mcz.show.viewing.requests import save_files

    whole = form(("a/x.bvh", body), ("b.bvh", body[::-1]))
    folder = tmp_path_factory.mktemp("form")
    for number, data in enumerate((body, whole[:cut] + body, whole)):
        try:
            paths = save_files(io.BytesIO(data), len(data), b"X", folder / str(number))
        except Refused as refused:
            assert refused.status in (400, 413)
            continue
        assert all(folder in path.parents for path in paths)
    if b"\r\n--X" not in b"\r\n" + body + body[::-1]:
        assert [path.read_bytes() for path in paths] == [body, body[::-1]]


def test_a_form_in_pieces_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    from mcz.show.viewing import requests

    data = b"\r\n--\r\n--X" * 3 + b"\r\n-" + bytes(range(256)) * 4
    data = data.replace(b"\r\n--X", b"\r\n--Z")
    body = form(("a.bvh", data), ("b.bvh", b""))
    for size in (1, 2, 3, 5, 64, 4096):
        monkeypatch.setattr(requests, "PIECE", size)
        (tmp_path / str(size)).mkdir()
        paths = requests.save_files(io.BytesIO(body), len(body), b"X", tmp_path / str(size))
        assert [path.read_bytes() for path in paths] == [data, b""]


def test_too_much_is_refused(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(server.site.tasks), "most_posted", 100)
    assert convert(server, form(("a.bvh", b"x" * 200))).status == 413
    assert ask(server, "convert", "POST", b"x", Content_Type="text/plain").status == 415


def test_uploads_are_few(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry_module, "MOST_UPLOADS", 1)
    with Server(page(), FileRegistry()) as server:
        body = form(("walk.bvh", (samples / "walk.bvh").read_bytes()))
        assert convert(server, body).status == 200
        assert convert(server, body).json["error"]["class"] == "LimitError"


def test_a_page_of_another_version_is_refused() -> None:
    text = page().text
    places = [text.replace(name, "x") for name in ("mcz:embedded", "mcz:end")]
    for wrong in ("", *places, text + "<!-- mcz:embedded -->"):
        with pytest.raises(FormatError, match="is not a page of this version of the viewer"):
            Page(wrong)
