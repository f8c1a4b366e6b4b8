"""The tables of SPEC.md that no schema makes, its constants, and its worked examples."""

from __future__ import annotations

import hashlib
import json
import re
from itertools import product, takewhile
from pathlib import Path

import numpy as np
import pytest

from mcz.codecs import codec_by_id, space
from mcz.codecs.coding import mixing, residuals
from mcz.codecs.curves import kernels as qbc_kernels
from mcz.codecs.online import kernels as online_kernels
from mcz.codecs.posewave import header as posewave
from mcz.codecs.transforms.wavelets import MAX_LEVELS
from mcz.container.grammar import GRAMMAR
from mcz.model.numbers import Grid, GridFlag, GridKind, printed_base, rules, values_of_texts
from mcz.model.schema import parse
from mcz.sources import FORMATS
from mcz.sources.c3d import data_section
from mcz.sources.c3d.layout import FieldKind
from mcz.sources.tables import opensim
from mcz.sources.tables.layout import PHRASES, TableTemplate
from mcz.sources.text import amc
from mcz.sources.text.layout import Template
from tests.test_spec import ROOT, SPEC, rows_under

WORDS = " ".join(SPEC.split())


def section(heading: str) -> str:
    return re.split(r"\n#{1,3} ", SPEC.split(f"# {heading}\n", 1)[1])[0]


def words_of(heading: str) -> str:
    """The section on one line."""
    return " ".join(section(heading).split())


def table_after(text: str, head: str) -> list[list[str]]:
    rows = list(takewhile(bool, text.split(head, 1)[1].splitlines()[2:]))
    return [[c.strip() for c in row.strip("|").split("|")] for row in rows]


def test_states_of_the_grammar() -> None:
    head = "| thing | start | body | clip | packets | index | file |"
    states = [state.strip() for state in head.strip("|").split("|")][1:]
    found = {
        thing: {state: after for state, after in zip(states, row[1:], strict=True) if after}
        for row in table_after(section("Grammar"), head)
        for thing in row[0].split(", ")
    }
    assert found == GRAMMAR


def test_groups_and_resolutions_of_codecs() -> None:
    levels = f"1 to {MAX_LEVELS + 1}"
    for row in rows_under("Codecs"):
        codec = codec_by_id(int(row[0]), 0, 0)
        groups = "any" if codec.domain == "ordinals" else codec.grouping
        assert row[4] == groups + ("; any with exact groups" if codec.exact else "")
        by_codec = {"wavelet": levels, "qbc": "1 to 2"}
        by_codec["posewave"] = f"1 to {posewave.MAX_LEVELS + 1}"
        assert row[5] == by_codec.get(codec.name, "1")


def test_contexts_of_residuals() -> None:
    names = ("below", "less", "more", "second", "third", "side")
    rows = {row[0].lower(): row[1:] for row in rows_under("Residuals")}
    assert list(rows) == list(names)
    firsts = [getattr(residuals, f"C_{name.upper()}") for name in names]
    mixers = [getattr(residuals, f"M_{name.upper()}") for name in names]
    assert [int(rows[name][0]) for name in names] == firsts
    assert [int(rows[name][1].split(" to ")[0]) for name in names] == mixers
    assert rows["more"][1] == f"{residuals.M_MORE} to {residuals.M_SECOND - 1}"
    counts = f"{residuals.N_CONTEXTS} contexts and {residuals.N_MIXERS} mixers"
    assert f"There are {counts}." in words_of("Residuals")


def test_nodes_of_the_mixer() -> None:
    text = re.search(r"NODES = ([\d\s]+)", SPEC)
    assert text is not None
    assert tuple(map(int, text[1].split())) == mixing.NODES


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        ("Entropy coding", f"if n < {mixing.COUNT_LIMIT}: n = n + 1"),
        ("Entropy coding", f"clamp(dot, -{mixing.LIMIT}, {mixing.LIMIT})"),
        ("Entropy coding", f"clamp(a.p, {mixing.LEAST_ONE}, {65536 - mixing.LEAST_ONE})"),
        ("Entropy coding", f"-2^{mixing.MAX_WEIGHT.bit_length() - 1}, 2^24)"),
        ("Residuals", "refuse if n > 53"),
    ],
)
def test_constants(heading: str, words: str) -> None:
    assert words in words_of(heading)


