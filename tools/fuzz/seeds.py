"""Seeds of mutation: the vectors, and the source files that they restore."""

from __future__ import annotations

from collections.abc import Iterator
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
    for path in sorted((VECTORS / "valid").rglob("*.mcz")):
        for source, data in _restore_sources(path):
            if PurePosixPath(source).suffix.lower() == f".{name}" and len(data) <= LARGEST:
                found.setdefault(data, f"{path.parent.name}-{path.stem}")
    return {f"{where}-{n}.{name}": data for n, (data, where) in enumerate(found.items())}


def _restore_sources(path: Path) -> Iterator[tuple[str, bytes]]:
    with mcz.open(path.read_bytes()) as file:
        for source, restore in named_files(file):
            yield source, restore()
