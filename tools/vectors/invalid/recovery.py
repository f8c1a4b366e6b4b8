"""Invalid: RECV with other flags; files of valid/recovery with damage that a repairer mends."""

from __future__ import annotations

from collections.abc import Iterable

from mcz.container.chunks import KNOWN_FLAGS, ChunkType
from tools.vectors.build.files import Broken, Crafter, Vector, finished
from tools.vectors.build.motions import dance
from tools.vectors.valid import recovery as sound

HOLE = 20  # bytes


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/recovery")
    for name, flags in (
        ("critical", 0),
        ("safe-to-copy", KNOWN_FLAGS),
    ):
        crafter = Crafter()
        crafter.clip(dance())
        crafter.plain_chunk(ChunkType.RECV, b"", flags)
        data = finished(crafter, index=False)
        shelf.add(name, "Chunks; RECV", f"A RECV with flags {flags}.", data)
    _damaged(shelf)
    return shelf.vectors


def _damaged(shelf: Broken) -> None:
    """Each is repaired to the file of valid/recovery that its name begins with."""
    for vector in sound.vectors():
        name, data = vector.name.rpartition("/")[2], vector.data
        if name == "no-packets":
            continue
        at = data.index(b"CLIP")
        hole = data[:at] + bytes(HOLE) + data[at + HOLE :]
        cases = (
            ("hole", "RECV; Chunks", f"{HOLE} bytes are zeros", hole),
            ("tail", "RECV; FOOT", "the last 40 bytes are lost", data[:-40]),
            ("head", "RECV; Chunks", "the first 40 bytes are lost", data[40:]),
        )
        for kind, spec, damage, bad in cases:
            shelf.add(f"{name}-{kind}", spec, f"Of {name}.mcz {damage}.", bad)
