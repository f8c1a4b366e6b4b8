"""Invalid, one fault each: codec 6, ``awt``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.invalid.common import every_codec, wavelets


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/awt")
    wavelets.add(shelf, "awt")
    every_codec.add(shelf, "awt")
    return shelf.vectors
