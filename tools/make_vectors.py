"""Write conformance/vectors and conformance/manifest.json; nothing else ever does.

    python tools/make_vectors.py [--check]

The same code and the same zlib give the same bytes: there are no clocks and no dice. ``--check``
writes nothing and says whether all files are as they would be written. Vectors of a released
format are frozen (SPEC.md, "Versions").
"""

from __future__ import annotations

import hashlib
import json
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # so that this file can be run as a script

from tools.vectors import (  # noqa: E402 - needs the path
    bad_c3d,
    bad_chunks,
    bad_clips,
    bad_cut,
    bad_data,
    bad_index,
    bad_khan,
    bad_lossless,
    bad_lsdt,
    bad_lsdt_models,
    bad_lsdt_streams,
    bad_mrdwt,
    bad_notes,
    bad_numbers,
    bad_online,
    bad_online_streams,
    bad_online_units,
    bad_qbc,
    bad_shared,
    bad_sources,
    sources,
    sources_c3d,
    sources_text,
    uncommon,
    valid_container,
    valid_cut,
    valid_filtered,
    valid_khan,
    valid_lossless,
    valid_lossless_clips,
    valid_lsdt,
    valid_lsdt_clips,
    valid_lsdt_windows,
    valid_mrdwt,
    valid_mrdwt_clips,
    valid_notes,
    valid_numbers,
    valid_online,
    valid_online_clips,
    valid_qbc,
    valid_raw,
)
from tools.vectors.craft import OK, REFUSED, Vector  # noqa: E402

CONFORMANCE = ROOT / "conformance"
MODULES = (
    valid_container,
    valid_numbers,
    valid_notes,
    valid_raw,
    valid_lossless,
    valid_lossless_clips,
    valid_mrdwt,
    valid_mrdwt_clips,
    valid_qbc,
    valid_khan,
    valid_lsdt,
    valid_lsdt_clips,
    valid_lsdt_windows,
    valid_online,
    valid_online_clips,
    valid_cut,
    valid_filtered,
    sources,
    sources_c3d,
    sources_text,
    uncommon,
    bad_chunks,
    bad_index,
    bad_shared,
    bad_clips,
    bad_data,
    bad_cut,
    bad_notes,
    bad_numbers,
    bad_lossless,
    bad_mrdwt,
    bad_qbc,
    bad_khan,
    bad_lsdt,
    bad_lsdt_models,
    bad_lsdt_streams,
    bad_online,
    bad_online_units,
    bad_online_streams,
    bad_sources,
    bad_c3d,
)
FORMAT_VERSION = "0.9"


def vectors() -> list[Vector]:
    """Every vector, by group and then in the order of the modules."""
    found = [vector for module in MODULES for vector in module.vectors()]
    names = [vector.name for vector in found]
    assert len(names) == len(set(names)), sorted(n for n in names if names.count(n) > 1)
    return found


def row(vector: Vector) -> dict[str, Any]:
    """The manifest's row of ``vector``."""
    expected: dict[str, Any] = {}
    if OK not in vector.exit:
        expected["refusal"] = "invalid" if REFUSED in vector.exit else "unsupported"
    else:
        for mode in vector.modes:
            expected[mode] = (
                _listed(vector.arrays) if mode == "arrays" else _sources(vector.sources)
            )
    fields = {
        "file": f"{vector.name}.mcz",
        "group": vector.name.partition("/")[0],
        "spec": list(vector.spec),
        "purpose": vector.purpose,
        "format_version": FORMAT_VERSION,
        "licence": "CC0-1.0",
        "sha256": _hash(vector.data),
        "exit": list(vector.exit),
        "modes": list(vector.modes),
        "expected": expected,
    }
    if vector.parts:
        fields["parts"] = [
            {"arguments": list(arguments), "arrays": _listed(arrays)}
            for arguments, arrays in vector.parts
        ]
    return fields


def _listed(arrays: Sequence[tuple[dict[str, Any], bytes]]) -> list[dict[str, Any]]:
    return [fields | {"sha256": _hash(data)} for fields, data in arrays]


def _sources(sources: Sequence[tuple[str, bytes]]) -> list[dict[str, Any]]:
    return [{"path": path, "bytes": len(data), "sha256": _hash(data)} for path, data in sources]


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def files() -> dict[str, bytes]:
    """Path below conformance/ and content of every file."""
    made = vectors()
    manifest = {
        "format_version": FORMAT_VERSION,
        "licence": "CC0-1.0",
        "zlib": zlib.ZLIB_RUNTIME_VERSION,
        "vectors": [row(vector) for vector in made],
    }
    text = json.dumps(manifest, indent=1, ensure_ascii=False) + "\n"
    return {f"vectors/{vector.name}.mcz": vector.data for vector in made} | {
        "manifest.json": text.encode()
    }


def main() -> int:
    made = files()
    old = {p.relative_to(CONFORMANCE).as_posix() for p in CONFORMANCE.glob("vectors/**/*.mcz")}
    stale = sorted(old - set(made))
    changed = [name for name in made if not _is_same(CONFORMANCE / name, made[name])]
    for name in [*stale, *changed]:
        print(name)
    if "--check" in sys.argv[1:]:
        return int(bool(stale or changed))
    for name in stale:
        (CONFORMANCE / name).unlink()
    for name in changed:
        (CONFORMANCE / name).parent.mkdir(parents=True, exist_ok=True)
        (CONFORMANCE / name).write_bytes(made[name])
    size = sum(map(len, made.values()))
    print(f"{len(made) - 1} vectors, {size:,} bytes with the manifest")
    return 0


def _is_same(path: Path, data: bytes) -> bool:
    return path.is_file() and path.read_bytes() == data


if __name__ == "__main__":
    sys.exit(main())
