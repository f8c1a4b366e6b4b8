"""Records: every structure of the format, declared once, as a dataclass over a construct schema.

::

    class Head(Record):
        "HEAD, the first chunk."

        major: int = field(Int8ul, "format version of the writer, major")
        extension: bytes = field(EXTENSION, "ignored, kept", default=b"")

    parse(Head, payload, "HEAD").major
    build(Head(major=1), "HEAD")

The type after the colon is that of the value; the first argument of ``field`` is how construct
reads and writes it, with its bounds; the second is its meaning in the table of SPEC.md. ``parse``
and ``build`` are the one door to construct: what it refuses becomes an error of ours that names
the field and the value. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Mapping
from functools import cache
from io import BytesIO
from typing import Any, TypeVar, cast, dataclass_transform

import construct

from mcz.errors import FormatError, MczError, TruncatedError
from mcz.schema.types import as_construct, field_path

COMPILED_FROM = 4096  # bytes from which a schema is worth compiling, some milliseconds
# What a value raises that is none of a field: of another type, too large, not there.
NO_VALUE = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, struct.error)


def field(kind: Any, docs: str, *, default: Any = dataclasses.MISSING) -> Any:
    """A field of a record: its construct type, and its meaning, with units and bounds.

    ``kind`` may be a record, too.
    """
    metadata = {"construct": kind, "docs": docs}
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclass_transform(kw_only_default=True, field_specifiers=(field,))
class Record:
    """A structure of the format; its fields are those of its subclass, given by keyword."""

    def __init_subclass__(cls) -> None:
        dataclasses.dataclass(kw_only=True)(cls)

    @classmethod
    @cache
    def construct_type(cls) -> RecordType:
        """The construct type that reads and writes the record."""
        return RecordType(cls)

    @classmethod
    @cache
    def compiled_type(cls) -> construct.Construct:
        """The same, compiled: it reads faster, and does not know which field is at fault."""
        return cls.construct_type().compile()


R = TypeVar("R", bound=Record)


class RecordType(construct.Adapter):
    """Construct's Struct of the fields of ``record``, whose values are records."""

    def __init__(self, record: type[Record]) -> None:
        self.record = record
        self.rows = [(f.name, as_construct(f.metadata["construct"])) for f in _fields(record)]
        super().__init__(construct.Struct(*(name / item for name, item in self.rows)))

    def _decode(self, obj: Any, context: Any, path: str) -> Record:
        return self.record(**{name: obj[name] for name, _ in self.rows})

    def _encode(self, obj: Record, context: Any, path: str) -> dict[str, Any]:
        return {name: getattr(obj, name) for name, _ in self.rows}

    def _emitparse(self, code: Any) -> str:
        """Emit a function that reads the fields without a container for each record."""
        code.linkedinstances[id(self)] = self
        lines = [
            f"    {name} = this[{name!r}] = {item._compileparse(code)}" for name, item in self.rows
        ]
        names = ", ".join(f"{name}={name}" for name, _ in self.rows)
        code.append(
            "\n".join(
                [
                    f"def parse_{id(self)}(io, this):",
                    "    states = dict(_parsing=True, _building=False, _sizing=False)",
                    "    this = Container(_=this, _params=this['_params'], **states)",
                    *lines,
                    f"    return linkedinstances[{id(self)}].record({names})",
                ]
            )
        )
        return f"parse_{id(self)}(io, this)"


def parse(record: type[R], data: bytes, where: str, limits: Mapping[str, int] | None = None) -> R:
    """The record of ``data``, all of which it must consume.

    ``limits`` says how many items of some kinds, see ``Counted``, there may be in all. Raises
    TruncatedError, LimitError or FormatError; ``where`` opens the message.
    """
    if len(data) >= COMPILED_FROM:
        try:
            return cast(R, _parsed(record.compiled_type(), data, limits))
        except (MczError, construct.ConstructError, *NO_VALUE):
            pass  # the plain schema, which knows the place, says what is at fault
    try:
        return cast(R, _parsed(record.construct_type(), data, limits))
    except construct.StreamError as error:  # CONV-13
        raise TruncatedError(_message(error), where=_place(where, error)) from None
    except construct.ConstructError as error:
        raise FormatError(_message(error), where=_place(where, error)) from None
    except MczError as error:
        error.add(where=where)
        raise


def _parsed(schema: Any, data: bytes, limits: Mapping[str, int] | None) -> Any:
    stream = BytesIO(data)
    record = schema.parse_stream(stream, left=dict(limits or {}))
    if stream.tell() < len(data):  # CONV-12
        raise FormatError(f"{len(data) - stream.tell()} bytes behind its end")
    return record


def build(record: Record, where: str) -> bytes:
    """The bytes of ``record``; raises FormatError where its schema does not admit a value."""
    try:
        data: bytes = record.construct_type().build(record)
    except construct.ConstructError as error:
        raise FormatError(_message(error), where=_place(where, error)) from None
    except MczError as error:
        error.add(where=where)
        raise
    except NO_VALUE as error:
        raise FormatError(f"{type(error).__name__}: {error}", where=where) from None
    return data


def _message(error: construct.ConstructError) -> str:
    return str(error).partition("\n")[2] or str(error)


def _place(where: str, error: construct.ConstructError) -> str:
    return ": ".join(filter(None, (where, field_path(error.path or ""))))


def docs_of(record: type[Record]) -> list[tuple[str, Any, str]]:
    """Name, construct type and meaning of each field, as the table of SPEC.md has them."""
    return [(f.name, f.metadata["construct"], f.metadata["docs"]) for f in _fields(record)]


def _fields(record: type[Record]) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(record)  # type: ignore[arg-type]  # __init_subclass__ made it one
