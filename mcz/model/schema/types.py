"""Types of fields that the format has and construct lacks, as classes of construct.

Numbers, arrays, ``If`` and ``this`` come from construct. Its types that accept malformed bytes are
not used: ``GreedyRange``, ``Enum``, ``Flag``, ``Padding``, ``VarInt``, ``Compressed``. Varints and
raw deflate serve bulk data too. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import chain
from typing import Any, BinaryIO, TypeAlias

import construct
from construct import Construct, Container, Float64l, GreedyBytes, Subconstruct
from construct.core import CodeGen, stream_read, stream_write

from mcz.errors import FormatError, LimitError, TruncatedError

MAX_COUNT = 2**53 - 1  # every count, size and offset; JavaScript's largest exact integer (CONV-01)
ONE_BYTE = [bytes((value,)) for value in range(0x80)]


def varint(value: int) -> bytes:
    """The bytes of ``value``, 0 <= value <= 2^53 - 1."""
    if not 0 <= value <= MAX_COUNT:
        raise LimitError(f"{value} is not between 0 and 2^53 - 1")
    if value < 0x80:
        return ONE_BYTE[value]
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def take_varint(source: Iterable[int], where: str) -> int:
    """The varint at the start of ``source``, which is advanced past it."""
    value = shift = 0
    for byte in source:
        value |= (byte & 0x7F) << shift
        if value > MAX_COUNT or shift > 49:  # 8 bytes hold 56 bits (CONV-03)
            raise FormatError("a varint exceeds 2^53 - 1", where=where)
        if byte < 0x80:
            if byte == 0 and shift:  # CONV-02
                raise FormatError(f"varint {value} is not in its shortest form", where=where)
            return value
        shift += 7  # CONV-04
    raise TruncatedError("a varint extends past the end", where=where)


def read_varint(data: bytes | bytearray | memoryview, at: int) -> tuple[int, int]:
    """The varint at offset ``at`` of ``data`` and the offset after it."""
    if at + 1 < len(data):  # most have one byte or two
        low, high = data[at], data[at + 1]
        if low < 0x80:
            return low, at + 1
        if 0 < high < 0x80:
            return low & 0x7F | high << 7, at + 2
    value = take_varint(data[at : at + 9], f"offset {at}")
    return value, at + max(1, -(-value.bit_length() // 7))  # its form is the shortest


Kind: TypeAlias = "Construct | type"  # a type of construct, or a record


class Varint(construct.Construct):
    """Unsigned, up to ``MAX_COUNT``: 7 bits a byte, least significant first, shortest form."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        first = stream.read(1)
        return first[0] if first and first[0] < 0x80 else _read_long_varint(first, stream, path)

    def _build(self, obj: int, stream: BinaryIO, context: Container, path: str) -> int:
        _write(stream, varint(obj), path)
        return obj


class Exactly(construct.Bytes):
    """So many bytes. A compiled ``Bytes`` would accept fewer at the end of the data."""

    def _emitparse(self, code: CodeGen) -> str:
        code.linkedparsers[id(self)] = self._parse
        return f"linkedparsers[{id(self)}](io, this, '')"


