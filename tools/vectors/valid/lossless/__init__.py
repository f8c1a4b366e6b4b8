"""Valid: ``lossless``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector
from tools.vectors.build.lossless_clips import Streams
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.lossless import clips, counts, streams


def vectors() -> Iterable[Vector]:
    shelf = Streams("valid/lossless")
    streams.add(shelf)
    counts.add(shelf)
    clips.add(shelf)
    every_codec.no_channels(shelf, "lossless")
    every_codec.add(shelf, "lossless")
    return shelf.vectors
