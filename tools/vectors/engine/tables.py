"""Tables of vectors: TOML files whose rows say all that there is of a vector. README.md."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mcz.cli.conformance import answer
from mcz.container.limits import FORMAT_NAME
from tools.vectors.bases import Base, base_bytes, base_of
from tools.vectors.build.files import OK, REFUSED, Vector, arrays, partial
from tools.vectors.engine.coded import CLIP_KEYS, coded_file
from tools.vectors.engine.edits import edit_file

FOLDER = Path(__file__).parent.parent / "tables"
HEAD = {"folder", "spec", "base", "file", "rules", "also", "modes", "exit", "edit"} | CLIP_KEYS
ROW = {"purpose", "spec", "rules", "also", "fault", "base", "file", "edit"} | CLIP_KEYS | {
    "exit", "modes", "parts", "holds", "since", "clips", "crafted",
}  # fmt: skip
Arrays = tuple[tuple[dict[str, Any], bytes], ...]
DECODED = "decoded"  # what a file holds whose row says it with edits
KINDS = MALFORMED, IMPOSSIBLE, CHECKSUM = "malformed", "impossible", "checksum"
PARTS, MOST_CHECKSUMS = "invalid/parts/", 3  # a folder about checksums; vectors beside it
EFFECTS = ("crash", "memory", "hang", "wrong data", "silent loss")


@dataclass(frozen=True)
class Fault:
    """``kind`` of fault, ``effect`` if accepted, ``reason`` in a sentence."""

    kind: str
    effect: str
    reason: str

    @classmethod
    def of(cls, text: str) -> Fault:
        """The fault of ``kind, effect: reason``."""
        head, _, reason = text.partition(": ")
        kind, _, effect = head.partition(", ")
        if kind not in KINDS or effect not in EFFECTS or not reason:
            raise ValueError(f"{text!r} is no fault")
        return cls(kind, effect, reason)


@dataclass(frozen=True)
class Row:
    """A vector as a table describes it: ``name`` is its path, ``fields`` its own and the head's."""

    name: str
    fields: Mapping[str, Any]
    constants: Mapping[str, str]
    fault: Fault | None

    @property
    def rules(self) -> list[str]:
        """The rules without which a decoder fails the vector."""
        return str(self.fields.get("rules", "")).split()

    @property
    def requirements(self) -> list[str]:
        """Them, and the other rules that it shows."""
        return sorted({*self.rules, *str(self.fields.get("also", "")).split()})

    @property
    def data(self) -> bytes:
        edits = self.fields.get("edit", [])
        edits = [edits] if isinstance(edits, str) else edits
        return edit_file(self._base(), edits, self.constants)

    def _base(self) -> bytes:
        fields, options = self.fields, self.fields.get("file", {})
        if not self.has_segments:
            return base_bytes(fields["base"], options)
        clips = [{**fields, **own} for own in fields.get("clips", [{}])]
        motions = [base_of(clip["base"]).motions[0] for clip in clips]
        return coded_file(list(zip(motions, clips, strict=True)), self.constants, **options)

    @property
    def has_segments(self) -> bool:
        """True where the row writes segments out: it holds what mcz decodes.

        The row's hashes and the other decoder vouch for that.
        """
        return bool({"segments", "clips"} & set(self.fields))

    def vector(self) -> Vector:
        """The file, and what a decoder must make of it."""
        fields = self.fields
        group = self.name.partition("/")[0]
        exit_ = fields.get("exit", REFUSED if group == "invalid" else OK)
        exit_ = tuple(exit_) if isinstance(exit_, list) else (exit_,)
        data, modes = self.data, tuple(fields.get("modes", "arrays").split())
        content, listed = Base(), ()
        if OK in exit_ and (self.has_segments or fields.get("holds") == DECODED):
            listed = _decode_arrays(data)
            restored = _decode_arrays(data, "--source") if "sources" in modes else ()
            content = Base(sources=tuple((row["path"], content) for row, content in restored))
        elif OK in exit_:
            content = base_of(fields.get("holds", fields["base"]))
            listed = arrays(*content.motions)
        return Vector(
            self.name,
            tuple(heading.strip() for heading in fields["spec"].split(";")),
            fields["purpose"],
            data,
            exit=exit_,
            arrays=listed,
            sources=content.sources if "sources" in modes else (),
            modes=modes,
            parts=tuple(
                _part(data, content, text) if OK in exit_ else (tuple(text.split()), ())
                for text in fields.get("parts", ())
            ),
            since=fields.get("since", FORMAT_NAME),
            is_crafted=bool(fields.get("crafted")),
        )


