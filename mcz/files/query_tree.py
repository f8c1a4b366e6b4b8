"""Trees of queries: their values, their text, and their evaluation for one clip after the other.

A comparison is true, false, or None if unknown: a value may be missing. Logic is as in SQL: ``not``
of unknown is unknown; ``and`` is false if a part is false, ``or`` true if one is true, and
otherwise unknown if a part is. Parts are evaluated from left to right, and only as many as needed.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import translate
from math import isfinite
from typing import Any

Value = str | bool | int | float | None  # None: missing
Lookup = Callable[[str], Value]  # the value of a name

NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
LONGEST_NUMBER = 100  # characters; Python refuses to read integers of some thousand digits
_NUMBER = re.compile(NUMBER)

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def as_number(text: str) -> int | float | None:
    """The number that ``text`` reads as, None if it is not a finite number.

    >>> as_number("05"), as_number("-2.50"), as_number("1e3"), as_number("5 cm")
    (5, -2.5, 1000.0, None)
    """
    if len(text) > LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    if text.lstrip("+-").isdigit():
        return int(text)
    number = float(text)
    return number if isfinite(number) else None


def compare(left: Value, sign: str, right: Value) -> bool | None:
    """Compare ``left`` and ``right`` by a sign of ``COMPARISONS``; None: unknown.

    >>> compare("05", "==", 5), compare("05", "==", "5"), compare("a", "<", 5)
    (True, False, None)
    """
    if left is None or right is None:
        return None
    if isinstance(left, bool) or isinstance(right, bool):
        same_kind = isinstance(left, bool) and isinstance(right, bool)
        return COMPARISONS[sign](left, right) if same_kind and is_equality(sign) else None
    if isinstance(left, str) != isinstance(right, str):
        left, right = _number(left), _number(right)
        if left is None or right is None:  # a text that is not a number
            return sign == "!=" if is_equality(sign) else None
    return COMPARISONS[sign](left, right)


def is_equality(sign: str) -> bool:
    return sign in ("==", "!=")


def _number(value: str | int | float) -> int | float | None:
    return as_number(value) if isinstance(value, str) else value


Test = Callable[[Lookup], bool | None]  # None: unknown


def truth_of(node: Node) -> Test:
    """Compile ``node`` to a test of a lookup."""
    match node:
        case Compare(left, sign, right):
            return _comparison(_value_of(left), sign, _value_of(right))
        case In(operand, literals):
            value = _value_of(operand)
            return _first_decisive(
                True, [_comparison(value, "==", _value_of(each)) for each in literals]
            )
        case Like(operand, pattern):
            return _like_pattern(_value_of(operand), pattern)
        case Missing(Name(name)):
            return lambda lookup: lookup(name) is None
        case Not(part):
            return _opposite(truth_of(part))
        case And(parts):
            return _first_decisive(False, [truth_of(part) for part in parts])
        case Or(parts):
            return _first_decisive(True, [truth_of(part) for part in parts])


def _value_of(operand: Operand) -> Callable[[Lookup], Value]:
    if isinstance(operand, Literal):
        value = operand.value
        return lambda lookup: value
    name = operand.name
    return lambda lookup: lookup(name)


def _comparison(
    left: Callable[[Lookup], Value], sign: str, right: Callable[[Lookup], Value]
) -> Test:
    return lambda lookup: compare(left(lookup), sign, right(lookup))


def _like_pattern(value: Callable[[Lookup], Value], pattern: str) -> Test:
    matches = re.compile(translate(pattern)).match

    def test(lookup: Lookup) -> bool | None:
        text = value(lookup)
        return matches(text) is not None if isinstance(text, str) else None

    return test


def _opposite(part: Test) -> Test:
    def test(lookup: Lookup) -> bool | None:
        result = part(lookup)
        return None if result is None else not result

    return test


def _first_decisive(decisive: bool, parts: Sequence[Test]) -> Test:
    """The first part that is ``decisive``; otherwise unknown if a part is, or its opposite."""

    def test(lookup: Lookup) -> bool | None:
        result: bool | None = not decisive
        for part in parts:
            answer = part(lookup)
            if answer is decisive:
                return decisive
            if answer is None:
                result = None
        return result

    return test


@dataclass(frozen=True, slots=True)
class Name:
    name: str


@dataclass(frozen=True, slots=True)
class Literal:
    value: str | bool | int | float


Operand = Name | Literal


@dataclass(frozen=True, slots=True)
class Compare:
    """``left sign right``; the sign is one of ``values.COMPARISONS``."""

    left: Operand
    sign: str
    right: Operand


@dataclass(frozen=True, slots=True)
class In:
    """``operand in (a, b)``, with at least one literal."""

    operand: Operand
    literals: tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class Like:
    """``operand like 'pattern'``."""

    operand: Operand
    pattern: str


@dataclass(frozen=True, slots=True)
class Missing:
    """``name is missing``."""

    name: Name


@dataclass(frozen=True, slots=True)
class Not:
    part: Node


@dataclass(frozen=True, slots=True)
class And:
    """Two parts or more."""

    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Two parts or more."""

    parts: tuple[Node, ...]


Node = Compare | In | Like | Missing | Not | And | Or


def names_in(node: Node | Operand) -> Iterator[str]:
    """Every name, with repetitions, from left to right."""
    match node:
        case Name(name):
            yield name
        case Compare(left, _, right):
            yield from names_in(left)
            yield from names_in(right)
        case In(operand, _) | Like(operand, _) | Missing(operand) | Not(operand):
            yield from names_in(operand)
        case And(parts) | Or(parts):
            for part in parts:
                yield from names_in(part)


def print_query(node: Node | Operand) -> str:
    """The text that the parser turns into this tree.

    >>> print_query(Not(And((Missing(Name("subject")), Like(Name("name"), "it's *")))))
    "not (subject is missing and name like 'it\\\\'s *')"
    """
    match node:
        case Name(name):
            return name
        case Literal(value):
            return _literal(value)
        case Compare(left, sign, right):
            return f"{print_query(left)} {sign} {print_query(right)}"
        case In(operand, literals):
            return f"{print_query(operand)} in ({', '.join(map(print_query, literals))})"
        case Like(operand, pattern):
            return f"{print_query(operand)} like {_literal(pattern)}"
        case Missing(operand):
            return f"{print_query(operand)} is missing"
        case Not(part):
            return f"not {_operand_text(part)}"
        case And(parts):
            return " and ".join(map(_operand_text, parts))
        case Or(parts):
            return " or ".join(
                print_query(p) if isinstance(p, And) else _operand_text(p) for p in parts
            )


def _operand_text(part: Node) -> str:
    """An operand of ``and``, ``or`` or ``not``."""
    return f"({print_query(part)})" if isinstance(part, And | Or) else print_query(part)


def _literal(value: str | bool | int | float) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return "'" + re.sub(r"(['\\])", r"\\\1", value) + "'"
    return repr(value)
