"""Invalid, one fault each: what restores source files. All are asked for sources.

Where a reader can overlook the fault, what it then restores has the size and the hash that are
stated.
"""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Unrestorable, Vector
from tools.vectors.invalid.sources import arrays, c3d, c3d_outputs, files, notes, tables, templates


def vectors() -> Iterable[Vector]:
    shelf = Unrestorable("invalid/sources")
    files.add(shelf)
    templates.add(shelf)
    notes.add(shelf)
    c3d.add(shelf)
    c3d_outputs.add(shelf)
    tables.add(shelf)
    arrays.add(shelf)
    return shelf.vectors
