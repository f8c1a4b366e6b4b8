"""The length of segments, as a parameter of the lossless codecs."""

from __future__ import annotations

from mcz.codecs.parameters import Parameter, integer


def segment_frames(size: str, most: int) -> Parameter:
    """The parameter of their length, at most ``most`` frames; 0 means about ``size`` bytes."""
    return Parameter(
        "segment_frames",
        0,
        f"frames a segment; 0: as many as make about {size} bytes",
        integer("segment_frames", 0, most),
    )
