"""Candidate ASF files for an AMC file, by name and folder."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_SEPARATORS = re.compile(r"[^0-9A-Za-z]")
_NUMBER = re.compile(r"[0-9]+$")

TAKE, SUBJECT, NUMBER = "the take", "the subject", "the take without its number"


@dataclass(frozen=True, slots=True)
class Candidate:
    """An ASF file that may be that of an AMC; ``name_of`` is whose name it has, "" of neither.

    Those of equal ``rank`` are equally near.
    """

    path: Path
    name_of: str
    rank: int


def skeletons_around(amc_path: str | Path) -> list[Candidate]:
    """The ASF files around an AMC file, those whose names fit it first, the best at the front.

    A name fits that is the stem of the AMC (``TAKE``), or that stem up to one of its separators,
    the longest first (``SUBJECT``: 14.asf for 14_02.amc); first beside it, then in a sibling folder
    ``asf``; after that the stem without the number at its end (``NUMBER``: walk.asf for
    walk2.amc). Case matters in stems, not in ``asf``.
    """
    path = Path(amc_path)
    beside = _skeletons(path.parent)
    siblings: list[Path] = []
    for folder in _folders(path.absolute().parent.parent):
        siblings += _skeletons(folder)
    candidates: dict[Path, Candidate] = {}
    exact, short = list(_stems(path.stem)), [(_NUMBER.sub("", path.stem), NUMBER)]
    places = [(n, f) for names in (exact, short) for f in (beside, siblings) for n in names]
    for rank, ((stem, name_of), files) in enumerate(places):
        for file in files:
            if stem and file.stem == stem:
                candidates.setdefault(file, Candidate(file, name_of, rank))
    others = (file for file in (*beside, *siblings) if file not in candidates)
    return [*candidates.values(), *(Candidate(file, "", len(places)) for file in others)]


def _stems(stem: str) -> Iterator[tuple[str, str]]:
    """The stem, then its parts before each separator, longest first; whose name each is."""
    yield stem, TAKE
    for match in reversed(list(_SEPARATORS.finditer(stem))):
        if match.start():
            yield stem[: match.start()], SUBJECT


def _skeletons(folder: Path) -> list[Path]:
    return sorted(p for p in _entries(folder) if p.suffix.lower() == ".asf" and p.is_file())


def _folders(folder: Path) -> list[Path]:
    return sorted(p for p in _entries(folder) if p.name.lower() == "asf" and p.is_dir())


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []
