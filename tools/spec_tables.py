"""Write the field tables of SPEC.md from the schemas, or check that they agree.

    python tools/spec_tables.py [--check]

A table follows a line ``<!-- table: NAME -->``; NAME is that of a construct Struct or of a tuple
of (name, type, meaning) rows in one of ``MODULES``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import construct

from mcz import numbers, schema
from mcz.container import payloads

MODULES = (
    "mcz.container.payloads",
    "mcz.container.segments",
    "mcz.container.packets",
    "mcz.container.directory",
    "mcz.codecs.raw",
    "mcz.codecs.lossless",
    "mcz.codecs._wavelet_codec",
    "mcz.codecs._wavelet_streams",
    "mcz.codecs.qbc",
    "mcz.codecs._qbc_streams",
    "mcz.codecs.pca",
    "mcz.codecs._pca_streams",
    "mcz.codecs._bases",
    "mcz.codecs._space",
    "mcz.codecs._prefix_streams",
    "mcz.codecs._windows",
    "mcz.codecs.lsdt_frame",
    "mcz.codecs._online_coder",
    "mcz.codecs._online_units",
    "mcz.formats.layout",
    "mcz.formats.notes",
    "mcz.formats.c3d_layout",
    "mcz.numbers",
)
NAMED = {
    id(schema.UVARINT): "varint",
    id(schema.SVARINT): "zigzag varint",
    id(schema.TEXT): "text",
    id(schema.SIZED): "sized",
    id(schema.FINITE): "binary64",
    id(payloads.ID): "id",
    id(numbers.GRID): "grid",
}
SPEC = Path(__file__).parent.parent / "SPEC.md"
MARK = re.compile(r"(<!-- table: (\S+) -->\n)((?:\|.*\n)*)")


def structures() -> dict[str, Any]:
    """Every structure that a table may show, by name; ``module.NAME`` where names collide."""
    found: dict[str, Any] = {}
    for module_name in MODULES:
        module = import_module(module_name)
        for name, thing in vars(module).items():
            if isinstance(thing, construct.Struct) or (name.endswith("FIELDS") and _is_rows(thing)):
                found.setdefault(name, thing)
                found[f"{module_name.removeprefix('mcz.')}.{name}"] = thing
    return found


def _is_rows(thing: Any) -> bool:
    return isinstance(thing, tuple) and all(isinstance(r, tuple) and len(r) == 3 for r in thing)


def rows(structure: Any) -> Iterator[tuple[str, str, str]]:
    """(name, type, meaning) of each field."""
    if isinstance(structure, tuple):
        yield from structure
        return
    for field in structure.subcons:
        yield field.name, type_name(field.subcon), field.docs


def type_name(subcon: Any) -> str:
    """How SPEC.md calls a type."""
    if id(subcon) in NAMED:
        return NAMED[id(subcon)]
    match subcon:
        case construct.Struct():
            names = {id(thing): name for name, thing in structures().items() if "." not in name}
            return names[id(subcon)]
        case construct.FocusedSeq():
            return _counted(subcon)
        case construct.Array():
            return f"{subcon.count} {type_name(subcon.subcon)}"
        case construct.Bytes():
            return f"{subcon.length} bytes"
        case construct.IfThenElse():
            return type_name(subcon.thensubcon) + ", or absent"
        case construct.FormatField():
            return {"B": "u8", "d": "binary64"}[subcon.fmtstr[-1]]
    if subcon is construct.GreedyBytes:
        return "bytes to the end"
    return type_name(subcon.subcon)


def _counted(subcon: Any) -> str:
    """construct's PrefixedArray: a Rebuild of the count, then an Array."""
    count, items = (renamed.subcon for renamed in subcon.subcons)
    word = "optional" if count.subcon is payloads.AT_MOST_ONE else "counted"
    return f"{word} {type_name(items.subcon)}"


def table(structure: Any) -> str:
    lines = ["| field | type | meaning |", "|---|---|---|"]
    lines += [f"| {name} | {kind} | {meaning} |" for name, kind, meaning in rows(structure)]
    return "\n".join(lines) + "\n"


def generated(text: str) -> str:
    """``text`` with every marked table made anew."""
    known = structures()
    return MARK.sub(lambda match: match[1] + table(known[match[2]]), text)


def main() -> int:
    text = SPEC.read_text()
    fresh = generated(text)
    if "--check" in sys.argv[1:]:
        if fresh != text:
            print("SPEC.md: a field table differs from its schema; run tools/spec_tables.py")
        return int(fresh != text)
    SPEC.write_text(fresh)
    return 0


if __name__ == "__main__":
    sys.exit(main())
