"""Which ASF file belongs to an AMC file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from mcz.errors import SourceError

_SEPARATORS = re.compile(r"[^0-9A-Za-z]")


def find_asf(amc_path: str | Path) -> Path | None:
    """The skeleton of an AMC file, or None.

    Looked for in this order: an ASF of the same stem beside it; one whose stem is the AMC's up to
    one of its separators (14.asf for 14_02.amc), the longest first; the same two in a sibling
    folder ``asf``; the only ASF beside it. Case matters in stems, not in ``asf``. Raises
    SourceError where two files are equally good, naming them.
    """
    path = Path(amc_path)
    beside = _skeletons(path.parent)
    siblings: list[Path] = []
    for folder in _folders(path.absolute().parent.parent):
        siblings += _skeletons(folder)
    for files in (beside, siblings):
        for stem in _stems(path.stem):
            found = [file for file in files if file.stem == stem]
            if found:
                return _only(path, found)
    return _only(path, beside) if beside else None


def _only(path: Path, found: list[Path]) -> Path:
    if len(found) > 1:
        names = ", ".join(str(file) for file in found)
        raise SourceError(f"{path.name}: {len(found)} skeletons are equally near: {names}")
    return found[0]


def _stems(stem: str) -> Iterator[str]:
    """The stem, then its parts before each separator, longest first."""
    yield stem
    for match in reversed(list(_SEPARATORS.finditer(stem))):
        if match.start():
            yield stem[: match.start()]


def _skeletons(folder: Path) -> list[Path]:
    return sorted(p for p in _entries(folder) if p.suffix.lower() == ".asf" and p.is_file())


def _folders(folder: Path) -> list[Path]:
    return sorted(p for p in _entries(folder) if p.name.lower() == "asf" and p.is_dir())


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []
