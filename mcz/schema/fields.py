"""What schemas are made of, and how each is read.

A field is read from a ``Source``, the bytes of one structure. It is given the fields that its
structure has so far, which conditions and checks may look at. What it refuses is a FormatError, a
TruncatedError where the bytes end too early, whose ``args`` are the places on the way to it, the
outermost first, and the message. ``parse`` makes one line of them. SPEC.md, "Conventions", is
normative.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mcz.errors import FormatError, LimitError, MczError, TruncatedError
from mcz.schema.varints import MAX_COUNT, read_varint


class Fields(dict[str, Any]):
    """The fields of a structure by name, which are attributes, too."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None


Condition = Callable[[Fields], Any]
Check = Callable[[Any, Fields], bool]


class Source:
    """The bytes of a structure, ``at`` the next one.

    ``left``: how many items of some kinds there may still be, see ``counted``.
    """

    __slots__ = ("at", "data", "left")

    def __init__(self, data: bytes, left: dict[str, int]) -> None:
        self.data, self.at, self.left = data, 0, left

    def take(self, size: int) -> bytes:
        """The next ``size`` bytes."""
        stop = self.at + size
        if stop > len(self.data):  # CONV-13
            raise TruncatedError(f"{len(self.data) - self.at} of {size} bytes left")
        taken = self.data[self.at : stop]
        self.at = stop
        return taken

    def varint(self) -> int:
        value, self.at = read_varint(self.data, self.at)
        return value

    def take_items(self, kind: str, count: int) -> None:
        """Take ``count`` off what is left of a kind, before any of these items is read."""
        take_items(self.left, kind, count)


def take_items(left: dict[str, int], kind: str, count: int) -> None:
    if count > left.get(kind, count):
        raise LimitError(f"{kind}: {count} are over the limit, which leaves {left[kind]}")
    if kind in left:
        left[kind] -= count


def parse(
    schema: Struct, data: bytes, where: str, limits: Mapping[str, int] | None = None
) -> Fields:
    """The fields of ``data``, all of which ``schema`` must consume.

    ``limits`` says how many items of some kinds, see ``counted``, there may be in all. Raises
    TruncatedError, LimitError or FormatError; ``where`` opens the message.
    """
    source = Source(bytes(data), dict(limits or {}))
    try:
        fields = schema.read(source, Fields())
        if source.at < len(source.data):  # CONV-12
            raise FormatError(f"{len(source.data) - source.at} bytes behind its end")
    except MczError as error:
        *places, message = error.args
        error.args = (": ".join(filter(None, (where, ".".join(places), message))),)
        raise
    return fields


class Field:
    """A kind of field: a number, bytes, some of another kind, a structure."""

    def read(self, source: Source, fields: Fields) -> Any:
        """Take the next value from ``source``; ``fields`` are those before it."""
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
                error.args = (field.name, *error.args)
                raise
        return found


class Number(Field):
    """A number of fixed size, in the words of Python's ``struct``."""

    def __init__(self, format: str) -> None:
        self.format = struct.Struct(format)

    def read(self, source: Source, fields: Fields) -> int | float:
        number: int | float = self.format.unpack(source.take(self.format.size))[0]
        return number


class Varint(Field):
    """Unsigned, up to ``MAX_COUNT``: 7 bits a byte, least significant first, shortest form."""

    def read(self, source: Source, fields: Fields) -> int:
        return source.varint()


class Bytes(Field):
    """So many bytes."""

    def __init__(self, size: int) -> None:
        self.size = size

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(self.size)


class Sized(Field):
    """A varint length, then that many bytes."""

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(source.varint())


class Rest(Field):
    """All bytes to the end."""

    def read(self, source: Source, fields: Fields) -> bytes:
        return source.take(len(source.data) - source.at)


class Nothing(Field):
    """No bytes, and the value None."""

    def read(self, source: Source, fields: Fields) -> None:
        return None


