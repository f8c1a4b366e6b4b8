"""Schemas: our own reading of them agrees with construct's, and says where bytes are at fault."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import construct
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mcz.container import payloads
from mcz.errors import FormatError, LimitError, MczError, TruncatedError
from mcz.schema import (
    UVARINT,
    Bytes,
    Field,
    Fields,
    If,
    IfThenElse,
    Int8ul,
    OneOf,
    Pass,
    Struct,
    build,
    counted,
    parse,
    this,
    varint,
)
from mcz.schema import fields as own
from mcz.schema.source import Source
from mcz.schema.twins import twin
from tools.spec_tables import structures

SCHEMAS = {
    name: schema
    for name, schema in structures().items()
    if "." in name and isinstance(schema, Struct)
}
TRICKY = (0, 1, 2, 3, 4, 5, 6, 9, 12, 19, 84, 88, 117, 127, 128, 255, 2**14, 2**32, 2**53 - 1)


def by_construct(schema: Struct, data: bytes, limits: Mapping[str, int]) -> Any:
    """What ``parse`` gives, as construct has it: the fields, or the kind of error."""
    whole = construct.Struct("fields" / twin(schema), construct.Terminated)
    try:
        return plain(whole.parse(data, left=dict(limits)).fields)
    except MczError as error:
        return type(error)
    except construct.StreamError:
        return TruncatedError
    except construct.ConstructError:
        return FormatError


def by_ourselves(schema: Struct, data: bytes, limits: Mapping[str, int]) -> Any:
    try:
        return plain(parse(schema, data, "here", limits))
    except MczError as error:
        assert str(error).startswith("here: ")
        return type(error)


def plain(value: Any) -> Any:
    """A value that equals another one of the same bits, of the same type."""
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items() if name != "_io"}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return struct.pack("<d", value)
    return type(value), value


def drawn(draw: st.DrawFn, field: Field, fields: Fields) -> bytes:
    """Bytes of a value that ``field`` mostly takes behind ``fields``, which get it by its name."""
    match field:
        case own.Struct():
            inner, parts = Fields(), []
            for named in field.fields:
                parts.append(drawn(draw, named.item, inner))
                try:
                    inner[named.name] = named.item.read(Source(parts[-1], {}), inner)
                except MczError:
                    inner[named.name] = 0
            return b"".join(parts)
        case own.ExprValidator():
            tried = [drawn(draw, field.item, fields) for _ in range(8)]
            taken = [data for data in tried if takes(field, data, fields)]
            return draw(st.sampled_from(taken or tried))
        case own.Adapter():
            return drawn(draw, field.item, fields)
        case own.IfThenElse():
            return drawn(draw, field.item if field.condition(fields) else field.other, fields)
        case own.Counted():
            count = draw(st.integers(0, min(field.most, 3)))
            return varint(count) + b"".join(drawn(draw, field.item, fields) for _ in range(count))
        case own.Array():
            return b"".join(drawn(draw, field.item, fields) for _ in range(field.count))
        case own.Varint():
            return varint(draw(st.sampled_from(TRICKY)))
        case own.Number() if field.format.size == 1:
            return bytes((draw(st.sampled_from([n for n in TRICKY if n < 256])),))
        case own.Number():
            return field.format.pack(draw(st.floats(width=8 * field.format.size)))
        case own.Sized():
            text = draw(st.text(max_size=3)).encode()
            return varint(len(text)) + text
        case own.Bytes():
            return draw(st.binary(min_size=field.size, max_size=field.size))
        case own.Rest():
            return draw(st.binary(max_size=3))
    return b""


def takes(field: Field, data: bytes, fields: Fields) -> bool:
    try:
        field.read(Source(data, {}), fields)
    except MczError:
        return False
    return True


@st.composite
def changed_bytes(draw: st.DrawFn) -> tuple[str, bytes]:
    """The name of a schema, and bytes: mostly right, cut, with a bit flipped or bytes added."""
    name = draw(st.sampled_from(sorted(SCHEMAS)))
    data = bytearray(drawn(draw, SCHEMAS[name], Fields()))
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


@given(changed_bytes())
@example(("container.payloads.CEND", b"\x80\x00"))  # a varint with a zero too many
@example(("container.payloads.CEND", b"\xff" * 9))
def test_reading_agrees_with_construct(given: tuple[str, bytes]) -> None:
    name, data = given
    for limits in ({}, {"joints": 1, "channels": 2, "runs": 1}):
        ours = by_ourselves(SCHEMAS[name], data, limits)
        assert ours == by_construct(SCHEMAS[name], data, limits), name


def built(schema: Struct, fields: Any) -> bytes | type[MczError]:
    try:
        return build(schema, fields, "here")
    except MczError as error:
        assert str(error).startswith("here: ")
        return type(error)


def built_by_construct(schema: Struct, fields: Any) -> bytes | type[MczError]:
    try:
        return bytes(twin(schema).build(dict(fields)))
    except MczError as error:
        return type(error)
    except (construct.ConstructError, KeyError, ValueError, TypeError, AttributeError):
        return FormatError


@given(changed_bytes())
def test_writing_agrees_with_construct(given: tuple[str, bytes]) -> None:
    """Fields that were read give the bytes that construct makes of them, and are read again."""
    name, data = given
    try:
        fields = parse(SCHEMAS[name], data, name)
    except FormatError:
        return
    again = built(SCHEMAS[name], fields)
    assert again == built_by_construct(SCHEMAS[name], fields)
    assert isinstance(again, bytes)
    assert plain(parse(SCHEMAS[name], again, name)) == plain(fields)


WRONG = (
    None,
    -1,
    0,
    1,
    2,
    7,
    200,
    255,
    256,
    2**53,
    0.5,
    float("nan"),
    "a",
    "\ud800",
    b"",
    b"ab",
    [],
)


@given(changed_bytes(), st.data())
def test_values_that_construct_refuses_are_refused(
    given: tuple[str, bytes], data: st.DataObject
) -> None:
    """Any field replaced by a value of another kind, or left out."""
    name, content = given
    try:
        fields = inner = parse(SCHEMAS[name], content, name)
    except FormatError:
        return
    while True:
        key = data.draw(st.sampled_from(sorted(inner)))
        within = inner[key][:1] if isinstance(inner[key], list) else [inner[key]]
        if not (within and isinstance(within[0], dict) and data.draw(st.booleans())):
            break
        inner = within[0]
    if data.draw(st.booleans()):
        del inner[key]
    else:
        wrong = [v for v in WRONG if not (isinstance(v, int) and isinstance(inner[key], bytes))]
        inner[key] = data.draw(st.sampled_from(wrong))  # construct makes bytes of integers
    assert built(SCHEMAS[name], fields) == built_by_construct(SCHEMAS[name], fields), (name, key)


def test_every_schema_is_tried() -> None:
    assert len(SCHEMAS) > 40
    assert all(schema in SCHEMAS.values() for schema in own_structures(payloads))


def own_structures(module: object) -> list[Struct]:
    return [thing for thing in vars(module).values() if isinstance(thing, Struct)]


TREE = Struct(
    "flags" / OneOf(Int8ul, (0, 1, 3)) * "bit 0: has a label; 1: has a weight",
    "label" / If(this.flags & 1, Bytes(2)) * "two letters",
    "weight" / IfThenElse(this.flags == 3, Int8ul[2], Pass) * "two bytes",
    "leaves"
    / counted(Struct("size" / own.ExprValidator(UVARINT, lambda n, ctx: n > 0)), 2, "leaves")
    * "at most two",
)


def test_fields_are_read() -> None:
    assert parse(TREE, b"\0\0", "tree") == {
        "flags": 0, "label": None, "weight": None, "leaves": []
    }  # fmt: skip
    full = parse(TREE, b"\3ab\4\5\2\7\x80\1", "tree")
    assert (full.label, full.weight) == (b"ab", [4, 5])
    assert [leaf.size for leaf in full.leaves] == [7, 128]
    assert build(TREE, full, "tree") == b"\3ab\4\5\2\7\x80\1"
    with pytest.raises(AttributeError, match="root"):
        full.root  # noqa: B018
    full.label = b"cd"
    assert build(TREE, full, "tree") == b"\3cd\4\5\2\7\x80\1"
    assert [(field.name, field.docs) for field in TREE.fields][-1] == ("leaves", "at most two")


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (b"", TruncatedError, "tree: flags: 0 of 1 bytes left"),
        (b"\2", FormatError, "tree: flags: 2 is not allowed"),
        (b"\1a", TruncatedError, "tree: label: 1 of 2 bytes left"),
        (b"\3ab\4", TruncatedError, "tree: weight.1: 0 of 1 bytes left"),
        (b"\0\3", FormatError, "tree: leaves: 3 are more than 2"),
        (b"\0\2\1\0", FormatError, "tree: leaves.1.size: 0 is not allowed"),
        (b"\0\1\x80", TruncatedError, "tree: leaves.0.size: offset 2: a varint runs past the end"),
        (b"\0\0\0\0", FormatError, "tree: 2 bytes behind its end"),
    ],
)
def test_messages_say_where(data: bytes, error: type[MczError], message: str) -> None:
    with pytest.raises(error) as caught:
        parse(TREE, data, "tree")
    assert type(caught.value) is error
    assert str(caught.value) == message


def test_items_are_counted_before_they_are_read() -> None:
    with pytest.raises(LimitError, match="tree: leaves: leaves: 2 are over the limit, which leave"):
        parse(TREE, b"\0\2", "tree", {"leaves": 1})
    assert len(parse(TREE, b"\0\1\1", "tree", {"leaves": 1}).leaves) == 1


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "tree: flags: KeyError: 'flags'"),
        ({"flags": 2}, "tree: flags: 2 is not allowed"),
        ({"flags": 3, "label": b"a"}, "tree: label: 1 bytes instead of 2"),
        ({"flags": 3, "label": b"ab", "weight": [1]}, "tree: weight: 1 instead of 2"),
        ({"flags": 0, "leaves": [{"size": 1}, {"size": 0}]}, "tree: leaves.1.size: 0 is not allow"),
        ({"flags": 0, "leaves": [{"size": 2**53}]}, f"tree: leaves.0.size: {2**53} is not between"),
        ({"flags": 0, "leaves": [{"size": 1}] * 3}, "tree: leaves: 3 are more than 2"),
        ({"flags": 0, "leaves": [5]}, "tree: leaves: TypeError: 'int' object is not iterable"),
    ],
)
def test_what_a_schema_does_not_admit_is_not_built(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(FormatError, match=message):
        build(TREE, {"label": None, "weight": None, "leaves": [], **fields}, "tree")
