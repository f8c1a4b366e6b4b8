"""``mcz view`` and ``mcz.view`` from start to end: when they end, and what they leave."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

import mcz
from mcz import AccessError, OptionError
from mcz.show.viewing import view
from mcz.show.viewing.server_tasks import OpenPages
from tests.commands import Call


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files, of which none may be left."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@contextmanager
def start_view(*words: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """``mcz view`` in a process of its own, and the address that it says."""
    command = [sys.executable, "-m", "mcz", "view", *map(str, words), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def get(url: str, path: str) -> bytes:
    at = urlsplit(url)
    connection = http.client.HTTPConnection(at.netloc, timeout=30)
    connection.request("GET", at.path + path)
    data = connection.getresponse().read()
    connection.close()
    return data


def open_events(url: str) -> http.client.HTTPResponse:
    """The event stream of a page."""
    at = urlsplit(url)
    connection = http.client.HTTPConnection(at.netloc, timeout=30)
    connection.request("GET", at.path + "alive")
    response = connection.getresponse()
    assert response.readline() == b": here\n"
    return response


def test_a_page_hears_that_the_server_ends(samples: Path) -> None:
    with mcz.view(samples / "walk.bvh", browser=False) as shown:
        assert shown.url is not None
        stream = open_events(shown.url)
    assert stream.read() == b"\nevent: end\ndata: \n\n"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_and_nothing_is_left(
    samples: Path, temporary: Path, number: int, code: int
) -> None:
    with start_view(samples / "walk.bvh") as (process, url):
        assert get(url, "files/0").startswith(b"\x89MCZ")
        assert len(list(temporary.iterdir())) == 1
        process.send_signal(number)
        assert process.wait(20) == code
        assert not list(temporary.iterdir())


def test_it_ends_with_its_pages(
    samples: Path, temporary: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While one of them is open it stays; it ends when all have been closed for a while."""
    monkeypatch.setattr("mcz.show.viewing.server.GRACE", 0.2)
    seen: list[object] = []

    def visit(url: str) -> bool:
        def pages() -> None:
            first, second = open_events(url), open_events(url)
            seen.append(first.headers["Content-Type"])
            first.close()
            seen.append(get(url, "files/0")[:4])
            second.close()

        Thread(target=pages).start()
        return True

    monkeypatch.setattr(view, "show", visit)
    code, out, errors = call("view", samples / "walk.bvh")
    assert (code, errors) == (0, "")
    assert out.startswith("http://127.0.0.1:")
    assert seen == ["text/event-stream", b"\x89MCZ"]
    assert not list(temporary.iterdir())


def test_without_a_browser_the_address_is_said(
    samples: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(OpenPages, "wait", lambda self, for_ever: None)
    code, out, errors = call("view", samples / "walk.bvh", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["files"] == [
        {"name": "walk.bvh", "size": None, "url": "files/0", "kind": "bvh"}
    ]
    assert "no browser" in json.loads(errors)["note"]
    assert call("view", samples / "walk.bvh", "--no-browser", "--host", "::1")[1].startswith(
        "http://[::1]:"
    )


def test_visitors_may_come_back() -> None:
    pages = OpenPages(30.0)
    waiting = Thread(target=pages.wait)
    waiting.start()
    with pages:
        pass
    with pages:  # within the time of grace
        waiting.join(0.05)
        assert waiting.is_alive()
    assert pages.stay(0.0)
    pages.close()
    waiting.join(10)
    assert not waiting.is_alive()
    assert not pages.stay(30.0)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("none.bvh",), 1, "none.bvh: no such file"),
        (("walk.asf",), 2, "unsupported suffix; it must be one of"),
        (("walk.bvh", "--host", "0.0.0.0"), 2, "only to this machine"),
        (("walk.bvh", "--port", "99999"), 2, "99999"),
        (("walk.bvh", "--codec", "lossy"), 2, "--codec applies only with -o"),
        (("walk.bvh", "--clip", "walk"), 2, "--clip applies only with -o"),
        (("walk.bvh", "--force"), 2, "--force applies only with -o"),
        (("walk.bvh", "-o", "x.html", "--keep"), 2, "--keep applies only without -o"),
        (("walk.bvh", "-o", "x.html", "--no-browser"), 2, "--no-browser applies only without"),
        (("walk.bvh", "-o", "-"), 2, "not to standard output"),
        ((), 2, "FILE"),
    ],
)
def test_wrong_use(
    samples: Path,
    call: Call,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    code: int,
    said: str,
) -> None:
    monkeypatch.chdir(samples)
    found, out, errors = call("view", *words)
    assert (found, out) == (code, "")
    assert said in errors
    assert errors.count("\n") == 1


