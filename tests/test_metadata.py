"""META: what is said of clips behind them."""

from __future__ import annotations

import io
import json
import os
import tempfile
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.container.chunks import Chunk
from mcz.container.metadata import (
    EXAMPLES,
    KEYS,
    TYPES,
    Record,
    apply_records,
    build_metas,
    check_pair,
    merge_records,
    parse_meta,
)
from mcz.container.writer import Writer
from mcz.files.editing.folders import nanoseconds, stamp
from mcz.files.editing.metadata_edit import from_table
from mcz.sources.sample import write_samples
from tests.commands import Call

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


def append_metadata(path: Path, *records: Record) -> Path:
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
    assert apply_records(pairs, [merge_records("", records)]) == apply_records(pairs, records)


@given(RECORDS, st.data())
def test_a_changed_payload_is_read_or_refused(records: list[Record], data: st.DataObject) -> None:
    for payload in build_metas(records):
        bad = bytearray(payload)
        at = data.draw(st.integers(0, len(bad) - 1))
        bad[at] ^= 1 << data.draw(st.integers(0, 7))
        with suppress(mcz.MczError):
            parse_meta(bytes(bad), CHUNK, 0)


def test_a_long_value_that_deflates_well_is_read_again(archive: Path) -> None:
    text = "a note. " * 20_000  # longer than twice the file  (LIMIT-17)
    mcz.set_metadata(archive, {"": {"x-note": text}, "walk": {"description": text}})
    assert mcz.verify(archive) == []
    found = metadata(archive)
    assert (found[""]["x-note"], found["walk"]["description"]) == (text, text)
    mcz.delete_clips(archive, ["walk.c3d"])
    assert metadata(archive)["walk"]["description"] == text


