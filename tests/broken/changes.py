"""The changes that a breaker tries on a statement or expression: a few operators, many places.

Each operator is a function from a node to what may stand there instead. ``OPERATORS`` has them in
the order in which they are tried: a check that never refuses comes first, a number that is off by
one last.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator
from functools import cache

from tests.broken.marks import Slot, modules, parse_module, slots, source

Changed = Iterator[ast.AST]
_RELAXED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_SWAPPED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitOr,
}


def off(node: ast.AST) -> Changed:
    """A condition that never holds, alone or within a chain; a bound that a validator forgets."""
    if isinstance(node, ast.If | ast.While):
        yield _with(node, "test", ast.Constant(False))
    if isinstance(node, ast.Lambda):
        yield _with(node, "body", ast.Constant(True))
    if isinstance(node, ast.IfExp):
        yield node.orelse


def unchecked(node: ast.AST) -> Changed:
    """Remove the check from a schema."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
        if node.func.id in ("ExprValidator", "OneOf", "NoneOf", "Const"):
            yield node.args[0]
        elif node.func.id[0].isupper() and len(node.args) > 1:
            yield node.args[-1]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        yield _with(node, "right", _attribute(node.right, "item"))


def drop(node: ast.AST) -> Changed:
    """A chain of conditions without one of them; half of a comparison between two bounds."""
    if isinstance(node, ast.BoolOp):
        for i in range(len(node.values)):
            rest = node.values[:i] + node.values[i + 1 :]
            yield rest[0] if len(rest) == 1 else _with(node, "values", rest)
    if isinstance(node, ast.Compare) and len(node.ops) > 1:
        yield ast.Compare(node.comparators[0], node.ops[1:], node.comparators[1:])
        yield ast.Compare(node.left, node.ops[:-1], node.comparators[:-1])
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        left, right = node.left, node.comparators[0]
        if isinstance(left, ast.Tuple) and isinstance(right, ast.Tuple):
            for i in range(len(left.elts)):
                yield ast.Compare(_without(left, i), node.ops, [_without(right, i)])


def clamped(node: ast.AST) -> Changed:
    """A bound that is taken in place of what lies beyond it."""
    if isinstance(node, ast.If) and isinstance(node.body[0], ast.Raise | ast.Return):
        for test in ast.walk(node.test):
            if isinstance(test, ast.Compare) and isinstance(test.left, ast.Name):
                target = ast.Name(test.left.id, ast.Store())
                if len(test.ops) == 1:
                    yield _with(node, "body", [ast.Assign([target], test.comparators[0])])


def out(node: ast.AST) -> Changed:
    """A statement that is left out, or leaves its function."""
    if isinstance(node, ast.Expr | ast.Raise | ast.AugAssign | ast.Assign | ast.Continue):
        yield ast.Pass()
    if isinstance(node, ast.Break | ast.Delete | ast.For):
        yield ast.Pass()
    if isinstance(node, ast.Raise):
        yield ast.Return(None)


def refuse(node: ast.AST) -> Changed:
    """Raise FormatError for UnsupportedError."""
    if isinstance(node, ast.Name) and node.id == "UnsupportedError":
        yield _attribute(node, "__base__")


def on(node: ast.AST) -> Changed:
    """A condition that always holds."""
    if isinstance(node, ast.If | ast.While):
        yield _with(node, "test", ast.Constant(True))
    if isinstance(node, ast.Lambda):
        yield _with(node, "body", ast.Constant(False))
    if isinstance(node, ast.IfExp):
        yield node.body


def edge(node: ast.AST) -> Changed:
    """A comparison that takes or leaves its bound, or is turned round."""
    if isinstance(node, ast.Compare):
        for i, operator in enumerate(node.ops):
            ops: list[ast.cmpop] = [*node.ops]
            ops[i] = _RELAXED[type(operator)]()
            yield _with(node, "ops", ops)


def bare(node: ast.AST) -> Changed:
    """Replace a call by its argument, an operation by its operand."""
    if isinstance(node, ast.Call):
        yield from (arg for arg in node.args if not isinstance(arg, ast.Starred))
        if isinstance(node.func, ast.Attribute):
            yield node.func.value
    if isinstance(node, ast.BinOp):
        yield node.left
        yield node.right
    if isinstance(node, ast.UnaryOp):
        yield node.operand
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice):
        yield node.value


