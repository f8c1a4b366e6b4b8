"""Clips of fast: groups, segments, notes, lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.motion import Channel, Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.build.fast_clips import HEADING, Coded, Head, Streams, codec_of
from tools.vectors.build.files import file_of, partial
from tools.vectors.build.lossless_clips import BINARY64, PLAIN, SIX, WHOLE, Constant, Copy
from tools.vectors.build.motions import (
    HUNDREDTHS,
    column,
    dance,
    numbers,
    panel,
    wave,
    with_exceptions,
    with_grid_changes,
    with_mask,
)


def add(shelf: Streams) -> None:
    _groups(shelf)
    _segments(shelf)
    _notes(shelf)
    _lengths(shelf)


def _groups(shelf: Streams) -> None:
    motion = dance(9)
    parts = (partial(motion, (1, 3), (1,)), partial(motion, (8, 9), (1, 0)))
    for grouping in ("joint", "all", "channel"):
        purpose = f"Groups by {grouping}: each has a state, words and bits of its own."
        spec = f"{HEADING}; CLIP"
        name = f"groups-{grouping}"
        shelf.code(name, purpose, motion, (), spec, grouping=grouping, parts=parts)
    values = np.column_stack([wave(12, seed) for seed in (0, 1, 2)])
    samples = Signal(
        np.round(values * 100).astype(np.int64),
        (WHOLE,) * 3,
        name="analog",
        role="analog",
        samples_per_frame=3,
        channels=tuple(Channel("", name, "V") for name in ("emg", "force", "moment")),
    )
    motion = replace(dance(4), signals=(*dance(4).signals, samples))
    part = {"parts": (partial(motion, (1, 3)),), "segment_frames": 3}
    purpose = "Integers at 3 rows a frame beside the motion; segments of 3 frames."
    shelf.code("two-signals", purpose, motion, **part)


def _segments(shelf: Streams) -> None:
    motion = dance(11)
    parts = (partial(motion, (3, 9), (1,)), partial(motion, (4, 4), (0,)))
    purpose = "Segments of 4, 4 and 3 frames: all channels start anew in each."
    shelf.code("segments", purpose, motion, segment_frames=4, parts=parts)
    a, b = wave(8, 1), wave(8, 2)
    motion = panel([a, [*b[:4], *a[4:]], [0.5] * 4 + b[4:]], (HUNDREDTHS,) * 3, (1, 1, 1))
    first: list[Head] = [Coded(taps=(32,)), Coded(form=PLAIN, drop=2), Constant()]
    second: list[Head] = [Copy(1, 0), Coded(from_last=0), Coded()]
    data = file_of(motion, codec=codec_of(first, second), segment_frames=4)
    parts = (partial(motion, (2, 6), (0,)), partial(motion, (5, 7), (2, 0)))
    purpose = "Heads differ from segment to segment: a copy in one is coded in the other."
    shelf.hold("segments-heads", HEADING, purpose, data, motion, parts=parts)


def _notes(shelf: Streams) -> None:
    spec = f"{HEADING}; Group notes"
    motion = with_exceptions()
    parts = (partial(motion, (1, 3), (1, 0)),)
    shelf.code("exceptions", "Exceptions beside coded channels.", motion, (), spec, parts=parts)
    motion = with_mask()
    heads: list[Head] = [*[Coded()] * 4, Copy(0, 3), Coded()]
    signal = motion.signals[0]
    values = signal.values.copy()
    values[:, 4] = values[:, 3]
    motion = replace(motion, signals=(replace(signal, values=values),))
    parts = (partial(motion, (1, 3), (1,)),)
    purpose = "A mask, also upon a copy: the mask of its own group counts."
    shelf.code("masks", purpose, motion, heads, f"{HEADING}; Masks", parts=parts)
    motion = with_grid_changes()
    parts = (partial(motion, (3, 6), (1,)),)
    for name, form, drop in (("classes", BINARY64, 0), ("plain", PLAIN, 19)):
        changed = [Coded(), Coded(form=form, drop=drop)]
        data = file_of(motion, codec=codec_of([], changed, []))
        purpose = f"A segment whose grid is TEXT64 instead of FIXED, its form said: {name}."
        shelf.hold(f"grid-change-{name}", spec, purpose, data, motion, parts=parts)


def _lengths(shelf: Streams) -> None:
    for n_frames in (0, 1, 2):
        purpose = f"A clip of {n_frames} frames."
        shelf.code(f"frames-{n_frames}", purpose, dance(n_frames))
    long = 70_000
    motion = panel([[-0.25] * long, [-0.25] * long], (HUNDREDTHS,) * 2, (1, 1))
    purpose = "More than 65,535 rows in one segment, constant and copied."
    parts = (partial(motion, (69_998, 70_000), (1,)),)
    shelf.code("long-constant", purpose, motion, [Constant(), Copy(0, 0)], parts=parts)
    ramp = [row / 100 for row in range(long)]
    purpose = "More than 65,535 coded rows, which a predictor hits."
    shelf.code("long-coded", purpose, column(ramp, HUNDREDTHS), [Coded(taps=(32,))])
    eight = [numbers(160, 8)[:, c].tolist() for c in range(8)]
    motion = panel(eight, (Grid(GridKind.FIXED, 2),) * 8)
    heads = [Coded(taps=(32,) * (c % 3), scale=10 * c) for c in range(8)]
    shelf.code("noise", "Eight channels of noise, one behind the other.", motion, heads)
    steps = [float(f"{row // 70 / 8:.6g}") for row in range(700)]
    purpose = "Long runs of one value in classes: the scale falls to 0."
    shelf.code("long-runs", purpose, column(steps, SIX), [Coded()])
