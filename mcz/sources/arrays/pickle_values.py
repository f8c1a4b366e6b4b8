"""Values that a pickle is made of, and the literals among its opcodes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import prod

MAX_AXES, MAX_LENGTH = 64, 2**48  # of a shape


@dataclass(frozen=True, slots=True)
class Number:
    """An integer of ``size`` bytes at offset ``at``."""

    value: int
    at: int
    size: int


@dataclass(frozen=True, slots=True)
class Raw:
    """Bytes of the file, after their length of ``count_size`` bytes (0: without).

    ``is_text``: a string of Python 2, which may be text.
    """

    start: int
    stop: int
    count_size: int
    is_text: bool = False


@dataclass(slots=True)
class Dict:
    """A dictionary; a key may come again, and the last one counts."""

    pairs: list[tuple[object, object]] = field(default_factory=list)


@dataclass(slots=True)
class DType:
    """A type of NumPy: ``code`` such as "f8"; ``order`` "<", ">" or "|", "" if not stated."""

    code: str
    order: str = ""


@dataclass(slots=True, eq=False)
class PickledArray:
    """An array: ``content`` is Raw, the list of its objects, or None with a ``fault``.

    ``items`` is how many numbers a tensor has, if the pickle states that.
    """

    shape: tuple[object, ...] = ()
    dtype: DType | None = None
    is_fortran: bool = False
    content: Raw | list[object] | None = None
    fault: str = ""
    items: Number | None = None

    @property
    def lengths(self) -> tuple[int, ...]:
        """The shape, (-1,) of one with too many axes."""
        return tuple(map(integer_of, self.shape)) if len(self.shape) <= MAX_AXES else (-1,)


@dataclass(frozen=True, slots=True)
class PickledName:
    """A name that a pickle may use, without its module."""

    name: str


@dataclass(frozen=True, slots=True)
class Storage:
    """The numbers of a tensor: their type, their bytes, and how many the pickle says they are."""

    dtype: DType
    content: Raw | None
    items: object


class Wrapper:
    """The object of joblib before the bytes of an array."""


def integer_of(value: object) -> int:
    """The integer of an opcode; -1 for anything else."""
    if isinstance(value, Number):
        return value.value
    return value if type(value) is int else -1


def size_of(shape: Sequence[int], itemsize: int) -> int | None:
    """Bytes of an array; None for an invalid shape."""
    is_shape = all(0 <= length <= MAX_LENGTH for length in shape)
    return prod(shape) * itemsize if is_shape else None


def _plain_int(data: bytes, start: int, stop: int) -> object:
    line = data[start:stop]
    return {b"00": False, b"01": True}.get(line) if line in (b"00", b"01") else int(line)


def _old_text(data: bytes, start: int, stop: int) -> str | None:
    """A printed string of Python 2, None if it has escapes."""
    line = data[start:stop].strip()
    is_quoted = len(line) > 1 and line[:1] == line[-1:] and line[:1] in (b"'", b'"')
    if not is_quoted:
        raise ValueError("no quotes")
    return None if b"\\" in line else line[1:-1].decode("latin-1")


def _number(signed: bool) -> Callable[..., Number]:
    return lambda d, a, b, _: Number(int.from_bytes(d[a:b], "little", signed=signed), a, b - a)


def _long(data: bytes, start: int, stop: int, _: int) -> int:
    return int.from_bytes(data[start:stop], "little", signed=True)


def _text(data: bytes, start: int, stop: int, _: int) -> str:
    return data[start:stop].decode("utf-8", "surrogatepass")


def _raw(is_text: bool) -> Callable[..., Raw]:
    return lambda _, start, stop, size: Raw(start, stop, size, is_text)


LITERALS: dict[str, Callable[[bytes, int, int, int], object]] = {
    "INT": lambda d, a, b, _: _plain_int(d, a, b),
    "LONG": lambda d, a, b, _: int(d[a:b].removesuffix(b"L")),
    "FLOAT": lambda d, a, b, _: float(d[a:b]),
    "BINFLOAT": lambda d, a, b, _: struct.unpack(">d", d[a:b])[0],
    "STRING": lambda d, a, b, _: _old_text(d, a, b),
    "UNICODE": lambda d, a, b, _: d[a:b].decode("raw-unicode-escape"),
    **dict.fromkeys(("BININT1", "BININT2"), _number(False)),
    "BININT": _number(True),
    **dict.fromkeys(("LONG1", "LONG4"), _long),
    **dict.fromkeys(("SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"), _text),
    **dict.fromkeys(("SHORT_BINSTRING", "BINSTRING"), _raw(True)),
    **dict.fromkeys(("SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8"), _raw(False)),
    "NONE": lambda *_: None,
    "NEWTRUE": lambda *_: True,
    "NEWFALSE": lambda *_: False,
    "EMPTY_TUPLE": lambda *_: (),
    **dict.fromkeys(("EMPTY_LIST", "EMPTY_SET"), lambda *_: []),
    "EMPTY_DICT": lambda *_: Dict(),
}
