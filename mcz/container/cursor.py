"""Reading a structure by hand, field by field, where there are tens of thousands of them.

Everything else is read by its schema, ``mcz/schema``. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from mcz.errors import FormatError, TruncatedError
from mcz.schema import read_varint


class Cursor:
    """Takes the fields of a structure off its bytes, one after the other; raises FormatError."""

    __slots__ = ("at", "data", "where")

    def __init__(self, data: bytes, where: str) -> None:
        self.data, self.where, self.at = data, where, 0

    def varint(self) -> int:
        data, at = self.data, self.at
        if at < len(data) and data[at] < 0x80:
            self.at = at + 1
            return data[at]
        try:
            value, self.at = read_varint(data, at)
        except FormatError as error:
            error.add(where=self.where)
            raise
        return value

    def take(self, size: int) -> bytes:
        start, stop = self.at, self.at + size
        if stop > len(self.data):  # CONV-13
            raise TruncatedError(
                f"{self.where}: {size} bytes at {start} of {len(self.data)} run past the end"
            )
        self.at = stop
        return self.data[start:stop]

    def sized(self) -> bytes:
        return self.take(self.varint())

    def text(self) -> str:
        data = self.sized()
        try:
            return data.decode("utf-8")  # CONV-05, CONV-06
        except UnicodeDecodeError as error:
            raise FormatError(f"{self.where}: {data!r} is not UTF-8: {error}") from None
