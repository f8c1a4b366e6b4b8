"""Valid: ``mdtt``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector
from tools.vectors.build.spatial_clips import MDTT, PCA_RDO, Spaces
from tools.vectors.valid.common import every_codec, spatial


def vectors() -> Iterable[Vector]:
    shelf = Spaces(MDTT)
    spatial.add(shelf)
    spatial.add_own_vectors(shelf)
    spatial.add_longer(shelf)
    spatial.add_ends(shelf, PCA_RDO)
    every_codec.add(shelf, MDTT)
    return shelf.vectors
