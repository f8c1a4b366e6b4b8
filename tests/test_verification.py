"""The quick check finds what is damaged, whatever it is; a report says what was checked."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing, suppress
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from conformance.manifest import VECTORS, load
from mcz import codecs
from mcz.container.chunks import FOOT, build_foot
from mcz.container.index import index_content
from mcz.container.source import lock, open_source
from mcz.errors import UnsupportedError
from mcz.files.reading.faults import ChecksumReport, check_checksums
from tests import live_codec
from tests.commands import Call
from tests.motions import skeleton, smooth, write_bytes

DATE = "2026-11-24"


def archive() -> bytes:
    """A clip in chunks."""
    return write_bytes(smooth(12), "raw")


def live() -> bytes:
    """A clip in packets, of a segment and of a frame."""
    out = BytesIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(codecs.CODECS, live_codec.CODEC.name, live_codec.CODEC)
        with mcz.LiveWriter(out, skeleton(), "stairs", frame_rate=Fraction(120)) as writer:
            for row in smooth(20).signals[0].values.round(2):
                writer.push(row)
    return out.getvalue()


@pytest.fixture(scope="module")
def archive_path(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("packed")
    for name in ("walk.asf", "walk.amc", "walk.bvh"):
        (folder / "in" / "sub").mkdir(parents=True, exist_ok=True)
        (folder / "in" / name).write_bytes((samples / name).read_bytes())
    (folder / "in" / "sub" / "walk.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    (folder / "in" / "notes.txt").write_text("left foot first\n")
    mcz.pack(folder / "in", folder / "all.mcz", rate=120, keep_all=True)
    return folder / "all.mcz"


def run_check(target: Any, progress: Callable[[int, int], object] | None = None) -> ChecksumReport:
    with closing(open_source(target)) as source:
        return check_checksums(source, progress)


# The quick check -----------------------------------------------------------------


def test_sound_vectors_pass() -> None:
    """All but those that need another reader."""
    for vector in load()["vectors"]:
        if vector["group"] == "invalid":
            continue
        try:
            assert mcz.verify(VECTORS / vector["file"], quick=True) == [], vector["file"]
        except UnsupportedError:
            assert vector["group"] == "uncommon"


@pytest.mark.parametrize("data", [archive(), live()], ids=["closed", "open"])
def test_every_flipped_bit_is_found(data: bytes) -> None:
    assert mcz.verify(data, quick=True) == []
    for at in range(len(data)):
        bad = bytearray(data)
        bad[at] ^= 1 << at % 8
        assert mcz.verify(bytes(bad), quick=True), at


def test_all_faults_are_named(archive_path: Path) -> None:
    data = bytearray(archive_path.read_bytes())
    with mcz.open(archive_path) as file:
        rows = [clip.clip for clip in file.container.directory.clips.values()]
        cends = [clip.cend for clip in file.container.directory.clips.values()]
    data[rows[0].offset + 9] ^= 1  # a header, behind which the walk finds its way again
    data[cends[1].payload_offset] ^= 1  # a payload
    problems = mcz.verify(bytes(data), quick=True)
    assert [(problem.offset, problem.heading) for problem in problems] == [
        (rows[0].offset, "CLIP"),
        (cends[1].offset, "CEND"),
    ]


def test_damaged_packets_are_named() -> None:
    """The first of each open DATA: where that one ends, its own bytes tell."""
    data = live()
    with mcz.open(data) as file:
        (clip,) = file.container.directory.clips.values()
        rows = [row for row in clip.segments if row.size]
    bad = bytearray(data)
    for row in (rows[1], rows[-1]):
        bad[row.offset] ^= 1
    problems = mcz.verify(bytes(bad), quick=True)
    assert len(problems) == 2
    assert all("crc of packet" in problem.message for problem in problems)


def test_an_index_of_another_file_is_found(archive_path: Path) -> None:
    """Its checksum is right, what it says is not."""
    from mcz.container.index import build_index

    data = archive_path.read_bytes()
    with mcz.open(archive_path) as file:
        directory = file.container.directory
        offset = directory.indexes[-1].chunk.offset
        assert index_content(directory)
        for change in ("shared", "attachments", "aliases", "clips"):
            table = getattr(directory, change).copy()
            table.pop(next(iter(table)))
            index = build_index(_with(directory, change, table))
            bad = data[:offset] + index + build_foot(offset, len(index))
            (problem,) = mcz.verify(bad, quick=True)
            assert problem.heading == "INDX"
            assert "it lists" in problem.message
    foot_at_0 = data[: -FOOT.size] + build_foot(0, 0)
    (problem,) = mcz.verify(foot_at_0, quick=True)
    assert "the index is at" in problem.message


def _with(directory: object, name: str, table: dict) -> object:
    from dataclasses import replace

    return replace(directory, **{name: table}, indexes=())


def test_blocks_end_anywhere(archive_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The block size bounds memory and does not change the findings."""
    from mcz.container import parser

    open_ones = live()
    whole = run_check(archive_path), run_check(open_ones)
    monkeypatch.setattr(parser, "BLOCK", 70_000)  # a packet may have 64 KiB
    assert (run_check(archive_path), run_check(open_ones)) == whole
    assert whole[0].indexed
    assert whole[1].n_packets == 20


def test_a_file_that_grows_is_checked_up_to_its_end(archive_path: Path, tmp_path: Path) -> None:
    path = tmp_path / "grows.mcz"
    path.write_bytes(archive_path.read_bytes() + b"SKEL")
    assert mcz.verify(path, quick=True)
    with path.open("r+b") as writer:
        assert lock(writer)
        with closing(open_source(path)) as source:
            grows = source.grows()
        if grows:  # not every system can tell
            assert mcz.verify(path, quick=True) == []


