"""Records: what they read and write, compiled or not, and where bytes are at fault."""

from __future__ import annotations

import io
import struct
from dataclasses import fields, is_dataclass, replace
from typing import Any

import construct
import pytest
from construct import If, Int8ul, this
from hypothesis import example, given
from hypothesis import strategies as st

from mcz import FormatError, LimitError, MczError, TruncatedError
from mcz.model.schema import (
    UVARINT,
    Checked,
    Exactly,
    Record,
    build,
    counted,
    field,
    one_of,
    parse,
    records,
    types,
    varint,
)
from tools.records import empty_context, record_of
from tools.spec_tables import is_record, structures

RECORDS = {name: thing for name, thing in structures().items() if "." in name and is_record(thing)}
TRICKY = (0, 1, 2, 3, 4, 5, 6, 9, 12, 19, 84, 88, 117, 127, 128, 255, 2**14, 2**32, 2**53 - 1)
ALWAYS, NEVER = 0, 2**62  # bytes from which a schema is compiled


def plain(value: Any) -> Any:
    """A value that equals another one of the same bits, of the same type."""
    if is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return struct.pack("<d", value)
    return type(value), value


def draw_bytes(draw: st.DrawFn, type_: Any, context: construct.Container) -> bytes:
    """Bytes of a value that a construct type mostly takes behind the fields ``context``."""
    match type_:
        case construct.Renamed():
            return draw_bytes(draw, type_.subcon, context)
        case records.RecordType():
            inner, parts = empty_context(), []
            for name, item in type_.rows:
                parts.append(draw_bytes(draw, item, inner))
                inner[name] = parse_value(item, parts[-1], inner, 0)
            return b"".join(parts)
        case types.Checked():
            tried = [draw_bytes(draw, type_.subcon, context) for _ in range(8)]
            good = [data for data in tried if parse_value(type_, data, context, None) is not None]
            return draw(st.sampled_from(good or tried))
        case construct.IfThenElse():
            chosen = type_.thensubcon if type_.condfunc(context) else type_.elsesubcon
            return draw_bytes(draw, chosen, context)
        case types.Counted():
            count = draw(st.integers(0, min(type_.most, 3)))
            return varint(count) + b"".join(
                draw_bytes(draw, type_.subcon, context) for _ in range(count)
            )
        case construct.Array():
            return b"".join(draw_bytes(draw, type_.subcon, context) for _ in range(type_.count))
        case types.Varint():
            return varint(draw(st.sampled_from(TRICKY)))
        case construct.FormatField() if type_.length == 1:
            return bytes((draw(st.sampled_from([n for n in TRICKY if n < 256])),))
        case construct.FormatField() if type_.fmtstr[-1] in "fd":
            return struct.pack(type_.fmtstr, draw(st.floats(width=8 * type_.length)))
        case construct.FormatField():
            return draw(st.binary(min_size=type_.length, max_size=type_.length))
        case types.Sized():
            text = draw(st.text(max_size=3)).encode()
            return varint(len(text)) + text
        case construct.Bytes():
            size = size_of(type_, context)
            return draw(st.binary(min_size=size, max_size=size))
        case construct.Adapter():
            return draw_bytes(draw, type_.subcon, context)
    return draw(st.binary(max_size=3)) if type_ is construct.GreedyBytes else b""


def size_of(type_: construct.Bytes, context: construct.Container) -> int:
    """The bytes that a field has behind those of ``context``; of many too few."""
    try:
        size = type_.length(context) if callable(type_.length) else type_.length
    except (MczError, TypeError):
        return 0  # what is before it is at fault
    return int(size) if size < 2**12 else 3


def parse_value(type_: Any, data: bytes, context: construct.Container, otherwise: Any) -> Any:
    """The value of ``data``, ``otherwise`` where it has none."""
    try:
        return type_._parse(io.BytesIO(data), context, "")
    except (MczError, construct.ConstructError):
        return otherwise


@st.composite
def changed_bytes(draw: st.DrawFn) -> tuple[str, bytes]:
    """The name of a record, and bytes: mostly right, cut, with a bit flipped or bytes added."""
    name = draw(st.sampled_from(sorted(RECORDS)))
    data = bytearray(draw_bytes(draw, RECORDS[name].construct_type(), empty_context()))
    how = draw(st.sampled_from(("whole", "whole", "cut", "flipped", "more", "replaced")))
    at = draw(st.integers(0, max(len(data) - 1, 0)))
    if how == "cut":
        del data[at:]
    elif how == "flipped" and data:
        data[at] ^= 1 << draw(st.integers(0, 7))
    elif how == "more":
        data[at:at] = draw(st.binary(min_size=1, max_size=9))
    elif how == "replaced":
        data[at : at + 9] = b"\xff" * draw(st.integers(1, 9))
    return name, bytes(data)


