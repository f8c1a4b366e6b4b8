"""The contract of codecs that work frame by frame: a file's values, and losses."""

from __future__ import annotations

import io
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import CODECS, codec_by_name
from mcz.codecs.contract import Layout, LiveDecoder, LiveEncoder, Request, Span, model_finder
from mcz.errors import LostFrameError
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tests.codecs.lossy import Array, Direct, clip_of, markers, markers_with_gaps
from tests.repair import flip_bit

CASES: dict[str, tuple[str, dict[str, Any], int]] = {  # frames from one that starts fresh on
    "lsdt-frame": ("lsdt-frame", {"step": 0.3, "basis": "cosines", "segment_frames": 5}, 5),
    "lsdt-frame-channels": (
        *("lsdt-frame", {"step": 0.1, "domain": "channels", "segment_frames": 6}, 6),
    ),
    "online": ("online", {"step": 0.3, "basis": "cosines", "gof": 4, "intra_period": 1}, 4),
    "online-golomb": ("online", {"step": 0.3, "gof": 3, "intra_period": 2, "coder": "golomb"}, 6),
    "online-reordered": (
        *("online", {"step": 0.3, "gof": 5, "intra_period": 1, "order": "reordered"}, 5),
    ),
    "posewave": ("posewave", {"step": 0.05, "segment_frames": 4}, 4),
}
EVERY = pytest.mark.parametrize("name", CASES)
Pushed = list[tuple[bytes, bool]]


def test_every_live_codec_has_a_case() -> None:
    live = {name for name in CODECS if codec_by_name(name).live}
    assert (
        {case[0] for case in CASES.values()}
        == live
        == {name for name in CODECS if codec_by_name(name).follow}
    )


class Live:
    """A clip whose frames are coded one by one."""

    def __init__(self, name: str, motion: Motion, **params: Any) -> None:
        codec, own, self.every = CASES[name]
        self.codec, self.motion = codec_by_name(codec), motion
        self.options = self.codec.options({**own, **params})
        self.layout: Layout = MemorySource(motion, 0, self.codec, 2**26).layout
        self.encoder = self.new_encoder()
        self.layout = replace(self.layout, find_model=model_finder(self.encoder.models))
        self.decoder = self.new_decoder()

    def new_encoder(self) -> LiveEncoder:
        assert self.codec.live is not None
        return self.codec.live(replace(self.layout, n_frames=0), self.options)

    def new_decoder(self) -> LiveDecoder:
        assert self.codec.follow is not None
        return self.codec.follow(self.encoder.header, self.layout)

    def push_rows(self) -> Pushed:
        mask = self.motion.signals[0].mask
        valid = [None] * self.motion.n_frames if mask is None else mask
        rows = zip(self.motion.values, valid, strict=True)
        return [self.encoder.push(np.nan_to_num(row), known) for row, known in rows]

    def values(self) -> Array:
        """The answers to all frames."""
        return np.array([self.decoder.push(*packet) for packet in self.push_rows()])

    def read(self, pushed: Pushed, start: int, stop: int) -> Array:
        """A file of the packets, each in a segment of its own."""
        spans = [Span(at, 1, fresh=fresh) for at, (_, fresh) in enumerate(pushed)]
        request = Request(start, stop, (0,))
        return self.codec.decode(
            self.encoder.header, self.layout, spans, request, lambda at, _, __: pushed[at][0]
        )


def walk(name: str, n_frames: int, seed: int = 0) -> Motion:
    if CASES[name][0] != "posewave" and "domain" not in CASES[name][1]:
        return markers(n_frames, 2, seed)
    frames = np.arange(n_frames)[:, None] + 10.0 * seed
    values = 30 * np.sin(frames * np.linspace(0.05, 0.2, 8) + np.arange(8))
    return clip_of(values, ["tx", "ty", "tz", "rx", "ry", "rz", "rx", "ry"])


@EVERY
@settings(max_examples=10)
@given(st.integers(1, 25), st.integers(0, 99), st.data())
def test_a_file_of_the_packets_has_what_came_live(
    name: str, n_frames: int, seed: int, data: st.DataObject
) -> None:
    live = Live(name, walk(name, n_frames, seed))
    pushed = live.push_rows()
    assert [fresh for _, fresh in pushed] == [at % live.every == 0 for at in range(n_frames)]
    found = np.array([live.decoder.push(*packet) for packet in pushed])
    assert np.abs(found - live.motion.values).max() < 3
    start = data.draw(st.integers(0, n_frames))
    stop = data.draw(st.integers(start, n_frames))
    np.testing.assert_array_equal(live.read(pushed, 0, n_frames), found)
    np.testing.assert_array_equal(live.read(pushed, start, stop), found[start:stop])
    if name not in ("posewave", "lsdt-frame-channels"):  # which look at all frames at first
        whole = Direct(live.codec.name, live.motion, **CASES[name][1])
        np.testing.assert_array_equal(whole.read(), found)