def test_an_installation_without_page_says_so(
    samples: Path, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCZ_VIEWER_PAGE", str(tmp_path / "none.html"))
    code, _, errors = call("view", samples / "walk.bvh", "--no-browser")
    assert (code, "none.html: No such file" in errors) == (1, True)
    (tmp_path / "none.html").write_bytes(b"\xff\xfe")
    assert "not a page of the viewer" in call("view", samples / "walk.bvh", "--no-browser")[2]


# From Python ---------------------------------------------------------------------


def test_view_serves_motions_clips_and_files(samples: Path, temporary: Path) -> None:
    motion = mcz.read(samples / "walk.bvh")
    mcz.write(motion, samples.parent / "one.mcz", "mrdwt")
    with mcz.open(samples.parent / "one.mcz") as file:
        clip = file["walk"]
        given = (motion, clip, samples / "walk.c3d")
        with mcz.view(*given, browser=False) as shown:
            assert repr(shown) == f"<View at {shown.url}>"
            assert shown._repr_html_() is None
            assert shown.url is not None
            with mcz.open(get(shown.url, "files/0")) as served:
                assert (served["walk"].values[:] == motion.values).all()
            with mcz.open(get(shown.url, "files/1")) as served:
                assert served["walk"].codec == "mrdwt"
            assert get(shown.url, "files/2").startswith(b"\x89MCZ")
    shown.close()
    assert not view._OPEN
    assert not list(temporary.iterdir())
    with pytest.raises(OSError):
        get(shown.url, "api.json")


def test_a_clip_of_a_stream_is_served(samples: Path, tmp_path: Path) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz")
    with (
        (tmp_path / "a.mcz").open("rb") as stream,
        mcz.open(stream) as file,
        mcz.view(file["walk"], browser=False) as shown,
    ):
        assert shown.url is not None
        with mcz.open(get(shown.url, "files/0")) as served:
            assert served["walk"].n_frames == 240


def test_view_opens_the_browser(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(view, "show", opened.append)
    with mcz.view(samples / "walk.bvh") as shown:
        assert opened == [shown.url]


def test_what_cannot_be_viewed(samples: Path, temporary: Path) -> None:
    with pytest.raises(OptionError, match="nothing to view"):
        mcz.view()
    with pytest.raises(AccessError):
        mcz.view(mcz.read(samples / "walk.bvh"), samples / "none.bvh")
    assert not list(temporary.iterdir())


def test_a_notebook_gets_players(samples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "IPython", kernel)  # type: ignore[arg-type]
    mcz.encode(samples / "walk.bvh", samples.parent / "nb.mcz")
    shown = mcz.view(mcz.read(samples / "walk.bvh"), samples.parent / "nb.mcz")
    assert shown.url is None
    assert repr(shown) == "<View in a notebook>"
    html = shown._repr_html_()
    assert html is not None
    assert html.count("<iframe ") == 2
    shown.close()


def test_a_terminal_of_ipython_is_no_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    for shell in (None, SimpleNamespace()):
        module = SimpleNamespace(get_ipython=lambda shell=shell: shell)
        monkeypatch.setitem(sys.modules, "IPython", module)  # type: ignore[arg-type]
        assert not view.in_notebook()


def test_the_browser_is_that_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    import webbrowser

    opened: list[str] = []

    def open_(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", open_)
    monkeypatch.setenv("DISPLAY", ":0")
    assert view.show("http://x/")
    assert opened == ["http://x/"]


def test_what_is_written_has_a_suffix_of_its_kind(call: Call, tmp_path: Path) -> None:
    assert call("view", "walk.bvh", "-o", tmp_path / "film.mp4") == (
        2,
        "",
        f"mcz: {tmp_path / 'film.mp4'}: a page must be an .html; for films, use mcz render\n",
    )
    code, _, said = call("view", tmp_path / "missing.mcz", "-o", tmp_path / "take.rrd")
    assert code != 2 and "missing.mcz" in said  # an .rrd is for rerun