START = {  # annex: what the text says of each of its sets
    "best": ["2568 contexts and 17 mixers"],
    "wavelet": 5 * ["2568 contexts and 17 mixers"],
    "qbc": ["2568 contexts, 17 mixers", "7736 contexts, 52 mixers"],
    "pca": ["7704 contexts, 51 mixers"],
    "window": ["7704 contexts, 51 mixers"],
    "frame": ["contexts and mixers as in lsdt-clip"],
    "online": [*2 * ["7719 contexts"], *2 * ["143 contexts"]],
}
AS_WINDOWS = 7704, 51


@pytest.mark.parametrize("name", START)
def test_sizes_of_start_tables(name: str) -> None:
    document = json.loads((ROOT / f"conformance/annex/{name}_start.json").read_text())
    tables = document.get("sets", [document])
    assert len(tables) == len(START[name])
    for table, words in zip(tables, START[name], strict=True):
        assert words in WORDS
        numbers = [int(n) for n in re.findall(r"\d+", words)] or list(AS_WINDOWS)
        assert len("".join(table["probabilities"])) == 2 * numbers[0]
        assert len("".join(table["counts"])) == 2 * numbers[0]
        if len(numbers) == 2:
            assert len(table["weights"]) == 3 * numbers[1]


def test_places_of_residuals_in_codecs() -> None:
    """The text names some first contexts and mixers; all follow from the sizes."""
    first = residuals.N_CONTEXTS, residuals.N_MIXERS
    second = 2 * first[0], 2 * first[1]
    assert ((0, 0), first, second) == (
        space.LENGTHS,
        space.FIRSTS,
        space.OTHERS,
    )
    assert f"context {first[0]} and mixer {first[1]}" in words_of("Space")
    assert f"context {second[0]} and mixer {second[1]}" in words_of("Space")
    assert f"LAST at context {qbc_kernels.C_LAST} and mixer" in words_of("Codec 17: qbc")


def test_every_annex_that_is_named_with_a_hash_has_it() -> None:
    named = re.findall(r"`conformance/annex/(\w+\.\w+)` \(SHA-256 ([0-9a-f]{64})\)", WORDS)
    named += re.findall(r"^\| `(\w+\.\w+)` \| ([0-9a-f]{64}) \|", SPEC, re.M)
    files = {path.name for path in (ROOT / "conformance/annex").iterdir()} - {"registry.json"}
    assert {name for name, _ in named} == files
    for name, digest in named:
        data = (ROOT / "conformance/annex" / name).read_bytes()
        assert hashlib.sha256(data).hexdigest() == digest, name


def numbers_in(text: str) -> set[int]:
    """The numbers that "0 to 22" or "0, 1, 16, 17" lists."""
    found = set()
    for part in text.split(", "):
        low, _, high = part.partition(" to ")
        found |= set(range(int(low), int(high or low) + 1))
    return found


def flags_in(text: str, digits: int) -> int:
    """The flags that a grid of so many digits may have, without regard to those that clash."""
    if text == "all":
        return int(sum(GridFlag))
    found = 0
    for name, sign in re.findall(r"([A-Z][A-Z_0-9]+)(?: \(digits ([>=]) 0\))?", text):
        if not sign or (sign == ">") == (digits > 0):
            found |= GridFlag[name]
    return found


def test_grids() -> None:
    allowed: dict[tuple[GridKind, int], tuple[int, str, str]] = {}
    rows = table_after(section("The grid structure"), "| kind | id |")
    for kind, id_, digits, flags, most, ordinals in rows:
        assert GridKind[kind] == int(id_)
        for number in numbers_in(digits):
            allowed[GridKind[kind], number] = flags_in(flags, number), most, ordinals
    for kind in GridKind:
        for digits in range(256):
            style = digits + 63 if kind == GridKind.PRINTED and 128 < digits < 144 else 0
            legal = rules.grid_fault(kind, digits, 0, 1.0, style) is None
            assert legal == ((kind, digits) in allowed), (kind, digits)
            if legal and kind != GridKind.PRINTED:
                check_grid(Grid(kind, digits), *allowed[kind, digits])


def check_grid(grid: Grid, flags: int, most: str, ordinals: str) -> None:
    for flag in GridFlag:
        legal = rules.grid_fault(grid.kind, grid.digits, int(flag), 1.0) is None
        assert legal == bool(flags & flag), (grid, flag)
    most = most.replace("^", "**").replace("digits", str(grid.digits))
    assert grid.limit == eval(most)
    assert ordinals == ("-1 - M to M" if grid.signed_magnitude else "-M to M")


