"""What schemas are made of, and how each is read and written.

A field is read from a ``Source``, the bytes of one structure, and written behind the bytes so far.
Conditions and checks may look at the other fields of its structure; where it is read, at those
before it. What it refuses is a FormatError, a TruncatedError where the bytes end too early, whose
``args`` are the places on the way to it, the outermost first, and the message: ``doors`` makes one
line of them. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mcz.errors import FormatError, MczError
from mcz.schema.source import Fields, Source
from mcz.schema.varints import MAX_COUNT, varint

Condition = Callable[[Fields], Any]
Check = Callable[[Any, Fields], bool]
# What a value raises that is none of a field: of another type, too large, not there.
NO_VALUE = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, struct.error)


class Field:
    """A kind of field: a number, bytes, some of another kind, a structure."""

    def read(self, source: Source, fields: Fields) -> Any:
        """Take the next value from ``source``; ``fields`` are those before it."""
        raise NotImplementedError

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        """Add the bytes of ``value`` to ``out``; ``fields`` are those of its structure.

        Raises FormatError, or one of ``NO_VALUE``.
        """
        raise NotImplementedError

    def __rtruediv__(self, name: str) -> Named:
        return Named(name, self)

    def __getitem__(self, count: int) -> Array:
        return Array(self, count)


@dataclass(frozen=True)
class Named:
    """A field of a structure; ``docs``: unit and meaning, as the table of SPEC.md has it."""

    name: str
    item: Field
    docs: str = ""

    def __mul__(self, docs: str) -> Named:
        return replace(self, docs=docs)


class Struct(Field):
    """Fields one after the other."""

    def __init__(self, *fields: Named) -> None:
        self.fields = fields

    def read(self, source: Source, fields: Fields) -> Fields:
        found = Fields()
        for field in self.fields:
            try:
                found[field.name] = field.item.read(source, found)
            except MczError as error:
                _place(error, field.name)
                raise
        return found

    def write(self, value: Mapping[str, Any], out: bytearray, fields: Fields) -> None:
        given = Fields(value)
        for field in self.fields:
            try:
                field.item.write(given[field.name], out, given)
            except MczError as error:
                _place(error, field.name)
                raise
            except NO_VALUE as error:
                raise FormatError(field.name, f"{type(error).__name__}: {error}") from None


class Number(Field):
    """A number of fixed size, in the words of Python's ``struct``."""

    def __init__(self, format: str) -> None:
        self.format = struct.Struct(format)

    def read(self, source: Source, fields: Fields) -> int | float:
        number: int | float = self.format.unpack(source.take(self.format.size))[0]
        return number

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        out += self.format.pack(value)


class Varint(Field):
    """Unsigned, up to ``MAX_COUNT``: 7 bits a byte, least significant first, shortest form."""

    def read(self, source: Source, fields: Fields) -> int:
        return source.varint()

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        out += varint(value)


class Bytes(Field):
    """So many bytes."""

    def __init__(self, size: int) -> None:
        self.size = size

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(self.size)

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        if len(value) != self.size:
            raise FormatError(f"{len(value)} bytes instead of {self.size}")
        out += memoryview(value)


class Sized(Field):
    """A varint length, then that many bytes."""

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(source.varint())

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        out += varint(len(value))
        out += memoryview(value)


class Rest(Field):
    """All bytes to the end."""

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(len(source.data) - source.at)

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        out += memoryview(value)


class Nothing(Field):
    """No bytes, and the value None."""

    def read(self, source: Source, fields: Fields) -> None:
        return None

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        pass


class Array(Field):
    """So many items."""

    def __init__(self, item: Field, count: int) -> None:
        self.item, self.count = item, count

    def read(self, source: Source, fields: Fields) -> list[Any]:
        return _read_items(self.item, self.count, source, fields)

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        if len(value) != self.count:
            raise FormatError(f"{len(value)} instead of {self.count}")
        _write_items(self.item, value, out, fields)


class Counted(Field):
    """A varint count, then that many items: see ``counted`` and ``optional``, its ``word``."""

    def __init__(self, item: Field, most: int, kind: str = "", word: str = "counted") -> None:
        self.item, self.most, self.kind, self.word = item, most, kind, word

    def read(self, source: Source, fields: Fields) -> list[Any]:
        count = source.varint()
        self._check(count)
        if self.kind:
            source.take_items(self.kind, count)
        return _read_items(self.item, count, source, fields)

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        self._check(len(value))
        out += varint(len(value))
        _write_items(self.item, value, out, fields)

    def _check(self, count: int) -> None:
        if count > self.most:  # CONV-07
            raise FormatError(f"{count} are more than {self.most}")


