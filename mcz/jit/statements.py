"""Statements of compiled loops, and with them a whole function.

The type of a variable is that of what it is first assigned.
"""

from __future__ import annotations

import ast
from types import FunctionType

from mcz.jit.arrays import view_of
from mcz.jit.calls import Calls, Program, returned
from mcz.jit.emitter import Slots
from mcz.jit.types import INT, NOTHING, Array, LoopError, Tuple, Type, Value


class Function(Calls):
    """One function, emitted statement by statement; a method for each kind."""

    def __init__(
        self, program: Program, function: FunctionType, node: ast.FunctionDef, checked: bool
    ) -> None:
        super().__init__(program, function, checked)
        self.node = node
        self.exit = self.label()
        self.result: Slots | None = None
        self.ways_out: list[tuple[str, str]] = []  # of each loop: to go on, to leave

    def text(self, name: str, types: tuple[Type, ...]) -> tuple[str, Type]:
        """The function in LLVM's assembly, and the type of what it returns."""
        names = [argument.arg for argument in self.node.args.args]
        if len(names) != len(types):
            raise LoopError(f"{len(types)} arguments for {len(names)} parameters")
        stored = (n.id for n in ast.walk(self.node) if isinstance(n, ast.Name) and is_stored(n))
        self.own_names = {*names, *stored}
        parameters = []
        for number, (own, type_) in enumerate(zip(names, types, strict=True)):
            parts = [f"%p{number}.{place}" for place in range(len(type_.parts()))]
            parameters += [f"{m} {p}" for m, p in zip(type_.parts(), parts, strict=True)]
            self._assign_name(own, Value(type_, tuple(parts)))
        self._block(self.node.body)
        self.place(self.exit)
        self._leave()
        result = self.result[0] if self.result else NOTHING
        body = "\n  ".join([*self.slots, *self.lines])
        head = f"define internal {returned(result)} {name}({', '.join(parameters)}) nounwind"
        if getattr(self.function, "__is_inlined__", False):
            head += " alwaysinline"
        return f"{head} {{\n  {body}\n}}\n", result

    def _leave(self) -> None:
        for slot in self.kept:
            self.do(f"call void @free(ptr {self.op(f'load ptr, ptr {slot}')})")
        if self.result is None or not self.result[1]:
            self.do("ret void")
            return
        value = self.read(self.result)
        type_, found = returned(value.type), value.parts[0]
        if len(value.parts) > 1:
            found = "poison"
            for place, (m, part) in enumerate(zip(value.type.parts(), value.parts, strict=True)):
                found = self.op(f"insertvalue {type_} {found}, {m} {part}, {place}")
        self.do(f"ret {type_} {found}")

    def _block(self, nodes: list[ast.stmt]) -> None:
        for node in nodes:
            self.line = node.lineno
            method = getattr(self, "do_" + type(node).__name__, None)
            if method is None:
                raise LoopError(f"{type(node).__name__} is not compiled")
            method(node)

    def do_Pass(self, node: ast.Pass) -> None:  # noqa: N802
        pass

    def do_Expr(self, node: ast.Expr) -> None:  # noqa: N802
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.value(node.value)

    def do_Return(self, node: ast.Return) -> None:  # noqa: N802
        value = Value(NOTHING, ()) if node.value is None else self.value(node.value)
        if self.result is None:
            self.result = self.variable(value.type)
        self.write(self.result, value)
        self.jump(self.exit)

    def do_Assign(self, node: ast.Assign) -> None:  # noqa: N802
        value = self.value(node.value)
        for target in node.targets:
            self._assign(target, value)

    def do_AnnAssign(self, node: ast.AnnAssign) -> None:  # noqa: N802
        if node.value is not None:
            self._assign(node.target, self.value(node.value))

    def do_AugAssign(self, node: ast.AugAssign) -> None:  # noqa: N802
        if isinstance(node.target, ast.Name):
            before = self.of_Name(node.target)
            self._assign(node.target, self.binary(node.op, before, self.value(node.value)))
            return
        if not isinstance(node.target, ast.Subscript):
            raise LoopError(f"{ast.unparse(node.target)} cannot be assigned")
        part = self.part(self.value(node.target.value), node.target.slice)
        if part.lengths:
            raise LoopError("whole arrays are not computed with")
        right = self.value(node.value)
        self.put(part, self.binary(node.op, self.get(part), right))

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._assign_name(target.id, value)
        elif isinstance(target, ast.Tuple) and isinstance(value.type, Tuple):
            for one, item in zip(target.elts, value.items(), strict=True):
                self._assign(one, item)
        elif isinstance(target, ast.Tuple) and isinstance(value.type, Array):
            for place, one in enumerate(target.elts):
                index = Value(INT, (str(place),), place)
                part = self.select(view_of(value), [index])
                self._assign(one, self.get(part))
        elif isinstance(target, ast.Subscript):
            self.put(self.part(self.value(target.value), target.slice), value)
        else:
            raise LoopError(f"{ast.unparse(target)} cannot be assigned")

    def _assign_name(self, name: str, value: Value) -> None:
        if name not in self.names:
            self.names[name] = self.variable(value.type)
        self.write(self.names[name], value)

    def do_If(self, node: ast.If) -> None:  # noqa: N802
        yes, no, end = (self.label() for _ in range(3))
        self.branch(node.test, yes, no)
        self.place(yes)
        self._block(node.body)
        self.jump(end)
        self.place(no)
        self._block(node.orelse)
        self.place(end)

    def do_While(self, node: ast.While) -> None:  # noqa: N802
        test, inside, end = (self.label() for _ in range(3))
        self.place(test)
        self.branch(node.test, inside, end)
        self.place(inside)
        self._body(node, test, end)
        self.jump(test)
        self.place(end)

    def _body(self, node: ast.For | ast.While, following: str, end: str) -> None:
        if node.orelse:
            raise LoopError("loops have no else")
        self.ways_out.append((following, end))
        self.depth += 1
        self._block(node.body)
        self.depth -= 1
        self.ways_out.pop()

    def do_Continue(self, node: ast.Continue) -> None:  # noqa: N802
        self.jump(self.ways_out[-1][0])

    def do_Break(self, node: ast.Break) -> None:  # noqa: N802
        self.jump(self.ways_out[-1][1])

    def do_For(self, node: ast.For) -> None:  # noqa: N802
        if isinstance(node.iter, ast.Call) and self.fixed(node.iter.func) is range:
            self._for_range(node, [self.value(item) for item in node.iter.args])
            return
        over = self.value(node.iter)
        if isinstance(over.type, Tuple):
            self._for_items(node, over.items())
        elif isinstance(over.type, Array):
            self._for_rows(node, over)
        else:
            raise LoopError(f"no loop over {over.type}")

    def _for_range(self, node: ast.For, given: list[Value]) -> None:
        for value in given:
            self.scalar(value, INT)
        zero, one = Value(INT, ("0",), 0), Value(INT, ("1",), 1)
        start, stop, step = ([zero, *given, one] if len(given) == 1 else [*given, one])[:3]
        if not isinstance(step.known, int) or step.known == 0:
            raise LoopError("the step of a range is a number that is not 0")

        def body(at: str, following: str, end: str) -> None:
            self._assign(node.target, Value(INT, (at,)))
            self._body(node, following, end)

        self.repeat(start.parts[0], stop.parts[0], step.known, body)

    def _for_items(self, node: ast.For, items: list[Value]) -> None:
        """A tuple is no loop: its items are worked on one after the other."""
        end = self.label()
        for item in items:
            following = self.label()
            self._assign(node.target, item)
            self._body(node, following, end)
            self.place(following)
        self.place(end)

    def _for_rows(self, node: ast.For, over: Value) -> None:
        def body(at: str, following: str, end: str) -> None:
            self._assign(node.target, self.get(self._row(view_of(over), Value(INT, (at,)))))
            self._body(node, following, end)

        self.repeat("0", over.lengths[0], 1, body)


def is_stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)
