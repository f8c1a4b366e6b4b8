"""Valid: ``mrdwt``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector
from tools.vectors.build.wavelet_clips import Waves
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.mrdwt import clips, streams


def vectors() -> Iterable[Vector]:
    shelf = Waves("valid/mrdwt")
    streams.add(shelf)
    clips.add(shelf)
    every_codec.add(shelf, "mrdwt")
    return shelf.vectors
