"""A plain decoder of codec 11, online, written from SPEC.md alone and in its order.

Python integers and floats only, one value at a time: slow, small, and independent of the package.
Space, and the coefficients of coder 0, are those of the plain decoder of lsdt-frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tests import plain_lsdt
from tests.plain_lsdt import APART, WEIGHTED, FindModel, Kinds, Row, Segment, Space, Vector
from tests.plain_qbc import in_range
from tests.plain_wavelets import Bytes, Coder, Model, bits, clamp, refuse, starts_of

START_SHA256 = "00dbab74bc28796b089f9a4510381be8c170ed27c2f81f4d66de3edcafd6047c"
STARTS = starts_of("online_start.json", START_SHA256)

STR, LTR, INTRA = 0, 1, 2  # kinds
MIXED, GOLOMB = 0, 1  # coders


# The header


class Header(NamedTuple):
    space: Space
    channels: list[list[int]]  # of each matrix those of its points
    coder: int


def parse_header(data: bytes, n_channels: int, find: FindModel) -> Header:
    fields = Bytes(data)
    space = plain_lsdt.parse_space(fields, n_channels, APART | WEIGHTED, find)
    order, coder = fields.u8(), fields.u8()
    if order > 1 or coder > 1 or fields.rest():
        raise refuse(f"order {order}, coder {coder}, or bytes after the header")
    channels = [list(matrix.channels) for matrix in space.matrices]
    if order == 1:
        if len(space.matrices) > 1 or n_channels % 3:
            raise refuse(f"{n_channels} channels in {len(space.matrices)} matrices, reordered")
        m = n_channels // 3
        channels = [[3 * (j % m) + j // m for j in range(n_channels)]]
    return Header(space, channels, coder)


# Units


class Unit(NamedTuple):
    kind: int
    first: int  # frame
    n_frames: int
    distance: int
    data: bytes


def units_of(stream: bytes, first: int, n_frames: int) -> list[Unit]:
    """Those of a segment."""
    fields = Bytes(stream)
    units = []
    left = n_frames
    while left:
        n, kind = divmod(fields.varint(), 4)
        if kind == 3 or not 1 <= n <= left:
            raise refuse(f"a unit of {n} frames of {left}, kind {kind}")
        distance = fields.varint() if kind == LTR else 0
        data = fields.take(fields.varint()) if n < left else fields.rest()
        units.append(Unit(kind, first + n_frames - left, n, distance, data))
        left -= n
    return units


def check_units(units: Sequence[Unit], last: int | None) -> int | None:
    """``last``: the frame of the last LTR before, and what it then is."""
    for unit in units:
        if unit.kind == LTR and (last is None or unit.distance != unit.first - last):
            raise refuse(f"an LTR at {unit.first}, {unit.distance} behind that at {last}")
        if unit.kind != STR:
            last = unit.first
    return last


# Frames

FLAGS = {MIXED: 7704, GOLOMB: 0}
PREFIX = 15


def adaptive(model: Model, k: int) -> int:
    """Adaptive bit of context ``k``."""
    bit = model.coder.decode(clamp(model.p[k], 32, 65504))
    model.p[k] += ((65535 if bit else 0) - model.p[k]) * (65536 // (model.n[k] + 2)) >> 16
    model.n[k] += model.n[k] < 250
    return bit


class Reference(NamedTuple):
    """The last LTR."""

    frame: int
    step: int
    values: Vector


class State(plain_lsdt.State):
    """What a unit leaves to the next."""

    def __init__(self, header: Header) -> None:
        self.own = header
        self.values = [0.0 for _ in header.space.weights]
        self.step = 0
        self.ltr: Reference | None = None

    def unit(self, unit: Unit) -> list[Vector]:
        """The values of its frames."""
        coder = Coder(unit.data)
        self.begin(unit, coder)
        rows = [self.frame(unit.kind if i == 0 else STR) for i in range(unit.n_frames)]
        coder.finish()
        return rows

    def begin(self, unit: Unit, coder: Coder) -> None:
        self.at = unit.first
        if unit.kind == STR:
            self.model.coder = coder
            return
        self.model = Model(STARTS[2 * self.own.coder + (unit.kind != INTRA)], coder)
        self.present = 0
        if self.own.coder == MIXED:
            self.kinds = Kinds(self.model)
        matrices = self.own.space.matrices
        self.rows = [[Row() for _ in matrix.vectors] for matrix in matrices]
        self.lengths = [0 for _ in matrices]
        self.sizes = [[0 for _ in matrix.vectors] for matrix in matrices]  # p of coder 1

    def flag(self, k: int) -> int:
        return adaptive(self.model, FLAGS[self.own.coder] + k)

    def frame(self, kind: int) -> Vector:
        c = self.coefficients(kind)
        values = list(self.values_of(kind, c))
        if kind != STR:
            self.ltr = Reference(self.at, self.step, values)
        self.values = values
        self.at += 1
        return values

    def coefficients(self, kind: int) -> list[list[int]]:
        """The step of a frame, and the coefficients of each matrix."""
        before = 256 if kind == INTRA else self.step
        if kind == LTR:
            assert self.ltr is not None
            before = self.ltr.step
        here = self.flag(kind + 1 if kind else self.present)
        self.present = 0 if kind else here
        if not here:
            self.step = before
            return [[0] * len(rows) for rows in self.rows]
        self.step = self.step_of(kind, before)
        if self.own.coder == MIXED:
            return self.adaptive_frame(kind != STR)
        return self.golomb_frame(kind)

    def step_of(self, kind: int, before: int) -> int:
        coder = self.model.coder
        if kind == INTRA:
            return coder.number(9)
        if self.flag(4 + (kind > 0)):
            return before
        negative, n = coder.number(1), 1
        while self.flag(5 + n):
            n += 1
            if n > 9:
                raise refuse("a change of a step")
        change = (1 << (n - 1)) + coder.number(n - 1)
        step = before - change if negative else before + change
        if not 0 <= step <= 511:
            raise refuse(f"step {step}")
        return step

    # Coder 1

    def golomb_frame(self, kind: int) -> list[list[int]]:
        found = [self.golomb_matrix(kind, p) for p in self.sizes]
        for c in found:
            for r, size in enumerate(c):
                if size and self.model.coder.number(1):
                    c[r] = -size
        for m, c in enumerate(found):
            self.sizes[m] = [0 if kind else abs(v) for v in c]
        return found

    def golomb_matrix(self, kind: int, p: Sequence[int]) -> list[int]:
        """The absolute values."""
        sizes = []
        one = two = 0
        for r in range(len(p)):
            a = 2 * one + two + 2 * p[r] + (p[r + 1] if r + 1 < len(p) else 0)
            g = max(0, bits(a) - 3)
            q = a if g == 0 else 7 + min(g, 8)
            x = 4 * (16 * (kind > 0) + q)
            size = in_range(self.prefix(x, g) * 2**g + self.model.coder.number(g))
            sizes.append(size)
            two, one = one, size
        return sizes

    def prefix(self, x: int, g: int) -> int:
        n = 0
        while adaptive(self.model, PREFIX + x + min(n, 3)):
            n += 1
            if n == 16:
                size = self.model.coder.number(6)
                if size == 0 or size > 42:
                    raise refuse(f"a prefix of {size} bits")
                n = 15 + 2 ** (size - 1) + self.model.coder.number(size - 1)
                break
        if n > 2**40 >> g:
            raise refuse(f"a prefix of {n}")
        return n

    # Values

    def values_of(self, kind: int, coefficients: Sequence[Sequence[int]]) -> Vector:
        values = list(self.values)
        if kind == INTRA:
            values = [0.0 for _ in values]
        elif kind == LTR:
            assert self.ltr is not None
            values = list(self.ltr.values)
        space = self.own.space
        s = space.step * ((8 + self.step % 8) * 2.0 ** (self.step // 8 - 35))
        for matrix, channels, own in zip(
            space.matrices, self.own.channels, coefficients, strict=True
        ):
            sums = [0.0 for _ in channels]
            for c, e in zip(own, matrix.vectors, strict=True):
                sums = [v + c * x for v, x in zip(sums, e, strict=True)]
            for channel, v in zip(channels, sums, strict=True):
                values[channel] += (v * s) * space.weights[channel]
        return values


# All


def units_of_segments(n_channels: int, n_frames: int, segments: Sequence[Segment]) -> list[Unit]:
    """Those of a signal with channels."""
    plain_lsdt.check_segments(plain_lsdt.FRAME, n_channels, n_frames, segments)
    units: list[Unit] = []
    for segment in segments:
        for stream in segment.streams:
            own = units_of(stream, segment.first, segment.n_frames)
            if segment.fresh != (own[0].kind == INTRA):
                raise refuse(f"a segment of a unit of kind {own[0].kind}, fresh {segment.fresh}")
            units += own
    check_units(units, None)
    return units


def decode(
    header: bytes,
    n_channels: int,
    n_frames: int,
    segments: Sequence[Segment],
    find: FindModel,
    start: int = 0,
) -> list[Vector]:
    """Rows from ``start`` on, from the last intra coded unit before it on.

    Raises ValueError where a reader must refuse.
    """
    fields = parse_header(header, n_channels, find)
    units = units_of_segments(n_channels, n_frames, segments)
    if n_channels == 0:
        return [[] for _ in range(start, n_frames)]
    begins = [unit.first for unit in units if unit.kind == INTRA and unit.first <= start]
    state, rows = State(fields), []
    for unit in units:
        if begins and unit.first >= begins[-1]:
            rows += state.unit(unit)
    return rows[start - begins[-1] :] if begins else []


# Lost frames

Frame = tuple[bytes, bool]  # stream, fresh


def decode_live(
    header: bytes,
    n_channels: int,
    frames: Sequence[Frame | None],
    find: FindModel,
) -> list[Vector | None]:
    """The values of single frames: None of those that did not come or must not be decoded."""
    state = State(parse_header(header, n_channels, find))
    rows: list[Vector | None] = []
    for at, frame in enumerate(frames):
        before = state.ltr
        decoded = bool(rows) and rows[-1] is not None
        try:
            rows.append(live_frame(state, at, decoded, frame))
        except ValueError:
            state.ltr = before
            rows.append(None)
    return rows


def live_frame(state: State, at: int, decoded: bool, frame: Frame | None) -> Vector:
    """``decoded``: whether the frame before was."""
    if frame is None:
        raise refuse(f"frame {at} did not come")
    stream, fresh = frame
    (unit,) = units_of(stream, at, 1)
    if fresh != (unit.kind == INTRA) or (unit.kind == STR and not decoded):
        raise refuse(f"frame {at} needs the one before")
    check_units([unit], None if state.ltr is None else state.ltr.frame)
    (row,) = state.unit(unit)
    return row
