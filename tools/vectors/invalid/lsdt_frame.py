"""Invalid, one fault each: ``lsdt-frame``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.build.spatial_clips import FRAME
from tools.vectors.invalid.common import every_codec, lsdt, lsdt_streams, spatial


def vectors() -> Iterable[Vector]:
    shelf = Broken(f"invalid/{FRAME}")
    spatial.add(shelf, FRAME)
    lsdt.add(shelf, FRAME)
    lsdt_streams.add(shelf, FRAME)
    every_codec.add(shelf, FRAME)
    return shelf.vectors
