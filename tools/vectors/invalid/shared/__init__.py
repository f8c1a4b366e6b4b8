"""Invalid, one fault each: SKEL, SRCE, MODL, ATTA, ALIA."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Broken, Vector
from tools.vectors.invalid.shared import attachments, deflate, skeletons


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/shared")
    skeletons.add(shelf)
    attachments.add(shelf)
    deflate.add(shelf)
    return shelf.vectors
