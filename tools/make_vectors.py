"""Write conformance/vectors and their manifest; nothing else ever does.

    python tools/make_vectors.py [--check | --freeze] [TABLE ...]

The same code and the same zlib give the same bytes: there are no clocks and no dice. ``--check``
writes nothing and says whether all files are as they would be written. Files that SHA256SUMS lists
are frozen (SPEC.md, "Versions"): they and their rows of the manifest stay as they are, whatever
today's encoders would make of them. ``--freeze``, at the release of a version, lists all files.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import zlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # so that this file can be run as a script

from mcz.container.limits import FORMAT_NAME  # noqa: E402 - needs the path
from tools.vectors import uncommon, valid  # noqa: E402 - needs the path
from tools.vectors.bases import MADE  # noqa: E402
from tools.vectors.build.files import OK, REFUSED, Vector  # noqa: E402
from tools.vectors.contents import codecs_of, formats_of  # noqa: E402
from tools.vectors.engine.tables import Fault, Row, tables  # noqa: E402
from tools.vectors.engine.tables import rows as table_rows  # noqa: E402
from tools.vectors.requirements import requirements  # noqa: E402

CONFORMANCE = ROOT / "conformance"
SUMS = "SHA256SUMS"
GROUPS = {"valid": valid.MODULES, "uncommon": uncommon.MODULES, "invalid": ()}


def vectors() -> list[Vector]:
    """Every vector, by group and name."""
    collected = []
    for group, modules in GROUPS.items():
        made = [vector for module in modules for vector in module.vectors()]
        MADE.update({vector.name: vector.data for vector in made if group == "valid"})
        own = [row for row in table_rows().values() if row.name.startswith(f"{group}/")]
        for row in sorted(own, key=_rests_on_another):
            made.append(row.vector())
            if group == "valid":
                MADE[row.name] = made[-1].data
        collected += sorted(made, key=lambda vector: vector.name)
    names = [vector.name for vector in collected]
    assert len(names) == len(set(names)), sorted(n for n in names if names.count(n) > 1)
    return collected


def _rests_on_another(row: Row) -> bool:
    return str(row.fields.get("base", "")).startswith("valid/")


def rows(made: Sequence[Vector], names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """The manifest's rows of vectors: of all, or of some among ``names``, those of all."""
    names = names or [vector.name for vector in made]
    ids = requirements(names)
    wrong = {name: row.fault for name, row in table_rows().items()}
    return [row(vector, ids[vector.name], wrong.get(vector.name)) for vector in made]


def row(vector: Vector, ids: Sequence[str] = (), fault: Fault | None = None) -> dict[str, Any]:
    """The manifest's row of ``vector``, which shows the requirements ``ids``."""
    fields = {
        "file": f"{vector.name}.mcz",
        "group": vector.name.partition("/")[0],
        "spec": list(vector.spec),
        "requirements": list(ids),
        "purpose": vector.purpose,
        "since": vector.since,
        "codecs": codecs_of(vector),
        "licence": "CC0-1.0",
        "sha256": _hash(vector.data),
        "exit": list(vector.exit),
        "modes": list(vector.modes),
        "expected": _expected_modes(vector),
    }
    if "sources" in vector.modes:
        fields["formats"] = formats_of(vector)
    if fault:
        fields |= {"fault": fault.kind, "effect": fault.effect, "reason": fault.reason}
    if vector.is_crafted:
        fields["crafted"] = True
    if vector.seed is not None:
        fields["seed"] = vector.seed
    if vector.parts:
        fields["parts"] = [
            {"arguments": list(arguments), "arrays": _array_rows(arrays)}
            for arguments, arrays in vector.parts
        ]
    return fields


def _expected_modes(vector: Vector) -> dict[str, Any]:
    if OK not in vector.exit:
        return {"refusal": "invalid" if REFUSED in vector.exit else "unsupported"}
    return {
        mode: _array_rows(vector.arrays) if mode == "arrays" else _sources(vector.sources)
        for mode in vector.modes
    }


def _array_rows(arrays: Sequence[tuple[dict[str, Any], bytes]]) -> list[dict[str, Any]]:
    return [fields | {"sha256": _hash(data)} for fields, data in arrays]


def _sources(sources: Sequence[tuple[str, bytes]]) -> list[dict[str, Any]]:
    return [{"path": path, "bytes": len(data), "sha256": _hash(data)} for path, data in sources]


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def files() -> dict[str, bytes]:
    """Path below conformance/ and content of every vector, and of the manifest."""
    made = vectors()
    written = {f"vectors/{vector.name}.mcz": vector.data for vector in made}
    return _with_frozen(written, rows(made), frozen())


