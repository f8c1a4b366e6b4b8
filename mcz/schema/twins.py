"""Schemas in the classes of construct, the library: the only module that imports it.

``twin`` makes of a field of ours the same one of construct's, each once::

    from mcz.container.payloads import HEAD
    twin(HEAD).parse(payload).major

Nothing of the package uses it. It gives tests and tools an independent reader and writer of every
schema, and everybody who works with construct its own schemas of the format.
"""

from __future__ import annotations

from functools import cache
from itertools import chain
from typing import Any

import construct
from construct import stream_read, stream_write

from mcz.schema import fields as own
from mcz.schema.source import take_items
from mcz.schema.varints import take_varint, varint


@cache
def twin(field: own.Field) -> Any:
    """``field`` as construct has it."""
    match field:
        case own.Struct():
            return construct.Struct(*(f.name / twin(f.item) * f.docs for f in field.fields))
        case own.Number():
            formats = {"<B": "Int8ul", "<f": "Float32l", "<d": "Float64l"}
            return getattr(construct, formats[field.format.format])
        case own.Varint():
            return _Varint()
        case own.Bytes():
            return construct.Bytes(field.size)
        case own.Sized():
            return _Sized()
        case own.Rest():
            return construct.GreedyBytes
        case own.Nothing():
            return construct.Pass
        case own.Array():
            return construct.Array(field.count, twin(field.item))
        case own.Counted():
            return construct.PrefixedArray(_count(field), twin(field.item))
        case own.IfThenElse():
            return construct.IfThenElse(field.condition, twin(field.item), twin(field.other))
        case own.OneOf():
            return construct.OneOf(twin(field.item), field.values)
        case own.ExprValidator():
            return construct.ExprValidator(twin(field.item), field.check)
        case own.Adapter():
            return _Adapted(field)
    raise TypeError(f"{type(field).__name__} has no twin")


class _Varint(construct.Construct):
    def _parse(self, stream: Any, context: Any, path: str) -> int:
        first: int = stream_read(stream, 1, path)[0]
        more = iter(lambda: stream_read(stream, 1, path)[0], None)
        return take_varint(chain((first,), more), path)

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:
        _write(stream, varint(obj), path)
        return obj


class _Sized(construct.Construct):
    def _parse(self, stream: Any, context: Any, path: str) -> bytes:
        data: bytes = stream_read(stream, _LENGTH._parse(stream, context, path), path)
        return data

    def _build(self, obj: bytes, stream: Any, context: Any, path: str) -> Any:
        _write(stream, varint(len(obj)) + bytes(obj), path)
        return obj


def _write(stream: Any, data: bytes, path: str) -> None:
    stream_write(stream, data, len(data), path)


_LENGTH = _Varint()


def _count(field: own.Counted) -> Any:
    """The count of a counted field, with its bounds."""
    count = construct.ExprValidator(_LENGTH, lambda n, ctx: n <= field.most)
    if not field.kind:
        return count

    def take(n: int, context: Any) -> bool:
        take_items(context._params.get("left") or {}, field.kind, n)
        return True

    return construct.ExprValidator(count, take)


class _Adapted(construct.Adapter):
    def __init__(self, field: own.Adapter) -> None:
        super().__init__(twin(field.item))
        self.field = field

    def _decode(self, obj: Any, context: Any, path: str) -> Any:
        return self.field.decode(obj)

    def _encode(self, obj: Any, context: Any, path: str) -> Any:
        return self.field.encode(obj)
