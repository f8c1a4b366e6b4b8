"""Invalid, one fault each: codec 9, ``mdtt``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.build.spatial_clips import MDTT
from tools.vectors.invalid.common import every_codec, spatial


def vectors() -> Iterable[Vector]:
    shelf = Broken(f"invalid/{MDTT}")
    spatial.add(shelf, MDTT)
    spatial.add_once(shelf, MDTT)
    every_codec.add(shelf, MDTT)
    return shelf.vectors
