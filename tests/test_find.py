"""Clips of a file found by a query: fields, metadata, ``File.find`` and its kin, ``--where``."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz import File, FormatError, OptionError
from mcz.codecs import CODECS, codec_by_name
from mcz.container.writer import Writer
from mcz.files.queries import Query
from mcz.files.reading.clips import FIELDS
from mcz.files.reading.faults import part_problems
from mcz.files.reading.report import info
from mcz.files.writing.clip_writer import write_clip
from mcz.model.schema import parse_until
from tests import live_codec
from tests.commands import Call
from tests.motions import skeleton, smooth

CLIPS = (
    ("05_01", 30, {"subject": "05", "x-session": "a", "x-name": "one"}),
    ("05_02", 60, {"subject": "05", "x-session": "b"}),
    ("16_01", 90, {"subject": "16", "rights": "CMU"}),
    ("still", 2, {}),
)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four clips, one of which says no rate, and an attachment."""
    path = tmp_path_factory.mktemp("found") / "a.mcz"
    with path.open("wb") as stream:
        writer = Writer(stream)
        for name, n_frames, metadata in CLIPS:
            rate = None if name == "still" else 120
            motion = smooth(n_frames, name=name, metadata=metadata, frame_rate=rate)
            write_clip(writer, motion, codec_by_name("raw" if n_frames > 60 else "fast"), {})
        writer.attachment("notes.txt", b"hello")
        writer.finish()
    return path


@pytest.fixture(scope="module")
def archive_path(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    """The sample files, of three formats."""
    folder = tmp_path_factory.mktemp("packed")
    mcz.pack(samples, folder / "p.mcz", rate=120)
    return folder / "p.mcz"


def find_names(path: Path, where: object) -> list[str]:
    with mcz.open(path) as file:
        return [clip.name for clip in file.find(where)]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("where", "names"),
    [
        ("n_frames >= 0", ["05_01", "05_02", "16_01", "still"]),
        ("n_frames > 1000", []),
        ("name like '05_*' and n_frames > 30", ["05_02"]),
        ("frame_rate == 120", ["05_01", "05_02", "16_01"]),
        ("frame_rate is missing", ["still"]),
        ("duration == 0.25", ["05_01"]),
        ("not duration < 0.5", ["05_02", "16_01"]),
        ("n_channels == 10 and n_joints == 4", ["05_01", "05_02", "16_01", "still"]),
        ("codec == 'raw' and lossless == true", ["16_01"]),
        ("skeleton == 'puppet' and unit_cm == 2.5 and up_axis == 'y'", [n for n, *_ in CLIPS]),
        ("source is missing and format is missing", [n for n, *_ in CLIPS]),
        ("subject == 5", ["05_01", "05_02"]),
        ("subject == '5'", []),
        ("subject != 5", ["16_01"]),
        ("subject is missing", ["still"]),
        ("subject in ('05', '16') and x-session != 'a'", ["05_02"]),
        ("x-session is missing or x-session == 'a'", ["05_01", "16_01", "still"]),
        ("metadata.rights == 'CMU'", ["16_01"]),
        (Query("subject == 16"), ["16_01"]),
        (lambda clip: clip.n_frames == 60, ["05_02"]),
    ],
)
def test_clips_are_found(archive: Path, where: object, names: list[str]) -> None:
    assert find_names(archive, where) == names


@pytest.mark.parametrize(
    ("where", "names"),
    [
        ("format == 'bvh'", ["walk.bvh"]),
        ("format == 'c3d' and source == 'walk.c3d'", ["walk.c3d"]),
        ("format in ('amc', 'c3d')", ["walk", "walk.c3d"]),
        ("skeleton == 'walk'", ["walk"]),
        ("skeleton-note is not missing", ["walk"]),
        ("up_axis is not missing", ["walk.c3d"]),
        ("unit_cm > 5", ["walk"]),
    ],
)
def test_clips_with_sources_are_found(archive_path: Path, where: str, names: list[str]) -> None:
    assert find_names(archive_path, where) == names


