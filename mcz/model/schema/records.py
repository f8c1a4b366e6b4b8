"""Records: every structure of the format, declared once, as a dataclass over a construct schema.

::

    class Head(Record):
        "HEAD, the first chunk."

        major: int = field(Int8ul, "format version of the writer, major")
        extension: bytes = field(EXTENSION, "ignored, kept", default=b"")

    parse(Head, payload, "HEAD").major
    build(Head(major=1), "HEAD")

The annotation is the type of the value; the first argument of ``field`` is how construct
reads and writes it, with its bounds; the second is its meaning in the table of SPEC.md. ``parse``
and ``build`` are the only calls of construct: its errors become errors of ours that name the
field and the value. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from itertools import takewhile
from typing import Any, TypeVar, cast, dataclass_transform

import construct
from construct.core import CodeGen

from mcz.errors import FormatError, MczError, TruncatedError
from mcz.model.schema.types import CheckedInRecord, Exactly, Kind, as_construct, field_path

COMPILED_FROM = 4096  # bytes that repay compiling a schema, some milliseconds
MOST_KNOWN, MOST_BYTES = 256, 65536  # ends of records that ``parse_shared`` keeps, bytes of each
# Errors for values of a wrong type, too large or missing.
NO_VALUE = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, struct.error)


def field(kind: Kind, docs: str, *, default: Any = dataclasses.MISSING) -> Any:
    """A field of a record: its construct type, and its meaning, with units and bounds.

    ``kind`` may be a record, too.
    """
    metadata = {"construct": kind, "docs": docs}
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclass_transform(kw_only_default=True, field_specifiers=(field,))
class Record:
    """A structure of the format; its subclass has its fields, given by keyword."""

    def __init_subclass__(cls) -> None:
        dataclasses.dataclass(kw_only=True)(cls)

    @classmethod
    @cache
    def construct_type(cls, before: str | None = None) -> RecordType:
        """The construct type of the record, or of its fields before ``before`` alone."""
        return RecordType(cls, before)

    @classmethod
    @cache
    def compiled_type(cls, before: str | None = None) -> construct.Construct:
        """The compiled type: faster, but its errors do not name the field."""
        return RecordType(cls, before).compile()


R = TypeVar("R", bound=Record)
T = TypeVar("T")


class RecordType(construct.Adapter):
    """Construct's Struct of the fields of ``record``, with records as values."""

    def __init__(self, record: type[Record], before: str | None = None) -> None:
        self.record, self.is_whole = record, before is None
        rows = [(f.name, as_construct(f.metadata["construct"])) for f in _fields(record)]
        self.rows = list(takewhile(lambda row: row[0] != before, rows))
        super().__init__(construct.Struct(*(name / item for name, item in self.rows)))

    def make_record(self, **values: object) -> Record:
        """The record of these values; a partial record lacks its other fields."""
        if self.is_whole:
            return self.record(**values)
        record = object.__new__(self.record)
        vars(record).update(values)
        return record

    def _decode(self, obj: construct.Container, context: construct.Container, path: str) -> Record:
        return self.make_record(**{name: obj[name] for name, _ in self.rows})

    def _encode(self, obj: Record, context: construct.Container, path: str) -> dict[str, object]:
        return {name: getattr(obj, name) for name, _ in self.rows}

    def _emitparse(self, code: CodeGen) -> str:
        """Emit a function that reads the fields, with a context of its own if needed."""
        code.linkedinstances[id(self)] = self.record if self.is_whole else self.make_record
        lines = [f"def parse_{id(self)}(io, this):"]
        has_context = any(_looks_back(item) for _, item in self.rows)
        if has_context:
            lines.append("    states = dict(_parsing=True, _building=False, _sizing=False)")
            lines.append("    this = Container(_=this, _params=this['_params'], **states)")
        for name, item in self.rows:
            assignment = f"{name} = this[{name!r}]" if has_context else name
            lines.append(f"    {assignment} = {item._compileparse(code)}")
        names = ", ".join(f"{name}={name}" for name, _ in self.rows)
        lines.append(f"    return linkedinstances[{id(self)}]({names})")
        code.append("\n".join(lines))
        return f"parse_{id(self)}(io, this)"


