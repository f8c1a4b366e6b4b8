"""Bytes as tables write them: ``01ff v:300 d:-0.5 "text" sized(00*3) sha256("a")``."""

from __future__ import annotations

import ast
import hashlib
import math
import re
import struct
import zlib
from collections.abc import Callable, Mapping

from mcz.model.schema import deflate, varint

TOKEN = re.compile(
    r"""\s*(?:
    (?P<text>"(?:[^"\\]|\\.)*")          # UTF-8 without a length
    | (?P<field><[^>]+>)                 # bytes of the file being edited
    | (?P<constant>@[\w-]+)              # bytes that the table names
    | (?P<number>(?:v|z|d|f|u16|u32|u64|u128):[-+^.\w]+)
    | (?P<open>[\w-]*\()
    | (?P<close>\))
    | (?P<times>\*\s*\d+)
    | (?P<hex>(?:[0-9a-fA-F]{2})+)
    )""",
    re.VERBOSE,
)
FUNCTIONS: dict[str, Callable[[bytes], bytes]] = {
    "": lambda data: data,
    "sized": lambda data: varint(len(data)) + data,
    "deflate": deflate,
    "packed": lambda data: b"\1" + varint(len(data)) + deflate(data),
    "sha256": lambda data: hashlib.sha256(data).digest(),
    "id": lambda data: hashlib.sha256(data).digest()[:16],
    "crc32": lambda data: struct.pack("<I", zlib.crc32(data)),
}
SIZES = {"u16": 2, "u32": 4, "u64": 8, "u128": 16}
Lookup = Callable[[str], bytes]


def integer(text: str) -> int:
    """An integer such as -7, 0x1f or 2^40-1."""
    match = re.fullmatch(r"(-?)(\d+)\^(\d+)([-+]\d+)?", text)
    if match is None:
        return int(text, 0)
    sign, base, power, more = match.groups()
    value = int(base) ** int(power) + int(more or 0)
    return -value if sign else value


def number(text: str) -> bytes:
    """The bytes of a number behind its type, such as v:300."""
    kind, _, digits = text.partition(":")
    if kind in "df":
        value = math.nan if digits == "nan" else float(digits)
        return struct.pack("<" + kind, value)
    value = integer(digits)
    if kind == "v":
        return varint(value)
    if kind == "z":
        return varint(2 * value if value >= 0 else -2 * value - 1)
    return value.to_bytes(SIZES[kind], "little")


def read_bytes(text: str, lookup: Lookup, constants: Mapping[str, str]) -> bytes:
    """The bytes that ``text`` says; ``lookup`` has fields of the file, ``constants`` named bytes.

    Raises ValueError for text that is no such notation.
    """
    stack: list[tuple[str, list[bytes]]] = [("", [])]
    at = 0
    while text[at:].strip():
        match = TOKEN.match(text, at)
        if match is None:
            raise ValueError(f"{text[at:].strip()!r} is no notation of bytes")
        at, kind, token = match.end(), match.lastgroup, match[match.lastgroup or 0]
        parts = stack[-1][1]
        if kind == "open":
            stack.append((token[:-1], []))
        elif kind == "close":
            name, inner = stack.pop()
            stack[-1][1].append(FUNCTIONS[name](b"".join(inner)))
        elif kind == "times":
            parts.append(parts.pop() * int(token[1:]))
        elif kind == "field":
            parts.append(lookup(token[1:-1]))
        elif kind == "constant":
            parts.append(read_bytes(constants[token[1:]], lookup, constants))
        elif kind == "text":
            parts.append(str(ast.literal_eval(token)).encode())
        else:
            parts.append(number(token) if kind == "number" else bytes.fromhex(token))
    ((_, parts),) = stack
    return b"".join(parts)
