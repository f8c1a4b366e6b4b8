"""Rows of segments and copies in streams, for all lossless codecs."""

from __future__ import annotations

from mcz.codecs.contract import Layout
from mcz.codecs.parameters import Parameter, integer
from mcz.errors import FormatError

MAX_ROWS = 2**16


def check_copy(name: str, layout: Layout, group: int, column: int) -> None:
    """Raise FormatError for a copy of a channel that there is not."""
    if not group < len(layout.groups) or not column < len(layout.groups[group]):  # LOSS-10
        raise FormatError(f"{name}: a copy of channel {column} of group {group}")


def segment_frames(size: str, most: int = MAX_ROWS) -> Parameter:
    """The parameter of their length, where 0 means about ``size``."""
    return Parameter(
        "segment_frames",
        0,
        f"frames a segment; 0: as many as make about {size} bytes",
        integer("segment_frames", 0, most),
    )
