"""Recovery data, which a decoder skips; repairers find the damaged twins under invalid/recovery."""

from __future__ import annotations

from collections.abc import Iterable

from mcz.container.chunks import ChunkType
from tools.vectors.build.files import Crafter, Vector, Whole, file_of, finish_file
from tools.vectors.build.motions import dance
from tools.vectors.build.recovery import protect_file

TWO = dance(3, name="encore")


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/recovery")
    whole = file_of(dance(), TWO)
    purpose = "Recovery data of a whole file, INDX and FOOT with it."
    shelf.hold("protected", "RECV", purpose, protect_file(whole, 0.25), dance(), TWO)
    purpose = "Recovery data of a file without INDX."
    shelf.hold("no-index", "RECV", purpose, protect_file(file_of(TWO, index=False), 1.0), TWO)
    two = protect_file(file_of(dance()), 0.25, file_of(TWO))
    purpose = "Two RECV: the second is of what was appended."
    shelf.hold("appended", "RECV", purpose, two, dance(), TWO)
    crafter = Crafter()
    crafter.clip(dance())
    crafter.ancillary(ChunkType.RECV, b"no packets at all", safe_to_copy=False)
    purpose = "A RECV without a packet in it: nobody refuses a file for what a RECV says."
    shelf.hold("no-packets", "RECV; Chunks", purpose, finish_file(crafter), dance())
    return shelf.vectors
