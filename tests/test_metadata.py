"""META: what is said of clips behind them."""

from __future__ import annotations

import io
import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.container.chunks import Chunk
from mcz.container.metadata import Record, applied, as_one, build_metas, parse_meta
from mcz.container.writer import Writer
from mcz.sample import write_samples

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
RECORDS = st.lists(
    st.builds(Record, TEXTS, st.dictionaries(TEXTS, TEXTS, max_size=3), st.sets(TEXTS).map(tuple)),
    max_size=5,
)
CHUNK = Chunk(b"META", 3, 0, 0)


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    (tmp_path / "takes").mkdir()
    write_samples(tmp_path / "takes")
    mcz.pack(tmp_path / "takes", tmp_path / "a.mcz", codec="fast", rate=120)
    return tmp_path / "a.mcz"


def said(path: Path, *records: Record) -> Path:
    """The file, to which these are appended, each in a META and a body of its own."""
    for record in records:
        with mcz.open(path) as file:
            sink = io.BytesIO(path.read_bytes())
            sink.seek(0, os.SEEK_END)
            writer = Writer(sink, directory=file.container.directory, offset=file.size)
        writer.metadata([record])
        writer.finish()
        path.write_bytes(sink.getvalue())
    assert mcz.verify(path) == []
    return path


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with mcz.open(path) as file:
        said = {"": file.metadata} | {clip.name: clip.metadata for clip in file}
    notes = "skeleton-note", "source-note"
    return {
        name: {k: v for k, v in pairs.items() if k not in notes} for name, pairs in said.items()
    }


@given(RECORDS)
def test_what_is_written_is_read(records: list[Record]) -> None:
    found = [r for payload in build_metas(records) for r in parse_meta(payload, CHUNK, 0)]
    assert found == records
    short = [r for p in build_metas(records, short=True) for r in parse_meta(p, CHUNK, 0)]
    assert short == records


@given(RECORDS, st.dictionaries(TEXTS, TEXTS, max_size=3))
def test_one_record_says_what_many_say(records: list[Record], pairs: dict[str, str]) -> None:
    assert applied(pairs, [as_one("", records)]) == applied(pairs, records)


@given(RECORDS, st.data())
def test_a_changed_payload_is_read_or_refused(records: list[Record], data: st.DataObject) -> None:
    for payload in build_metas(records):
        bad = bytearray(payload)
        at = data.draw(st.integers(0, len(bad) - 1))
        bad[at] ^= 1 << data.draw(st.integers(0, 7))
        with suppress(mcz.MczError):
            parse_meta(bytes(bad), CHUNK, 0)


def test_the_last_one_wins(archive: Path) -> None:
    said(
        archive,
        Record("walk", {"subject": "05", "place": "lab"}),
        Record("walk", {"subject": "06"}, ("place",)),
        Record("nobody", {"subject": "07"}),
        Record("", {"rights": "CC-BY-4.0"}),
    )
    found = metadata(archive)
    assert found["walk"] == {"subject": "06"}
    assert found[""] == {"rights": "CC-BY-4.0"}
    assert "subject" not in found["walk.bvh"]


def test_what_readers_interpret_is_not_said_behind(archive: Path) -> None:
    before = archive.read_bytes()
    with pytest.raises(AssertionError):
        said(archive, Record("walk", {"frame-numbers": "9"}))
    with mcz.open(archive) as file, pytest.raises(mcz.FormatError, match="frame-numbers"):
        _ = file.clips["walk"].metadata
    assert archive.read_bytes()[: len(before)] == before


def test_it_goes_along(archive: Path, tmp_path: Path) -> None:
    said(archive, Record("walk", {"subject": "05"}), Record("walk.c3d", {"subject": "Ada"}))
    mcz.rename_clips(archive, {"walk": "first"})
    assert metadata(archive)["first"] == {"subject": "05"}
    assert mcz.extract(archive, tmp_path / "b.mcz", clip="first", frames=(0, 9)).clips
    assert metadata(tmp_path / "b.mcz")["first"]["subject"] == "05"
    assert b"Ada" not in (tmp_path / "b.mcz").read_bytes()
    mcz.split(archive, tmp_path / "parts", by="name", rest="rest")
    assert metadata(tmp_path / "parts" / "walk.c3d.mcz")["walk.c3d"]["subject"] == "Ada"
    mcz.merge([archive, tmp_path / "parts" / "first.mcz"], tmp_path / "c.mcz", rename=True)
    assert metadata(tmp_path / "c.mcz")["first/first"] == {"subject": "05"}
    mcz.repair(archive, tmp_path / "d.mcz")
    assert metadata(tmp_path / "d.mcz") == metadata(archive)


def test_what_is_said_of_a_deleted_clip_is_gone(archive: Path) -> None:
    said(archive, Record("walk", {"subject": "Ada Lovelace", "contact": "ada@example.org"}))
    assert b"Ada" in archive.read_bytes() or b"ada@" in archive.read_bytes()
    mcz.delete_clips(archive, "walk")
    assert b"Ada" not in archive.read_bytes()
    assert b"ada@" not in archive.read_bytes()
    assert mcz.verify(archive) == []
