"""Valid: preset ``dwt`` of wavelet, which is coded as mrdwt is."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector, Whole
from tools.vectors.valid.common import every_codec, wavelets


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/dwt")
    wavelets.add(shelf, "dwt")
    every_codec.add(shelf, "dwt")
    return shelf.vectors
