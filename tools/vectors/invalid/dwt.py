"""Invalid, one fault each: codec 5, ``dwt``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.invalid.common import every_codec, wavelets


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/dwt")
    wavelets.add(shelf, "dwt")
    every_codec.add(shelf, "dwt")
    return shelf.vectors
