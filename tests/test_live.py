"""Live clips: written frame by frame, read as they arrive, damaged, cut off, and long."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import codecs
from mcz.container.chunks import (
    CHECK_SIZE,
    END,
    Packet,
    build_chunk,
    build_packet,
)
from mcz.container.writer import Writer
from mcz.files.live.clip_state import StreamSummary
from mcz.files.live.generators import live_frames
from mcz.files.live.reader_with_losses import FramesWithLosses
from mcz.files.live.writer import LiveWriter
from mcz.files.reading.clips import packet_framing
from mcz.files.reading.report import info
from mcz.files.writing.clip_writer import write_clip
from tests import live_codec
from tests.motions import skeleton, smooth
from tests.repair import flip_bit, parts_of, use, with_packets

ROOT = Path(mcz.__file__).parent.parent


@pytest.fixture(autouse=True)
def stairs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.CODECS, live_codec.CODEC.name, live_codec.CODEC)


def frames(n: int = 23, seed: int = 1) -> np.ndarray:
    """Multiples of an eighth, some frames equal to the one before, some values invalid."""
    random = np.random.default_rng(seed)
    steps = random.integers(-40, 40, (n, 10)) * (random.random((n, 1)) < 0.8)
    values = steps.cumsum(axis=0) / 8
    if n > 7:
        values[7, 3:5] = np.nan
    return values


def live(values: np.ndarray, **params: object) -> bytes:
    out = io.BytesIO()
    with LiveWriter(out, skeleton(), "stairs", params, frame_rate=Fraction(120)) as writer:
        for row in values:
            writer.push(row)
    return out.getvalue()


def test_salvage_of_a_clip_that_was_cut_off() -> None:
    values = frames(13)
    data = live(values)
    with mcz.open(data) as file:
        ends = [row.stop + CHECK_SIZE for row in file.clips["live"].signals[0].rows]
        start = file.container.directory.clips["live"].clip
    for size in range(start.offset + start.size, len(data), 5):
        whole = sum(end <= size for end in ends)
        with mcz.open(data[:size], salvage=True) as file:
            np.testing.assert_array_equal(file.clips["live"].read(), values[:whole])


def test_numbers_of_missing_frames_come_with_the_end() -> None:
    values, out = frames(9), io.BytesIO()
    with LiveWriter(out, skeleton(), "stairs", frame_rate=Fraction(4), first_number=5) as writer:
        with pytest.raises(mcz.OptionError, match="missing"):
            writer.miss()
        for n, row in enumerate(values):
            writer.push(row)
            writer.miss() if n in (2, 8) else None
            writer.miss(3) if n in (2, 3) else None
        with pytest.raises(mcz.OptionError, match="2\\^52"):
            writer.miss(2**52)
    wanted = [5, 6, 7, 12, 16, 17, 18, 19, 20]
    data = out.getvalue()
    assert mcz.verify(data) == []
    assert [n for n, _, _ in live_frames(io.BytesIO(data))] == list(range(9))
    losses = FramesWithLosses(io.BytesIO(data), "missing", False, StreamSummary())
    assert [frame.state for frame in losses.frames()] == ["decoded"] * 9
    for target in (data, extract_clips(data)):
        with mcz.open(target) as file:
            clip = file.clips["live"]
            assert clip.frame_numbers.tolist() == wanted
            np.testing.assert_array_equal(clip.times, (np.array(wanted) - 1) / 4)
    with mcz.open(extract_clips(data, frames=(2, 7))) as file:
        assert file.clips["live"].frame_numbers.tolist() == wanted[2:7]


def extract_clips(data: bytes, **how: Any) -> bytes:
    out = io.BytesIO()
    mcz.extract(data, out, **({"clip": "live"} | how))
    return out.getvalue()


def test_the_hash_is_compared_at_the_end() -> None:
    data = live(frames())
    with mcz.open(data) as file:
        cend = file.container.directory.clips["live"].cend
    assert cend is not None
    payload = bytearray(data[cend.payload_offset : cend.offset + cend.size - 4])
    payload[-1] ^= 1  # of the hash
    bad = data[: cend.offset] + build_chunk(b"CEND", bytes(payload))
    found = []
    with pytest.raises(mcz.ChecksumError):
        for number, _, _ in live_frames(io.BytesIO(bad)):
            found.append(number)
    assert found == list(range(23))


@given(st.integers(0, 30), st.integers(1, 12), st.integers(0, 2**32))
def test_any_number_of_frames(n: int, every: int, seed: int) -> None:
    codecs.CODECS[live_codec.CODEC.name] = live_codec.CODEC
    values = frames(n, seed)
    data = live(values, every=every)
    found = list(live_frames(io.BytesIO(data)))
    assert [number for number, _, _ in found] == list(range(n))
    np.testing.assert_array_equal(np.array([row for _, row, _ in found]).reshape(n, 10), values)
    np.testing.assert_array_equal(
        np.array([mask for _, _, mask in found], bool).reshape(n, 10), ~np.isnan(values)
    )
    with mcz.open(data) as file:
        np.testing.assert_array_equal(file.clips["live"].read(), values)


def test_each_frame_comes_with_its_last_byte() -> None:
    values = frames()
    data = live(values)
    with mcz.open(data) as file:
        ends = [row.stop + CHECK_SIZE for row in file.clips["live"].signals[0].rows]
    stream = live_codec.Trickle(data)
    assert [stream.at for _ in live_frames(stream)] == ends


def test_one_write_a_frame() -> None:
    class Sink:
        def __init__(self) -> None:
            self.writes: list[bytes] = []
            self.flushes = 0

        def write(self, data: memoryview) -> int:
            self.writes.append(bytes(data[:100]))  # takes a part alone
            return len(self.writes[-1])

        def flush(self) -> None:
            self.flushes += 1

    sink = Sink()
    with LiveWriter(sink, skeleton(), "stairs") as writer:
        for count, row in enumerate(frames()):
            writer.push(row)
            found = live_frames(io.BytesIO(b"".join(sink.writes)))
            for _ in range(count + 1):
                next(found)
            assert sink.flushes == count + 2
    assert mcz.verify(b"".join(sink.writes)) == []


def test_quality_of_markers() -> None:
    channels = tuple(map(mcz.Channel, ("tx", "ty", "tz")))
    bones = mcz.Skeleton(tuple(mcz.Joint(n, channels=channels) for n in "ab"), unit_cm=10.0)
    values = np.array([[0.0, 0, 0, 8, 8, 8], [0.05, 0, 0, 8, 8, np.nan], [0, 0, 0.0625, 1, 1, 1]])
    out = io.BytesIO()
    with LiveWriter(out, bones, "stairs") as writer:
        decoded = np.array([writer.push(row) for row in values])
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["live"]
        np.testing.assert_array_equal(clip.read(), decoded)
        quality = clip.quality
        motion = clip.motion()
    signal = mcz.Signal(np.nan_to_num(values), mask=~np.isnan(values))
    wanted = mcz.compare(mcz.Motion(bones, (signal,)), motion).entries()
    assert quality is not None
    for key in ("mean_position_error_cm", "max_position_error", "max_position_error_point"):
        assert quality[key] == str(wanted[key])
    assert int(quality["max_position_error_frame"]) == wanted["max_position_error_frame"] == 2
    assert float(quality["mse_raw"]) == pytest.approx(wanted["mse_raw"])


def test_places_of_points_are_coded() -> None:
    out = io.BytesIO()
    rows = smooth(5).values
    with LiveWriter(out, skeleton(), "stairs", {"domain": "positions"}) as writer:
        for row in rows:
            writer.push(row)
        with pytest.raises(mcz.MotionError, match="10 channels"):
            writer.push(rows[0, :9])
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["live"]
        wanted = mcz.positions(smooth(5)).reshape(5, -1)
        np.testing.assert_allclose(clip.read(), wanted, atol=1 / 16)
        assert clip.skeleton.base is not None
        assert file.skeleton(clip.skeleton.base) == skeleton()


def test_what_cannot_be_live() -> None:
    out = io.BytesIO()
    with pytest.raises(mcz.OptionError, match="frame by frame"):
        LiveWriter(out, skeleton(), "raw")
    with pytest.raises(mcz.OptionError, match="no parameter"):
        LiveWriter(out, skeleton(), "stairs", {"steps": 1})
    with pytest.raises(mcz.MotionError, match="0 groups"):
        LiveWriter(out, mcz.Skeleton((mcz.Joint("a"),)), "stairs")
    writer = LiveWriter(out, skeleton(), "stairs")
    writer.close()
    writer.close()
    with pytest.raises(mcz.MotionError, match="closed"):
        writer.push(np.zeros(10))


def test_clips_that_are_not_live_are_followed_too() -> None:
    out = io.BytesIO()
    writer = Writer(out)
    motion = smooth(12)
    write_clip(writer, motion, codecs.codec_by_name("raw"), {"segment_frames": 5})
    write_clip(writer, smooth(6, name="b"), live_codec.CODEC, {"every": 4})
    writer.finish()
    writer.attachment("a", b"more")
    write_clip(writer, smooth(3, name="c"), codecs.codec_by_name("fast"), {})
    writer.finish()
    found = list(live_frames(io.BytesIO(out.getvalue())))
    assert [n for n, _, _ in found] == [*range(12), *range(6), *range(3)]
    with mcz.open(out.getvalue()) as file:
        parts = found[:12], found[12:18], found[18:]
        for clip, part in zip(file.clips.values(), parts, strict=True):
            np.testing.assert_array_equal(np.array([row for _, row, _ in part]), clip.read())


def test_sizes_count_the_framing() -> None:
    data = live(frames())
    with mcz.open(data) as file:
        row = file.container.directory.clips["live"]
        clip = info(file)["clips"][0]
        assert row.cend is not None
        bodies = sum(segment.size for segment in row.segments)
        between = row.cend.offset - (row.clip.offset + row.clip.size)
        repeats = sum(
            20 + len(payload) for chunk, payload in parts_of(data) if chunk.type == b"REPT"
        )
        assert clip["between_bytes"] == repeats > 0
        assert packet_framing(row.segments) == between - repeats - bodies
        assert clip["packet_bytes"] == between - repeats - bodies
        assert clip["packets"] == 23
        assert clip["payload_bytes"] + clip["overhead_bytes"] + clip["hash_bytes"] == (
            row.cend.offset + row.cend.size - row.clip.offset - repeats
        )


# Damage ----------------------------------------------------------------------


def with_body(data: bytes, frame: int, change: Callable[[bytes], bytes]) -> bytes:
    """The file, without an index, with another body of a packet, and the check of that."""
    number = -1

    def change_packet(packet: Packet) -> Packet:
        nonlocal number
        number += 1
        return replace(packet, body=change(packet.body)) if number == frame else packet

    return with_packets(data, change_packet)


def test_bodies_flipped_and_cut_behind_repaired_checks() -> None:
    data = live(frames(13))
    for frame in range(13):
        for at in range(1, 160, 8):
            for change in (
                lambda body, at=at: flip_bit(body, at // 8 % len(body), at % 8) if body else b"x",
                lambda body, at=at: body[: at % max(1, len(body))] if body else b"\0",
            ):
                bad = with_body(data, frame, change)
                for how in (False, True):
                    with suppress(mcz.MczError):
                        use(bad, salvage=how)
                with pytest.raises(mcz.MczError):
                    list(live_frames(io.BytesIO(bad)))


def test_a_lost_end_packet_costs_no_frame() -> None:
    data = live(frames())
    end = build_packet(Packet(END, 3, b""))
    assert data.count(end) == 1
    with mcz.open(data.replace(end, b""), salvage=True) as file:
        clip = file.clips["live"]
        np.testing.assert_array_equal(clip.read(), frames())
        assert clip.quality is not None
        assert not any("CEND" in text for text in clip.damage)


def test_an_undecodable_frame_is_salvaged_around() -> None:
    bad = with_body(live(frames()), 13, lambda _: b"\xff")
    with mcz.open(bad, salvage=True) as file:
        decoded = file.clips["live"].read()
        lost = np.isnan(decoded).all(axis=1)
        np.testing.assert_array_equal(np.flatnonzero(lost), np.arange(13, 20))
        np.testing.assert_array_equal(decoded[~lost], frames()[~lost])
        assert len(file.damage) == 2


# Long and cut off --------------------------------------------------------------


@pytest.mark.parametrize("n", [2_000, pytest.param(100_000, marks=pytest.mark.long)])
def test_many_frames(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is decoded twice, or kept for each frame beside its row in the index."""
    values = np.random.default_rng(3).integers(-9, 9, (n, 10)).cumsum(axis=0) / 8
    data = live(values, every=240)
    pushes = 0
    plain = live_codec.Decoder.push

    def count_push(self, stream, fresh):
        nonlocal pushes
        pushes += 1
        return plain(self, stream, fresh)

    monkeypatch.setattr(live_codec.Decoder, "push", count_push)
    with mcz.open(data) as file:
        np.testing.assert_array_equal(file.clips["live"].read(), values)
        assert pushes == n
        assert file.container.source.n_bytes < 4 * len(data)
    assert mcz.verify(data) == []
    pushes = 0
    cut = data[: len(data) - 40]  # amid INDX
    with mcz.open(cut, salvage=True) as file:
        np.testing.assert_array_equal(file.clips["live"].read(), values)
        assert pushes == n
    part = live(values[:2_000], every=240)
    tracemalloc.start()
    for number, row, _ in live_frames(io.BytesIO(part)):
        assert row[0] == values[number, 0]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 80 * 2_000  # less than the values take


