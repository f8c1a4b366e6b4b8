"""Clips carried over from file to file: merge, append, delete, rename, reorder, split."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mcz
from mcz import LiveWriter, codecs
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.scan import scan
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.files.editing.reorganize import natural
from mcz.sources.sample import write_samples
from tests import live_codec
from tests.amounts import amount
from tests.motions import skeleton


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders a and b of three clips and a skeleton each; b/walk.bvh is another one than a's."""
    folder = tmp_path_factory.mktemp("takes")
    for name in "ab":
        (folder / name).mkdir()
        write_samples(folder / name)
    text = (folder / "b" / "walk.bvh").read_bytes()
    (folder / "b" / "walk.bvh").write_bytes(text.replace(b"Frame Time: ", b"Frame Time:  "))
    (folder / "b" / "notes.txt").write_bytes(b"what b says")
    (folder / "b" / "copy.bvh").write_bytes((folder / "b" / "walk.bvh").read_bytes())
    return folder


@pytest.fixture
def files(takes: Path, tmp_path: Path) -> tuple[Path, Path]:
    """a.mcz and b.mcz of these folders; b has an attachment and an alias of its walk."""
    for name in "ab":
        mcz.pack(takes / name, tmp_path / f"{name}.mcz", codec="fast", rate=120, keep_all=True)
    return tmp_path / "a.mcz", tmp_path / "b.mcz"


def contents(path: Path) -> dict[str, bytes]:
    """Every file that an archive restores."""
    from mcz.files.editing.unpacking import named_files

    with mcz.open(path) as file:
        return {name: restore() for name, restore in named_files(file)}


def chunks_of(path: Path) -> list[Chunk]:
    source = open_source(str(path))
    try:
        return scan(source).chunks
    finally:
        source.close()


def results(report: mcz.Report) -> dict[str, str]:
    return {outcome.path: outcome.result for outcome in report.outcomes}


def sound(path: Path) -> mcz.File:
    """The file, which is sound; what was left of it in memory is never kept open."""
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        return file


def test_equal_names_are_refused_and_nothing_is_left(files: tuple[Path, Path]) -> None:
    target = files[0].parent / "c.mcz"
    with pytest.raises(mcz.OptionError, match="in more than one file"):
        mcz.merge(files, target)
    assert not target.exists()


def test_merge_with_rename_restores_all_files_of_both(files: tuple[Path, Path]) -> None:
    one, other = map(contents, files)
    target = files[0].parent / "c.mcz"
    report = mcz.merge(files, target, rename=True)
    file = sound(target)
    with mcz.open(files[0]) as first, mcz.open(files[1]) as second:
        names = {*first.clips, *(f"b/{n}" if n in first.clips else n for n in second.clips)}
        ids = first.container.directory.shared.keys() | second.container.directory.shared.keys()
    assert set(file.clips) == names
    merged = contents(target)
    assert {name: merged[name] for name in one} == one
    for name, data in other.items():
        assert data in (merged.get(name), merged.get(f"b/{name}")), name
    assert results(report)["walk.asf"] == "present"  # the same skeleton's own file
    assert file.container.directory.shared.keys() == ids
    kinds = [chunk.type for chunk in chunks_of(target) if chunk.type in (b"SKEL", b"SRCE")]
    assert len(kinds) == len(ids)  # shared chunks once