def less(node: ast.AST) -> Changed:
    """A call without one of its arguments, a list without an item, a loop without its condition."""
    if isinstance(node, ast.Call):
        for i in range(len(node.keywords)):
            yield _with(node, "keywords", node.keywords[:i] + node.keywords[i + 1 :])
        if len(node.args) > 1:
            yield _with(node, "args", node.args[:-1])
    if isinstance(node, ast.comprehension):
        for i in range(len(node.ifs)):
            yield _with(node, "ifs", node.ifs[:i] + node.ifs[i + 1 :])
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        yield from (_without(node, i) for i in range(len(node.elts)))
    if isinstance(node, ast.Slice):
        for bound in ("lower", "upper"):
            if getattr(node, bound) is not None:
                yield _with(node, bound, None)


def operator(node: ast.AST) -> Changed:
    """Another operator."""
    if isinstance(node, ast.BinOp | ast.AugAssign):
        yield _with(node, "op", _SWAPPED.get(type(node.op), ast.Add)())
    if isinstance(node, ast.BoolOp):
        yield _with(node, "op", ast.And() if isinstance(node.op, ast.Or) else ast.Or())


def order(node: ast.AST) -> Changed:
    """Two neighbours in each other's place; a loop that runs backwards."""
    if isinstance(node, ast.Call):
        for i in range(len(node.args) - 1):
            args = [*node.args]
            args[i : i + 2] = args[i + 1], args[i]
            yield _with(node, "args", args)
    if isinstance(node, ast.Tuple | ast.List):
        for i in range(len(node.elts) - 1):
            elts = [*node.elts]
            elts[i : i + 2] = elts[i + 1], elts[i]
            yield _with(node, "elts", elts)
    if isinstance(node, ast.For | ast.comprehension):
        listed = ast.Call(ast.Name("list", ast.Load()), [node.iter], [])
        yield _with(node, "iter", ast.Call(ast.Name("reversed", ast.Load()), [listed], []))


def number(node: ast.AST) -> Changed:
    """A constant that is another one."""
    if not isinstance(node, ast.Constant):
        return
    value = node.value
    if isinstance(value, bool):
        yield ast.Constant(not value)
    elif isinstance(value, int):
        yield from (ast.Constant(n) for n in (value + 1, value - 1, 2 * value, value << 20))
    elif isinstance(value, float):
        yield from (ast.Constant(other) for other in (2 * value, value / 2, value + 1))
    elif isinstance(value, bytes) and value:
        yield ast.Constant(bytes([value[0] ^ 1, *value[1:]]))
    elif isinstance(value, str) and value[:1] in ("<", ">"):
        yield ast.Constant("<>"[value[0] == "<"] + value[1:])
    elif value == "utf-8":
        yield ast.Constant("latin-1")
        yield ast.Constant("utf-8-sig")


