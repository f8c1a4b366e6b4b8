"""Live streams with losses: what came is decoded, what did not is said."""

from __future__ import annotations

import io
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import codecs
from mcz.container import limits, payloads
from mcz.container.chunks import (
    CHECK_SIZE,
    END,
    FRAME,
    OPEN_LENGTH,
    SEGMENT,
    SIGNATURE,
    ChunkFlag,
    ChunkType,
    Packet,
    build_chunk,
    build_foot,
    build_header,
    build_packet,
    head_size,
    implied_by,
)
from mcz.container.parser_drivers import repeated_chunks
from mcz.container.scan import scan
from mcz.container.segments import FRESH, SegmentHeader, build_segment
from mcz.container.source import open_source
from mcz.files.live.clip_state import LiveFrame
from mcz.files.live.reader_with_losses import MOST_MADE_UP
from mcz.files.reading.report import info
from mcz.files.reading.sizes import layout
from mcz.model.schema import build, parse
from tests import live_codec
from tests.amounts import amount
from tests.clocked_files import bvh
from tests.repair import flip_bit, parts_of, use
from tools.records import build_record

NAMES = ("a", "b", "c")
CODECS = {
    "stairs": {"every": 10},
    "lsdt-frame": {"step": 0.02, "segment_frames": 10},
    "online": {"step": 0.02, "gof": 5, "intra_period": 2},
    "posewave": {"step": 0.02, "segment_frames": 10},
}
CODEC = pytest.mark.parametrize("codec", CODECS)


@pytest.fixture(autouse=True)
def stairs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, live_codec.CODEC.name, live_codec.CODEC)


def rows(n: int = 60, seed: int = 1) -> np.ndarray:
    """Multiples of an eighth; one value is missing."""
    values = np.random.default_rng(seed).integers(-9, 9, (n, 9)).cumsum(axis=0) / 8 + 20
    if n > 15:
        values[15, 3] = np.nan
    return values


def pieces(codec: str = "stairs", n: int = 60, **more: object) -> list[bytes]:
    """Split a stream: its beginning, the bytes of each frame, its end."""
    codecs.CODECS[live_codec.CODEC.name] = live_codec.CODEC
    rate = Fraction(120)
    given = {"params": CODECS[codec], "frame_rate": rate, "unit": "cm"} | more
    return list(mcz.stream_encode(rows(n), NAMES, codec=codec, **given))


def read(data: bytes, **how: object) -> tuple[list[LiveFrame], mcz.StreamSummary]:
    reader = mcz.stream_decode(io.BytesIO(data), **how)
    return list(reader), reader.summary


def states(found: list[LiveFrame]) -> str:
    """A letter a frame: d, c or m."""
    return "".join(frame.state[0] for frame in found)


def check_decoded(found: list[LiveFrame], whole: list[LiveFrame]) -> None:
    """Every frame said to be decoded is that of the lossless run, bit for bit."""
    for frame in found:
        if frame.state == "decoded":
            np.testing.assert_array_equal(frame.values, whole[frame.number].values)
            np.testing.assert_array_equal(frame.valid, whole[frame.number].valid)
        assert np.isnan(frame.values[~frame.valid]).all()
        assert not np.isnan(frame.values[frame.valid]).any()
        if frame.state == "missing":
            assert not frame.valid.any()


