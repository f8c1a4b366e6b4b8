"""The head of an NPY file: what its numbers are, and where they lie."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import prod

from mcz.errors import SourceError
from mcz.sources.arrays.layout import TYPES

MAGIC = b"\x93NUMPY"
VERSIONS = ((1, 0), (2, 0), (3, 0))
MAX_HEAD = 10_000  # bytes; NumPy takes no more of a file that nobody vouches for
MAX_AXES = 64  # those of NumPy
_NUMBER = re.compile(rb"\d+")
_PLAIN = re.compile(rb"0|[1-9]\d{0,17}")
_BLANKS = rb"[ \t\r\n]*"
_VALUES = {
    b"descr": rb"""(?:'([<>|=]?)([A-Za-z])(\d*)'|"([<>|=]?)([A-Za-z])(\d*)")""",
    b"fortran_order": rb"(True|False)",
    b"shape": rb"\( ((?:\d+ , )*(?:\d+ , \d+ )?)\)",
}
_ITEM = rb"""(?:'%s'|"%s") : %s """
_ITEMS = {
    key: re.compile((_ITEM % (key, key, value)).replace(b" ", _BLANKS))
    for key, value in _VALUES.items()
}
_OPEN, _COMMA = re.compile(rb"[ \t]*\{" + _BLANKS), re.compile(b"," + _BLANKS)
_CLOSE = re.compile(rb"\}" + _BLANKS)


@dataclass(frozen=True, slots=True)
class Head:
    """``start`` is where the numbers of an array begin, of shape ``shape`` and type ``code``.

    ``code`` is NumPy's without byte order, such as "f8"; "O" of pickled objects. ``rows_at`` and
    ``end`` are where the length of the first axis is printed, and where the text ends that may
    follow it, without the blanks behind; unless ``is_printed``, it is an integer there, and the
    number of all numbers one at ``items_at``. A fault of the head is ``odd``, and there is no more
    then.
    """

    start: int = 0
    shape: tuple[int, ...] = ()
    code: str = ""
    big_endian: bool = False
    by_columns: bool = False
    rows_at: tuple[int, int] = (0, 0)
    end: int = 0
    odd: str = ""
    is_printed: bool = True
    items_at: tuple[int, int] = (0, 0)

    @property
    def is_number(self) -> bool:
        """True if a grid may store such numbers."""
        return self.code in TYPES

    @property
    def size(self) -> int:
        """Bytes of the numbers, of a type that ``is_number``."""
        return prod(self.shape) * int(self.code[1:])


def read_head(data: bytes, at: int, stop: int) -> Head:
    """The head of the NPY file in data[at:stop]; see ``Head.odd``."""
    if data[at : at + 6] != MAGIC or stop < at + 10:
        return Head(odd=f"offset {at}: no NPY file, which begins with \\x93NUMPY")
    version = data[at + 6], data[at + 7]
    wide = 2 if version == (1, 0) else 4
    if version not in VERSIONS:
        return Head(odd=f"offset {at + 6}: version {version[0]}.{version[1]} of NPY is not known")
    text_at = at + 8 + wide
    size = int.from_bytes(data[at + 8 : text_at], "little")
    if size > MAX_HEAD or text_at + size > stop:
        return Head(odd=f"offset {at + 8}: a head of {size} bytes is too long")
    return _parse_header(data[text_at : text_at + size], text_at, stop)


def _parse_header(text: bytes, at: int, stop: int) -> Head:
    """Parse the text of a header at offset ``at``."""
    items = _items(text)
    if items is None:
        return Head(
            odd=f"offset {at}: the head is no plain dictionary of descr, fortran_order and shape"
        )
    descr, order, shape = items[b"descr"], items[b"fortran_order"], items[b"shape"]
    numbers = _NUMBER.findall(shape[1])
    if len(numbers) > MAX_AXES or not all(map(_PLAIN.fullmatch, numbers)):
        return Head(
            odd=f"offset {at + shape.start(1)}: the shape {shape[1][:60]!r} is no plain one"
        )
    lengths = tuple(map(int, numbers))
    byte_order, code = _type_of(descr)
    first = re.match(rb"\d+", shape[1])
    rows_at = (0, 0)
    if first is not None:
        rows_at = at + shape.start(1), at + shape.start(1) + first.end()
    end = at + len(text.rstrip(b"\n").rstrip(b" "))
    head = Head(
        at + len(text), lengths, code, byte_order == b">", order[1] == b"True", rows_at, end
    )
    if head.is_number and head.size != stop - head.start:
        return Head(
            odd=f"offset {head.start}: {stop - head.start} bytes of numbers, but shape {lengths} "
            f"of {code} has {head.size}"
        )
    return head


def _items(text: bytes) -> dict[bytes, re.Match[bytes]] | None:
    """The three values of a head, a dictionary in Python's words; None where it is not so plain.

    A key that is there twice, another key, a comment or an escape might mean something else to
    NumPy, which evaluates the text.
    """
    at, items = 0, dict[bytes, re.Match[bytes]]()
    last = _OPEN.match(text)
    while last is not None:
        at = last.end()
        item = next(filter(None, (pattern.match(text, at) for pattern in _ITEMS.values())), None)
        if item is None:
            break
        key = next(key for key, pattern in _ITEMS.items() if pattern is item.re)
        if key in items:
            return None
        items[key], at = item, item.end()
        last = _COMMA.match(text, at)
    end = _CLOSE.fullmatch(text, at)
    return items if end is not None and len(items) == len(_ITEMS) else None


def _type_of(descr: re.Match[bytes]) -> tuple[bytes, str]:
    """The byte order of a type and its code without one."""
    order, kind, size = descr.groups()[:3] if descr[2] else descr.groups()[3:]
    return order, (kind + size).decode()


def has_rows(data: bytes) -> bool:
    """Return True if ``data`` begins with the header of numbers with at least two axes."""
    size = int.from_bytes(data[8 : 10 if data[6:7] == b"\1" else 12], "little")
    begin = 10 if data[6:7] == b"\1" else 12
    items = _items(data[begin : begin + min(size, MAX_HEAD)])
    if items is None:
        return False
    return _type_of(items[b"descr"])[1] in TYPES and len(_NUMBER.findall(items[b"shape"][1])) > 1


def refuse_odd(head: Head) -> None:
    """Raise SourceError where a head has a fault."""
    if head.odd:
        raise SourceError(head.odd)


DIRECTORY_END = b"PK\5\6"


def is_motion(data: bytes) -> bool:
    """Return True if an NPY or NPZ that begins with ``data`` may have a row of numbers per frame.

    What cannot be told from these bytes counts: the reader says what is wrong.
    """
    heads = [match.start() for match in re.finditer(re.escape(MAGIC), data)]
    is_whole = not data.startswith(b"PK") or DIRECTORY_END in data
    return not heads or not is_whole or any(has_rows(data[at:]) for at in heads)