class Sized(construct.Construct):
    """A varint length, then that many bytes."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> bytes:
        first = stream.read(1)
        size = first[0] if first and first[0] < 0x80 else _read_long_varint(first, stream, path)
        data = stream.read(size)
        if len(data) != size:
            raise construct.StreamError(f"{len(data)} of {size} bytes left", path=path)
        return data

    def _build(self, obj: bytes, stream: BinaryIO, context: Container, path: str) -> bytes:
        _write(stream, varint(len(obj)) + bytes(obj), path)
        return obj


class Text(Sized):
    """UTF-8 after a varint length."""

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> str:  # type: ignore[override]
        data = super()._parse(stream, context, path)
        try:
            return data.decode("utf-8")  # CONV-05, CONV-06
        except UnicodeDecodeError as error:
            raise FormatError(f"not UTF-8: {error}", where=field_path(path)) from None

    def _build(  # type: ignore[override]
        self, obj: str, stream: BinaryIO, context: Container, path: str
    ) -> str:
        try:
            super()._build(obj.encode("utf-8"), stream, context, path)
        except UnicodeEncodeError as error:  # half of a surrogate pair
            message = f"{ascii(obj)[:80]} is not UTF-8: {error.reason}"
            raise FormatError(message, where=field_path(path)) from None
        return obj


class Checked(construct.Adapter):
    """A value that passes a test: ``Checked(UVARINT, lambda value: value >= 1)``."""

    def __init__(self, kind: Kind, test: Callable[..., bool]) -> None:
        super().__init__(kind)
        self.test = test

    def _decode(self, obj: object, context: Container, path: str) -> object:
        if not self.test(obj):
            raise construct.ValidationError(f"{obj!r} is not allowed", path=path)
        return obj

    _encode = _decode

    def _emitparse(self, code: CodeGen) -> str:
        code.linkedinstances[id(self)] = self
        value = self.subcon._compileparse(code)
        return f"linkedinstances[{id(self)}]._decode({value}, this, '')"


class CheckedInRecord(Checked):
    """A type with a test of the value and of the earlier fields of its record."""

    def _decode(self, obj: object, context: Container, path: str) -> object:
        if not self.test(obj, context):
            raise construct.ValidationError(f"{obj!r} is not allowed", path=path)
        return obj

    _encode = _decode


class Adapted(construct.Adapter):
    """A value that ``decode`` makes of another one; ``encode`` is its inverse."""

    def __init__(
        self, kind: Kind, decode: Callable[[Any], Any], encode: Callable[[Any], Any]
    ) -> None:
        super().__init__(as_construct(kind))
        self.decode, self.encode = decode, encode

    def _decode(self, obj: object, context: Container, path: str) -> object:
        try:
            return self.decode(obj)
        except FormatError as error:
            raise construct.ValidationError(str(error), path=path) from None

    def _encode(self, obj: object, context: Container, path: str) -> object:
        return self.encode(obj)

    def _emitparse(self, code: CodeGen) -> str:
        code.linkedinstances[id(self)] = self
        return f"linkedinstances[{id(self)}].decode({self.subcon._compileparse(code)})"


class Counted(Subconstruct):
    """A varint count of at most ``most``, then that many items.

    ``kind`` names the items if ``parse`` may limit their total number.
    """

    def __init__(self, item: Kind, most: int = MAX_COUNT, kind: str = "") -> None:
        super().__init__(as_construct(item))
        self.most, self.kind = most, kind

    def count(self, stream: BinaryIO, context: Container, path: str) -> int:
        """Read and check the count."""
        count: int = UVARINT._parse(stream, context, path)
        self._check(count, path)
        left = context._params.get("left", {})
        if count > left.get(self.kind, count):
            raise LimitError(
                f"{self.kind}: {count} exceed the limit, which leaves {left[self.kind]}",
                where=field_path(path),
            )
        if self.kind in left:
            left[self.kind] -= count
        return count

    def _check(self, count: int, path: str) -> None:
        if count > self.most:  # CONV-07
            raise construct.ValidationError(f"{count} exceed the limit of {self.most}", path=path)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> list[object]:
        count = self.count(stream, context, path)
        return [self.subcon._parsereport(stream, context, f"{path} -> {i}") for i in range(count)]

    def _build(
        self, obj: Sequence[object], stream: BinaryIO, context: Container, path: str
    ) -> Sequence[object]:
        self._check(len(obj), path)
        UVARINT._build(len(obj), stream, context, path)
        for index, item in enumerate(obj):
            self.subcon._build(item, stream, context, f"{path} -> {index}")
        return obj

    def _emitparse(self, code: CodeGen) -> str:
        code.linkedinstances[id(self)] = self
        count = f"linkedinstances[{id(self)}].count(io, this, '')"
        return f"[{self.subcon._compileparse(code)} for _ in range({count})]"


class Optional(construct.Adapter):
    """A count of 0 or 1, then that many items: None, or the value."""

    def __init__(self, item: Kind) -> None:
        super().__init__(Counted(item, 1))
        self.flagbuildnone = True

    def _decode(self, obj: list[object], context: Container, path: str) -> object:
        return obj[0] if obj else None

    def _encode(self, obj: object, context: Container, path: str) -> list[object]:
        return [] if obj is None else [obj]

    def _emitparse(self, code: CodeGen) -> str:
        return f"({self.subcon._compileparse(code)} or [None])[0]"


def only_if(condition: object, item: Kind) -> Construct:
    """An item that is present only if the condition holds; otherwise None."""
    return construct.If(condition, as_construct(item))


def one_of(kind: Kind, values: Collection[object]) -> Checked:
    """One of ``values``."""
    return Checked(kind, lambda value: value in values)


def bounded(kind: Kind, least: float, most: float) -> Checked:
    """A number from ``least`` to ``most``, not NaN."""
    return Checked(kind, lambda value: least <= value <= most)


def flags(*names: str, extended: bool = False) -> Checked:
    """One byte of flags, bit 0 first; bits without a name are reserved and must be 0.

    ``extended``: bit 7 means that the structure has an extension.
    """
    known = (1 << len(names)) - 1 | extended * EXTENDED
    return Checked(construct.Int8ul, lambda value: not value & ~known)  # CONV-14


def as_construct(kind: Kind) -> Construct:
    """A construct type, also from a record."""
    return getattr(kind, "construct_type", lambda: kind)()


def field_path(path: str) -> str:
    """The fields on the way to a value, from construct's path: "joints.3.name"."""
    return ".".join(path.split(" -> ")[1:])


