"""Legal files of codecs 8 to 10 for rules that no other vector shows by itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from tools.vectors.craft import Vector
from tools.vectors.spatial import CLIP, MDTT, PCA_RDO, Plan, Spaces, basis_of, noise
from tools.vectors.valid_lsdt_windows import UNLIKE

SEGMENTS = (12, 16, 9, 8)  # windows of 8 and 4, 8 and 8, 8 and 1, 8 frames
REQUESTS = ((10, 20), (27, 38), (36, 45))


def vectors() -> Iterable[Vector]:
    shelves = [Spaces(name) for name in (CLIP, MDTT, PCA_RDO)]
    for shelf in shelves:
        _longer(shelf)
    _courses(shelves[-1])
    return [vector for shelf in shelves for vector in shelf.vectors]


def _longer(shelf: Spaces) -> None:
    """Matrices of windows that are longer than the one before, of which nothing is left."""
    plan = Plan(n_channels=9, segments=SEGMENTS, apart=True)
    cases = {
        "longer": ("", plan),
        "longer-full": (", no coefficient 0", replace(plan, fill=noise)),
        "longer-few": (", 5 of 8 frequencies", replace(plan, frequencies=5, bases=UNLIKE)),
    }
    for name, (how, made) in cases.items():
        purpose = f"Three matrices, windows of 8, 4, 8, 8, 8, 1 and 8 frames{how}."
        shelf.plan(name, purpose, made, REQUESTS)


def _courses(shelf: Spaces) -> None:
    """Windows with cosines between others with courses."""
    plan = Plan(
        n_channels=9,
        segments=SEGMENTS,
        frequencies=5,
        apart=True,
        courses=basis_of(8, 5, 3),
        mean=basis_of(9, 1, 5, shifts=[3]),
    )
    purpose = "Courses and a mean, three matrices, windows of 8, 4, 8, 8, 8, 1 and 8 frames."
    shelf.plan("courses-longer", purpose, plan, REQUESTS)
    one = replace(plan, segments=(7, 8, 3, 8), apart=False, fill=noise)
    purpose = "Courses and a mean, one matrix, windows of 7, 8, 3 and 8 frames."
    shelf.plan("courses-between", purpose, one, [(5, 10), (15, 20)])
