"""Requirements of SPEC.md that each vector shows, by ids such as CHUNK-07.

The manifest's ``requirements`` are made of requirements.txt, the vectors that a decoder without the
rule fails (``tests.broken`` has such decoders), and of ``VECTORS``, what else shows it; ``ARGUED``
says of the rules that no vector can show why that is so.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import filter as matching
from pathlib import Path

from tools.vectors import (
    requirements_codecs,
    requirements_container,
    requirements_points,
    requirements_poses,
)
from tools.vectors.engine.tables import rows as table_rows

CAUGHT = Path(__file__).with_suffix(".txt")

# Globs of vector names without their suffix, "valid/*/frames-1"; * stands for / as well.
VECTORS: dict[str, tuple[str, ...]] = {
    **requirements_container.VECTORS,
    **requirements_codecs.VECTORS,
    **requirements_points.VECTORS,
    **requirements_poses.VECTORS,
}

ARGUED: dict[str, str] = {
    **requirements_container.ARGUED,
    **requirements_codecs.ARGUED,
    **requirements_points.ARGUED,
    **requirements_poses.ARGUED,
}

ID = re.compile(r"[A-Z][A-Z0-9]*(?:-[A-Z0-9]+)*-[0-9]{2,}")


def read_catches() -> dict[str, list[str]]:
    """The vectors that a decoder without a rule fails, by the rule."""
    lines = CAUGHT.read_text("utf-8").partition("\n\n")[2].splitlines()
    found = {id_: names.split() for id_, names in (line.split(": ") for line in lines)}
    for row in table_rows().values():
        for id_ in row.rules:
            found.setdefault(id_, []).append(row.name)
    return found


def requirements(names: Iterable[str]) -> dict[str, list[str]]:
    """The ids, sorted, that each of the vectors ``names`` shows.

    Those in tables say it themselves. Raises ValueError for an id that is none, or is both shown
    and argued, and for a glob that matches no vector.
    """
    found: dict[str, list[str]] = {name: [] for name in names}
    told = {name: row.requirements for name, row in table_rows().items() if name in found}
    table = {id_: list(globs) for id_, globs in VECTORS.items()}
    for id_, shown in read_catches().items():
        table.setdefault(id_, []).extend(name for name in shown if name not in told)
    for id_ in sorted({*table, *ARGUED}.union(*told.values())):
        shown = any(id_ in ids for ids in told.values())
        if not ID.fullmatch(id_) or ((id_ in table or shown) and id_ in ARGUED):
            raise ValueError(f"requirements: {id_!r} is no id, or is both shown and argued")
    for id_, globs in sorted(table.items()):
        matched = [[glob] if glob in found else matching(found, glob) for glob in globs]
        if not all(matched) or not (globs or any(id_ in ids for ids in told.values())):
            raise ValueError(f"requirements: a glob of {id_} matches no vector: {globs}")
        for name in sorted({name for part in matched for name in part}):
            if name not in told:
                found[name].append(id_)
    return found | told