@EVERY
@settings(max_examples=10)
@given(lost=st.sets(st.integers(0, 29), max_size=6), damaged=st.integers(0, 29))
def test_after_a_loss_no_frame_is_wrong(name: str, lost: set[int], damaged: int) -> None:
    """Frames that need a lost or damaged one are refused up to the next that starts fresh."""
    live = Live(name, walk(name, 30))
    pushed = live.push_rows()
    whole, able = live.new_decoder(), False
    for at, (stream, fresh) in enumerate(pushed):
        meant = whole.push(stream, fresh)
        if at in lost:
            live.decoder.skip(1)
            able = False
            continue
        if at == damaged:
            with pytest.raises(mcz.FormatError):
                live.decoder.push(stream + bytes(40), fresh)
            able = False
            continue
        try:
            np.testing.assert_array_equal(live.decoder.push(stream, fresh), meant)
            able = True
        except LostFrameError:
            assert not fresh and not able


@EVERY
def test_a_frame_that_is_refused_leaves_no_trace(name: str) -> None:
    live = Live(name, walk(name, 20))
    other = live.new_encoder()
    for at, row in enumerate(live.motion.values):
        for bad in (np.nan, 1e300):
            with pytest.raises(mcz.MotionError):
                live.encoder.push(np.where(np.arange(len(row)) == at % len(row), bad, row))
        assert live.encoder.push(row) == other.push(row)


@EVERY
def test_a_missing_marker_is_held(name: str) -> None:
    live = Live(name, markers_with_gaps(60))
    mask, before = live.motion.signals[0].mask, np.zeros(6)
    for packet, row, valid in zip(live.push_rows(), live.motion.values, mask, strict=True):
        found = live.decoder.push(*packet)
        np.testing.assert_allclose(found, np.where(valid, row, before), atol=1)
        before = np.where(valid, row, before)


@EVERY
def test_a_segment_that_has_nothing_before_it_is_refused(name: str) -> None:
    live = Live(name, walk(name, 12))
    pushed = live.push_rows()
    stale = [(stream, False) for stream, _ in pushed]
    with pytest.raises(mcz.FormatError):
        live.read(stale, 0, 12)


@EVERY
def test_a_damaged_packet_costs_the_frames_up_to_a_fresh_one(name: str) -> None:
    """In a file that is salvaged; those before it and behind them are what they were."""
    codec, params, every = CASES[name]
    motion, out = walk(name, 20), io.BytesIO()
    with mcz.LiveWriter(out, motion.skeleton, codec, params, frame_rate=Fraction(120)) as writer:
        for row in motion.values:
            writer.push(row)
    assert mcz.verify(out.getvalue()) == []
    with mcz.open(out.getvalue()) as file:
        whole, row = file.only_clip().read(), file.only_clip().signals[0].rows[every + 1]
    np.testing.assert_array_equal(whole, Live(name, motion).values())
    data = flip_bit(out.getvalue(), row.offset, 0)
    with mcz.open(data) as file, pytest.raises(mcz.ChecksumError):
        file.only_clip().read()
    with mcz.open(data, salvage=True) as file:
        decoded = file.only_clip().read()
    lost = np.isnan(decoded).any(axis=1)
    assert np.flatnonzero(lost).tolist() == list(range(every + 1, 2 * every))
    np.testing.assert_array_equal(decoded[~lost], whole[~lost])


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("lsdt-frame", {}, "step"),
        ("lsdt-frame", {"step": 1, "basis": "learned"}, "train"),
        ("lsdt-frame", {"step": 1, "coder": "prefix"}, "prefix"),
        ("online", {}, "a step or a bitrate"),
        ("online", {"step": 1, "basis": "learned"}, "train"),
        ("online", {"bitrate": 4}, "frame rate"),
        (
            "posewave",
            {"levels": 3, "step": 0.1},
            "levels=3 needs later frames, which a live stream does not have",
        ),
        ("posewave", {"quality": "head=1mm", "step": 0.1}, "quality needs all frames"),
        ("posewave", {"lossless": "M0", "levels": 0}, "lossless"),
    ],
)
def test_what_needs_all_frames_is_refused(name: str, params: dict[str, Any], words: str) -> None:
    codec = codec_by_name(name)
    layout = Layout(0, ((0, 1, 2),), skeleton=markers(1, 1).skeleton)
    assert codec.live is not None
    with pytest.raises(mcz.OptionError, match=words):
        codec.live(layout, codec.options(params))
