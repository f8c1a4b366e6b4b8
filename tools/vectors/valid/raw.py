"""Valid: ``raw``: segments, widths, groups, signals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from tools.vectors.build.edits import Made, put, raw_stream
from tools.vectors.build.files import Vector, Whole, file_of, partial
from tools.vectors.build.motions import HUNDREDTHS, column, dance, numbers
from tools.vectors.valid.common import every_codec


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/raw")
    _segments(shelf)
    _widths(shelf)
    _groups(shelf)
    _two_signals(shelf)
    _own_channels(shelf)
    every_codec.no_channels(shelf, "raw")
    every_codec.add(shelf, "raw")
    return shelf.vectors


def _segments(shelf: Whole) -> None:
    motion, long = dance(), dance(8)
    parts = [((0, 4), (0,)), ((3, 4), (1, 0)), ((2, 2), (1,)), ((1, 2), (2,))]
    shelf.hold(
        "plain",
        "Codec 0: raw; DATA; CEND",
        "One segment, a group a joint.",
        file_of(motion),
        motion,
        parts=tuple(partial(motion, *part) for part in parts),
    )
    purpose = "A clip without a frame has no segment."
    shelf.hold("zero-frames", "DATA; CEND", purpose, file_of(dance(0)), dance(0))
    data = file_of(long, segment_frames=3)
    part = partial(long, (2, 7), (1,))
    shelf.hold("three-segments", "DATA", "Of 3, 3 and 2 frames.", data, long, parts=(part,))


def _widths(shelf: Whole) -> None:
    """Offsets of 0 to 8 bytes, more than our writer ever takes."""
    values = np.array([[-5 + c * r for c in range(9)] for r in range(3)], np.float64)
    names = tuple(Channel("", f"needle {c}") for c in range(9))
    bones = Skeleton((Joint("dials", channels=names),))
    motion = Motion(bones, (Signal(values, (Grid(GridKind.FIXED, 0),) * 9),), name="widths")
    columns = [[int(v) if v >= 0 else int(v) - 1 for v in column] for column in values.T]

    def edit(made: Made) -> Made:
        return [(made[0][0], [raw_stream(columns, range(9))])]

    purpose = "Offsets of every width from 0 to 8 bytes, wider than they need to be."
    shelf.hold("widths", "Codec 0: raw", purpose, file_of(motion, segments=edit), motion)
    wrapping = column([-1.0, 1.0, -2.0], Grid(GridKind.BINARY64))
    purpose = "Offsets beyond 2^63: the sum with the least ordinal wraps modulo 2^64."
    shelf.hold("wrapping", "Codec 0: raw", purpose, file_of(wrapping), wrapping)


def _groups(shelf: Whole) -> None:
    def merge(made: Made) -> Made:
        """Streams of single channels become those of 1, 4 and 1 channels."""
        ((header, streams),) = made
        return [(header, [b"".join(streams[a:b]) for a, b in ((0, 1), (1, 5), (5, 6))])]

    motion = dance()
    listed = put(payloads.Clip, "signals.0.groups", b"\3\3\1\4\1")
    cases: tuple[tuple[str, str, bytes], ...] = (
        ("all", "Groups of kind 0.", file_of(motion, grouping="all")),
        ("channel", "Groups of kind 2.", file_of(motion, grouping="channel")),
        (
            "listed",
            "Groups of kind 3: of 1, 4 and 1 channels, across joints.",
            file_of(motion, grouping="channel", CLIP=listed, segments=merge),
        ),
    )
    for name, purpose, data in cases:
        parts = (partial(motion, (1, 3), (1,)),)
        shelf.hold(f"groups-{name}", "CLIP", purpose, data, motion, parts=parts)


def _two_signals(shelf: Whole) -> None:
    samples = Signal(
        np.arange(24, dtype=np.int64).reshape(12, 2) * 1000 - 7,
        (Grid(GridKind.INTEGER),) * 2,
        name="analog",
        role="analog",
        samples_per_frame=3,
        channels=(Channel("", "emg", "V"), Channel("", "force", "N")),
    )
    motion = replace(dance(), signals=(*dance().signals, samples))

    def turns(made: Made) -> Made:
        def place(item: Any) -> tuple[int, int]:
            return item[0].first, -item[0].signal

        return sorted(made, key=place)

    data = file_of(motion, segment_frames=2, segments=turns)
    purpose = "Integers at 3 rows a frame beside the motion; their segments take turns."
    parts = (partial(motion, (1, 3)), partial(motion, (1, 3), (1,)))
    shelf.hold("two-signals", "CLIP; DATA; CEND", purpose, data, motion, parts=parts)


def _own_channels(shelf: Whole) -> None:
    own = tuple(Channel("", name, "V") for name in ("emg", "force", "light"))
    first = Signal(numbers(4, 3), (HUNDREDTHS,) * 3, channels=own)
    motion = dance(signals=(first,))
    purpose = "A motion with channels of its own, beside a skeleton that has others."
    data = file_of(motion, grouping="channel")
    shelf.hold(
        "own-channels", "CLIP; SKEL", purpose, data, motion, parts=(partial(motion, (1, 3)),)
    )
    again = Signal(numbers(8, 6)[::-1].copy(), (HUNDREDTHS,) * 6, "again", samples_per_frame=2)
    motion = dance(signals=(*dance().signals, again))
    data = file_of(motion, segment_frames=3)
    purpose = "A second signal with the skeleton's channels, in groups by joint."
    parts = (partial(motion, (1, 3)),)
    shelf.hold("skeleton-twice", "CLIP; SKEL", purpose, data, motion, parts=parts)
    motion = dance(signals=(first, replace(dance().signals[0], role="")))
    data = file_of(motion, grouping="channel")
    purpose = "A motion with channels of its own, and a signal with the skeleton's."
    shelf.hold("skeleton-second", "CLIP; SKEL", purpose, data, motion)
