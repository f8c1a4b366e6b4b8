"""A plain decoder of codec 3, qbc, written from SPEC.md alone and in its order.

Python integers and floats only, one value at a time: slow, small, and independent of the package.
Entropy coding and residuals are those of the plain decoder of mrdwt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tests.plain_wavelets import (
    Bytes,
    Coder,
    Model,
    Residuals,
    bits,
    clamp,
    refuse,
    side,
    starts_of,
)

START_SHA256 = "5cff32b14de47be6da716494f98497d9a189de80c104557986a47ff00e6dd0dc"
MARKS_START, CURVES_START = starts_of("qbc_start.json", START_SHA256)

Point = list[int]
Segment = tuple[int, int, Sequence[bytes]]  # first frame, frames, the codec's streams


class Header(NamedTuple):
    delta: int
    coded_frames: int
    decimals: int
    step: float
    position_step: float

    def point(self, point: Point, positions: Sequence[bool]) -> list[float]:
        """The coordinates of a control point; ``positions`` says which of them are lengths."""
        if self.decimals != 255:
            return [v / 10**self.decimals for v in point]
        steps = [self.position_step if position else self.step for position in positions]
        return [v * step for v, step in zip(point, steps, strict=True)]


def parse_header(data: bytes) -> Header:
    fields = Bytes(data)
    delta, coded_frames, decimals = fields.varint(), fields.varint(), fields.u8()
    steps = [fields.binary64() if decimals == 255 else 1.0 for _ in range(2)]
    sound = all(2.0**-100 <= step <= 2.0**100 for step in steps)
    if not 1 <= delta <= 2**20 or 15 < decimals < 255 or not sound:
        raise refuse(f"delta {delta}, {decimals} decimals, steps {steps}")
    if fields.rest():
        raise refuse("bytes after the header")
    return Header(delta, coded_frames, decimals, *steps)


def check_segments(header: Header, n_frames: int, segments: Sequence[Segment]) -> None:
    end = 0
    for first, size, _ in segments:
        if first != end or size < 1 or first % header.delta:
            raise refuse(f"a segment of {size} frames from {first} on, where {end} is due")
        end = first + size
    if end != n_frames or end > header.coded_frames:
        raise refuse(f"segments end at {end} of {n_frames}, {header.coded_frames} were coded")
    if end % header.delta and end != header.coded_frames:
        raise refuse(f"the last segment ends at {end}")


def marks_in(header: Header, first: int, end: int) -> list[int]:
    """The frames of the marks from ``first`` to ``end`` - 1."""
    frames = list(range(first, end, header.delta))
    last = header.coded_frames - 1
    return [*frames, last] if first <= last < end and frames[-1] != last else frames


# Points


class Points:
    """One kind of points: its residuals, and what each channel remembers."""

    def __init__(self, residuals: Residuals, h: int, n_channels: int) -> None:
        if h > 63:
            raise refuse(f"scale {h}")
        scale = (2 + h % 2) * 2 ** (h // 2) // 2
        self.residuals = residuals
        self.fast, self.slow = [16 * scale] * n_channels, [16 * scale] * n_channels
        self.side1, self.side2 = [0] * n_channels, [0] * n_channels

    def point(self, predicted: Point) -> Point:
        v = []
        near, other = 0, 3
        for c, expected in enumerate(predicted):
            model = self.residuals
            model.near, model.other = near, other
            model.side1, model.side2 = self.side1[c], self.side2[c]
            r = model.residual(self.fast[c], self.slow[c])
            v.append(in_range(expected + r))
            size = 16 * abs(r)
            near = (near + bits(size) - bits(self.slow[c])) >> 1
            self.fast[c] += (size - self.fast[c]) >> 1
            self.slow[c] += (size - self.slow[c]) >> 4
            self.side2[c] = self.side1[c]
            self.side1[c] = other = side(r)
        return v


def in_range(v: int) -> int:
    if abs(v) > 2**40:
        raise refuse(f"coordinate {v}")
    return v


# The stream of marks


def marks_of(data: bytes, n_channels: int, n_marks: int) -> list[Point]:
    if not data:
        return [[0] * n_channels] * n_marks
    fields = Bytes(data)
    h = fields.u8()
    coder = Coder(fields.rest())
    points = Points(Residuals(Model(MARKS_START, coder)), h, n_channels)
    marks = [[first_of(coder) for _ in range(n_channels)]]
    while len(marks) < n_marks:
        marks.append(points.point(marks[-1]))
    coder.finish()
    return marks


def first_of(coder: Coder) -> int:
    b = coder.number(6)
    if b == 0:
        return 0
    if b > 41:
        raise refuse(f"a coordinate of {b} bits")
    v = 2 ** (b - 1) + coder.number(b - 1)
    return in_range(-v if coder.number(1) else v)


# The stream of curves


class Curve(NamedTuple):
    first: int
    n_frames: int
    p0: Point
    p1: Point
    p2: Point


def middle_of(p0: Point, p2: Point) -> Point:
    return [(a + b) >> 1 for a, b in zip(p0, p2, strict=True)]


def straight(frames: Sequence[int], marks: Sequence[Point]) -> list[Curve]:
    """One straight curve from mark to mark."""
    return [
        Curve(a, b - a, p, middle_of(p, q), q)
        for a, b, p, q in zip(frames, frames[1:], marks, marks[1:], strict=False)
    ]


LAST, LAST_MIXER = 7704, 51


class Curves:
    """The curves of a stream, between marks at ``frames``."""

    def __init__(self, data: bytes, n_channels: int) -> None:
        fields = Bytes(data)
        scales = fields.u8(), fields.u8()
        self.coder = Coder(fields.rest())
        self.model = Model(CURVES_START, self.coder)
        self.lengths = Residuals(self.model)
        self.breaks = Points(Residuals(self.model, 2568, 17), scales[0], n_channels)
        self.middles = Points(Residuals(self.model, 5136, 34), scales[1], n_channels)

    def decode(self, frames: Sequence[int], marks: Sequence[Point]) -> list[Curve]:
        curves = []
        usual = 0
        for frame, end, p0, b in zip(frames, frames[1:], marks, marks[1:], strict=False):
            here, left = 0, end - frame
            while left > 0:
                m = self.length(left, here, usual)
                if m == left:
                    p2 = b
                else:
                    beside = zip(p0, b, strict=True)
                    p2 = self.breaks.point(
                        [p + (2 * (q - p) * m + left) // (2 * left) for p, q in beside]
                    )
                p1 = middle_of(p0, p2)
                if m > 1:
                    p1 = self.middles.point(p1)
                curves.append(Curve(end - left, m, p0, p1, p2))
                p0, left, here = p2, left - m, here + 1
            usual = here
        return curves

    def length(self, left: int, here: int, usual: int) -> int:
        if left == 1:
            return 1
        beside = 16 + min(here, 7), 24 + clamp(usual - here, 0, 7)
        if self.model.mixed(LAST_MIXER, LAST, min(bits(left), 15), *beside):
            return left
        self.lengths.near, self.lengths.other = min(here, 7) - 3, 3
        m = left // 2 + self.lengths.residual(4 * left, left)
        if not 1 <= m < left:
            raise refuse(f"a curve over {m} of {left} frames")
        return m


# Values


def values_of(header: Header, curve: Curve, positions: Sequence[bool]) -> list[list[float]]:
    rows = []
    ends = [header.point(point, positions) for point in curve[2:]]
    for i in range(curve.n_frames):
        t = i / curve.n_frames
        u = 1 - t
        rows.append(
            [((u * u) * a + ((2 * t) * u) * b) + (t * t) * c for a, b, c in zip(*ends, strict=True)]
        )
    return rows


def joint_rows(
    header: Header, positions: Sequence[bool], segments: Sequence[Segment], stop: int
) -> list[list[float]]:
    """Frames 0 to ``stop`` - 1 of a joint from its marks, and curves where there are any."""
    n_channels = len(positions)
    joined: list[tuple[list[int], list[Point], bytes]] = []
    for first, size, streams in segments:
        frames = marks_in(header, first, first + size)
        points = marks_of(streams[0], n_channels, len(frames))
        joined.append((frames, points, streams[1] if len(streams) > 1 else b""))
    rows: list[list[float]] = []
    for i, (frames, points, data) in enumerate(joined):
        whole = frames[-1] == header.coded_frames - 1
        if i + 1 < len(joined):
            following, whole = joined[i + 1], True
            frames, points = [*frames, following[0][0]], [*points, following[1][0]]
        if data:
            stream = Curves(data, n_channels)
            curves = stream.decode(frames, points)
            if whole:
                stream.coder.finish()
        else:
            curves = straight(frames, points)
        for curve in curves:
            rows += values_of(header, curve, positions)
        if i + 1 == len(joined):
            rows.append(header.point(points[-1], positions))
    if stop > len(rows):
        raise refuse(f"frames behind the last mark, at {len(rows)}")
    return rows[:stop]


def decode(
    header: bytes,
    groups: Sequence[Sequence[bool]],
    n_frames: int,
    n_resolutions: int,
    segments: Sequence[Segment],
    resolution: int = 0,
    stop: int | None = None,
) -> list[list[float]]:
    """Rows 0 to ``stop`` - 1 of a signal; resolution 1 leaves out the curves.

    ``groups`` say of each channel whether it is a length.

    ``segments`` hold ``n_frames``; without ``stop`` these are all wanted. Raises ValueError where
    a reader must refuse.
    """
    fields = parse_header(header)
    stop = n_frames if stop is None else stop
    n_groups = len(groups)
    if not 1 <= n_resolutions <= 2 or not 0 <= resolution < n_resolutions:
        raise refuse(f"resolution {resolution} of {n_resolutions}")
    check_segments(fields, n_frames, segments)
    if any(len(streams) != n_groups * n_resolutions for _, _, streams in segments):
        raise refuse(f"not {n_resolutions} streams a joint")
    wanted = n_groups * (n_resolutions - resolution)  # those of the curves come last
    rows: list[list[float]] = [[] for _ in range(stop)]
    for group, positions in enumerate(groups):
        own = [(first, n, streams[group:wanted:n_groups]) for first, n, streams in segments]
        for row, values in zip(rows, joint_rows(fields, positions, own, stop), strict=True):
            row += values
    return rows
