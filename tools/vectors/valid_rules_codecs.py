"""Valid: rules of codecs that no other vector shows by itself."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.components import Parts, Plan, part_of
from tools.vectors.craft import Vector


def vectors() -> Iterable[Vector]:
    shelf = Parts("valid/pca")
    courses = [(f // 3 * 7, -(f // 4) * f) for f in range(24)]
    part = part_of(24, 3, 2, coefficients=courses, forms=(9, 73))
    purpose = "Coefficients that stay for some frames: what counts is where they moved last."
    shelf.hold_plan("stays", purpose, Plan((part,)))
    return shelf.vectors
