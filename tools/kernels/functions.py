"""A function of a kernel in Cython: its statements, and the declarations of its variables."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any

from tools.kernels.annotations import (
    BOOL,
    FLOAT,
    INT,
    NOTHING,
    Array,
    Record,
    Scalar,
    Tuple,
    Type,
)
from tools.kernels.expressions import Expressions, Root
from tools.kernels.source import Source, mangle_name

DTYPES = {
    "np.int64": "int64",
    "np.int32": "int32",
    "np.float64": "float64",
    "np.uint8": "uint8",
    "np.bool_": "bool",
}


class Function(Expressions):
    """One function; ``lines`` is its body, ``types`` are those of its variables."""

    def __init__(self, source: Source, name: str) -> None:
        super().__init__(source, source.functions[name])
        self.name = mangle_name(source.name, name)
        self.parameters: list[tuple[str, Type]] = []
        for argument in self.node.args.args:
            if argument.annotation is None:
                raise self.error(argument, "has no type")
            type_ = source.type_of(argument.annotation)
            named = source.imported.get(ast.unparse(argument.annotation))
            self.modules |= {named[0]} if named else set()
            self.parameters.append((argument.arg, type_))
            self.types[argument.arg] = type_
        if self.node.returns is None:
            raise self.error(self.node.args, "does not say what it returns")
        self.returns = source.type_of(self.node.returns)
        if not isinstance(self.returns, Scalar | Tuple):
            raise self.error(self.node.returns, "is returned by no kernel")
        self.lines: list[str] = []
        self.depth = 1
        self.n_temporaries = 0
        self._block(self.node.body)
        if self.returns == NOTHING:
            self.line("return 0")

    def line(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    def temporary(self, type_: Type, *roots: Root | None) -> str:
        """A new variable."""
        self.n_temporaries += 1
        name = f"temporary_{self.n_temporaries}"
        self.types[name] = type_
        self.effects.aliases[name] = {root for root in roots if root is not None}
        return name

    def _block(self, nodes: list[ast.stmt]) -> None:
        before = len(self.lines)
        for node in nodes:
            method = getattr(self, "do_" + type(node).__name__, None)
            if method is None:
                raise self.error(node, "is not compiled")
            method(node)
        if len(self.lines) == before:
            self.line("pass")

    def _write_block(self, nodes: list[ast.stmt]) -> None:
        self.depth += 1
        self._block(nodes)
        self.depth -= 1

    def do_Pass(self, node: ast.Pass) -> None:  # noqa: N802
        self.line("pass")

    def do_Break(self, node: ast.Break) -> None:  # noqa: N802
        self.line("break")

    def do_Continue(self, node: ast.Continue) -> None:  # noqa: N802
        self.line("continue")

    def do_Expr(self, node: ast.Expr) -> None:  # noqa: N802
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.line(self.expr(node.value)[0])

    def do_Return(self, node: ast.Return) -> None:  # noqa: N802
        if node.value is None:
            self.line("return 0")
            return
        text, type_ = self.expr(node.value)
        self.line(f"return {self.convert(node, text, type_, self.returns)}")

    def do_If(self, node: ast.If) -> None:  # noqa: N802
        self.line(f"if {self.truth(node.test)}:")
        self._write_block(node.body)
        if node.orelse:
            self.line("else:")
            self._write_block(node.orelse)

    def do_While(self, node: ast.While) -> None:  # noqa: N802
        self.line(f"while {self.truth(node.test)}:")
        self._write_block(node.body)

    def do_AnnAssign(self, node: ast.AnnAssign) -> None:  # noqa: N802
        if node.value is not None:
            self._assign_all([node.target], node.value)

    def do_Assign(self, node: ast.Assign) -> None:  # noqa: N802
        self._assign_all(node.targets, node.value)

    def do_AugAssign(self, node: ast.AugAssign) -> None:  # noqa: N802
        if any(
            isinstance(n, ast.Call) and ast.unparse(n.func) != "len" for n in ast.walk(node.target)
        ):
            raise self.error(node, "calls a function in a target, which C leaves open how often")
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        text, type_ = self.binary(node, node.op, self.number(load), self.number(node.value))
        self._assign(node.target, text, type_, None)

    def _assign_all(self, targets: list[ast.expr], value: ast.expr) -> None:
        if _is_allocation(value):
            for target in targets:
                self._allocate(target, value)
            return
        if isinstance(value, ast.Attribute) and value.attr == "shape":
            text, type_ = self.expr(value.value)
            assert isinstance(type_, Array) and isinstance(targets[0], ast.Tuple)
            for axis, target in enumerate(targets[0].elts):
                self._assign(target, f"<long long>{text}.shape[{axis}]", INT, None)
            return
        if isinstance(value, ast.Tuple) and isinstance(targets[0], ast.Tuple):
            self._assign_several(targets[0], value)
            return
        text, type_ = self.expr(value)
        root = self.root(value) if isinstance(type_, Array) else None
        if len(targets) > 1 and isinstance(type_, Scalar) and self.constant_of(value) is None:
            name = self.temporary(type_)
            self.line(f"{name} = {text}")
            text = name
        for target in targets:
            self._assign(target, text, type_, root)

    def _assign_several(self, target: ast.Tuple, value: ast.Tuple) -> None:
        """Assign a, b = c, d: all values are known before the first is assigned."""
        simple = {n.id for n in ast.walk(target) if isinstance(n, ast.Name)}
        used = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)}
        calls = any(isinstance(n, ast.Call) for n in ast.walk(value))
        stored = any(not isinstance(one, ast.Name) for one in target.elts)
        held: list[tuple[str, Type, Root | None]] = []
        for one, item in zip(target.elts, value.elts, strict=True):
            if _is_allocation(item):
                self._allocate(one, item)
                held.append(("", NOTHING, None))
                continue
            text, type_ = self.expr(item)
            root = self.root(item) if isinstance(type_, Array) else None
            if self.constant_of(item) is None and (simple & used or stored or calls):
                name = self.temporary(type_, root)
                self.line(f"{name} = {text}")
                text, root = name, name if root is not None else None
            held.append((text, type_, root))
        for one, (text, type_, root) in zip(target.elts, held, strict=True):
            if text:
                self._assign(one, text, type_, root)

    def _allocate(self, target: ast.expr, value: ast.expr) -> None:
        assert isinstance(value, ast.Call) and isinstance(target, ast.Name)
        item = DTYPES[ast.unparse(value.args[1])] if len(value.args) > 1 else "float64"
        shape = value.args[0].elts if isinstance(value.args[0], ast.Tuple) else [value.args[0]]
        lengths = ", ".join(self.int_of(length) for length in shape)
        if target.id not in self.types:
            self.types[target.id] = Array(item, len(shape))
        self.effects.written.add(target.id)
        self.effects.aliases.setdefault(target.id, set())
        self.effects.allocates = True
        self.line("with gil:")
        self.line(f"    {target.id} = {ast.unparse(value.func)[3:]}(({lengths},), {item}_)")

    def _assign(self, target: ast.expr, text: str, type_: Type, root: Root | None) -> None:
        if isinstance(target, ast.Name):
            self._assign_name(target, text, type_, root)
        elif isinstance(target, ast.Tuple):
            self._unpack(target, text, type_, root)
        elif isinstance(target, ast.Subscript):
            self._store(target, text, type_, root)
        else:
            raise self.error(target, "cannot be assigned")

    def _assign_name(self, node: ast.Name, text: str, type_: Type, root: Root | None) -> None:
        name = node.id
        if name not in self.types:
            self.types[name] = type_
        if isinstance(type_, Array) and root is not None:
            self.effects.aliases.setdefault(name, set()).add(root)
            if isinstance(root, tuple) and self.stores[name] == 1 and self._is_parameter(text):
                self.shared[name] = text  # a memoryview of its own would cost two atomic steps
                return
        self.line(f"{name} = {self.convert(node, text, type_, self.types[name])}")

    def _is_parameter(self, text: str) -> bool:
        """True if a text is a field of a given record, not a part of that field."""
        name, *fields = text.split(".")
        given = name in dict(self.parameters) and name not in self.stores
        return given and all(field.isidentifier() for field in fields)

    def _unpack(self, target: ast.Tuple, text: str, type_: Type, root: Root | None) -> None:
        if isinstance(type_, Tuple):
            name = self.temporary(type_)
            self.line(f"{name} = {text}")
            for place, (one, item) in enumerate(zip(target.elts, type_.items, strict=True)):
                if not (isinstance(one, ast.Name) and one.id == "_"):
                    self._assign(one, f"{name}[{place}]", item, None)
        elif isinstance(type_, Record):
            for one, (field, kind) in zip(target.elts, type_.fields, strict=True):
                if not (isinstance(one, ast.Name) and one.id == "_"):
                    self._assign(one, f"{text}.{field}", kind, (type_.name, field))
        elif isinstance(type_, Array) and type_.rank == 1:
            name = self.temporary(type_, root)
            self.line(f"{name} = {text}")
            for place, one in enumerate(target.elts):
                item = FLOAT if type_.item == "float64" else INT
                self._assign(one, f"{name}[{place}]", item, None)
        else:
            raise self.error(target, f"{type_} is not unpacked")

    def _store(self, target: ast.Subscript, text: str, type_: Type, root: Root | None) -> None:
        whole = self.root(target)
        if whole is not None:
            self.effects.written.add(whole)
        place, kind = self.expr(target)
        if isinstance(kind, Scalar):
            self.line(f"{place} = {self.convert(target, text, type_, kind)}")
            return
        assert isinstance(kind, Array)
        into = self.temporary(kind, whole)
        self.effects.written.add(into)
        self.line(f"{into} = {place}")
        axes = [self.temporary(INT) for _ in range(kind.rank)]
        index = f"[{', '.join(axes)}]"
        if isinstance(type_, Array):
            name = self.temporary(type_, root)
            self.line(f"{name} = {text}")
            text = name + index
        for axis, name in enumerate(axes):
            self.line(f"{'    ' * axis}for {name} in range({into}.shape[{axis}]):")
        self.line(f"{'    ' * kind.rank}{into}{index} = {text}")

    def do_For(self, node: ast.For) -> None:  # noqa: N802
        if isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "range":
            self._for_range(node, node.iter)
            return
        fixed = self.constant_of(node.iter)
        if not isinstance(fixed, tuple) and isinstance(node.iter, ast.Tuple):
            values = tuple(map(self.constant_of, node.iter.elts))
            fixed = values if None not in values else None
        if isinstance(fixed, tuple):
            self._for_constants(node, fixed)
            return
        text, type_ = self.expr(node.iter)
        if isinstance(type_, Tuple):
            for place, item in enumerate(type_.items):
                self._assign(node.target, f"{text}[{place}]", item, None)
                self._block(node.body)
            return
        if not isinstance(type_, Array):
            raise self.error(node.iter, "is not looped over")
        at = self.temporary(INT)
        self.line(f"for {at} in range({text}.shape[0]):")
        self.depth += 1
        part = Array(type_.item, type_.rank - 1, type_.dense) if type_.rank > 1 else None
        item = {"float64": FLOAT, "bool": BOOL}.get(type_.item, INT)
        self._assign(node.target, f"{text}[{at}]", part or item, self.root(node.iter))
        self.depth -= 1
        self._write_block(node.body)

    def _for_range(self, node: ast.For, call: ast.Call) -> None:
        ends = [self.int_of(item) for item in call.args]
        if len(ends) == 3:
            step = self.constant_of(call.args[2])
            if not isinstance(step, int):
                raise self.error(call, "the step of a range is a constant")
            ends[2] = str(step)
        if not isinstance(node.target, ast.Name):
            raise self.error(node.target, "is no variable")
        name = node.target.id
        # As in Python, the variable keeps its last value, and changes to it do not reach the loop.
        changed = any(
            isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Store)
            for part in node.body
            for n in ast.walk(part)
        )
        self.types.setdefault(name, INT)
        at = self.temporary(INT) if changed else name
        self.line(f"for {at} in range({', '.join(ends)}):")
        if changed:
            self.line(f"    {name} = {at}")
        self._write_block(node.body)

    def _for_constants(self, node: ast.For, values: tuple[Any, ...]) -> None:
        at = self.temporary(INT)
        self.line(f"for {at} in range({len(values)}):")
        self.depth += 1
        if isinstance(node.target, ast.Tuple):
            for one, column in zip(node.target.elts, zip(*values, strict=True), strict=True):
                name, type_ = self.table(node.iter, tuple(column))
                self._assign(one, f"{name}[{at}]", type_, None)
        elif not (isinstance(node.target, ast.Name) and node.target.id == "_"):
            name, type_ = self.table(node.iter, values)
            self._assign(node.target, f"{name}[{at}]", type_, None)
        self.depth -= 1
        self._write_block(node.body)

    def find_unordered_calls(self) -> Iterator[tuple[ast.AST, list[str]]]:
        """Expressions with calls in several operands, whose order C leaves open; the calls."""
        for node in ast.walk(self.node):
            called = [
                [self.called[n] for n in ast.walk(part) if n in self.called]
                for part in _operands(node)
            ]
            if sum(map(bool, called)) > 1:
                yield node, [name for names in called for name in names]

    def declarations(self, written: set[Root]) -> list[str]:
        """The types of variables that are no parameters."""
        own = {name for name, _ in self.parameters}
        names = (name for name in self.types if name not in own | self.shared.keys())
        return [f"    cdef {type_text(self.types[name], name in written)} {name}" for name in names]


def type_text(type_: Type, written: bool) -> str:
    """The type in Cython."""
    return type_.c(written=written) if isinstance(type_, Array) else type_.c


def _operands(node: ast.AST) -> list[ast.expr]:
    """The parts of an expression, or of an assignment, that C computes in any order."""
    if isinstance(node, ast.BinOp):
        return [node.left, node.right]
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    if isinstance(node, ast.Call):
        return node.args
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
        return node.slice.elts
    return [node.value, *node.targets] if isinstance(node, ast.Assign) else []


def _is_allocation(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.zeros", "np.empty")