def packet_spans(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of each packet with a frame."""
    spans, number = [], 0
    with mcz.open(data) as file:
        for row in file.clips["live"].signals[0].rows:
            number = 0 if row.header.flags & FRESH else number + 1
            spans.append((row.offset - head_size(number, row.size), row.stop + CHECK_SIZE))
    return spans


def without_packets(data: bytes, lost: set[int]) -> bytes:
    """The file without the packets of these frames."""
    kept, at = [], 0
    for frame, (start, stop) in enumerate(packet_spans(data)):
        if frame in lost:
            kept.append(data[at:start])
            at = stop
    return b"".join([*kept, data[at:]])


# REPT --------------------------------------------------------------------------


@CODEC
def test_what_is_repeated(codec: str) -> None:
    data = b"".join(pieces(codec))
    assert mcz.verify(data) == []
    use(data)
    use(data, salvage=True)
    found = scan(open_source(data))
    repeats = [chunk for chunk in found.chunks if chunk.type == ChunkType.REPT]
    assert [chunk.flags for chunk in repeats] == [ChunkFlag.ANCILLARY] * 5
    opening = pieces(codec)[0].removeprefix(SIGNATURE)
    for chunk in repeats:
        payload = data[chunk.payload_offset :][: chunk.length]
        assert payload == opening
        assert [inner.chunk.type for inner in repeated_chunks(payload, 0)] == [
            b"HEAD",
            b"SKEL",
            b"CLIP",
        ]
    with mcz.open(data) as file:
        clip = info(file)["clips"][0]
        assert clip["between_bytes"] == sum(chunk.size for chunk in repeats)
        assert sum(size for _, size, _ in layout(file)) == len(data)


@pytest.mark.parametrize(("repeat", "found"), [(0, 0), (1, 5), (2, 2), (3, 1), (9, 0)])
def test_every_so_many_fresh_frames_are_preceded_by_it(repeat: int, found: int) -> None:
    data = b"".join(pieces(repeat=repeat))
    assert sum(chunk.type == ChunkType.REPT for chunk, _ in parts_of(data)) == found
    assert mcz.verify(data) == []
    with pytest.raises(mcz.OptionError, match="repeat"):
        pieces(repeat=-1)


def test_rewriting_drops_it(tmp_path) -> None:
    path, other = tmp_path / "a.mcz", tmp_path / "b.mcz"
    path.write_bytes(b"".join(pieces()))
    mcz.extract(path, other, frames=(12, 47))
    assert all(chunk.type != ChunkType.REPT for chunk, _ in parts_of(other.read_bytes()))
    assert mcz.verify(other) == []
    with mcz.open(path) as a, mcz.open(other) as b:
        np.testing.assert_array_equal(b.clips["live"].read(), a.clips["live"].read((12, 47)))
    found, _ = read(other.read_bytes(), lost="hold")
    assert states(found) == "d" * 35
    assert [frame.number for frame in found] == list(range(35))
    one = tmp_path / "one.bvh"
    one.write_text(bvh("2", time="1"))
    mcz.append([one], path)
    assert mcz.verify(path) == []


def test_salvage_finds_a_clip_in_it() -> None:
    """Without CLIP before them, frames are found from the first REPT on."""
    parts = pieces()
    data = b"".join([parts[0][:-4], bytes(4), *parts[1:]])
    with mcz.open(data, salvage=True) as file:
        found = file.clips["live"].read()
    assert np.isnan(found[:10]).all()
    np.testing.assert_array_equal(found[10:], rows()[10:])


def test_salvage_is_not_misled_by_what_a_damaged_one_holds() -> None:
    data = b"".join(pieces())
    at = next(
        chunk for chunk in scan(open_source(data)).chunks if chunk.type == ChunkType.REPT
    ).offset
    for byte in (at, at + 5, at + 7, at + 9):
        with mcz.open(flip_bit(data, byte, 1), salvage=True) as file:
            assert list(file.clips) == ["live"]
            np.testing.assert_array_equal(file.clips["live"].read(), rows())


# Without losses ------------------------------------------------------------------


@CODEC
@pytest.mark.parametrize("lost", ["refuse", "missing", "hold", "linear"])
def test_nothing_lost_is_nothing_changed(codec: str, lost: str) -> None:
    parts = pieces(codec)
    data = b"".join(parts)
    strict = list(mcz.live_frames(io.BytesIO(data)))
    reader = mcz.stream_decode(iter(parts), lost=lost)
    for (number, values, valid), frame in zip(strict, reader, strict=True):
        assert (frame.number, frame.state) == (number, "decoded")
        np.testing.assert_array_equal(frame.values, values)
        np.testing.assert_array_equal(frame.valid, valid)
    summary = reader.summary
    assert (summary.decoded, summary.n_faults) == (60, 0)
    assert summary.is_checked
    assert not summary.is_cut
    assert summary.stream_bytes == len(data)
    with mcz.open(data) as file:
        streams = file.clips["live"].signals[0]
        tables = [file.container.table(row, streams.counts) for row in streams.rows]
    assert summary.payload_bytes == sum(table.lengths[table.codec(0, 0)] for table in tables)
    assert reader.clip is not None
    assert (reader.clip.name, reader.clip.frame_rate) == ("live", 120)


@CODEC
@pytest.mark.parametrize("lost", ["refuse", "hold"])
def test_each_frame_comes_with_its_bytes(codec: str, lost: str) -> None:
    """A row is asked for when the bytes of the one before are out, and those are enough for it."""
    asked: list[int] = []
    arrived: list[int] = []

    def give_rows() -> Iterator[np.ndarray]:
        for number, row in enumerate(rows()):
            assert arrived == list(range(number))
            asked.append(number)
            yield row

    sent = mcz.stream_encode(give_rows(), NAMES, codec=codec, params=CODECS[codec], unit="cm")
    for frame in mcz.stream_decode(sent, lost=lost):
        assert asked == list(range(frame.number + 1))
        arrived.append(frame.number)
    assert len(arrived) == 60


def test_clips_follow_each_other(tmp_path) -> None:
    first, second = tmp_path / "a.mcz", b"".join(pieces(n=12, name="second"))
    parts = pieces(n=25)
    first.write_bytes(b"".join(parts[:-1]))
    data = b"".join(parts) + second.removeprefix(SIGNATURE)
    reader = mcz.stream_decode(io.BytesIO(data), lost="hold")
    names = []
    for frame in reader:
        assert reader.clip is not None
        names.append((reader.clip.name, frame.number))
    assert names == [("live", n) for n in range(25)] + [("second", n) for n in range(12)]
    assert reader.summary.is_checked


def test_parameters_change_at_a_border() -> None:
    values = list(rows(40))
    frames = [*values[:7], {"step": 0.5}, *values[7:]]
    data = b"".join(mcz.stream_encode(frames, NAMES, codec="online", params=CODECS["online"]))
    assert mcz.verify(data) == []
    found = np.array([frame.values for frame in mcz.stream_decode(io.BytesIO(data))])
    known = ~np.isnan(np.array(values))
    errors = np.abs(found - values)
    assert errors[:10][known[:10]].max() < 0.05
    assert errors[20:][known[20:]].max() > 0.05
    with mcz.open(data) as file:
        quality = file.clips["live"].quality
    assert quality is not None
    assert "param.gof" in quality
    assert "param.step" not in quality  # it has had two values


def test_what_cannot_change() -> None:
    frames = [*rows(3), {"every": 5}]
    sent = mcz.stream_encode(frames, NAMES, codec="stairs")
    data = b""
    with pytest.raises(mcz.OptionError, match="nothing changes"):
        for part in sent:
            data += part
    found = mcz.stream_decode(data)
    assert [next(found).number for _ in range(3)] == [0, 1, 2]
    with pytest.raises(mcz.TruncatedError):  # the stream was aborted
        next(found)
    assert found.summary.is_cut
    with pytest.raises(mcz.OptionError, match="no parameter"):
        list(mcz.stream_encode([{"nothing": 1}], NAMES, codec="stairs"))


def test_names_of_markers() -> None:
    def joints(names: list[str]) -> list[str]:
        data = b"".join(mcz.stream_encode([], names, codec="stairs", unit="mm"))
        with mcz.open(data) as file:
            assert file.clips["live"].skeleton.unit_cm == 0.1
            return [joint.name for joint in file.clips["live"].skeleton.joints]

    assert joints(["a", "b"]) == ["a", "b"]
    assert joints(["a.x", "a.y", "a.z", "b.x", "b.y", "b.z"]) == ["a", "b"]
    assert joints(["a.tx", "a.ty", "a.tz"]) == ["a"]
    assert joints(["a.x", "a.y"]) == ["a.x", "a.y"]
    for bad in ([], ["a", ""], ["a.x", "a.z", "a.y"], ["a.x", "b.y", "b.z"]):
        with pytest.raises(mcz.OptionError):
            joints(bad)
    with pytest.raises(mcz.OptionError, match="parsec"):
        list(mcz.stream_encode([], NAMES, codec="stairs", unit="parsec"))
    for odd in ("a.mcz", 5):
        with pytest.raises(mcz.OptionError, match="cannot read from"):
            mcz.stream_decode(odd)
    assert len(list(mcz.stream_decode(b"".join(pieces(n=3))))) == 3
    for row in ("what", [1, 2], [[1] * 9], None):
        with pytest.raises(mcz.MotionError):
            list(mcz.stream_encode([row], NAMES, codec="stairs"))  # type: ignore[list-item]
    with pytest.raises(mcz.OptionError, match="lost is"):
        mcz.stream_decode([], lost="what")  # type: ignore[arg-type]


# Losses --------------------------------------------------------------------------


@CODEC
@pytest.mark.parametrize("seed", range(4))
def test_packets_lost_at_random(codec: str, seed: int) -> None:
    data = b"".join(pieces(codec))
    whole, _ = read(data)
    random = np.random.default_rng(seed)
    lost = set(np.flatnonzero(random.random(60) < (0.05, 0.1, 0.3, 0.9)[seed]).tolist())
    bad = without_packets(data, lost)
    for how in ("missing", "hold", "linear"):
        found, summary = read(bad, lost=how)
        assert [frame.number for frame in found] == list(range(60))
        check_decoded(found, whole)
        came = {frame.number for frame in found if frame.state == "decoded"}
        assert not came & lost
        assert (summary.decoded, summary.is_checked) == (len(came), not lost)
        assert summary.decoded + summary.concealed + summary.missing == 60
        assert not summary.is_cut
        if codec != "online":  # a frame needs all those before it back to a fresh one
            assert came == {n for n in range(60) if not lost & set(range(n - n % 10, n + 1))}
        else:  # long-term frames follow from each other, others from the last of these
            kept = {n for n in range(60) if not _needed_by(n) & lost}
            assert came == kept
    with pytest.raises(mcz.FormatError):
        read(bad)
    with pytest.raises(mcz.FormatError):
        read(bad, join=True)


def _needed_by(n: int) -> set[int]:
    """The frames that frame ``n`` is made of, with groups of 5 of which every second is intra."""
    intra, ltr = n - n % 10, n - n % 5
    return {intra, ltr, *range(ltr, n + 1)}


def test_what_is_shown_for_a_lost_frame() -> None:
    data = b"".join(pieces())
    truth = rows()
    bad = without_packets(data, {2, 47})  # one to the end of its run, in the midst of another
    hold, _ = read(bad, lost="hold")
    linear, _ = read(bad, lost="linear")
    missing, _ = read(bad, lost="missing")
    wanted = "dd" + 8 * "c" + 37 * "d" + 3 * "c" + 10 * "d"
    assert states(hold) == states(linear) == wanted
    assert states(missing) == wanted.replace("c", "m")
    for frame in hold[2:10]:
        np.testing.assert_array_equal(frame.values, truth[1])
    for frame in linear[2:10]:
        part = (frame.number - 1) / 9
        np.testing.assert_allclose(frame.values, truth[1] + part * (truth[10] - truth[1]))
    assert all(not frame.valid.any() for frame in missing[2:10])


def test_a_missing_value_is_not_interpolated() -> None:
    data = b"".join(pieces())
    found, _ = read(without_packets(data, {16}), lost="linear")
    gone = [n for n, frame in enumerate(found) if not frame.valid[3]]
    assert gone == [15, 16, 17, 18, 19]
    assert states(found)[15:20] == "dcccc"


def test_lines_wait_for_the_next_frame_and_end_with_the_stream() -> None:
    parts = pieces(n=20)
    sent = [*parts[:5], *parts[6:]]
    reader = mcz.stream_decode(iter(sent), lost="linear")
    assert states(list(reader)) == "dddd" + 6 * "c" + 10 * "d"
    whole, _ = read(b"".join(parts))
    cut = b"".join([*parts[:15], *parts[16:19]])  # frame 14 is lost, and no fresh one follows
    found, summary = read(cut, lost="linear")
    assert states(found) == 14 * "d" + 4 * "c"
    np.testing.assert_array_equal(found[-1].values, whole[13].values)  # held
    assert summary.is_cut


def test_a_lost_beginning_is_made_up_by_the_first_repetition() -> None:
    parts = pieces()
    whole, _ = read(b"".join(parts))
    found, summary = read(b"".join(parts[1:]), lost="hold")
    assert states(found) == "m" * 10 + "d" * 50
    check_decoded(found, whole)
    assert summary.n_faults == 1
    found, summary = read(b"".join([parts[0][:40], *parts[1:]]), lost="hold")
    assert states(found) == "m" * 10 + "d" * 50
    never = b"".join(pieces(repeat=0)[1:])
    assert read(never, lost="hold")[0] == []


# Joining ---------------------------------------------------------------------------


@CODEC
@pytest.mark.parametrize("lost", ["refuse", "hold"])
def test_joining_anywhere(codec: str, lost: str) -> None:
    parts = pieces(codec)
    data = b"".join(parts)
    whole, _ = read(data)
    end = len(build_packet(Packet(END, 10, b"")))  # a REPT follows; HEAD in it will do as well
    begins = np.cumsum([len(part) for part in parts]) + end + 16
    for at in range(0, begins[60] if lost == "refuse" else len(data), 31):
        found, summary = read(data[at:], lost=lost, join=True)
        check_decoded(found, whole)
        assert set(states(found)) <= {"d"}
        numbers = [frame.number for frame in found]
        if at == 0:
            assert numbers == list(range(60))
        elif at < begins[50]:  # before the last fresh frame
            fresh = next(n for n in range(10, 60, 10) if at <= begins[n])
            assert numbers == list(range(fresh, 60))
        assert summary.is_checked == (at == 0)


def test_joining_behind_the_beginning() -> None:
    """Late receivers over TCP get the beginning, then the frames from a fresh one on."""
    parts = pieces()
    end = len(build_packet(Packet(END, 10, b"")))
    late = b"".join([parts[0], parts[21][end:], *parts[22:]])
    found, summary = read(late, lost="refuse", join=True)
    assert [frame.number for frame in found] == list(range(20, 60))
    assert (summary.n_faults, summary.is_cut) == (0, False)
    found, _ = read(late, lost="hold")
    assert states(found) == "m" * 20 + "d" * 40


def test_where_one_can_join() -> None:
    skeleton = mcz.Skeleton((mcz.Joint("a", channels=tuple(map(mcz.Channel, ("tx", "ty", "tz")))),))
    sent: list[tuple[bytes, int | None]] = []

    class Sink:
        def write(self, data: bytes) -> int:
            sent.append((bytes(data), writer.entry if sent else None))
            return len(data)

    writer = mcz.LiveWriter(Sink(), skeleton, "stairs", {"every": 4})
    with writer:
        for row in rows(10)[:, :3]:
            writer.push(row)
    found = [None if at is None else data[at : at + 4] for data, at in sent]
    none = [None] * 3
    assert found == [None, b"DATA", *none, ChunkType.REPT, *none, ChunkType.REPT, None, b"CEND"]


# Cut off and damaged -----------------------------------------------------------------


@CODEC
@pytest.mark.parametrize("lost", ["refuse", "hold", "linear"])
def test_cut_at_every_byte(codec: str, lost: str) -> None:
    n = 13 if codec == "stairs" else 12
    data = b"".join(pieces(codec, n=n))
    whole, _ = read(data)
    ends = [stop for _, stop in packet_spans(data)]
    step = 3 if codec == "stairs" else 17
    for size in range(0, len(data), step):
        got: list[LiveFrame] = []
        reader = mcz.stream_decode(io.BytesIO(data[:size]), lost=lost)
        if lost == "refuse":
            with pytest.raises(mcz.TruncatedError):
                got.extend(reader)
            got = list(mcz.stream_decode(io.BytesIO(data[:size]), lost="hold"))
        else:
            got.extend(reader)
            assert reader.summary.is_cut
            assert not reader.summary.is_checked or size >= len(data) - 1000
        assert states(got) == "d" * sum(end <= size for end in ends)
        check_decoded(got, whole)


@pytest.mark.parametrize("lost", ["missing", "linear"])
def test_a_damaged_packet_is_one_that_did_not_come(lost: str) -> None:
    data = b"".join(pieces())
    whole, _ = read(data)
    for frame in (0, 3, 9, 10, 31, 59):
        start, stop = packet_spans(data)[frame]
        for byte in (start, start + 1, stop - 1):
            found, summary = read(flip_bit(data, byte, 2), lost=lost)
            assert [f.number for f in found] == list(range(60))
            run = 10 - frame % 10
            assert states(found) == states(read(without_packets(data, {frame}), lost=lost)[0])
            assert states(found).count("d") == 60 - run
            assert summary.n_faults >= 1
            check_decoded(found, whole)


EDITS = st.lists(
    st.tuples(
        st.floats(0, 1), st.sampled_from(["cut", "flip", "drop", "twice"]), st.integers(1, 80)
    ),
    max_size=4,
)


@settings(max_examples=amount(60, 25))
@given(EDITS, st.sampled_from(["missing", "hold", "linear"]), st.booleans())
def test_any_damage(edits: list[tuple[float, str, int]], lost: str, join: bool) -> None:
    data = b"".join(pieces(n=33))
    whole, _ = read(data)
    for place, kind, size in edits:
        at = int(place * len(data))
        if kind == "cut":
            data = data[:at]
        elif kind == "drop":
            data = data[:at] + data[at + size :]
        elif kind == "twice":
            data = data[: at + size] + data[at:]
        elif at < len(data):
            data = flip_bit(data, at, size % 8)
    try:
        found, _ = read(data, lost=lost, join=join)
    except mcz.MczError as error:
        assert str(error)
        return
    check_decoded(found, whole)
    numbers = [frame.number for frame in found]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else True


# Frames in the wrong place ---------------------------------------------------------------


def heads_and_bodies(data: bytes) -> list[tuple[int, int, int]]:
    """Begin, begin of the body, and end of each packet with a frame."""
    return [(start, stop - CHECK_SIZE - size, stop) for start, stop, size in _spans(data)]


def _spans(data: bytes) -> Iterator[tuple[int, int, int]]:
    with mcz.open(data) as file:
        rows = file.clips["live"].signals[0].rows
    for (start, stop), row in zip(packet_spans(data), rows, strict=True):
        yield start, stop, row.size


Places = list[tuple[int, int, int]]


def burst(data: bytes, places: Places, random: np.random.Generator) -> bytes:
    """Packets are lost, of a DATA and the next ones, with all that lies between."""
    a, b = sorted(random.integers(0, len(places), 2))
    if random.random() < 0.5:  # the numbers go on as if nothing were lost
        b = min(a + 10 * int(random.integers(1, 3)), len(places) - 1)
    return data[: places[a][0]] + data[places[b][0] :]


def replay(data: bytes, places: Places, random: np.random.Generator) -> bytes:
    """Old packets come again, from where they were or with the header of their DATA."""
    at = int(random.integers(0, len(places)))
    a = int(random.integers(0, at + 1))
    b = min(len(places) - 1, a + int(random.integers(0, 12)))
    start = places[a][0] - (16 if random.random() < 0.2 else 0)
    cut = int(random.integers(0, 4))  # they may have come in the place of others
    behind = places[min(at + cut, len(places) - 1)][0]
    return data[: places[at][0]] + data[start : places[b][2]] + data[behind:]


def splice(data: bytes, places: Places, random: np.random.Generator) -> bytes:
    """The head of a packet is followed by the body of another."""
    a, b = sorted(random.integers(0, len(places), 2))
    if random.random() < 0.3:
        a, b = b, a  # the latter is an old one
    return data[: places[a][1]] + data[places[b][1] :]


DAMAGES = {"burst": burst, "replay": replay, "splice": splice}


def n_wrong(found: list[LiveFrame], whole: list[LiveFrame]) -> int:
    """The frames that are said to be decoded and are others."""
    return sum(
        frame.state == "decoded"
        and not np.array_equal(frame.values, whole[frame.number].values, equal_nan=True)
        for frame in found
    )


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("codec", ["stairs", "online"])
def test_no_frame_in_the_wrong_place_is_said_to_be_decoded(codec: str, damage: str) -> None:
    data = b"".join(pieces(codec, repeat=2))
    whole, _ = read(data)
    places = heads_and_bodies(data)
    random = np.random.default_rng(7)
    for _ in range(200 if codec == "stairs" else 60):
        seed = int(random.integers(2**32))
        how = ("missing", "hold", "linear")[seed % 3]
        bad = DAMAGES[damage](data, places, np.random.default_rng(seed))
        found, _ = read(bad, lost=how, join=seed % 5 == 0)
        assert n_wrong(found, whole) == 0
        numbers = [frame.number for frame in found]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else 1


def test_what_is_lost_over_a_border_costs_no_more_than_that() -> None:
    """Frames 14 to 33 are lost, with two borders; 34 is number 4 of its DATA, where 14 is due."""
    data = b"".join(pieces())
    whole, _ = read(data)
    places = heads_and_bodies(data)
    found, summary = read(data[: places[14][0]] + data[places[34][0] :], lost="hold")
    assert states(found) == 14 * "d" + 26 * "c" + 20 * "d"
    check_decoded(found, whole)
    assert any("or it is not frame" in remark for remark in summary.remarks)
    with pytest.raises(mcz.FormatError, match="or it is not frame"):
        read(data[: places[14][0]] + data[places[34][0] :], join=True)


def test_a_packet_that_tells_its_frame_puts_those_behind_it_right() -> None:
    """Frames 5 to 14 are lost, with a border; 15, of kind 1, says which one it is."""
    parts = pieces("online", params=CODECS["online"] | {"gof": 2, "intra_period": 5})
    data = b"".join(parts)
    whole, _ = read(data)
    places = heads_and_bodies(data)
    found, _ = read(data[: places[5][0]] + data[places[15][0] :], lost="hold")
    check_decoded(found, whole)
    assert states(found)[20:] == 40 * "d"
    assert states(found)[:15] == 5 * "d" + 10 * "c"


@pytest.mark.parametrize("cut", [0, 1, 4, 9, 12, 30])
def test_an_unchecked_packet_hides_nothing(cut: int) -> None:
    """Packets after an unchecked one are found even if it is cut."""
    data = b"".join(pieces())
    whole, _ = read(data)
    places = heads_and_bodies(data)
    for frame in (11, 12, 18, 19):
        lacks = places[frame][1] + 2
        bad = data[:lacks] + data[lacks + cut :]
        bad = bad[: places[10][0]] + bad[places[10][2] :]
        found, summary = read(bad, lost="hold")
        check_decoded(found, whole)
        assert [one.number for one in found] == list(range(60))
        assert states(found)[20 if cut < 12 or frame < 18 else 30 :].strip("d") == ""
        assert states(found)[10:20] == 10 * "c"
        assert summary.decoded >= 40


# Hostile -------------------------------------------------------------------------------


def assembled(chunks: list[list[Packet]], n_frames: int = 0, end: bool = True) -> bytes:
    """A stream with these packets in its open DATA."""
    out = [pieces(n=1)[0]]
    for packets in chunks:
        out.append(build_header(b"DATA", 0, OPEN_LENGTH))
        out += map(build_packet, packets)
    if end:
        cend = build(payloads.Cend(n_frames=n_frames, value_sha256=[bytes(32)]), "CEND")
        out += [build_chunk(b"CEND", cend), build_foot(0, 0)]
    return b"".join(out)


def told(number: int, sequence: int = 0, *, fresh: bool = True) -> Packet:
    """A packet of kind 1 with frame ``number``."""
    header = SegmentHeader(0, number, 1, flags=FRESH if fresh else 0)
    return Packet(SEGMENT, sequence, build_segment(header, [bytes([2] * 9)]), fresh)


@pytest.mark.parametrize("lost", ["missing", "hold", "linear"])
@pytest.mark.parametrize(
    "chunks",
    [
        [[told(0)], [told(2**50)]],
        [[told(0), Packet(FRAME, 2**50, b"", False, implied_by(2**50, b""))]],
        [[told(2**50)]],
        [[told(0), Packet(END, 2**50, b"")]],
    ],
)
def test_a_gap_that_is_too_large_is_jumped_over(lost: str, chunks: list[list[Packet]]) -> None:
    tracemalloc.start()
    found, summary = read(assembled(chunks, end=False), lost=lost)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found) <= 3
    assert summary.skipped >= 2**50 - 2
    assert any("too many" in remark for remark in summary.remarks)
    assert peak < 2**21


def test_many_gaps_are_paid_for_by_bytes() -> None:
    count = 20
    chunks = [[told(n * 60_000)] for n in range(count)]
    data = assembled(chunks, (count - 1) * 60_000 + 1)
    found, summary = read(data, lost="hold")
    assert summary.concealed <= MOST_MADE_UP + len(data)
    assert summary.concealed == 59_999
    assert summary.skipped == (count - 2) * 59_999
    assert [frame.number for frame in found if frame.state == "decoded"] == [
        n * 60_000 for n in range(count)
    ]


def test_a_clip_that_is_said_to_be_longer() -> None:
    found, summary = read(assembled([[told(0)]], 2**53 - 1), lost="hold")
    assert len(found) == 1
    assert summary.skipped == 2**53 - 2
    found, summary = read(assembled([[told(0)]], 5), lost="hold")
    assert states(found) == "dcccc"
    with pytest.raises(mcz.ChecksumError, match="its frames differ from the hash"):
        read(assembled([[told(0)]], 1), lost="hold")
    with pytest.raises(mcz.ChecksumError, match="frames, but another number arrived"):
        read(assembled([[told(0)]], 0), lost="hold")


def test_a_packet_whose_frame_nobody_told() -> None:
    """Nothing of it is decoded, and nothing waits for it."""
    chunks = [[told(0)], [short(n, n + 3) for n in range(3)]]
    found, _ = read(assembled([*chunks, [told(6)]], end=False), lost="hold")
    assert states(found) == "d" + 5 * "c" + "d"
    early = mcz.stream_decode(io.BytesIO(assembled(chunks, end=False)), lost="hold")
    assert states(list(early)) == "d"


def short(sequence: int, number: int) -> Packet:
    """A packet of kind 2 with frame ``number``, which starts fresh."""
    return Packet(FRAME, sequence, bytes([2] * 9), True, implied_by(number, b""))


def test_behind_a_gap_among_several_signals_numbers_are_not_known() -> None:
    opening = pieces(n=1)[0]
    clip = repeated_chunks(opening.removeprefix(SIGNATURE), 0)[-1]
    fields = parse(payloads.Clip, clip.payload, "CLIP")
    fields.signals.append(replace(fields.signals[0], role=0))
    two = build_chunk(b"CLIP", build_record(payloads.Clip, fields, "CLIP"))
    other = build_segment(SegmentHeader(1, 0, 1), [bytes([2] * 9)])
    chunk = [
        told(0),
        Packet(SEGMENT, 1, other),
        short(2, 1),
        short(5, 2),  # packets 3 and 4 may have been of either signal
        short(6, 3),
        told(5, 7),
        short(8, 6),
    ]
    data = assembled([chunk], end=False).removeprefix(opening)
    found, summary = read(opening[: clip.offset + len(SIGNATURE)] + two + data, lost="hold")
    assert states(found) == "ddcccdd"
    assert summary.is_cut


def test_a_segment_that_cannot_be_read_tells_no_number() -> None:
    bad = Packet(SEGMENT, 1, b"\xff" * 20)
    chunks = [[told(0), bad, short(2, 2)], [told(3), bad, short(2, 5)], [told(6)]]
    found, summary = read(assembled(chunks, end=False), lost="hold")
    assert states(found) == "dccdccd"
    assert summary.n_faults >= 2


def test_packets_of_another_data_are_not_taken_for_those_that_are_due() -> None:
    """The end of a DATA, and the beginning of the next, are lost: numbers begin anew."""
    parts = pieces()
    data = b"".join(parts[:18] + parts[22:])  # frames 17 to 20, the last of which was fresh
    found, summary = read(data, lost="hold")
    assert states(found) == 17 * "d" + 13 * "c" + 30 * "d"
    assert any("is expected" in remark for remark in summary.remarks)


def test_looking_for_what_is_whole_is_bounded() -> None:
    """Many heads of packets, each followed by other bytes than its own."""
    head = build_packet(Packet(FRAME, 5, bytes(60_000), fresh=False))[:-60_004]
    opening = assembled([[told(0)]], end=False)
    with pytest.raises(mcz.LimitError, match="false starts of"):
        read(opening + b"\xff" + head * 20_000 + bytes(70_000), lost="hold")


def test_a_damaged_length_holds_nothing_up() -> None:
    """It says 15,000 bytes: frames behind it come long before these have."""
    data = b"".join(pieces(n=600))
    whole, _ = read(data)
    places = heads_and_bodies(data)
    start, body, stop = places[102]
    assert body - start == 3
    bad = bytearray(data)
    bad[body - 1 : body + 1] = b"\x98\x75"
    stream = live_codec.Trickle(bytes(bad))
    found, came = [], {}
    for frame in mcz.stream_decode(stream, lost="missing"):
        found.append(frame)
        came[frame.number] = stream.at
    check_decoded(found, whole)
    assert states(found) == 102 * "d" + 8 * "m" + 490 * "d"
    assert came[110] <= max(places[110][2], stop + 1500)
    assert came[200] == places[200][2]


def test_what_a_stream_may_repeat() -> None:
    parts = pieces()
    opening = parts[0].removeprefix(SIGNATURE)
    head = repeated_chunks(opening, 0)[0]
    for payload in (b"", head.data, opening[:-1], opening + opening, b"noise"):
        data = (
            parts[0]
            + build_chunk(ChunkType.REPT, payload, ChunkFlag.ANCILLARY)
            + b"".join(parts[1:])
        )
        found, summary = read(data, lost="hold")
        assert states(found) == "d" * 60
        assert summary.n_faults == 1


def test_critical_chunks_that_are_not_known() -> None:
    parts = pieces()
    data = parts[0] + build_chunk(b"WHAT", b"") + b"".join(parts[1:])
    with pytest.raises(mcz.UnsupportedError, match="critical"):
        read(data, lost="hold")
    data = parts[0] + build_chunk(b"what", b"x" * 2**21, ChunkFlag.ANCILLARY) + b"".join(parts[1:])
    assert states(read(data, lost="hold")[0]) == "d" * 60


def test_a_model_that_is_lost_comes_again() -> None:
    parts = pieces("lsdt-frame")
    opening = parts[0]
    inner = repeated_chunks(opening.removeprefix(SIGNATURE), len(SIGNATURE))
    for event in inner:
        bad = flip_bit(opening, event.offset + 18, 1)
        found, _ = read(b"".join([bad, *parts[1:]]), lost="hold")
        assert states(found) == "m" * 10 + "d" * 50, event.chunk.label


def test_a_stream_of_the_small_profile() -> None:
    parts = pieces(repeat=0)
    head, *others = repeated_chunks(parts[0].removeprefix(SIGNATURE), 0)
    small = replace(parse(payloads.Head, head.payload, "HEAD"), profile=limits.SMALL.id)
    opening = [SIGNATURE, build_chunk(b"HEAD", build(small, "HEAD"))]
    data = b"".join([*opening, *(event.data for event in others), *parts[1:]])
    assert states(read(data, lost="hold")[0]) == "d" * 60


# The post filter ---------------------------------------------------------------------------


@pytest.mark.parametrize("lost", ["refuse", "hold"])
def test_filtered_frames_come_twelve_late(lost: str) -> None:
    parts = pieces("online")
    data = b"".join(parts)
    plain, _ = read(data)
    came = 0

    def sent() -> Iterator[bytes]:
        nonlocal came
        for number, part in enumerate(parts):
            came = number
            yield part

    found = []
    for frame in mcz.stream_decode(sent(), lost=lost, post_filter=True):
        found.append(frame)
        assert came >= min(60, frame.number + 12)
    assert [frame.number for frame in found] == list(range(60))
    with mcz.open(data) as file:
        wanted = mcz.post_filter(file.clips["live"].motion())
    mask = ~np.isnan(np.array([frame.values for frame in plain]))
    values = np.array([frame.values for frame in found])
    np.testing.assert_array_equal(values[mask], wanted.values[mask])
    np.testing.assert_array_equal(np.isnan(values), ~mask)


def test_filtered_frames_of_a_stream_that_is_cut_off() -> None:
    data = b"".join(pieces("online")[:31])
    got: list[LiveFrame] = []
    with pytest.raises(mcz.TruncatedError):
        for frame in mcz.stream_decode(io.BytesIO(data), post_filter=True):
            got.append(frame)  # noqa: PERF402 - those before the error are kept
    assert [frame.number for frame in got] == list(range(30))
    unknown = b"".join(pieces("online", frame_rate=None))
    with pytest.raises(mcz.OptionError, match="rate"):
        read(unknown, post_filter=True)
    assert len(read(unknown, post_filter=True, rate=Fraction(120))[0]) == 60
