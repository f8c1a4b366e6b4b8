"""The text of one function in LLVM's assembly: lines, blocks, variables, conversions.

Variables lie in slots of the stack, which LLVM turns into registers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mcz.jit.types import (
    BOOL,
    FLOAT,
    INT,
    RANKED,
    Array,
    LoopError,
    Scalar,
    Tuple,
    Type,
    Value,
    pack,
)

WIDER = {  # what turns one scalar into another
    (BOOL, INT): "zext i1 {} to i64",
    (BOOL, FLOAT): "uitofp i1 {} to double",
    (INT, FLOAT): "sitofp i64 {} to double",
}
Slots = tuple[Type, list[str]]


class Emitter:
    """A function that grows line by line."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.slots: list[str] = []  # lines that make them, in front of all others
        self.kept: list[str] = []  # slots of memory to be given back
        self._count = 0
        self._closed = False  # the block has its last line

    def _new(self) -> str:
        self._count += 1
        return f"%v{self._count}"

    def keep(self, address: str) -> None:
        """Note memory that is given back where the function ends."""
        slot = self._new()
        self.slots += [f"{slot} = alloca ptr", f"store ptr null, ptr {slot}"]
        self.do(f"store ptr {address}, ptr {slot}")
        self.kept.append(slot)

    def do(self, line: str) -> None:
        """A line without a result."""
        if self._closed:
            self.place(self.label())  # nothing comes here: LLVM drops it
        self.lines.append(line)

    def op(self, text: str) -> str:
        """The name of what an instruction returns."""
        name = self._new()
        self.do(f"{name} = {text}")
        return name

    def label(self) -> str:
        self._count += 1
        return f"L{self._count}"

    def place(self, label: str) -> None:
        """Here begins a block, which comes after the one before where that is still open."""
        if not self._closed:
            self.lines.append(f"br label %{label}")
        self.lines.append(f"{label}:")
        self._closed = False

    def jump(self, label: str) -> None:
        self.do(f"br label %{label}")
        self._closed = True

    def fork(self, condition: str, yes: str, no: str) -> None:
        self.do(f"br i1 {condition}, label %{yes}, label %{no}")
        self._closed = True

    def at(self, place: int, action: Callable[[], None]) -> None:
        """What ``action`` emits goes in front of the line number ``place``."""
        lines, self.lines = self.lines, []
        closed, self._closed = self._closed, False
        action()
        lines[place:place] = self.lines
        self.lines, self._closed = lines, closed

    def variable(self, type_: Type) -> Slots:
        """A new variable, all zeros."""
        names = []
        for machine in type_.parts():
            name = self._new()
            self.slots.append(f"{name} = alloca {machine}")
            self.slots.append(f"store {machine} zeroinitializer, ptr {name}")
            names.append(name)
        return type_, names

    def read(self, variable: Slots) -> Value:
        type_, names = variable
        parts = zip(type_.parts(), names, strict=True)
        return Value(type_, tuple(self.op(f"load {m}, ptr {name}") for m, name in parts))

    def write(self, variable: Slots, value: Value) -> None:
        type_, names = variable
        value = self.convert(value, type_)
        for machine, part, name in zip(type_.parts(), value.parts, names, strict=True):
            self.do(f"store {machine} {part}, ptr {name}")

    def convert(self, value: Value, type_: Type) -> Value:
        """``value`` as another type, which can hold all that its own can."""
        own = value.type
        if own == type_:
            return value
        if isinstance(own, Scalar) and isinstance(type_, Scalar) and (own, type_) in WIDER:
            return Value(type_, (self.op(WIDER[own, type_].format(value.parts[0])),))
        if isinstance(own, Tuple) and isinstance(type_, Tuple):
            pairs = zip(value.items(), type_.items, strict=True)
            return pack([self.convert(item, wanted) for item, wanted in pairs])
        if isinstance(own, Array) and isinstance(type_, Array) and own.dense > type_.dense:
            return Value(type_, (*value.parts, "1"))
        raise LoopError(f"{own} where {type_} is needed: give a variable one type")

    def scalar(self, value: Value, *allowed: Scalar) -> Scalar:
        """The type of a number; LoopError where it is none, or not one of ``allowed``."""
        if isinstance(value.type, Scalar) and value.type in (allowed or RANKED):
            return value.type
        raise LoopError(f"{value.type} is not {' or '.join(t.name for t in allowed or RANKED)}")

    def common(self, values: Sequence[Value]) -> Type:
        """The least type that holds all of these."""
        types = [value.type for value in values]
        if all(type_ in RANKED for type_ in types):
            return max((self.scalar(value) for value in values), key=RANKED.index)
        if all(isinstance(type_, Tuple) for type_ in types):
            columns = zip(*(value.items() for value in values), strict=True)
            return Tuple(tuple(self.common(column) for column in columns))
        if all(isinstance(type_, Array) for type_ in types):
            return min(types, key=lambda type_: isinstance(type_, Array) and type_.dense)
        raise LoopError(f"nothing holds each of {', '.join(map(str, types))}")

    def repeat(
        self, start: str, stop: str, step: int, body: Callable[[str, str, str], None]
    ) -> None:
        """A loop over integers; ``body`` gets the integer, where to go on, and where to leave."""
        variable = self.variable(INT)
        self.write(variable, Value(INT, (start,)))
        test, inside, following, end = (self.label() for _ in range(4))
        self.place(test)
        at = self.read(variable).parts[0]
        self.fork(self.op(f"icmp {'slt' if step > 0 else 'sgt'} i64 {at}, {stop}"), inside, end)
        self.place(inside)
        body(at, following, end)
        self.place(following)
        self.write(variable, Value(INT, (self.op(f"add nsw i64 {at}, {step}"),)))
        self.jump(test)
        self.place(end)
