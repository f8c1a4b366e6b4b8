"""Expressions of kernels in Cython: the text, and the type that it has.

Integers have 64 bits: literals are cast, shifts and quotients are functions of ``arithmetic.h``.
"""

from __future__ import annotations

import ast
import builtins
import hashlib
import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from tools.kernels.annotations import (
    BOOL,
    FLOAT,
    INT,
    ITEMS,
    Array,
    KernelError,
    Record,
    Scalar,
    Tuple,
    Type,
)
from tools.kernels.source import Source, is_constant, mangle_name, source

Root = str | tuple[str, str]  # what an array is a part of: a variable, or a record's field
Typed = tuple[str, Type]
OPERATORS = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
}
INT_CALLS = {
    ast.LShift: "mcz_left",
    ast.RShift: "mcz_right",
    ast.FloorDiv: "mcz_divide",
    ast.Mod: "mcz_remainder",
}
COMPARISONS = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}
# Functions of floats in C.
FLOAT_CALLS = {
    "np.floor": "floor",
    "np.rint": "rint",
    "np.log2": "log2",
    "math.log": "log",
    "math.exp": "exp",
    "math.cos": "cos",
    "math.sin": "sin",
    "math.sqrt": "sqrt",
}
RANKED = (BOOL, INT, FLOAT)


@dataclass
class Effects:
    """Effects of a function on arrays, collected during its translation."""

    aliases: dict[str, set[Root]] = field(default_factory=dict)  # of variables
    written: set[Root] = field(default_factory=set)
    calls: list[tuple[str, list[Root | None]]] = field(default_factory=list)
    allocates: bool = False