def _read_items(item: Field, count: int, source: Source, fields: Fields) -> list[Any]:
    found: list[Any] = []
    for place in range(count):
        try:
            found.append(item.read(source, fields))
        except MczError as error:
            _place(error, place)
            raise
    return found


def _write_items(item: Field, values: Any, out: bytearray, fields: Fields) -> None:
    for place, value in enumerate(values):
        try:
            item.write(value, out, fields)
        except MczError as error:
            _place(error, place)
            raise


def counted(item: Field, most: int = MAX_COUNT, kind: str = "") -> Counted:
    """A varint count of at most ``most``, then that many items.

    ``kind`` names the items where ``parse`` may be told how many there are to be in all.
    """
    return Counted(item, most, kind)


def optional(item: Field) -> Counted:
    """A count of 0 or 1, then that many items."""
    return Counted(item, 1, word="optional")


class IfThenElse(Field):
    """One field where ``condition`` holds of the fields before, else another."""

    def __init__(self, condition: Condition, item: Field, other: Field) -> None:
        self.condition, self.item, self.other = condition, item, other

    def read(self, source: Source, fields: Fields) -> Any:
        return (self.item if self.condition(fields) else self.other).read(source, fields)

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        (self.item if self.condition(fields) else self.other).write(value, out, fields)


class ExprValidator(Field):
    """A field whose value must pass ``check``, which sees the fields before it, too."""

    def __init__(self, item: Field, check: Check) -> None:
        self.item, self.check = item, check

    def read(self, source: Source, fields: Fields) -> Any:
        value = self.item.read(source, fields)
        self._check(value, fields)
        return value

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        self._check(value, fields)
        self.item.write(value, out, fields)

    def _check(self, value: Any, fields: Fields) -> None:
        if not self.check(value, fields):
            raise FormatError(f"{value!r} is not allowed")


class OneOf(ExprValidator):
    """A field whose value must be one of ``values``."""

    def __init__(self, item: Field, values: Container[Any]) -> None:
        super().__init__(item, lambda value, fields: value in values)
        self.values = values


class Adapter(Field):
    """A field whose value is what ``decode`` makes of that of ``item``; ``encode`` undoes it."""

    def __init__(
        self, item: Field, decode: Callable[[Any], Any], encode: Callable[[Any], Any]
    ) -> None:
        self.item, self.decode, self.encode = item, decode, encode

    def read(self, source: Source, fields: Fields) -> Any:
        return self.decode(self.item.read(source, fields))

    def write(self, value: Any, out: bytearray, fields: Fields) -> None:
        self.item.write(self.encode(value), out, fields)


def _place(error: MczError, place: str | int) -> None:
    """Note that the field at fault is within that at ``place``."""
    error.args = (str(place), *error.args)


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8")  # CONV-05, CONV-06
    except UnicodeDecodeError as error:
        raise FormatError(f"not UTF-8: {error}") from None


def _encoded(text: str) -> bytes:
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:  # half of a surrogate pair
        raise FormatError(f"{ascii(text)[:80]} is not UTF-8: {error.reason}") from None


Pass = Nothing()
GreedyBytes = Rest()
Int8ul, Float32l, Float64l = Number("<B"), Number("<f"), Number("<d")
UVARINT = Varint()
SVARINT = Adapter(UVARINT, lambda n: n >> 1 ^ -(n & 1), lambda n: 2 * n if n >= 0 else -2 * n - 1)
SIZED = Sized()
TEXT = Adapter(SIZED, _text, _encoded)
# CONV-10
EXTENSION = GreedyBytes  # the end of an open structure: ignored by readers, kept on rewriting
FINITE = ExprValidator(Float64l, lambda obj, ctx: obj - obj == 0)  # SKEL-08


def If(condition: Condition, item: Field) -> IfThenElse:  # noqa: N802
    """``item`` where ``condition`` holds, else nothing, and the value None."""
    return IfThenElse(condition, item, Pass)
