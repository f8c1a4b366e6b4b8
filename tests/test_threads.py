"""Threads: the same numbers and bytes however many there are, and faults where they were."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import ChecksumError, OptionError
from mcz.codecs import CODECS
from mcz.codecs.contract import Layout
from mcz.codecs.segments import Sizing, segments_by_guess
from mcz.model.threads import limit_threads, map_in_order, thread_limit
from tests.motions import smooth, write_bytes

MOTION = smooth(1800)
SEGMENTED = sorted(
    codec.name
    for codec in CODECS.values()
    if any(parameter.name == "segment_frames" for parameter in codec.parameters)
)


def file_of(codec: str, threads: int | None = None, **params: object) -> bytes:
    return write_bytes(MOTION, codec=codec, threads=threads, **params)


@pytest.mark.parametrize("codec", SEGMENTED)
def test_numbers_do_not_depend_on_threads(codec: str) -> None:
    data = file_of(codec, segment_frames=270)
    found = []
    for threads in (1, 2, 5):
        with mcz.open(data, threads=threads) as file:
            clip = file.only_clip()
            found.append((clip.values[:], clip.values[100:1700], clip.read(joints=["spine"])))
    for arrays in found[1:]:
        for one, other in zip(arrays, found[0], strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("codec", ["raw", "fast", "best"])
@pytest.mark.parametrize("segment_frames", [0, 250])
def test_bytes_do_not_depend_on_threads(codec: str, segment_frames: int) -> None:
    files = {file_of(codec, threads, segment_frames=segment_frames) for threads in (1, 2, 5)}
    assert len(files) == 1


@pytest.mark.parametrize("threads", [1, 4])
def test_damage_is_found_where_it_is(threads: int) -> None:
    data = bytearray(file_of("fast", segment_frames=300))
    with mcz.open(bytes(data)) as file:
        rows = file.only_clip().signals[0].rows
    data[rows[3].offset + 40] ^= 1
    with mcz.open(bytes(data), threads=threads) as file:
        clip = file.only_clip()
        with pytest.raises(ChecksumError, match=f"DATA at {rows[3].chunk().offset}"):
            clip.values[:]
        np.testing.assert_array_equal(clip.values[:900], MOTION.values[:900])
        np.testing.assert_array_equal(clip.values[1200:], MOTION.values[1200:])


def test_how_many_threads_there_are() -> None:
    usual = thread_limit()
    assert usual >= 1
    with limit_threads(3):
        assert thread_limit() == 3
        with limit_threads(None):
            assert thread_limit() == 3
        with limit_threads(1):
            assert thread_limit() == 1
    assert thread_limit() == usual
    with pytest.raises(OptionError, match="threads is 0"):
        mcz.open(b"", threads=0)
    with pytest.raises(OptionError, match="threads is -1"):
        mcz.write(MOTION, io.BytesIO(), threads=-1)


def test_few_results_wait() -> None:
    begun: list[int] = []
    before = threading.active_count()
    results = map_in_order(lambda item: begun.append(item) or item, range(100), 3)
    assert next(results) == 0
    assert len(begun) <= 5
    results.close()
    assert len(begun) <= 5
    assert threading.active_count() == before


@given(
    n_frames=st.integers(0, 60),
    breaks=st.sets(st.integers(1, 59), max_size=3),
    costs=st.lists(st.integers(0, 40), min_size=60, max_size=60),
    target=st.integers(1, 100),
    spare=st.integers(0, 30),
    most_rows=st.integers(1, 80),
    full=st.booleans(),
    fixed=st.just(0) | st.integers(1, 70),
    threads=st.integers(1, 3),
)
def test_segments_cover_all_frames(
    n_frames: int,
    breaks: set[int],
    costs: list[int],
    target: int,
    spare: int,
    most_rows: int,
    full: bool,
    fixed: int,
    threads: int,
) -> None:
    """Whatever frames cost: no segment is too large that could be shorter, and there is an end."""
    begun = 0

    def prepare(first: int, stop: int) -> Callable[[], tuple[bytes, ...]]:
        nonlocal begun
        begun += 1
        assert begun < 5000
        return lambda: (bytes(7 + sum(costs[first:stop])),)

    layout = Layout(n_frames, ((0,),))
    source = SimpleNamespace(layout=layout, breaks=sorted(b for b in breaks if b < n_frames))
    sizing = Sizing(target, target + spare, 1.5, most_rows, full=full)
    at = 0
    for segment in segments_by_guess(source, fixed, sizing, prepare, threads):
        assert segment.first == at
        at += segment.n_frames
        assert 1 <= segment.n_frames <= most_rows
        assert not any(segment.first < b < at for b in source.breaks)
        if fixed:
            ends = {*source.breaks, n_frames}
            assert segment.n_frames == min(fixed, most_rows) or at in ends
        elif segment.n_frames > 1:
            assert len(segment.streams[0]) <= sizing.most
    assert at == n_frames
