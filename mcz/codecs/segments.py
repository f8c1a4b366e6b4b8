"""Segments: their lengths in an encoder, and rows gathered from several in a decoder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mcz.codecs.contract import Layout, Request, Segment, SignalSource, Span
from mcz.codecs.parameters import Parameter, integer
from mcz.errors import MotionError
from mcz.model.motion import Skeleton
from mcz.model.types import Floats, Ints

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

CLEARLY_LARGER = 1.25  # than ``TARGET_BYTES``
TARGET_BYTES = 62_000  # of a segment: under the 64 KiB that DATA should have, table included
SEGMENT_FRAMES = 4096  # by default

SEGMENT_FRAMES_PARAMETER = Parameter(
    "segment_frames",
    None,
    f"frames a segment; default: as many as make 64 KiB, at most {SEGMENT_FRAMES}",
    integer("segment_frames", 1, 2**40),
)


def lossless_segment_frames(size: str, most: int) -> Parameter:
    """Parameter of the segment length, at most ``most`` frames; 0 means about ``size`` bytes."""
    return Parameter(
        "segment_frames",
        0,
        f"frames a segment; 0: as many as make about {size} bytes",
        integer("segment_frames", 0, most),
    )


def segment_frames_of(layout: Layout, option: int | None, *, as_published: bool = False) -> int:
    """Frames per segment; 0: by size. Published methods take the whole clip at once."""
    if option is None:
        return layout.n_frames if as_published else 0
    return option


Streams = tuple[bytes, ...]
Frames = tuple[int, int]  # first <= f < stop
Prepare = Callable[
    [int, int], Callable[[], Streams]
]  # reads frames; the returned function may run in any thread
Code = Callable[[int, int], Streams]  # frames first <= f < stop -> the streams of their segment


@dataclass(frozen=True, slots=True)
class Lengths:
    """Segment lengths: ``length`` frames at first, halved while segments are too large.

    A length is a multiple of ``unit`` and at least ``least``, except for the last segment.
    ``fixed``: sizes are ignored.
    """

    length: int
    fixed: bool
    unit: int = 1
    least: int = 1

    def halve(self, length: int) -> int:
        """Return half of ``length``, or ``length`` if that would be too short."""
        shorter = max(self.unit, length // 2 // self.unit * self.unit)
        return shorter if self.least <= shorter < length else length

    def fit(self, length: int, n_frames: int, n_bytes: float) -> int:
        """Halve ``length`` while a segment would be too large; ``n_frames`` took ``n_bytes``."""
        most = float(TARGET_BYTES)
        while n_bytes * min(length, n_frames) > most * n_frames:
            shorter = self.halve(length)
            if shorter == length:
                break
            length = shorter
            if length < n_frames:  # bytes that are not known yet may be fewer
                most = CLEARLY_LARGER * TARGET_BYTES
        return length


def segments_by_halving(
    n_frames: int, lengths: Lengths, code: Code, breaks: Sequence[int] = ()
) -> Iterator[tuple[int, int, Streams]]:
    """Yield segments first <= f < stop of a signal of ``n_frames``, and their streams.

    A segment also begins at each of the ``breaks``.
    """
    length, first = lengths.length, 0
    while first < n_frames:
        stop = min(first + length, *(end for end in (*breaks, n_frames) if end > first))
        streams = code(first, stop)
        shorter = length if lengths.fixed else lengths.fit(length, stop - first, _size(streams))
        if shorter < stop - first:
            length = shorter
            continue
        yield first, stop, streams
        first = stop


@dataclass(frozen=True, slots=True)
class Sizing:
    """Targets for the segment lengths of a codec of ordinals.

    About ``target`` bytes, ``most`` at most; ``value_bytes`` a value as the first estimate;
    ``spare`` bytes besides the streams; ``most_rows``. ``full``: a segment that is much smaller is
    encoded again, longer.
    """

    target: int
    most: int
    value_bytes: float
    most_rows: int
    spare: int = 0
    full: bool = False


class SegmentPrefetch(AbstractContextManager["SegmentPrefetch"]):
    """Encodes a requested segment while other threads encode the likely next ones."""

    def __init__(self, prepare: Prepare, threads: int) -> None:
        self._prepare = prepare
        self._threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._pending: dict[Frames, Future[Streams]] = {}

    def code(self, span: Frames, following: Iterator[Frames]) -> Streams:
        """Return the streams of ``span``; ``following`` only affects the speed."""
        if self._threads < 2:
            return self._prepare(*span)()
        batch = [span, *islice(following, self._threads)]
        if self._pool is None:
            if len(batch) < 2:
                return self._prepare(*span)()
            from concurrent.futures import ThreadPoolExecutor  # on first use

            self._pool = ThreadPoolExecutor(self._threads)
        for other in self._pending.keys() - set(batch):
            self._pending.pop(other).cancel()
        for other in batch:
            if other not in self._pending:
                self._pending[other] = self._pool.submit(self._prepare(*other))
        return self._pending.pop(span).result()

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


def segments_by_guess(
    source: SignalSource, fixed: int, sizing: Sizing, prepare: Prepare, threads: int = 1
) -> Iterator[Segment]:
    """Yield segments of ``fixed`` frames or, if that is 0, of as many as their size allows.

    A segment begins wherever the grids change. The length is kept while it is about right, so that
    ``threads`` can work on the following segments.
    """
    layout = source.layout
    per_frame = max(1, layout.n_channels) * layout.samples_per_frame
    ends = sorted({*source.breaks, layout.n_frames})
    most = min(layout.most_frames, max(1, sizing.most_rows // layout.samples_per_frame))
    guess = fixed or max(1, int(sizing.target / (sizing.value_bytes * per_frame)))
    first, limit, grows = 0, most, sizing.full and not fixed
    with SegmentPrefetch(prepare, threads) as prefetch:
        while first < layout.n_frames:
            longest = min(limit, guess if fixed else guess * 11 // 10)
            spans = _spans(first, min(guess, limit), longest, ends)
            span = next(spans)
            n_frames = span[1] - first
            streams = prefetch.code(span, spans)
            size = _size(streams) + sizing.spare
            fitting = n_frames * sizing.target // size if size else guess
            if size > sizing.most and n_frames > 1 and not fixed:
                guess, limit, grows = max(1, fitting), n_frames - 1, False
                continue
            if grows and size < 0.85 * sizing.target and span[1] not in ends and n_frames < most:
                guess, grows = min(4 * n_frames, fitting), False
                continue
            yield Segment(first, n_frames, streams)
            first, limit, grows = span[1], most, sizing.full and not fixed
            if not (fixed or not size or 0.85 * guess <= fitting <= 1.15 * guess):
                guess = max(1, min(4 * n_frames, fitting))


def _spans(first: int, length: int, longest: int, ends: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield spans of ``length`` frames from ``first`` on; before ``ends`` shorter or a bit longer.

    If ``longest`` permits, the last two are equally long.
    """
    for end in ends:
        while first < end:
            rest = end - first
            half = (rest + 1) // 2 if longest > length else length
            stop = end if rest <= longest else first + min(length, max(half, 1))
            yield first, stop
            first = stop