def word(node: ast.AST) -> Changed:
    """Another of the words that the same function is given elsewhere."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
        for i, arg in enumerate(node.args):
            if isinstance(arg, ast.Constant) and isinstance(arg.value, str):
                for other in words(_name(node.func)).get(i, {}):
                    if other == arg.value:
                        continue
                    args = [*node.args]
                    args[i] = ast.Constant(other)
                    yield _with(node, "args", args)


@cache
def words(function: str) -> dict[int, dict[str, None]]:
    """The words that functions of this name are given anywhere, by the number of the argument."""
    words_by_line: dict[int, dict[str, None]] = {}
    for module in modules():
        if function not in source(module):
            continue
        for node in ast.walk(parse_module(module)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
                for i, arg in enumerate(node.args if _name(node.func) == function else ()):
                    if isinstance(arg, ast.Constant) and isinstance(arg.value, str):
                        words_by_line.setdefault(i, {})[arg.value] = None
    return words_by_line


def lenient(node: ast.AST) -> Changed:
    """Bytes that are no text, taken for text."""
    if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "decode":
        for errors in ("replace", "surrogatepass"):
            yield _with(node, "args", [*node.args, ast.Constant(errors)])


def nudge(node: ast.AST) -> Changed:
    """A value that is one more, or its negative."""
    if isinstance(node, ast.Name | ast.Attribute | ast.Subscript | ast.Call | ast.BinOp):
        if isinstance(getattr(node, "ctx", None), ast.Store | ast.Del):
            return
        yield ast.BinOp(node, ast.Add(), ast.Constant(1))
        yield ast.BinOp(node, ast.Sub(), ast.Constant(1))
        yield ast.UnaryOp(ast.USub(), node)


def negated(node: ast.AST) -> Changed:
    """A condition or truth that is the other one."""
    if isinstance(node, ast.If | ast.While | ast.IfExp):
        yield _with(node, "test", ast.UnaryOp(ast.Not(), node.test))
    if isinstance(node, ast.Return) and node.value is not None:
        yield _with(node, "value", ast.UnaryOp(ast.Not(), node.value))
        yield _with(node, "value", ast.Constant(False))
        yield _with(node, "value", ast.Constant(True))
        yield _with(node, "value", ast.Constant(None))


OPERATORS: dict[str, Callable[[ast.AST], Changed]] = {
    function.__name__: function
    for function in (
        off,
        unchecked,
        drop,
        clamped,
        out,
        refuse,
        lenient,
        word,
        on,
        edge,
        bare,
        less,
        operator,
        order,
        number,
        negated,
        nudge,
    )
}


def changes(
    targets: Iterable[Slot], operators: Iterable[str] = tuple(OPERATORS)
) -> Iterator[tuple[str, Slot, ast.AST]]:
    """(operator, slot, what stands there instead) for all that a mark means, by operator."""
    inner = [slot for target in targets for slot in _inner(target)]
    for name in operators:
        if name == "off":
            yield from ((name, target, node) for target in targets for node in _neutral(target))
        for slot in inner:
            for node in OPERATORS[name](slot.node):
                yield name, slot, node


def _neutral(slot: Slot) -> Changed:
    """An operand of a chain of conditions that is of no account."""
    if isinstance(slot.holder, ast.BoolOp):
        yield ast.Constant(isinstance(slot.holder.op, ast.And))


def _inner(slot: Slot) -> Iterator[Slot]:
    """``slot`` and the slots below it in which a change can say something."""
    node = slot.node
    yield slot
    if isinstance(node, ast.Raise):
        if isinstance(node.exc, ast.Call):
            yield Slot(node.exc, "func", None)
        return
    for child in slots(node):
        if child.field in ("annotation", "returns", "decorator_list", "orelse", "ctx") and not (
            isinstance(node, ast.IfExp) and child.field == "orelse"
        ):
            continue
        if isinstance(child.node, ast.JoinedStr) or _is_words(child.node):
            continue
        if isinstance(node, _BLOCKS) and child.field == "body" and not _is_step(node, child.node):
            continue
        yield from _inner(child)


_BLOCKS = (ast.If, ast.For, ast.While, ast.With)
_SIMPLE = (ast.Expr, ast.Raise, ast.Assign, ast.AugAssign, ast.Return, ast.Continue, ast.Break)


def _is_step(block: ast.If | ast.For | ast.While | ast.With, node: ast.AST) -> bool:
    """True if ``node`` is one of the few simple statements of a block."""
    return len(block.body) <= 3 and isinstance(node, _SIMPLE)


def _is_words(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _with(node: ast.AST, field: str, value: object) -> ast.AST:
    """A shallow copy of ``node`` with another ``field``."""
    fields = dict(ast.iter_fields(node)) | {field: value}
    return type(node)(**fields)


def _without(node: ast.Tuple | ast.List | ast.Set, index: int) -> ast.AST:
    return _with(node, "elts", node.elts[:index] + node.elts[index + 1 :])


def _name(function: ast.Name | ast.Attribute) -> str:
    return function.id if isinstance(function, ast.Name) else function.attr


def _attribute(node: ast.expr, name: str) -> ast.Attribute:
    return ast.Attribute(node, name, ast.Load())
