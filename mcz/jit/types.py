"""What a loop computes with: integers, floats, truths, arrays and tuples of these.

A value is its type and its parts: names or literals of LLVM, one for each machine word that the
type takes. So an array is its address, its lengths and its strides, and a tuple is the parts of its
items one after the other.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass


class LoopError(Exception):
    """A loop that is written in more than the compiled subset of Python."""


@dataclass(frozen=True)
class Scalar:
    """An integer, a float or a truth; ``machine`` is its type in LLVM."""

    name: str
    machine: str

    def parts(self) -> list[str]:
        return [self.machine]


INT, FLOAT, BOOL = Scalar("int", "i64"), Scalar("float", "double"), Scalar("bool", "i1")
RANKED = (BOOL, INT, FLOAT)  # each holds what those before it hold


@dataclass(frozen=True)
class Array:
    """An array of int64, float64, uint8 or bool; ``dense``: the last axis has no stride."""

    item: str
    rank: int
    dense: bool = True

    def parts(self) -> list[str]:
        return ["ptr"] + ["i64"] * (2 * self.rank - self.dense)


# What arrays hold: how an item lies in memory, and what it is once loaded.
ITEMS = {
    "int64": ("i64", 8, INT),
    "float64": ("double", 8, FLOAT),
    "uint8": ("i8", 1, INT),
    "bool": ("i8", 1, BOOL),
}


@dataclass(frozen=True)
class Tuple:
    """Several values side by side, those of a NamedTuple with their names."""

    items: tuple[Type, ...]
    names: tuple[str, ...] = ()

    def parts(self) -> list[str]:
        return [part for item in self.items for part in item.parts()]


Type = Scalar | Array | Tuple
NOTHING = Tuple(())


@dataclass(frozen=True)
class Value:
    """A value of a type; ``known`` is the Python number that it is, where that is known."""

    type: Type
    parts: tuple[str, ...]
    known: int | float | bool | None = None

    def items(self) -> list[Value]:
        """The items of a tuple."""
        assert isinstance(self.type, Tuple)
        found, at = [], 0
        for type_ in self.type.items:
            size = len(type_.parts())
            found.append(Value(type_, self.parts[at : at + size], self._known_if_one(type_, at)))
            at += size
        return found

    def _known_if_one(self, type_: Type, at: int) -> int | None:
        """Integers of a tuple are still known: their part is a literal."""
        text = self.parts[at] if type_ == INT else ""
        return int(text) if text.lstrip("-").isdigit() else None

    # Of an array: its address, its lengths, and by how many items each axis strides.
    @property
    def address(self) -> str:
        return self.parts[0]

    @property
    def lengths(self) -> tuple[str, ...]:
        assert isinstance(self.type, Array)
        return self.parts[1 : 1 + self.type.rank]

    @property
    def strides(self) -> tuple[str, ...]:
        assert isinstance(self.type, Array)
        return self.parts[1 + self.type.rank :] + ("1",) * self.type.dense


def pack(values: list[Value]) -> Value:
    """A tuple of values."""
    type_ = Tuple(tuple(value.type for value in values))
    return Value(type_, tuple(part for value in values for part in value.parts))


def array(item: str, address: str, lengths: list[str], strides: list[str]) -> Value:
    """An array, which is dense where the stride of its last axis is the literal 1."""
    dense = strides[-1] == "1"
    type_ = Array(item, len(lengths), dense)
    return Value(type_, (address, *lengths, *(strides[:-1] if dense else strides)))


def constant(value: object) -> Value | None:
    """A number, a truth or a tuple of them as a value; None for anything else."""
    if isinstance(value, bool):
        return Value(BOOL, ("true" if value else "false",), value)
    if isinstance(value, int):
        if not -(1 << 63) <= value < 1 << 63:
            return None
        return Value(INT, (str(int(value)),), int(value))
    if isinstance(value, float):
        bits = int.from_bytes(struct.pack("<d", value), "little")
        return Value(FLOAT, (f"0x{bits:016X}",), value)
    if isinstance(value, tuple):
        items = [constant(item) for item in value]
        known = [item for item in items if item is not None]
        return pack(known) if len(known) == len(items) else None
    return None
