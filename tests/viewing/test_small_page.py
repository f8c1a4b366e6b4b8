"""The page where the viewer was not built: a player of each clip, and the way to the viewer."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import mcz
from mcz import AccessError
from mcz.show.viewing import page
from mcz.show.viewing.file_registry import FileRegistry, add_path
from mcz.show.viewing.page import build_page
from mcz.show.viewing.player import MOST_CLIPS, viewer_page
from mcz.show.viewing.server import Server
from tests.viewing.asking import ask


@pytest.fixture
def without_npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A source checkout in which the page was never built, on a machine without npm."""
    (tmp_path / page.VIEWER).mkdir(parents=True)
    (tmp_path / page.VIEWER / "build.mjs").touch()
    monkeypatch.delenv(page.OTHER, raising=False)
    monkeypatch.setattr(page, "build_page", lambda say: build_page(say, tmp_path))
    monkeypatch.setattr(shutil, "which", lambda name: None)


def test_it_plays_every_clip_and_names_the_way_to_the_viewer(
    samples: Path, tmp_path: Path, without_npm: None
) -> None:
    damaged = tmp_path / "<b>.bvh"
    damaged.write_bytes((samples / "walk.bvh").read_bytes()[:300])
    told: list[str] = []
    registry = FileRegistry({}, told.append)
    for path in (samples / "walk.bvh", samples / "walk.c3d", damaged):
        add_path(registry, str(path))
    with Server(viewer_page(registry), registry) as server:
        answer = ask(server, "")
    text = answer.body.decode()
    assert answer.status == 200
    assert text.count("<iframe ") == 2
    assert re.findall("<h2>(.*)</h2>", text) == ["walk.bvh", "walk.c3d", "&lt;b&gt;.bvh"]
    assert "<pre>" in text
    assert "npm run build" in text
    assert "npm run build" in told[0]
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


def test_a_large_archive_shows_its_first_clips(
    samples: Path, tmp_path: Path, without_npm: None
) -> None:
    text = (samples / "walk.bvh").read_text()
    for number in range(MOST_CLIPS + 1):
        (tmp_path / f"{number}.bvh").write_text(text.replace("OFFSET 0", f"OFFSET {number}", 1))
    mcz.pack(tmp_path, tmp_path / "takes.mcz")
    registry = FileRegistry()
    add_path(registry, str(tmp_path / "takes.mcz"))
    page_text = viewer_page(registry).text
    assert page_text.count("<iframe ") == MOST_CLIPS
    assert f"The first {MOST_CLIPS} clips are shown." in page_text


def test_a_page_that_the_environment_names_is_not_replaced(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(page.OTHER, str(tmp_path / "none.html"))
    registry = FileRegistry()
    add_path(registry, str(samples / "walk.bvh"))
    with pytest.raises(AccessError, match=r"none\.html"):
        viewer_page(registry)
