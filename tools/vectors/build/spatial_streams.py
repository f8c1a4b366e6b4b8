"""Odd streams of lsdt-frame and lsdt-clip, and what a lax reader makes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Model, id_of
from mcz.codecs.spatial import lsdt_frame, prefix_streams, window_streams
from mcz.codecs.spatial.lsdt_frame import FrameHeader
from mcz.codecs.spatial.prefix_streams import codes_from
from mcz.codecs.spatial.windows import WindowsHeader, space_of_windows, temporal_of
from mcz.codecs.table_kernels import code_table
from mcz.coding import mixing
from mcz.coding.huffman import class_of, codes_of
from mcz.coding.residuals import bits, code_residual, side_of
from mcz.coding.start import start_states
from mcz.coding.streams import code
from mcz.container import payloads
from mcz.motion import Motion
from mcz.schema import parse, varint
from tools.records import built
from tools.vectors.build.edits import Edit, stream, swap
from tools.vectors.build.spatial_clips import (
    CLIP,
    FRAME,
    HEADINGS,
    Ints,
    Lengths,
    Plan,
    file_with,
    header,
    segments_of,
    still,
    tables,
)

UNEXAMINED = 2**16  # bytes, more than any crafted stream has


def sized(*windows: bytes) -> bytes:
    """The stream of windows of these bytes."""
    return b"".join(varint(len(window)) + window for window in windows)


def _start_of(codec: str) -> Ints:
    return start_states("frame" if codec == FRAME else "window")[0].copy()


def adaptive(codec: str, loop: Callable[[Ints, NDArray[np.uint8]], bool], *, faulty: bool) -> bytes:
    """The bits that ``loop`` writes; ``faulty``: the last integer has no code."""
    data, state = np.zeros(UNEXAMINED, np.uint8), _start_of(codec)
    mixing.start(state, data, 1)
    assert loop(state, data) != faulty
    return data[: mixing.finish(state, data)].tobytes()


def faulty_bits(plan: Plan, table: Ints) -> bytes:
    """A table whose last coefficient may not be, in adaptive bits: a window's or a segment's."""

    def loop(state: Ints, data: NDArray[np.uint8]) -> bool:
        return _code(plan, state, data, table.copy()) < 0

    return adaptive(plan.codec, loop, faulty=True)


def _code(plan: Plan, state: Ints, data: NDArray[np.uint8], table: Ints) -> int:
    """Code a table in place, a window's or a segment's; the row or frame of a fault, or -1."""
    starts = plan.starts
    if plan.codec == FRAME:
        frames = lsdt_frame._kernels()
        memory = np.zeros(len(starts) - 1, np.int64)
        tracks = np.zeros((int(starts[-1]), frames.TRACK_SIZE), np.int64)
        return int(frames.code_frames(state, data, table, starts, memory, tracks, 1))
    windows = window_streams._kernels()
    return int(windows.code_window(state, data, table, starts, np.zeros(len(table), np.int64)))


def _code_longer_row(state: Ints, data: Any, row: Ints, n: int) -> bool:
    """Code the only row of a window of ``n`` frequencies, all of ``row`` as its length."""
    length = len(row)
    code_residual(state, data, length, 0, (16 * n, 16 * n), 3, (0, 0, 0), (0, 0))
    last = before = side_1 = side_2 = 0
    for k in range(length):
        if k == 0:
            code_residual(state, data, row[0], 0, (0, 0), 0, (0, 0, 0), (2568, 17))
            continue
        near = min(bits(length - k), 7)
        scales = 8 * last + 4 * before, 0
        code_residual(state, data, row[k], 0, scales, near, (side_1, side_2, 0), (5136, 34))
        before, last = last, abs(row[k])
        side_2, side_1 = side_1, side_of(row[k])
    return True


def _code_longer_frame(state: Ints, data: Any, row: Ints) -> bool:
    """Code the only frame, a fresh one of one matrix, all of ``row`` as its length."""
    code_residual(state, data, len(row), 0, (0, 0), 0, (0, 0, 0), (0, 0))
    above = 0
    for r in range(len(row)):
        sides = side_of(above), 0, 0
        code_residual(state, data, row[r], 0, (16 * abs(above), 0), 0, sides, (2568, 17))
        above = row[r]
    return True


def longer_row(row: Ints, n: int) -> bytes:
    """The bits of the only row of a window, whose length counts zeros behind the last other."""

    def loop(state: Ints, data: Any) -> bool:
        return bool(_code_longer_row(state, data, row, n))

    return adaptive(CLIP, loop, faulty=False)


def longer_frame(row: Ints) -> bytes:
    """The bits of the only frame, of one matrix, likewise."""

    def loop(state: Ints, data: Any) -> bool:
        return bool(_code_longer_frame(state, data, row))

    return adaptive(FRAME, loop, faulty=False)


class Bits:
    """Bits as they are written, of integers by the codes of these lengths."""

    def __init__(self, lengths: Lengths = ((), ())) -> None:
        self.text = ""
        self.lengths = lengths

    def plain(self, value: int, n: int) -> Bits:
        self.text += f"{value:0{n}b}" if n else ""
        return self

    def integer(self, value: int, which: int) -> Bits:
        """``which``: 0 a gap, 1 a value."""
        lengths = list(self.lengths[which])
        symbol, n = class_of(value)
        self.plain(int(codes_of(lengths, "code")[symbol]), lengths[symbol])
        return self.plain(value % 2**n, n)

    def sparse(self, n: int, *pairs: tuple[int, int], count: int | None = None) -> Bits:
        """A list of ``n`` entries: gaps and coefficients; ``count`` is said in place of theirs."""
        self.plain(len(pairs) if count is None else count, n.bit_length())
        for gap, value in pairs:
            self.integer(gap, 0).integer(abs(value) - 1, 1).plain(value < 0, 1)
        return self

    def data(self, padding: str = "0") -> bytes:
        text = self.text + padding * (-len(self.text) % 8)
        return bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8))


def overlooked(plan: Plan, edit: Edit) -> Plan:
    """What is read of edited bits, of prefix codes, where nobody counts their bytes.

    The only segment has one window, or it is of lsdt-frame.
    """
    ((table,),) = tables(plan)
    (segment,) = segments_of(plan)
    stream = segment.streams[0]
    data = np.frombuffer(edit(stream if plan.codec == FRAME else stream[1:]), np.uint8).copy()
    kind = FrameHeader if plan.codec == FRAME else WindowsHeader
    codes = codes_from(parse(kind, header(plan), plan.codec).code, plan.codec)
    assert codes is not None
    found = np.zeros_like(table)
    starts = plan.starts if plan.codec == FRAME else np.array([0, found.shape[1]])
    loops = prefix_streams._kernels()
    coder = np.array([0, 0])
    assert loops.code_vectors(coder, data, found, starts, codes.gaps, codes.values) < 0
    return replace(plan, fill=lambda number, n_rows, n: found)


def values_from(plan: Plan) -> NDArray[np.float64]:
    """The values of all frames, never coded: for coefficients that may not be."""
    values = np.zeros((plan.n_frames, plan.n_channels))
    found = [table for segment in tables(plan) for table in segment]
    if plan.codec == FRAME:
        coder = lsdt_frame._Coder(header(plan), plan.layout)
        for first, table in zip(plan.firsts, found, strict=True):
            out = values[first : first + len(table)]
            lsdt_frame._kernels().add_frames(out, coder._values, table, coder.space.transform())
        return values
    fields = parse(WindowsHeader, header(plan), plan.codec)
    space = space_of_windows(fields, plan.layout)
    sizes, at = [n for _, own in plan.windows() for n in own], 0
    for n, table in zip(sizes, found, strict=True):
        window_streams._kernels().synthesize(
            values[at : at + n],
            table,
            np.full(len(table), table.shape[1]),
            temporal_of(space, fields, n),
            space.transform(),
            space.mean,
        )
        at += n
    return values


def spec_of(name: str, *more: str) -> str:
    """Headings of SPEC.md: those of the codec, and more."""
    return "; ".join((HEADINGS[name], *more))


def silent(plan: Plan, motion: Motion | None = None, **edits: Any) -> bytes:
    """A file of zeros."""
    return file_with(replace(plan, fill=still), motion, **edits)


def stream_with(plan: Plan, data: bytes) -> Any:
    """The only segment has these bits, of frames or of a window."""
    return stream(0, lambda _: data if plan.codec == FRAME else sized(data))


def with_model(plan: Plan, kind: int, data: bytes, **edits: Any) -> bytes:
    """The file of ``plan`` with another model, which the clip names."""
    old = plan.model
    assert old is not None
    payload = built(payloads.Modl, {"kind": kind, "data": data}, "MODL")
    named = swap(id_of(old), id_of(Model(kind, data)))
    return file_with(plan, MODL=lambda _: payload, CLIP=named, **edits)


def coded_entries(
    tables: Sequence[tuple[int, int, int]], *entries: Sequence[Sequence[int]]
) -> bytes:
    """The bits of tables of (vectors, points, shift), zeros unless they are given."""

    def loop(state: Ints, data: Any) -> bool:
        for at, (n_vectors, n_points, shift) in enumerate(tables):
            table = np.zeros((n_vectors, n_points), np.int64)
            if entries:
                table[:] = entries[at]
            scales = np.full(n_vectors, 1 << shift) >> n_points.bit_length() // 2
            code_table(state, data, table, scales, 1)
        return True

    size = sum(n_vectors * n_points for n_vectors, n_points, _ in tables)
    return code(start_states("pca")[0], 2 * size + 256, loop, "bases")