def _looks_back(item: construct.Construct) -> bool:
    if isinstance(item, Exactly):
        return callable(item.length)
    return isinstance(item, construct.IfThenElse | CheckedInRecord)


def parse(record: type[R], data: bytes, where: str, limits: Mapping[str, int] | None = None) -> R:
    """The record of ``data``, all of which it must consume.

    ``limits``: greatest total numbers of items of some kinds, see ``Counted``. Raises
    TruncatedError, LimitError or FormatError; ``where`` opens the message.
    """

    def read(schema: construct.Construct) -> R:
        stream = BytesIO(data)
        result = schema.parse_stream(stream, left=dict(limits or {}))
        if stream.tell() < len(data):  # CONV-12
            raise FormatError(f"{len(data) - stream.tell()} bytes follow its end")
        return cast(R, result)

    return _read(read, record, where, compiled=len(data) >= COMPILED_FROM)


def parse_until(record: type[R], data: bytes, where: str, before: str) -> R:
    """The record of ``data`` with the fields before ``before`` alone; the others are missing.

    For a quick pass over many records. Raises as ``parse``.
    """

    def read(schema: construct.Construct) -> R:
        return cast(R, schema.parse_stream(BytesIO(data)))

    return _read(read, record, where, before=before, compiled=True)


_shared: dict[tuple[type[Record], bytes], dict[str, object]] = {}


def parse_shared(record: type[R], data: bytes, where: str, before: str) -> R:
    """``parse``, for many records that are alike from the field ``before`` on.

    These fields, which must not depend on those before them, are parsed once for equal bytes.
    Records share them: they are read-only.
    """
    stream = BytesIO(data)
    try:
        head = record.compiled_type(before).parse_stream(stream, left={})
    except (MczError, construct.ConstructError, *NO_VALUE):
        return parse(record, data, where)
    rest = record, data[stream.tell() :]
    tail = _shared.get(rest)
    if tail is None:
        whole = parse(record, data, where)
        tail = {name: value for name, value in vars(whole).items() if name not in vars(head)}
        if len(_shared) >= MOST_KNOWN:
            _shared.clear()
        if len(rest[1]) <= MOST_BYTES:
            _shared[rest] = tail
    vars(head).update(tail)
    return cast(R, head)


def parse_all(record: type[R], data: bytes, where: str) -> list[R]:
    """The records that ``data`` consists of; raises as ``parse``."""

    def read(schema: construct.Construct) -> list[R]:
        stream, result = BytesIO(data), []
        while stream.tell() < len(data):
            result.append(schema.parse_stream(stream))
        return result

    return _read(read, record, where, compiled=len(data) >= COMPILED_FROM)


def _read(
    read: Callable[[construct.Construct], T],
    record: type[Record],
    where: str,
    *,
    before: str | None = None,
    compiled: bool,
) -> T:
    """Read with the compiled schema, if asked to, and with the plain one if that fails."""
    if compiled:
        try:
            return read(record.compiled_type(before))
        except (MczError, construct.ConstructError, *NO_VALUE):
            pass  # errors of the plain one name the field
    with _our_errors(where):
        return read(record.construct_type(before))


def build(record: Record, where: str) -> bytes:
    """The bytes of ``record``; raises FormatError if its schema does not admit a value."""
    with _our_errors(where):
        return bytes(record.construct_type().build(record))


@contextmanager
def _our_errors(where: str) -> Iterator[None]:
    """Turn errors of construct into ours, which name the faulty field."""
    try:
        yield
    except construct.StreamError as error:  # CONV-13
        raise TruncatedError(_message(error), where=_place(where, error)) from None
    except construct.ConstructError as error:
        raise FormatError(_message(error), where=_place(where, error)) from None
    except MczError as error:
        error.add(where=where)
        raise
    except NO_VALUE as error:
        raise FormatError(f"{type(error).__name__}: {error}", where=where) from None


def _message(error: construct.ConstructError) -> str:
    return str(error).partition("\n")[2] or str(error)


def _place(where: str, error: construct.ConstructError) -> str:
    return ": ".join(filter(None, (where, field_path(error.path or ""))))


def _fields(record: type[Record]) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(record)  # type: ignore[arg-type]  # __init_subclass__ made it one
