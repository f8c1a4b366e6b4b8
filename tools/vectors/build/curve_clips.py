"""Clips of ``qbc``, to order: control points, curves and headers that no encoder chooses.

Control points are integers that are written out or counted, so the bytes do not depend on a
machine's arithmetic; values are those of the decoder.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import raw
from mcz.codecs.coding import mixing
from mcz.codecs.coding.streams import start_states
from mcz.codecs.contract import Codec, Encoded, Layout, Request, Segment, Span
from mcz.codecs.curves import kernels, qbc, streams
from mcz.codecs.parameters import SCALED
from mcz.model.motion import Motion, Skeleton
from mcz.model.schema import varint
from tools.vectors.build.files import partial

UNEXAMINED = 2**16  # bytes, more than any crafted stream has
Ints = NDArray[np.int64]
Point = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Piece:
    """A curve: its frames, the points at its end and in its middle; None: what is predicted.

    The last piece between two marks ends at the mark, a piece of one frame has no middle point:
    what is said there counts for nothing.
    """

    n_frames: int
    end: Point | None = None
    middle: Point | None = None


@dataclass(frozen=True, slots=True)
class Path:
    """One joint: its marks, and between marks k and k + 1 ``pieces[k]``, else a straight curve.

    ``scales``: of marks, breaks, middle points, in half octaves. ``spoken``: which of the streams
    0 and 1 are written with bits where they could be empty. ``size``: channels where no mark is.
    """

    marks: Sequence[Point]
    pieces: Mapping[int, Sequence[Piece]] = field(default_factory=dict)
    scales: tuple[int, int, int] = (12, 8, 6)
    spoken: tuple[int, ...] = ()
    size: int = 0


@dataclass(frozen=True, slots=True)
class Plan:
    """Header and segments of a signal.

    ``ends``: the segments' but the last one's; ``coded``: coded_frames, where these are more.
    """

    n_frames: int
    delta: int = 8
    decimals: int = 2
    step: float = 1.0
    position_step: float | None = None  # None: that of the others
    ends: tuple[int, ...] = ()
    coded: int | None = None
    n_resolutions: int = 2

    @property
    def own_position_step(self) -> float:
        return self.step if self.position_step is None else self.position_step

    @property
    def coded_frames(self) -> int:
        return self.n_frames if self.coded is None else self.coded

    @property
    def marks(self) -> list[int]:
        """The frames of all marks up to the first behind the stored frames."""
        if not self.n_frames:
            return []
        return [int(f) for f in qbc.marks_of(0, self.n_frames, self.coded_frames, self.delta)]

    def between(self, mark: int) -> int:
        """The frames from this mark to the next."""
        return self.marks[mark + 1] - self.marks[mark]


def header(plan: Plan, **parts: bytes) -> bytes:
    """The header, field by field; ``parts`` are said in place of what the plan says."""
    fields = {
        "delta": varint(plan.delta),
        "coded_frames": varint(plan.coded_frames),
        "decimals": bytes((plan.decimals,)),
        "step": struct.pack("<d", plan.step) if plan.decimals == SCALED else b"",
        "position_step": struct.pack("<d", plan.own_position_step)
        if plan.decimals == SCALED
        else b"",
    }
    return b"".join((fields | parts).values())


def still(plan: Plan, size: int = 1, **changes: Any) -> Path:
    """A joint of zeros."""
    return Path([(0,) * size] * len(plan.marks), **changes)


# Streams


def curves_of(plan: Plan, path: Path, first: int, stop: int) -> tuple[Ints, Ints, streams.Curves]:
    """Marks, their frames and the curves between them, of the marks ``first`` to ``stop``."""
    frames = np.array(plan.marks[first : stop + 1], np.int64)
    marks = np.array(path.marks[first : stop + 1], np.int64).reshape(len(frames), -1)
    lengths: list[int] = []
    points: list[tuple[list[int], list[int]]] = []
    for k in range(first, min(stop, len(plan.marks) - 1)):
        start, last = list(path.marks[k]), list(path.marks[k + 1])
        left = plan.between(k)
        for piece in path.pieces.get(k, (Piece(left),)):
            n = piece.n_frames
            end = last
            if n < left:
                ahead = [
                    a + (2 * (b - a) * n + left) // (2 * left)
                    for a, b in zip(start, last, strict=True)
                ]
                end = ahead if piece.end is None else list(piece.end)
            middle = [(a + b) >> 1 for a, b in zip(start, end, strict=True)]
            if n > 1 and piece.middle is not None:
                middle = list(piece.middle)
            lengths.append(n)
            points.append((end, middle))
            start, left = end, left - n
        assert left == 0, (k, left)
    ends, mids = (
        np.array([p[i] for p in points], np.int64).reshape(len(points), marks.shape[1])
        for i in range(2)
    )
    return marks, frames, streams.Curves(np.array(lengths, np.int64), ends, mids)


def coded_marks(marks: Ints, halves: int, *, faulty: bool = False) -> bytes:
    """A stream of marks; ``faulty``: its last point has no code."""
    scale = streams.scale_of(min(halves, streams.MAX_SCALE))
    return bytes((halves,)) + _bits(
        streams.MARKS,
        lambda state, data: kernels.code_marks(state, data, marks.copy(), len(marks), scale) < 0,
        faulty=faulty,
    )


def coded_curves(
    marks: Ints,
    frames: Ints,
    curves: streams.Curves,
    halves: Sequence[int],
    *,
    faulty: bool = False,
) -> bytes:
    """A stream of curves; ``faulty``: its last point or length has no code."""
    scales = np.array([streams.scale_of(min(h, streams.MAX_SCALE)) for h in halves])

    def loop(state: Ints, data: NDArray[np.uint8]) -> bool:
        parts = (part.copy() for part in (curves.lengths, curves.ends, curves.mids))
        found: int = kernels.code_details(state, data, marks, frames, *parts, scales)
        return found == len(curves.lengths)

    return bytes(halves) + _bits(streams.DETAILS, loop, faulty=faulty)


def _bits(number: int, loop: Callable[..., bool], *, faulty: bool) -> bytes:
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("qbc")[number].copy()
    mixing.start(state, data, 1)
    assert loop(state, data) != faulty
    return data[: mixing.finish(state, data)].tobytes()


def segments_of(plan: Plan, made: Sequence[Path]) -> list[Segment]:
    found = []
    first = 0
    for stop in (*plan.ends, *([plan.n_frames] if plan.n_frames else [])):
        own = [i for i, frame in enumerate(plan.marks) if first <= frame < stop]
        pairs = [_streams(plan, path, own[0], own[-1] + 1) for path in made]
        listed = [pair[k] for k in range(plan.n_resolutions) for pair in pairs]
        found.append(Segment(first, stop - first, tuple(listed), min(first, plan.delta - 1)))
        first = stop
    return found


def _streams(plan: Plan, path: Path, first: int, stop: int) -> tuple[bytes, bytes]:
    marks, frames, curves = curves_of(plan, path, first, stop)
    own = marks[: stop - first]
    plain = streams.straight_curves(marks, frames)
    bent = len(plain.lengths) != len(curves.lengths) or (plain.mids != curves.mids).any()
    coarse, fine = b"", b""
    if own.any() or 0 in path.spoken:
        coarse = coded_marks(own, path.scales[0])
    if bent or 1 in path.spoken:
        fine = coded_curves(marks, frames, curves, path.scales[1:])
    return coarse, fine


# Files


def codec_of(plan: Plan, made: Sequence[Path]) -> Codec:
    """Codec qbc with this content, whatever the values of the motion."""

    def encode(source: Any, params: Any) -> Encoded:
        return Encoded(header(plan), iter(segments_of(plan, made)), plan.n_resolutions)

    return replace(qbc.CODEC, encode=encode, parameters=raw.CODEC.parameters, dial=None)


def values_of(
    plan: Plan, made: Sequence[Path], resolution: int = 0, skeleton: Skeleton | None = None
) -> NDArray[np.float64]:
    """The values of all frames; ``skeleton`` says which channels are positions, by default none."""
    found, n = segments_of(plan, made), len(made)
    ends = np.cumsum([0, *(sizes_of(made))]).tolist()
    groups = tuple(tuple(range(a, b)) for a, b in zip(ends, ends[1:], strict=False))
    layout = Layout(plan.n_frames, groups, skeleton=skeleton, n_resolutions=plan.n_resolutions)
    spans = [Span(s.first, s.n_frames, s.lead) for s in found]
    request = Request(0, plan.n_frames, tuple(range(n)), resolution)

    def fetch(segment: int, stored: int, group: int) -> bytes:
        return found[segment].streams[stored * n + group]

    values: NDArray[np.float64] = qbc.CODEC.decode(header(plan), layout, spans, request, fetch)
    return values


def sizes_of(made: Sequence[Path]) -> list[int]:
    return [len(path.marks[0]) if path.marks else path.size for path in made]


def request(
    plan: Plan,
    made: Sequence[Path],
    motion: Motion,
    resolution: int,
    frames: tuple[int, int],
    joints: Sequence[int] | None,
) -> Any:
    """Arguments and arrays of a partial read, of resolution 1 without the curves."""
    first = replace(motion.signals[0], values=values_of(plan, made, resolution, motion.skeleton))
    coarse = replace(motion, signals=(first, *motion.signals[1:]))
    arguments, arrays = partial(coarse, frames, joints)
    return (*arguments, "--resolution", str(resolution)), arrays