def read(name: str, data: bytes, limits: dict[str, int], compiled_from: int) -> Any:
    """The result of ``parse``: fields, or the kind and the message of an error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(records, "COMPILED_FROM", compiled_from)
        try:
            return plain(parse(RECORDS[name], data, "here", limits))
        except MczError as error:
            assert str(error).startswith("here: ")
            return type(error), str(error)


@given(changed_bytes())
@example(("container.payloads.CEND", b"\x80\x00"))  # a varint with a zero too many
@example(("container.payloads.CEND", b"\xff" * 9))
def test_compiled_schemas_read_the_same(given: tuple[str, bytes]) -> None:
    name, data = given
    for limits in ({}, {"joints": 1, "channels": 2, "runs": 1}):
        assert read(name, data, limits, ALWAYS) == read(name, data, limits, NEVER), name


@given(changed_bytes())
def test_what_is_read_is_written_again(given: tuple[str, bytes]) -> None:
    name, data = given
    try:
        record = parse(RECORDS[name], data, name)
    except FormatError:
        return
    compiled = RECORDS[name].compiled_type().parse_stream(io.BytesIO(data), left={})
    assert plain(compiled) == plain(record)
    again = build(record, name)
    assert plain(parse(RECORDS[name], again, name)) == plain(record)


WRONG = (None, -1, 0, 200, 256, 2**53, 0.5, float("nan"), "a", "\ud800", b"", b"ab", [], [None])


@given(changed_bytes(), st.data())
def test_wrong_values_are_refused_or_read_again(
    given: tuple[str, bytes], data: st.DataObject
) -> None:
    """Any field replaced by a value of another kind."""
    name, content = given
    try:
        record = inner = parse(RECORDS[name], content, name)
    except FormatError:
        return
    while True:
        key = data.draw(st.sampled_from([f.name for f in fields(inner)]))
        value = getattr(inner, key)
        within = value[:1] if isinstance(value, list) else [value]
        if not (within and isinstance(within[0], Record) and data.draw(st.booleans())):
            break
        inner = within[0]
    setattr(inner, key, data.draw(st.sampled_from(WRONG)))
    try:
        written = build(record, "here")
    except FormatError as error:
        assert str(error).startswith("here: ")
        return
    assert build(parse(RECORDS[name], written, name), name) == written


def test_every_record_is_tried() -> None:
    assert len(RECORDS) > 40
    assert set(RECORDS.values()) >= {
        r for r in Record.__subclasses__() if r.__module__[:3] == "mcz"
    }


class Leaf(Record):
    """A leaf of TREE."""

    size: int = field(Checked(UVARINT, lambda value: value > 0), "bytes")


class Tree(Record):
    """A structure with all that structures have."""

    flags: int = field(one_of(Int8ul, (0, 1, 3)), "bit 0: has a label; 1: has a weight")
    label: bytes | None = field(If(this.flags & 1, Exactly(2)), "two letters", default=None)
    weight: list[int] | None = field(If(this.flags == 3, Int8ul[2]), "two bytes", default=None)
    leaves: list[Leaf] = field(counted(Leaf, 2, "leaves"), "at most two", default=[])


def test_fields_are_read() -> None:
    assert parse(Tree, b"\0\0", "tree") == Tree(flags=0)
    full = parse(Tree, b"\3ab\4\5\2\7\x80\1", "tree")
    assert (full.label, full.weight) == (b"ab", [4, 5])
    assert [leaf.size for leaf in full.leaves] == [7, 128]
    assert build(full, "tree") == b"\3ab\4\5\2\7\x80\1"
    assert build(replace(full, label=b"cd"), "tree") == b"\3cd\4\5\2\7\x80\1"


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (b"", TruncatedError, "tree: flags: stream read less than specified amount, expected 1, "),
        (b"\2", FormatError, "tree: flags: 2 is not allowed"),
        (b"\1a", TruncatedError, "tree: label: stream read less than specified amount, expected 2"),
        (b"\0\3", FormatError, "tree: leaves: 3 exceed the limit of 2"),
        (b"\0\2\1\0", FormatError, "tree: leaves.1.size: 0 is not allowed"),
        (b"\0\1\x80", TruncatedError, "tree: leaves.0.size: "),
        (b"\0\0\0\0", FormatError, "tree: 2 bytes follow its end"),
    ],
)
def test_messages_say_where(data: bytes, error: type[MczError], message: str) -> None:
    with pytest.raises(error) as caught:
        parse(Tree, data, "tree")
    assert type(caught.value) is error
    assert str(caught.value).startswith(message)


def test_items_are_counted_before_they_are_read() -> None:
    with pytest.raises(LimitError, match="tree: leaves: leaves: 2 exceed the limit, which leaves"):
        parse(Tree, b"\0\2", "tree", {"leaves": 1})
    assert len(parse(Tree, b"\0\1\1", "tree", {"leaves": 1}).leaves) == 1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"flags": 2}, "tree: flags: 2 is not allowed"),
        ({"flags": 3, "label": b"a"}, "tree: label: bytes object of wrong length, expected 2"),
        ({"flags": 3, "label": b"ab", "weight": [1]}, "tree: weight: expected 2 elements, found 1"),
        ({"flags": 0, "leaves": [{"size": 1}, {"size": 0}]}, "tree: leaves.1.size: 0 is not allow"),
        ({"flags": 0, "leaves": [{"size": 2**53}]}, f"tree: {2**53} is not between"),
        ({"flags": 0, "leaves": [{"size": 1}] * 3}, "tree: leaves: 3 exceed the limit of 2"),
        ({"flags": 0, "leaves": [5]}, "tree: AttributeError: 'int' object has no attribute 'size'"),
    ],
)
def test_what_a_schema_does_not_admit_is_not_built(values: dict[str, Any], message: str) -> None:
    with pytest.raises(FormatError, match=message):
        build(record_of(Tree, values), "tree")