def files_of(names: Collection[str]) -> dict[str, bytes]:
    """Files of the tables ``names``; the manifest's other rows stay as they are."""
    unknown = sorted(set(names) - set(tables()))
    if unknown:
        raise SystemExit(f"make_vectors: there is no table {', '.join(unknown)}")
    own: dict[str, Row] = {row.name: row for name in names for row in tables()[name]}
    made = [row.vector() for row in own.values()]
    kept = [fields for fields in _listed() if fields["file"].removesuffix(".mcz") not in own]
    every = [*own, *(fields["file"].removesuffix(".mcz") for fields in kept)]
    written = {f"vectors/{vector.name}.mcz": vector.data for vector in made}
    known = {path: digest for path, digest in frozen().items() if path in written}
    return _with_frozen(written, [*kept, *rows(made, every)], known)


def _listed() -> list[dict[str, Any]]:
    """The rows of the manifest as it stands."""
    listed: list[dict[str, Any]] = json.loads((CONFORMANCE / "manifest.json").read_text("utf-8"))[
        "vectors"
    ]
    return listed


def frozen() -> dict[str, str]:
    """Path below conformance/ and SHA-256 of every file that must stay as it is."""
    path = CONFORMANCE / SUMS
    lines = path.read_text("ascii").splitlines() if path.exists() else []
    return {path: digest for digest, path in (line.split("  ") for line in lines)}


def _with_frozen(
    written: Mapping[str, bytes], rows: Sequence[dict[str, Any]], listed: Mapping[str, str]
) -> dict[str, bytes]:
    """Files and their manifest, those of ``listed`` as they stand; raise SystemExit if not."""
    whole = dict(written)
    by_path = {f"vectors/{fields['file']}": fields for fields in rows}
    stored = {f"vectors/{fields['file']}": fields for fields in _listed()} if listed else {}
    for path, digest in listed.items():
        if _hash(whole.get(path, b"")) == digest:
            continue
        place = CONFORMANCE / path
        whole[path] = place.read_bytes() if place.exists() else b""
        if _hash(whole[path]) != digest:
            raise SystemExit(f"make_vectors: {path} is frozen, but it was changed or removed")
        by_path[path] = stored[path]
    groups = list(GROUPS)
    ordered = sorted(
        by_path.values(), key=lambda row: (groups.index(row["group"]), row["file"][:-4])
    )
    return whole | {"manifest.json": _manifest(ordered).encode()}


def _sums(made: Mapping[str, bytes]) -> bytes:
    """A line a vector, as ``sha256sum --check`` reads it."""
    paths = sorted(path for path in made if path.startswith("vectors/"))
    return "".join(f"{_hash(made[path])}  {path}\n" for path in paths).encode("ascii")


def _manifest(listed: Sequence[dict[str, Any]]) -> str:
    """A line a vector, so that the file stays small and a change shows what it changes."""
    head = {
        "format_version": FORMAT_NAME,
        "licence": "CC0-1.0",
        "zlib": zlib.ZLIB_RUNTIME_VERSION,
    }
    lines = [json.dumps(fields, ensure_ascii=False, separators=(",", ":")) for fields in listed]
    start = json.dumps(head)[:-1]
    return f'{start}, "vectors": [\n' + ",\n".join(lines) + "\n]}\n"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="write nothing, list what differs")
    parser.add_argument("--freeze", action="store_true", help=f"list all files in {SUMS}")
    parser.add_argument(
        "tables", nargs="*", metavar="TABLE", help="make these tables alone, such as invalid/clip"
    )
    options = parser.parse_args(arguments)
    made = files_of(options.tables) if options.tables else files()
    old = {p.relative_to(CONFORMANCE).as_posix() for p in CONFORMANCE.glob("vectors/**/*.mcz")}
    stale = [] if options.tables else sorted(old - set(made))
    changed = [name for name in made if not _is_same(CONFORMANCE / name, made[name])]
    for name in [*stale, *changed]:
        print(name)
    if options.check:
        return int(bool(stale or changed))
    for name in stale:
        (CONFORMANCE / name).unlink()
    for name in changed:
        (CONFORMANCE / name).parent.mkdir(parents=True, exist_ok=True)
        (CONFORMANCE / name).write_bytes(made[name])
    size = sum(map(len, made.values()))
    print(f"{len(made) - 1} vectors, {size:,} bytes with the manifest")
    if options.freeze:
        (CONFORMANCE / SUMS).write_bytes(sums := _sums(made))
        print(f"SHA-256 of {SUMS}, which SPEC.md states: {_hash(sums)}")
    return 0


def _is_same(path: Path, data: bytes) -> bool:
    return path.is_file() and path.read_bytes() == data


if __name__ == "__main__":
    sys.exit(main())
