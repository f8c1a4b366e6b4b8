"""Shared field types and the only doorway to construct.

``parse`` and ``build`` add the end-of-data check, turn every foreign exception into one of ours
and keep the path of the field at fault. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

from construct import (
    Adapter,
    Construct,
    ConstructError,
    Container,
    ExprValidator,
    Float64l,
    GreedyBytes,
    PrefixedArray,
    StreamError,
    Struct,
    Terminated,
    stream_read,
    stream_write,
)

from mcz.errors import FormatError, LimitError, MczError, TruncatedError

MAX_RATIO = 1032  # raw deflate never inflates to more than this times its size
MAX_COUNT = 2**53 - 1  # every count, size and offset; JavaScript's largest exact integer (CONV-01)


class Varint(Construct):
    """Unsigned, up to ``MAX_COUNT``: 7 bits a byte, least significant first, shortest form."""

    def _parse(self, stream: Any, context: Any, path: str) -> int:
        first: int = stream_read(stream, 1, path)[0]
        if first < 0x80:
            return first
        more = iter(lambda: stream_read(stream, 1, path)[0], None)
        return take_varint(chain((first,), more), path)

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:
        _write(stream, varint(obj), path)
        return obj


def _write(stream: Any, data: bytes, path: str) -> None:
    stream_write(stream, data, len(data), path)


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
    """The varint that the bytes of ``source`` begin with; no more of them are taken."""
    value = shift = 0
    for byte in source:
        value |= (byte & 0x7F) << shift
        if value > MAX_COUNT or shift > 49:  # 8 bytes hold 56 bits (CONV-03)
            raise FormatError(f"{where}: varint beyond 2^53 - 1")
        if byte < 0x80:
            if byte == 0 and shift:  # CONV-02
                raise FormatError(f"{where}: varint {value} is not in its shortest form")
            return value
        shift += 7  # CONV-04
    raise TruncatedError(f"{where}: a varint runs past the end")


def read_varint(data: bytes | memoryview, at: int) -> tuple[int, int]:
    """The varint at offset ``at`` of ``data`` and the offset after it."""
    if at + 1 < len(data):  # most have one byte or two
        low, high = data[at], data[at + 1]
        if low < 0x80:
            return low, at + 1
        if 0 < high < 0x80:
            return low & 0x7F | high << 7, at + 2
    value = take_varint(data[at : at + 9], f"offset {at}")
    return value, at + max(1, -(-value.bit_length() // 7))  # its form is the shortest


class _Zigzag(Adapter):
    def _decode(self, obj: int, context: Any, path: str) -> int:
        return (obj >> 1) ^ -(obj & 1)

    def _encode(self, obj: int, context: Any, path: str) -> int:
        return obj << 1 if obj >= 0 else (-obj << 1) - 1


class _Utf8(Adapter):
    def _decode(self, obj: bytes, context: Any, path: str) -> str:
        try:
            return obj.decode("utf-8")  # CONV-05, CONV-06
        except UnicodeDecodeError as error:
            raise FormatError(f"{path}: not UTF-8: {error}") from None

    def _encode(self, obj: str, context: Any, path: str) -> bytes:
        return obj.encode("utf-8")


class Sized(Construct):
    """A varint length, then that many bytes."""

    def _parse(self, stream: Any, context: Any, path: str) -> bytes:
        data: bytes = stream_read(stream, UVARINT._parse(stream, context, path), path)  # CONV-13
        return data

    def _build(self, obj: bytes, stream: Any, context: Any, path: str) -> Any:
        _write(stream, varint(len(obj)) + bytes(obj), path)
        return obj


UVARINT = Varint()
SVARINT = _Zigzag(UVARINT)
SIZED = Sized()
TEXT = _Utf8(SIZED)
AT_MOST_ONE = ExprValidator(UVARINT, lambda obj, ctx: obj <= 1)  # CONV-07
# CONV-10
EXTENSION = GreedyBytes  # the end of an open structure: ignored by readers, kept on rewriting
FINITE = ExprValidator(Float64l, lambda obj, ctx: obj - obj == 0)  # SKEL-08


def optional(item: Construct) -> Construct:
    """A count of 0 or 1, then that many items."""
    return PrefixedArray(AT_MOST_ONE, item)


def counted(item: Construct, most: int = MAX_COUNT, kind: str = "") -> Construct:
    """A varint count of at most ``most``, then that many items.

    ``kind`` names the items where ``parse`` may be told how many there are to be in all.
    """
    count = UVARINT if most == MAX_COUNT else ExprValidator(UVARINT, lambda n, ctx: n <= most)
    if kind:
        count = ExprValidator(count, lambda n, ctx: _take(ctx, kind, n))
    return PrefixedArray(count, item)


def _take(context: Any, kind: str, count: int) -> bool:
    """Take ``count`` off what is left of the items of a kind, before any of them is parsed."""
    left = context._params.get("left") or {}
    if count > left.get(kind, count):
        raise LimitError(f"{kind}: {count} are over the limit, which leaves {left[kind]}")
    if kind in left:
        left[kind] -= count
    return True


def parse(
    schema: Struct, data: bytes, where: str, limits: Mapping[str, int] | None = None
) -> Container:
    """The fields of ``data``, all of which ``schema`` must consume.

    ``limits`` says how many items of some kinds, see ``counted``, there may be in all. Raises
    TruncatedError, LimitError or FormatError; ``where`` opens the message.
    """
    try:
        # CONV-12
        whole = Struct("fields" / schema, Terminated).parse(data, left=dict(limits or {}))
    except MczError as error:
        error.args = (f"{where}: {error}",)
        raise
    except StreamError as error:
        raise TruncatedError(f"{where}: {_plain(error)}") from None
    except (ConstructError, KeyError, IndexError, ValueError, OverflowError, zlib.error) as error:
        raise FormatError(f"{where}: {_plain(error)}") from None
    return whole.fields


def build(schema: Struct, fields: Mapping[str, Any], where: str) -> bytes:
    """The bytes of ``fields``; raises FormatError where ``schema`` does not admit them."""
    try:
        return bytes(schema.build(dict(fields)))
    except MczError as error:
        error.args = (f"{where}: {error}",)
        raise
    except (ConstructError, KeyError, IndexError, ValueError, TypeError, AttributeError) as error:
        raise FormatError(f"{where}: {_plain(error)}") from None


def _plain(error: Exception) -> str:
    """construct's message on one line, without its own indentation."""
    return " ".join(str(error).split()).replace("(parsing) -> ", "") or type(error).__name__


def inflate(data: bytes, size: int, where: str, *, words: bytes = b"") -> bytes:
    """The ``size`` bytes whose raw deflate is ``data``; never more memory than ``size`` + 1.

    ``words``: bytes that distances may reach back to, as if they came before.
    """
    if size > MAX_RATIO * (len(data) + 1):  # LIMIT-14
        raise LimitError(f"{where}: {size} bytes cannot come of {len(data)}")
    inflater = zlib.decompressobj(-15, words)  # CONV-19
    try:
        out = inflater.decompress(data, size + 1)
    except zlib.error as error:
        raise FormatError(f"{where}: {error}") from None
    if len(out) != size or not inflater.eof or inflater.unused_data:  # CONV-08, CONV-09
        raise FormatError(f"{where}: deflate of {len(data)} bytes does not give {size} bytes")
    return out


def deflate(data: bytes, *, words: bytes = b"") -> bytes:
    """The raw deflate of ``data``, which may refer to ``words``."""
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15, 9, zlib.Z_DEFAULT_STRATEGY, words)
    return deflater.compress(data) + deflater.flush()