def test_the_last_one_wins(archive: Path) -> None:
    append_metadata(
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


def test_a_key_that_is_said_behind_costs_one_read(archive: Path) -> None:
    """However many clips there are: no CLIP is read where a META has the last word."""
    with mcz.open(archive) as file:
        names = list(file.clips)
    append_metadata(archive, *(Record(name, {"subject": "05", "x-mood": "good"}) for name in names))
    append_metadata(archive, Record("walk", {}, ("subject",)))
    with mcz.open(archive) as file:
        source = file.container.source
        before = source.n_requests
        found = file.find("subject == '05' and x-mood == 'good'")
        assert [clip.name for clip in found] == [name for name in names if name != "walk"]
        assert source.n_requests - before == len(names) + 1  # the METAs
        assert all("_fields" not in vars(clip) for clip in file)


def test_it_goes_along(archive: Path, tmp_path: Path) -> None:
    append_metadata(
        archive, Record("walk", {"subject": "05"}), Record("walk.c3d", {"subject": "Ada"})
    )
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
    append_metadata(
        archive, Record("walk", {"subject": "Ada Lovelace", "contact": "ada@example.org"})
    )
    assert b"Ada" in archive.read_bytes() or b"ada@" in archive.read_bytes()
    mcz.delete_clips(archive, "walk")
    assert b"Ada" not in archive.read_bytes()
    assert b"ada@" not in archive.read_bytes()
    assert mcz.verify(archive) == []


# The registry, tables, lists ----------------------------------------------------


def test_types_are_those_of_the_registry() -> None:
    rows = json.loads((Path(mcz.__file__).parent / "annex" / "registry.json").read_text("utf-8"))
    assert {row["key"]: row["type"] for row in rows["metadata_keys"]} == KEYS
    assert {row["type"] for row in rows["metadata_keys"]} <= TYPES.keys()
    assert TYPES.keys() - {"text"} == EXAMPLES.keys()


GOOD = {
    "date": ("2014", "2014-05", "2014-02-28"),
    "time": ("2014-05-21T14:30", "2014-05-21T14:30:00Z", "2014-05-21T14:30:00.123456789+02:00"),
    "licence": ("CC-BY-4.0", "MIT OR (Apache-2.0 AND GPL-2.0+)", "LicenseRef-ours"),
    "doi": ("10.1000/182",),
    "subject": ("", "Åsa"),
    "x-mood": ("any",),
}
BAD = {
    "date": ("2003-13", "2014-02-30", "21.5.2014", ""),
    "time": ("2014-05-21", "14:30", "2014-05-21T25:00"),
    "licence": ("CC BY 4.0", ""),
    "doi": ("https://doi.org/10.1000/182", "10.1/x"),
    "x-": ("y",),
    "sbject": ("05",),
    "name-encoding": ("1",),
}


@pytest.mark.parametrize("key", GOOD)
def test_good_values(key: str) -> None:
    for value in GOOD[key]:
        check_pair(key, value)


@pytest.mark.parametrize("key", BAD)
def test_bad_values(key: str) -> None:
    for value in BAD[key]:
        with pytest.raises(mcz.OptionError, match=key):
            check_pair(key, value)


def test_nothing_is_written_where_nothing_changes(archive: Path) -> None:
    mcz.set_metadata(archive, {"walk": {"subject": "05"}})
    before = archive.read_bytes()
    assert mcz.set_metadata(archive, {"walk": {"subject": "05", "place": None}}).outcomes == []
    assert archive.read_bytes() == before
    with pytest.raises(mcz.OptionError, match="no clip"):
        mcz.set_metadata(archive, {"wlak": {"subject": "05"}})
    with pytest.raises(mcz.OptionError, match="did you mean 'subject'"):
        mcz.set_metadata(archive, {"walk": {"sbject": "05"}})
    assert archive.read_bytes() == before
    assert mcz.verify(archive) == []


def test_a_rate_for_those_that_have_none(tmp_path: Path) -> None:
    (tmp_path / "takes").mkdir()
    write_samples(tmp_path / "takes")
    mcz.pack(tmp_path / "takes", tmp_path / "a.mcz", codec="fast")
    report = mcz.set_rate(tmp_path / "a.mcz", 120)
    assert [outcome.path for outcome in report.outcomes] == ["walk"]
    with mcz.open(tmp_path / "a.mcz") as file:
        assert file.clips["walk"].frame_rate == 120
        assert file.clips["walk"].source_bytes() == (tmp_path / "takes/walk.amc").read_bytes()
    with pytest.raises(mcz.OptionError, match="its source format states the frame rate"):
        mcz.set_rate(tmp_path / "a.mcz", 100, ["walk.bvh"], force=True)
    with pytest.raises(mcz.OptionError, match="has 120 frames a second"):
        mcz.set_rate(tmp_path / "a.mcz", 100, ["walk"])
    assert mcz.set_rate(tmp_path / "a.mcz", 100).outcomes == []
    assert mcz.verify(tmp_path / "a.mcz") == []


TABLES = {
    "commas": "name,subject,date\nwalk,05,\nwalk.c3d,06,2014\n",
    "tabs": "\ufeffclip\tsubject\tdate\r\nwalk\t05\t\r\nwalk.c3d\t06\t2014\r\n",
    "semicolons": 'path;subject;date\n"walk.amc";05;\nwalk.c3d;06;2014\n',
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(archive: Path, name: str) -> None:
    (archive.parent / "t.csv").write_bytes(TABLES[name].encode())
    with mcz.open(archive) as file:
        said, unknown = from_table(archive.parent / "t.csv", file)
    assert said == {"walk": {"subject": "05"}, "walk.c3d": {"subject": "06", "date": "2014"}}
    assert unknown == []


def test_columns_make_up_a_name(archive: Path) -> None:
    table = archive.parent / "t.csv"
    table.write_text("what,kind,fps\nwalk,bvh,120\nrun,bvh,120\n")
    with mcz.open(archive) as file:
        with pytest.raises(mcz.OptionError, match="no column is called clip, name, path, file"):
            from_table(table, file)
        with pytest.raises(mcz.OptionError, match="1 of 2 rows match no clip: run.bvh"):
            from_table(table, file, match="{what}.{kind}", take=[])
        with pytest.raises(mcz.OptionError, match="not metadata keys"):
            from_table(table, file, match="{what}.{kind}", skip_unknown=True)
        for bad in ("{what.__class__}", "{nothing}", "{what", "{what:d}"):
            with pytest.raises(mcz.OptionError):
                from_table(table, file, match=bad, take=[])
        said, unknown = from_table(table, file, match="{what}.{kind}", take=[], skip_unknown=True)
    assert (said, unknown) == ({"walk.bvh": {}}, ["run.bvh"])


def test_columns_are_keys_by_what_is_said(archive: Path) -> None:
    table = archive.parent / "t.csv"
    table.write_text("Trial #,What they do,date\n,a walk,2014\n")
    take = ["description=What they do", "date"]
    with mcz.open(archive) as file:
        said, _ = from_table(table, file, match="walk{Trial #}", take=take)
        assert said == {"walk": {"description": "a walk", "date": "2014"}}
        with pytest.raises(mcz.OptionError, match="no column 'What'; the columns are Trial #"):
            from_table(table, file, match="walk{Trial #}", take=["description=What"])
        with pytest.raises(mcz.OptionError, match="such as description=What they do"):
            from_table(table, file, match="walk{Trial #}")


def test_a_registered_key_that_nobody_has_is_missing_and_no_error(archive: Path) -> None:
    with mcz.open(archive) as file:
        assert file.find("subject == '05'") == []
        assert len(file.find("subject is missing")) == len(file)
        with pytest.raises(mcz.OptionError):
            file.find("sbject == '05'")


def test_times_of_files_come_back(tmp_path: Path) -> None:
    takes = tmp_path / "takes"
    takes.mkdir()
    write_samples(takes)
    os.utime(takes / "walk.bvh", ns=(0, 1_400_000_000_123_456_700))
    mcz.pack(takes, tmp_path / "a.mcz", codec="fast", mtimes=True)
    mcz.unpack(tmp_path / "a.mcz", tmp_path / "out", mtimes=True)
    assert (tmp_path / "out/walk.bvh").stat().st_mtime_ns == 1_400_000_000_123_456_700
    assert mcz.verify(tmp_path / "a.mcz") == []


@given(st.integers(-(10**9) * 10**9, 10**10 * 10**9))
def test_any_time_is_written_and_read(ns: int) -> None:
    with tempfile.NamedTemporaryFile() as file:
        os.utime(file.name, ns=(0, ns))
        path = Path(file.name)
        assert nanoseconds(stamp(path)) == path.stat().st_mtime_ns


def readable(data: bytes) -> bytes:
    """The bytes, and all that can be inflated from any of them on."""
    found = [data]
    for at in range(len(data)):
        with suppress(zlib.error):
            found.append(zlib.decompressobj(-15).decompress(data[at : at + 2000], 2000))
    return b"\n".join(found)


def check_purge(path: Path, words: list[str]) -> bytes:
    """The file without the consent of anything; ``words`` are what was said of it."""
    assert [word for word in words if word.encode() not in readable(path.read_bytes())] == []
    with mcz.open(path) as file:
        values = {clip.name: clip.read() for clip in file}
    report = mcz.set_metadata(path, {n: {"consent": None} for n in ("", *values)}, purge=True)
    after = path.read_bytes()
    assert report.size == len(after) and not list(path.parent.glob(".*"))
    left = readable(after)
    assert [word for word in ("consent", "META", "REPT", *words) if word.encode() in left] == []
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        assert all(np.array_equal(file[name].read(), old) for name, old in values.items())
    return after


def test_nothing_of_what_was_withdrawn_is_left(tmp_path: Path, samples: Path) -> None:
    """Consent in CLIP, META, COPY, recovery data and in what a live clip repeats."""
    in_clip, in_meta, of_file, of_live, last = (f"9e2b-consent-{n}" for n in range(5))
    path, live = tmp_path / "a.mcz", tmp_path / "live.mcz"
    motion = mcz.read(samples / "walk.bvh")
    pairs = {**motion.metadata, "consent": in_clip, "subject": "S-01"}
    mcz.write(replace(motion, metadata=pairs), path, copies=True)
    mcz.set_metadata(path, {"walk": {"consent": in_meta}, "": {"consent": of_file}})
    mcz.protect(path, 0.2)
    mcz.set_metadata(path, {"walk": {"consent": last, "place": "hall 4"}})
    after = check_purge(path, [in_clip, in_meta, of_file, last])
    with mcz.open(path) as file:
        clip = file.only_clip()
        found = [clip.metadata[key] for key in ("subject", "place")]
        assert found == ["S-01", "hall 4"]
        assert clip.source_bytes() == (samples / "walk.bvh").read_bytes()
    (tmp_path / "bad.mcz").write_bytes(after[:200] + bytes(60) + after[260:])
    assert mcz.repair(tmp_path / "bad.mcz", tmp_path / "good.mcz").restored
    assert (tmp_path / "good.mcz").read_bytes() == after

    options = {"params": {"gof": 4, "step": 0.5}, "metadata": {"consent": of_live}}
    live.write_bytes(b"".join(mcz.stream_encode(motion.values[:40, :6], ["a", "b"], **options)))
    assert live.read_bytes().count(of_live.encode()) > 1
    check_purge(live, [of_live])


def test_what_is_purged_may_be_said_of_the_file(archive: Path, call: Call) -> None:
    mcz.set_metadata(archive, {"": {"licence": "none", "x-id": "7"}})
    assert call("meta", archive, "--file", "--set", "licence=CC0", "--purge").code == 0
    assert metadata(archive)[""] == {"licence": "CC0", "x-id": "7"}
    size = archive.stat().st_size
    assert "purged" in call("meta", archive, "--purge").out
    assert archive.stat().st_size == size and mcz.verify(archive) == []


def described(path: Path, call: Call, *words: str) -> tuple[dict[str, Any], str]:
    code, out, errors = call("meta", str(path), "--to", *words)
    assert code == 0
    return json.loads(out), errors


def test_records_for_repositories(archive: Path, call: Call) -> None:
    """Properties come from the file, or from what all clips state alike."""
    record, errors = described(archive, call, "datacite")
    assert record["types"]["resourceTypeGeneral"] == "Dataset"
    assert [line.split("requires ")[1].split(";")[0] for line in errors.splitlines()] == [
        "creators",
        "titles",
        "publisher",
        "publicationYear",
    ]
    of_file = {"title": "Walks", "lab": "Motion Lab", "published": "2026-03", "contact": "Library"}
    with mcz.open(archive) as file:
        names = [clip.name for clip in file]
    of_clips = {
        name: {"licence": "CC-BY-4.0", "date": f"2014-05-{day}", "keywords": "gait; walk"}
        for day, name in enumerate(names, 10)
    }
    mcz.set_metadata(archive, of_clips | {"": of_file})
    record, errors = described(archive, call, "datacite")
    assert not errors
    assert record["publicationYear"] == "2026"
    assert record["rightsList"][0]["rightsIdentifier"] == "CC-BY-4.0"
    assert record["dates"] == [
        {"date": f"2014-05-10/2014-05-{9 + len(names)}", "dateType": "Collected"}
    ]
    assert [row["subject"] for row in record["subjects"]] == ["gait", "walk"]
    mcz.set_metadata(archive, {names[0]: {"licence": "CC0-1.0"}})
    crate, errors = described(archive, call, "ro-crate")
    assert "requires description" in errors and "requires license" in errors
    entities = {entity["@id"]: entity for entity in crate["@graph"]}
    assert entities["./"]["hasPart"] == [{"@id": "a.mcz"}]
    assert entities["a.mcz"]["contentSize"] == str(archive.stat().st_size)
    assert entities["#lab"]["name"] == "Motion Lab"
    clips = [entities[part["@id"]] for part in entities["a.mcz"]["hasPart"]]
    assert [clip["name"] for clip in clips] == names and clips[0]["license"] == "CC0-1.0"
    crate, _ = described(archive, call, "ro-crate", "--clip", names[1])
    assert {"@id": "https://spdx.org/licenses/CC-BY-4.0"} in [
        entity.get("license") for entity in crate["@graph"]
    ]
    assert call("meta", str(archive), "--to", "datacite", "--set", "title=x").code == 2
