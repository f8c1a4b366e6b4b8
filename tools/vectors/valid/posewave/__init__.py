"""Valid: ``posewave``."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors.build.files import Vector
from tools.vectors.build.pose_clips import Poses
from tools.vectors.valid.common import every_codec
from tools.vectors.valid.posewave import chains, clips, contacts, exact, whole


def vectors() -> Iterable[Vector]:
    shelf = Poses("valid/posewave")
    clips.add(shelf)
    whole.add(shelf)
    chains.add(shelf)
    contacts.add(shelf)
    exact.add(shelf)
    every_codec.add(shelf, "posewave")
    return shelf.vectors
