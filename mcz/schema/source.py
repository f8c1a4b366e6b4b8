"""The bytes of one structure as they are read, and the fields that were."""

from __future__ import annotations

from typing import Any

from mcz.errors import LimitError, TruncatedError
from mcz.schema.varints import read_varint


class Fields(dict[str, Any]):
    """The fields of a structure by name, which are attributes, too."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


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
