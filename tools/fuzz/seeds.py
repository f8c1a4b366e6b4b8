"""Seeds of mutation: the vectors, and the source files that they restore."""

from __future__ import annotations

from functools import cache
from pathlib import Path, PurePosixPath

import mcz
from mcz.files.editing.unpacking import named_files

VECTORS = Path(__file__).parents[2] / "conformance" / "vectors"
LARGEST = 16 * 1024  # bytes of a seed


def vectors(*folders: str) -> dict[str, bytes]:
    """The vectors in folders of these names, all without any; the large ones are left out."""
    found: dict[str, bytes] = {}
    for path in sorted(VECTORS.rglob("*.mcz")):
        name = path.relative_to(VECTORS).as_posix()
        wanted = not folders or any(part in folders for part in path.parts[:-1])
        if wanted and path.stat().st_size <= LARGEST:
            found[name.replace("/", "-")] = path.read_bytes()
    return found


def sources(name: str) -> dict[str, bytes]:
    """The source files with the suffix ``name`` that valid vectors restore, each once."""
    found: dict[bytes, str] = {}
    for vector, source, data in _restore_sources():
        if PurePosixPath(source).suffix.lower() == f".{name}":
            found.setdefault(data, vector)
    return {f"{vector}-{n}.{name}": data for n, (data, vector) in enumerate(found.items())}


@cache
def _restore_sources() -> list[tuple[str, str, bytes]]:
    """The small source files of all valid vectors: the vector, the path, the bytes."""
    restored: list[tuple[str, str, bytes]] = []
    for path in sorted((VECTORS / "valid").rglob("*.mcz")):
        with mcz.open(path.read_bytes()) as file:
            for source, restore in named_files(file):
                if len(data := restore()) <= LARGEST:
                    restored.append((f"{path.parent.name}-{path.stem}", source, data))
    return restored