class Array(Field):
    """So many items."""

    def __init__(self, item: Field, count: int) -> None:
        self.item, self.count = item, count

    def read(self, source: Source, fields: Fields) -> list[Any]:
        return _items(self.item, self.count, source, fields)


class Counted(Field):
    """A varint count, then that many items: see ``counted`` and ``optional``, its ``word``."""

    def __init__(self, item: Field, most: int, kind: str = "", word: str = "counted") -> None:
        self.item, self.most, self.kind, self.word = item, most, kind, word

    def read(self, source: Source, fields: Fields) -> list[Any]:
        count = source.varint()
        if count > self.most:
            raise FormatError(f"{count} are more than {self.most}")
        if self.kind:
            source.take_items(self.kind, count)
        return _items(self.item, count, source, fields)


def _items(item: Field, count: int, source: Source, fields: Fields) -> list[Any]:
    found: list[Any] = []
    for place in range(count):
        try:
            found.append(item.read(source, fields))
        except MczError as error:
            error.args = (str(place), *error.args)
            raise
    return found


def counted(item: Field, most: int = MAX_COUNT, kind: str = "") -> Counted:
    """A varint count of at most ``most``, then that many items.

    ``kind`` names the items where ``parse`` may be told how many there are to be in all.
    """
    return Counted(item, most, kind)


def optional(item: Field) -> Counted:
    """A count of 0 or 1, then that many items."""
    return Counted(item, 1, word="optional")  # CONV-07


class IfThenElse(Field):
    """One field where ``condition`` holds of the fields before, else another."""

    def __init__(self, condition: Condition, item: Field, other: Field) -> None:
        self.condition, self.item, self.other = condition, item, other

    def read(self, source: Source, fields: Fields) -> Any:
        return (self.item if self.condition(fields) else self.other).read(source, fields)


class ExprValidator(Field):
    """A field whose value must pass ``check``, which sees the fields before it, too."""

    def __init__(self, item: Field, check: Check) -> None:
        self.item, self.check = item, check

    def read(self, source: Source, fields: Fields) -> Any:
        value = self.item.read(source, fields)
        if not self.check(value, fields):
            raise FormatError(f"{value!r} is not allowed")
        return value


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


class Term:
    """What ``this.name`` is: a condition that looks at the field ``name``."""

    def __init__(self, of: Condition) -> None:
        self.of = of

    def __call__(self, fields: Fields) -> Any:
        return self.of(fields)

    def __and__(self, bits: int) -> Term:
        return Term(lambda fields: self.of(fields) & bits)

    def __eq__(self, value: object) -> Term:  # type: ignore[override]
        return Term(lambda fields: self.of(fields) == value)

    __hash__ = object.__hash__


class This:
    """The structure whose fields a condition looks at: ``this.flags & 1``, ``this.kind == 3``."""

    def __getattr__(self, name: str) -> Term:
        return Term(lambda fields: fields[name])


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8")  # CONV-05, CONV-06
    except UnicodeDecodeError as error:
        raise FormatError(f"not UTF-8: {error}") from None


this = This()
Pass = Nothing()
GreedyBytes = Rest()
Int8ul, Float32l, Float64l = Number("<B"), Number("<f"), Number("<d")
UVARINT = Varint()
SVARINT = Adapter(UVARINT, lambda n: n >> 1 ^ -(n & 1), lambda n: 2 * n if n >= 0 else -2 * n - 1)
SIZED = Sized()
TEXT = Adapter(SIZED, _text, str.encode)
# CONV-10
EXTENSION = GreedyBytes  # the end of an open structure: ignored by readers, kept on rewriting
FINITE = ExprValidator(Float64l, lambda obj, ctx: obj - obj == 0)  # SKEL-08


def If(condition: Condition, item: Field) -> IfThenElse:  # noqa: N802
    """``item`` where ``condition`` holds, else nothing, and the value None."""
    return IfThenElse(condition, item, Pass)
