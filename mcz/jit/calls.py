"""Calls in compiled loops: of other loops, and of a few functions of Python and NumPy."""

from __future__ import annotations

import ast
import builtins
import math
from collections.abc import Callable
from types import FunctionType
from typing import Any, Protocol

import numpy as np

from mcz.jit.expressions import Expressions
from mcz.jit.functions import bit_length, truncated
from mcz.jit.types import (
    FLOAT,
    INT,
    NOTHING,
    Array,
    LoopError,
    Tuple,
    Type,
    Value,
)

ONE_FLOAT: dict[Any, str] = {  # of a float64; LLVM knows them, libm computes some
    np.floor: "floor",
    np.rint: "rint",
    np.log2: "log2",
    math.log: "log",
    math.exp: "exp",
    math.cos: "cos",
    math.sin: "sin",
}
ITEM_NAMES = {np.int64: "int64", np.float64: "float64", np.uint8: "uint8", np.bool_: "bool"}
Maker = Callable[["Calls", list[Value]], Value]


class Program(Protocol):
    """The loops that are compiled together."""

    def function(self, function: FunctionType, types: tuple[Type, ...]) -> tuple[str, Type]:
        """Name and type of what a loop returns that is called with values of these types."""


class Calls(Expressions):
    """Emits calls."""

    def __init__(self, program: Program, function: FunctionType, checked: bool) -> None:
        super().__init__(function, checked)
        self.program = program
        self.depth = 0  # of loops around

    def of_Call(self, node: ast.Call) -> Value:  # noqa: N802
        called = self.fixed(node.func)
        called = getattr(called, "loop", called)  # of a kernel or an inner loop
        if node.keywords or any(isinstance(item, ast.Starred) for item in node.args):
            raise LoopError(f"{ast.unparse(node)}: arguments go by their place")
        if called in (np.zeros, np.empty):
            return self._new_array(node, filled=called is np.zeros)
        values = [self.value(item) for item in node.args]
        if getattr(called, "__is_loop__", False):
            return self._call_loop(called, values)
        if called in ONE_FLOAT and len(values) == 1:
            part = self.convert(values[0], FLOAT).parts[0]
            name = f"@llvm.{ONE_FLOAT[called]}.f64"
            return Value(FLOAT, (self.op(f"call double {name}(double {part})"),))
        if called not in MAKERS:
            raise LoopError(f"{ast.unparse(node.func)} cannot be called in a compiled loop")
        return MAKERS[called](self, values)

    def _call_loop(self, called: FunctionType, values: list[Value]) -> Value:
        name, result = self.program.function(called, tuple(value.type for value in values))
        pairs = [
            f"{machine} {part}"
            for value in values
            for machine, part in zip(value.type.parts(), value.parts, strict=True)
        ]
        call = f"call {returned(result)} {name}({', '.join(pairs)})"
        parts = result.parts()
        if not parts:
            self.do(call)
            return Value(NOTHING, ())
        found = self.op(call)
        if len(parts) == 1:
            return Value(result, (found,))
        taken = f"extractvalue {returned(result)} {found}"
        return Value(result, tuple(self.op(f"{taken}, {place}") for place in range(len(parts))))

    def _new_array(self, node: ast.Call, *, filled: bool) -> Value:
        if self.depth:
            raise LoopError("arrays are made in front of loops, not in them")
        item = ITEM_NAMES.get(self.fixed(node.args[1]) if len(node.args) > 1 else np.float64)
        shape = self.value(node.args[0])
        if item is None:
            raise LoopError(f"{ast.unparse(node)}: arrays of int64, float64, uint8, bool_")
        return self.make(item, shape.items() if isinstance(shape.type, Tuple) else [shape], filled)

    def least_or_greatest(self, values: list[Value], order: str) -> Value:
        """As ``min`` and ``max``: of equals the first, and what is not a number only if first."""
        type_ = self.common(values)
        found = self.convert(values[0], type_).parts[0]
        comparison = f"fcmp o{order} double" if type_ == FLOAT else f"icmp s{order} i64"
        type_ = FLOAT if type_ == FLOAT else INT
        for value in values[1:]:
            part = self.convert(value, type_).parts[0]
            this = self.op(f"{comparison} {part}, {found}")
            machine = type_.machine
            found = self.op(f"select i1 {this}, {machine} {part}, {machine} {found}")
        return Value(type_, (found,))

    def size(self, value: Value) -> Value:
        """As ``abs``."""
        part = value.parts[0]
        if self.scalar(value, INT, FLOAT) == INT:
            return Value(INT, (self.op(f"call i64 @llvm.abs.i64(i64 {part}, i1 false)"),))
        return Value(FLOAT, (self.op(f"call double @llvm.fabs.f64(double {part})"),))

    def bit_length(self, value: Value) -> Value:
        part = self.convert(value, INT).parts[0]
        zeros = self.op(f"call i64 @llvm.ctlz.i64(i64 {part}, i1 false)")
        return Value(INT, (self.op(f"sub i64 64, {zeros}"),))

    def truncated(self, value: Value) -> Value:
        part = self.convert(value, FLOAT).parts[0]
        return Value(INT, (self.op(f"fptosi double {part} to i64"),))

    def length(self, value: Value) -> Value:
        """As ``len``."""
        if not isinstance(value.type, Array):
            raise LoopError(f"{value.type} has no length")
        return Value(INT, (value.lengths[0],))

    def whole(self, value: Value) -> Value:
        """As ``int``; what has more than 64 bits gets the nearest there is."""
        if self.scalar(value) != FLOAT:
            return self.convert(value, INT)
        part = value.parts[0]
        return Value(INT, (self.op(f"call i64 @llvm.fptosi.sat.i64.f64(double {part})"),))


def returned(type_: Type) -> str:
    """What a function in LLVM returns for a type."""
    parts = type_.parts()
    return ("void" if not parts else parts[0]) if len(parts) < 2 else "{" + ", ".join(parts) + "}"


def _one(action: Callable[[Calls, Value], Value]) -> Maker:
    """An action with one argument."""

    def make(calls: Calls, values: list[Value]) -> Value:
        if len(values) != 1:
            raise LoopError("one argument is needed")
        return action(calls, values[0])

    return make


def _ldexp(calls: Calls, values: list[Value]) -> Value:
    number, power = calls.convert(values[0], FLOAT), calls.convert(values[1], INT)
    short = calls.op(f"trunc i64 {power.parts[0]} to i32")
    call = f"call double @llvm.ldexp.f64.i32(double {number.parts[0]}, i32 {short})"
    return Value(FLOAT, (calls.op(call),))


MAKERS: dict[Any, Maker] = {
    builtins.min: lambda calls, values: calls.least_or_greatest(values, "lt"),
    builtins.max: lambda calls, values: calls.least_or_greatest(values, "gt"),
    builtins.abs: _one(Calls.size),
    builtins.len: _one(Calls.length),
    bit_length: _one(Calls.bit_length),
    truncated: _one(Calls.truncated),
    builtins.int: _one(Calls.whole),
    builtins.float: _one(lambda calls, value: calls.convert(value, FLOAT)),
    np.int64: _one(Calls.whole),
    math.ldexp: _ldexp,
}
