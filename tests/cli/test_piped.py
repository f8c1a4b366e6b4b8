"""``mcz encode -``: standard input, frame by frame over real pipes, and as a whole."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import live_frames
from mcz.files.live.clip_state import StrictFrames
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.file import EncodingOptions
from mcz.sources import FORMATS
from tests.commands import Started
from tests.commands import run_piped as run
from tests.live_codec import encode_live

HEADER = (
    b"HIERARCHY\nROOT hips\n{\n  OFFSET 1 2 3\n  CHANNELS 3 Xposition Yposition Zposition\n"
    b"  JOINT arm\n  {\n    OFFSET 0 4 0\n    CHANNELS 1 Zrotation\n    End Site\n    {\n"
    b"      OFFSET 0 2 0\n    }\n  }\n}\nMOTION\nFrames: 3\nFrame Time: .0083333\n"
)
LINES = b"1 2 3 10\n", b"1.5 2 3 20\n", b"2 2.25 3 30\n"
VALUES = np.array([[1, 2, 3, 10], [1.5, 2, 3, 20], [2, 2.25, 3, 30]])
ASF = (
    b":version 1.10\n:name VICON\n:units\n  length 0.45\n  angle deg\n:root\n"
    b"  order TX TY TZ RX RY RZ\n  axis XYZ\n  position 0 0 0\n  orientation 0 0 0\n"
    b":bonedata\n  begin\n    id 1\n    name knee\n    direction 0 1 0\n    length 2\n"
    b"    axis 0 0 20 XYZ\n    dof rx\n  end\n:hierarchy\n  begin\n    root knee\n  end\n"
)
AMC = (
    b"#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n3\n",
    b"root 1 2 3 4 5 6\n",
    b"knee 15\n",
    b"4\n",
    b"knee 20\n",
    b"root 1 2 3.5 4 5 -7\n",
)
STEP = ("--param", "step=0.01", "--codec", "lsdt-frame")


@pytest.fixture
def asf(tmp_path: Path) -> Path:
    path = tmp_path / "knee.asf"
    path.write_bytes(ASF)
    return path


def test_each_frame_is_out_before_the_next_line_is_read() -> None:
    with Started("encode", "-", *STEP, "--param", "domain=channels") as piped:
        piped.say(HEADER)
        found = live_frames(piped.stdout)
        for number, (line, row) in enumerate(zip(LINES, VALUES, strict=True)):
            piped.say(line[:3])
            piped.say(line[3:])  # its line end completes a frame
            frame, values, valid = next(found)  # waits for ever if it were held back
            assert frame == number
            np.testing.assert_allclose(values, row, atol=0.02)
            assert valid.all()
        piped.stdin.close()
        assert (list(found), piped.end()) == ([], 0)


def test_bones_complete_a_frame_of_an_amc(asf: Path) -> None:
    words = ("encode", "-", *STEP, "--skeleton", asf, "--param", "domain=channels")
    with Started(*words) as piped:
        piped.say(b"".join(AMC[:3]))
        found = live_frames(piped.stdout)
        np.testing.assert_allclose(next(found)[1], [1, 2, 3, 4, 5, 6, 15], atol=0.02)
        piped.say(b"".join(AMC[3:]))
        np.testing.assert_allclose(next(found)[1], [1, 2, 3.5, 4, 5, -7, 20], atol=0.02)
        piped.stdin.close()
        assert (list(found), piped.end()) == ([], 0)


def test_positions_of_a_bvh_from_a_pipe(tmp_path: Path) -> None:
    out = tmp_path / "out.mcz"
    data = HEADER + b"".join(LINES)
    code, said, errors = run("encode", "-", *STEP, "-o", out, "--unit", "cm", data=data)
    assert (code, errors) == (0, "")
    assert said.decode().startswith(f"{out}: 3 frames of 4 channels, live; ")
    assert mcz.verify(out) == []
    (tmp_path / "a.bvh").write_bytes(data)
    wanted = mcz.positions(mcz.read(tmp_path / "a.bvh")).reshape(3, -1)
    with mcz.open(out) as file:
        clip = file.clips["live"]
        np.testing.assert_allclose(clip.read(), wanted, atol=0.03)
        assert [joint.name for joint in clip.skeleton.joints] == ["hips", "arm", "arm end"]
        assert clip.frame_rate == 120
        note = "positions by forward kinematics; coded live, frame by frame, from BVH text"
        assert clip.metadata["source-note"].startswith(note)
        assert clip.quality is not None
        assert float(clip.quality["max_position_error_cm"]) < 0.03
    assert run("encode", "-", *STEP, "-o", out, data=data)[0] == 2
    assert run("encode", "-", *STEP, "-o", out, "--force", data=data)[0] == 0


def test_lossy_goes_live_where_that_is_asked_for(tmp_path: Path) -> None:
    """Without levels frame by frame; otherwise, as ever, when all frames are there."""
    out, data = tmp_path / "out.mcz", HEADER + b"".join(LINES)
    lossy = ("encode", "-", "--codec", "lossy", "--unit", "cm", "-o", out, "--force")
    code, said, _ = run(*lossy, "--param", "levels=0", data=data)
    assert (code, b"4 channels, live; " in said) == (0, True)
    (tmp_path / "a.bvh").write_bytes(data)
    wanted = mcz.read(tmp_path / "a.bvh", unit="cm")
    with mcz.open(out) as file:
        error = mcz.compare(wanted, file.clips["live"].motion(), virtual_markers=False)
    assert error.max_position_error_cm is not None
    assert error.max_position_error_cm <= 0.5
    code, said, _ = run(*lossy, data=data)
    assert (code, b", live; " in said) == (0, False)
    assert run(*lossy, "--param", "level=0", data=data)[0] == 2


def test_text_that_breaks_off_leaves_what_was_whole(tmp_path: Path) -> None:
    out = tmp_path / "out.mcz"
    data = HEADER + LINES[0] + LINES[1] + b"1 2 x 3\n"
    code, _, errors = run("encode", "-", *STEP, "-o", out, data=data)
    assert code == 1
    assert errors == (
        "mcz: standard input: line 21: 'x' is not a number; the stream is aborted after 2 frames, "
        "and has no end\n"
    )
    assert count_frames(out) == 2


def count_frames(path: Path) -> int:
    """The frames in a clip without an end, which only salvage opens."""
    with pytest.raises(mcz.TruncatedError):
        mcz.open(path)
    with mcz.open(path, salvage=True) as file:
        return file.clips["live"].n_frames


def test_a_source_that_dies_in_a_frame_leaves_no_end(tmp_path: Path, asf: Path) -> None:
    out = tmp_path / "out.mcz"
    bvh, amc = HEADER + b"".join(LINES), b"".join(AMC)
    for data, arguments, whole in (
        (bvh[:-1], (), 2),  # amid the last line, or at its end
        (bvh[: -len(LINES[2])], (), 2),  # between two lines: 3 frames are declared
        (amc[: amc.rindex(b" ") + 2], ("--skeleton", asf), 1),
        (b"".join((*AMC[:4], AMC[5])), ("--skeleton", asf), 1),  # the last bone did not come
    ):
        code, _, errors = run("encode", "-", *STEP, *arguments, "-o", out, "--force", data=data)
        assert (code, "has no end" in errors) == (1, True), data
        assert count_frames(out) == whole


def test_codecs_that_are_not_live_read_all(tmp_path: Path, asf: Path) -> None:
    data = HEADER + b"".join(LINES)
    out = tmp_path / "out.mcz"
    assert run("encode", "-", data=data)[0] == 2
    assert run("encode", "-", "-o", out, data=data)[0] == 0
    with mcz.open(out) as file:
        assert file.clips["stdin"].source_bytes() == data
    amc = b"".join(AMC)
    code, coded, _ = run("encode", "-", "-o", "-", "--skeleton", asf, data=amc)
    assert code == 0
    with mcz.open(coded) as file:
        assert file.clips["stdin"].source_bytes() == amc
    assert run("encode", "-", "-o", out, "--force", data=b"what?")[0] == 2
    assert run("encode", "-", "-o", out, "--force", "--format", "bvh", data=b"what?")[0] == 1


@pytest.mark.parametrize(
    "arguments",
    [("--archive",), ("--verbatim",), ("--json",), ("--format", "c3d"), ("--format", "amc")],
)
def test_what_has_no_meaning_live(arguments: tuple[str, ...]) -> None:
    code, said, errors = run("encode", "-", *STEP, *arguments, data=HEADER)
    assert (code, said) == (2, b"")
    assert errors.startswith("mcz: ")


def test_format_is_for_standard_input(asf: Path) -> None:
    assert run("encode", asf, "--format", "asf")[0] == 2


# The parsers, without a process ---------------------------------------------


def lines(data: bytes) -> Iterator[bytes]:
    return iter(io.BytesIO(data).readline, b"")


def parse_rows(name: str, data: bytes, *skeleton: mcz.Skeleton) -> np.ndarray:
    arriving = FORMATS[name].arrive(lines(data), *skeleton)
    rows = [row for _, row in arriving.frames]
    return np.array(rows).reshape(len(rows), arriving.skeleton.n_channels)


def test_bvh_arrives_as_it_is_read() -> None:
    odd = HEADER.replace(
        b"Frame Time: .0083333\n", b"Frame Time:\n.01 1 2\n 3 # 4\n 10 1.5\n2 3 20 "
    )
    whole = FORMATS["bvh"].read(odd)
    np.testing.assert_array_equal(parse_rows("bvh", odd), whole.values)
    arriving = FORMATS["bvh"].arrive(lines(odd))
    assert arriving.skeleton == whole.skeleton
    assert arriving.frame_rate == whole.frame_rate == 100


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "no HIERARCHY"),
        (HEADER[:60], "channels are named"),
        (HEADER + b"1 2 3", "3 of 4 values"),
        (HEADER.replace(b"Frames: 3\n", b""), "'Frames:' must follow MOTION"),
        (
            b"HIERARCHY\nROOT a\n{\n}\nMOTION\nFrames: 1\nFrame Time: 1\n",
            "no joint has channels",
        ),
    ],
)
def test_bad_bvh(data: bytes, match: str) -> None:
    with pytest.raises(mcz.SourceError, match=match):
        parse_rows("bvh", data)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b":DEGREES\n", "no line with a frame number"),
        (b"1\nroot 1 2 3 4 5 6\nknee 1\nknee 2\n", "twice"),
        (b"1\nroot 1 2 3 4 5 6\nknee 1\ntoe 2\n", "is not in the first frame"),
        (b"1\nroot 1 2 3 4 5 6\nknee 1\n2\nknee 1 2\n", "2 values for bone"),
        (b"1\nroot 1 2 3 4 5 x\nknee 1\n", "not a number"),
        (b"12345678901234567\n", "too large"),
    ],
)
def test_bad_amc(asf: Path, data: bytes, match: str) -> None:
    with pytest.raises(mcz.SourceError, match=match):
        parse_rows("amc", data, mcz.read_skeleton(asf))
    with pytest.raises(mcz.SourceError, match="needs its skeleton"):
        FORMATS["amc"].arrive(lines(data))


def in_channels(asf: Path) -> tuple[SourceOptions, EncodingOptions]:
    encoding = EncodingOptions("lsdt-frame", {"step": 0.01, "domain": "channels"})
    return SourceOptions(skeleton=asf), encoding


def test_bones_that_are_missing_are_invalid(asf: Path) -> None:
    data = b":DEGREES\n1\nroot 1 2 3 4 5 6\nknee 7\n2\nroot 1 2 3 4 5 6\n4\nknee 8\n"
    whole = FORMATS["amc"].read(data, "x", mcz.read_skeleton(asf))
    np.testing.assert_array_equal(parse_rows("amc", data, mcz.read_skeleton(asf)), whole.values)
    out = io.BytesIO()
    report = encode_live(lines(data), out, "amc", *in_channels(asf))
    assert report.remarks == ()
    with mcz.open(out.getvalue()) as file:
        assert file.clips["live"].frame_numbers.tolist() == [1, 2, 4]
        decoded = file.clips["live"].read()
        np.testing.assert_array_equal(np.isnan(decoded), np.isnan(whole.values))
        assert file.skeleton_bytes(file.clips["live"].skeleton_id) == ASF


def test_numbers_that_fall_are_counted_on(asf: Path) -> None:
    data = b"".join(b"%d\nroot 1 2 3 4 5 6\nknee 7\n" % n for n in (7, 9, 3, 4, 6))
    out = io.BytesIO()
    report = encode_live(lines(b":DEGREES\n" + data), out, "amc", *in_channels(asf))
    assert report.remarks == ("frame 3 instead of 10; the clip continues its count",)
    with mcz.open(out.getvalue()) as file:
        assert file.clips["live"].frame_numbers.tolist() == [7, 9, 10, 11, 13]


def test_other_channels_than_the_asf(asf: Path) -> None:
    data = b":RADIANS\n5\nroot 1 2 3 4 5 6\nknee 7 8 9\n6\nroot 1 2 3 4 5 6\nknee 7 8 9\n"
    out = io.BytesIO()
    encode_live(lines(data), out, "amc", *in_channels(asf))
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["live"]
        assert clip.skeleton.n_channels == 9
        assert clip.skeleton.angle_unit == "rad"
        assert clip.skeleton.base is not None
        assert file.skeleton_bytes(clip.skeleton.base) == ASF
        assert clip.frame_numbers.tolist() == [5, 6]


@pytest.mark.real
def test_real_clips_live(data: Path) -> None:
    """A clip of each format, its first frames: as the whole file gives them, to the step."""
    asf, amc = data / "cmu/asf/17.asf", data / "cmu/amc/17_10.amc"
    bvh = data / "cmu/bvh/17_10.bvh"
    text = b"".join(amc.read_bytes().splitlines(keepends=True)[: 3 + 30 * 50])
    motion = FORMATS["amc"].read(text, "17_10", mcz.read_skeleton(asf))
    out = io.BytesIO()
    encoding = EncodingOptions("lsdt-frame", {"step": 0.05})
    encode_live(lines(text), out, "amc", SourceOptions(skeleton=asf), encoding)
    with mcz.open(out.getvalue()) as file:
        decoded = file.clips["live"].read().reshape(motion.n_frames, -1, 3)
    distances = np.sqrt(((decoded - mcz.positions(motion)) ** 2).sum(axis=2))
    assert distances.mean() < 0.05
    for path in (bvh,) if bvh.exists() else ():
        np.testing.assert_array_equal(parse_rows("bvh", path.read_bytes()), mcz.read(path).values)


def test_nothing_is_kept_that_was_used() -> None:
    out = io.BytesIO()
    text = HEADER + b"".join(LINES) * 500
    encode_live(
        lines(text), out, "bvh", SourceOptions(), EncodingOptions("lsdt-frame", {"step": 0.01})
    )
    reader = StrictFrames(io.BytesIO(out.getvalue()), mcz.StreamSummary())
    for _ in reader.frames():
        assert reader.scanner.clip is not None
        assert len(reader.scanner.clip.segments) == 1
        assert len(reader.scanner.result.chunks) <= 1
    assert reader.scanner.result.chunks == []


def test_frames_that_did_not_come_are_remarked(tmp_path: Path) -> None:
    target = tmp_path / "walk.mcz"
    code, _, errors = run("encode", "-", *STEP, "-o", target, data=HEADER + LINES[0])
    assert code == 1 and "3 frames are declared, 1 came" in errors
    more = HEADER + b"".join(LINES) + LINES[0]
    code, _, errors = run("encode", "-", *STEP, "-o", target, "--force", data=more)
    assert code == 0 and "3 frames are declared, 4 came" in errors
    whole = HEADER + b"".join(LINES)
    code, _, errors = run("encode", "-", *STEP, "-o", target, "--force", data=whole)
    assert (code, errors) == (0, "")


def test_what_is_refused_leaves_an_old_file_alone(tmp_path: Path) -> None:
    target = tmp_path / "walk.mcz"
    target.write_bytes(b"dear")
    data = HEADER + b"".join(LINES)
    marked = ("--param", "virtual_markers=true", "--force")
    assert run("encode", "-", *STEP, *marked, "-o", target, data=data)[0] == 2
    assert target.read_bytes() == b"dear"
    assert run("encode", "-", *STEP, "-o", target, data=data)[0] == 2
    assert target.read_bytes() == b"dear"
    assert run("encode", "-", *STEP, "--force", "-o", target, data=data)[0] == 0
    assert mcz.verify(target) == []
