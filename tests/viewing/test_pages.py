"""Pages that hold files: what is in them, what may not be, and what the decoder needs."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

import mcz
from mcz.codecs import CODECS
from mcz.model.extras import annex_bytes
from mcz.show.viewing.page import TABLES, element, page, tables_for
from tests.commands import run
from tests.motions import smooth

ROOT = Path(mcz.__file__).parents[1]
Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    def call(*arguments: object) -> tuple[int, str, str]:
        code = int(run("view", *map(str, arguments)))
        return code, *capsys.readouterr()

    return call


class Parsed(HTMLParser):
    """The elements of a page, and what its embedded document says."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.policy = self.document = ""
        self._within = False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        given = dict(attrs)
        if given.get("http-equiv") == "Content-Security-Policy":
            self.policy = given["content"] or ""
        self._within = given == {"type": "application/json", "id": "embedded"}

    def handle_data(self, data: str) -> None:
        if self._within:
            self.document += data

    def handle_endtag(self, tag: str) -> None:
        self._within = False


def embedded_data(path: Path) -> dict:
    """Data embedded in a page, the rest of which must be unchanged."""
    text = path.read_text("utf-8")
    found = Parsed(text)
    assert found.policy == page().policy
    assert found.tags == [*Parsed(page().text).tags[:-1], "script", "script"]
    document = json.loads(found.document)
    assert text == page().before + element(document) + page().after
    return document


def files_of(document: dict) -> list[mcz.File]:
    return [mcz.open(base64.b64decode(file["base64"])) for file in document["files"]]


def test_a_source_is_held_without_loss(samples: Path, tmp_path: Path, call: Call) -> None:
    out = tmp_path / "take.html"
    code, printed, errors = call(samples / "walk.bvh", "-o", out)
    assert (code, errors) == (0, "")
    document = embedded_data(out)
    (file,) = files_of(document)
    assert document["files"][0]["name"] == "walk.bvh"
    assert file["walk"].source_bytes() == (samples / "walk.bvh").read_bytes()
    assert f"{out.stat().st_size:,} bytes, the player {len(page().text):,} of them" in printed
    assert f"walk.bvh: 1 clip, {file.size:,} bytes" in printed
    assert "diffs" not in document
    assert document["annex"].keys() == {"words.bin"}
    for name, text in document["annex"].items():
        assert zlib.decompress(base64.b64decode(text), -15) == annex_bytes(name)


def test_an_mcz_is_held_as_it_is(samples: Path, tmp_path: Path, call: Call) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz")
    damaged = bytearray((tmp_path / "a.mcz").read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "b.mcz").write_bytes(damaged[:-100])
    assert call(tmp_path / "a.mcz", tmp_path / "b.mcz", "-o", tmp_path / "x.html")[0] == 0
    document = embedded_data(tmp_path / "x.html")
    held = [base64.b64decode(file["base64"]) for file in document["files"]]
    assert held == [(tmp_path / "a.mcz").read_bytes(), bytes(damaged[:-100])]
    (found,) = document["diffs"]
    assert found["clips"] or found["notes"]
    assert "diff" not in document


def test_clips_are_copied(samples: Path, tmp_path: Path, call: Call) -> None:
    mcz.pack(samples, tmp_path / "all.mcz")
    with mcz.open(tmp_path / "all.mcz") as file:
        names = list(file.clips)
    out = tmp_path / "x.html"
    assert call(tmp_path / "all.mcz", "-o", out, "--clip", names[1])[0] == 0
    (one,) = files_of(embedded_data(out))
    assert list(one.clips) == [names[1]]
    words = ("-o", out, "--force", "--where", "source.format == 'c3d'")
    assert call(tmp_path / "all.mcz", *words)[0] in (0, 2)
    code, _, errors = call(tmp_path / "all.mcz", "-o", out, "--force", "--clip", "none")
    assert (code, "none" in errors) == (2, True)
    assert list(files_of(embedded_data(out))[0].clips)  # the page that was there still is


def test_a_codec_makes_it_small_and_says_how_far_it_is(
    samples: Path, tmp_path: Path, call: Call
) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz", unit="cm")
    words = ("--codec", "mrdwt", "--param", "T_g=4", "-o", tmp_path / "x.html", "--json")
    code, printed, _ = call(tmp_path / "a.mcz", *words)
    assert code == 0
    (file,) = files_of(embedded_data(tmp_path / "x.html"))
    assert file["walk"].codec == "mrdwt"
    assert file["walk"].quality["param.T_g"] == "4.0"
    document = json.loads(printed)
    assert document["size"] == (tmp_path / "x.html").stat().st_size
    assert document["files"] == [{"name": "a.mcz", "size": file.size, "n_clips": 1}]
    held = embedded_data(tmp_path / "x.html")["files"][0]["base64"]
    (tmp_path / "b.mcz").write_bytes(base64.b64decode(held))
    assert call(tmp_path / "a.mcz", tmp_path / "b.mcz", "-o", tmp_path / "y.html")[0] == 0
    (difference,) = embedded_data(tmp_path / "y.html")["diffs"]
    assert (difference["a"], difference["b"]) == ("a.mcz", "b.mcz")
    (clip,) = difference["clips"]
    record = float(file["walk"].quality["mean_position_error_cm"])
    assert clip["mean_position_error_cm"] == pytest.approx(record)


