"""COPY: what holds a file together stands in it twice, and a flipped bit there costs nothing."""

from __future__ import annotations

import io
import pickle
import random
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import FormatError, MotionError
from mcz.container.chunks import COPIED, Chunk, ChunkFlag, ChunkType, build_chunk
from mcz.container.encodings import MOST_BYTES, Copy, build_copies, parse_copies
from mcz.container.limits import BASE
from mcz.container.scan import scan
from mcz.container.source import Overlay, open_source
from mcz.container.writer import Writer
from mcz.files.reading.report import info
from mcz.files.writing.atomic import WriteTransaction
from mcz.sources import FORMATS
from mcz.sources.sample import write_samples
from tests.commands import run
from tests.motions import smooth, write_bytes
from tests.repair import use

VECTORS = Path(__file__).parent.parent / "conformance" / "vectors"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The samples: an AMC with its ASF, a BVH, a C3D."""
    folder = tmp_path_factory.mktemp("samples")
    write_samples(folder)
    return folder


@pytest.fixture(scope="module")
def archive_bytes(folder: Path) -> bytes:
    out = io.BytesIO()
    assert not mcz.pack(folder, out, codec="raw").failures
    return out.getvalue()


def chunks(data: bytes, *kinds: bytes) -> list[Chunk]:
    """The chunks of these types, all without one, in file order."""
    return [c for c in scan(open_source(data)).chunks if not kinds or c.type in kinds]


def change_bytes(data: bytes, *places: int) -> bytes:
    bad = bytearray(data)
    for at in places:
        bad[at] ^= 0x10
    return bytes(bad)


def content(data: bytes, *, salvage: bool = False) -> dict[str, object]:
    """Every value and every file that an archive gives, by name."""
    with mcz.open(data, salvage=salvage) as file:
        found: dict[str, object] = {}
        for name, clip in file.clips.items():
            for signal in range(len(clip.signals)):
                values, mask = clip.read_masked(signal=signal)
                masked = b"" if mask is None or mask.all() else mask.tobytes()
                found[f"{name} {signal}"] = values.tobytes(), masked
            if clip.source is not None:
                found[clip.source.path] = clip.source_bytes()
        for name, (_, target) in file.aliases.items():
            found[name] = file.skeleton_bytes(target)
        return found


# Salvage -----------------------------------------------------------------------


def test_a_bad_byte_costs_nothing_that_has_a_copy(archive_bytes: bytes) -> None:
    whole = content(archive_bytes)
    assert len(whole) == 8  # three clips, a signal more, three files, an ASF
    for chunk in chunks(archive_bytes, *COPIED):
        for at in (0, 9, 16 + (chunk.length or 0) // 2, chunk.size - 1):
            bad = change_bytes(archive_bytes, chunk.offset + at)
            with mcz.open(bad, salvage=True) as file:
                assert re.match(f"{chunk.label}: .*; its copy is used", file.damage[0])
                assert len(file.damage) == 1
            assert content(bad, salvage=True) == whole, (chunk, at)


def test_all_of_them_may_be_bad_at_once(archive_bytes: bytes) -> None:
    every = chunks(archive_bytes, *COPIED)
    bad = change_bytes(
        archive_bytes, *(chunk.offset + 18 for chunk in every), *range(8), len(archive_bytes) - 9
    )
    with mcz.open(bad, salvage=True) as file:
        used = [line for line in file.damage if line.endswith("its copy is used")]
        assert len(used) == len(every)
    assert content(bad, salvage=True) == content(archive_bytes)


def signals(data: bytes, *, salvage: bool = False) -> dict[tuple[str, int], np.ndarray]:
    with mcz.open(data, salvage=salvage) as file:
        return {
            (name, signal.index): clip.read(signal=signal.index)
            for name, clip in file.clips.items()
            for signal in clip.signals
        }


def test_what_lies_before_the_signature_moves_all_alike(archive_bytes: bytes) -> None:
    (first, *_) = chunks(archive_bytes, b"SKEL")
    bad = b"junk of a mail program" + change_bytes(archive_bytes, first.offset + 30)
    assert content(bad, salvage=True) == content(archive_bytes)


def test_what_is_sound_is_kept(archive_bytes: bytes) -> None:
    """A COPY that tells another tale of chunks that are there changes none of them."""
    skel, *_ = chunks(archive_bytes, b"SKEL")
    (copy,) = chunks(archive_bytes, ChunkType.COPY)
    other = build_chunk(ChunkType.COPY, b"", ChunkFlag.ANCILLARY)
    for offset, size in ((skel.offset, skel.length or 0), (skel.offset + 3, 5), (skel.offset, 9)):
        lie = [Copy(offset, b"SKEL", bytes(size))]
        other = build_chunk(ChunkType.COPY, build_copies(lie, copy.offset), ChunkFlag.ANCILLARY)
        bad = archive_bytes[: copy.offset] + other + archive_bytes[copy.offset + copy.size :]
        with mcz.open(bad, salvage=True) as file:
            assert any(
                "is not used, because the original is intact" in line for line in file.damage
            )
            assert not any("copy is used" in line for line in file.damage)
        assert content(bad, salvage=True) == content(archive_bytes)
        with pytest.raises(FormatError):
            scan(open_source(bad), whole=True)


def test_an_archive_within_an_archive(archive_bytes: bytes) -> None:
    """COPY of an attached file refers to that file, wherever it lies."""
    out = io.BytesIO()
    writer = Writer(out, copies=True)
    mcz.open(archive_bytes).close()
    noise = random.Random(1).randbytes(len(archive_bytes))
    writer.attachment("a.bin", noise)
    writer.chunk(b"xtra", archive_bytes, ChunkFlag.ANCILLARY)
    writer.finish()
    data = out.getvalue()
    extra = next(chunk for chunk in chunks(data) if chunk.type == b"xtra")
    skel = chunks(archive_bytes, b"SKEL")[0]
    bad = change_bytes(data, extra.offset + 5, extra.payload_offset + skel.offset + 20)
    with mcz.open(bad, salvage=True) as file:
        assert file.attachments["a.bin"].read() == noise
        for clip in file.clips.values():
            clip.read()


def test_a_salvaged_file_is_pickled_as_it_is(archive_bytes: bytes) -> None:
    skel = chunks(archive_bytes, b"SKEL")[0]
    with mcz.open(change_bytes(archive_bytes, skel.offset + 20), salvage=True) as file:
        again = pickle.loads(pickle.dumps(file))
        assert again.damage == file.damage
        for name, clip in file.clips.items():
            np.testing.assert_array_equal(again.clips[name].read(), clip.read())


# Without a COPY ------------------------------------------------------------------


@pytest.mark.parametrize("unit", [None, "m", "in"])
@pytest.mark.parametrize("named", [True, False])
def test_a_skeleton_is_made_again_from_its_asf(
    folder: Path, tmp_path: Path, unit: str | None, named: bool
) -> None:
    for name in ("walk.asf", "walk.amc"):
        text = (folder / name).read_text()
        text = text if named else re.sub(":name.*\n", "", text)
        (tmp_path / name).write_text(text)
    mcz.encode(tmp_path / "walk.amc", tmp_path / "a.mcz", unit=unit, codec="raw")
    data = (tmp_path / "a.mcz").read_bytes()
    whole = content(data)
    skel, *_ = chunks(data, b"SKEL")
    for at in (2, 20, skel.size - 1):
        bad = change_bytes(data, skel.offset + at)
        with mcz.open(bad, salvage=True) as file:
            how = "header was corrected" if at == 2 else "rebuilt from its ASF, SRCE"
            assert any(how in line for line in file.damage)
            again = pickle.loads(pickle.dumps(file))
            assert list(again.clips) == list(file.clips)
            assert again.clips["walk"].skeleton == file.clips["walk"].skeleton
        assert content(bad, salvage=True) == whole
    both = change_bytes(data, skel.offset + 20, chunks(data, b"SRCE")[0].offset + 20)
    with mcz.open(both, salvage=True) as file, pytest.raises(FormatError, match="no SKEL"):
        file.clips["walk"].read()


def test_a_skeleton_that_faces_up_is_made_again_from_the_other(
    folder: Path, tmp_path: Path
) -> None:
    mcz.encode(folder / "walk.amc", tmp_path / "a.mcz", up="z", codec="raw")
    data = (tmp_path / "a.mcz").read_bytes()
    both = chunks(data, b"SKEL")
    assert len(both) == 2
    for hit in (both[:1], both[1:], both):
        bad = change_bytes(data, *(skel.offset + 20 for skel in hit))
        with mcz.open(bad, salvage=True) as file:
            assert file.clips["walk"].skeleton.up_axis == "z"
        assert content(bad, salvage=True) == content(data)


def test_another_skeleton_is_not_taken_for_it(folder: Path, tmp_path: Path) -> None:
    """An ASF that is no longer what the skeleton was made of does not have its id."""
    skeleton = FORMATS["asf"].read((folder / "walk.asf").read_bytes(), "walk")
    odd = replace(skeleton, up_axis="z")
    motion = FORMATS["amc"].read((folder / "walk.amc").read_bytes(), "walk", skeleton)
    data = write_bytes(replace(motion, skeleton=odd, source=None), codec="raw")
    skel, *_ = chunks(data, b"SKEL")
    with mcz.open(change_bytes(data, skel.offset + 20), salvage=True) as file:
        assert not any("made again" in line for line in file.damage)
        with pytest.raises(FormatError, match="no SKEL"):
            file.clips["walk"].read()


def test_another_chunk_of_the_same_bytes_will_do() -> None:
    data = (VECTORS / "uncommon/container/repeated-template.mcz").read_bytes()
    whole = content(data)
    for kind in (b"SKEL", b"SRCE"):
        for chunk in chunks(data, kind):
            assert content(change_bytes(data, chunk.offset + 20), salvage=True) == whole
    for path in sorted((VECTORS / "valid/online").glob("repeat-[oe][na]c*.mcz")):
        data = path.read_bytes()
        skel, *_ = chunks(data, b"SKEL")
        assert content(change_bytes(data, skel.offset + 20), salvage=True) == content(data)


def test_a_rept_changes_nothing_in_a_sound_file() -> None:
    paths = [*(VECTORS / "valid/online").glob("repeat-*.mcz")]
    assert len(paths) > 5
    for path in (*paths, VECTORS / "uncommon/container/REPT-of-nothing.mcz"):
        with mcz.open(path) as file, mcz.open(path, salvage=True) as salvaged:
            assert not salvaged.damage
            assert salvaged.skeletons == file.skeletons


# Repair ----------------------------------------------------------------------


def test_repair_loses_nothing_that_has_a_copy(archive_bytes: bytes, tmp_path: Path) -> None:
    bad, sound = tmp_path / "bad.mcz", tmp_path / "sound.mcz"
    whole = content(archive_bytes)
    kinds = {chunk.type: chunk for chunk in chunks(archive_bytes, *COPIED, ChunkType.COPY)}
    for number, chunk in enumerate(kinds.values()):
        bad.write_bytes(change_bytes(archive_bytes, chunk.offset + (2, 17)[number % 2]))
        found = mcz.repair(bad, sound, force=True)
        assert found.damage
        assert not found.lost
        assert content(sound.read_bytes()) == whole
        with mcz.open(sound) as file:
            assert len(file.container.copies()) == (chunk.type != ChunkType.COPY)


# Writing -------------------------------------------------------------------------


def n_copies(target: object) -> int:
    with mcz.open(target) as file:
        found = file.container.copies()
        assert info(file)["copy_bytes"] == sum(chunk.size for chunk in found)
    assert mcz.verify(target) == []
    return len(found)


def test_who_makes_them(folder: Path, tmp_path: Path) -> None:
    a, b, c = (tmp_path / f"{name}.mcz" for name in "abc")
    bvh = folder / "walk.bvh"
    mcz.pack(folder, a, codec="raw")
    assert n_copies(a) == 1
    mcz.pack(folder, b, codec="raw", copies=False)
    assert n_copies(b) == 0
    for target, before in ((a, 1), (b, 0)):
        mcz.append([bvh], target, root=folder.parent, codec="raw")
        assert n_copies(target) == 2 * before
        mcz.extract(target, c, clip="walk", force=True)
        assert n_copies(c) == before
        mcz.extract(target, c, clip="walk", copies=not before, force=True)
        assert n_copies(c) == 1 - before
        with mcz.open(target) as file:
            joint = file.clips["walk"].skeleton.joints[0].name
            values = file.clips["walk"].read(joints=[joint])
        found = mcz.replace(target, "walk", joint, values, c, force=True)
        assert n_copies(c) == before
        assert not found.left_out
    mcz.append([bvh], b, root=folder.parent.parent, copies=True, codec="raw")
    assert n_copies(b) == 1
    mcz.append([bvh], a, root=folder.parent.parent, copies=False, codec="raw")
    assert n_copies(a) == 2
    mcz.encode(bvh, c, force=True, codec="raw")
    assert n_copies(c) == 0
    mcz.encode(bvh, c, force=True, codec="raw", copies=True)
    assert n_copies(c) == 1


def test_what_an_append_has_not_yet_copied(folder: Path, tmp_path: Path) -> None:
    """Chunks that others appended without copies get theirs with the next that has some."""
    path = tmp_path / "a.mcz"
    mcz.pack(folder, path, codec="raw", copies=False)
    late = tmp_path / "late.bvh"  # the same bytes would be an alias
    late.write_bytes((folder / "walk.bvh").read_bytes().replace(b"Time: ", b"Time:  "))
    mcz.append([late], path, codec="raw", copies=True)
    data = path.read_bytes()
    for chunk in chunks(data, b"HEAD", b"SKEL", b"SRCE", b"CLIP", b"CEND"):
        bad = change_bytes(data, chunk.offset + 18)
        assert content(bad, salvage=True) == content(data), chunk


def test_a_file_without_clips(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    mcz.encode(folder / "walk.asf", path, copies=True)
    assert n_copies(path) == 1
    data = path.read_bytes()
    skel, *_ = chunks(data, b"SKEL")
    assert content(change_bytes(data, skel.offset + 18), salvage=True) == content(data)
    mcz.append([folder / "walk.bvh"], path, codec="raw")
    assert n_copies(path) == 1  # those before any clip belong to none
    assert len(chunks(path.read_bytes(), ChunkType.COPY)) == 2


def test_a_step_that_failed_is_not_copied() -> None:
    out = io.BytesIO()
    transaction = WriteTransaction(out, BASE, copies=True)
    with pytest.raises(MotionError), transaction.step():
        transaction.writer.template(3, b"a template that nobody wants")
        raise MotionError("no")
    with transaction.step():
        transaction.writer.template(3, b"another")
    transaction.finish()
    data = out.getvalue()
    (copy,) = chunks(data, ChunkType.COPY)
    copies = parse_copies(data[copy.payload_offset :][: copy.length], copy, len(data))
    assert [one.type for one in copies] == [b"HEAD", b"SRCE"]
    assert mcz.verify(data) == []


def test_many_of_them_lie_in_several_chunks() -> None:
    out, draw = io.BytesIO(), random.Random(2)
    writer = Writer(out, copies=True)
    for size in (40_000, 40_000, 200_000, 10, 10):
        writer.template(3, draw.randbytes(size))
    writer.finish()
    data = out.getvalue()
    found = chunks(data, ChunkType.COPY)
    sizes = []
    for chunk in found:
        copies = parse_copies(data[chunk.payload_offset :][: chunk.length], chunk, len(data))
        sizes.append([len(copy.payload) for copy in copies])
    assert [len(one) for one in sizes] == [2, 1, 1, 2]
    assert all(len(one) == 1 or sum(one) <= MOST_BYTES for one in sizes)
    assert mcz.verify(data) == []


@pytest.mark.parametrize(("size", "copied"), [(1000, True), (20_000, False)])
def test_a_model_is_copied_where_it_is_small_beside_the_rest(size: int, copied: bool) -> None:
    out, draw = io.BytesIO(), random.Random(4)
    writer = Writer(out, copies=True)
    writer.shared(b"MODL", b"\0\x63" + draw.randbytes(size))
    writer.attachment("noise", draw.randbytes(100_000))
    writer.finish()
    data = out.getvalue()
    with mcz.open(data) as file:
        (chunk,) = file.container.copies()
    copies = parse_copies(data[chunk.payload_offset :][: chunk.length], chunk, len(data))
    assert [copy.type for copy in copies] == [b"HEAD"] + [b"MODL"] * copied
    assert mcz.verify(data) == []


def test_the_same_with_every_byte_cut_or_changed() -> None:
    """No byte string is too odd for a reader, and a strict one takes no false copy."""
    data = write_bytes(smooth(3), codec="raw", copies=True)
    (copy,) = chunks(data, ChunkType.COPY)
    for at in range(copy.offset, copy.offset + copy.size):
        use(change_bytes(data, at), salvage=True)
        assert mcz.verify(change_bytes(data, at))
    payload = data[copy.payload_offset :][: copy.length]
    for size in range(len(payload)):
        other = build_chunk(ChunkType.COPY, payload[:size], ChunkFlag.ANCILLARY)
        bad = data[: copy.offset] + other + data[copy.offset + copy.size :]
        with pytest.raises(FormatError):
            scan(open_source(bad), whole=True)
        with mcz.open(bad, salvage=True) as file:
            np.testing.assert_array_equal(file.clips["smooth"].read(), smooth(3).values)


def test_an_overlay_reads_like_the_whole() -> None:
    draw = random.Random(3)
    whole = bytearray(draw.randbytes(300))
    parts = {at: draw.randbytes(size) for at, size in ((0, 3), (50, 20), (70, 1), (90, 40))}
    source = Overlay(open_source(bytes(whole)), parts | {300: b"behind the end"})
    for at, part in parts.items():
        whole[at : at + len(part)] = part
    for _ in range(400):
        start, stop = sorted(draw.choices(range(301), k=2))
        assert source.read(start, stop - start) == whole[start:stop]
    assert source.read(307, 3) == b"the"
    assert source.size == 300
    assert source.name == "bytes"


# Commands ------------------------------------------------------------------------


def test_the_commands_say_it(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, bvh = str(tmp_path / "a.mcz"), str(folder / "walk.bvh")

    def read_output(*arguments: str) -> str:
        assert run(*arguments) == 0
        return capsys.readouterr().out

    read_output("encode", bvh, "-o", path, "--copies", "--codec", "raw")
    with mcz.open(path) as file:
        size = info(file)["copy_bytes"]
    assert re.search(rf"copies +{size:,} ", read_output("info", path))
    assert "COPY payload" in read_output("info", "--layout", path)
    read_output("encode", bvh, "-o", path, "--force", "--codec", "raw")
    assert "copies" not in read_output("info", path)
    read_output("pack", str(folder), path, "--no-copies", "--force", "--codec", "raw")
    assert "copies" not in read_output("info", path)
    read_output("append", "--copies", "--root", str(folder.parent), "--codec", "raw", bvh, path)
    assert "copies" in read_output("info", path)
    out = str(tmp_path / "b.mcz")
    read_output("extract", path, out, "--clip", "walk", "--no-copies")
    assert "copies" not in read_output("info", out)


@cache
def invalid() -> list[Path]:
    return sorted((VECTORS / "invalid/copies").glob("*.mcz"))


@pytest.mark.parametrize("path", invalid(), ids=lambda path: path.stem)
def test_false_copies_are_refused_and_salvaged_around(path: Path) -> None:
    data = path.read_bytes()
    with pytest.raises(FormatError, match="COPY"):
        scan(open_source(data), whole=True)
    with mcz.open(data, salvage=True) as file:
        assert len(file.clips) == 2
        for clip in file.clips.values():
            assert not np.isnan(clip.read()).any()


def test_a_file_with_copies_can_be_followed(samples: Path, tmp_path: Path) -> None:
    mcz.encode(samples / "walk.bvh", tmp_path / "walk.mcz", codec="raw", copies=True)
    data = (tmp_path / "walk.mcz").read_bytes()
    assert b"COPY" in data
    rows = [values for _, values, _ in mcz.live_frames(io.BytesIO(data))]
    with mcz.open(data) as file:
        np.testing.assert_array_equal(rows, file.only_clip().read())