def test_styles_of_printed_grids() -> None:
    """Each pair of digits and a style is legal where both tables have it, with those flags."""
    styles = {
        style: flags_in(flags, 1)
        for listed, _, flags in table_after(section("PRINTED"), "| style | text |")
        for style in numbers_in(listed)
    }
    wanted = {}
    rows = table_after(section("PRINTED"), "| digits | numbers |")
    for listed, _, kind, which, most in rows:
        for digits in numbers_in(listed):
            for style, flags in styles.items():
                of = {"any": True, "below 128": style < 128, "128 and more": style >= 128}
                if of.get(which, style == digits + 63):
                    limit = eval(most.replace("^", "**").replace("digits", str(digits)))
                    wanted[digits, style] = GridKind[kind], limit, flags
    for digits, style in product(range(256), range(256)):
        legal = rules.grid_fault(GridKind.PRINTED, digits, 0, 1.0, style) is None
        assert legal == ((digits, style) in wanted), (digits, style)
    for (digits, style), (kind, limit, flags) in wanted.items():
        grid = Grid(GridKind.PRINTED, digits, style=style)
        assert (grid.limit, printed_base(grid).kind) == (limit, kind)
        for flag in GridFlag:
            legal = rules.grid_fault(GridKind.PRINTED, digits, int(flag), 1.0, style) is None
            assert legal == bool(flags & flag), (grid, flag)


def test_flags_of_grids() -> None:
    rows = table_after(section("The grid structure"), "| flag | bit | text |")
    assert {row[0]: int(row[1]) for row in rows} == {flag.name: int(flag) for flag in GridFlag}


@pytest.mark.parametrize("row", rows_under("Worked examples"), ids=lambda row: row[0])
def test_worked_examples_of_grids(row: list[str]) -> None:
    token, spec, ordinal, value = row
    spec, _, style = spec.partition(", style ")
    kind, *rest = spec.split()
    digits = int(rest.pop(0)) if rest and rest[0].isdigit() else 0
    grid = Grid(GridKind[kind], digits, sum(GridFlag[name] for name in rest), style=int(style or 0))
    place = np.array([int(ordinal, 0)])
    text = re.fullmatch(r"(bytes )?`([^`]+)`", token)
    assert text is not None
    if text[1]:
        word = np.frombuffer(bytes.fromhex(text[2]), "<u4")
        assert grid.ordinals_of_bits(word).tolist() == place.tolist()
    else:
        assert grid.texts(place).tolist() == [text[2].encode()]
        assert grid.values(place).tolist() == values_of_texts([text[2].encode()])[0].tolist()
    found = grid.values(place).view(np.int64)
    wanted = np.array([float(value.split()[0])]).view(np.int64)
    assert found.tolist() == wanted.tolist()


def test_parts_of_source_formats() -> None:
    rows = {row[0]: row[1:] for row in rows_under("Source reconstruction")}
    assert {name: int(row[0]) for name, row in rows.items()} == {
        name: known.id for name, known in FORMATS.items()
    }
    for name, known in FORMATS.items():
        assert rows[name][4].endswith("NOTES") == (known.join_notes is not None)


def test_worked_example_of_a_template() -> None:
    text = section("The text of AMC and BVH")
    block = re.search(r"Worked example, the file\n\n```\n(.*?)\n```", text, re.S)
    assert block is not None
    file = block[1].replace("\n", "").replace("\\n", "\n").encode()
    motion = amc.read(file, "a", None)
    source = motion.source
    assert source is not None
    assert source.detail == b"\0\0\0\0\1\0"
    fields = parse(Template, source.template, "template")
    said = {row[0]: row[1] for row in table_after(text, "| part | value |")}
    plain = {b"": "empty", b" ": "one blank"}
    gaps = [plain.get(g) or f"`{g.decode()}`".replace("\n", "\\n") for g in fields.gaps]
    assert said["gaps"] == ", ".join(f"{n}: {gap}" for n, gap in enumerate(gaps))
    assert [bytes(part) for part in fields.header] == [b":DEGREES\n"]
    (pattern,) = fields.patterns
    assert (pattern.tail, [(run.gap, run.column) for run in pattern.runs]) == (
        int(said["pattern 0"].split("tail ")[1]),
        [(0, 0), (1, 1), (2, 2), (3, 3)],
    )
    assert {grid.kind for grid in motion.signals[0].grids} == {GridKind.FIXED}
    assert amc.write(motion) == file


