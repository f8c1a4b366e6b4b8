"""Trees of queries, and their text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass


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
    """``operand in (a, b)``, of at least one literal."""

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
    """Every name, as often as it occurs, from left to right."""
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


def printed(node: Node | Operand) -> str:
    """The text of which the parser makes this tree.

    >>> printed(Not(And((Missing(Name("subject")), Like(Name("name"), "it's *")))))
    "not (subject is missing and name like 'it\\\\'s *')"
    """
    match node:
        case Name(name):
            return name
        case Literal(value):
            return _literal(value)
        case Compare(left, sign, right):
            return f"{printed(left)} {sign} {printed(right)}"
        case In(operand, literals):
            return f"{printed(operand)} in ({', '.join(map(printed, literals))})"
        case Like(operand, pattern):
            return f"{printed(operand)} like {_literal(pattern)}"
        case Missing(operand):
            return f"{printed(operand)} is missing"
        case Not(part):
            return f"not {_bound(part)}"
        case And(parts):
            return " and ".join(map(_bound, parts))
        case Or(parts):
            return " or ".join(printed(p) if isinstance(p, And) else _bound(p) for p in parts)


def _bound(part: Node) -> str:
    """A part that stands beside ``and``, ``or`` or ``not``."""
    return f"({printed(part)})" if isinstance(part, And | Or) else printed(part)


def _literal(value: str | bool | int | float) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return "'" + re.sub(r"(['\\])", r"\\\1", value) + "'"
    return repr(value)
