"""The tools behind the conformance vectors: random files, and the manifest's tables."""

from __future__ import annotations

import random
import re
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conformance import run
from mcz import MczError
from mcz.cli import conformance
from mcz.codecs import CODECS, bitstream_name, codec_by_name
from tools import make_vectors
from tools.vectors import requirements
from tools.vectors.build.files import Vector, arrays
from tools.vectors.build.random_parts import NAMES
from tools.vectors.contents import codecs_of, formats_of
from tools.vectors.engine import tables
from tools.vectors.valid.random import COUNT, _parts, random_file

ROWS = {row["file"].removesuffix(".mcz"): row for row in run.load_manifest()}
SEEDS = st.integers(COUNT, 2**32 - 1)


def vector_of(seed: int) -> Vector:
    """The file of this seed as a vector."""
    made = random_file(seed)
    return Vector(
        "valid/random/any",
        ("Grammar",),
        "A file made at random.",
        made.data,
        arrays=arrays(*made.motions),
        sources=tuple(made.sources),
        modes=("arrays", "sources"),
        parts=tuple(_parts(random.Random(seed), made.motions)),
        seed=seed,
    )


@settings(max_examples=25)
@given(SEEDS)
def test_files_made_at_random_are_what_they_say(seed: int) -> None:
    vector = vector_of(seed)
    for request in run.requests(make_vectors.row(vector), conformance.OPTIONS):
        answer = conformance.answer(vector.data, request.arguments)
        assert run.judge(request, *answer) is None, request.arguments


@settings(max_examples=10)
@given(SEEDS, st.data())
def test_files_made_at_random_and_changed_are_read_or_refused(
    seed: int, data: st.DataObject
) -> None:
    whole = random_file(seed).data
    at = data.draw(st.integers(0, len(whole) - 1))
    bit = data.draw(st.integers(0, 7))
    changed = whole[:at] + bytes((whole[at] ^ 1 << bit,)) + whole[at + 1 :]
    try:
        b"".join(conformance.respond(changed, conformance._parser().parse_args([])))
    except MczError:
        return
    pytest.fail(f"bit {bit} of byte {at} is of no consequence")


def test_a_seed_gives_the_same_file() -> None:
    for seed in (3, 17, 999):
        first, second = random_file(seed), random_file(seed)
        assert first.data == second.data
        assert first.traits == second.traits


def test_stored_files_made_at_random_have_everything() -> None:
    stored = [row for name, row in ROWS.items() if name.startswith("valid/random/")]
    assert sorted(row["seed"] for row in stored) == list(range(COUNT))
    found = Counter(name for row in stored for name in row["codecs"])
    assert set(found) == {bitstream_name(codec.id) for codec in CODECS.values()}
    assert min(found.values()) >= 5
    said = " ".join(row["purpose"] for row in stored)
    for trait in (
        "packets of kind 2",
        "REPT",
        "unknown chunks in a clip",
        "unknown ancillary chunks",
        "frames that are not shown",
        "an open clip",
        "several signals",
        "a source",
        "an alias",
        "an extension of HEAD",
        "an extension of a signal",
        "a body without INDX",
        "what nobody refers to",
    ):
        assert trait in said, trait


def test_every_invalid_vector_has_a_fault() -> None:
    for name, row in ROWS.items():
        own = {"fault", "effect", "reason"} & set(row)
        assert len(own) == (3 if row["group"] == "invalid" else 0), name
    others = [row for name, row in ROWS.items() if not name.startswith(tables.PARTS)]
    kinds = Counter(row["fault"] for row in others if "fault" in row)
    assert kinds["checksum"] <= tables.MOST_CHECKSUMS
    assert min(kinds["malformed"], kinds["impossible"]) > 150
    effects = {row["effect"] for row in ROWS.values() if "effect" in row}
    assert effects == set(tables.EFFECTS)
    every = {name for row in ROWS.values() if "fault" in row for name in row["codecs"]}
    assert every == {bitstream_name(codec_by_name(name).id) for name in NAMES}


def test_requirements_refuse_what_no_vector_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["valid/raw/plain", "valid/raw/widths", "uncommon/container/open-clip"]
    monkeypatch.setattr(requirements, "ARGUED", {})
    monkeypatch.setattr(requirements, "read_catches", dict)
    monkeypatch.setattr(requirements, "table_rows", dict)
    monkeypatch.setattr(requirements, "VECTORS", {"RAW-01": ("valid/*",), "A-02": ("*/plain",)})
    assert requirements.requirements(names) == {
        "valid/raw/plain": ["A-02", "RAW-01"],
        "valid/raw/widths": ["RAW-01"],
        "uncommon/container/open-clip": [],
    }
    for table in ({"RAW-01": ("valid/fast/*",)}, {"RAW-01": ()}, {"RAW": ("valid/*",)}):
        monkeypatch.setattr(requirements, "VECTORS", table)
        with pytest.raises(ValueError, match="requirements"):
            requirements.requirements(names)
    monkeypatch.setattr(requirements, "VECTORS", {"RAW-01": ("valid/*",)})
    monkeypatch.setattr(requirements, "ARGUED", {"RAW-01": "as well"})
    with pytest.raises(ValueError, match="both shown and argued"):
        requirements.requirements(names)


def test_tests_that_argue_for_rules_are_there() -> None:
    for id_, text in requirements.ARGUED.items():
        for file, name in re.findall(r"(\w+\.py)::(\w+)", text):
            places = Path(__file__).parent.rglob(file)
            assert any(f"def {name}(" in path.read_text("utf-8") for path in places), id_


def test_facts_are_those_of_the_files() -> None:
    def vector(name: str) -> Vector:
        data = (run.VECTORS / f"{name}.mcz").read_bytes()
        return Vector(name, ("HEAD",), "As it is.", data)

    for name, codecs in (
        ("valid/container/minimal", []),
        ("valid/mrdwt/signals", ["fast", "wavelet"]),
        ("valid/pca-rdo/clips", ["lsdt-clip", "raw"]),
        ("invalid/numbers/kind-12", []),
        ("invalid/fast/tiny-mantissa", ["fast"]),
    ):
        assert codecs_of(vector(name)) == codecs, name
    assert formats_of(vector("valid/sources/amc")) == ["amc", "asf"]
    assert formats_of(vector("valid/container/attachments")) == []
