"""Expressions of compiled loops: names, numbers, operators, conditions, indices.

Integers have 64 bits and wrap around; ``//`` and ``%`` round down as in Python, and give 0 where
the divisor is 0; a shift takes the low six bits of its distance.
"""

from __future__ import annotations

import ast
import builtins
import operator
from collections.abc import Callable
from types import FunctionType
from typing import Any

from mcz.jit.arrays import Arrays, Slice, View, view_of
from mcz.jit.emitter import Slots
from mcz.jit.types import (
    BOOL,
    FLOAT,
    INT,
    Array,
    LoopError,
    Scalar,
    Tuple,
    Value,
    constant,
    pack,
)

ABSENT = object()
INT_OPS = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.BitXor: "xor",
}
FLOAT_OPS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
COMPARISONS = {  # of integers and of floats; nothing but != is true of what is not a number
    ast.Eq: ("eq", "oeq"),
    ast.NotEq: ("ne", "une"),
    ast.Lt: ("slt", "olt"),
    ast.LtE: ("sle", "ole"),
    ast.Gt: ("sgt", "ogt"),
    ast.GtE: ("sge", "oge"),
}
FOLDED: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
}


class Expressions(Arrays):
    """Emits expressions of ``function``; a method for each kind of node."""

    def __init__(self, function: FunctionType, checked: bool) -> None:
        super().__init__(checked)
        self.function = function
        self.names: dict[str, Slots] = {}
        self.own_names: set[str] = set()  # all that the function assigns

    def value(self, node: ast.expr) -> Value:
        """What an expression is worth."""
        fixed = constant(self.fixed(node))
        if fixed is not None:
            return fixed
        method = getattr(self, "of_" + type(node).__name__, None)
        if method is None:
            raise LoopError(f"{type(node).__name__} is not compiled: {ast.unparse(node)}")
        found: Value = method(node)
        return found

    def fixed(self, node: ast.expr) -> Any:
        """What an expression is already when the loop is compiled, or ABSENT."""
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name) and node.id not in self.own_names:
            found = self.function.__globals__.get(node.id, ABSENT)
            return getattr(builtins, node.id, ABSENT) if found is ABSENT else found
        if isinstance(node, ast.Attribute):
            base = self.fixed(node.value)
            return ABSENT if base is ABSENT else getattr(base, node.attr, ABSENT)
        return ABSENT

    def of_Name(self, node: ast.Name) -> Value:  # noqa: N802
        if node.id not in self.names:
            raise LoopError(f"{node.id} is no number here")
        return self.read(self.names[node.id])

    def of_Tuple(self, node: ast.Tuple) -> Value:  # noqa: N802
        return pack([self.value(item) for item in node.elts])

    def of_Attribute(self, node: ast.Attribute) -> Value:  # noqa: N802
        base = self.value(node.value)
        if isinstance(base.type, Array) and node.attr == "shape":
            return pack([Value(INT, (length,)) for length in base.lengths])
        if isinstance(base.type, Tuple) and node.attr in base.type.names:
            return base.items()[base.type.names.index(node.attr)]
        raise LoopError(f".{node.attr} is not compiled")

    def of_Subscript(self, node: ast.Subscript) -> Value:  # noqa: N802
        base = self.value(node.value)
        if isinstance(base.type, Tuple):
            return self._item(base.items(), self.value(node.slice))
        return self.get(self.part(base, node.slice))

    def _item(self, items: list[Value], index: Value) -> Value:
        if isinstance(index.known, int):
            return items[index.known]
        found = items[0]
        for number, item in enumerate(items[1:], 1):
            this = self.op(f"icmp eq i64 {index.parts[0]}, {number}")
            parts = zip(item.type.parts(), item.parts, found.parts, strict=True)
            chosen = [self.op(f"select i1 {this}, {m} {a}, {m} {b}") for m, a, b in parts]
            found = Value(found.type, tuple(chosen))
        return found

    def part(self, base: Value, index: ast.expr) -> View:
        """The part of an array that is named in brackets."""
        if not isinstance(base.type, Array):
            raise LoopError(f"{base.type} has no items")
        nodes = index.elts if isinstance(index, ast.Tuple) else [index]
        return self.select(view_of(base), [self._index(node) for node in nodes])

    def _index(self, node: ast.expr) -> Value | Slice:
        if not isinstance(node, ast.Slice):
            return self.value(node)
        if node.step is not None:
            raise LoopError("slices have no steps")
        ends = [None if end is None else self.value(end) for end in (node.lower, node.upper)]
        return ends[0], ends[1]

    def of_UnaryOp(self, node: ast.UnaryOp) -> Value:  # noqa: N802
        if isinstance(node.op, ast.Not):
            return Value(BOOL, (self.op(f"xor i1 {self.truth(node.operand)}, true"),))
        operand = self.value(node.operand)
        if isinstance(node.op, ast.USub):
            if operand.known is not None:
                return self._constant(-operand.known)
            if self.scalar(operand, INT, FLOAT) == FLOAT:
                return Value(FLOAT, (self.op(f"fneg double {operand.parts[0]}"),))
            return Value(INT, (self.op(f"sub i64 0, {operand.parts[0]}"),))
        raise LoopError(f"{ast.unparse(node)} is not compiled")

    def _constant(self, known: float) -> Value:
        found = constant(known)
        if found is None:
            raise LoopError(f"{known} has more than 64 bits")
        return found

    def of_BinOp(self, node: ast.BinOp) -> Value:  # noqa: N802
        return self.binary(node.op, self.value(node.left), self.value(node.right))

    def binary(self, op: ast.operator, left: Value, right: Value) -> Value:
        if left.known is not None and right.known is not None and type(op) in FOLDED:
            return self._constant(FOLDED[type(op)](left.known, right.known))
        type_ = self.common([left, right])
        if type_ == BOOL and isinstance(op, ast.BitAnd | ast.BitOr | ast.BitXor):
            return self._binary(INT_OPS[type(op)], BOOL, left, right)
        if isinstance(op, ast.Pow):
            return self._power(left, right)
        if isinstance(op, ast.Div) or type_ == FLOAT:
            if type(op) not in FLOAT_OPS:
                raise LoopError(f"{type(op).__name__} of floats is not compiled")
            return self._binary(FLOAT_OPS[type(op)], FLOAT, left, right)
        if type(op) in INT_OPS:
            return self._binary(INT_OPS[type(op)], INT, left, right)
        if isinstance(op, ast.LShift | ast.RShift):
            return self._shift("shl" if isinstance(op, ast.LShift) else "ashr", left, right)
        if isinstance(op, ast.FloorDiv | ast.Mod):
            return self._divide(op, self.convert(left, INT), self.convert(right, INT))
        raise LoopError(f"{type(op).__name__} is not compiled")

    def _binary(self, name: str, type_: Scalar, left: Value, right: Value) -> Value:
        one, other = (self.convert(value, type_).parts[0] for value in (left, right))
        return Value(type_, (self.op(f"{name} {type_.machine} {one}, {other}"),))

    def _shift(self, name: str, left: Value, right: Value) -> Value:
        distance = self._binary("and", INT, right, self._constant(63))
        return self._binary(name, INT, left, distance)

    def _power(self, left: Value, right: Value) -> Value:
        if right.known == 2:
            return self.binary(ast.Mult(), left, left)
        one, other = (self.convert(value, FLOAT).parts[0] for value in (left, right))
        return Value(FLOAT, (self.op(f"call double @llvm.pow.f64(double {one}, double {other})"),))

    def _divide(self, op: ast.operator, left: Value, right: Value) -> Value:
        a, b = left.parts[0], right.parts[0]
        known = right.known
        if isinstance(known, int) and known > 0 and known & (known - 1) == 0:  # a power of 2
            masked, shifted = f"and i64 {a}, {known - 1}", f"ashr i64 {a}, {known.bit_length() - 1}"
            return Value(INT, (self.op(masked if isinstance(op, ast.Mod) else shifted),))
        # 0 and -1, with which the processor may trap, are kept from it.
        special = self.op(f"icmp ult i64 {self.op(f'add i64 {b}, 1')}, 2")
        by = self.op(f"select i1 {special}, i64 1, i64 {b}")
        quotient = self.op(f"sdiv i64 {a}, {by}")
        rest = self.op(f"sub i64 {a}, {self._product(quotient, by)}")
        other_sign = self.op(f"icmp slt i64 {self.op(f'xor i64 {rest}, {by}')}, 0")
        down = self.op(f"and i1 {self.op(f'icmp ne i64 {rest}, 0')}, {other_sign}")
        if isinstance(op, ast.Mod):
            above = self.op(f"add i64 {rest}, {by}")
            return Value(INT, (self.op(f"select i1 {down}, i64 {above}, i64 {rest}"),))
        lower = self.op(f"sub i64 {quotient}, {self.op(f'zext i1 {down} to i64')}")
        product = self._product(a, b)  # by 0 and -1 the right answer
        return Value(INT, (self.op(f"select i1 {special}, i64 {product}, i64 {lower}"),))

    def of_Compare(self, node: ast.Compare) -> Value:  # noqa: N802
        if len(node.ops) == 1:
            left, right = self.value(node.left), self.value(node.comparators[0])
            return self._compare(node.ops[0], left, right)
        return Value(BOOL, (self.truth(node),))

    def _compare(self, op: ast.cmpop, left: Value, right: Value) -> Value:
        type_ = self.common([left, right])
        if not isinstance(type_, Scalar) or type(op) not in COMPARISONS:
            raise LoopError(f"{type(op).__name__} of {type_} is not compiled")
        if type_ == BOOL and not isinstance(op, ast.Eq | ast.NotEq):
            type_ = INT
        of_ints, of_floats = COMPARISONS[type(op)]
        name = f"fcmp {of_floats}" if type_ == FLOAT else f"icmp {of_ints}"
        return Value(BOOL, self._binary(name, type_, left, right).parts)

    def of_BoolOp(self, node: ast.BoolOp) -> Value:  # noqa: N802
        return Value(BOOL, (self.truth(node, strict=True),))

    def truth(self, node: ast.expr, *, strict: bool = False) -> str:
        """Whether a condition holds; ``strict``: of what is no truth itself, Python differs."""
        if not isinstance(node, ast.BoolOp) and not (
            isinstance(node, ast.Compare) and len(node.ops) > 1
        ):
            value = self.value(node)
            if strict:
                self.scalar(value, BOOL)
            return self._truth(value)
        found = self.variable(BOOL)
        yes, no, end = (self.label() for _ in range(3))
        self.branch(node, yes, no, strict=strict)
        for label, answer in ((yes, "true"), (no, "false")):
            self.place(label)
            self.write(found, Value(BOOL, (answer,)))
            self.jump(end)
        self.place(end)
        return self.read(found).parts[0]

    def _truth(self, value: Value) -> str:
        type_ = self.scalar(value)
        if type_ == BOOL:
            return value.parts[0]
        zero = "icmp ne i64 {}, 0" if type_ == INT else "fcmp une double {}, 0.0"
        return self.op(zero.format(value.parts[0]))

    def branch(self, node: ast.expr, yes: str, no: str, *, strict: bool = False) -> None:
        """Go to ``yes`` or ``no``; what need not be known is not computed."""
        if isinstance(node, ast.BoolOp):
            for part in node.values[:-1]:
                following = self.label()
                if isinstance(node.op, ast.And):
                    self.branch(part, following, no, strict=strict)
                else:
                    self.branch(part, yes, following, strict=strict)
                self.place(following)
            self.branch(node.values[-1], yes, no, strict=strict)
        elif isinstance(node, ast.Compare) and len(node.ops) > 1:
            left = self.value(node.left)
            for op, right_node in zip(node.ops, node.comparators, strict=True):
                following = self.label()
                right = self.value(right_node)
                self.fork(self._compare(op, left, right).parts[0], following, no)
                self.place(following)
                left = right
            self.jump(yes)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            self.branch(node.operand, no, yes)
        else:
            self.fork(self.truth(node, strict=strict), yes, no)

    def of_IfExp(self, node: ast.IfExp) -> Value:  # noqa: N802
        """One of two; only that one is computed."""
        yes, no, end = (self.label() for _ in range(3))
        self.branch(node.test, yes, no)
        self.place(yes)
        first = self.value(node.body)
        after_first = len(self.lines)
        self.jump(end)
        self.place(no)
        second = self.value(node.orelse)
        found = self.variable(self.common([first, second]))
        self.write(found, second)
        self.at(after_first, lambda: self.write(found, first))
        self.place(end)
        return self.read(found)