def test_a_page_tells_what_an_mcz_does_not_say(samples: Path, tmp_path: Path, call: Call) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz")  # which says no unit
    words = (tmp_path / "a.mcz", samples / "walk.bvh", "--unit", "mm", "--up", "z")
    code, _, errors = call(*words, "-o", tmp_path / "x.html")
    assert (code, errors.count("\n")) == (0, 1)
    assert "a.mcz: copied unchanged, without the given unit, up" in errors
    document = embedded_data(tmp_path / "x.html")
    assert document["diffs"][0]["clips"][0]["mean_position_error_cm"] == 0
    copied, made = files_of(document)
    assert (copied["walk"].skeleton.unit_cm, made["walk"].skeleton.unit_cm) == (None, 0.1)
    code, _, errors = call(*words, "-o", tmp_path / "y.html", "--effort", "fast")
    assert (code, errors) == (0, "")
    for file in files_of(embedded_data(tmp_path / "y.html")):
        assert (file["walk"].skeleton.unit_cm, file["walk"].skeleton.up_axis) == (0.1, "z")


def test_the_limit_of_decoded_bytes_holds_for_pages(
    samples: Path, tmp_path: Path, call: Call
) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "a.mcz")
    words = (tmp_path / "a.mcz", tmp_path / "a.mcz", "-o", tmp_path / "x.html", "--force")
    for limit, is_enough in (("10M", True), ("10k", False)):
        assert call(*words, "--max-decoded", limit)[0] == 0
        (found,) = embedded_data(tmp_path / "x.html")["diffs"]
        assert bool(found["clips"]) == is_enough
        assert ("--max-decoded" in " ".join(found["notes"])) != is_enough


def test_a_page_that_is_too_large_is_not_written(samples: Path, tmp_path: Path, call: Call) -> None:
    out = tmp_path / "x.html"
    out.write_bytes(b"mine")
    for words in (("--max-size", 15000), ("--max-size", 500)):
        code, _, errors = call(samples / "walk.bvh", "-o", out, "--force", *words)
        assert code == 1
        assert "allow more bytes (--max-size)" in errors
        assert out.read_bytes() == b"mine"
    code, _, errors = call(samples / "walk.bvh", "-o", out)
    assert (code, "--force" in errors) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == ["x.html"]


@pytest.mark.parametrize(
    "name", ["</script><script>alert(1)</script>", "<!--<script>", "]]>", "\u2028\u0000&lt;"]
)
def test_no_text_of_a_file_becomes_markup(name: str, tmp_path: Path, call: Call) -> None:
    document = {"files": [{"name": name, "base64": ""}], name: name}
    text = page().before + element(document) + page().after
    found = Parsed(text)
    assert json.loads(found.document) == document
    assert found.tags.count("script") == 2
    assert "<" not in element(document)[len("<script") : -len("</script>")]
    safe = re.sub(r"[/\0]", "_", name)
    mcz.write(smooth(4, name=name.replace("\0", "")), tmp_path / f"{safe}.mcz")
    assert call(tmp_path / f"{safe}.mcz", "-o", tmp_path / "x.html")[0] == 0
    assert embedded_data(tmp_path / "x.html")["files"][0]["name"] == f"{safe}.mcz"


# Tables --------------------------------------------------------------------------


def test_every_codec_has_its_tables() -> None:
    assert TABLES.keys() == CODECS.keys()
    for names in TABLES.values():
        for name in names:
            assert annex_bytes(name)


def test_what_a_codec_needs_is_there(tmp_path: Path) -> None:
    """The second decoder reads a file of every codec with the tables that a page would hold."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node")
    from mcz.show.viewing.page import deflate_annexes

    motion = smooth(40)
    documents = []
    for number, name in enumerate(CODECS):
        mcz.write(motion, tmp_path / "a.mcz", name, force=True)
        data = (tmp_path / "a.mcz").read_bytes()
        with mcz.open(data) as file:
            tables = deflate_annexes(tables_for(file))
        document = {"files": [{"base64": base64.b64encode(data).decode()}], "annex": tables}
        documents.append(tmp_path / f"{number}.json")
        documents[-1].write_text(json.dumps(document))
    script = ROOT / "tests" / "viewing" / "decode_page.mjs"
    done = subprocess.run(
        [node, str(script), *map(str, documents)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["40"] * len(documents)
