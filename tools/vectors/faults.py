"""What is wrong with each invalid vector, and what comes of a decoder that takes it: faults.txt."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tools.vectors.engine.tables import CHECKSUM, EFFECTS, KINDS
from tools.vectors.engine.tables import rows as table_rows

TABLE = Path(__file__).with_name("faults.txt")
MOST_CHECKSUMS = 3  # vectors in which nothing is wrong but a checksum, beside those of PARTS
PARTS = "invalid/parts/"  # is about checksums
SHARED = "*"  # the folder of rows that count in every folder of a codec
KIN = {
    "pca-rdo": "lsdt-clip",
    "fast": "lossless",
    "best": "lossless",
}
CODECS = tuple(
    "raw lossless mrdwt qbc pca lsdt-frame lsdt-clip pca-rdo online best posewave fast".split()
)


class Fault(NamedTuple):
    """``kind`` of fault, ``effect`` if accepted, ``names`` as globs, ``reason`` in a sentence."""

    kind: str
    effect: str
    names: tuple[str, ...]
    reason: str


@cache
def table() -> dict[str, list[Fault]]:
    """The rows of faults.txt by folder."""
    found: dict[str, list[Fault]] = {}
    folder = ""
    _, *blocks = TABLE.read_text("utf-8").strip().split("\n\n")
    for block in blocks:
        if block.startswith("["):
            folder = block.strip("[]")
            found[folder] = []
        elif folder:
            found[folder].append(_row(block))
    return found


def _row(block: str) -> Fault:
    head, *lines = block.split("\n")
    kind, _, effect = head.partition(", ")
    n_names = 1 + sum(line.startswith("  ") for line in lines)
    names = " ".join(lines[:n_names]).removeprefix("names: ").split()
    if kind not in KINDS or effect not in EFFECTS:
        raise ValueError(f"faults: {head!r}")
    return Fault(kind, effect, tuple(names), " ".join(lines[n_names:]))


def faults(names: Sequence[str]) -> dict[str, Fault]:
    """The fault of each of the invalid vectors ``names``.

    Raises ValueError for a vector without a row, for a glob that no vector needs, and for too many
    checksums.
    """
    found: dict[str, Fault] = {}
    unused = {(folder, g) for folder, rows in table().items() for row in rows for g in row.names}
    told = {name: row.fault for name, row in table_rows().items()}
    for name in names:
        own = told.get(name)
        if own is not None:
            found[name] = Fault(own.kind, own.effect, (), own.reason)
            continue
        _, folder, base = name.split("/")
        place = next(_places(folder, base), None)
        if place is None:
            raise ValueError(f"faults: nothing is said of {name}")
        found[name], used = place
        unused.discard(used)
    if unused:
        raise ValueError(f"faults: no vector needs {sorted(unused)}")
    checksums = [name for name in found if found[name].kind == CHECKSUM]
    if sum(not name.startswith(PARTS) for name in checksums) > MOST_CHECKSUMS:
        raise ValueError(f"faults: more than {MOST_CHECKSUMS} vectors of checksums alone")
    return found


def _places(folder: str, base: str) -> Iterator[tuple[Fault, tuple[str, str]]]:
    """The rows that name a vector, in order, each with the folder and glob that does."""
    shared = [KIN.get(folder, ""), SHARED] if folder in CODECS else []
    for place in (folder, *shared):
        for row in table().get(place, []):
            for glob in row.names:
                if fnmatchcase(base, glob):
                    yield row, (place, glob)