def _size(streams: Streams) -> int:
    return sum(map(len, streams))


def skeleton_of(name: str, layout: Layout) -> Skeleton:
    """Return the skeleton of a signal that codec ``name`` can encode; raises MotionError."""
    if layout.samples_per_frame != 1 or layout.skeleton is None:
        raise MotionError(f"{name}: the signal must have one sample a frame")
    return layout.skeleton


def gather(
    layout: Layout,
    spans: Sequence[Span],
    request: Request,
    decode_group: Callable[[int, int], Ints],
) -> Ints:
    """Gather the requested rows and groups of a codec whose segments do not overlap.

    ``decode_group(segment, group)`` returns all rows of one group in one segment.
    """
    per_frame = layout.samples_per_frame
    n_channels = sum(len(layout.groups[group]) for group in request.groups)
    out = np.empty(((request.stop - request.start) * per_frame, n_channels), np.int64)
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start >= stop:
            continue
        rows = slice((start - request.start) * per_frame, (stop - request.start) * per_frame)
        cut = slice((start - span.first) * per_frame, (stop - span.first) * per_frame)
        column = 0
        for group in request.groups:
            n = len(layout.groups[group])
            out[rows, column : column + n] = decode_group(index, group)[cut]
            column += n
    return out


def sample(source: SignalSource, most: int) -> Floats:
    """Sample at most ``most`` frames of a signal, evenly spread; invalid values are NaN."""
    layout = source.layout
    rows = [np.zeros((0, layout.n_channels))]
    for frame in range(0, layout.n_frames, max(1, -(-layout.n_frames // most))):
        values = np.asarray(source.values(frame, frame + 1), np.float64)
        valid = source.valid(frame, frame + 1)
        rows.append(values if valid is None else np.where(valid, values, np.nan))
    return np.concatenate(rows)
