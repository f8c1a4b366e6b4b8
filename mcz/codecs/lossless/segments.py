"""What the codecs of ordinals share: segments of streams, each of one group, and copies in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Encoded, Layout, Recoding, SignalSource
from mcz.codecs.parameters import Parameter, integer
from mcz.codecs.segments import Sizing, guessing
from mcz.errors import FormatError
from mcz.numbers import Grid
from mcz.types import Params

Ints = NDArray[np.int64]

MAX_ROWS = 2**16

# (ordinals, grids in force and of the clip, the groups' channels, their numbers, copying) -> the
# streams of groups. ``copying``: a channel may repeat one before it.
Build = Callable[
    [Ints, Sequence[tuple[Grid, Grid]], Sequence[Sequence[int]], Sequence[int], bool], list[bytes]
]


def encode_groups(build: Build, sizing: Sizing, source: SignalSource, params: Params) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    prepare = partial(_prepare, build, source, range(len(source.layout.groups)), True)
    return Encoded(b"", guessing(source, params["segment_frames"], sizing, prepare))


def recode_groups(build: Build, asked: Recoding) -> Iterator[tuple[bytes, ...]]:
    """The streams of some groups with new values, without copies.

    What such a stream repeated, or who repeated it, need not be looked at then.
    """
    for span in asked.spans:
        yield _prepare(build, asked.source, asked.groups, False, span.first, span.stop)()


def _prepare(
    build: Build,
    source: SignalSource,
    groups: Sequence[int],
    copying: bool,
    start: int,
    stop: int,
) -> Callable[[], tuple[bytes, ...]]:
    """What makes the streams of some groups in a segment."""
    layout = source.layout
    grids = list(zip(source.grids(start), layout.grids, strict=True))
    channels = [layout.groups[group] for group in groups]
    ordinals = source.ordinals(start, stop)
    return lambda: tuple(build(ordinals, grids, channels, groups, copying))


def check_copy(name: str, layout: Layout, group: int, column: int) -> None:
    """Raise FormatError for a copy of a channel that there is not."""
    if not group < len(layout.groups) or not column < len(layout.groups[group]):  # LOSS-10
        raise FormatError(f"{name}: a copy of channel {column} of group {group}")


def segment_frames(size: str) -> Parameter:
    """The parameter of their length, where 0 means about ``size``."""
    return Parameter(
        "segment_frames",
        0,
        f"frames a segment; 0: as many as make about {size} bytes",
        integer("segment_frames", 0, MAX_ROWS),
    )
