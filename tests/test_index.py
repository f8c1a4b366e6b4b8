"""INDX: its tables against a plain reading of its record, chains of INDX, and what vectors list."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import conformance
import mcz
from mcz.codecs import raw
from mcz.container import http, index
from mcz.container.index import build_index
from mcz.container.scan import scan
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import write_clip
from mcz.model.schema import Table, build, columns, field, parse
from mcz.model.schema.records import Record
from mcz.model.schema.types import SIZED, TEXT, UVARINT, Exactly
from tests.motions import smooth
from tests.web_server import Server, serve

VECTORS = Path(conformance.__file__).parent / "vectors" / "valid"

NUMBERS = st.integers(0, 2**53 - 1)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)


class Item(Record):
    """A row of a table of every type of column."""

    name: str = field(TEXT, "a text")
    number: int = field(UVARINT, "a number")
    tag: bytes = field(Exactly(2), "two bytes")
    data: bytes = field(SIZED, "bytes")


class Items(Record):
    """A table, and what follows it."""

    items: Table[Item] = field(columns(Item), "the table")
    last: int = field(UVARINT, "a number")


ITEMS = st.builds(
    Item, name=NAMES, number=NUMBERS, tag=st.binary(min_size=2, max_size=2), data=st.binary()
)


@given(st.lists(ITEMS, max_size=5), NUMBERS)
def test_a_table_is_its_columns(items: list[Item], last: int) -> None:
    from mcz.model.schema.types import varint

    made = build(Items(items=items, last=last), "items")
    plain = varint(len(items))
    texts = [item.name.encode() for item in items]
    plain += b"".join(varint(len(text)) for text in texts) + b"".join(texts)
    plain += b"".join(varint(item.number) for item in items)
    plain += b"".join(item.tag for item in items)
    plain += b"".join(varint(len(item.data)) for item in items)
    plain += b"".join(item.data for item in items) + varint(last)
    assert made == plain
    parsed = parse(Items, made, "items")
    assert list(parsed.items) == items == [parsed.items[n] for n in range(len(items))]
    assert parsed.last == last
    for stop in range(len(made)):
        with pytest.raises(mcz.TruncatedError):
            parse(Items, made[:stop], "items")


@pytest.mark.parametrize(
    ("column", "error"),
    [
        (b"\x80\x00", "shortest form"),
        (b"\xff" * 7 + b"\x1f", "2\\^53"),
        (b"\x80" * 9 + b"\x01", "2\\^53"),
        (b"\x80", "past the end"),
    ],
)
def test_columns_have_the_varints_of_the_format(column: bytes, error: str) -> None:
    with pytest.raises(mcz.FormatError, match=error):
        parse(Items, b"\x02\x00\x00\x05" + column, "items")


def test_appends_leave_few_indexes_and_write_little() -> None:
    """The INDX of one more clip lists few, and no more than four are to be read."""
    sink, sizes = BytesIO(), []
    writer = Writer(sink)
    for number in range(300):
        write_clip(writer, smooth(1, name=f"first {number}"), raw.CODEC, {})
    writer.finish()
    for number in range(80):
        with mcz.open(sink.getvalue()) as file:
            directory = file.container.directory
            assert len(directory.indexes) <= 4
        writer = Writer(sink, directory=directory, offset=len(sink.getvalue()))
        write_clip(writer, smooth(1, name=f"more {number}"), raw.CODEC, {})
        before = writer.offset
        writer.finish()
        sizes.append(writer.offset - before)
    with mcz.open(sink.getvalue()) as file:
        names = [f"first {n}" for n in range(300)] + [f"more {n}" for n in range(80)]
        assert list(file.clips) == names
        whole = len(build_index(replace(file.container.directory, indexes=())))
    assert not mcz.verify(sink.getvalue())
    assert sorted(sizes)[40] < whole / 4


def test_four_requests_open_a_file_of_many_appends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is taken in for being small, and each INDX lies far from the next one."""
    monkeypatch.setattr(index, "GROWTH", 0)
    monkeypatch.setattr(http, "TAIL", 2000)
    sink, directory = BytesIO(), None
    for number in range(10):
        writer = Writer(sink, directory=directory, offset=len(sink.getvalue()))
        writer.attachment(f"note {number}", np.random.default_rng(number).bytes(5000))
        write_clip(writer, smooth(1, name=f"clip {number}"), raw.CODEC, {})
        writer.finish()
        with mcz.open(sink.getvalue()) as file:
            directory = file.container.directory
    assert len(directory.indexes) == 4
    server = Server(sink.getvalue())
    with serve(server), mcz.open(server.address) as file:
        assert list(file.clips) == [f"clip {number}" for number in range(10)]
        assert len(server.asked) <= 4


def test_a_rewriter_makes_one_index_and_copies_none(tmp_path: Path) -> None:
    path = VECTORS / "container" / "index-continued.mcz"
    with mcz.open(path) as file:
        assert len(file.container.directory.indexes) == 3
    mcz.extract(path, tmp_path / "new.mcz", frames=(0, 1))
    with mcz.open(tmp_path / "new.mcz") as file:
        assert len(file.container.directory.indexes) == 1
        types = [chunk.type for chunk in scan(file.container.source, whole=True).chunks]
    assert types.count(b"INDX") == 1


def test_every_vector_with_an_index_lists_what_its_walk_finds() -> None:
    seen = 0
    for path in sorted((VECTORS / "container").rglob("*.mcz")):
        with mcz.open(path) as file:
            if not file.container.directory.indexes:
                continue
            source = open_source(str(path))
            walked = scan(source).directory
            source.close()
            assert file.container.directory.clips == walked.clips, path.name
            seen += 1
    assert seen > 5