def _decode_arrays(data: bytes, *arguments: str) -> Arrays:
    """The arrays of a file or of a part of it, or its sources, as mcz decodes them."""
    _, output = answer(data, arguments)
    line, _, content = output.partition(b"\n")
    arrays = []
    for row in next(iter(json.loads(line).values())):
        size = row.pop("bytes")
        arrays.append((row, content[:size]))
        content = content[size:]
    return tuple(arrays)


def _part(data: bytes, content: Base, text: str) -> Any:
    """A partial read: ``dance 1:3`` or ``dance 1:3 0,2``, clip, frames, joints, or arguments."""
    if text.startswith("--"):
        return tuple(text.split()), _decode_arrays(data, *text.split())
    clip, frames, *joints = text.rsplit(" ", text.count(" "))
    (motion,) = (motion for motion in content.motions if motion.name == clip)
    start, _, stop = frames.partition(":")
    listed = [int(joint) for joint in joints[0].split(",")] if joints else None
    return partial(motion, (int(start), int(stop)), listed)


def rows_of(path: Path) -> Iterator[Row]:
    """The rows of one table; raises ValueError for what no table has."""
    document = tomllib.loads(path.read_text("utf-8"))
    head, constants = document.pop("TABLE"), document.pop("BYTES", {})
    bases = document.pop("BASES", {})
    faults = {key: Fault.of(text) for key, text in document.pop("FAULTS", {}).items()}
    if set(head) - HEAD:
        raise ValueError(f"{path.name}: TABLE has no {sorted(set(head) - HEAD)}")
    folders = head["folder"]
    for folder in [folders] if isinstance(folders, str) else folders:
        used = set()
        for name, row in document.items():
            unknown = sorted(set(row) - ROW)
            if unknown or ("fault" in row) != folder.startswith("invalid/"):
                raise ValueError(f"{path.name}: {name}: {unknown or 'fault'}")
            fields = _fill_fields({**head, **row}, folder.rpartition("/")[2])
            fields["base"] = bases.get(fields["base"], fields["base"])
            fields["also"] = f"{head.get('also', '')} {row.get('also', '')}"
            used.add(row.get("fault"))
            fault = faults[row["fault"]] if "fault" in row else None
            yield Row(f"{folder}/{name}", fields, constants, fault)
        if set(faults) - used:
            raise ValueError(f"{path.name}: no row has the faults {sorted(set(faults) - used)}")


def _fill_fields(fields: dict[str, Any], codec: str) -> dict[str, Any]:
    """The fields with the folder's own name, a codec's, where they say ``$codec``."""

    def fill(value: Any) -> Any:
        if isinstance(value, str):
            return value.replace("$codec", codec)
        if isinstance(value, dict):
            return {key: fill(inner) for key, inner in value.items()}
        return [fill(inner) for inner in value] if isinstance(value, list) else value

    return {key: fill(value) for key, value in fields.items()}


@cache
def tables() -> dict[str, tuple[Row, ...]]:
    """The rows of all tables, by the names of these."""
    paths = sorted(FOLDER.rglob("*.toml"))
    return {p.relative_to(FOLDER).with_suffix("").as_posix(): tuple(rows_of(p)) for p in paths}


@cache
def rows() -> dict[str, Row]:
    """All rows by the names of their vectors."""
    rows_by_name: dict[str, Row] = {}
    for table, listed in tables().items():
        for row in listed:
            if row.name in rows_by_name:
                raise ValueError(f"{table}: {row.name} is in two tables")
            rows_by_name[row.name] = row
    alone = [name for name, row in rows_by_name.items() if row.fault and row.fault.kind == CHECKSUM]
    if sum(not name.startswith(PARTS) for name in alone) > MOST_CHECKSUMS:
        raise ValueError(f"more than {MOST_CHECKSUMS} vectors of checksums alone")
    return rows_by_name
