"""The source of the page: a wheel built with it, or a source checkout."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import mcz
from mcz import AccessError
from mcz.show.viewing import page
from mcz.show.viewing.page import build_page

ROOT = Path(mcz.__file__).parents[1]
PAGE = Path(__file__).with_name("page.html")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A source checkout without the page."""
    names = ("build.mjs", "package.json", "package-lock.json", "src/main.js", "../js/mcz.js")
    for name in names:
        path = tmp_path / page.VIEWER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
        set_mtime(path, 100)
    return tmp_path


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the programs that would run; building creates a page, as the real build does."""
    ran: list[str] = []

    def run(words: list[str], cwd: Path, **options: object) -> subprocess.CompletedProcess[bytes]:
        ran.append(" ".join([Path(words[0]).name, *words[1:]]))
        if "build.mjs" in words:
            (cwd / "dist" / "viewer.html").write_bytes(PAGE.read_bytes())
        else:
            (cwd / "node_modules").mkdir(exist_ok=True)
            (cwd / "node_modules" / ".package-lock.json").write_text("")
        return subprocess.CompletedProcess(words, 0, b"", b"")

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}")
    return ran


def set_mtime(path: Path, seconds: int) -> None:
    """Set a file's modification time, in seconds after 1970."""
    os.utime(path, (seconds, seconds))


def test_it_is_built_once_and_when_sources_change(checkout: Path, programs: list[str]) -> None:
    said: list[str] = []
    built_page = build_page(said.append, checkout)
    assert built_page.read_bytes() == PAGE.read_bytes()
    assert programs == ["npm ci --no-audit --no-fund", "node build.mjs"]
    assert len(said) == 2
    assert build_page(said.append, checkout) == built_page
    assert len(programs) == 2
    viewer = checkout / page.VIEWER
    made = (built_page, viewer / "node_modules" / ".package-lock.json")
    for name in ("tools/js/mcz.js", f"{page.VIEWER}/src/main.js"):
        for path in made:
            set_mtime(path, 200)
        set_mtime(checkout / name, 300)
        programs.clear()
        build_page(said.append, checkout)
        assert programs == ["node build.mjs"]
        set_mtime(checkout / name, 100)
    set_mtime(viewer / "package-lock.json", 2**32)  # the one thing that what was fetched depends on
    programs.clear()
    build_page(said.append, checkout)
    assert programs == ["npm ci --no-audit --no-fund", "node build.mjs"]


def test_without_npm_the_command_is_said(
    checkout: Path, programs: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(AccessError, match=r"\(cd tools/viewer && npm ci && npm run build\)"):
        build_page(lambda line: None, checkout)
    built_page = checkout / page.VIEWER / "dist" / "viewer.html"
    built_page.parent.mkdir()
    built_page.write_bytes(PAGE.read_bytes())
    set_mtime(built_page, 50)
    said: list[str] = []
    assert build_page(said.append, checkout) == built_page
    assert "older than its sources" in said[0]
    assert not programs


def test_an_installation_without_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(AccessError, match="its wheel was built without"):
        build_page(lambda line: None, tmp_path)


def test_a_build_that_fails_says_why(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(words: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        return subprocess.CompletedProcess(words, 1, b"", b"no network\n")

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}")
    with pytest.raises(AccessError, match="npm ci --no-audit --no-fund in .* said: no network"):
        build_page(lambda line: None, checkout)


@pytest.mark.parametrize("has_page", [True, False])
def test_a_wheel_has_the_page_unless_told(
    tmp_path: Path, has_page: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a package of a few modules in place of ours, and the real hook and settings."""
    monkeypatch.delenv("MCZ_BUILD_WITHOUT_VIEWER", raising=False)
    monkeypatch.setenv("MCZ_BUILD", "interpreted")
    wheel = pytest.importorskip("hatchling.builders.wheel")
    sdist = pytest.importorskip("hatchling.builders.sdist")
    for name in ("pyproject.toml", "README.md", "LICENSE", "tools/build_hook.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(ROOT / "mcz" / "show" / "viewing", tmp_path / "mcz" / "show" / "viewing")
    for name in ("__init__.py", "errors.py"):
        (tmp_path / "mcz" / name).write_bytes((ROOT / "mcz" / name).read_bytes())
    if has_page:
        (tmp_path / "tools/viewer/dist").mkdir(parents=True)
        shutil.copy(PAGE, tmp_path / "tools/viewer/dist/viewer.html")
    else:
        for builder in (wheel.WheelBuilder, sdist.SdistBuilder):
            with pytest.raises(SystemExit, match="npm run build"):
                list(builder(str(tmp_path)).build(directory=str(tmp_path / "out")))
        monkeypatch.setenv("MCZ_BUILD_WITHOUT_VIEWER", "1")
    (whl,) = wheel.WheelBuilder(str(tmp_path)).build(directory=str(tmp_path / "out"))
    with zipfile.ZipFile(whl) as archive:
        names = archive.namelist()
        assert ("mcz/show/viewing/viewer.html" in names) == has_page
        assert not [name for name in names if name.startswith("tools")]
        if has_page:
            assert archive.read("mcz/show/viewing/viewer.html") == PAGE.read_bytes()
    (tar,) = sdist.SdistBuilder(str(tmp_path)).build(directory=str(tmp_path / "out"))
    with tarfile.open(tar) as source:
        held = [
            name for name in source.getnames() if name.endswith("tools/viewer/dist/viewer.html")
        ]
        assert bool(held) == has_page


def test_an_installed_page_is_found(tmp_path: Path) -> None:
    """An unpacked wheel has its page, without the repository around it."""
    shutil.copytree(ROOT / "mcz", tmp_path / "mcz", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PAGE, tmp_path / "mcz" / "show" / "viewing" / "viewer.html")
    code = "from mcz.show.viewing.page import page; print(page().policy)"
    environment = {k: v for k, v in os.environ.items() if k != "MCZ_VIEWER_PAGE"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(tmp_path)},
    )
    assert re.match("default-src 'none'", done.stdout)
