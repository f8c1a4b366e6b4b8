"""Parts of arrays in compiled loops: where they lie, read and written.

An index below zero counts from the end, as in Python. No index is checked, unless all of them are:
one out of range then is noted with its line, and nothing outside the array is touched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mcz.jit.emitter import Emitter
from mcz.jit.types import BOOL, INT, ITEMS, Array, LoopError, Value, array

Slice = tuple[Value | None, Value | None]  # start and stop
FAULT, NOWHERE = "@fault", "@nowhere"  # of a module that checks


@dataclass(frozen=True)
class View:
    """Part of an array; one item where it has no axis."""

    item: str
    address: str
    lengths: list[str]
    strides: list[str]

    def value(self) -> Value:
        return array(self.item, self.address, self.lengths, self.strides)


def view_of(value: Value) -> View:
    assert isinstance(value.type, Array)
    return View(value.type.item, value.address, list(value.lengths), list(value.strides))


class Arrays(Emitter):
    """Emits what reads and writes arrays."""

    def __init__(self, checked: bool) -> None:
        super().__init__()
        self.checked = checked
        self.line = 0  # of the source

    def select(self, view: View, indices: Sequence[Value | Slice]) -> View:
        """Part of ``view``: an index or a slice an axis, all of those that are not named."""
        if len(indices) > len(view.lengths):
            raise LoopError("more indices than axes")
        offsets, lengths, strides, inside = [], [], [], []
        for axis, index in enumerate(indices):
            length, stride = view.lengths[axis], view.strides[axis]
            if isinstance(index, Value):
                self.scalar(index, INT)
                start = self._from_end(index, length)
                inside.append((start, length))
            else:
                start, stop = self._bounds(index, length)
                size = self.op(f"sub i64 {stop}, {start}")
                lengths.append(self._most(size, "0"))
                strides.append(stride)
            if start != "0":
                factor = start if stride == "1" else self.op(f"mul i64 {start}, {stride}")
                offsets.append(factor)
        lengths += view.lengths[len(indices) :]
        strides += view.strides[len(indices) :]
        address = self._moved(view, offsets)
        if self.checked and inside:
            address, lengths = self._check(address, inside, lengths)
        return View(view.item, address, lengths, strides)

    def _from_end(self, index: Value, length: str) -> str:
        if isinstance(index.known, int) and index.known >= 0:
            return index.parts[0]
        added = self.op(f"add i64 {index.parts[0]}, {length}")
        below = self.op(f"icmp slt i64 {index.parts[0]}, 0")
        return self.op(f"select i1 {below}, i64 {added}, i64 {index.parts[0]}")

    def _bounds(self, bounds: Slice, length: str) -> tuple[str, str]:
        ends = ["0", length]
        for place, bound in enumerate(bounds):
            if bound is not None and bound.known != 0:
                end = self._most(self._from_end(bound, length), "0")
                above = self.op(f"icmp sgt i64 {end}, {length}")
                ends[place] = self.op(f"select i1 {above}, i64 {length}, i64 {end}")
            elif bound is not None:
                ends[place] = "0"
        return ends[0], ends[1]

    def _most(self, one: str, other: str) -> str:
        above = self.op(f"icmp sgt i64 {one}, {other}")
        return self.op(f"select i1 {above}, i64 {one}, i64 {other}")

    def _moved(self, view: View, offsets: list[str]) -> str:
        address = view.address
        for offset in offsets:
            machine = ITEMS[view.item][0]
            address = self.op(f"getelementptr {machine}, ptr {address}, i64 {offset}")
        return address

    def _check(
        self, address: str, inside: list[tuple[str, str]], lengths: list[str]
    ) -> tuple[str, list[str]]:
        """Where an index is out of range: note it, and go on with nothing."""
        fine = "true"
        for index, length in inside:
            this = self.op(f"icmp ult i64 {index}, {length}")
            fine = self.op(f"and i1 {fine}, {this}")
        before = self.op(f"load i64, ptr {FAULT}")
        known = self.op(f"or i1 {fine}, {self.op(f'icmp ne i64 {before}, 0')}")
        note = self.op(f"select i1 {known}, i64 {before}, i64 {self.line}")
        self.do(f"store i64 {note}, ptr {FAULT}")
        address = self.op(f"select i1 {fine}, ptr {address}, ptr {NOWHERE}")
        return address, [self.op(f"select i1 {fine}, i64 {length}, i64 0") for length in lengths]

    def get(self, view: View) -> Value:
        """The item of a view without axes, or the view as an array."""
        if view.lengths:
            return view.value()
        machine, _, type_ = ITEMS[view.item]
        found = self.op(f"load {machine}, ptr {view.address}")
        if machine != "i8":
            return Value(type_, (found,))
        if type_ == BOOL:
            return Value(BOOL, (self.op(f"icmp ne i8 {found}, 0"),))
        return Value(INT, (self.op(f"zext i8 {found} to i64"),))

    def put(self, view: View, value: Value) -> None:
        """Write a number to all of a view, or an array of the same shape."""
        if not view.lengths:
            self._put_item(view, value)
            return

        def body(at: str, following: str, end: str) -> None:
            index = Value(INT, (at,))
            row = value
            if is_array:  # of the same shape, or too short where that is checked
                source = view_of(value)
                row = self.get(
                    self.select(source, [index]) if self.checked else self._row(source, index)
                )
            self.put(self._row(view, index), row)

        is_array = isinstance(value.type, Array)
        if isinstance(value.type, Array) and value.type.rank != len(view.lengths):
            raise LoopError(f"{value.type} does not fit the axes that it is written to")
        self.repeat("0", view.lengths[0], 1, body)

    def _row(self, view: View, index: Value) -> View:
        """One index of the first axis, known to be in range."""
        stride = view.strides[0]
        offset = index.parts[0]
        if stride != "1":
            offset = self.op(f"mul i64 {offset}, {stride}")
        address = self._moved(view, [offset])
        return View(view.item, address, view.lengths[1:], view.strides[1:])

    def _put_item(self, view: View, value: Value) -> None:
        machine, _, type_ = ITEMS[view.item]
        part = self.convert(value, type_).parts[0]
        if machine == "i8":
            before = "i1" if type_ == BOOL else "i64"
            step = "zext" if type_ == BOOL else "trunc"
            part = self.op(f"{step} {before} {part} to i8")
        self.do(f"store {machine} {part}, ptr {view.address}")

    def make(self, item: str, lengths: list[Value], filled: bool) -> Value:
        """A new array, its address kept in a slot until the function ends."""
        size = ITEMS[item][1]
        total = "1"
        strides: list[str] = []
        for length in reversed(lengths):
            self.scalar(length, INT)
            strides.insert(0, total)
            total = length.parts[0] if total == "1" else self._product(total, length.parts[0])
        call = f"call ptr @calloc(i64 {total}, i64 {size})"
        if not filled:
            call = f"call ptr @malloc(i64 {self._product(total, str(size))})"
        address = self.op(call)
        self.keep(address)
        return array(item, address, [length.parts[0] for length in lengths], strides)

    def _product(self, one: str, other: str) -> str:
        return self.op(f"mul i64 {one}, {other}")