def test_merge_skips_what_is_identical(files: tuple[Path, Path], tmp_path: Path) -> None:
    a, b = files
    copy = tmp_path / "copy.mcz"
    copy.write_bytes(a.read_bytes())
    report = mcz.merge([a, copy], tmp_path / "c.mcz", skip_identical=True)
    assert contents(tmp_path / "c.mcz") == contents(a)
    assert {"present"} == {o.result for o in report.outcomes[len(report.outcomes) // 2 :]}
    with pytest.raises(mcz.OptionError, match=r"walk"):  # b's walk.bvh is another one
        mcz.merge([a, b], tmp_path / "d.mcz", skip_identical=True)


def test_merging_parts_of_a_split_gives_the_whole(files: tuple[Path, Path], tmp_path: Path) -> None:
    _, b = files
    parts = mcz.split(b, tmp_path / "parts", by="codec", rest="rest")
    assert sorted(p.name for p in (tmp_path / "parts").iterdir()) == ["fast.mcz", "rest.mcz"]
    paths = [outcome.path for outcome in parts.outcomes]
    for path in paths:
        sound(Path(path))
    mcz.merge(paths, tmp_path / "again.mcz")
    assert contents(tmp_path / "again.mcz") == contents(b)
    with pytest.raises(mcz.OptionError, match="1 attachment without codec"):
        mcz.split(b, tmp_path / "others", by="codec")
    assert not (tmp_path / "others").exists()


def test_append_of_an_archive_and_of_a_folder(
    files: tuple[Path, Path], takes: Path, tmp_path: Path
) -> None:
    a, b = files
    before = a.read_bytes()
    with pytest.raises(mcz.OptionError, match="in more than one file"):
        mcz.append([b], a)
    assert a.read_bytes() == before
    report = mcz.append([b], a, rename=True)
    assert a.read_bytes()[: len(before)] == before
    sound(a)
    assert results(report)["walk"] == "renamed"
    assert contents(b).items() <= {k.removeprefix("b/"): v for k, v in contents(a).items()}.items()
    mcz.encode(takes / "a" / "walk.amc", tmp_path / "one.mcz", rate=120)
    report = mcz.append([takes / "b"], tmp_path / "one.mcz", rate=120)
    found = results(report)
    assert (found["walk.bvh"], found["notes.txt"]) == ("alias", "skipped")  # copy.bvh came first
    assert sound(tmp_path / "one.mcz").aliases["walk.bvh"][1] == b"copy"


def test_what_an_archive_has_is_not_stored_again(files: tuple[Path, Path], takes: Path) -> None:
    a, _ = files
    other = a.parent / "other.bvh"
    other.write_bytes((takes / "a" / "walk.bvh").read_bytes())
    assert results(mcz.append([other], a)) == {"other.bvh": "alias"}
    assert contents(a)["other.bvh"] == other.read_bytes()


def test_deleted_is_gone_from_the_bytes(files: tuple[Path, Path], takes: Path) -> None:
    _, b = files
    with mcz.open(b) as file:
        row = file.container.directory.clips["walk"]
        data = [file.container.payload(s.chunk()) for s in row.segments]
        skeleton = file.container.directory.shared[b"SKEL", row.skeleton]
        gone = [*data, file.container.payload(skeleton), file.container.payload(row.clip)]
    asf = (takes / "b" / "walk.asf").read_bytes()
    assert all(piece in b.read_bytes() for piece in gone)
    report = mcz.delete_clips(b, ["walk"])
    left = b.read_bytes()
    assert not any(piece in left for piece in gone)
    assert results(report) == {"walk": "deleted", "walk.asf": "deleted"}
    assert "walk.asf" not in contents(b)
    assert asf[:200] not in left
    sound(b)


def test_an_alias_keeps_no_content_alive(files: tuple[Path, Path]) -> None:
    _, b = files
    before = contents(b)
    with pytest.raises(mcz.OptionError, match="under another name"):
        mcz.delete_clips(b, "copy")
    assert contents(b) == before
    report = mcz.delete_clips(b, "copy", aliases=True)
    assert results(report) == {"copy": "deleted", "walk.bvh": "deleted"}
    sound(b)
    assert contents(b) == {k: v for k, v in before.items() if k not in ("copy.bvh", "walk.bvh")}


def test_an_alias_alone_goes_alone(files: tuple[Path, Path]) -> None:
    _, b = files
    before = contents(b)
    mcz.delete_clips(b, ["walk.bvh", "notes.txt"])
    assert contents(b) == {k: v for k, v in before.items() if k not in ("walk.bvh", "notes.txt")}
    sound(b)


def test_delete_asks_for_what_is_there(files: tuple[Path, Path]) -> None:
    a, _ = files
    before = a.read_bytes()
    with pytest.raises(mcz.OptionError, match="did you mean 'walk'"):
        mcz.delete_clips(a, ["wakl"])
    with pytest.raises(mcz.OptionError, match="nothing to delete; name clips or give where"):
        mcz.delete_clips(a)
    with pytest.raises(
        mcz.OptionError, match="nothing to delete; no clip matches 'n_frames > 9e9'"
    ):
        mcz.delete_clips(a, where="n_frames > 9e9")
    with pytest.raises(mcz.ExistsError):
        mcz.delete_clips(a, "walk", output=a.parent / "b.mcz")
    with pytest.raises(mcz.OptionError, match="the input itself"):
        mcz.delete_clips(a, "walk", output=a, force=True)
    assert a.read_bytes() == before


def test_names_swap_and_sources_follow(files: tuple[Path, Path]) -> None:
    _, b = files
    before = contents(b)
    mcz.rename_clips(b, {"copy": "x/copy", "notes.txt": "x/notes", "walk.bvh": "y.bvh"})
    sound(b)
    after = contents(b)
    assert after["x/copy.bvh"] == after["y.bvh"] == before["copy.bvh"]
    assert after["x/notes"] == before["notes.txt"]
    with mcz.open(b) as file:
        amc = file.clips["walk"].read()
    mcz.rename_clips(b, {"walk": "x/copy", "x/copy": "walk"})
    sound(b)
    with mcz.open(b) as file:
        assert (file.clips["x/copy"].read() == amc).all()
        assert file.alias_of("y.bvh") == ("clip", "walk")
    with pytest.raises(mcz.OptionError, match="two clips would have the name 'walk'"):
        mcz.rename_clips(b, {"x/copy": "walk"})
    with pytest.raises(mcz.OptionError, match="two files would be restored to 'x/notes'"):
        mcz.rename_clips(b, {"y.bvh": "x/notes"})
    with pytest.raises(mcz.MotionError, match="is not a plain relative path"):
        mcz.rename_clips(b, {"walk": "../walk"})


def test_a_rate_that_is_set_later(files: tuple[Path, Path], takes: Path, tmp_path: Path) -> None:
    from fractions import Fraction

    from mcz.files.editing import Report
    from mcz.files.editing.rewriting import Change, plan_whole, rewriting

    path = tmp_path / "one.mcz"
    mcz.encode(takes / "a" / "walk.amc", path)
    with rewriting(path) as job:
        assert job.file.clips["walk"].frame_rate is None
        plan = plan_whole(job.file)
        plan.changes["clip", "walk"] = Change(rate=Fraction(30000, 1001))
        job.write(plan, Report(), lambda name: None)
    assert sound(path).clips["walk"].frame_rate == Fraction(30000, 1001)
    assert contents(path)["walk.amc"] == (takes / "a" / "walk.amc").read_bytes()


def test_the_order_is_what_was_asked_for(files: tuple[Path, Path]) -> None:
    _, b = files
    names = list(sound(b).clips)
    mcz.reorder_clips(b, [names[-1]])
    assert list(sound(b).clips) == [names[-1], *names[:-1]]
    mcz.reorder_clips(b, by="name")
    assert list(sound(b).clips) == sorted(names)
    mcz.reorder_clips(b, by="-name")
    assert list(sound(b).clips) == sorted(names, reverse=True)
    with pytest.raises(mcz.OptionError, match="neither a field nor a metadata key"):
        mcz.reorder_clips(b, by="naem")


def test_numbers_in_names_count_as_numbers() -> None:
    names = ["take10", "Take2", "take1", "b", "2", "10"]
    assert sorted(names, key=natural) == ["2", "10", "b", "take1", "Take2", "take10"]


def test_a_file_that_somebody_grows_is_left_alone(files: tuple[Path, Path]) -> None:
    from mcz.files.editing.appending import append_at_end

    with (
        append_at_end(files[0], salvage=False, force=False),
        pytest.raises(mcz.AccessError, match="another process"),
    ):
        mcz.delete_clips(files[0], "walk")


@settings(max_examples=amount(60, 25), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_no_damage_is_carried_over(files: tuple[Path, Path], data: st.DataObject) -> None:
    """A byte that is wrong is refused, or lies in what is made anew; the target is never wrong."""
    whole = bytearray(files[0].read_bytes())
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= 1 << data.draw(st.integers(0, 7))
    bad, out = files[0].parent / "bad.mcz", files[0].parent / "out.mcz"
    bad.write_bytes(whole)
    out.unlink(missing_ok=True)
    try:
        mcz.reorder_clips(bad, by="name", output=out)
    except mcz.MczError:
        assert not out.exists()
    else:
        assert mcz.verify(out) == []
        assert contents(out) == contents(files[0])


def test_live_clips_with_packets_and_repeats_are_carried_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks that may not be copied lie between DATA here, so that all behind them moves."""
    monkeypatch.setitem(codecs.CODECS, live_codec.CODEC.name, live_codec.CODEC)
    path = tmp_path / "live.mcz"
    values = np.random.default_rng(1).integers(-40, 40, (30, 10)).cumsum(axis=0) / 8
    with (
        path.open("wb") as out,
        LiveWriter(out, skeleton(), "stairs", {"every": 7}, frame_rate=120) as writer,
    ):
        for row in values:
            writer.push(row)
    assert sum(chunk.type == ChunkType.REPT for chunk in chunks_of(path)) == 4
    mcz.rename_clips(path, {"live": "later"})
    assert not any(chunk.type == ChunkType.REPT for chunk in chunks_of(path))
    with mcz.open(path) as file:
        np.testing.assert_array_equal(file.clips["later"].read(), values)
    sound(path)


def test_ancillary_chunks_go_along_where_that_is_safe(files: tuple[Path, Path]) -> None:
    a, _ = files
    sink = io.BytesIO(a.read_bytes())
    sink.seek(0, os.SEEK_END)
    with mcz.open(a) as file:
        writer = Writer(sink, directory=file.container.directory, offset=file.size)
        writer.ancillary(b"gOOd", b"kept")
        writer.ancillary(b"bADd", b"dropped", safe_to_copy=False)
        writer.finish()
    a.write_bytes(sink.getvalue())
    assert mcz.verify(a) == []
    report = mcz.reorder_clips(a, by="-name")
    assert b"kept" in a.read_bytes()
    assert b"dropped" not in a.read_bytes()
    assert "bADd" in report.left_out[0]
    sound(a)