def _read_long_varint(first: bytes, stream: BinaryIO, path: str) -> int:
    """A varint of several bytes that begins with ``first``."""
    if not first:
        raise construct.StreamError("0 of 1 bytes left", path=path)
    more = iter(lambda: stream_read(stream, 1, path)[0], None)
    return take_varint(chain(first, more), field_path(path))


def _write(stream: BinaryIO, data: bytes, path: str) -> None:
    stream_write(stream, data, len(data), path)


counted, optional = Counted, Optional  # names of the types in declarations of records
UVARINT = Varint()
SVARINT = Adapted(UVARINT, lambda n: n >> 1 ^ -(n & 1), lambda n: 2 * n if n >= 0 else -2 * n - 1)
SIZED = Sized()
TEXT = Text()
# CONV-10
EXTENSION = GreedyBytes  # the end of an open structure: ignored by readers, kept on rewriting
EXTENDED = 0x80  # flag of a structure with an extension, which is sized
SIZED_EXTENSION = construct.If(construct.this.flags & EXTENDED, SIZED)
FINITE = Checked(Float64l, lambda value: value - value == 0)  # SKEL-08
POSITIVE = Checked(UVARINT, lambda value: value >= 1)


MAX_RATIO = 1032  # raw deflate never inflates by more than this factor


def inflate(data: bytes, size: int, where: str, *, words: bytes = b"") -> bytes:
    """The ``size`` bytes whose raw deflate is ``data``; never uses more memory than ``size`` + 1.

    ``words``: a dictionary that distances may reach back to.
    """
    if size > MAX_RATIO * (len(data) + 1):  # LIMIT-14
        raise LimitError(f"{len(data)} bytes cannot inflate to as many as {size}", where=where)
    inflater = zlib.decompressobj(-15, words)  # CONV-19
    try:
        out = inflater.decompress(data, size + 1)
    except zlib.error as error:
        raise FormatError(str(error), where=where) from None
    if len(out) != size or not inflater.eof or inflater.unused_data:  # CONV-08, CONV-09
        message = f"deflate of {len(data)} bytes does not give {size} bytes"
        raise FormatError(message, where=where)
    return out


def deflate(data: bytes, *, words: bytes = b"") -> bytes:
    """The raw deflate of ``data`` with the dictionary ``words``."""
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15, 9, zlib.Z_DEFAULT_STRATEGY, words)
    return deflater.compress(data) + deflater.flush()
