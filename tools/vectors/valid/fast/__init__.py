"""Valid: ``fast``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.fast_clips import Streams
from tools.vectors.build.files import Vector
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.fast import clips, streams


def vectors() -> Iterable[Vector]:
    shelf = Streams("valid/fast")
    streams.add(shelf)
    clips.add(shelf)
    every_codec.no_channels(shelf, "fast")
    every_codec.add(shelf, "fast")
    return shelf.vectors
