"""Ordinals of every grid, and the codecs of ordinals without a container."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from unittest import mock

import numpy as np
from hypothesis import strategies as st

from mcz.codecs import codec_by_name
from mcz.codecs.coding.fast import lanes
from mcz.codecs.coding.fast.encoder import Plan, StreamBuilder
from mcz.codecs.coding.forms import units
from mcz.codecs.contract import Layout, Request, Span
from mcz.codecs.lossless.best import AS_FAST, code_plan
from mcz.codecs.lossless.echoes import choose_references
from mcz.model.numbers import Grid, GridKind

GRIDS = (
    Grid(GridKind.FIXED, 4),
    Grid(GridKind.TRIMMED, 6),
    Grid(GridKind.GENERAL, 1),
    Grid(GridKind.GENERAL, 6),
    Grid(GridKind.GENERAL, 15),
    Grid(GridKind.TEXT64),
    Grid(GridKind.TEXT64, 64 + 20),
    Grid(GridKind.TEXT32),
    Grid(GridKind.INTEGER),
    Grid(GridKind.SCALED, scale=0.01),
    Grid(GridKind.BINARY32),
    Grid(GridKind.BINARY64),
    Grid(GridKind.VAX_F),
)
Ordinals = np.ndarray


@dataclass(frozen=True)
class Coder:
    """The streams of a codec, and its ``decode``."""

    name: str
    build: Callable[[Ordinals, list[tuple[Grid, Grid]]], bytes]

    def encode_columns(self, columns: Ordinals, grid: Grid, clip_grid: Grid | None = None) -> bytes:
        return self.build(columns, [(grid, clip_grid or grid)] * columns.shape[1])

    def decode_stream(self, stream: bytes, n_rows: int, n_channels: int, grid: Grid) -> Ordinals:
        layout = Layout(n_rows, (tuple(range(n_channels)),), grids=(grid,) * n_channels)
        request = Request(0, n_rows, (0,))
        decode = codec_by_name(self.name).decode
        return decode(b"", layout, [Span(0, n_rows)], request, lambda s, r, g: stream)

    def rows(self, stream: bytes, n_rows: int, n_channels: int, grid: Grid) -> object:
        """Rows as lists; the same by both decoders of fast."""
        found: list[object] = []
        for lacking in (False, True) if self.name == "fast" else (False,):
            with ExitStack() as stack:
                for module in (units, lanes) if lacking else ():
                    name = f"{module.__name__}.lacks_compiled_kernels"
                    stack.enter_context(mock.patch(name, return_value=True))
                found.append(self.decode_stream(stream, n_rows, n_channels, grid).tolist())
        assert found[0] == found[-1]
        return found[0]


def plan_of(columns: Ordinals, own: list[tuple[Grid, Grid]]) -> Plan:
    builder = StreamBuilder([clip for _, clip in own], [range(len(own))])
    return builder.plan(columns, tuple(grid for grid, _ in own))


def encode_predicted(
    columns: Ordinals, own: list[tuple[Grid, Grid]], references: list[list[int]] | None = None
) -> bytes:
    """A stream of method 1 of ``best``, or of 0 where no channel is coded."""
    plan = plan_of(columns, own)
    if not len(plan.lanes.numbers):
        return bytes((AS_FAST,)) + FAST.build(columns, own)
    chosen = references or choose_references(plan.lanes.leads.T, 8, 4096)
    return code_plan(plan, chosen[: len(plan.lanes.numbers)], [])


FAST = Coder(
    "fast",
    lambda columns, own: StreamBuilder([clip for _, clip in own], [range(len(own))]).build(
        columns, tuple(grid for grid, _ in own)
    )[0],
)
BEST = Coder("best", encode_predicted)
CODERS = (FAST, BEST)


@st.composite
def columns(draw: st.DrawFn, grid: Grid) -> Ordinals:
    """Ordinals of the grid: walks, noise, jumps to the ends, constants."""
    low = -1 - grid.limit if grid.signed_magnitude else -grid.limit
    rows = draw(st.integers(1, 40))
    made = []
    for _ in range(draw(st.integers(1, 4))):
        step = draw(st.sampled_from([0, 1, 7, 1000, 10**6, 10**12, grid.limit]))
        start = draw(st.integers(low, grid.limit))
        steps = draw(st.lists(st.integers(-step, step), min_size=rows, max_size=rows))
        at, column = start, []
        for change in steps:
            at = min(max(at + change, low), grid.limit)
            column.append(at)
        made.append(column)
    return np.array(made, np.int64).T.copy()