@given(st.sampled_from([archive(), live()]), st.data())
def test_damage_of_any_sort_is_a_problem(data: bytes, draw: st.DataObject) -> None:
    """Bytes cut out and put in: never another exception, never a file that passes."""
    at = draw.draw(st.integers(0, len(data)))
    stop = draw.draw(st.integers(at, len(data)))
    bad = data[:at] + draw.draw(st.binary(max_size=40)) + data[stop:]
    with suppress(UnsupportedError):
        assert bool(mcz.verify(bad, quick=True)) == (bad != data)


def test_quick_takes_no_part(archive_path: Path, call: Call) -> None:
    with pytest.raises(
        mcz.OptionError, match="a quick check covers the whole file, so where is not allowed"
    ):
        mcz.verify(archive_path, quick=True, where="n_frames > 1")
    assert call("verify", archive_path, "--quick", "--where", "n_frames > 1")[0] == 2
    assert call("verify", archive_path, "--quick", "--source", archive_path)[0] == 2


def test_parts_with_recovery_data_are_counted(archive_path: Path, call: Call) -> None:
    mcz.protect(archive_path)
    mcz.set_metadata(archive_path, {"": {"contact": "lab@example.org"}})
    code, out, _ = call("verify", archive_path)
    assert code == 0 and out.endswith(", 2 parts with recovery data\n")


def test_the_command_says_what_was_not_checked(
    archive_path: Path, tmp_path: Path, call: Call
) -> None:
    code, out, errors = call("verify", archive_path, "--quick")
    assert (code, errors) == (0, "")
    assert "values and sources were not checked" in out
    seen: list[int] = []
    run_check(archive_path, lambda done, total: seen.append(done))
    assert seen[-1] == archive_path.stat().st_size
    bad = bytearray(archive_path.read_bytes())
    bad[len(bad) // 2] ^= 1
    (tmp_path / "bad.mcz").write_bytes(bad)
    code, out, errors = call("verify", tmp_path / "bad.mcz", "--quick")
    assert (code, out) == (3, "")
    assert errors.startswith(f"mcz: {tmp_path / 'bad.mcz'}: checksums: at ")


# Reports -------------------------------------------------------------------------


def test_a_report_lists_what_was_verified(archive_path: Path, tmp_path: Path, call: Call) -> None:
    import hashlib

    path = tmp_path / "report.json"
    words = ("verify", archive_path, "--report", path, "--date", "none")
    assert call(*words)[0] == 0
    first = path.read_bytes()
    document = json.loads(first)
    assert document["verified"] and document["mode"] == "full" and document["date"] is None
    assert document["sha256"] == hashlib.sha256(archive_path.read_bytes()).hexdigest()
    assert document["totals"]["files"] == 5
    assert document["totals"]["files_bytes"] == sum(
        file.stat().st_size for file in (archive_path.parent / "in").rglob("*.*") if file.is_file()
    )
    clip = next(row for row in document["clips"] if row["source_path"] == "walk.amc")
    amc = (archive_path.parent / "in" / "walk.amc").read_bytes()
    assert clip["source_sha256"] == hashlib.sha256(amc).hexdigest()
    assert {row["result"] for row in (*document["clips"], *document["attachments"])} == {"verified"}
    assert call(*words)[0] == 2  # a report is not overwritten
    assert call(*words, "--force")[0] == 0
    assert call("verify", archive_path, "--report", tmp_path / "now.json")[0] == 0
    assert json.loads((tmp_path / "now.json").read_bytes())["date"].endswith("Z")
    assert path.read_bytes() == first
    assert call("verify", archive_path, "--report", tmp_path / "report.pdf")[0] == 2
    assert call("verify", archive_path, "--report", f"{archive_path}", "--force")[0] == 2
    assert call("verify", archive_path, "--date", "none")[0] == 2


@pytest.mark.parametrize("quick", [[], ["--quick"]])
@pytest.mark.parametrize("damage", ["none", "one clip", "no end"])
def test_a_report_says_what_is_wrong(
    archive_path: Path, tmp_path: Path, call: Call, quick: list[str], damage: str
) -> None:
    data = bytearray(archive_path.read_bytes())
    with mcz.open(archive_path) as file:
        at = next(iter(file.container.directory.clips.values())).segments[0].offset
    if damage == "one clip":
        data[at + 40] ^= 1
    (tmp_path / "a.mcz").write_bytes(data[:-40] if damage == "no end" else data)
    for suffix in ("json", "txt"):
        report = tmp_path / f"r.{suffix}"
        code = call("verify", tmp_path / "a.mcz", "--report", report, "--date", DATE, *quick)[0]
        assert code == (0 if damage == "none" else 3)
    document = json.loads((tmp_path / "r.json").read_bytes())
    text = (tmp_path / "r.txt").read_text("utf-8")
    assert document["verified"] == (damage == "none") == (not document["problems"])
    assert (": VERIFIED" in text) == (damage == "none")
    assert document["date"] == DATE and DATE in text
    assert all(row["source_sha256"] in text for row in document["clips"])
    assert all(problem in text for problem in document["problems"])
    results = [row["result"] for row in document["clips"]]
    if damage == "no end":
        assert quick or (results == [] and "cannot be opened" in text)
    elif quick:
        assert set(results) == {"not decoded"}
    else:
        assert results.count("damaged") == (damage == "one clip")


def test_a_report_of_some_clips_says_so(archive_path: Path, tmp_path: Path, call: Call) -> None:
    path = tmp_path / "r.json"
    code, _, _ = call("verify", archive_path, "--where", "format == 'bvh'", "--report", path)
    document = json.loads(path.read_bytes())
    assert code == 0
    assert sorted(row["result"] for row in document["clips"]) == ["not decoded", "verified"]
    assert document["not_checked"]