class Expressions:
    """Translates the expressions of one function."""

    def __init__(self, where: Source, node: ast.FunctionDef) -> None:
        self.source, self.node = where, node
        self.types: dict[str, Type] = {}
        self.shared: dict[str, str] = {}  # fields of records, by the variables that name them
        self.needed: list[tuple[Source, str]] = []  # functions that are called
        self.tables: dict[str, tuple[Any, ...]] = {}  # constant tuples that are looped over
        self.modules = {where.name}  # that its text depends on
        self.effects = Effects()
        self.called: dict[ast.AST, str] = {}  # the function of each call
        stored = [n for n in ast.walk(node) if isinstance(n, ast.Name)]
        self.stores = Counter(n.id for n in stored if isinstance(n.ctx, ast.Store))
        self.own = self.stores.keys() | {argument.arg for argument in node.args.args}

    def error(self, node: ast.AST, fault: str) -> KernelError:
        line = getattr(node, "lineno", self.node.lineno)
        return KernelError(f"{self.source.path}:{line}: {ast.unparse(node)}: {fault}")

    def expr(self, node: ast.expr) -> Typed:
        """Text and type of an expression."""
        fixed = self.constant_of(node)
        if fixed is not None:
            return self._literal(node, fixed)
        method = getattr(self, "of_" + type(node).__name__, None)
        if method is None:
            raise self.error(node, "is not compiled")
        found: Typed = method(node)
        return found

    def constant_of(self, node: ast.expr) -> Any:
        """The constant that an expression is, or None."""
        if isinstance(node, ast.Constant):
            return node.value if is_constant(node.value) else None
        if isinstance(node, ast.Name) and node.id not in self.own:
            return self._constant(self.source, node.id)
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "np.inf":
            return math.inf
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module, original = self.source.imported.get(node.value.id, ("", "other"))
            return None if original else self._constant(source(module), node.attr)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            operand = self.constant_of(node.operand)
            return -operand if isinstance(operand, int | float) else None
        return None

    def _constant(self, where: Source, name: str) -> Any:
        """The constant that a name stands for in a module; notes where that comes from."""
        found = where.constant(name)
        if found is not None:
            defined = where.find(name)
            self.modules |= {where.name, where.imported.get(name, (where.name, ""))[0]}
            self.modules |= {defined[0].name} if defined else set()
        return found

    def _literal(self, node: ast.expr, value: Any) -> Typed:
        if isinstance(value, bool):
            return ("True" if value else "False"), BOOL
        if isinstance(value, int):
            if value == -(1 << 63):
                return "(-9223372036854775807LL - 1)", INT
            return f"<long long>({value})", INT
        if isinstance(value, float):
            return ("INFINITY" if value == math.inf else f"({value!r})"), FLOAT
        if isinstance(value, tuple) and not any(isinstance(item, tuple | str) for item in value):
            texts, types = zip(*(self._literal(node, item) for item in value), strict=True)
            return f"({', '.join(texts)})", Tuple(types)
        raise self.error(node, f"{value!r} is no number")

    def root(self, node: ast.expr) -> Root | None:
        """The array that an expression is a part of."""
        if isinstance(node, ast.Subscript):
            return self.root(node.value)
        if isinstance(node, ast.Name):
            return node.id
        if isinstance(node, ast.Attribute):
            record = self.expr(node.value)[1]
            return (record.name, node.attr) if isinstance(record, Record) else None
        return None

    def of_Name(self, node: ast.Name) -> Typed:  # noqa: N802
        if node.id not in self.types:
            raise self.error(node, "is no number here")
        return self.shared.get(node.id, node.id), self.types[node.id]

    def of_Tuple(self, node: ast.Tuple) -> Typed:  # noqa: N802
        texts, types = zip(*map(self.expr, node.elts), strict=True)
        for item, type_ in zip(node.elts, types, strict=True):
            if not isinstance(type_, Scalar):
                raise self.error(item, "tuples are of numbers")
        return f"({', '.join(texts)})", Tuple(types)

    def of_Attribute(self, node: ast.Attribute) -> Typed:  # noqa: N802
        text, type_ = self.expr(node.value)
        fields = dict(type_.fields) if isinstance(type_, Record) else {}
        if node.attr not in fields:
            raise self.error(node, "is not compiled")
        return f"{text}.{node.attr}", fields[node.attr]

    def of_Subscript(self, node: ast.Subscript) -> Typed:  # noqa: N802
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            text, type_ = self.expr(node.value.value)
            axis = self.constant_of(node.slice)
            if isinstance(type_, Array) and isinstance(axis, int) and axis < type_.rank:
                return f"<long long>{text}.shape[{axis}]", INT
        fixed = self.constant_of(node.value)
        if isinstance(fixed, tuple):
            return self._table_item(node, fixed)
        text, type_ = self.expr(node.value)
        if isinstance(type_, Tuple):
            index = self.constant_of(node.slice)
            if not isinstance(index, int):
                raise self.error(node, "the index of a tuple is a constant")
            return f"{text}[{index}]", type_.items[index]
        if not isinstance(type_, Array):
            raise self.error(node, f"{type_} has no items")
        return self._part(node, text, type_)

    def _table_item(self, node: ast.Subscript, values: tuple[Any, ...]) -> Typed:
        index = self.constant_of(node.slice)
        if isinstance(index, int):
            return self._literal(node, values[index])
        name, type_ = self.table(node, values)
        return f"{name}[mcz_index({self.int_of(node.slice)}, {len(values)})]", type_

    def table(self, node: ast.expr, values: tuple[Any, ...]) -> tuple[str, Scalar]:
        """The name and item type of a constant array in C."""
        if any(isinstance(value, tuple | str) for value in values):
            raise self.error(node, "is no tuple of numbers")
        type_ = FLOAT if any(isinstance(value, float) for value in values) else INT
        name = f"table_{hashlib.sha256(repr(values).encode()).hexdigest()[:12]}"
        self.tables[name] = values
        return name, type_

    def _part(self, node: ast.Subscript, text: str, type_: Array) -> Typed:
        nodes = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(nodes) > type_.rank:
            raise self.error(node, f"has {type_.rank} axes")
        kept = [isinstance(item, ast.Slice) for item in nodes] + [True] * (type_.rank - len(nodes))
        indices = [self._index(item) for item in nodes]
        found = f"{text}[{', '.join(indices)}]"
        if not any(kept):
            return found, ITEMS[type_.item][1]
        # The last axis is still contiguous, and those before it fit Cython's idea of that, where
        # only leading axes are gone.
        leading = all(not kept[axis] for axis in range(len(kept) - sum(kept)))
        whole = all(
            isinstance(item, ast.Slice) and item.lower is None and item.upper is None
            for item in nodes[len(kept) - sum(kept) + 1 :]
        )
        return found, Array(type_.item, sum(kept), type_.dense and leading and whole)

    def _index(self, node: ast.expr) -> str:
        if not isinstance(node, ast.Slice):
            fixed = self.constant_of(node)
            if isinstance(fixed, int) and fixed < 0:
                raise self.error(node, "an index counts from the front")
            return str(fixed) if isinstance(fixed, int) else self.int_of(node)
        if node.step is not None:
            raise self.error(node, "slices have no steps")
        ends = ["" if end is None else self.int_of(end) for end in (node.lower, node.upper)]
        return ":".join(ends)

    def int_of(self, node: ast.expr) -> str:
        text, type_ = self.expr(node)
        if type_ not in (INT, BOOL):
            raise self.error(node, f"is no integer but {type_}")
        return text

    def number(self, node: ast.expr) -> tuple[str, Scalar]:
        text, type_ = self.expr(node)
        if not isinstance(type_, Scalar):
            raise self.error(node, f"is no number but {type_}")
        return text, type_

    def common(self, types: list[Scalar]) -> Scalar:
        return max(types, key=RANKED.index)

    def of_UnaryOp(self, node: ast.UnaryOp) -> Typed:  # noqa: N802
        text, type_ = self.number(node.operand)
        if isinstance(node.op, ast.Not):
            return f"(not {text})", BOOL
        if isinstance(node.op, ast.USub):
            return f"(-{text})", FLOAT if type_ == FLOAT else INT
        raise self.error(node, "is not compiled")

    def of_BinOp(self, node: ast.BinOp) -> Typed:  # noqa: N802
        return self.binary(node, node.op, self.number(node.left), self.number(node.right))

    def binary(
        self, node: ast.AST, op: ast.operator, left: tuple[str, Scalar], right: tuple[str, Scalar]
    ) -> Typed:
        one, other = left[0], right[0]
        type_ = self.common([left[1], right[1]])
        if isinstance(op, ast.Div):
            return f"(<double>{one} / <double>{other})", FLOAT
        if isinstance(op, ast.Pow):
            if other == "<long long>(2)":
                return f"mcz_square({one})", FLOAT
            return f"mcz_power({one}, {other})", FLOAT
        if type(op) in INT_CALLS and type_ != FLOAT:
            return f"{INT_CALLS[type(op)]}({one}, {other})", INT
        if type(op) not in OPERATORS or (
            type_ == FLOAT and not isinstance(op, ast.Add | ast.Sub | ast.Mult)
        ):
            raise self.error(node, f"{type(op).__name__} of {type_.name} is not compiled")
        bits = isinstance(op, ast.BitAnd | ast.BitOr | ast.BitXor)
        result = BOOL if type_ == BOOL and bits else FLOAT if type_ == FLOAT else INT
        return f"({one} {OPERATORS[type(op)]} {other})", result

    def of_Compare(self, node: ast.Compare) -> Typed:  # noqa: N802
        texts = [self.number(node.left)[0]]
        for op, right in zip(node.ops, node.comparators, strict=True):
            if type(op) not in COMPARISONS:
                raise self.error(node, "is not compiled")
            texts += [COMPARISONS[type(op)], self.number(right)[0]]
        return f"({' '.join(texts)})", BOOL

    def of_BoolOp(self, node: ast.BoolOp) -> Typed:  # noqa: N802
        for value in node.values:
            if self.expr(value)[1] != BOOL:
                raise self.error(value, "is no bool")
        return self.truth(node), BOOL

    def truth(self, node: ast.expr) -> str:
        """A condition; of what is no truth itself, whether it is not 0."""
        if isinstance(node, ast.BoolOp):
            parts = [f"({self.truth(value)})" for value in node.values]
            return f"({(' and ' if isinstance(node.op, ast.And) else ' or ').join(parts)})"
        text, type_ = self.number(node)
        return text if type_ == BOOL else f"({text} != 0)"

    def of_IfExp(self, node: ast.IfExp) -> Typed:  # noqa: N802
        one, type_ = self.expr(node.body)
        other, type_2 = self.expr(node.orelse)
        if isinstance(type_, Tuple) and type_ == type_2:
            return f"({one} if {self.truth(node.test)} else {other})", type_
        (one, type_), (other, type_2) = self.number(node.body), self.number(node.orelse)
        type_ = self.common([type_, type_2])
        cast = f"<{type_.c}>"
        return f"({cast}{one} if {self.truth(node.test)} else {cast}{other})", type_

    def of_Call(self, node: ast.Call) -> Typed:  # noqa: N802
        if node.keywords or any(isinstance(item, ast.Starred) for item in node.args):
            raise self.error(node, "arguments go by their place")
        name = ast.unparse(node.func)
        if name in FLOAT_CALLS:
            return f"{FLOAT_CALLS[name]}({self.number(node.args[0])[0]})", FLOAT
        if name == "math.ldexp":
            return f"ldexp({self.number(node.args[0])[0]}, <int>{self.int_of(node.args[1])})", FLOAT
        if name in BUILTINS and name not in self.own:
            return self._builtin(node, name)
        place = None
        if isinstance(node.func, ast.Name) and not hasattr(builtins, name):
            place = self.source.find(name)
        elif isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            place = self.source.find_in(node.func.value.id, node.func.attr)
        if place is None or place[1] not in place[0].functions:
            raise self.error(node, "cannot be called")
        return self._call(node, *place)

    def _builtin(self, node: ast.Call, name: str) -> Typed:
        if name == "len":
            text, type_ = self.expr(node.args[0])
            if not isinstance(type_, Array):
                raise self.error(node, f"{type_} has no length")
            return f"<long long>{text}.shape[0]", INT
        if name in ("eight_bytes", "put_eight_bytes"):
            return self._eight_bytes(node, name)
        parts = [self.number(item) for item in node.args]
        (text, type_), *_ = parts
        if name in ("min", "max"):
            common = self.common([type_ for _, type_ in parts])
            return f"{name}({', '.join(f'<{common.c}>{part}' for part, _ in parts)})", common
        if name == "abs":
            return (f"fabs({text})", FLOAT) if type_ == FLOAT else (f"mcz_magnitude({text})", INT)
        if name == "float":
            return f"(<double>{text})", FLOAT
        if name == "bit_length":
            return f"mcz_bit_length({text})", INT
        if name == "truncated":
            return f"mcz_truncated({text})", INT
        if name in ("wrapped", "trailing_zeros"):
            return f"mcz_{name}({text})", INT
        return (f"mcz_integer({text})" if type_ == FLOAT else f"(<long long>{text})"), INT

    def _eight_bytes(self, node: ast.Call, name: str) -> Typed:
        text, type_ = self.expr(node.args[0])
        if type_ != Array("uint8", 1):
            raise self.error(node, f"{type_} has no bytes")
        at = self.int_of(node.args[1])
        parts = [f"&{text}[{at}]", f"{text}[{at} + 7]", *map(self.int_of, node.args[2:])]
        root = self.root(node.args[0])
        if name == "put_eight_bytes" and root is not None:
            self.effects.written.add(root)
        return f"mcz_{name}({', '.join(parts)})", INT

    def _call(self, node: ast.Call, where: Source, name: str) -> Typed:
        called = where.functions[name]
        self.needed.append((where, name))
        wanted = [where.type_of(a.annotation) for a in called.args.args if a.annotation]
        if len(wanted) != len(node.args):
            raise self.error(node, f"takes {len(wanted)} arguments")
        texts: list[str] = []
        for item, type_ in zip(node.args, wanted, strict=True):
            text, given = self.expr(item)
            texts.append(self.convert(item, text, given, type_))
        roots = [
            self.root(item) if isinstance(type_, Array) else None
            for item, type_ in zip(node.args, wanted, strict=True)
        ]
        full = mangle_name(where.name, name)
        self.effects.calls.append((full, roots))
        self.called[node] = full
        if called.returns is None:
            raise self.error(node, "does not say what it returns")
        return f"{full}({', '.join(texts)})", where.type_of(called.returns)

    def convert(self, node: ast.AST, text: str, given: Type, wanted: Type) -> str:
        """The text of a value where another type is wanted; arrays only lose what is known."""
        if isinstance(given, Scalar) and isinstance(wanted, Scalar):
            if _widens(given, wanted):
                return text
        elif isinstance(given, Array) and isinstance(wanted, Array):
            if given == wanted or (given.dense and given == Array(wanted.item, wanted.rank)):
                return text
        elif isinstance(given, Tuple) and isinstance(wanted, Tuple):
            pairs = list(zip(given.items, wanted.items, strict=False))
            if len(given.items) == len(wanted.items) and all(
                _widens(one, other) for one, other in pairs
            ):
                return text
        elif given == wanted:
            return text
        raise self.error(node, f"is {given}, not {wanted}")


def _widens(given: Scalar, wanted: Scalar) -> bool:
    """True if each number of one type is also one of the other."""
    known = given in RANKED and wanted in RANKED
    return given == wanted or (known and RANKED.index(given) < RANKED.index(wanted))


BUILTINS = {
    "min",
    "max",
    "abs",
    "len",
    "int",
    "float",
    "bit_length",
    "eight_bytes",
    "put_eight_bytes",
    "trailing_zeros",
    "truncated",
    "wrapped",
}
