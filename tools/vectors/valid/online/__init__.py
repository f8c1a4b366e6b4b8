"""Valid: ``online``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector
from tools.vectors.build.online_clips import Groups
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.online import clips, streams


def vectors() -> Iterable[Vector]:
    shelf = Groups("valid/online")
    streams.add(shelf)
    clips.add(shelf)
    every_codec.add(shelf, "online")
    return shelf.vectors
