"""Frames, joints and resolutions cut from stored bytes, without re-encoding."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import codecs
from mcz.codecs import raw
from mcz.codecs.contract import Encoded
from mcz.container import payloads
from mcz.container.model_records import canonical
from mcz.container.scan import scan
from mcz.container.segments import FRESH
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.files.reading.faults import validate
from mcz.files.writing.clip_writer import write_clip
from mcz.model.motion import Signal
from mcz.model.schema import EXTENDED, parse
from tests import overlap_codec
from tests.commands import run
from tests.motions import rich, smooth
from tests.repair import join_parts, parts_of, replace_payload
from tools.records import build_record, update

JOINTS = ("hips", "spine", "fixed", "knee")


def _running_encode(source: Any, params: Any) -> Encoded:
    """Raw, but only every third segment is said to start fresh."""
    encoded = raw.encode(source, params)
    runs = (replace(s, fresh=i % 3 == 0) for i, s in enumerate(encoded.segments))
    return Encoded(encoded.header, runs)


EXTRA = (
    overlap_codec.CODEC,
    replace(raw.CODEC, id=253, name="running", encode=_running_encode),
    replace(raw.CODEC, id=254, name="one", grouping="all"),
)
LENGTH = {"overlap": "length"}  # else segment_frames


@pytest.fixture(autouse=True, scope="module")
def extra_codecs() -> Any:
    codecs.CODECS.update({codec.name: codec for codec in EXTRA})
    yield
    for codec in EXTRA:
        del codecs.CODECS[codec.name]


def write_bytes(motion: mcz.Motion, codec: str = "raw", length: int = 7) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec, **{LENGTH.get(codec, "segment_frames"): length})
    return out.getvalue()


def extract_clips(data: bytes, **how: Any) -> bytes:
    out = io.BytesIO()
    mcz.extract(data, out, **how)
    return out.getvalue()


def check(whole: bytes, part: bytes, start: int, stop: int, joints: Any, resolution: int) -> None:
    """``part`` shows what ``whole`` gives for the same request, and is sound in itself."""
    with mcz.open(whole) as old, mcz.open(part) as new:
        assert validate(new) == []
        assert new.container.directory == scan(open_source(part), whole=True).directory
        before, after = old.clips["smooth"], new.clips["smooth"]
        assert after.n_frames == stop - start
        np.testing.assert_array_equal(after.frame_numbers, before.frame_numbers[start:stop])
        for one, other in zip(before.signals, after.signals, strict=True):
            chosen = None
            if joints is not None and one.channels is None:
                chosen = sorted({before.skeleton.find(joint) for joint in joints})
            coarser = one.coarser(resolution)
            values, mask = before.read_masked((start, stop), chosen, coarser, signal=one.index)
            found, valid = after.read_masked(signal=one.index)
            assert canonical(found) == canonical(values)
            all_valid = np.ones(values.shape, bool)
            np.testing.assert_array_equal(
                all_valid if mask is None else mask, all_valid if valid is None else valid
            )
            assert other.counts.n_resolutions == one.counts.n_resolutions - coarser
            for a in range(0, stop - start, 5):  # a part of the part
                piece = after.read_masked((a, stop - start), signal=one.index)[0]
                assert canonical(piece) == canonical(found[a * one.layout.samples_per_frame :])


CODECS = ("raw", "fast", "overlap", "running")


def motion_for(codec: str) -> mcz.Motion:
    motion = rich()
    if codec in LENGTH:  # of values, one row a frame
        return replace(motion, signals=(Signal(motion.signals[0].values),))
    return motion


@st.composite
def requests(draw: st.DrawFn) -> tuple[str, int, list[dict[str, Any]]]:
    """A codec, a segment length, and one or two cuts that can be made one after the other."""
    codec = draw(st.sampled_from(CODECS))
    length = draw(st.integers(2, 17))
    cuts, n_frames, resolutions = [], 40, 2 if codec in LENGTH else 1
    joints: tuple[str, ...] | None = None
    for _ in range(draw(st.integers(1, 2))):
        how: dict[str, Any] = {}
        if draw(st.booleans()):
            start = draw(st.integers(0, n_frames))
            stop = draw(st.integers(start, n_frames))
            how["frames"] = start, None if stop == n_frames else stop
            n_frames = stop - start
        if draw(st.booleans()) or not how:
            kept = draw(st.lists(st.sampled_from(joints or JOINTS), unique=True))
            how["joints"] = joints = tuple(kept)
        if resolutions > 1 and draw(st.booleans()):
            how["resolution"] = 1
            resolutions -= 1
        cuts.append(how)
        if joints == ():
            break
    return codec, length, cuts


@given(requests())
def test_any_cut_shows_what_was_asked_for(request: tuple[str, int, list[dict[str, Any]]]) -> None:
    codec, length, cuts = request
    whole = part = write_bytes(motion_for(codec), codec, length)
    start, stop, joints, resolution = 0, 40, None, 0
    for how in cuts:
        part = extract_clips(part, **how)
        a, b = how.get("frames", (0, None))
        start, stop = start + a, stop if b is None else start + b
        joints, resolution = how.get("joints", joints), resolution + how.get("resolution", 0)
        check(whole, part, start, stop, joints, resolution)


def streams_of(data: bytes) -> list[bytes]:
    with mcz.open(data) as file:
        found = []
        for clip in file.clips.values():
            for signal in clip.signals:
                for row in signal.rows:
                    found += file.container.streams(row, signal.counts, None)[1].values()
        return [stream for stream in found if stream]


@pytest.mark.parametrize("codec", CODECS)
def test_streams_are_copied_byte_for_byte(codec: str) -> None:
    whole = write_bytes(motion_for(codec), codec)
    for how in ({"frames": (10, 20)}, {"joints": ["hips", "spine"]}, {"frames": (3, 4)}):
        streams = streams_of(extract_clips(whole, **how))
        assert streams
        assert set(streams) <= set(streams_of(whole))
        assert len(streams) < len(streams_of(whole))


def segments_of(data: bytes, signal: int = 0) -> list[tuple[int, int, int, bool]]:
    with mcz.open(data) as file:
        rows = next(iter(file.clips.values())).signals[signal].rows
        return [
            (r.header.first, r.header.stop, r.header.lead, bool(r.header.flags & FRESH))
            for r in rows
        ]


def test_segments_that_bear_upon_the_frames_are_kept() -> None:
    data = write_bytes(motion_for("overlap"), "overlap", 10)
    assert segments_of(data)[1] == (10, 20, 1, True)
    # Frame 19 hangs on the segment after it, frame 18 does not; the first lead is cut to 0.
    assert segments_of(extract_clips(data, frames=(12, 20))) == [
        (0, 10, 0, True),
        (10, 20, 1, True),
    ]
    assert segments_of(extract_clips(data, frames=(12, 19))) == [(0, 10, 0, True)]
    with mcz.open(extract_clips(data, frames=(12, 19))) as file:
        info = file.clips["smooth"].signals[0]
        assert (info.skip, info.spare, info.layout.n_frames) == (2, 1, 10)


def test_segments_that_are_needed_are_kept() -> None:
    data = write_bytes(motion_for("running"), "running", 5)
    part = extract_clips(data, frames=(31, 33))  # in segment 6, which is fresh
    assert segments_of(part) == [(0, 5, 0, True)]
    part = extract_clips(data, frames=(11, 12))  # in segment 2, which needs 1 and 0
    assert [s[3] for s in segments_of(part)] == [True, False, False]


def test_every_signal_is_cut_at_its_own_segments() -> None:
    motion = motion_for("raw")
    out = io.BytesIO()
    writer = Writer(out)
    write_clip(writer, motion, codecs.codec_by_name("raw"), {})
    writer.finish()
    with mcz.open(out.getvalue()) as file:
        assert [len(s.rows) for s in file.clips["smooth"].signals] == [2, 1]
    part = extract_clips(out.getvalue(), frames=(25, 30))
    check(out.getvalue(), part, 25, 30, None, 0)
    with mcz.open(part) as file:
        assert [(s.skip, s.spare) for s in file.clips["smooth"].signals] == [(5, 10), (25, 10)]


def test_copies_of_a_joint_that_goes_are_coded_anew() -> None:
    whole = write_bytes(motion_for("fast"), "fast")
    check(whole, extract_clips(whole, joints=["knee"]), 0, 40, ["knee"], 0)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({}, "nothing to extract"),
        ({"resolution": 2}, "cannot leave out the 2 finest resolutions: it has 2"),
        ({"resolution": -1}, "finest resolutions: it has"),
        ({"frames": (0, 41)}, "has 40 frames, not 0:41"),
        ({"frames": (7, 3)}, "not 7:3"),
        ({"frames": (-1, 3)}, "not -1:3"),
        ({"clip": "other"}, "no clip 'other'"),
    ],
)
def test_what_cannot_be_cut(tmp_path: Path, how: dict[str, Any], message: str) -> None:
    whole = write_bytes(motion_for("overlap"), "overlap")
    with pytest.raises(mcz.OptionError, match=message):
        mcz.extract(whole, tmp_path / "a.mcz", **how)
    assert list(tmp_path.iterdir()) == []


def test_joints_that_cannot_be_cut() -> None:
    whole = write_bytes(motion_for("raw"), "one")
    with pytest.raises(mcz.OptionError, match="joint spine cannot be cut out: its channels are"):
        extract_clips(whole, joints=["spine"])
    check(whole, extract_clips(whole, joints=["hips", "spine", "knee"]), 0, 40, None, 0)
    with pytest.raises(mcz.MotionError, match="no joint 'elbow'"):
        extract_clips(whole, joints=["elbow"])
    signal = replace(
        smooth(4).signals[0], channels=tuple(mcz.Channel("", f"c{i}") for i in range(10))
    )
    with pytest.raises(mcz.OptionError, match="is not made of joints"):
        extract_clips(write_bytes(replace(smooth(4), signals=(signal,))), joints=["spine"])


def test_damage_is_found_and_not_copied() -> None:
    whole = bytearray(write_bytes(rich()))
    with mcz.open(bytes(whole)) as file:
        row = file.clips["smooth"].signals[0].rows[3]
    whole[row.offset + row.size - 1] ^= 1
    with pytest.raises(mcz.ChecksumError, match="crc of chunk DATA"):
        extract_clips(bytes(whole), frames=(20, 30), joints=["hips"])


def test_an_uncut_clip_is_copied_as_it_is() -> None:
    out = io.BytesIO()
    writer = Writer(out)
    writer.attachment("notes.txt", b"kept")
    for name in ("a", "b"):
        write_clip(writer, replace(rich(), name=name), codecs.codec_by_name("raw"), {})
        writer.ancillary(b"abCD", name.encode())
        writer.ancillary(b"abCE", b"", safe_to_copy=False)
    writer.finish()
    found = mcz.extract(out.getvalue(), part := io.BytesIO(), clip="b")
    assert [clip.name for clip in found.clips] == ["b"]
    assert found.size == len(part.getvalue())
    assert len(found.left_out) == 1
    assert "abCE" in found.left_out[0]
    before, after = parts_of(out.getvalue()), parts_of(part.getvalue())
    start = max(i for i, (chunk, _) in enumerate(before) if chunk.type == b"CLIP")
    kept = [payload for chunk, payload in before[start:] if chunk.type != b"abCE"]
    assert [payload for _, payload in after[2:]] == kept
    with mcz.open(part.getvalue()) as file:
        assert validate(file) == []
        assert list(file.attachments) == []
        assert file.clips["b"].quality is None


def test_all_clips_are_cut_alike_and_the_rest_is_kept() -> None:
    out = io.BytesIO()
    writer = Writer(out, head_extension=b"later")
    writer.ancillary(b"abCD", b"before all clips")
    writer.shared(b"MODL", build_record(payloads.Modl, {"kind": 77, "data": b"learned"}, "MODL"))
    writer.attachment("notes.txt", b"kept")
    writer.alias("more.txt", payloads.OF_ATTACHMENT, b"notes.txt")
    for name in ("a", "b"):
        write_clip(writer, replace(rich(), name=name), codecs.codec_by_name("raw"), {})
    writer.finish()
    part = extract_clips(out.getvalue(), frames=(3, 9))
    with mcz.open(part) as file:
        assert validate(file) == []
        assert file.container.directory.head.endswith(b"later")
        assert [clip.n_frames for clip in file.clips.values()] == [6, 6]
        assert file.attachments["notes.txt"].read() == b"kept"
        assert list(file.aliases) == ["more.txt"]
        assert (b"abCD", b"before all clips") in [(c.type, p) for c, p in parts_of(part)]
        assert [c.type for c, _ in parts_of(part)].count(b"MODL") == 1


def test_listed_groups_and_extensions() -> None:
    """Groups of kind 3 are those that are left; what is not known is kept."""
    whole = write_bytes(rich())
    listed = {"kind": payloads.GROUP_LISTED, "sizes": [6, 3, 1]}
    data = clip_with(whole, groups=listed, extended=b"of a signal")
    part = extract_clips(data, joints=["hips", "knee"], frames=(5, 30))
    check(whole, part, 5, 30, ["hips", "knee"], 0)
    fields = clip_fields_of(part)
    assert list(fields.signals[0].groups.sizes) == [6, 1]
    assert fields.signals[0].extension == b"of a signal"


def test_extensions_are_kept_in_what_is_cut() -> None:
    whole = (
        Path(__file__).parents[1] / "conformance/vectors/valid/extensions/all.mcz"
    ).read_bytes()
    part = extract_clips(whole, frames=(1, 2))
    found = [(chunk.type, payload.count(b"later version")) for chunk, payload in parts_of(part)]
    for type_, n in ((b"HEAD", 1), (b"SRCE", 1), (b"MODL", 1), (b"ATTA", 1), (b"QUAL", 1)):
        assert (type_, n) in found
    assert [n for type_, n in found if type_ == b"SKEL"] == [3, 3]
    assert [n for type_, n in found if type_ == b"CLIP"] == [3, 3]
    assert {n for type_, n in found if type_ in (b"DATA", b"CEND")} == {1}


def test_an_open_clip_is_closed() -> None:
    whole = write_bytes(rich())
    part = extract_clips(clip_with(whole, flags=1, n_frames=0), frames=(5, 30))
    check(whole, part, 5, 30, None, 0)
    assert clip_fields_of(part).flags == payloads.HAS_TIME_BASE


class _Live(Writer):
    """Every clip in one open DATA, behind an ancillary chunk."""

    def begin_clip(self, fields: Any) -> None:
        super().begin_clip(fields)
        self.ancillary(b"abCD", b"inside")
        self.open_data()


def test_ancillary_chunks_inside_a_clip_are_kept() -> None:
    out = io.BytesIO()
    writer = _Live(out)
    write_clip(writer, rich(), codecs.codec_by_name("raw"), {})
    writer.finish()
    for how in ({"frames": (3, 9)}, {"clip": "smooth"}):
        kinds = [chunk.type for chunk, _ in parts_of(extract_clips(out.getvalue(), **how))]
        assert kinds.index(b"CLIP") < kinds.index(b"abCD") < kinds.index(b"CEND")


def test_skeleton_of_joints_keeps_the_tree() -> None:
    whole = write_bytes(rich())
    with mcz.open(whole) as old, mcz.open(extract_clips(whole, joints=["knee", "fixed"])) as new:
        before, after = old.clips["smooth"].skeleton, new.clips["smooth"].skeleton
        assert [j.name for j in after.joints] == list(JOINTS)
        assert [len(j.channels) for j in after.joints] == [0, 0, 0, 1]
        assert [replace(j, channels=()) for j in before.joints] == [
            replace(j, channels=()) for j in after.joints
        ]
        assert after.base == old.clips["smooth"].skeleton_id
        assert new.skeleton(after.base) == before


def quality(data: bytes) -> dict[str, str]:
    with mcz.open(data) as file:
        return next(iter(file.clips.values())).quality or {}


def test_quality_says_what_was_cut() -> None:
    motion = replace(smooth(40), signals=(Signal(smooth(40).signals[0].values),))
    whole = write_bytes(motion, "overlap")
    assert quality(whole)["param.length"] == "7"
    part = extract_clips(whole, frames=(10, 30), joints=["hips", "knee"], resolution=1)
    found = quality(part)
    assert found["cut-frames"] == "10:30"
    assert found["cut-joints"] == "hips,knee"
    assert found["cut-resolution"] == "1"
    assert found["param.length"] == "7"
    assert found["uncut_mse"] == quality(whole)["mse"]
    assert "mse" not in found
    again = quality(extract_clips(part, frames=(3, 5), joints=["knee"]))
    assert again == found | {"cut-frames": "13:15", "cut-joints": "knee"}
    assert quality(extract_clips(part, clip="smooth")) == found
    assert quality(extract_clips(write_bytes(rich()), frames=(1, 2))) == {"cut-frames": "1:2"}


@pytest.mark.parametrize("suffix", ["amc", "bvh", "c3d"])
@pytest.mark.parametrize("codec", ["fast", "raw"])
def test_sources_of_cut_frames(samples: Path, tmp_path: Path, suffix: str, codec: str) -> None:
    path = tmp_path / "whole.mcz"
    mcz.encode(samples / f"walk.{suffix}", path, codec=codec, params={"segment_frames": 32})
    part = tmp_path / "part.mcz"
    found = mcz.extract(path, part, frames=(37, 101))
    assert found.clips[0].stored_frames == 96
    with mcz.open(path) as old, mcz.open(part) as new:
        assert mcz.verify(part) == []
        wanted = old.clips["walk"].source_bytes((37, 101))
        assert new.clips["walk"].source_bytes() == wanted
        assert new.clips["walk"].source is not None
        assert new.clips["walk"].source.size == len(wanted)
        piece = old.clips["walk"].source_bytes((40, 45))
        assert new.clips["walk"].source_bytes((3, 8)) == piece
    (tmp_path / f"part.{suffix}").write_bytes(wanted)
    skeleton = {"skeleton": samples / "walk.asf"} if suffix == "amc" else {}
    read = mcz.read(tmp_path / f"part.{suffix}", **skeleton)
    np.testing.assert_array_equal(read.values, mcz.read(part).values)


def test_sources_of_cut_joints(samples: Path, tmp_path: Path) -> None:
    mcz.encode(samples / "walk.amc", tmp_path / "whole.mcz")
    found = mcz.extract(tmp_path / "whole.mcz", tmp_path / "part.mcz", joints=["lfemur", "root"])
    assert found.left_out == ["clip walk: its source file, as joints were cut"]
    with mcz.open(tmp_path / "part.mcz") as file:
        clip = file.clips["walk"]
        assert clip.source is None
        assert "left out when joints were cut" in clip.metadata["source-note"]
        assert clip.skeleton.base is not None
        assert file.skeleton_bytes(clip.skeleton.base) == (samples / "walk.asf").read_bytes()
        assert list(file.aliases) == ["walk.asf"]
        assert validate(file) == []


def test_a_source_that_cannot_be_cut_is_left_out(
    samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mcz.sources import FORMATS

    def refuse(motion: mcz.Motion) -> bytes:
        raise mcz.MotionError("only whole clips can be written")

    mcz.encode(samples / "walk.c3d", tmp_path / "whole.mcz")
    monkeypatch.setitem(FORMATS, "c3d", replace(FORMATS["c3d"], write=refuse))
    found = mcz.extract(tmp_path / "whole.mcz", tmp_path / "part.mcz", frames=(3, 9))
    assert found.left_out == ["clip walk: its source file, as only whole clips can be written"]
    with mcz.open(tmp_path / "part.mcz") as file:
        assert file.clips["walk"].source is None
        assert validate(file) == []


def test_aliases_of_cut_clips_are_left_out(samples: Path, tmp_path: Path) -> None:
    folder = tmp_path / "take"
    folder.mkdir()
    for name in ("walk.bvh", "same.bvh"):
        (folder / name).write_bytes((samples / "walk.bvh").read_bytes())
    mcz.pack(folder, tmp_path / "all.mcz")
    found = mcz.extract(tmp_path / "all.mcz", tmp_path / "part.mcz", frames=(0, 50))
    assert len(found.left_out) == 1
    assert found.left_out[0].startswith("walk.bvh, a file identical to that of clip same")
    with mcz.open(tmp_path / "part.mcz") as file:
        assert dict(file.aliases) == {}
    found = mcz.extract(tmp_path / "all.mcz", tmp_path / "one.mcz", clip="same")
    assert found.left_out == []
    with mcz.open(tmp_path / "one.mcz") as file:
        assert list(file.aliases) == ["walk.bvh"]
        assert validate(file) == []


def test_resolution_beside_a_signal_without_any() -> None:
    """A second signal loses as many resolutions as it has, here none."""
    motion = rich()
    out = io.BytesIO()
    writer = Writer(out)
    write_clip(writer, replace(motion, signals=motion.signals[:1]), overlap_codec.CODEC, {})
    write_clip(writer, replace(motion, name="raw"), codecs.codec_by_name("raw"), {})
    writer.finish()
    with pytest.raises(mcz.OptionError, match="clip 'raw': cannot leave out the 1 finest"):
        extract_clips(out.getvalue(), resolution=1)
    found = mcz.extract(out.getvalue(), io.BytesIO(), resolution=1, clip="smooth")
    assert found.clips[0].data_bytes < 0.6 * found.clips[0].data_bytes_before


# Decimation


def test_motion_at_a_resolution() -> None:
    motion = replace(smooth(45), frame_numbers=np.arange(45) + 3)
    with mcz.open(write_bytes(motion, "overlap")) as file:
        clip = file.clips["smooth"]
        coarse = clip.motion((4, 40), 1)
        np.testing.assert_array_equal(coarse.values, clip.read((4, 40), resolution=1))
        assert coarse.frame_rate == 120
        thin = clip.motion((4, 40), 1, decimate=True)
        np.testing.assert_array_equal(thin.values, clip.read((4, 40), None, 1, decimate=True))
        assert thin.frame_numbers is not None
        assert list(thin.frame_numbers) == list(range(7, 43, 2))
        assert thin.frame_rate == 60
        with pytest.raises(mcz.OptionError, match="no resolution 2: it has resolutions 0 to 1"):
            clip.motion(resolution=2)


@pytest.mark.parametrize("suffix", ["amc", "bvh"])
def test_files_at_a_resolution(samples: Path, tmp_path: Path, suffix: str) -> None:
    """The original format at half the rate; numbers of frames stay what they were."""
    motion = replace(mcz.read(samples / f"walk.{suffix}"), frame_rate=120)
    mcz.write(motion, tmp_path / "a.mcz", "overlap", length=20)
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file.clips["walk"]
        values = clip.read(resolution=1)
        full = clip.source_bytes(resolution=1)
        thin = clip.source_bytes(resolution=1, decimate=True)
        assert clip.motion(decimate=True).source is not None
        assert (clip.motion(None, 1, decimate=True).source is None) is (suffix == "bvh")
    skeleton = {"skeleton": samples / "walk.asf"} if suffix == "amc" else {}
    for text, step in ((full, 1), (thin, 2)):
        (tmp_path / f"b.{suffix}").write_bytes(text)
        back = mcz.read(tmp_path / f"b.{suffix}", **skeleton)
        assert back.n_frames == len(values[::step])
        np.testing.assert_allclose(back.values, values[::step], rtol=1e-5, atol=1e-4)
        if suffix == "bvh":
            assert float(back.frame_rate or 0) == pytest.approx(120 / step)
        elif step == 2:
            assert back.frame_numbers is not None
            assert list(back.frame_numbers[:3]) == [1, 3, 5]


# Hostile


def clip_fields_of(data: bytes) -> Any:
    (payload,) = (p for chunk, p in parts_of(data) if chunk.type == b"CLIP")
    return parse(payloads.Clip, payload, "CLIP")


def clip_with(
    data: bytes,
    *,
    flags: int = 0,
    n_frames: int | None = None,
    extended: bytes = b"",
    **signal: Any,
) -> bytes:
    """The file with other fields in its clip and the first signal, checksums made right.

    Where it is open, its missing frames are told by CEND.
    """
    parts = parts_of(data)
    which = next(i for i, (chunk, _) in enumerate(parts) if chunk.type == b"CLIP")
    fields = clip_fields_of(data)
    fields.flags |= flags
    fields.n_frames = fields.n_frames if n_frames is None else n_frames
    update(fields.signals[0], signal)
    if extended:
        own_flags = fields.signals[0].flags | EXTENDED
        update(fields.signals[0], {"flags": own_flags, "extension": extended})
    if fields.flags & payloads.OPEN_CLIP:
        end = next(i for i, (chunk, _) in enumerate(parts) if chunk.type == b"CEND")
        cend = parse(payloads.Cend, parts[end][1], "CEND")
        cend.missing, fields.time_base.missing = fields.time_base.missing, []
        assert cend.missing
        parts = replace_payload(parts, end, build_record(payloads.Cend, cend, "CEND"))
    return join_parts(replace_payload(parts, which, build_record(payloads.Clip, fields, "CLIP")))


def test_a_clip_without_an_end_shows_what_is_there() -> None:
    part = extract_clips(write_bytes(rich()), frames=(9, 30))
    parts = [p for p in parts_of(part) if p[0].type != b"CEND"]
    with mcz.open(join_parts(parts), salvage=True) as file:
        clip = file.clips["smooth"]
        assert clip.n_frames == 21
        with mcz.open(part) as whole:
            np.testing.assert_array_equal(clip.read(), whole.clips["smooth"].read())
    data = [i for i, p in enumerate(parts) if p[0].type == b"DATA"]
    with mcz.open(
        join_parts([p for i, p in enumerate(parts) if i not in data[1:]]), salvage=True
    ) as f:
        assert f.clips["smooth"].n_frames == 5


# The command


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion = replace(smooth(40), signals=(Signal(smooth(40).signals[0].values),))
    mcz.write(motion, tmp_path / "a.mcz", "overlap")
    a, b = str(tmp_path / "a.mcz"), str(tmp_path / "b.mcz")
    how = ("--frames", "10:", "--joints", "hips, 3", "--resolution", "1")
    assert run("extract", a, b, *how, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["output"] == b
    assert document["size"] == Path(b).stat().st_size
    (clip,) = document["clips"]
    assert clip["frames"] == [10, 40]
    assert clip["joints"] == ["hips", "knee"]
    assert clip["resolution"] == 1
    assert run("extract", a, b, *how) == 2  # exists
    assert "exists" in capsys.readouterr().err
    assert run("extract", a, b, *how, "--force") == 0
    shown = capsys.readouterr().out
    assert "1 clip" in shown
    assert "frames 10:40, joints hips knee, resolution 1" in shown
    assert run("verify", b) == 0
    assert run("extract", a, b, "--force") == 2
    assert run("extract", a, "-") == 2
    assert run("extract", a, b, "--joints", "elbow", "--force") == 1


@pytest.mark.parametrize("target", ["bvh", "csv", "npz"])
def test_decode_at_a_resolution(samples: Path, tmp_path: Path, target: str) -> None:
    mcz.write(mcz.read(samples / "walk.bvh"), tmp_path / "a.mcz", "overlap", length=20)
    a, b = str(tmp_path / "a.mcz"), str(tmp_path / f"b.{target}")
    with mcz.open(a) as file:
        wanted = file.clips["walk"].read((3, 50), resolution=1)[::2]
    how = ("-o", b, "--frames", "3:50", "--resolution", "1", "--decimate")
    assert run("decode", a, *how, "--to", target) == 0
    if target == "bvh":
        decoded = mcz.read(b)
        assert float(decoded.frame_rate or 0) == pytest.approx(60)
        np.testing.assert_allclose(decoded.values, wanted, rtol=0, atol=6e-5)
        assert run("decode", a, *how, "--force") == 0
        np.testing.assert_allclose(mcz.read(b).values, wanted, rtol=0, atol=6e-5)
    elif target == "npz":
        arrays = np.load(b, allow_pickle=False)
        np.testing.assert_array_equal(arrays["values"], wanted)
        assert arrays["frame_numbers"].tolist() == list(range(4, 51, 2))
    else:
        assert len(Path(b).read_text().splitlines()) == 1 + len(wanted)
    assert run("decode", a, "-o", b, "--decimate", "--force") == 2
