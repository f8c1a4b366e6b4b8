"""Records from plain fields, and where a field of a record lies in its bytes.

Vectors and tests write what no writer would: they name fields and give numbers, lists and
mappings, which become the records of ``mcz.model.schema``.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import BytesIO
from typing import Any, TypeVar

import construct
import numpy as np

from mcz.container.encodings import chunk_id, plain_id
from mcz.container.payloads import AFTER_WORDS, ENCODING
from mcz.errors import MczError
from mcz.model.extras import annex_bytes
from mcz.model.schema import EXTENDED, Record, build, read_varint, varint
from mcz.model.schema.columns import Columns, read_column, read_varints
from mcz.model.schema.records import RecordType
from mcz.model.schema.types import Checked, Counted, Exactly, Sized

R = TypeVar("R", bound=Record)


def record_of(kind: type[R], fields: Any) -> R:
    """The record of kind ``kind`` with these fields, mappings for the records within."""
    fields = vars(fields) if isinstance(fields, Record) else fields
    types = {field.name: field.metadata["construct"] for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    return kind(**{name: _value(types[name], value) for name, value in fields.items()})


def _value(type_: Any, value: Any) -> Any:
    """``value`` with records in the place of mappings."""
    if isinstance(value, Mapping | Record):
        while not isinstance(type_, type):
            type_ = type_.record if isinstance(type_, RecordType) else _inner(type_)
        return record_of(type_, value)
    if isinstance(value, list | tuple) and not isinstance(type_, type):
        return [_value(_inner(type_), item) for item in value] if _holds(type_) else value
    return value


def _holds(type_: Any) -> bool:
    """Return whether the type has records within."""
    while not isinstance(type_, RecordType | type):
        if not hasattr(type_, "subcon") and not hasattr(type_, "thensubcon"):
            return False
        type_ = _inner(type_)
    return True


def _inner(type_: Any) -> Any:
    return type_.thensubcon if isinstance(type_, construct.IfThenElse) else type_.subcon


def build_record(kind: type[Record], fields: Any, where: str) -> bytes:
    """The bytes of the record of kind ``kind`` with these fields."""
    return build(record_of(kind, fields), where)


def empty_context() -> construct.Container:
    """The context in which construct reads the fields of a record."""
    states = {"_parsing": True, "_building": False, "_sizing": False}
    return construct.Container(_params=construct.Container(left={}), **states)


def span(kind: Any, payload: bytes, path: str) -> tuple[int, int]:
    """The range in ``payload`` of the field at ``path``, such as "signals.0.codec".

    Parses what lies before it, and raises KeyError where there is none.
    """
    stream, type_ = BytesIO(payload), kind
    start = 0
    names = path.split(".")
    for depth, name in enumerate(names):
        stream.seek(start)
        context = empty_context()
        while not isinstance(type_, type | RecordType | Counted | Columns):
            type_ = _inner(type_)
        if isinstance(type_, Columns):
            return _span_in_columns(type_, payload, start, path, names[depth:])
        if isinstance(type_, Counted):
            count = type_.count(stream, context, "")
            if not int(name) < count:
                raise KeyError(path)
            items = [(str(index), type_.subcon) for index in range(int(name) + 1)]
        else:
            record = type_ if isinstance(type_, RecordType) else type_.construct_type()
            items = record.rows
        for field, inner in items:
            start, type_ = stream.tell(), inner
            if field == name and depth < len(names) - 1:
                break  # it need not be sound
            context[field] = inner._parsereport(stream, context, "")
            if field == name:
                break
        else:
            raise KeyError(path)
    return start, stream.tell()


def _span_in_columns(
    type_: Columns, payload: bytes, start: int, path: str, rest: Sequence[str]
) -> tuple[int, int]:
    """The range of a value in a table by columns: "3.name", or "3.name.size" of its length."""
    count, at = read_varint(payload, start)
    number, wanted, *size = rest
    data = np.frombuffer(payload, np.uint8)
    if int(number) >= count:
        raise KeyError(path)
    for name, kind in type_.rows:
        if name == wanted:
            return _span_in_column(kind, data, at, count, int(number), bool(size))
        _, at = read_column(kind, data, at, count)
    raise KeyError(path)


def _span_in_column(
    kind: Any, data: np.ndarray, at: int, count: int, number: int, is_size: bool
) -> tuple[int, int]:
    while isinstance(kind, Checked):
        kind = kind.subcon
    if kind is construct.Int8ul or isinstance(kind, Exactly):
        size = kind.sizeof()
        return at + number * size, at + (number + 1) * size
    first = read_varints(data, at, number)[1] if number else at
    own = first, read_varints(data, first, 1)[1]
    if not isinstance(kind, Sized) or is_size:
        return own
    sizes, at = read_varints(data, at, count)
    return at + int(sizes[:number].sum()), at + int(sizes[: number + 1].sum())


def extend(kind: Any, payload: bytes, path: str, more: bytes) -> bytes:
    """``payload`` with an extension in the structure at ``path``, which had none."""
    within = f"{path}." if path else ""
    start, stop = span(kind, payload, f"{within}extension")
    at = span(kind, payload, f"{within}flags")[0]
    flags = bytes((payload[at] | EXTENDED,))
    extension = varint(len(more)) + more
    return payload[:at] + flags + payload[at + 1 : start] + extension + payload[stop:]


def id_of(kind: bytes, payload: bytes) -> bytes:
    """The id of a shared chunk; of a faulty one what a lenient reader takes for it."""
    try:
        return chunk_id(kind, payload)
    except MczError:
        with suppress(MczError, IndexError):
            payload = _leniently(payload) if kind == b"SRCE" else payload
        return plain_id(kind, payload)


def _leniently(payload: bytes) -> bytes:
    """A SRCE with its template as far as it can be inflated, whatever is behind it."""
    flags, (_, at) = payload[1], read_varint(payload, 2)
    if not flags & ENCODING:
        return payload
    words = annex_bytes("words.bin") if flags & ENCODING == AFTER_WORDS else b""
    inflater = zlib.decompressobj(-15, zdict=words[-(2**15) :])
    text = b""
    with suppress(zlib.error):
        text = inflater.decompress(payload[at:])
    return payload[:1] + b"\0" + payload[2:at] + text


def update(record: Record, changes: Mapping[str, Any]) -> None:
    """Set fields of a record, mappings standing for the records within."""
    types = {f.name: f.metadata["construct"] for f in dataclasses.fields(record)}  # type: ignore[arg-type]
    for name, value in changes.items():
        setattr(record, name, _value(types[name], value))
