"""Invalid, one fault each: ``online``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.invalid.common import every_codec
from tools.vectors.invalid.online import headers, streams, units


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/online")
    headers.add(shelf)
    units.add(shelf)
    streams.add(shelf)
    every_codec.add(shelf, "online")
    return shelf.vectors
