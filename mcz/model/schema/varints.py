"""Varints: unsigned integers up to 2^53 - 1, 7 bits a byte. SPEC.md, "Conventions"."""

from __future__ import annotations

from collections.abc import Iterable

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
    """The varint that the bytes of ``source`` begin with; no more of them are taken."""
    value = shift = 0
    for byte in source:
        value |= (byte & 0x7F) << shift
        if value > MAX_COUNT or shift > 49:  # 8 bytes hold 56 bits (CONV-03)
            raise FormatError("varint beyond 2^53 - 1", where=where)
        if byte < 0x80:
            if byte == 0 and shift:  # CONV-02
                raise FormatError(f"varint {value} is not in its shortest form", where=where)
            return value
        shift += 7  # CONV-04
    raise TruncatedError("a varint runs past the end", where=where)


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
