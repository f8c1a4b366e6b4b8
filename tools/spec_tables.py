"""Write what a program makes of SPEC.md, or check it: field tables, contents, traced streams.

    python tools/spec_tables.py [--check]

A table follows a line ``<!-- table: NAME -->``; NAME is that of a record, ``JointFields`` or
``Joint`` being JOINT, or of a tuple of (name, type, meaning) rows that a loop reads by, in one of
``MODULES``. Structures that are read
by hand have tables without such a line. The contents list the headings behind them.
The lines of traced streams are those of ``tools/spec_traces``.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import construct

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # so that it runs as a script

from mcz.container import payloads
from mcz.model import numbers, schema
from mcz.model.schema import types
from mcz.model.schema.columns import Columns
from mcz.model.schema.records import RecordType
from tools.spec_traces import best, fast, posewave

MODULES = (
    "mcz.container.payloads",
    "mcz.container.directory",
    "mcz.container.segments",
    "mcz.container.encodings",
    "mcz.container.metadata",
    "mcz.container.encodings",
    "mcz.codecs.wavelet.wavelet",
    "mcz.codecs.curves.qbc",
    "mcz.codecs.pca.pca",
    "mcz.codecs.space",
    "mcz.codecs.coding.prefix_codes",
    "mcz.codecs.spatial.windows",
    "mcz.codecs.spatial.lsdt_frame",
    "mcz.codecs.online.coder",
    "mcz.codecs.posewave.header",
    "mcz.codecs.posewave.contact_plan",
    "mcz.sources.text.layout",
    "mcz.sources.tables.layout",
    "mcz.sources.arrays.layout",
    "mcz.sources.arrays.deflate",
    "mcz.sources.text.source",
    "mcz.sources.c3d.layout",
    "mcz.container.recovery",
    "mcz.model.numbers",
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
NUMBERS = {"B": "u8", "L": "u32", "Q": "u64", "f": "binary32", "d": "binary64"}
SPEC = Path(__file__).parent.parent / "SPEC.md"
MARK = re.compile(r"(<!-- table: (\S+) -->\n)((?:\|.*\n)*)")
CONTENTS = re.compile(r"(<!-- contents -->\n)(.*?)(<!-- end of contents -->\n)(.*)", re.DOTALL)
TRACE = re.compile(r"(<!-- trace (\w+) -->\n```\n).*?(```\n)", re.DOTALL)
TRACES = {"best": best.trace_bits, "fast": fast.trace, "posewave": posewave.trace}
HEADING = re.compile(r"^(##?) (.+)$", re.MULTILINE)


def structures() -> dict[str, Any]:
    """Every structure that a table may show, by name; ``module.NAME`` where names collide."""
    found: dict[str, Any] = {}
    for module_name in MODULES:
        module = import_module(module_name)
        for name, thing in vars(module).items():
            if is_record(thing) and thing.__module__.startswith(module_name):
                name = table_name(thing)
            elif not (name.endswith("FIELDS") and _is_rows(thing)):
                continue
            found.setdefault(name, thing)
            found[f"{module_name.removeprefix('mcz.')}.{name}"] = thing
    return found


def table_name(record: type[schema.Record]) -> str:
    """The name of a record in SPEC.md."""
    name = record.__name__.removesuffix("Fields")
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).upper()


def is_record(thing: Any) -> bool:
    is_class = isinstance(thing, type) and issubclass(thing, schema.Record)
    return is_class and thing is not schema.Record


def _is_rows(thing: Any) -> bool:
    return isinstance(thing, tuple) and all(isinstance(r, tuple) and len(r) == 3 for r in thing)


def rows(structure: Any) -> Iterator[tuple[str, str, str]]:
    """(name, type, meaning) of each field."""
    if isinstance(structure, tuple):
        yield from structure
        return
    for field in dataclasses.fields(structure):
        yield field.name, type_name(field.metadata["construct"]), field.metadata["docs"]


def type_name(field: Any) -> str:
    """Name of a type in SPEC.md."""
    if id(field) in NAMED:
        return NAMED[id(field)]
    if is_record(field):
        return table_name(field)
    match field:
        case RecordType():
            return table_name(field.record)
        case types.Optional():
            return f"optional {type_name(field.subcon.subcon)}"
        case Columns():
            return f"columns {type_name(field.subcon)}"
        case types.Counted():
            return f"counted {type_name(field.subcon)}"
        case construct.Array():
            return f"{field.count} {type_name(field.subcon)}"
        case construct.Bytes():
            return "bytes" if callable(field.length) else f"{field.length} bytes"
        case construct.IfThenElse():
            return type_name(field.thensubcon) + ", or absent"
        case construct.FormatField():
            return {"B": "u8", "L": "u32", "Q": "u64", "f": "binary32", "d": "binary64"}[
                field.fmtstr[-1]
            ]
    return "bytes to the end" if field is construct.GreedyBytes else type_name(field.subcon)


def table(structure: Any) -> str:
    lines = ["| field | type | meaning |", "|---|---|---|"]
    lines += [f"| {name} | {kind} | {meaning} |" for name, kind, meaning in rows(structure)]
    return "\n".join(lines) + "\n"


def contents(text: str) -> str:
    """Links to the parts of ``text``, each with a paragraph of links to its sections."""
    blocks: list[list[str]] = [[]]
    for marks, heading in HEADING.findall(re.sub(r"(?ms)^```.*?^```$", "", text)):
        link = f"[{heading}](#{anchor(heading)})"
        if len(marks) == 1:
            blocks += [[f"**{link}**"], []]
        else:
            blocks[-1].append(link)
    return "\n".join("\n" + _wrap_links(block) for block in blocks if block).strip() + "\n"


def _wrap_links(links: list[str]) -> str:
    """The links as a paragraph; none is broken over two lines."""
    lines = [""]
    for link in links:
        if lines[-1] and len(lines[-1]) + len(link) > 105:
            lines.append("")
        lines[-1] += f"{' · ' if lines[-1] else ''}{link}"
    return " ·\n".join(lines)


def anchor(heading: str) -> str:
    """Anchor of a heading, as GitHub and most others form it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def generate(text: str) -> str:
    """``text`` with every marked table, the traced streams and the contents made anew."""
    known = structures()
    text = MARK.sub(lambda match: match[1] + table(known[match[2]]), text)
    text = TRACE.sub(lambda match: match[1] + TRACES[match[2]]() + match[3], text)
    return CONTENTS.sub(lambda match: f"{match[1]}{contents(match[4])}{match[3]}{match[4]}", text)


def main() -> int:
    text = SPEC.read_text()
    fresh = generate(text)
    if "--check" in sys.argv[1:]:
        if fresh != text:
            print("SPEC.md: a table, the contents or a trace is old; run tools/spec_tables.py")
        return int(fresh != text)
    SPEC.write_text(fresh)
    return 0


if __name__ == "__main__":
    sys.exit(main())