def test_bytes_are_those_of_info(
    archive: Path, archive_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that ``mcz info`` counts to a clip but the template, which clips may share."""
    monkeypatch.setitem(CODECS, live_codec.CODEC.name, live_codec.CODEC)
    mcz.write(smooth(300), tmp_path / "lossy.mcz", codec="mrdwt", mean_error_cm=0.1)
    with (
        (tmp_path / "live.mcz").open("wb") as out,
        mcz.LiveWriter(out, skeleton(), "stairs") as live,
    ):
        for row in smooth(100).signals[0].values:
            live.push(row)
    for path in (archive, archive_path, tmp_path / "lossy.mcz", tmp_path / "live.mcz"):
        with mcz.open(path) as file:
            for told in info(file)["clips"]:
                clip = file[told["name"]]
                parts = ("payload", "overhead", "source_chunk", "hash", "quality")
                total = sum(told[f"{part}_bytes"] for part in parts)
                shared = file.container.directory.shared
                source = clip._fields.source
                template = shared[b"SRCE", source.template].size if source else 0
                assert FIELDS["bytes"](clip) == total - template, path


def test_a_codec_that_is_unknown_is_not_called_lossless(archive: Path) -> None:
    with mcz.open(archive) as file:
        row = file.container.directory.clips["still"]
        row.signals = (replace(row.signals[0], codec=250),)
        assert [clip.name for clip in file.find("codec == 'codec 250'")] == ["still"]
        assert len(file.find("lossless == true")) == 3
        assert [clip.name for clip in file.find("lossless is missing")] == ["still"]


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("n_frame > 5", "column 1: 'n_frame' is neither a field .* did you mean 'n_frames'"),
        ("n_frames > 5 and subjct == 5", r"column 18: 'subjct' .* 'subject'\? \(n_frames"),
        ("metadata.subjct == 5", "did you mean 'metadata.subject' or 'metadata.rights'"),
        ("zzzz is missing", r"known are bytes, codec, .* x-name, x-session \(--> zzzz"),
        ("n_frames = 5", "column 10: .* write =="),
        (5, "where is 5; it must be a string or a function of a clip"),
    ],
)
def test_what_cannot_be_found(archive: Path, where: object, said: str) -> None:
    with pytest.raises(OptionError, match=said):
        find_names(archive, where)


def test_a_file_without_clips_has_none_to_find(tmp_path: Path, samples: Path) -> None:
    mcz.encode(samples / "walk.asf", tmp_path / "a.mcz")
    assert find_names(tmp_path / "a.mcz", "anything == 5") == []
    with pytest.raises(OptionError, match="column 9"):
        find_names(tmp_path / "a.mcz", "anything")
    with mcz.open(tmp_path / "a.mcz") as file:
        assert not len(file) and bool(file) and list(file) == []


def test_a_file_is_of_clips(archive: Path) -> None:
    with mcz.open(archive) as file, mcz.open(archive) as other:
        assert len(file) == 4
        assert [clip.name for clip in file] == [name for name, *_ in CLIPS]
        assert file["05_02"] is file.clips["05_02"]
        assert "05_02" in file and "nobody" not in file and 5 not in file
        assert next(iter(file)) in file and next(iter(other)) not in file
        for wrong in ("nobody", 5, None):
            with pytest.raises(OptionError, match="nobody|5|None"):
                file[wrong]  # type: ignore[index]
        assert [clip.name for clip in pickle.loads(pickle.dumps(file))] == list(file.clips)


def test_names_mean_clips_as_elsewhere(archive_path: Path) -> None:
    with mcz.open(archive_path) as file:
        assert file["walk.amc"].name == "walk"
        assert "walk.amc" in file and "walk.asf" not in file


def test_names_and_queries_together(archive: Path) -> None:
    with mcz.open(archive) as file:
        assert [c.name for c in file.select_clips()] == list(file.clips)
        assert [c.name for c in file.select_clips(["16_01", "05_01"])] == ["16_01", "05_01"]
        names = ["16_01", "05_01"]
        assert [c.name for c in file.select_clips(names, "subject == 5")] == ["05_01"]
        with pytest.raises(OptionError, match="none of 1 clip matches 'subject == 5'"):
            file.select_clips(["16_01"], "subject == 5")
        with pytest.raises(OptionError, match="none of 4 clips matches what is asked for"):
            file.select_clips(where=lambda clip: False)


def test_twenty_thousand_clips(archive: Path) -> None:
    """No clip is read where the index answers the query."""
    with mcz.open(archive) as file:
        rows = file.container.directory.clips
        row = rows.pop("05_01")
        rows.clear()
        for number in range(20_000):
            rows[f"take/{number:05}"] = replace(row, name=f"take/{number:05}", n_frames=number)
        many = File(file.container)
        calls: list[str] = []
        many.container.clip = lambda row: calls.append(row.name)  # type: ignore[assignment]
        query = "n_frames >= 100 and name like 'take/*7' and codec == 'fast' and frame_rate > 100"
        assert len(many) == 20_000
        assert len(many.find(query + " and n_channels == 10 and lossless == true")) == 1990
        assert not calls


def test_metadata_of_clips_are_read_once(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the clips are others by then, and for a key that nobody has."""
    calls: list[str] = []

    def count_parse(record: Any, payload: bytes, where: str, before: str) -> Any:
        calls.append(where)
        return parse_until(record, payload, where, before)

    monkeypatch.setattr("mcz.container.caches.parse_until", count_parse)
    for most in (2**20, 0):  # bytes that are kept
        monkeypatch.setattr("mcz.container.caches.MOST_KEPT", most)
        calls.clear()
        with mcz.open(archive) as file:
            for _ in range(2):
                file.clips._alive.clear()
                file.clips._last.clear()
                with pytest.raises(OptionError, match="neither"):
                    file.find("x-none == 1")
        assert (len(calls) == len(set(calls)) == 4) == (most > 0)


def test_damage_is_no_unknown(archive: Path) -> None:
    """A clip whose CLIP cannot be read is neither taken nor left out in silence."""
    data = bytearray(archive.read_bytes())
    with mcz.open(archive) as file:
        data[file.container.directory.clips["05_02"].clip.offset + 20] ^= 1
    with mcz.open(bytes(data)) as file:
        assert len(file.find("n_frames > 30")) == 2
        with pytest.raises(FormatError):
            file.find("subject == 5")


def test_parts_of_a_file(archive: Path, archive_path: Path, tmp_path: Path) -> None:
    done = mcz.extract(archive, tmp_path / "e.mcz", where="subject == 5", frames=(0, 10))
    assert [clip.name for clip in done.clips] == ["05_01", "05_02"]
    with mcz.open(tmp_path / "e.mcz") as file:
        assert [clip.name for clip in file.find("subject == 5")] == list(file.clips)
        assert not file.attachments
    report = mcz.unpack(archive_path, tmp_path / "out", where=lambda clip: clip.n_channels == 62)
    assert sorted(o.path for o in report.outcomes) == ["walk.amc", "walk.asf"]


@pytest.mark.real
def test_real_clips(data: Path, tmp_path: Path) -> None:
    """A search of an archive finds the clips that it holds."""
    folder = data / "cmu/c3d"
    files = sorted(folder.rglob("*.c3d"))
    mcz.pack(folder, tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        clips = file.find("format == 'c3d' and n_frames > 0 and lossless == true")
        assert len(clips) == len(files) == len(file)
        longest = max(clip.n_frames for clip in clips)
        assert file.find(f"n_frames == {longest}") == file.find(lambda c: c.n_frames == longest)
        assert file.find("n_joints != 41") == [c for c in file if c.skeleton.n_joints != 41]


# The commands


def test_list_and_info(call: Call, archive: Path) -> None:
    code, out, _ = call("list", archive, "--where", "subject == 5", "--json")
    document = json.loads(out)
    assert [clip["name"] for clip in document["clips"]] == ["05_01", "05_02"]
    assert not document["attachments"]
    code, out, _ = call("info", archive, "--where", "x-session == 'b'")
    assert code == 0 and "clip 05_02: 60 frames" in out and "05_01" not in out


def test_clip_and_where_are_both(call: Call, archive: Path) -> None:
    where = ("--where", "n_frames > 30")
    code, out, _ = call("info", archive, "--clip", "05_01", "--clip", "05_02", *where, "--json")
    assert [clip["name"] for clip in json.loads(out)["clips"]] == ["05_02"]
    code, _, err = call("info", archive, "--clip", "05_01", *where)
    assert code == 2 and "none of 1 clip matches 'n_frames > 30'" in err


def test_verify_what_is_damaged_and_what_is_not(archive: Path) -> None:
    data = bytearray(archive.read_bytes())
    with mcz.open(archive) as file:
        data[file.container.directory.clips["16_01"].segments[0].offset + 5] ^= 1
    (problem,) = mcz.verify(bytes(data), where="subject == 5")
    assert problem.heading == "DATA"  # every checksum of the file is compared
    with mcz.open(bytes(data)) as file:
        names = list(part_problems(file, file.find("subject == 5")))
        assert names == [("skeleton", "puppet", []), ("clip", "05_01", []), ("clip", "05_02", [])]
        assert [name for _, name, wrong in part_problems(file) if wrong] == ["16_01"]
    with pytest.raises(OptionError, match="none of 4 clips"):
        mcz.verify(archive, where="n_frames > 100")


def test_verify_some(call: Call, archive: Path, archive_path: Path) -> None:
    code, out, _ = call("verify", archive, "--where", "subject == 5")
    assert code == 0 and out.endswith("verified, every chunk checked, 1 skeleton, 2 clips\n")
    code, out, _ = call("verify", archive_path, "--where", "format == 'bvh'")
    assert code == 0 and out.endswith("verified, every chunk checked, 1 skeleton, 1 clip\n")


def test_decode_unpack_extract(call: Call, archive_path: Path, tmp_path: Path) -> None:
    where = ("--where", "format in ('bvh', 'c3d')")
    assert call("decode", archive_path, *where, "-o", f"{tmp_path}/d/")[0] == 0
    assert call("unpack", archive_path, tmp_path / "u", *where)[0] == 0
    for folder in ("d", "u"):
        held = sorted(path.name for path in (tmp_path / folder).iterdir())
        assert held == ["walk.bvh", "walk.c3d"]
    assert (
        call("decode", archive_path, *where, "-o", tmp_path / "one.bvh")[0] == 2
    )  # one file for two
    assert call("extract", archive_path, tmp_path / "e.mcz", *where)[0] == 0
    assert find_names(tmp_path / "e.mcz", "n_frames > 0") == ["walk.bvh", "walk.c3d"]


def test_diff(call: Call, archive: Path, archive_path: Path, samples: Path) -> None:
    code, out, _ = call("diff", archive, archive, "--where", "subject == 5", "--json")
    document = json.loads(out)
    assert [clip["name_a"] for clip in document["clips"]] == ["05_01", "05_02"]
    assert "only_in_a" not in document
    names = ("--clip", "05_01", "--clip", "16_01")
    code, out, _ = call("diff", archive, archive, *names, "--where", "subject == 5", "--json")
    assert [clip["name_a"] for clip in json.loads(out)["clips"]] == ["05_01"]
    code, out, err = call("diff", samples / "walk.bvh", archive_path, "--where", "format == 'bvh'")
    assert code == 0 and "walk.bvh" in out, err
    bvh = samples / "walk.bvh"
    code, _, err = call("diff", bvh, bvh, "--where", "n_frames > 0")
    assert code == 2 and "--where selects clips of an .mcz" in err
    code, _, err = call("diff", archive, archive_path, "--where", "n_frames > 0")
    assert code == 2 and "no clip in common" in err


def test_a_single_clip_on_each_side(call: Call, tmp_path: Path) -> None:
    for name in ("a", "b"):
        mcz.write(smooth(20, name=name), tmp_path / f"{name}.mcz")
    files = tmp_path / "a.mcz", tmp_path / "b.mcz"
    assert call("diff", *files, "--where", "name == 'a'")[0] == 0
    assert call("diff", *files, "--where", "name == 'b'")[0] == 2  # it is asked of A


@pytest.mark.parametrize("command", ["list", "info", "verify", "unpack", "decode", "extract"])
def test_refusals(call: Call, archive: Path, tmp_path: Path, command: str) -> None:
    target = {"unpack": [tmp_path / "o"], "extract": [tmp_path / "o.mcz"]}.get(command, [])
    for where, said in (
        ("n_frames > 1e6", "a.mcz: none of 4 clips matches 'n_frames > 1e6'"),
        ("n_frame > 5", "did you mean 'n_frames'"),
        ("n_frames >> 5", "mcz: where: column 11: expected a name, a number or a text"),
    ):
        code, out, err = call(command, archive, *target, "--where", where)
        assert (code, out) == (2, "") and said in err and err.count("\n") == 1, err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_info_refuses_more(call: Call, archive: Path, samples: Path) -> None:
    where = ("--where", "n_frames > 0")
    for option in ("--layout", "--validate"):
        code, _, err = call("info", archive, option, *where)
        assert code == 2 and "without --clip and --where" in err
    code, _, err = call("info", samples / "walk.bvh", *where)
    assert code == 2 and "--where selects clips of an .mcz" in err


def test_an_error_as_json(call: Call, archive: Path) -> None:
    code, _, err = call("list", archive, "--where", "n_frames", "--json")
    error = json.loads(err)["error"]
    assert code == error["exit_code"] == 2 and error["class"] == "OptionError"
