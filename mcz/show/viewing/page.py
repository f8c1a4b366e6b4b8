"""The page: its text, its permissions, and the place in it for files."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from mcz.container.source import lock
from mcz.errors import AccessError, FormatError, reason_of
from mcz.show.viewing.file_registry import Report

PACKAGED = Path(__file__).with_name("viewer.html")  # in a wheel that was built with it
OTHER = "MCZ_VIEWER_PAGE"  # an environment variable: a page to use instead of ours
PLACE = "<!-- mcz:embedded -->"
END = "<!-- mcz:end -->"
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"<>]*)"')


class Page:
    """The text of the page, and ``policy``, its permissions in browsers.

    The page on disk has the tables of all codecs at ``PLACE``, which ``text`` lacks: a server has
    them, and written pages have those that their files need.
    """

    def __init__(self, text: str, name: str = "the page") -> None:
        before, separator, rest = text.partition(PLACE)
        _, end, after = rest.partition(END)
        policy = POLICY.search(before)
        if not separator or not end or PLACE in after or policy is None:
            raise FormatError(f"{name} is not a page of this version of the viewer")
        self.text = before + PLACE + END + after
        self.before, self.after, self.policy = before, after, policy[1]


def page(say: Report | None = None) -> Page:
    """The page of this installation; in a source checkout it is built if outdated.

    ``say`` gets a line for slow steps. Raises AccessError if there is none; the message explains
    how to build one.
    """
    if other := os.environ.get(OTHER):
        path = Path(other)
    else:
        path = PACKAGED if PACKAGED.is_file() else build_page(say or (lambda line: None))
    try:
        return Page(path.read_text("utf-8"), str(path))
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None
    except UnicodeDecodeError:
        raise FormatError("not a page of the viewer", path=path) from None


ROOT = Path(__file__).parents[3]
VIEWER = "tools/viewer"


def has_page() -> bool:
    """Return True if the page is there without being built."""
    paths = Path(os.environ.get(OTHER, PACKAGED)), ROOT / VIEWER / "dist" / "viewer.html"
    return any(path.is_file() for path in paths)


COMMAND = f"(cd {VIEWER} && npm ci && npm run build)"
INSTALL = ("ci", "--no-audit", "--no-fund")
SHOWN = 300  # last characters of the output of a failed program


def build_page(say: Callable[[str], None], root: Path = ROOT) -> Path:
    """The page built from the sources below ``root``; raises AccessError without one.

    npm builds it if it is older than its sources. Without npm an old one is used.
    """
    folder = root / VIEWER
    page = folder / "dist" / "viewer.html"
    if not (folder / "build.mjs").is_file():
        text = "this installation has no page of the viewer: its wheel was built without"
        raise AccessError(f"{text}; in a clone of the repository, build it with {COMMAND}")
    if page.is_file() and not _is_older(page, _sources(root)):
        return page
    npm, node = shutil.which("npm"), shutil.which("node")
    if npm is None or node is None:
        if page.is_file():
            say(f"{page} is older than its sources, and npm is not installed to rebuild it")
            return page
        raise AccessError(f"the page of the viewer is not built: install Node.js, then {COMMAND}")
    _build(folder, npm, node, say)
    return page


def _sources(root: Path) -> Iterator[Path]:
    folder = root / VIEWER
    yield from (folder / name for name in ("build.mjs", "package.json", "package-lock.json"))
    yield from (path for path in (folder / "src").rglob("*") if path.is_file())
    yield from (root / "tools" / "js").rglob("*.js")
    yield from (root / "mcz" / "annex").glob("*")


def _is_older(made: Path, sources: Iterator[Path]) -> bool:
    when = made.stat().st_mtime_ns
    return any(path.stat().st_mtime_ns > when for path in sources if path.is_file())


def _build(folder: Path, npm: str, node: str, say: Callable[[str], None]) -> None:
    (folder / "dist").mkdir(exist_ok=True)
    with (folder / "dist" / "building").open("wb") as stream:
        if not lock(stream):
            raise AccessError("another process is building the page; try again soon", path=folder)
        packages = folder / "node_modules" / ".package-lock.json"
        if not packages.is_file() or _is_older(packages, iter([folder / "package-lock.json"])):
            say(f"fetching the build tools of the page (once): npm ci in {folder}")
            _run([npm, *INSTALL], folder)
        say("building the page: node build.mjs")
        _run([node, "build.mjs"], folder)


def _run(words: list[str], folder: Path) -> None:
    done = subprocess.run(
        words, cwd=folder, capture_output=True, stdin=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        message = " ".join((done.stderr or done.stdout).decode("utf-8", "replace").split())[-SHOWN:]
        command = " ".join([Path(words[0]).name, *words[1:]])
        raise AccessError(f"the page could not be built: {command} in {folder} said: {message}")
