"""Valid: clips and skeletons that give back their source files."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector, Whole
from tools.vectors.valid.sources import (
    arrays,
    c3d,
    c3d_outputs,
    c3d_parts,
    layouts,
    lossy,
    lossy_steps,
    numbers,
    table_traps,
    tables,
    text,
)


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    text.add(shelf)
    numbers.add(shelf)
    layouts.add(shelf)
    lossy.add(shelf)
    lossy_steps.add(shelf)
    c3d.add(shelf)
    c3d_parts.add(shelf)
    c3d_outputs.add(shelf)
    tables.add(shelf)
    table_traps.add(shelf)
    arrays.add(shelf)
    return shelf.vectors