def test_phrases_of_tables() -> None:
    rows = table_after(section("The text of tables"), "| byte | phrase")
    said = {int(row[0]): row[1].split("`")[1].replace("\\t", "\t").encode() for row in rows}
    assert said == PHRASES


def test_worked_example_of_a_table() -> None:
    text = section("The text of tables")
    block = re.search(r"Worked example, the file\n\n```\n(.*?)\n```", text, re.S)
    assert block is not None
    file = block[1].replace("\n", "").replace("\\n", "\n").replace("\\t", "\t").encode()
    motion = opensim.read_trc(file)
    source = motion.source
    assert source is not None
    assert source.detail == b"\1" + bytes(6)
    assert source.notes is None
    (fields,) = parse(TableTemplate, source.template, "template").sections
    said = {row[0]: row[1] for row in table_after(text, "| part | value |")}
    header = "".join(
        part.replace("\\t", "\t").replace("\\n", "\n") if k % 2 else bytes.fromhex(part).decode()
        for k, part in enumerate(said["header"].split("`"))
    )
    assert (fields.header, fields.marks, fields.missing) == (header.encode(), 1, b"")
    assert [int(said["signals"])] == fields.signals
    clock = fields.clock
    told = f"FIXED {clock.grid.digits}, numerator {clock.numerator}, "
    assert said["clock"] == f"{told}denominator {clock.denominator}, offset {clock.offset}"
    assert fields.gaps == [b"", b"\t", b"\n"]
    (pattern,) = fields.patterns
    assert (pattern.tail, [(r.gap, r.column, r.n_columns, r.width) for r in pattern.runs]) == (
        2,
        [(0, 0, 1, 0), (1, 7, 1, 0), (1, 1, 6, 0)],
    )
    assert set(motion.signals[0].grids) == {Grid(GridKind.FIXED, 1)}
    assert opensim.write_trc(motion) == file


def test_fields_of_c3d() -> None:
    rows = table_after(section("Template and detail of C3D"), "| kind | size | content |")
    assert [(int(row[0]), int(row[1])) for row in rows] == [(kind, kind.size) for kind in FieldKind]
    assert f"a block has {data_section.BLOCK} bytes" in rows[-1][2]


def test_signals_of_c3d() -> None:
    rows = table_after(section("Template and detail of C3D"), "| signal | needed where |")
    assert f"{data_section.ROTATION_WORDS} rotations" in [row[2] for row in rows]
    assert "SCALED or INTEGER" in rows[0][4]
    assert {kind.name for kind in data_section.INTEGERS} == {"SCALED", "INTEGER"}


def test_sizes_and_ratios() -> None:
    """Each figure of the table is one that the package states under that name."""
    code = "\n".join(path.read_text() for path in (ROOT / "mcz/files/reading").glob("*.py"))
    text = (ROOT / "docs/reference/measures.md").read_text("utf-8")
    for name, _ in rows_under("Sizes and ratios", text):
        assert f'"{name}"' in code, name


@pytest.mark.parametrize(
    ("heading", "folder"),
    [("Keys of cuts", "mcz/files/editing"), ("Keys of replaced joints", "mcz/files/editing")],
)
def test_keys_of_edits(heading: str, folder: str) -> None:
    code = "\n".join(path.read_text() for path in Path(ROOT / folder).glob("*.py"))
    for key, _ in rows_under(heading, (ROOT / "docs/guides/parts.md").read_text("utf-8")):
        name = key.strip("`").removesuffix("ID")
        assert f'"{name}' in code, key


def test_contexts_of_online() -> None:
    text, loops = words_of("Codec 21: online"), online_kernels
    assert f"FLAGS begins at context {loops.MIXED_FLAGS}." in text
    assert (
        f"FLAGS begins at context {loops.GOLOMB_FLAGS}, PREFIX at context {loops.C_PREFIX}" in text
    )
    assert f"FLAGS has {loops.N_FLAGS} contexts, PREFIX {143 - loops.N_FLAGS}" in text
    assert f"code < 0 or > {loops.N_STEPS - 1}" in text
