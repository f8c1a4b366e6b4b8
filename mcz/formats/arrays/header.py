"""The head of an NPY file: what its numbers are, and where they lie."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import prod

from mcz.errors import SourceError
from mcz.formats.arrays.layout import TYPES

MAGIC = b"\x93NUMPY"
MAX_HEAD = 2**16  # bytes; NumPy itself takes no more than 10,000 that nobody vouches for
MAX_AXES = 64  # those of NumPy
_PLAIN = re.compile(rb"0|[1-9]\d{0,17}")
_DESCR = re.compile(rb"""["']descr["']\s*:\s*["']([<>|=]?)([A-Za-z])(\d*)["']""")
_ORDER = re.compile(rb"""["']fortran_order["']\s*:\s*(True|False)\b""")
_SHAPE = re.compile(rb"""["']shape["']\s*:\s*\(\s*((?:\d+\s*,\s*)*(?:\d+\s*)?)\)""")


@dataclass(frozen=True, slots=True)
class Head:
    """``start`` is where the numbers of an array begin, of shape ``shape`` and type ``code``.

    ``code`` is NumPy's without byte order, such as "f8"; "O" of pickled objects. ``rows_at`` and
    ``end`` are where the length of the first axis is printed, and where the text ends that may
    follow it, without the blanks behind. A fault of the head is ``odd``, and there is no more then.
    """

    start: int = 0
    shape: tuple[int, ...] = ()
    code: str = ""
    big_endian: bool = False
    by_columns: bool = False
    rows_at: tuple[int, int] = (0, 0)
    end: int = 0
    odd: str = ""

    @property
    def is_number(self) -> bool:
        """Whether a grid may hold such numbers."""
        return self.code in TYPES

    @property
    def size(self) -> int:
        """Bytes of the numbers, of a type that ``is_number``."""
        return prod(self.shape) * int(self.code[1:])


def read_head(data: bytes, at: int, stop: int) -> Head:
    """The head of the NPY file in data[at:stop]; see ``Head.odd``."""
    if data[at : at + 6] != MAGIC or stop < at + 10:
        return Head(odd=f"offset {at}: no NPY file, which begins with \\x93NUMPY")
    version = data[at + 6]
    wide = 2 if version == 1 else 4
    if version not in (1, 2, 3):
        return Head(odd=f"offset {at + 6}: version {version} of NPY is not known")
    text_at = at + 8 + wide
    size = int.from_bytes(data[at + 8 : text_at], "little")
    if size > MAX_HEAD or text_at + size > stop:
        return Head(odd=f"offset {at + 8}: a head of {size} bytes is too long")
    return _parsed(data[text_at : text_at + size], text_at, stop)


def _parsed(text: bytes, at: int, stop: int) -> Head:
    """What the text of a head, which lies at offset ``at``, says."""
    found = [pattern.search(text) for pattern in (_DESCR, _ORDER, _SHAPE)]
    descr, order, shape = found
    if descr is None or order is None or shape is None:
        return Head(odd=f"offset {at}: a head without a plain descr, fortran_order and shape")
    numbers = re.findall(rb"\d+", shape[1])
    if len(numbers) > MAX_AXES or not all(map(_PLAIN.fullmatch, numbers)):
        return Head(
            odd=f"offset {at + shape.start(1)}: the shape {shape[1][:60]!r} is no plain one"
        )
    lengths = tuple(map(int, numbers))
    code = (descr[2] + descr[3]).decode()
    first = re.match(rb"\d+", shape[1])
    rows_at = (0, 0)
    if first is not None:
        rows_at = at + shape.start(1), at + shape.start(1) + first.end()
    end = at + len(text.rstrip(b"\n").rstrip(b" "))
    head = Head(
        at + len(text),
        lengths,
        code,
        descr[1] == b">",
        order[1] == b"True",
        rows_at,
        end,
    )
    if head.is_number and head.size != stop - head.start:
        return Head(
            odd=f"offset {head.start}: {stop - head.start} bytes of numbers, but shape {lengths} "
            f"of {code} has {head.size}"
        )
    return head


def has_rows(data: bytes) -> bool:
    """Whether the head that ``data`` begins with is one of numbers with two axes or more."""
    size = int.from_bytes(data[8 : 10 if data[6:7] == b"\1" else 12], "little")
    text = data[: 12 + min(size, MAX_HEAD)]
    descr, shape = _DESCR.search(text), _SHAPE.search(text)
    if descr is None or shape is None:
        return False
    return (descr[2] + descr[3]).decode() in TYPES and len(re.findall(rb"\d+", shape[1])) > 1


def refuse_odd(head: Head) -> None:
    """Raise SourceError where a head has a fault."""
    if head.odd:
        raise SourceError(head.odd)
