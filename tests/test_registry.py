"""registry.json says what SPEC.md says, and both what the code does."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import pytest

from mcz import compare
from mcz.codecs import CODECS, bitstream_name
from mcz.codecs.basis_models import known_model_name
from mcz.codecs.online.rate_control import PRESET_IDS
from mcz.codecs.transforms.wavelets import IDS, WAVELETS
from mcz.container import limits
from mcz.container.chunks import FLAGS_OF, ChunkType
from mcz.container.limits import FORMAT_NAME
from mcz.model.motion import CHANNEL_KINDS, ROLES
from mcz.sources import FORMATS, sample
from tools import registry

LIMITS = {
    "channels": "channels of a signal, and of a skeleton",
    "joints": "joints of a skeleton",
    "segment_bytes": "decoded bytes of a segment (8 a value)",
    "model_bytes": "bytes of the payloads of all MODL chunks, repeats too, none in REPT or COPY",
    "chunk_bytes": "bytes of a chunk's payload",
    "packet_bytes": "bytes of a packet's body",
    "text_bytes": "bytes of a template",
    "signals": "signals of a clip",
    "rows": "rows of a segment",
}
FOUND: dict[str, Any] = json.loads(registry.REGISTRY.read_text("utf-8"))


def by(key: str, name: str) -> dict[Any, dict[str, Any]]:
    """The rows of table ``name`` by their ``key``, no two of which are the same."""
    rows = {row[key]: row for row in FOUND[name]}
    assert len(rows) == len(FOUND[name])
    return rows


def test_it_is_what_the_text_says() -> None:
    assert registry.REGISTRY.read_text("utf-8") == registry.document()


@pytest.mark.parametrize("mark", ["**Annexes**", "## Codecs\n", "## Wavelets\n"])
def test_a_table_that_is_gone_is_missed(mark: str) -> None:
    text = registry.SPEC.read_text("utf-8").replace(mark, "")
    with pytest.raises(ValueError, match="no table"):
        registry.registry(text)


def test_version() -> None:
    assert FOUND["format_version"] == FORMAT_NAME


def test_chunk_types() -> None:
    found = {name.encode(): row["flags"] for name, row in by("type", "chunk_types").items()}
    assert found == dict.fromkeys(found, 0) | FLAGS_OF
    assert set(found) == set(ChunkType)


def test_profiles() -> None:
    rows = by("id", "profiles")
    assert set(rows) == set(limits.PROFILES)
    for id_, row in rows.items():
        assert row["name"] == limits.PROFILES[id_].name
        fields = asdict(limits.PROFILES[id_])
        found = {field: row["limits"][name] for field, name in LIMITS.items()}
        assert found == {
            field: fields[field]
            for field in set(fields) - {"id", "name", "is_plain", "coded_bytes"}
        }
        assert len(row["limits"]) == len(LIMITS)


def test_codecs() -> None:
    rows = by("id", "codecs")
    assert {id_: (row["name"], row["version"], row["decodes"]) for id_, row in rows.items()} == {
        codec.id: (bitstream_name(codec.id), codec.version, codec.domain)
        for codec in CODECS.values()
    }
    presets = {(row["codec"], row["id"], row["preset"]) for row in FOUND["presets"]}
    online = {(21, id_, name) for name, id_ in PRESET_IDS.items() if id_}
    assert presets - online == {
        (codec.id, codec.preset, name) for name, codec in CODECS.items() if codec.preset
    }
    assert online < presets


def test_source_formats() -> None:
    rows = by("id", "source_formats")
    assert {id_: (row["name"], row["suffixes"]) for id_, row in rows.items()} == {
        f.id: (f.name, " ".join(f.suffixes)) for f in FORMATS.values()
    }


def test_channel_kinds() -> None:
    rows = by("id", "channel_kinds")
    assert [rows[id_]["name"] for id_ in sorted(rows)] == ["", *CHANNEL_KINDS]


def test_roles() -> None:
    assert tuple(row["name"] for _, row in sorted(by("id", "roles").items())) == ROLES


def test_metrics() -> None:
    motion = sample.acclaim_walk()
    ours = compare(motion, motion).entries()
    assert set(ours) | {
        f"signal.NAME.{figure}" for figure in ("mse", "max_error", "mean_error")
    } == set(by("id", "metrics"))


def test_bases() -> None:
    for name, row in by("name", "bases").items():
        assert known_model_name(bytes.fromhex(row["id"])) == name


def test_wavelets() -> None:
    rows = by("name", "wavelets")
    assert {name: (row["id"], row["taps"]) for name, row in rows.items()} == {
        name: (IDS[name], wavelet.n_taps) for name, wavelet in WAVELETS.items()
    }
