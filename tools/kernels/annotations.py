"""Types of kernels: what an annotation is in C."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass


class KernelError(Exception):
    """A kernel that is written in more than can be declared."""


@dataclass(frozen=True)
class Scalar:
    """A number; ``c`` is its type in C."""

    name: str
    c: str

    def __str__(self) -> str:
        return self.name


INT, FLOAT = Scalar("int", "long long"), Scalar("float", "double")
BOOL, NOTHING = Scalar("bool", "bint"), Scalar("None", "int")


@dataclass(frozen=True)
class Array:
    """A memoryview; ``dense``: its last axis is contiguous."""

    item: str
    rank: int
    dense: bool = True

    def c(self, *, written: bool) -> str:
        """The type in Cython."""
        axes = [":"] * self.rank
        if self.dense:
            axes[-1] = "::1"
        return f"{'' if written else 'const '}{ITEMS[self.item][0]}[{', '.join(axes)}]"


ITEMS = {  # type in C, number that an item is
    "int64": ("long long", INT),
    "int32": ("int", INT),
    "float64": ("double", FLOAT),
    "uint8": ("unsigned char", INT),
    "bool": ("unsigned char", BOOL),
}


@dataclass(frozen=True)
class Tuple:
    """Numbers side by side."""

    items: tuple[Scalar, ...]

    @property
    def c(self) -> str:
        return f"({', '.join(item.c for item in self.items)})"


@dataclass(frozen=True)
class Record:
    """A NamedTuple: a struct where all fields are numbers, otherwise an extension class."""

    name: str
    module: str
    fields: tuple[tuple[str, Type], ...]

    @property
    def c(self) -> str:
        return self.name

    @property
    def is_struct(self) -> bool:
        return all(isinstance(type_, Scalar) for _, type_ in self.fields)


Type = Scalar | Array | Tuple | Record
SCALARS = {"int": INT, "float": FLOAT, "bool": BOOL, "None": NOTHING}
PREFIXES = {"Int": "int64", "Word": "int32", "Float": "float64", "Byte": "uint8", "Flag": "bool"}
# As mcz.kernels.types has them.
NAME = re.compile(r"(Int|Word|Float|Byte|Flag)(?:s([2-9]?)|(Columns?))")


def array_type(name: str) -> Array | None:
    """The array that a name stands for: ``Ints``, ``Floats3``, ``IntColumn``, ``FloatColumns``."""
    found = NAME.fullmatch(name)
    if found is None:
        return None
    item, axes, column = PREFIXES[found[1]], found[2], found[3]
    if column:
        return Array(item, 2 if column == "Columns" else 1, dense=False)
    return Array(item, int(axes or 1))


def simple_type(node: ast.expr) -> Type | None:
    """The type of an annotation that names no other module's; None of another."""
    if isinstance(node, ast.Constant) and node.value is None:
        return NOTHING
    if isinstance(node, ast.Name):
        return SCALARS.get(node.id) or array_type(node.id)
    if (
        isinstance(node, ast.Subscript)
        and isinstance(node.value, ast.Name)
        and node.value.id == "tuple"
    ):
        nodes = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        items = tuple(map(simple_type, nodes))
        if all(isinstance(item, Scalar) for item in items):
            return Tuple(items)  # type: ignore[arg-type]
    return None
