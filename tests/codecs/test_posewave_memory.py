"""Memory of posewave: what a search for a target need not encode again."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mcz.codecs import codec_by_name
from mcz.codecs.posewave import posewave
from mcz.codecs.posewave.header import parse_posewave_header
from mcz.codecs.posewave.memory import Memory
from mcz.codecs.posewave.segment import decode_segment
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tests.motions import smooth

CODEC = codec_by_name("posewave")
N_FRAMES = 200
Streams = list[tuple[bytes, ...]]


def encode(
    motion: Motion, octaves: NDArray[np.int64], memory: Memory
) -> tuple[bytes, Streams, MemorySource]:
    given = {"step": 0.05, "levels": 3, "refinement": octaves, "memory": memory}
    options = CODEC.options(given, inner=True)
    source = MemorySource(motion, 0, CODEC, 2**26, options)
    encoded = CODEC.encode(source, options)
    return encoded.header, [segment.streams for segment in encoded.segments], source


def octaves_at(frame: int) -> NDArray[np.int64]:
    octaves = np.zeros(N_FRAMES, np.int64)
    octaves[frame] = 2
    return octaves


def test_nothing_is_encoded_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    motion, memory = smooth(N_FRAMES), Memory()
    trials = [encode(motion, octaves_at(frame), memory)[:2] for frame in (20, 150)]

    def refuse(*_: object) -> None:
        raise AssertionError("encoded again")

    monkeypatch.setattr(posewave, "encode_segment", refuse)
    again = [encode(motion, octaves_at(frame), memory)[:2] for frame in (20, 150)]
    assert again == trials
    with pytest.raises(AssertionError, match="encoded again"):
        encode(motion, octaves_at(151), memory)


def decoded(motion: Motion, octaves: NDArray[np.int64], memory: Memory) -> NDArray[np.float64]:
    header, (streams,), source = encode(motion, octaves, memory)
    fields = parse_posewave_header(header, source.layout)
    return decode_segment(fields, motion.skeleton, streams, N_FRAMES, "test")


def test_frames_far_from_those_that_are_refined_stay() -> None:
    motion, memory = smooth(N_FRAMES), Memory()
    before = decoded(motion, octaves_at(150), memory)
    after = decoded(motion, octaves_at(150) + octaves_at(160), memory)
    assert np.array_equal(before[:100], after[:100])
    assert not np.array_equal(before[160], after[160])
    anew = decoded(motion, octaves_at(150) + octaves_at(160), Memory())
    assert not np.array_equal(before[:100], anew[:100])
