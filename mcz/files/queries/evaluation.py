"""A tree as a function that is asked of one clip after the other.

Logic is that of SQL: ``not`` of what is unknown is unknown; ``and`` is false where a part is false,
``or`` true where one is true, and otherwise unknown where a part is. Parts are asked from left to
right, and no more of them than it takes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fnmatch import translate

from mcz.files.queries.tree import (
    And,
    Compare,
    In,
    Like,
    Literal,
    Missing,
    Name,
    Node,
    Not,
    Operand,
    Or,
)
from mcz.files.queries.values import Lookup, Value, compared

Test = Callable[[Lookup], bool | None]  # None: unknown


def truth_of(node: Node) -> Test:
    """Compile ``node`` to a test of a lookup."""
    match node:
        case Compare(left, sign, right):
            return _comparison(_value_of(left), sign, _value_of(right))
        case In(operand, literals):
            value = _value_of(operand)
            return _any_of([_comparison(value, "==", _value_of(each)) for each in literals])
        case Like(operand, pattern):
            return _likeness(_value_of(operand), pattern)
        case Missing(Name(name)):
            return lambda lookup: lookup(name) is None
        case Not(part):
            return _opposite(truth_of(part))
        case And(parts):
            return _all_of([truth_of(part) for part in parts])
        case Or(parts):
            return _any_of([truth_of(part) for part in parts])


def _value_of(operand: Operand) -> Callable[[Lookup], Value]:
    if isinstance(operand, Literal):
        value = operand.value
        return lambda lookup: value
    name = operand.name
    return lambda lookup: lookup(name)


def _comparison(
    left: Callable[[Lookup], Value], sign: str, right: Callable[[Lookup], Value]
) -> Test:
    return lambda lookup: compared(left(lookup), sign, right(lookup))


def _likeness(value: Callable[[Lookup], Value], pattern: str) -> Test:
    matches = re.compile(translate(pattern)).match

    def test(lookup: Lookup) -> bool | None:
        text = value(lookup)
        return matches(text) is not None if isinstance(text, str) else None

    return test


def _opposite(part: Test) -> Test:
    def test(lookup: Lookup) -> bool | None:
        found = part(lookup)
        return None if found is None else not found

    return test


def _all_of(parts: Sequence[Test]) -> Test:
    return _until(False, parts)


def _any_of(parts: Sequence[Test]) -> Test:
    return _until(True, parts)


def _until(decisive: bool, parts: Sequence[Test]) -> Test:
    """The first part that is ``decisive``; without one unknown where a part is, or its opposite."""

    def test(lookup: Lookup) -> bool | None:
        result: bool | None = not decisive
        for part in parts:
            found = part(lookup)
            if found is decisive:
                return decisive
            if found is None:
                result = None
        return result

    return test
