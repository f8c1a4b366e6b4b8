"""Write conformance/annex/registry.json from the tables of SPEC.md, or check that they agree.

    python tools/registry.py [--check]

SPEC.md is normative; pages of the manual define metrics and keys of quality records. The file is
for programs that would rather not parse them.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
SPEC = ROOT / "SPEC.md"
MEASURES = (ROOT / "docs/reference/measures.md", ROOT / "docs/guides/contacts.md")
PARTS = ROOT / "docs/guides/parts.md"
REGISTRY = ROOT / "conformance" / "annex" / "registry.json"
Rows = list[list[str]]


def rows_after(text: str, mark: str) -> Rows:
    """The cells of the first table after ``mark``, which is in ``text`` once, without its head."""
    _, found, rest = text.partition(mark)
    table = re.search(r"(?:^\|.*\n)+", rest, re.M)
    if not found or table is None:
        raise ValueError(f"no table after {mark!r}")
    lines = table[0].splitlines()[2:]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines]


def registry(text: str) -> dict[str, Any]:
    """Content of the registry file, from SPEC.md's ``text``."""
    text = re.sub(r" \[[A-Z0-9]+-\d\d\]", "", text)  # ids of requirements
    version = re.search(r"^Version (\d+\.\d+)", text, re.M)
    assert version is not None
    limits = rows_after(text, "## Limits and profiles\n")
    limits += [row for row in rows_after(text, "by profile:\n") if row[2] != "any"]
    parts = PARTS.read_text("utf-8")
    return {
        "format_version": version[1],
        "identification": _rows_by_column(
            rows_after(text, "**Identification**"), "what", "value", "meaning"
        ),
        "chunk_types": _rows_by_column(
            rows_after(text, "**Chunk types.**"), "type", "flags", "meaning"
        ),
        "profiles": [
            {"id": id_, "name": name, "limits": {row[0]: _number(row[at]) for row in limits}}
            for id_, name, at in ((0, "base", 2), (1, "large", 3), (2, "small", 1))
        ],
        "codecs": _rows_by_column(
            rows_after(text, "## Codecs\n"),
            *("id", "name", "version", "decodes", "groups", "resolutions", "presets"),
        ),
        "presets": [
            {"codec": int(row[0]), "id": id_, "preset": name}
            for row in rows_after(text, "## Codecs\n")
            for id_, name in enumerate(filter(None, row[6].split(", ")), 1)
        ],
        "point_sets": _rows_by_column(rows_after(text, "**Points.**"), "id", "of", "points"),
        "source_formats": _rows_by_column(
            rows_after(text, "## Source reconstruction\n"),
            *("name", "id", "suffixes", "template", "detail", "frame_notes", "restored_from"),
        ),
        "roles": _rows_by_column(rows_after(text, "**Roles of signals**"), "id", "name", "meaning"),
        "channel_kinds": list(_kinds(rows_after(text, "**Channel kinds**"))),
        "metadata_keys": _rows_by_column(
            rows_after(text, "**Metadata keys**"), "key", "value", "type", "dublin_core", "others"
        ),
        "cut_keys": _rows_by_column(rows_after(parts, "## Keys of cuts\n"), "key", "value"),
        "edit_keys": _rows_by_column(
            rows_after(parts, "## Keys of replaced joints\n"), "key", "value"
        ),
        "metrics": [
            {"id": name, "unit": unit, "meaning": meaning}
            for page, heading in zip(MEASURES, ("## Metrics\n", "# Contacts\n"), strict=True)
            for names, unit, meaning in rows_after(page.read_text("utf-8"), heading)
            for name in names.split(", ")
        ],
        "bases": _rows_by_column(
            rows_after(text, "Some models are well known."), "name", "annex", "id", "meaning"
        ),
        "wavelets": _rows_by_column(rows_after(text, "## Wavelets\n"), "id", "name", "taps"),
        "annexes": _rows_by_column(rows_after(text, "**Annexes**"), "file", "sha256", "meaning"),
    }


def _rows_by_column(rows: Rows, *names: str) -> list[dict[str, Any]]:
    """Each row by the names of its columns; whole numbers as such."""
    return [
        {name: int(cell) if cell.isdigit() else cell for name, cell in zip(names, row, strict=True)}
        for row in rows
    ]


def _kinds(rows: Rows) -> Iterator[dict[str, Any]]:
    """A row of its own for each of several ids in one."""
    for ids, names, meaning in rows:
        numbers = [int(id_) for id_ in ids.split(", ")]
        for number, name in zip(numbers, names.split() or [""], strict=True):
            yield {"id": number, "name": name, "meaning": meaning}


def _number(text: str) -> int:
    """Bytes or a count, as the table of limits prints it."""
    text = text.replace(",", "")
    if "^" in text:
        return 2 ** int(text.split("^")[1])
    value, _, unit = text.partition(" ")
    return int(value) * {"": 1, "KiB": 2**10, "MiB": 2**20}[unit]


def document() -> str:
    """The text of the file."""
    made = registry(SPEC.read_text("utf-8"))
    return json.dumps(made, indent=1, ensure_ascii=False) + "\n"


def main() -> int:
    made = document()
    same = REGISTRY.is_file() and REGISTRY.read_text("utf-8") == made
    if "--check" in sys.argv[1:]:
        return int(not same)
    REGISTRY.write_text(made, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