WRITES = """
import sys, time
import numpy as np
from mcz import codecs
from mcz.files.live.writer import LiveWriter
from tests import live_codec
from tests.motions import skeleton
codecs.CODECS[live_codec.CODEC.name] = live_codec.CODEC
with open(sys.argv[1], "wb", buffering=0) as sink:
    writer = LiveWriter(sink, skeleton(), "stairs")
    for n in range(100000):
        writer.push(np.full(10, n / 8))
        if n == 200:
            print("ready", flush=True)
"""


def test_killed_amid_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    process = subprocess.Popen(
        [sys.executable, "-c", WRITES, str(path)],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    process.kill()
    process.wait()
    process.stdout.close()
    with pytest.raises(mcz.TruncatedError):
        mcz.open(path)
    with mcz.open(path, salvage=True) as file:
        clip = file.clips["live"]
        assert clip.n_frames > 200
        wanted = np.repeat(np.arange(clip.n_frames)[:, None] / 8, 10, axis=1)
        np.testing.assert_array_equal(clip.read(), wanted)


class Interrupts:
    """Signals an interrupt before the n-th line that is traced in the block; says if it came."""

    def __init__(self, n: int) -> None:
        self.n, self.came = n, False

    def __enter__(self) -> Interrupts:
        sys.settrace(self._call)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _call(self, frame: FrameType, *_: object) -> Any:
        file = frame.f_code.co_filename
        return self._line if file.endswith(("live/writer.py", "container/writer.py")) else None

    def _line(self, _: FrameType, event: str, __: object) -> Any:
        self.n -= event == "line"
        if self.n == 0 and not self.came:
            self.came = True
            signal.raise_signal(signal.SIGINT)
        return self._line


def test_an_interrupt_before_any_line_leaves_a_whole_clip() -> None:
    rows = frames(6)
    n, came = 0, True
    while came:
        n += 1
        out = io.BytesIO()
        try:
            with LiveWriter(out, skeleton(), "stairs") as live:
                live.push(rows[0])
                with Interrupts(n) as interrupts:
                    for row in rows[1:3]:
                        live.push(row)
                    live.close()
        except KeyboardInterrupt:
            pass
        came = interrupts.came
        assert mcz.verify(out.getvalue()) == []
        with mcz.open(out.getvalue()) as file:
            values = file.clips["live"].read()
            np.testing.assert_array_equal(values, rows[: len(values)])
    assert n > 100
    assert len(values) == 3


def test_a_block_that_fails_leaves_no_end() -> None:
    rows = frames(6)
    for error in (ValueError("x"), OSError("x"), SystemExit(1), mcz.MotionError("x")):
        out = io.BytesIO()
        with pytest.raises(type(error)), LiveWriter(out, skeleton(), "stairs") as writer:
            for row in rows:
                writer.push(row)
            raise error
        writer.close()  # does nothing any more
        found = []
        with pytest.raises(mcz.TruncatedError):
            for number, _, _ in live_frames(io.BytesIO(out.getvalue())):
                found.append(number)
        assert found == list(range(6))
        with pytest.raises(mcz.TruncatedError):
            mcz.open(out.getvalue())
        with mcz.open(out.getvalue(), salvage=True) as file:
            np.testing.assert_array_equal(file.clips["live"].read(), rows)
        with pytest.raises(mcz.MotionError, match="closed"):
            writer.push(rows[0])


def test_heartbeats_are_skipped_by_every_reader(tmp_path: Path) -> None:
    rows = frames(12)
    out = io.BytesIO()
    with LiveWriter(out, skeleton(), "stairs", {"every": 4}) as writer:
        writer.heartbeat()
        for row in rows:
            writer.push(row)
            writer.heartbeat()
            writer.heartbeat()
    data = out.getvalue()
    writer.heartbeat()
    assert out.getvalue() == data
    assert mcz.verify(data) == []
    with mcz.open(data) as file:
        np.testing.assert_array_equal(file.clips["live"].read(), rows)
    use(data)
    use(data, salvage=True)
    for lost in ("refuse", "missing", "hold", "linear"):
        found = list(mcz.stream_decode(data, lost=lost))
        assert [frame.state for frame in found] == ["decoded"] * 12
        np.testing.assert_array_equal([frame.values for frame in found], rows)


def test_a_second_interrupt_does_not_wait() -> None:
    class Stuck(io.BytesIO):
        def write(self, data: Any, /) -> int:
            if self.tell() > 0:
                signal.raise_signal(signal.SIGINT)
                signal.raise_signal(signal.SIGINT)
            return super().write(data)

    out = Stuck()
    with pytest.raises(KeyboardInterrupt), LiveWriter(out, skeleton(), "stairs") as live:
        live.push(frames(1)[0])
    with pytest.raises(mcz.TruncatedError):
        mcz.open(out.getvalue())
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
